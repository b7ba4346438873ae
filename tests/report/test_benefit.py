"""Sections on the benefit: headline, paired runs, the shaking itself, losses, and what limits the design."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.design.criteria import Room, Stroke
from tpd.design.result import DesignStatus, Nearest
from tpd.design.study import Study
from tpd.design.verified import Reason, ReasonKind, Step
from tpd.report import benefit
from tpd.report.blocks import Note, Severity, Table
from tpd.report.content import content

SOUND = (designs.loss_case("friction"),)
"""Losses on which the benefit does not hang."""


def rows(table) -> dict:
    assert isinstance(table, Table)
    return {row[0]: row[1:] for row in table.rows}


def test_the_headline_has_the_benefit_its_interval_and_the_shares():
    said = benefit.headline(designs.around(losses=SOUND))
    assert said.startswith("WORTH HANGING under the stated conditions. Over 40 paired runs of the nonlinear")
    # 1 - (2 + 38 * 0.2)/(20 + 20 * 0.4)
    assert "66% less tilt (95 % interval " in said
    assert "5.0% overturn in place of 50.0%" in said
    assert said.endswith("That is no verdict of safety: read the shares.")


def test_a_benefit_that_hangs_on_the_losses_says_so_first():
    said = benefit.headline(designs.around())
    assert said.startswith(
        "THE BENEFIT HANGS ON THE LOSSES: it is not shown where the block loses energy by impacts (0%)."
    )


@pytest.mark.parametrize(
    ("design", "said"),
    [
        (designs.single(), "the search knows one shaking and none beside it and takes a bob without size"),
        (designs.single(limits=(Stroke(), Room())), "the search knows one shaking and none beside it."),
        (designs.band(), "the search takes a bob without size and no walls."),
    ],
)
def test_what_the_search_did_not_ask_for_comes_before_the_benefit(design, said):
    assert benefit.headline(design).startswith(f"FOUND, BUT NOT TO BE HUNG AS IT IS: {said}")


def test_a_refusal_names_the_best_and_what_is_against_it():
    said = benefit.headline(designs.refused())
    assert said.startswith(DesignStatus.refused.value)
    assert f"1.622 kg on 0.12 m, damping ratio 0.1. Against it: {designs.REASON}." in said
    nearest = Nearest(design=np.array(designs.RATIOS), broken=(designs.REASON,))
    none = designs.single(
        status=DesignStatus.none_feasible, pendulum=None, verified=(), nearest=nearest, surveys=()
    )
    assert benefit.headline(none).endswith(f"The nearest: {designs.REASON}.")


def test_paired_runs_stand_with_their_intervals():
    table, chance, by_condition = benefit.paired_runs(designs.around())
    found = rows(table)
    assert found["overturned"][:2] == ("5.0%", "50.0%")
    assert found["overturned"][2].startswith("-45.0% (-")
    assert found["mean tilt over ν"][:2] == ("24.0%", "70.0%")
    assert chance == Note(
        Severity.information,
        "0 runs overturn with the pendulum only and 18 without it only. Would chance alone do this? Hardly: "
        "p = 3.8e-06.",
    )
    assert len(by_condition.rows) == 10
    # Runs 0, 10, 20 and 30 are of the first condition; 0 overturns with the pendulum, 0 and 10 without.
    assert rows(by_condition)["2.375 Hz"] == ("40.0%", "70.0%", None)


def test_conditions_that_get_worse_are_marked():
    runs = designs.paired(lost=30, lost_bare=2, tilt=0.2)
    winner = dataclasses.replace(designs.around().winner, paired=runs, benefit=designs.benefit(runs, 10))
    marks = [row[-1] for row in benefit.paired_runs(designs.around(verified=(winner,)))[-1].rows]
    assert "worse" in marks


def test_without_paired_runs_and_for_one_condition_there_is_less_to_show():
    assert benefit.paired_runs(designs.refused()) == []
    assert len(benefit.paired_runs(designs.single())) == 2
    for part in (benefit.losses, benefit.limiting):
        assert part(designs.single()) == []


def test_losses_have_a_row_each():
    (table,) = benefit.losses(designs.around())
    found = rows(table)
    assert list(found) == ["friction", "impacts"]
    assert found["impacts"][:2] == ("k = 0.05, e = 0.9", "0% less tilt (95 % interval 0% to 0%)")
    assert found["impacts"][2] == "50.0% / 50.0%"


def test_limits_that_keep_better_designs_out_are_named():
    counts, table = benefit.limiting(designs.around())
    assert "Of 4 designs followed from rest by the linear equations 2 keep to all limits from" in counts.text
    assert "1 exceed the limit on room for the bob on the way from rest" in counts.text
    kept, without = table.rows
    assert kept[:2] == ("limits kept from rest", pytest.approx(1.6224))
    assert without[1:3] == (pytest.approx(3.2448), pytest.approx(0.16))
    assert kept[-4:] == ("30.0%", "0 of 10", None, None)
    assert without[-4:] == ("20.0%", "0 of 10", None, None)


def test_a_limit_without_which_the_best_design_is_the_same_has_no_row():
    design = designs.around()
    wide = design.surveys[0]
    excess = wide.excess | {"stroke": np.array([-0.1, -0.1, 0.2, -0.1])}
    surveys = (dataclasses.replace(wide, excess=excess), *design.surveys[1:])
    table = benefit.limiting(dataclasses.replace(design, surveys=surveys))[-1]
    assert "The best design is the same without the limit on stroke." in table.caption
    rest = ["without the limit on room", "without any limit"]
    assert [row[0] for row in table.rows] == ["limits kept from rest", *rest]


@pytest.mark.mends("the table of limits called a design sound that strikes a wall in a quarter of the runs")
def test_designs_that_keep_the_limits_from_rest_are_shown_with_their_strikes():
    assert "all limits kept" not in rows(benefit.limiting(designs.around())[-1])
    # Here, so that the other tests of this module run on code without it.
    from tpd.design.study import Surveyed

    runs = Surveyed(strikes=0.286, allowed=0.01, overturned=0.086, benefit=designs.benefit(designs.paired()))
    table = benefit.limiting(designs.around(), Study(surveyed={0: runs}))[-1]
    assert table.head[-2:] == ("strikes a wall, of runs", "overturned, of runs")
    kept, without = table.rows
    assert kept[-2:] == ("28.6%", "8.6%")
    assert without[-2:] == (None, None)
    assert table.caption.endswith("a bob that strikes in more than 1.0% of them is refused.")


def refused(*verified):
    return designs.around(status=DesignStatus.refused, pendulum=None, verified=verified)


def against(kind, value, reference=0.0, **more):
    return Reason(step=Step.benefit, kind=kind, value=value, reference=reference, **more)


STRIKES = against(ReasonKind.strikes, 0.27, 0.01)
LITTLE = against(ReasonKind.too_little_benefit, 0.08, 0.1, low=0.02)


@pytest.mark.mends("the headline named the design of the largest benefit, whose bob strikes in every run")
def test_the_headline_is_made_of_the_reasons_of_what_came_nearest():
    strikes = [(against(ReasonKind.strikes, share, 0.01),) for share in (1.0, 0.02)]
    gains = [designs.benefit(designs.paired(lost)) for lost in (1, 4)]
    far, near = (
        designs.verified(mass_ratio=mu, reasons=reasons, benefit=gain)
        for mu, reasons, gain in zip((0.2, 0.05), strikes, gains, strict=True)
    )
    early = designs.verified(mass_ratio=0.15, reasons=(designs.REASON,), benefit=None, paired=None)
    for order in ((far, near, early), (early, near, far)):
        said = benefit.headline(refused(*order))
        assert "Nearest comes 0.8112 kg on 0.12 m, damping ratio 0.1. Against it: by the paired runs" in said
        assert "strikes a wall in 2.0% of the cases, and 1.0% is allowed." in said
        assert said.endswith(f"Over 40 paired runs of the nonlinear equations: {gains[1]}.")


@pytest.mark.mends("strikes and overturnings stood last among the reasons, or were cut off")
def test_the_gravest_reason_stands_first_and_none_is_left_out():
    limits = [dataclasses.replace(designs.REASON, condition=f"{f} Hz") for f in (1, 2, 3)]
    rests = against(ReasonKind.rests_less, 1.0, 9.0, total=40)
    said = benefit.headline(refused(designs.verified(reasons=(*limits, rests, LITTLE, STRIKES))))
    first = said.split("Against it: ")[1]
    assert first.startswith("by the paired runs of the nonlinear equations the bob strikes a wall in 27.0%")
    assert "falls by 8.0% (at least 2.0% with 95 % confidence)" in first
    assert "ends at rest in 1 of 40 cases" in first
    assert "by 0.2 of it at 1 Hz" in first
    assert "2 Hz" not in first
    assert "and 2 more of these" in first


@pytest.mark.mends("every refusal was a danger, and 'keep to all limits' as well")
def test_a_refusal_is_a_danger_where_it_is_about_overturning_or_strikes():
    for reason, severity in ((LITTLE, Severity.warning), (STRIKES, Severity.danger)):
        bad = (designs.verified(reasons=(reason,)),)
        alone = designs.single(status=DesignStatus.refused, pendulum=None, verified=bad)
        assert content(alone, Study()).verdict.severity is severity
        counts = benefit.limiting(refused(*bad))[0]
        assert "keep to all limits" in counts.text
        assert counts.severity is not Severity.danger
    assert content(designs.single(), Study()).verdict.severity is Severity.information


@pytest.mark.mends("a design was counted by its first reason alone")
def test_every_reason_against_the_verified_is_counted():
    counts = benefit.limiting(refused(designs.verified(reasons=(LITTLE, STRIKES))))[0]
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
    design = designs.around(verified=(winner,), losses=SOUND)
    assert "Over 40 fresh paired runs of the nonlinear equations: 66% less tilt" in benefit.headline(design)
    caption = benefit.paired_runs(design)[0].caption
    assert "seed 2, which judged the design once and which no choice has seen; those" in caption
    failed = dataclasses.replace(winner, reasons=(Reason(step=Step.judgement, kind=ReasonKind.strikes),))
    design = designs.around(verified=(failed, winner), losses=SOUND)
    caption = benefit.paired_runs(design)[0].caption
    assert "; 1 before it failed by these runs, and each further try may pass by luck; those" in caption
    assert "those that chose it, seed 0, gave 71% less tilt" in caption
