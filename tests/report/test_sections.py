"""Sections of a report: runs, losses, limits, motions, search and rejected designs."""

import dataclasses

import numpy as np
import pytest

from tests.report.conftest import DESIGNS, LITTLE, STRIKES, against, details, ground, harmonic, rejected
from tpd.design.as_built import Details
from tpd.design.reasons import DesignStatus
from tpd.report import sections, words
from tpd.report.blocks import Table
from tpd.scene.hazard import HOW_TO


def rows(table) -> dict:
    assert isinstance(table, Table)
    return {row[0]: row[1:] for row in table.rows}


def test_validation_runs_are_listed_with_intervals():
    table, chance, by_group = sections.over_runs(harmonic())
    runs = harmonic().runs
    assert rows(table)["overturned, all runs"] == tuple(
        str(o.share_overturned) for o in (runs.with_pendulum, runs.without_pendulum)
    )
    kinds = ["sudden start from rest", "growth over 10 periods", "after a disturbance"]
    assert {f"overturned, {kind}" for kind in kinds} <= rows(table).keys()
    assert chance.text == runs.overturning_in_words
    assert [row[0] for row in by_group.rows] == [*runs.labels, *kinds]
    np.testing.assert_allclose(
        [float(row[1][:-2]) for row in by_group.rows],
        [100 * part.with_pendulum for part in runs.parts],
        atol=0.5,
    )
    assert {row[3] for row in by_group.rows} == {"no"}
    assert table.caption.startswith(f"{runs.description}. These runs were not used to choose the design, ")


def test_a_group_with_a_larger_tilt_is_marked():
    runs = harmonic().runs
    severe = dataclasses.replace(runs.with_pendulum, settled_tilt=np.full(len(runs.group), np.inf))
    case = dataclasses.replace(runs, with_pendulum=severe)
    found = dataclasses.replace(harmonic().validated[-1], reported_runs=case)
    table = sections.over_runs(dataclasses.replace(harmonic(), validated=(found,)))[-1]
    assert [row[3] == "yes" for row in table.rows] == [part.is_worse for part in case.parts]


def test_the_table_under_records_states_that_it_covers_all_groups():
    design = dataclasses.replace(ground(), validated=(ground().searched,))
    table, chance, rates, _ = sections.over_runs(design)
    assert rates.text == f"{HOW_TO}."
    assert design.runs.description.startswith("16 paired runs")
    assert "1 earthquake" in design.runs.description
    assert "1 earthquakes" not in design.runs.description
    assert table.caption.startswith("All 32 runs of all groups.")
    # Runs of one earthquake are not independent.
    assert "p =" not in chance.text


def test_every_variation_is_a_row_with_its_difference_from_the_stated_design():
    table, text = sections.depends_on(harmonic(), details())
    found, variations = rows(table), details().variations
    assert list(found) == [of.words for of in variations]
    for of, row in zip(variations, found.values(), strict=True):
        share, tilt = (of.runs.change(name) for name in ("overturned", "mean tilt"))
        cells = [
            " / ".join(words.percent(x, 1) for x in (change.with_pendulum, change.without_pendulum))
            for change in (share, tilt)
        ]
        points = of.difference and words.points(*dataclasses.astuple(of.difference))
        assert row == (*cells, points)
    assert found["all as stated"][2] is None
    # nu + k: 0.225 + 0.05.
    assert "90 % of the base (lifts at 0.275 g)" in found
    assert f"Tolerances in the validation runs: {harmonic().problem.scatter_in_words()}." in table.caption
    assert f"the same effect as a block {words.wider(details().equivalent_widening)}." in table.caption
    assert "reduction of the share of runs that overturn, minus as stated" in table.head
    linear = details().of("stated", "quantity", "losses", "width", "hinge")
    lost = [of.words for of in linear if not of.runs.reduction(of.measure)[1]]
    if lost:
        assert text.text == f"The reduction is not significant in these linear runs: {'; '.join(lost)}."
    else:
        assert text.text == sections._SOUND


def test_without_a_recommended_pendulum_only_the_wider_bases_have_rows():
    (table,) = sections.depends_on(rejected(), details("rejected"))
    assert [name.partition(" wider")[0] for name in rows(table)] == ["base 5 %", "base 10 %", "base 20 %"]
    assert {row[2] for row in rows(table).values()} == {None}
    assert "same effect" not in table.caption
    assert sections.depends_on(harmonic(), Details()) == []


def test_the_table_lists_the_limits_that_exclude_better_designs():
    trials = harmonic().trials
    used, text, table = sections.limiting(harmonic())
    kept = int(trials.feasible.sum())
    assert text.text.startswith(f"{kept} of {len(trials.designs)} designs with trial runs keep all limits.")
    (over,) = np.sum(trials.sizes[:, [trials.names.index("stroke")]] > 1.0, axis=0)
    assert (f"exceed each limit, or for which it is unknown: stroke {over}" in text.text) == (over > 0)
    share = words.percent(harmonic().usage["stroke"])
    assert rows(used)["stroke"] == ("at most 0.5 rad", "settled motion of each run", share)
    assert rows(used)["reserve"][2] == words.percent(harmonic().usage["reserve"])
    best = trials.best_without()
    assert rows(table)["all limits"][0] == pytest.approx(trials.designs[best, 0] * 16.224)
    # The best of all designs exceeds one limit: without this limit it is the best one.
    sizes = trials.sizes.copy()
    sizes[best, trials.names.index("stroke")] = 2.0
    changed = dataclasses.replace(
        trials, sizes=sizes, feasible=trials.feasible & (np.arange(len(sizes)) != best)
    )
    table = sections.limiting(dataclasses.replace(harmonic(), trials=changed))[2]
    assert list(rows(table)) == ["all limits", "without the limit on stroke"]
    assert "Other rows: best design without that limit." in table.caption


def test_the_table_of_settled_motion_has_a_row_for_every_condition():
    for design in (harmonic(), rejected()):
        first, conditions = sections.settled(design)
        assert [row[0] for row in conditions.rows] == [design.conditions.label(i) for i in range(10)]
        assert ("came nearest and is not recommended" in conditions.caption) is (design.pendulum is None)
        assert "largest tilt without pendulum" in rows(first)
    assert sections.settled(ground()) == []


@pytest.mark.parametrize("kind", DESIGNS)
def test_the_search_and_the_rejected_designs_are_described(kind):
    design = DESIGNS[kind]()
    (text,) = sections.searched(design, ())
    begin = f"Trial runs of the linear model evaluated {len(design.trials.designs)}"
    if design.search is not None:
        begin = "Descents by the gradient minimised what remains of a disturbance, per period"
    assert text.text.startswith(begin)
    tables = sections.rejected(design)
    listed = [v for v in design.validated if v.reasons]
    assert len(tables) == bool(listed)
    for row, v in zip(tables[0].rows if tables else (), listed, strict=True):
        # The benefit is that of the runs which the reasons are about.
        assert row[3] == v.runs.benefit_in_words
        assert row[4] == "; ".join(v.refusals)


def test_dangers_precede_other_reasons_for_a_rejection():
    (table,) = sections.rejected(against(LITTLE, STRIKES))
    assert table.rows[0][-1] == f"{STRIKES}; {LITTLE}"
    calm = dataclasses.replace(harmonic(), status=DesignStatus.no_uplift, validated=(), trials=None)
    assert [sections.over_runs(calm), sections.limiting(calm), sections.searched(calm, ())] == [[], [], []]
