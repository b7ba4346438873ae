"""The whole report as data: one family for one condition and for many."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.analysis.sensitivity import Elasticities
from tpd.core.bob import Bob
from tpd.design.criteria import Mass, Risk, Room
from tpd.design.result import DesignStatus, HarmonicDesign, Nearest
from tpd.design.study import Study
from tpd.plot.style import new_axes
from tpd.report import pictures, words
from tpd.report.blocks import Figure, Severity, Table
from tpd.report.content import content

BAND = designs.study(responses=None, elasticities=None)


def section(report, title):
    (found,) = (s for s in report.sections if s.title == title)
    return found.blocks


def row(table: Table, name: str):
    (found,) = (r for r in table.rows if r[0] == name)
    return found


def test_the_verdict_comes_first_and_dangers_before_the_answer():
    report = content(designs.single(), designs.study())
    assert report.verdict.severity is Severity.information
    # One shaking, and a bob without size: what the search does not know comes first.
    assert report.verdict.text.startswith("FOUND, BUT NOT TO BE HUNG AS IT IS: the search knows one shaking")
    assert "66% less tilt (95 % interval " in report.verdict.text
    assert "5.0% overturn in place of 50.0%" in report.verdict.text
    assert [s.title for s in report.sections[:3]] == ["Scene", "Before anything else", "The answer"]
    assert report.sections[1].blocks[0].severity is Severity.danger
    assert report.title == "Pendulum for a block of 0.1 m × 0.4 m"
    named = content(designs.single(), designs.study(), name="Tower", date="2026-11-23")
    assert named.title == "Tower: pendulum for a block of 0.1 m × 0.4 m, 2026-11-23"
    assert [r[1] for r in named.sections[0].blocks[0].rows[:2]] == ["Tower", "2026-11-23"]


def test_the_answer_has_the_pendulum_in_si_units_and_what_holds_it():
    table, held = section(content(designs.single(), designs.study()), "The answer")
    assert row(table, "mass of the bob")[1] == "1.622 kg"
    assert row(table, "length of the pendulum")[1:] == ("0.12 m", "λ = 0.6")
    assert row(table, "hinge to the bob's centre, to be built")[1] == "0.1153 m"
    assert row(table, "damping of the hinge")[1].endswith(" N m s/rad")
    # nu (1 + mu)/(1 + 2 mu) is 0.2292 rad.
    assert row(table, "rocking amplitude with it")[1:] == ("0.04 rad (2.29°)", "17.5% of toppling")
    assert row(table, "stroke of the bob, settled")[2] == "60% of the limit"
    assert row(table, "limit on offset (bob from the axis)")[1] == "80.0% used"
    assert held.text.startswith("Held by: limit on stroke at the scene's own shaking.")


def test_over_conditions_the_answer_has_the_risk_and_the_largest_stroke():
    table, _ = section(content(designs.band(), BAND), "The answer")
    assert row(table, "worst tilt with it")[1] == "0.07500 rad (30.0% of nu)"
    assert row(table, "worst tilt without a pendulum")[1] == "0.15000 rad (60.0% of nu)"
    assert row(table, "rocking amplitude without")[1:] == ("overturns", None)
    assert row(table, "stroke of the bob, settled")[1].startswith("0.45 rad")


def test_every_condition_is_a_row_with_motions_of_the_search_and_from_rest():
    described, figure, table = section(content(designs.band(), BAND), "Under every condition")
    assert described.text == "8 frequencies from 1.5 to 4 Hz."
    assert figure.name == "conditions.svg"
    assert len(table.rows) == 8
    assert table.rows[0] == ("1.5 Hz", 0.15, "rocking", "overturned", 0.075, "rocking", "rocking", 0.45)
    assert table.rows[-1][5:7] == ("rest", "rest")
    titles = [s.title for s in content(designs.single(), designs.study()).sections]
    assert "Under every condition" not in titles


def test_figures_are_those_that_there_is_data_for():
    def names(design, study):
        blocks = (b for s in content(design, study).sections for b in s.blocks)
        return {b.name for b in blocks if isinstance(b, Figure)}

    always = {"benefit.svg", "drawing.svg", "animation.gif", "motion.svg", "search.png"}
    assert names(designs.single(), designs.study()) == always | {"response.svg"}
    assert names(designs.band(), BAND) == always | {"conditions.svg"}
    front = dataclasses.replace(BAND, front=designs.front())
    assert names(designs.band(), front) == always | {"conditions.svg", "front.svg"}
    assert names(designs.single(status=DesignStatus.interrupted, pendulum=None), Study()) == {"search.png"}


def test_a_refused_design_is_not_shown_as_an_answer():
    report = content(designs.refused(), designs.study(comparison=None))
    # Dangers are overturning and strikes, and this design exceeds a limit on its stroke.
    assert report.verdict.severity is Severity.warning
    assert report.verdict.text.startswith("NO PENDULUM WORTH HANGING")
    (table,) = section(report, "The answer")
    assert row(table, "pendulum")[1] == "none to offer"
    (refused,) = section(report, "Designs refused")
    assert refused.rows[0][-1] == str(designs.REASON)


def test_the_design_nearest_to_the_limits_is_named_where_none_keeps_to_them():
    nearest = Nearest(design=np.array(designs.RATIOS), broken=(designs.REASON,))
    status = DesignStatus.none_feasible
    design = designs.single(status=status, pendulum=None, verified=(), nearest=nearest)
    _, note = section(content(design, Study()), "The answer")
    assert note.text == f"Nearest to the limits comes μ = 0.1, λ = 0.6, ζ = 0.1: {designs.REASON}."


A_DANGER = pytest.mark.mends("a stroke beyond its limit was a danger, as an overturning is")


@pytest.mark.parametrize(
    ("answer", "severity", "said"),
    [
        pytest.param({"stroke": 0.6}, Severity.warning, "the stroke is 0.6 rad, above 0.5", marks=A_DANGER),
        ({"amplitude": np.inf, "status": "overturned"}, Severity.danger, "the motion ends overturned"),
    ],
)
def test_objections_of_the_nonlinear_model_are_told_and_an_overturning_is_a_danger(answer, severity, said):
    study = designs.study()
    top = dataclasses.replace(designs.answer("nonlinear"), **answer)
    comparison = dataclasses.replace(study.comparison, models=(top,))
    note = section(content(designs.single(), designs.study(comparison=comparison)), "By several models")[-1]
    assert note.severity is severity
    assert said in note.text


def test_elasticities_stand_in_the_order_of_their_size_and_refusals_say_why():
    table = section(content(designs.single(), designs.study()), "Sensitivity")[-1]
    assert [r[-1] for r in table.rows[:3]] == ["-2", "-1.5", "-1"]
    none = Elasticities(of="amplitude", value=np.inf, at={}, slopes={}, refused="overturned: it falls <over>")
    (note,) = section(content(designs.single(), designs.study(elasticities=none)), "Sensitivity")
    assert note.text == "There is no gradient: overturned: it falls <over>."
    table = section(content(designs.band(), BAND), "Sensitivity")[-1]
    assert table.rows == (("frequency", "-2.00"), ("length", "+1.25"), ("mass", "-0.40"))
    unknown = designs.band(elasticities={"mass": np.nan, "length": 1.25})
    assert section(content(unknown, BAND), "Sensitivity")[-1].rows == (("length", "+1.25"),)


def test_the_front_has_a_row_for_every_mass():
    study = dataclasses.replace(BAND, front=designs.front())
    table = section(content(designs.band(), study), "Where it was searched")[-1]
    assert table.rows[0] == ("0.8112 kg", "refused", None)
    assert table.rows[-1] == ("1.622 kg", "1.622 kg on 0.12 m, ζ = 0.1", "50% (40% to 60%)")


def test_the_command_that_repeats_the_run_is_quoted(tmp_path):
    odd = tmp_path / "my & run"
    study = dataclasses.replace(BAND, front=designs.front())
    command, _, toml, _ = section(content(designs.band(), study, "[block]\n", odd), "How to repeat it")
    assert command.text == f"tpd optimise --scene '{odd}/scene.toml' --out '{odd}-again' --pareto"
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
    table, _ = section(content(lost_at_one(), BAND), "The answer")
    assert row(table, "rocking amplitude with it")[1] == "overturns"
    assert row(table, "stroke of the bob, settled")[1:] == ("0.46 rad (26.4°)", "92% of the limit")
    # 0.12 m times sin(0.46)
    assert row(table, "way of the bob to either side")[1] == "0.05327 m"


def test_the_drawing_shows_a_finite_stroke(monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "tpd.plot.drawing.plot_scene", lambda scene, hung, *, stroke, bob: drawn.append(stroke) or new_axes()
    )
    pictures.draw("drawing.svg", lost_at_one(), BAND)
    assert drawn == [pytest.approx(0.46)]


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
        screened_overturned=np.zeros(0, bool),
        paths=(),
        ends=np.zeros((0, 3)),
        end_values=np.zeros(0),
        statuses=(),
    )
    design = designs.band(status=DesignStatus.no_uplift, pendulum=None, verified=(), bare=bare, search=empty)
    report = content(design, Study())
    assert report.verdict.severity is Severity.information
    (table,) = section(report, "The answer")
    assert row(table, "worst tilt without pendulum")[1].startswith("none: at rest with 10.0%")
    _, figure, conditions = section(report, "Under every condition")
    assert figure.name == "conditions.svg"
    assert conditions.head == ("condition", "bare tilt (rad)", "bare kind", "bare from rest")
    assert conditions.rows[0][1:] == (0.0, "rest", "rest")
    assert pictures.draw("conditions.svg", design, Study()).startswith(b"<?xml")
    assert pictures.names(design, Study()) == ("conditions.svg", "drawing.svg")
