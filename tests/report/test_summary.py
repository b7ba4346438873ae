"""Summary of a design: verdict, dangers, pendulum, one comparison, what limits it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.designs import paired
from tests.report.conftest import details, flat, ground, harmonic, rejected, tuned
from tpd.answers.statistics import Interval
from tpd.design.as_built import Details, build_of
from tpd.design.assess import alternatives
from tpd.design.reasons import reduction
from tpd.design.variations import EquivalentWidening
from tpd.report.answer import answer
from tpd.report.summary import at_levels, depends_on, if_a_part_fails, overview, rows_of, summary, verdict
from tpd.report.words import percent, wider


def test_the_verdict_states_the_benefit_of_the_validation_runs():
    design, said = harmonic(), verdict(harmonic()).text
    lacking = (
        "NOT TO BE BUILT AS IT IS for a harmonic of 2.38 to 2.62 Hz and up to 0.0165 m, because the search "
    )
    assert said == f"{lacking}assumed a bob without size and no walls. This is not a safety assessment."
    said = design.result
    assert said.startswith(f"In {design.runs.pairs} paired runs: with the pendulum ")
    tilt, share = (
        f"he pendulum reduces the {of} by {100 * x.mean:.0f} % (95 % interval {100 * x.low:.0f} to "
        f"{100 * x.high:.0f} %)"
        for of, x in (
            ("mean tilt", design.benefit),
            ("share of runs that overturn", design.overturning_reduction),
        )
    )
    median = design.runs.change("median tilt")
    counts = f"the median is {percent(median.with_pendulum)} ({percent(median.without_pendulum)} without it)."
    # What was required comes first.
    assert said.index(share) < said.index(tilt) < said.index(counts)
    tilted = replace(design, validated=(replace(design.best, measure="tilt"),))
    assert tilted.result.index(tilt) < tilted.result.index(share)
    no_benefit = replace(design.runs, with_pendulum=design.runs.without_pendulum)
    # A dependence needs a significant difference: fewer runs alone are none.
    for high, is_claimed in ((-0.1, True), (0.1, False)):
        (case, *_) = details().of("losses")
        case = case._replace(runs=no_benefit, difference=Interval(-0.4, -0.6, high))
        said = verdict(design, replace(details(), variations=(case,))).text
        assert ("THE BENEFIT DEPENDS ON THE ENERGY LOSSES: with losses by impacts only" in said) is is_claimed
        assert ("smaller by 40 points (95 % interval 10 to 60) than" in said) is is_claimed
    assert "-0" not in reduction(no_benefit, "overturning")
    more = reduction(paired([np.inf] * 40 + [0.1] * 160, [np.inf] * 20 + [0.1] * 180), "tilt")
    assert more.startswith(
        "with the pendulum 20.0 % of the runs still overturn (10.0 % without it). The pend"
    )
    assert "share of runs that overturn by 100 % (95 % interval " in more


@pytest.mark.parametrize("make", [ground, tuned])
def test_a_verdict_about_few_earthquakes_comes_first_and_has_the_shares_of_the_same_runs(make):
    design = make()
    few = "TOO FEW EARTHQUAKES to validate a pendulum: at least 5 earthquakes are needed, and"
    said = verdict(design).text
    assert said.startswith(few if make is ground else "TUNED TO THESE MOTIONS ONLY: ")
    assert flat(answer(design)).startswith(said[:20])
    share = design.runs.change("overturned")
    assert f"In {design.runs.pairs} paired runs of these motions: with the pendulum " in said
    assert f"({100.0 * share.without_pendulum:.1f} % without it)" in said
    falls = paired([np.inf] * 4 + [0.1] * 6, [np.inf] * 8 + [0.1] * 2)
    other = replace(design, validated=(replace(design.validated[-1], reported_runs=falls),))
    assert "with the pendulum 40.0 % of the runs still overturn (80.0 % without it)." in verdict(other).text


@pytest.mark.parametrize(
    ("overturned", "first"),
    [
        ((0, 0), "no run overturns, with the pendulum or without it. The pendulum reduces the mean tilt by "),
        (
            (4, 8),
            "with the pendulum 1.0 % of the runs still overturn (2.0 % without it). The pendulum reduces the "
            "share of runs that overturn by 50 % (95 % interval -24 to 90 %), which is not significant. The "
            "pendulum reduces the mean tilt by ",
        ),
        (
            (4, 80),
            "with the pendulum 1.0 % of the runs still overturn (20.0 % without it). The pendulum reduces "
            "the share of runs that overturn by 95 % (95 % interval ",
        ),
    ],
)
def test_the_verdict_begins_with_overturning_if_it_occurs_in_one_per_cent_of_the_runs(overturned, first):
    run = np.arange(400)
    tilts = (np.where(run < n, np.inf, tilt) for n, tilt in zip(overturned, (0.2, 0.4), strict=True))
    runs = paired(*tilts)
    assert reduction(runs, runs.first_measure).startswith(first)


def test_the_overview_has_all_runs_and_each_start():
    runs, table = harmonic().runs, overview(harmonic(), harmonic().runs)
    assert table.caption.startswith(runs.description)
    fell = runs.change("overturned")
    row = next(row for row in table.rows if row[0] == "runs that overturn")
    assert row[1:3] == (percent(fell.without_pendulum, 1), percent(fell.with_pendulum, 1))
    less = runs.overturning_reduction
    assert row[3].startswith(f"{100 * less.mean:.0f} % fewer (95 % interval {100 * less.low:.0f} to ")
    starts = {row[0].strip(): row[1:3] for row in table.rows if row[0].startswith("  ")}
    for kind, rows in runs.with_pendulum.starts.items():
        cases = runs.without_pendulum.of(rows), runs.with_pendulum.of(rows)
        assert starts[kind] == tuple(percent(case.share_overturned.value, 1) for case in cases)
    same = replace(harmonic().runs, with_pendulum=harmonic().runs.without_pendulum)
    assert "-0" not in str(overview(harmonic(), same).rows)


def test_the_summary_describes_the_pendulum_as_built():
    near = np.asarray(harmonic().nearest)
    design = replace(harmonic(), equivalent=np.stack([0.8 * near, 1.2 * near]))
    build, said = build_of(design), flat(answer(design, details(), most=1000))
    ball = f"bob {build.mass:.3g} kg, a solid ball of steel, {build.bob_width:.3g} m wide (as a point "
    assert f"{ball}{design.pendulum.mass:.3g} kg on a rod of" in said
    assert f"the bob's centre: {build.frequency:.3g} Hz, {1 / build.frequency:.3g} s" in said
    low, high = (f"{0.01 * share * near[0] * 16.224:.2g}" for share in (80.0, 120.0))
    assert f"depends on {depends_on(details(), f'{low} to {high} kg')}" in said
    assert f"part fails {if_a_part_fails(details())}" in said
    assert f"breakaway moment at most {build.breakaway:.2g} N m" in said
    # Without walls in the search no distance to a wall is reported as if it were kept.
    assert "the wall is at" not in said


def test_every_summary_compares_the_pendulum_with_wider_bases():
    said = flat(answer(harmonic(), details(), most=1000))
    assert f"wider block {wider(details().equivalent_widening)} has the same effect" in said
    assert f"no pendulum {alternatives(harmonic().problem).brief}" in said
    # Without a pendulum that is offered the bases remain.
    said = flat(answer(rejected(), details("rejected"), most=1000))
    assert "wider block overturned in the same runs: " in said
    assert "% (base 20 % wider, " in said
    assert said.count("no pendulum a top tie") == 1


@pytest.mark.parametrize(
    ("worth", "words"),
    [
        ((0.07, 0.05, 0.09), "7 % wider (95 % interval 5 to 9 %)"),
        ((0.001, 0.0, 0.04), "less than 1 % wider (95 % interval less than 1 to 4 %)"),
        ((0.18, 0.1, np.inf), "18 % wider (95 % interval 10 to more than 20 %)"),
        ((np.inf, np.inf, np.inf), "more than 20 % wider"),
        ((0.1, 0.1, 0.1), "10 % wider"),
    ],
)
def test_an_unbounded_widening_is_described_by_its_bounds(worth, words):
    assert wider(EquivalentWidening(*worth, 0.2, "tilt")) == words


def test_the_summary_has_a_row_for_each_level_and_for_friction():
    design = replace(ground(), validated=(ground().searched,))
    said = " ".join(f"{name} {text}" for name, text in rows_of(design, Details()))
    assert design.runs.counted is not None
    head = "level PGA over g tan(alpha): share of 1 runs that overturn with (without) the pendulum"
    assert head in said
    for i, name in enumerate(design.problem.levels):
        rows = np.flatnonzero(design.runs.counted)[i::16]
        cases = (design.runs.with_pendulum.of(rows), design.runs.without_pendulum.of(rows))
        pendulum, without = (f"{100.0 * case.share_overturned.value:.1f} %" for case in cases)
        assert f"level {name}: {pendulum} ({without})" in said
    assert f"friction {design.sliding.sentence}" in said
    assert "While the block rocks from rest, the base needs a coefficient of friction of" in str(
        design.sliding
    )
    assert not [*at_levels(harmonic().problem, harmonic().runs)]


def test_sliding_during_rocking_is_a_danger():
    design = harmonic()
    block = replace(design.scene.block, base_friction=0.31)
    slides = replace(design, problem=replace(design.problem, scene=replace(design.scene, block=block)))
    sentence = slides.sliding.sentence
    assert sentence.startswith("SLIDES WHILE IT ROCKS: the base needs a coefficient of friction of ")
    assert sentence in [n.text for n in summary(slides, Details()).dangers]
    assert "friction" not in [name for name, _ in rows_of(slides, Details())]


def test_the_row_on_variations_has_the_two_that_reduce_the_benefit_most():
    stated, *_ = details().variations
    changes = {"stiff": (-0.1, -0.2, -0.05), "weak": (-0.3, -0.4, -0.2), "calm": (-0.4, -0.9, 0.1)}
    kind = "quantity"
    rows = [stated._replace(kind=kind, words=name, difference=Interval(*x)) for name, x in changes.items()]
    said = depends_on(Details(variations=(stated, *rows)))
    assert said == "weak: 30 points less; stiff: 10 points less"
    said = depends_on(Details(variations=(stated, rows[2])))
    assert said == "nothing varied reduces the benefit significantly"
    assert depends_on(Details(variations=(stated,))) == ""


def test_the_row_on_failures_compares_each_with_no_pendulum():
    row = details().of("failure")[0]
    of = lambda n, words, measure="overturning": row._replace(  # noqa: E731
        runs=paired([np.inf] * n + [0.1] * (40 - n), [np.inf] * 10 + [0.4] * 30), words=words, measure=measure
    )
    said = if_a_part_fails(Details(variations=(of(30, "hinge stuck"), of(0, "damper lost"), of(11, "other"))))
    assert said == (
        "overturned: hinge stuck, 75.0 % (more); damper lost, 0.0 % (fewer); "
        "other, 27.5 % (no significant difference); without a pendulum 25.0 %"
    )
    assert if_a_part_fails(Details(variations=(of(30, "hinge stuck", "tilt"),))).startswith(
        "mean tilt: hinge"
    )
    assert if_a_part_fails(Details()) == ""
