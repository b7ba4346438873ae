"""Whether a pendulum can be hung: the reasons of the verification, counts of runs, and what else is told."""

import dataclasses
import math
import tomllib

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.analysis.compare_models import nonlinear
from tpd.cli.config import job_of
from tpd.cli.new import template
from tpd.core.bob import Bob
from tpd.core.conditions import Conditions
from tpd.design import suitability as module
from tpd.design.reasons import Reason, ReasonKind, Step
from tpd.design.suitability import Motions, Suitability, motions, neighbours, suitability
from tpd.design.worth import Worth

TOWER = tpd.Scene(
    tpd.Block(width=2.0, height=9.0, mass=41500.0, radius_of_gyration=2.7, friction=0.02, cavity_width=1.6),
    tpd.Harmonic(amplitude=0.1, frequency=0.8),
)
HUNG = TOWER.pendulum(mass_ratio=0.08, length_ratio=0.22, damping_ratio=0.2)


def some(*amplitudes, angle=0.1) -> Motions:
    """Motions of these amplitudes."""
    sizes = np.array(amplitudes)
    over = np.isinf(sizes)
    status = np.where(over, "overturned", np.where(sizes == 0.0, "rest", "rocking"))
    far = np.where(over, np.inf, angle)
    return Motions(status=status, amplitude=sizes, settled=far, way=far)


def case(
    hung: Motions, bare: Motions, several: bool = False, reasons=(), needed: bool = True, **more
) -> Suitability:
    """A pendulum in the tower with motions under its own shaking and under two others."""
    return Suitability(
        scene=TOWER,
        pendulum=HUNG,
        bob=Bob(),
        check=CHECK,
        shakings=Conditions({"frequency": np.array([1.0, 0.99, 1.01])}),
        several=several,
        hung=hung,
        bare=bare,
        verified=designs.verified(reasons=reasons, **more),
        needed=needed,
        worth=Worth(),
    )


CHECK = designs.study().comparison
CALM = some(0.05, 0.05, 0.05), some(0.1, 0.1, 0.1)
INF = math.inf


def reason(kind, **more) -> Reason:
    return Reason(step=Step.benefit, kind=kind, **more)


@pytest.mark.parametrize(
    ("reasons", "said"),
    [
        ((), ()),
        ((reason(ReasonKind.too_little_benefit),), ("does not help",)),
        ((reason(ReasonKind.worse_condition),), ("does not help",)),
        ((reason(ReasonKind.rests_less),), ("does not help",)),
        ((reason(ReasonKind.rocks_more),), ("does not help",)),
        ((reason(ReasonKind.breaks_limit, limit="worsening"),), ("does not help",)),
        ((reason(ReasonKind.strikes),), ("does not fit",)),
        ((reason(ReasonKind.breaks_limit, limit="room on the way"),), ("does not fit",)),
        ((reason(ReasonKind.breaks_limit, limit="rod and bob within the height"),), ("does not fit",)),
        ((reason(ReasonKind.breaks_limit, limit="mass"),), ("does not fit",)),
        ((reason(ReasonKind.breaks_limit, limit="stroke"),), ("DO NOT USE",)),
        ((reason(ReasonKind.overturns_more),), ("DO NOT USE",)),
        ((reason(ReasonKind.does_not_settle),), ("DO NOT USE",)),
        (
            (reason(ReasonKind.overturns_more), reason(ReasonKind.strikes), reason(ReasonKind.rests_less)),
            ("does not help", "does not fit", "DO NOT USE"),
        ),
        # Of several conditions that break a limit the first is told.
        ((reason(ReasonKind.breaks_limit, limit="room", condition=c) for c in "ab"), ("does not fit",)),
    ],
)
def test_a_reason_of_the_verification_is_a_refusal_and_the_gravest_is_the_last(reasons, said):
    refusals = case(*CALM, reasons=tuple(reasons)).refusals
    assert tuple(x.split(":")[0] for x in refusals) == said


def test_where_the_bare_block_rests_no_pendulum_helps():
    (said,) = case(*CALM, needed=False).refusals
    assert said == "does not help: under all conditions the bare block settles at rest: none is needed"


def test_strikes_and_overturnings_are_counted():
    """Two of forty runs overturn with the pendulum, and 38 stand."""
    said = case(*CALM, strikes=2 / 38).counted
    assert said.startswith("Over 40 paired runs of the nonlinear equations (seed 0): 66% less tilt (95 % ")
    assert said.endswith(
        "5.0% overturn, 50.0% without; the bob strikes a wall in 2 of the 38 that stand (5.3%, and 1.0% is "
        "allowed)."
    )
    fresh = case(*CALM, strikes=math.nan, chosen_by=designs.benefit(designs.paired())).counted
    assert fresh.startswith("Over 40 fresh paired runs")
    assert fresh.endswith("50.0% without. No room for the bob is asked for.")


@pytest.mark.mends("runs without an answer counted as standing where strikes are counted")
def test_runs_without_an_answer_are_not_counted_as_standing():
    pair, number = designs.paired(), np.arange(40)
    status = np.where((number >= 2) & (number < 12), "event_bound", pair.hung.status)
    pair = dataclasses.replace(pair, hung=dataclasses.replace(pair.hung, status=status))
    said = case(*CALM, strikes=2 / 28, paired=pair).counted
    assert "a wall in 2 of the 28 that stand (7.1%, and 1.0% is allowed); 10 have no answer" in said


def test_shakings_beside_the_own_one_are_counted():
    found = case(some(INF, 0.2, INF), some(INF, 0.1, INF))
    assert (found.tried, found.lost, found.worse) == (2, (1, 1), 1)
    assert case(*CALM, several=True).around == "2 conditions"
    assert case(*CALM).around == "2 shakings within 1 % in amplitude or frequency"


def test_the_reach_is_that_of_the_motions_that_stand():
    at = HUNG.length * math.sin(0.1) + Bob().radius(HUNG.mass)
    assert case(some(0.05, INF, INF), some(0.1, 0.1, 0.1)).reach == pytest.approx((at, at), rel=1e-12)
    assert case(some(INF, 0.05, 0.05), some(0.1, 0.1, 0.1), True).reach == pytest.approx((at, at), rel=1e-12)
    assert all(map(math.isnan, case(some(INF, 0.05, 0.05), some(0.1, 0.1, 0.1)).reach))


def test_motions_are_those_of_the_nonlinear_equations():
    found = motions(TOWER, None, neighbours())
    assert len(found.status) == 8
    scene = dataclasses.replace(TOWER, motion=tpd.Harmonic(amplitude=0.1, frequency=0.8 * 1.01))
    amplitude, _, status = nonlinear(scene.parameters())
    assert found.status[7] == status == "rocking"
    # Followed until it repeats itself, not polished: the last periods still change by that much.
    assert found.amplitude[7] == pytest.approx(amplitude, abs=1e-5)
    assert found.way[7] >= found.settled[7] > 0.0


JOB = job_of(tomllib.loads(template("chimney")))
FEW = Worth(runs=64)


def asked(**changes) -> "module.Question":
    """Question of the chimney's job, with fewer runs."""
    given = {"scene": JOB.scene, "space": JOB.space, "limits": JOB.limits, "method": JOB.method, "worth": FEW}
    return module.Question(**(given | changes))


STRIKING = tpd.Pendulum(mass=774.3, length=0.5733, damping_ratio=0.5941)
"""The best of the chimney's job from rest: from other starts it strikes a wall in a quarter of the runs."""
OFFERED = tpd.Pendulum(mass=563.2, length=0.5213, damping_ratio=0.5981)


def kinds(v) -> list[str]:
    return [reason.kind.name for reason in v.reasons]


@pytest.mark.mends("a pendulum that strikes a wall in a quarter of the runs was said to fit")
def test_what_optimise_refuses_is_refused():
    found = suitability(JOB.scene, STRIKING, models=("uplift",))
    assert any(said.startswith("does not fit: ") for said in found.refusals)
    assert kinds(found.verified) == ["strikes"]
    assert found.verified.strikes == pytest.approx(126 / 475)
    assert "the bob strikes a wall in 126 of the 475 that stand (26.5%, and 1.0% is allowed)" in found.counted
    assert found.several
    assert found.around == "10 conditions"


def test_what_is_refused_by_a_limit_has_its_runs_counted_all_the_same():
    limits = (*JOB.limits, tpd.limits.Mass(500.0))
    v, _ = module.judged(asked(limits=limits), OFFERED)
    assert [reason.limit for reason in v.reasons] == ["mass"]
    assert v.reasons[0].value == pytest.approx(563.2 / 500.0)
    assert v.paired.hung.ensemble.seed == 0
    v, _ = module.judged(asked(limits=(tpd.limits.Stroke(0.1), tpd.limits.Room())), OFFERED)
    assert "stroke" in [reason.limit for reason in v.reasons]
    assert v.benefit.runs == 64


def test_what_nothing_speaks_against_is_judged_by_fresh_runs():
    found = suitability(JOB.scene, OFFERED, asked=asked(), models=("uplift",))
    assert found.refusals == ()
    assert found.verified.source == "check"
    assert found.verified.paired.hung.ensemble.seed == 2
    assert found.verified.chosen_by is not None
    assert found.needed


def test_a_pendulum_outside_of_the_space_is_asked_as_well():
    narrow = tpd.DesignSpace(mass_ratio=(0.1, 0.2), length_ratio=(0.5, 1.0), damping_ratio=0.1)
    v, verification = module.judged(asked(space=narrow), OFFERED)
    assert kinds(v) == []
    np.testing.assert_allclose(v.design, [563.2 / 16280.0, 0.5213 / 5.0, 0.5981], rtol=1e-12)
    assert verification.objective.space.mass_ratio == (563.2 / 16280.0, 0.2)


def test_where_nothing_lifts_the_block_none_is_needed():
    calm = dataclasses.replace(tpd.paper_scene(), motion=tpd.Harmonic(amplitude=0.001, frequency=2.5))
    assert module.rests(module.Question(scene=calm))
    assert not module.rests(asked())


def test_under_the_motion_itself_alone_its_neighbours_are_told():
    exactly = asked(conditions=Conditions.exactly(), limits=(tpd.limits.Stroke(0.5),), method=None)
    found = suitability(JOB.scene, OFFERED, asked=exactly, models=("uplift",))
    assert not found.several
    assert found.tried == 8
    assert math.isnan(found.verified.strikes)


def test_a_block_without_a_cavity_has_no_pendulum_inside():
    solid = dataclasses.replace(JOB.scene, block=dataclasses.replace(JOB.scene.block, cavity_width=None))
    with pytest.raises(ValueError, match="`cavity_width`"):
        suitability(solid, OFFERED)
