"""Whether a pendulum can be hung: the reasons of the verification, counts of runs, and what else is told."""

import dataclasses
import math
import tomllib

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.answers.compare_models import Answer, Check
from tpd.cli.new import template
from tpd.design import suitability as module
from tpd.design.criteria import Worth
from tpd.design.job import job_of
from tpd.design.problem import Problem
from tpd.design.suitability import Suitability, suitability
from tpd.design.verified import Reason, ReasonKind, Step

TOWER = tpd.Scene(
    tpd.Block(width=2.0, height=9.0, mass=41500.0, radius_of_gyration=2.7, friction=0.02, cavity_width=1.6),
    tpd.Harmonic(amplitude=0.1, frequency=0.8),
)
HUNG = TOWER.pendulum(mass_ratio=0.08, length_ratio=0.22, damping_ratio=0.2)


def case(reasons=(), needed=True, **more) -> Suitability:
    """A pendulum in the tower."""
    return Suitability(
        scene=TOWER,
        pendulum=HUNG,
        check=CHECK,
        verified=designs.verified(reasons=reasons, **more),
        needed=needed,
        worth=Worth(),
    )


MODEL = Answer(
    name="exact", amplitude=0.04, stroke=0.3, status="rocking", seconds=0.01, first=1.0, neglects="a < b"
)
CHECK = Check(models=(MODEL,), limit=0.5, bare=0.08)


def reason(kind, **more) -> Reason:
    """A reason of a kind, or of a limit that is broken."""
    known = kind in ReasonKind.__members__
    more |= {"kind": ReasonKind[kind]} if known else {"kind": ReasonKind.breaks_limit, "limit": kind}
    return Reason(step=Step.benefit, **more)


HELP, FIT, USE = "does not help", "does not fit", "DO NOT USE"
SAID = {
    HELP: ("too_little_benefit", "worse_condition", "rests_less", "rocks_more", "worsening"),
    FIT: ("strikes", "as_built", "room on the way", "rod and bob within the height", "mass"),
    USE: ("overturns_more", "overturns", "stroke"),
}


def test_a_reason_of_the_verification_is_a_refusal_and_the_gravest_is_the_last():
    cases = [((reason(kind),), [said]) for said, kinds in SAID.items() for kind in kinds]
    cases += [((), []), ([reason(kinds[0]) for kinds in reversed(SAID.values())], [HELP, FIT, USE])]
    # Of several conditions that break a limit the first is told.
    cases += [([reason("room", condition=c) for c in "ab"], [FIT])]
    for reasons, said in cases:
        assert [x.split(":")[0] for x in case(reasons=tuple(reasons)).refusals] == said


def test_where_the_bare_block_rests_no_pendulum_helps():
    (said,) = case(needed=False).refusals
    assert said == "does not help: under all conditions the bare block settles at rest: none is needed"


def test_strikes_and_overturnings_are_counted():
    """Two of forty runs overturn with the pendulum, and 38 stand."""
    said = case(strikes=2 / 38).counted
    assert said.startswith("Over 40 paired runs of the nonlinear equations (seed 0): 66% less tilt (95 % ")
    assert said.endswith(
        "5.0% overturn, 50.0% without; the bob strikes a wall in 2 of the 38 that stand (5.3%, and 1.0% is "
        "allowed)."
    )
    fresh = case(strikes=math.nan, chosen_by=designs.benefit(designs.paired())).counted
    assert fresh.startswith("Over 40 fresh paired runs")
    assert fresh.endswith("50.0% without. No room for the bob is asked for.")


@pytest.mark.mends("runs without an answer counted as standing where strikes are counted")
def test_runs_without_an_answer_are_not_counted_as_standing():
    pair, number = designs.paired(), np.arange(40)
    status = np.where((number >= 2) & (number < 12), "event_bound", pair.hung.status)
    pair = dataclasses.replace(pair, hung=dataclasses.replace(pair.hung, status=status))
    said = case(strikes=2 / 28, paired=pair).counted
    assert "a wall in 2 of the 28 that stand (7.1%, and 1.0% is allowed); 10 have no answer" in said


JOB = job_of(tomllib.loads(template("chimney")))
FEW = Worth(runs=64)


def asked(scene=JOB.scene, **changes) -> Problem:
    """Question of the chimney's job, with fewer runs."""
    given = {"space": JOB.space, "limits": JOB.limits, "method": JOB.method, "worth": FEW}
    return Problem.of(scene, **(given | changes))


STRIKING = tpd.Pendulum(mass=774.3, length=0.5733, damping_ratio=0.5941)
"""The best of the chimney's job from rest: from other starts it strikes a wall in a quarter of the runs."""
OFFERED = tpd.Pendulum(mass=540.0, length=0.515, damping_ratio=0.5981)


def kinds(v) -> list[str]:
    return [reason.kind.name for reason in v.reasons]


@pytest.mark.mends("a pendulum that strikes a wall in a quarter of the runs was said to fit")
def test_what_optimise_refuses_is_refused():
    found = suitability(JOB.scene, STRIKING, models=("uplift",))
    assert any(said.startswith("does not fit: ") for said in found.refusals)
    assert kinds(found.verified) == ["strikes"]
    assert found.verified.strikes == pytest.approx(127 / 478)
    assert "the bob strikes a wall in 127 of the 478 that stand (26.6%, and 1.0% is allowed)" in found.counted
    assert len(found.verified.rest.bare) == 10


def test_what_nothing_speaks_against_is_judged_by_fresh_runs_also_outside_of_the_space():
    narrow = tpd.DesignSpace(mass_ratio=(0.1, 0.2), length_ratio=(0.5, 1.0), damping_ratio=0.1)
    found = suitability(JOB.scene, OFFERED, asked=asked(space=narrow), models=("uplift",))
    np.testing.assert_allclose(found.verified.design, [540.0 / 16280.0, 0.515 / 5.0, 0.5981], rtol=1e-12)
    assert found.refusals == ()
    assert found.verified.source == "check"
    assert found.verified.paired.hung.ensemble.seed == 2
    assert found.verified.chosen_by is not None
    assert found.needed


def test_where_nothing_lifts_the_block_none_is_needed():
    calm = dataclasses.replace(tpd.paper_scene(), motion=tpd.Harmonic(amplitude=0.001, frequency=2.5))
    assert module.rests(Problem.of(calm))
    assert not module.rests(asked())


@pytest.mark.mends("a step that was not reached kept its reasons for itself")
def test_what_the_first_step_refuses_is_asked_from_rest_as_well(monkeypatch):
    first = Reason(step=Step.exact, kind=ReasonKind.overturns_more, value=3.0, reference=0.0, total=10)
    monkeypatch.setattr(
        module.Verification, "by_events", lambda self, v: dataclasses.replace(v, reasons=(first,))
    )
    v, _ = module.judged(asked(limits=(tpd.limits.Stroke(0.1), tpd.limits.Room())), OFFERED)
    assert v.reasons[0] is first
    assert "stroke" in [reason.limit for reason in v.reasons]
    assert v.benefit.runs == 64
