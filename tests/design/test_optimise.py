"""The main job: answers with one condition and with several, Ctrl-C, statuses."""

import dataclasses

import numpy as np
import pytest
from tpd.design.result import DesignStatus
from tpd.design.survey import ON_THE_WAY
from tpd.design.verified import ReasonKind, Step

import tpd
from tests.design.conftest import ANY_WORTH, LIGHT, ONE, SCENE, WIDE
from tpd.design import optimise
from tpd.design.optimise import solve
from tpd.design.problem import Problem
from tpd.design.search import SearchStatus

CALM = dataclasses.replace(SCENE, motion=tpd.Harmonic(amplitude=0.001, frequency=2.5))
"""A shaking that lifts no block, and under which no orbit attracts."""
FEW = tpd.Descent(searches=3, screening=16, steps=3, model=tpd.Piecewise())
RUNS = tpd.Ensemble(size=16, periods=30)
EXACTLY = {"conditions": tpd.Conditions.exactly(), "worth": ANY_WORTH}


def is_verified(design) -> bool:
    """Whether an offered design has gone through every step, and nothing speaks against it."""
    v = design.winner
    through = all(step is not None for step in (v.rest, v.paired, v.benefit))
    return through and v.reasons == () and v is design.verified[-1]


def same(a, b) -> bool:
    """Whether two answers are the same to the last digit."""
    designs = [np.array([v.design for v in d.verified]) for d in (a, b)]
    return (
        a.status is b.status
        and np.array_equal(*designs)
        and np.array_equal(a.search.ends, b.search.ends)
        and np.array_equal(a.search.screened, b.search.screened)
        and [v.reasons for v in a.verified] == [v.reasons for v in b.verified]
    )


def test_the_answer_is_exact_and_within_the_limits(one):
    assert one.status is DesignStatus.found
    assert is_verified(one)
    exact = tpd.steady_state(SCENE.parameters(one.pendulum))
    assert float(exact.amplitude) == pytest.approx(one.amplitude, rel=1e-9)
    assert float(exact.stroke) == pytest.approx(one.stroke, rel=1e-9)
    low, high = LIGHT.bounds
    assert np.all((one.winner.design[:2] >= low - 1e-12) & (one.winner.design[:2] <= high + 1e-12))
    assert one.pendulum.mass == pytest.approx(one.winner.mass_ratio * SCENE.block.mass)
    assert one.amplitude_without == pytest.approx(0.0833335, abs=1e-6)
    assert one.amplitude < 0.95 * one.amplitude_without
    assert np.all(one.search.mismatch[:, 0] < 1e-3), "the exact solution confirms the ends of the descents"
    assert np.any(one.search.mismatch > 0.0)
    assert one.search.screened.shape == (24, 3)


def test_designs_followed_from_rest_are_verified_until_one_stands(one):
    winner = one.verified[-1]
    assert {v.source for v in one.verified} == {"survey"}
    assert all(v.reasons for v in one.verified[:-1])
    assert not winner.reasons
    assert winner.value < 0.9 * one.bare.value
    ((tilt,),) = winner.rest.severity
    found = tpd.check(SCENE, one.pendulum, stroke=1.5, models=("uplift",))
    assert found.objections == ()
    assert found.top.amplitude / SCENE.block.slenderness == pytest.approx(tilt, rel=1e-5)
    assert found.top.stroke / 1.5 == pytest.approx(1.0 + winner.rest.excess["stroke"][0], rel=1e-5)


def test_one_condition_is_the_same_however_it_is_given(one):
    assert same(one, tpd.optimise(SCENE, LIGHT, **(ONE | {"conditions": tpd.Conditions()})))


@pytest.mark.mends("Ctrl-C in Python became a design, which the caller had to look at")
@pytest.mark.parametrize("stage", ["screening", "searching"])
def test_ctrl_c_is_an_exception(stage):
    def stop(now, *_):
        if now == stage:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tpd.optimise(SCENE, LIGHT, progress=stop, **ONE)


def test_a_block_that_rests_needs_no_pendulum():
    for given in ({"method": FEW}, {"method": ONE["method"], **EXACTLY}):
        design = tpd.optimise(CALM, LIGHT, ensemble=RUNS, **given)
        assert design.status is DesignStatus.no_uplift
        assert design.search.statuses == (), "no search has begun"
        assert (design.pendulum, design.verified) == (None, ())
        assert design.amplitude == design.amplitude_without == 0.0
        assert str(design).startswith("NO PENDULUM IS NEEDED FROM REST")


def test_where_no_design_keeps_to_the_limits_the_nearest_is_told():
    limits = (tpd.limits.Stroke(0.5), tpd.limits.Room(), tpd.limits.Reserve(0.05))
    design = tpd.optimise(SCENE, LIGHT, method=FEW, limits=limits, ensemble=RUNS, **EXACTLY)
    assert design.status is DesignStatus.none_feasible
    assert design.pendulum is None
    assert not np.isfinite(design.search.end_values).any()
    assert {reason.kind for reason in design.nearest.broken} == {ReasonKind.breaks_limit}
    assert {reason.limit for reason in design.nearest.broken} <= {"stroke", "room", "thickness", ON_THE_WAY}
    assert min(reason.value for reason in design.nearest.broken) > 1.0


def test_where_every_pendulum_rocks_more_none_is_offered():
    """Long pendulums with little damping below resonance."""
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.012), length_ratio=(1.9, 2.0), damping_ratio=0.0)
    soft = dataclasses.replace(SCENE, motion=tpd.Harmonic(amplitude=0.03, frequency=1.5))
    design = tpd.optimise(soft, space, method=FEW, limits=(), ensemble=RUNS, **EXACTLY)
    assert design.status is DesignStatus.refused
    assert design.pendulum is None


def test_the_answer_is_better_than_anything_screened_and_comes_from_the_survey(several):
    assert several.status is DesignStatus.found
    assert is_verified(several)
    winner, e = several.winner, several.winner.evaluation
    best = several.search.end_values.min()
    assert best <= several.search.screened_value.min()
    assert best < several.bare.value
    assert best == pytest.approx(0.273, abs=2e-3), "as with 64 starts and 20 frequencies"
    assert winner.exact.stroke[winner.exact.status == "rocking"].max() <= 0.5
    assert e.merit.shape == (1, 5)
    assert e.reserve.min() >= 0.05 * (1.0 - 1e-7)
    assert np.all(e.attracts)
    assert not winner.paired.harms
    assert winner.benefit.low > 0.0
    assert SearchStatus.at_limit in several.search.statuses
    assert {v.source for v in several.verified} == {"survey"}
    # Runs from many starts order those that help.
    first, last = several.surveys
    assert (first.equations, last.equations) == ("linear", "nonlinear")
    known = np.abs(last.designs - several.verified[0].design).max(axis=1)
    assert last.helps[np.argmin(known)]
    assert known.min() < 1e-12
    assert [case.name for case in several.losses] == ["friction", "impacts", "friction and impacts"]
    low, high = several.alike
    assert np.all((low <= winner.design) & (winner.design <= high))


@pytest.mark.mends("the benefit was quoted from the runs that had chosen the design")
def test_the_benefit_is_that_of_runs_that_no_choice_has_seen(several, one):
    for design in (several, one):
        judged = design.winner.paired
        assert judged.hung.ensemble.seed == judged.bare.ensemble.seed == design.ensemble.seed + 2
        assert design.bare.paired is judged.bare
        assert design.winner.chosen_by.runs == design.winner.benefit.runs
        # A refused design has the runs that refused it.
        for v in design.verified[:-1]:
            fresh = any(reason.step is Step.judgement for reason in v.reasons)
            if v.paired is not None:
                assert v.paired.hung.ensemble.seed == design.ensemble.seed + 2 * fresh


def test_of_many_conditions_a_sample_is_searched_under(monkeypatch):
    """The searches' ends are followed and verified under all of them."""
    conditions = tpd.Conditions.scatter(6, friction=0.2, length=0.05, frequency=0.1)
    asked = {"limits": tpd.limits.POINT_BOB, "method": FEW, "worth": ANY_WORTH, "ensemble": RUNS}
    problem = Problem.of(SCENE, WIDE, conditions=conditions, **asked)
    monkeypatch.setattr(optimise, "SEARCHED", 3)
    design = solve(problem)
    assert design.search.description == "3 designs under 3 of the 6 conditions"
    assert design.verified[-1].evaluation.merit.shape == (1, 6)
    assert same(solve(problem), design)


@pytest.mark.mends("a limit on the bob's mass bound the equivalent point, and the body was heavier")
def test_the_bodies_of_verified_designs_keep_the_limit_on_their_mass():
    limits, kg = (tpd.limits.Stroke(1.5), tpd.limits.Mass(0.17), tpd.limits.Room()), 0.17
    space = tpd.DesignSpace(mass_ratio=(0.006, 0.2), damping_ratio=(0.05, 0.4))
    found = tpd.optimise(SCENE, space, **(ONE | {"limits": limits}))
    points = [optimise.pendulum_of(SCENE, v) for v in found.verified]
    built = [tpd.limits.Bob().built(p.mass, p.length, float(SCENE.gravity))[0] for p in points]
    assert built
    assert np.max(built) <= kg * (1.0 + 1e-9)


@pytest.mark.mends("a body that exceeded a limit as built was offered")
def test_a_design_that_exceeds_a_limit_as_built_is_refused_by_its_first_step():
    limits = tpd.limits.Stroke(1.5), tpd.limits.Mass(1.0)
    problem = Problem.of(SCENE, WIDE, **(ONE | {"limits": limits}))
    v = optimise.Verification(problem, None).at_once(np.array([0.06, 0.5, 0.2]))
    (reason,) = (r for r in v.reasons if r.kind is ReasonKind.as_built)
    body = tpd.limits.Bob().built(
        0.06 * SCENE.block.mass, 0.5 * SCENE.block.half_height, float(SCENE.gravity)
    )
    assert 0.06 * SCENE.block.mass < 1.0 < body[0]
    assert (reason.limit, reason.reference) == ("mass of the bob in kg", 1.0)
    assert reason.value == pytest.approx(body[0])
    assert v.paired is None
