"""The whole report as data: one family for one condition and for many."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.design.criteria import Mass, Risk, Room
from tpd.design.result import DesignStatus, HarmonicDesign
from tpd.design.study import Study, build_of
from tpd.report import pictures, words
from tpd.report.blocks import Figure, Severity, Table
from tpd.report.content import content
from tpd.scene.bob import Bob

BAND = designs.study(responses=None)


def section(report, title):
    (found,) = (s for s in report.sections if s.title == title)
    return found.blocks


def row(table: Table, name: str):
    (found,) = (r for r in table.rows if r[0] == name)
    return found


def test_the_first_screen_has_verdict_dangers_answer_and_one_comparison():
    report = content(designs.single(), designs.study())
    assert report.verdict.severity is Severity.note
    # One shaking, and a bob without size: what the search does not know comes first.
    assert report.verdict.text.startswith(
        "FOUND, BUT NOT TO BE HUNG AS IT IS, since the search knows one shaking"
    )
    assert [n.severity for n in report.dangers] == [Severity.danger] * len(report.dangers)
    assert report.dangers
    assert report.comparison is not None
    assert row(report.comparison, "overturned")[1:3] == ("5.0%", "50.0%")
    assert [r[0] for r in report.answer.rows[:3]] == ["block", "motion", "conditions"]
    assert [f.name for f in report.figures] == ["drawing.svg", "animation.gif"]
    assert report.title == "Pendulum for a block of 0.1 m × 0.4 m"
    named = content(designs.single(), designs.study(), name="Tower", date="2026-11-23")
    assert named.title == "Tower: pendulum for a block of 0.1 m × 0.4 m, 2026-11-23"
    assert named.answer.rows[0] == ("project", "Tower")


def test_sections_stand_in_the_order_in_which_an_engineer_asks():
    study = designs.study(build=build_of(designs.around()))
    report = content(designs.around(), study, "[block]\n")
    titles = [s.title for s in report.sections]
    assert titles == [
        "Build it",
        "Over the runs",
        "Other losses of energy",
        "What limits the design",
        "Beside the shaking of the job",
        "Over time, from rest",
        "The settled motion",
        "Where it was searched",
        "Assumptions",
        "How to repeat it",
    ]
    printed = [s.title for s in report.sections if s.printed]
    assert printed == [
        "Build it",
        "Over the runs",
        "Other losses of energy",
        "Assumptions",
        "How to repeat it",
    ]


def test_over_conditions_the_settled_motion_has_the_risk_and_the_largest_stroke():
    table = section(content(designs.band(), BAND), "The settled motion")[0]
    assert row(table, "worst tilt with it")[1] == "0.07500 rad (30.0% of nu)"
    assert row(table, "worst tilt without a pendulum")[1] == "0.15000 rad (60.0% of nu)"
    assert row(table, "stroke of the bob")[1].startswith("0.45 rad")
    assert row(table, "limit on offset (bob from the axis)")[1] == "80% used"


def test_every_condition_is_a_row_with_motions_of_the_search_and_from_rest():
    _, figure, table, rest = section(content(designs.band(), BAND), "The settled motion")
    assert rest.text == designs.band().winner.rest.told
    assert figure.name == "conditions.svg"
    assert len(table.rows) == 8
    assert table.rows[0] == ("1.5 Hz", 0.15, "rocking", "overturned", 0.075, "rocking", "rocking", 0.45)
    assert table.rows[-1][5:7] == ("rest", "rest")
    assert len(section(content(designs.single(), designs.study()), "The settled motion")) == 2


def test_figures_are_those_that_there_is_data_for():
    def names(design, study):
        report = content(design, study)
        blocks = (b for s in report.sections for b in s.blocks)
        return {b.name for b in blocks if isinstance(b, Figure)} | {f.name for f in report.figures}

    always = {"benefit.svg", "drawing.svg", "animation.gif", "motion.svg"}
    assert names(designs.single(), designs.study()) == always | {"response.svg", "search.png"}
    assert names(designs.band(), BAND) == always | {"conditions.svg", "search.png"}
    front = dataclasses.replace(BAND, front=designs.front())
    assert names(designs.band(), front) == always | {"conditions.svg", "front.svg", "search.png"}
    assert names(designs.single(status=DesignStatus.interrupted, pendulum=None), Study()) == {"search.png"}


def test_a_refused_design_is_not_shown_as_an_answer():
    report = content(designs.refused(), designs.study())
    # Dangers are overturning and strikes, and this design exceeds a limit on its stroke.
    assert report.verdict.severity is Severity.note
    assert row(report.answer, "nearest")[1].endswith(": not offered")
    assert report.verdict.text == f"NO PENDULUM WORTH HANGING: {designs.REASON}."
    assert report.comparison is None
    (refused,) = section(report, "Designs refused")
    assert refused.rows[0][-1] == str(designs.REASON)


def test_the_front_has_a_row_for_every_mass():
    study = dataclasses.replace(BAND, front=designs.front())
    table = section(content(designs.band(), study), "What a kilogramme pays")[-1]
    assert table.rows[0] == ("0.8112 kg", "refused", None)
    assert table.rows[-1] == ("1.622 kg", "1.622 kg on 0.12 m, ζ = 0.1", "50% (40% to 60%)")


def test_the_command_that_repeats_the_run_is_quoted(tmp_path):
    odd = tmp_path / "my & run"
    command, _, toml, _ = section(content(designs.band(), BAND, "[block]\n", odd), "How to repeat it")
    assert command.text == f"tpd optimise --scene '{odd}/scene.toml' --out '{odd}-again'"
    assert toml.text == "[block]\n"


@pytest.mark.parametrize(
    ("losses", "said"),
    [
        ({}, "friction k = 0.05"),
        ({"restitution": "housner"}, "impact loss: Housner, e = 0.9118 for the bare block"),
        ({"restitution": 0.9, "friction": 0.02}, "impact loss: e = 0.9; friction k = 0.02"),
    ],
)
def test_a_report_names_the_energy_losses(losses, said):
    assert words.losses(tpd.Block(width=0.1, height=0.4, mass=16.0, **losses)) == said


@pytest.mark.parametrize(
    ("value", "changes", "said"),
    [
        (0.3, {}, "0.07500 rad (30.0% of nu)"),
        (-0.1, {}, "none: at rest with 10.0% of the lifting moment in reserve"),
        (1.2, {}, "no settled motion under the worst condition: by events the block may overturn"),
        (-0.1, {"risk": Risk.expected()}, "-0.1000 times nu, rest counted as less its uplift margin"),
    ],
)
def test_a_value_of_the_risk_in_words(value, changes, said):
    assert words.risk(designs.band(**changes), value) == said


def test_angles_that_are_infinite_or_unknown_are_told_apart():
    assert words.angle(0.1) == "0.1 rad (5.73°)"
    assert words.angle(np.inf) == "overturns"
    assert words.angle(np.nan) == "unknown"


def test_limits_in_words():
    assert words.limit(Mass(2.0)) == "mass 2 kg"
    assert words.limit(Room()) == "the bob, a solid ball of steel, keeps off the walls"
    wood = Room(Bob(shape="cylinder", density=700.0))
    assert "a solid cylinder of 700 kg/m³, 2 times as high as wide" in words.limit(wood)
    said = [words.limit(limit) for limit in designs.single().limits]
    assert said == ["stroke 0.5 rad", "reserve 0.05"]


def lost_at_one() -> HarmonicDesign:
    """A band in which the block overturns from rest under the first condition, with the pendulum too."""
    design = designs.band()
    status = np.array(["overturned", *["rocking"] * 7])
    exact = designs.motions(np.full(8, 0.05), np.linspace(0.2, 0.46, 8), status)
    return dataclasses.replace(design, verified=(dataclasses.replace(design.winner, exact=exact),))


def test_strokes_are_the_largest_of_the_conditions_that_the_block_withstands():
    table = section(content(lost_at_one(), BAND), "The settled motion")[0]
    assert row(table, "stroke of the bob")[1] == "0.46 rad (26.4°)"


def test_conditions_under_which_the_bare_block_rests_are_shown_without_a_pendulum():
    kind = np.full((1, 8), 2)
    bare = dataclasses.replace(
        designs.band().bare,
        value=-0.1,
        evaluation=designs.evaluation(np.zeros(8), 0.0, kind=kind),
        exact=designs.motions(np.zeros(8), 0.0, "rest"),
    )
    empty = designs.search(
        screened=np.zeros((0, 3)),
        screened_value=np.zeros(0),
        screened_feasible=np.zeros(0, bool),
        paths=(),
        ends=np.zeros((0, 3)),
        end_values=np.zeros(0),
        statuses=(),
    )
    design = designs.band(status=DesignStatus.no_uplift, pendulum=None, verified=(), bare=bare, search=empty)
    report = content(design, Study())
    assert report.verdict.severity is Severity.note
    table, figure, conditions = section(report, "The settled motion")
    assert row(table, "worst tilt without a pendulum")[1].startswith("none: at rest with 10.0%")
    assert figure.name == "conditions.svg"
    assert conditions.head == ("condition", "bare tilt (rad)", "bare kind", "bare from rest")
    assert conditions.rows[0][1:] == (0.0, "rest", "rest")
    assert pictures.draw("conditions.svg", design, Study()).startswith(b"<?xml")
    assert pictures.names(design, Study()) == ("conditions.svg", "drawing.svg")
