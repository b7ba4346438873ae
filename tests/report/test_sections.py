"""Sections of harmonic designs: paired runs, losses, and what limits the design. Those on ground motions are
tested with a design that was searched, in the tests of that search."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.design.verified import Reason, ReasonKind, Step
from tpd.report import sections
from tpd.report.blocks import Table, Text


def rows(table) -> dict:
    assert isinstance(table, Table)
    return {row[0]: row[1:] for row in table.rows}


def test_paired_runs_stand_with_their_intervals():
    table, chance, by_condition = sections.over_runs(designs.around())
    found = rows(table)
    assert found["overturned"] == ("5.0% (1.4% to 16.5%)", "50.0% (35.2% to 64.8%)")
    # Runs of odd numbers have shakings that grow: 1 of 20 overturns with the pendulum, 10 without.
    assert found["overturned, growing for 2 s"][0].startswith("5.0%")
    assert found["settled tilt, 50, 90, 99 % of the runs (rad)"][0] == "0.05, 0.05, overturned"
    said = "0 runs overturn with the pendulum only and 18 without it only. Would chance alone do this?"
    assert chance == Text(f"{said} Hardly: p = 7.6e-06.")
    assert len(by_condition.rows) == 10
    # Runs 0, 10, 20 and 30 are of the first condition; 0 overturns with the pendulum, 0 and 10 without.
    assert rows(by_condition)["2.375 Hz"] == ("40%", "70%", None)


def test_conditions_that_get_worse_are_marked():
    runs = designs.paired(lost=30, lost_bare=2, tilt=0.2)
    winner = dataclasses.replace(designs.around().winner, paired=runs, benefit=designs.benefit(runs, 10))
    table = sections.over_runs(designs.around(verified=(winner,)))[-1]
    assert "worse" in {row[-1] for row in table.rows}


def test_without_paired_runs_and_for_one_condition_there_is_less_to_show():
    assert sections.over_runs(designs.refused()) == []
    assert len(sections.over_runs(designs.single())) == 2
    assert sections.other_losses(designs.single()) == sections.limiting(designs.single()) == []


def test_losses_have_a_row_each():
    (table,) = sections.other_losses(designs.around())
    found = rows(table)
    assert list(found) == ["friction", "impacts"]
    assert found["impacts"][:2] == ("k = 0.05, e = 0.9", "0% less tilt (95 % interval -11% to 10%)")
    assert found["impacts"][2] == "50.0% / 50.0%"


def test_limits_that_keep_better_designs_out_are_named():
    counts, table = sections.limiting(designs.around())
    assert "Of 4 designs followed from rest by the linear equations 2 keep to all limits from" in counts.text
    assert "1 exceed the limit on room on the way" in counts.text
    kept, without = table.rows
    assert kept[:2] == ("limits kept from rest", pytest.approx(1.6224))
    assert without[1:3] == (pytest.approx(3.2448), pytest.approx(0.16))
    assert kept[-1] == "30%"
    assert without[-1] == "20%"


def test_a_limit_without_which_the_best_design_is_the_same_has_no_row():
    design = designs.around()
    wide, *others = design.surveys
    excess = wide.excess | {"stroke": np.array([-0.1, -0.1, 0.2, -0.1])}
    surveys = (dataclasses.replace(wide, excess=excess), *others)
    table = sections.limiting(dataclasses.replace(design, surveys=surveys))[-1]
    assert "The best design is the same without the limit on stroke." in table.caption
    named = ["limits kept from rest", "without the limit on room", "without any limit"]
    assert [row[0] for row in table.rows] == named


@pytest.mark.mends("a design was counted by its first reason alone")
def test_every_reason_against_the_verified_is_counted():
    both = designs.verified(reasons=(designs.LITTLE, designs.STRIKES))
    counts = sections.limiting(designs.all_refused(both))[0]
    assert "1 were refused: " in counts.text
    assert "1 because the benefit is too small" in counts.text
    assert "1 because the bob strikes a wall" in counts.text


def test_the_runs_that_judged_are_named_beside_those_that_chose():
    runs = designs.paired()
    judges = dataclasses.replace(runs.hung, ensemble=tpd.Ensemble(size=40, seed=2))
    winner = designs.verified(
        paired=dataclasses.replace(runs, hung=judges),
        benefit=designs.benefit(runs, 10),
        chosen_by=designs.benefit(designs.paired(0), 10),
    )
    failed = dataclasses.replace(winner, reasons=(Reason(step=Step.judgement, kind=ReasonKind.strikes),))
    caption = sections.over_runs(designs.around(verified=(failed, winner)))[0].caption
    assert caption.startswith("40 fresh paired runs of the nonlinear equations, seed 2")
    assert "; 1 before it failed by these runs, and each further try may pass by luck; those" in caption
    assert "those that chose it, seed 0, gave 71% less tilt" in caption
    alone = sections.over_runs(designs.around(verified=(winner,)))[0].caption
    assert alone.startswith(
        "40 fresh paired runs of the nonlinear equations, seed 2, which judged the design"
    )
