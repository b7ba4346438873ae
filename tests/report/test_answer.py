"""The answer in at most 25 lines: verdict, pendulum, one comparison, what limits it."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from tpd.design.result import DesignStatus, Nearest
from tpd.design.study import Study, build_of
from tpd.design.verified import ReasonKind

from tests import designs
from tpd.design.criteria import Room, Stroke
from tpd.report.answer import MOST, answer, verdict
from tpd.report.blocks import Severity

NONE = Study()
LIMITS = [dataclasses.replace(designs.REASON, limit=f"limit {i}" * 12) for i in range(40)]
CASES = {
    "one condition": (designs.single(), designs.study()),
    "neighbourhood": (designs.around(), designs.study()),
    "band": (designs.band(), designs.study(responses=None)),
    "refused": (designs.refused(), NONE),
    "forty reasons": (designs.all_refused(designs.verified(reasons=tuple(LIMITS))), NONE),
}


@pytest.mark.parametrize("case", CASES)
def test_the_answer_has_at_most_25_lines_and_ends_with_the_report(case):
    said = answer(*CASES[case], Path("a folder")).splitlines()
    assert len(said) <= MOST == 25
    assert max(map(len, said)) <= 100
    assert said[-1] == "  again      tpd optimise --scene 'a folder'/scene.toml --out 'a folder'-again"
    assert "a folder/report." in said[-2]
    assert said[0].startswith(verdict(CASES[case][0]).text[:40])
    # A long list of reasons is cut where the report goes on.
    assert any("(more in the report)" in line for line in said) is (case == "forty reasons")


def test_the_verdict_has_the_benefit_with_its_interval():
    said = verdict(designs.around(losses=(designs.loss_case("friction"),))).text
    # 1 - (2 + 38 * 0.2)/(20 + 20 * 0.4)
    worth = r"WORTH HANGING under the stated conditions: 66% less tilt \(95 %: \d+% to \d+%\)\. "
    assert re.fullmatch(worth + r"No verdict of safety\.", said)
    hangs = "THE BENEFIT HANGS ON THE LOSSES: it is not shown where the block loses energy by impacts (0%)."
    assert hangs in verdict(designs.around()).text


def test_what_the_search_did_not_ask_for_comes_before_the_benefit():
    one, point = "knows one shaking and none beside it", "takes a bob without size and no walls:"
    for design, said in (
        (designs.single(), f"{one} and {point}"),
        (designs.single(limits=(Stroke(), Room())), f"{one}:"),
        (designs.band(), point),
    ):
        first = "FOUND, BUT NOT TO BE HUNG AS IT IS, since the search"
        assert verdict(design).text.startswith(f"{first} {said}")


def test_every_share_is_of_one_set_of_runs_that_is_named():
    said = answer(*CASES["neighbourhood"])
    assert "40 paired runs of the nonlinear equations, seed 0; overturned counts as toppled" in said
    row = next(line for line in said.splitlines() if line.lstrip().startswith("overturned  "))
    assert row.split()[1:4] == ["5.0%", "50.0%", "-45.0"]


def test_the_pendulum_is_said_as_it_is_built_with_two_digits_where_others_do_as_well():
    said = answer(designs.single(), Study(build=build_of(designs.single())))
    assert "pendulum   acts as a point of 1.62 kg on 0.12 m" in said
    assert "bob        1.69 kg as built: a solid ball of steel, 0.0744 m wide" in said
    assert "rod        0.115 m from the hinge to the bob's centre, as built" in said
    # sqrt(9.80665/0.12)/(2 pi)
    assert "by itself  1.44 Hz, a period of 0.695 s, without the damper" in said
    design = designs.single(alike=np.array([[0.08, 0.5, 0.1], [0.12, 0.7, 0.1]]))
    said = answer(design, Study(build=build_of(design)))
    assert "acts as a point of 1.6 kg on 0.12 m (1.3 to 1.9 kg do as well)" in said


def test_a_refusal_names_the_nearest_and_what_is_against_it_gravest_first():
    limits = [dataclasses.replace(designs.REASON, condition=f"{f} Hz") for f in (1, 2, 3)]
    rests = designs.against(ReasonKind.rests_less, 1.0, 9.0, total=40)
    reasons = (*limits, rests, designs.LITTLE, designs.STRIKES)
    said = answer(designs.all_refused(designs.verified(reasons=reasons)), NONE)
    assert said.startswith("DANGER: NO PENDULUM WORTH HANGING: by the paired runs of the nonlinear equations")
    assert "nearest    1.62 kg on 0.12 m, ζ = 0.1: not offered" in said
    said = " ".join(said.split())
    order = "strikes a wall in 27.0%", "by 0.2 of it at 1 Hz", "at rest in 1 of 40"
    assert [*order] == sorted(order, key=said.index)
    assert "2 Hz" not in said.partition("against it")[2]


@pytest.mark.mends("the headline named the design of the largest benefit, whose bob strikes in every run")
def test_the_nearest_is_the_one_that_misses_its_requirements_by_the_least():
    strikes = [(designs.against(ReasonKind.strikes, share, 0.01),) for share in (1.0, 0.02)]
    far, near = (
        designs.verified(mass_ratio=mu, reasons=reasons, benefit=designs.benefit(designs.paired(lost)))
        for mu, reasons, lost in zip((0.2, 0.05), strikes, (1, 4), strict=True)
    )
    early = designs.verified(mass_ratio=0.15, reasons=(designs.REASON,), benefit=None, paired=None)
    for order in ((far, near, early), (early, near, far)):
        said = answer(designs.all_refused(*order), NONE)
        assert "nearest    0.811 kg on 0.12 m, ζ = 0.1" in said
        assert "strikes a wall in 2.0% of the cases, and 1.0% is allowed" in " ".join(said.split())


@pytest.mark.mends("every refusal was a danger, and 'keep to all limits' as well")
def test_a_refusal_is_a_danger_where_it_is_about_overturning_or_strikes():
    for reason, severity in ((designs.LITTLE, Severity.note), (designs.STRIKES, Severity.danger)):
        bad = (designs.verified(reasons=(reason,)),)
        alone = designs.single(status=DesignStatus.refused, pendulum=None, verified=bad)
        assert verdict(alone).severity is severity
    assert verdict(designs.single()).severity is Severity.note


def test_what_stands_against_the_nearest_is_said():
    nearest = Nearest(design=np.array(designs.RATIOS), broken=(designs.REASON,))
    empty = {"status": DesignStatus.none_feasible, "pendulum": None, "verified": ()}
    said = answer(designs.single(nearest=nearest, **empty), NONE)
    assert said.startswith("NO PENDULUM WORTH HANGING: no design that was tried in this space keeps to the")
    assert "nearest    1.62 kg on 0.12 m" in said
    assert f"against it {designs.REASON}"[:60] in said


def test_what_was_not_asked_stands_with_its_command():
    said = answer(*CASES["neighbourhood"], Path("tpd-design"))
    assert "earthquakes: tpd fragility tpd-design --records el-centro loma-prieta" in said
    assert "--engine mujoco" in said
    assert "not asked" not in answer(*CASES["refused"], Path("tpd-design"))
