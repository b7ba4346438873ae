"""The whole report as data: one family for one condition and for many."""

import dataclasses

import numpy as np

from tests import designs
from tpd.design.result import DesignStatus
from tpd.design.study import Study, build_of
from tpd.report.blocks import Figure, Severity, Table
from tpd.report.content import content, names

BAND, NONE = designs.study(responses=None), Study()


def section(report, title):
    (found,) = (s for s in report.sections if s.title == title)
    return found.blocks


def row(table: Table, name: str):
    (found,) = (r for r in table.rows if r[0] == name)
    return found


def test_the_first_screen_has_verdict_dangers_answer_and_one_comparison():
    report = content(designs.single(), designs.study(), name="Tower", date="2026-11-23")
    assert report.verdict.severity is Severity.note
    assert {n.severity for n in report.dangers} == {Severity.danger}
    assert row(report.comparison, "overturned")[1:3] == ("5.0%", "50.0%")
    assert report.comparison.caption.startswith("40 paired runs of the nonlinear equations, seed 0")
    assert [r[0] for r in report.answer.rows[:4]] == ["project", "block", "motion", "conditions"]
    assert [f.name for f in report.figures] == ["drawing.svg", "animation.gif"]
    assert report.title == "Tower: pendulum for a block of 0.1 m × 0.4 m, 2026-11-23"
    assert content(designs.single(), NONE).title == "Pendulum for a block of 0.1 m × 0.4 m"


def test_sections_stand_in_the_order_in_which_an_engineer_asks():
    study = designs.study(build=build_of(designs.around()))
    report = content(designs.around(), study, "[block]\n")
    first = ["Build it", "Over the runs", "Other losses of energy"]
    middle = ["What limits the design", "Beside the shaking of the job", "Over time, from rest"]
    middle += ["The settled motion", "Where it was searched"]
    last = ["Assumptions", "How to repeat it"]
    assert [s.title for s in report.sections] == [*first, *middle, *last]
    assert [s.title for s in report.sections if s.printed] == [*first, *last]


def test_over_conditions_the_settled_motion_has_the_risk_and_a_row_for_every_condition():
    table, figure, conditions, rest = section(content(designs.band(), BAND), "The settled motion")
    assert row(table, "worst tilt with it")[1] == "0.07500 rad (30.0% of nu)"
    assert row(table, "worst tilt without a pendulum")[1] == "0.15000 rad (60.0% of nu)"
    assert row(table, "stroke of the bob")[1].startswith("0.45 rad")
    assert row(table, "limit on offset (bob from the axis)")[1] == "80% used"
    # Motions of the search and from rest.
    assert rest.text == designs.band().winner.rest.told
    assert figure.name == "conditions.svg"
    assert len(conditions.rows) == 8
    first = ("1.5 Hz", 0.15, "rocking", "overturned", 0.075, "rocking", "rocking", 0.45)
    assert conditions.rows[0] == first
    assert conditions.rows[-1][5:7] == ("rest", "rest")
    assert len(section(content(designs.single(), designs.study()), "The settled motion")) == 2
    # The stroke is the largest of the conditions that the block withstands, of which the first is none here.
    design, status = designs.band(), np.array(["overturned", *["rocking"] * 7])
    exact = designs.motions(np.full(8, 0.05), np.linspace(0.2, 0.46, 8), status)
    design = dataclasses.replace(design, verified=(dataclasses.replace(design.winner, exact=exact),))
    table = section(content(design, BAND), "The settled motion")[0]
    assert row(table, "stroke of the bob")[1] == "0.46 rad (26.4°)"


def test_figures_are_those_that_there_is_data_for():
    always = {"benefit.svg", "drawing.svg", "animation.gif", "motion.svg", "search.png"}
    front = dataclasses.replace(BAND, front=designs.front())
    for design, study, shown in (
        (designs.single(), designs.study(), always | {"response.svg"}),
        (designs.band(), BAND, always | {"conditions.svg"}),
        (designs.band(), front, always | {"conditions.svg", "front.svg"}),
    ):
        report = content(design, study)
        blocks = [b for s in report.sections for b in s.blocks] + list(report.figures)
        assert {b.name for b in blocks if isinstance(b, Figure)} == shown


def test_a_refused_design_is_not_shown_as_an_answer():
    report = content(designs.refused(), designs.study())
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


def test_conditions_under_which_the_bare_block_rests_are_shown_without_a_pendulum():
    bare = dataclasses.replace(
        designs.band().bare,
        value=-0.1,
        evaluation=designs.evaluation(np.zeros(8), 0.0, kind=np.full((1, 8), 2)),
        exact=designs.motions(np.zeros(8), 0.0, "rest"),
    )
    none = {f"screened_{name}": np.zeros(0, kind) for name, kind in (("value", float), ("feasible", bool))}
    none |= {"screened": np.zeros((0, 3)), "ends": np.zeros((0, 3)), "end_values": np.zeros(0)}
    empty = designs.search(paths=(), statuses=(), **none)
    design = designs.band(status=DesignStatus.no_uplift, pendulum=None, verified=(), bare=bare, search=empty)
    report = content(design, NONE)
    assert report.verdict.severity is Severity.note
    table, _, conditions = section(report, "The settled motion")
    assert row(table, "worst tilt without a pendulum")[1].startswith("none: at rest with 10.0%")
    assert conditions.head == ("condition", "bare tilt (rad)", "bare kind", "bare from rest")
    assert conditions.rows[0][1:] == (0.0, "rest", "rest")
    assert names(design, NONE) == ("conditions.svg", "drawing.svg")
