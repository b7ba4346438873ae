"""Sections of a report: runs, losses, limits, motions, search and rejected designs."""

import dataclasses

import numpy as np
import pytest

from tests.report.conftest import DESIGNS, LITTLE, STRIKES, against, details, ground, harmonic, rejected
from tpd.answers.paired import Change
from tpd.design.as_built import Details
from tpd.design.reasons import DesignStatus
from tpd.design.transfer import Transfer
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
    kinds = ["from rest, sudden start", "from rest, growth over 10 periods", "after a disturbance"]
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
    found = dataclasses.replace(harmonic().validated[-1], quoted=case)
    table = sections.over_runs(dataclasses.replace(harmonic(), validated=(found,)))[-1]
    assert [row[3] == "yes" for row in table.rows] == [part.is_worse for part in case.parts]


def test_the_table_under_records_states_that_it_covers_all_groups():
    design = ground()
    table, chance, rates, _ = sections.over_runs(design)
    assert rates.text == f"{HOW_TO}."
    assert design.runs.description.startswith("2 paired runs")
    assert "1 earthquake" in design.runs.description
    assert "1 earthquakes" not in design.runs.description
    assert table.caption.startswith("All 4 runs of all groups.")
    # Runs of one earthquake are not independent.
    assert "p =" not in chance.text


def test_the_first_row_of_the_wider_bases_is_the_pendulum():
    (table,) = sections.wider_bases(harmonic(), details())
    found, own = rows(table), harmonic().runs.change("overturned")
    width = float(harmonic().scene.block.width)
    assert found["with the pendulum"][:2] == (width, words.percent(own.with_pendulum, 1))
    bases = details().wider_bases
    assert list(found)[1:] == [f"base {words.percent(base.widening)} wider" for base in bases]
    for base, row in zip(bases, list(found.values())[1:], strict=True):
        assert row[0] == pytest.approx((1.0 + base.widening) * width)
        assert row[2] == words.difference(base.runs.change("overturned"))
    assert f"the same effect as a block {words.wider(details().worth)}." in table.caption
    # Without a pendulum the bases have no such number.
    (table,) = sections.wider_bases(rejected(), details("rejected"))
    assert "worth" not in table.caption
    assert sections.wider_bases(harmonic(), Details()) == []


def test_each_other_set_of_records_has_a_table():
    levels = "1.5", "2", "3", "4"
    overturned = tuple(Change(at, 0.1 * i, 0.2 * i, -0.3, 0.1) for i, at in enumerate(levels))
    other = Transfer("near-field-pulse", overturned, 28, 11, 6)
    (table,) = sections.transferred(Details(transfer=(other,)))
    assert tuple(rows(table)) == levels
    assert rows(table)["3"] == ("20 %", "40 %", "-20 points (-30 to +10)")
    assert "28 records of 11 earthquakes, 6 of which the design used" in table.caption
    (text,) = sections.transferred(Details(transfer="The records are not installed."))
    assert text.text == "The records are not installed."
    assert sections.transferred(Details()) == []


def test_each_kind_of_energy_loss_has_a_row():
    (table,) = sections.other_losses(details())
    found = rows(table)
    # The block of the paper loses energy by friction only.
    assert list(found) == ["impacts only", "friction and impacts"]
    for case in details().losses:
        fell = case.runs.change("overturned")
        shares = " / ".join(words.percent(x, 1) for x in (fell.with_pendulum, fell.without_pendulum))
        assert found[words.energy_loss(case.name)][1:3] == (case.runs.benefit_in_words, shares)
    assert sections.other_losses(details("rejected")) == []


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
        first, conditions = sections.settled(design, ())
        assert [row[0] for row in conditions.rows] == [design.conditions.label(i) for i in range(10)]
        assert ("came nearest and is not recommended" in conditions.caption) is (design.pendulum is None)
        assert "largest tilt without pendulum" in rows(first)
    assert sections.settled(ground(), ()) == []


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


def test_each_level_of_ground_motions_has_a_row():
    runs = ground().runs
    found = rows(sections.over_runs(ground())[0])
    for i, scale in enumerate((2, 3)):
        cases = (case.of(np.arange(i, 4, 2)) for case in (runs.with_pendulum, runs.without_pendulum))
        expected = tuple(str(case.share_overturned) for case in cases)
        assert found[f"overturned, {scale} (PGA over g tan(alpha))"] == expected
