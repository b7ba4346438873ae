"""Notes: dangers first, each said once and only where it holds."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.analysis.attractors import Starts
from tpd.analysis.paired import Verdict
from tpd.design.result import DesignStatus
from tpd.design.study import Study
from tpd.report.blocks import Severity
from tpd.report.notes import notes, strikes, thick

LIGHT = dataclasses.replace(designs.HUNG, mass=0.5)
NONE = Study()


def texts(design, study=NONE, severity=None) -> list[str]:
    return [n.text for n in notes(design, study) if severity in (None, n.severity)]


def only(design, study=NONE, *, about: str):
    """The one note that holds these words."""
    (found,) = (n for n in notes(design, study) if about in n.text)
    return found


def with_winner(base=designs.single, **changes):
    design = base()
    winner = dataclasses.replace(design.winner, **changes)
    return dataclasses.replace(design, verified=(*design.verified[:-1], winner))


def test_dangers_come_before_warnings_and_these_before_information():
    order = [n.severity.value for n in notes(designs.band(), designs.study())]
    assert order == sorted(order)
    assert set(order) == {s.value for s in Severity}


def strike_notes(pendulum=LIGHT, **changes):
    exact = designs.motions(0.04, changes.pop("stroke"), **changes)
    design = with_winner(exact=exact, paired=None)
    return [t for t in texts(dataclasses.replace(design, pendulum=pendulum)) if "STRIKE" in t]


def test_a_bob_that_would_strike_the_walls_is_a_danger_with_a_remedy():
    """Half width 0.05 m, length 0.12 m; a ball of 0.5 kg has a radius of 0.0248 m: 0.2118 rad are left."""
    ball = (0.5 / 7850.0 * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    most = np.arcsin((0.05 - ball) / 0.12)

    def peaks(swing):
        return {"peak": np.array([0.06]), "peak_stroke": np.array([swing])}

    # The bob's angle and the block's tilt together: 0.04 rad settled, 0.06 rad on the way.
    assert strike_notes(stroke=most - 0.04 - 1e-6, **peaks(most - 0.06 - 1e-6)) == []
    (text,) = strike_notes(stroke=0.1, **peaks(most - 0.06 + 1e-6))
    start = "On the way from rest the bob, as a solid ball of steel, would reach 0.05 m from the block's axis"
    assert text.startswith(start)
    assert f"up to {np.floor(1e3 * most) / 1e3:g} rad between rod and block" in text
    assert "Without `--exactly` the search asks for room" in text
    (text,) = strike_notes(stroke=0.46, **peaks(0.6))
    # 0.12 m times sin(0.5), and the radius.
    assert text.startswith("Once settled the bob, as a solid ball of steel, would reach 0.0823 m")


def test_a_ball_wider_than_the_block_fits_at_no_angle():
    heavy = dataclasses.replace(designs.HUNG, mass=16.0)
    (note,) = strikes(designs.SCENE.block, heavy, {"settled": 0.0})
    assert note.severity is Severity.danger
    assert "keeps off them at no angle" in note.text


def test_with_room_the_body_of_the_bob_and_its_share_of_strikes_are_said():
    """A ball of 1.6224 kg of steel has a diameter of 0.0734 m."""
    design = designs.around()
    winner = dataclasses.replace(design.winner, strikes=0.005)
    text = only(dataclasses.replace(design, verified=(winner,)), about="strikes none").text
    assert text == (
        "The bob as a solid ball of steel is 0.0734 m wide and 0.0734 m high. Between walls 0.1 m apart it "
        "strikes none in 99.5% of the paired runs that stand (99.0% are asked for)."
    )
    assert not any("STRIKE" in t for t in texts(design))


def test_walls_are_watched_in_the_ensemble_too():
    """Half of the runs reach 0.1 rad of bob and block each, 0.2 rad together: 0.0238 m."""
    quiet = designs.motions(0.01, 0.01)
    runs = designs.paired(tilt=0.1)
    design = with_winner(exact=quiet, paired=runs)
    design = dataclasses.replace(design, pendulum=dataclasses.replace(LIGHT, mass=0.6))
    text = only(design, about="STRIKE").text
    # 0.12 m times sin(0.2), and the radius of 0.0263 m.
    assert text.startswith(
        "In half of the ensemble's runs the bob, as a solid ball of steel, would reach 0.0502"
    )
    lost = Verdict(hung=designs.outcomes(30), bare=designs.outcomes(30))
    design = dataclasses.replace(with_winner(exact=quiet, paired=lost), pendulum=design.pendulum)
    assert not any("STRIKE" in t for t in texts(design))


def test_over_conditions_the_search_may_know_larger_angles_than_the_start_from_rest():
    quiet = designs.motions(np.full(8, 0.01), 0.01)
    design = dataclasses.replace(with_winner(designs.band, exact=quiet, paired=None), pendulum=LIGHT)
    assert (
        "Once settled the bob, as a solid ball of steel, would reach 0.0849 m"
        in only(design, about="STRIKE").text
    )
    # Of a search over starts at rest the exact solution has the last word.
    assert not any("STRIKE" in t for t in texts(dataclasses.replace(design, starts=Starts.rest())))


def test_a_ball_that_is_no_point_is_said():
    """0.1 kg on 0.25 m: the ball's own share is 0.4 (0.01449/0.25)^2 = 0.13 %, without effect."""
    assert thick(tpd.Pendulum(mass=0.1, length=0.25, damping_ratio=0.1)) == []
    (note,) = thick(designs.HUNG)
    # 0.4 (0.03668/0.12)^2
    assert "a moment of inertia of its own, 3.7% of the point's" in note.text
    assert note.severity is Severity.warning
    assert note.text.endswith("frequency by -1.8%; a rod 3.9% shorter makes up for it.")


def test_overturning_from_rest_is_counted_and_a_danger_where_the_bare_block_stands():
    status = np.array(["overturned", "overturned", *["rocking"] * 6])
    exact = designs.motions(np.full(8, 0.05), 0.3, status)
    design = with_winner(designs.band, exact=exact)
    note = only(design, about="OVERTURNS")
    assert note.severity is Severity.danger
    said = "under 1 of 8 conditions that it stands without, and saves it under 0. The first: "
    assert f"{said}{design.conditions.label(1)}." in note.text
    assert (
        "under 2 of 8 conditions with the pendulum and 1 without" in only(design, about="From rest the").text
    )


@pytest.mark.parametrize(("peak", "near"), [(0.17, False), (0.18, True), (np.nan, False)])
def test_coming_near_toppling_on_the_way_is_a_danger(peak, near):
    exact = designs.motions(0.04, peak=np.array([peak]))
    said = texts(with_winner(exact=exact), severity=Severity.danger)
    assert any("near the tilt at which it topples" in t for t in said) is near


@pytest.mark.parametrize(("worse", "better", "fewer"), [(0, 0, False), (3, 5, False), (0, 19, True)])
def test_that_it_overturns_less_is_shown_by_significantly_fewer_runs(worse, better, fewer):
    size, order = 40, np.arange(40)
    hung, bare = designs.outcomes(worse), designs.outcomes(0)
    late = np.where(order >= size - better, "overturned", "rocking")
    verdict = Verdict(hung=hung, bare=dataclasses.replace(bare, status=late))
    assert (verdict.worse, verdict.better) == (worse, better)
    said = any("Nothing shows that the block overturns less" in t for t in texts(with_winner(paired=verdict)))
    assert said is not fewer


def test_an_ensemble_in_which_the_pendulum_harms_is_a_danger():
    worse = Verdict(hung=designs.outcomes(20), bare=designs.outcomes(2))
    note = only(with_winner(paired=worse), about="More runs overturn")
    assert note.severity is Severity.danger
    assert "18 runs overturn with the pendulum only and 0 without it only" in note.text
    assert "Would chance alone do this? Hardly: p = 3.8e-06." in note.text
    assert not any("More runs overturn" in t for t in texts(designs.single()))


def test_the_runs_that_decide_are_those_of_the_nonlinear_equations():
    design = with_winner(paired=designs.paired(lost=20, lost_bare=2))
    assert any("Nothing shows that the block overturns less" in t for t in texts(design))
    said = only(design, about="runs of the nonlinear equations").text
    assert said.startswith("Of 40 runs of the nonlinear equations 50.0% (")


def test_overturnings_from_rest_are_counted_and_more_of_them_are_a_danger():
    rest = designs.survey("nonlinear", 8).at(np.array([0]))
    severity = np.array([[1.0, 1.0, *[0.3] * 6]])
    both = with_winner(designs.band, rest=dataclasses.replace(rest, severity=severity, bare=severity[0]))
    note = only(both, about="of 8 conditions: 2 overturn the block with the pendulum, 2 without")
    assert note.severity is Severity.warning
    more = with_winner(designs.band, rest=dataclasses.replace(rest, severity=severity))
    assert only(more, about="2 overturn the block with the pendulum, 0 without").severity is Severity.danger
    assert "from rest, of" not in str(notes(with_winner(designs.band, rest=rest), designs.study()))


NEAR = tuple(2.5 * (1.0 + 0.004 * np.arange(6, 13)))
"""Frequencies (Hz) from 2.4 to 4.8 % above the design's, 0.4 % apart, as of a response."""


@pytest.mark.mends("a block that rocks more was a danger")
def test_frequencies_that_are_worse_are_said_with_their_neighbours():
    bare = designs.response(*[0.01] * 7, frequency=NEAR)

    def note(*hung):
        study = Study(responses=(bare, designs.response(*hung, frequency=NEAR)))
        return only(designs.single(), study, about="rocks more")

    mild, grave = (note(0.01, 0.01, 0.01, 0.015, 0.015, 0.01, x) for x in (0.019, 0.021))
    # The block stands: dangers are overturning and strikes.
    assert (mild.severity, grave.severity) == (Severity.warning, Severity.warning)
    # 2.59 Hz is the nearest; within 1 % are those from 2.57 to 2.61 Hz.
    assert mild.text == (
        "At 2 of 5 frequencies within 1 % of 2.59 Hz the block rocks more with this pendulum than without, "
        "at that frequency 0.015 rad in place of 0.01 rad."
    )
    assert grave.text.startswith("At 2 of 3 frequencies within 1 % of 2.62 Hz")


@pytest.mark.mends("one overturning more than without the pendulum was no danger")
def test_more_overturnings_among_neighbours_than_without_are_a_danger():
    def note(*lost, bare=()):
        status = [["overturned" if i in some else "rocking" for i in range(7)] for some in (bare, lost)]
        sizes = ([0.02] * 7, [0.01] * 7)
        pair = tuple(
            designs.response(*x, frequency=NEAR, status=s) for x, s in zip(sizes, status, strict=True)
        )
        return only(designs.single(), Study(responses=pair), about="OVERTURN the block")

    one, several = note(3), note(3, 4, 5)
    assert (one.severity, several.severity) == (Severity.danger, Severity.danger)
    assert note(3, bare=(4,)).severity is Severity.warning, "as many without"
    start = "frequencies within 1 % of 2.59 Hz, same base amplitude, from rest,"
    assert one.text.startswith(f"Of 5 {start} 1 OVERTURN the block with this pendulum and 0 without")
    assert several.text.startswith(f"Of 5 {start} 3 OVERTURN the block with this pendulum and 0 without")


@pytest.mark.mends("strikes in most of the runs were information where a job allows them")
def test_strikes_are_a_danger_whatever_a_job_allows():
    for share, severity in ((0.62, Severity.danger), (0.005, Severity.information)):
        design = dataclasses.replace(designs.around(), worth=tpd.limits.Worth(strikes=0.9, runs=40))
        winner = dataclasses.replace(design.winner, strikes=share)
        note = only(dataclasses.replace(design, verified=(winner,)), about="strikes none")
        assert note.severity is severity


def test_where_frequencies_are_far_apart_more_distant_neighbours_count():
    hung = designs.response(0.01, 0.01, np.inf, status=["rocking", "rocking", "overturned"])
    study = Study(responses=(designs.response(0.02, 0.02, 0.02), hung))
    note = only(designs.single(), study, about="OVERTURN the block")
    assert note.text.startswith("Of 3 frequencies within 10 % of 2.6 Hz, same base amplitude, from rest, 1 ")
    assert note.severity is Severity.danger
    count = "Of 3 frequencies tried from 2.4 to 2.6 Hz, 1 overturn the block with the pendulum and 0 without."
    assert count in texts(designs.single(), study)
    assert not any("Hz" in t for t in texts(designs.single(), Study(responses=study.responses[:1])))


def test_the_edges_of_the_settled_motion_are_said():
    exact = designs.motions(0.04, 0.35, multiplier=np.array([0.97]))
    said = texts(with_winner(exact=exact, margin=np.array([0.1])), severity=Severity.warning)
    assert "A stroke of 0.35 rad stretches the linear equations of the pendulum." in said
    assert "The motion attracts slowly (Floquet multiplier 0.970)." in said
    assert "The block could rest under this pendulum, but a start from rest ends in rocking." in said
    rest = designs.motions(0.0, 0.2, "rest")
    assert (
        "keeps 10.0% of the moment"
        in only(with_winner(exact=rest, margin=np.array([0.1])), about="The resting").text
    )


def test_whose_tilts_they_are_is_said_for_every_kind_of_start():
    said = {
        "rest wherever it holds": Starts.rest(),
        "whichever start leads to it": Starts.any(),
    }
    for words, starts in said.items():
        assert words in only(designs.single(starts=starts), about="Tilts are").text


def test_conditions_without_a_motion_that_attracts_are_counted():
    kind = np.full((1, 8), 3)
    none = with_winner(designs.band, evaluation=designs.evaluation(np.full(8, 0.1), 0.3, kind=kind))
    assert "Under 8 of 8 conditions no symmetric motion attracts" in " ".join(texts(none))


def test_a_pendulum_whose_settled_tilt_is_larger_is_said():
    said = "The worst settled tilt, which the searches make small, is larger with this pendulum"
    assert not any(said in t for t in texts(designs.single()))
    (note,) = [n for n in notes(with_winner(value=0.4), Study()) if said in n.text]
    assert note.severity is Severity.warning


def test_interruptions_are_said():
    cut = designs.single(status=DesignStatus.interrupted, pendulum=None)
    assert "The search was interrupted; nothing below is the best of the design space." in texts(cut)
    said = texts(designs.single(), Study(left_out=("the time histories",)))
    assert "This report goes without the time histories: its computation was interrupted." in said
