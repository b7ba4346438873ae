"""Refinement: the minimum of noisy runs under a limit, which no single trial shows."""

import dataclasses
from typing import Any

import numpy as np
import pytest

import tpd
from tests.designs import RATIOS, SPACE, NoisyProblem, outcomes
from tpd.core.progress import unreported
from tpd.design.optimise import solve_problem
from tpd.design.problem import Problem
from tpd.design.reasons import DesignStatus
from tpd.design.refine import Refinement


def refined(problem: Problem, progress=unreported) -> Refinement:
    return problem.improver(None, progress)


def best_of(here: Refinement, *rejected: np.ndarray) -> np.ndarray:
    best = here.best(rejected)
    assert best is not None
    return best


@pytest.fixture(scope="module")
def refinement():
    return refined(NoisyProblem.of())


def test_the_refinement_finds_the_minimum_within_the_limit(refinement):
    """The limit on the stroke cuts mu off below a half of its range; the minimum there is at (.5, .5, .4)."""
    trials, problem = refinement.trials(), refinement.problem
    best = SPACE.scaled(trials.designs[0])
    assert trials.feasible[0]
    # A share of 0.5 % of the runs may exceed the limit, and the deviation of a run is 2 %.
    assert 0.40 < best[0] < 0.5
    np.testing.assert_allclose(best[1:], [0.5, 0.4], atol=0.12)
    assert problem.tilt(trials.designs[0]) < 0.2 + 0.5 * (best[0] - 0.6) ** 2 + 0.01
    # The common noise shifts all trends alike: differences of designs are more accurate than the trends.
    shift = trials.trend[0] - problem.tilt(trials.designs[0])
    assert abs(shift) < 0.04
    errors = trials.trend - [problem.tilt(x) for x in trials.designs] - shift
    assert np.sqrt(np.mean(errors[:20] ** 2)) < 0.01


def test_trials_are_ordered_from_best_to_worst(refinement):
    trials = refinement.trials()
    m = len(trials.designs)
    assert m == 24 + 32 == refinement.total
    assert trials.names == ("stroke",)
    assert trials.sizes.shape == (m, 1)
    assert np.all(np.diff(trials.feasible.astype(int)) <= 0)
    assert np.all(np.diff(trials.trend[trials.feasible]) >= 0.0)
    assert trials.without_pendulum == pytest.approx(0.6, abs=0.05)
    np.testing.assert_array_equal(trials.undecided, 0)
    # The size over the limit is exceeded in half of the allowed share of the runs.
    largest = 0.5 * np.exp(SPACE.scaled(trials.designs)[:, 0] - 0.5) / 0.5
    np.testing.assert_allclose(trials.sizes[:, 0], largest * np.exp(0.02 * 2.6), rtol=0.03)
    i = trials.best_without("stroke")
    assert trials.trend[i] == trials.trend.min()
    assert trials.best_without() is None or trials.sizes[trials.best_without(), 0] <= 1.0


def test_all_trials_of_a_refinement_share_one_seed():
    problem, counts = NoisyProblem.of(), []
    here = refined(problem, lambda *count: counts.append(count))
    assert len(problem.asked) == 1 + len(here.runs)
    assert len(trial := set(problem.asked)) == 1
    assert counts == [("trial runs", i, here.total) for i in range(1, here.total + 1)]
    again = refined(NoisyProblem.of())
    np.testing.assert_array_equal(again.designs, here.designs)
    assert here.best([]) is not None
    (comparison,) = {(kind, seed) for kind, seed in problem.asked if kind == "nonlinear trial"}
    assert {seed for _, seed in trial}.isdisjoint({comparison[1]})
    other = NoisyProblem.of(ensemble=tpd.Ensemble(size=64, seed=1))
    refined(other)
    assert trial.isdisjoint(other.asked)


class Longer(NoisyProblem):
    """The nonlinear model has a longer swing than the linear one."""

    def runs(self, design, seed, equations="linear"):
        runs = super().runs(design, seed, equations)
        more = 1.1 if equations == "nonlinear" else 1.0
        return dataclasses.replace(runs, settled_swing=more * runs.settled_swing, swing=more * runs.swing)


def test_nonlinear_comparisons_correct_the_trend_of_a_limit():
    here = refined(Longer(**NoisyProblem.of().inputs))
    first = SPACE.scaled(here.trials().designs[0])[0]
    best = SPACE.scaled(best_of(here))
    # The swing is proportional to the exponential of the share of mu.
    assert first - best[0] == pytest.approx(np.log(1.1), abs=0.04)
    np.testing.assert_allclose(best[1:], [0.5, 0.4], atol=0.15)
    assert 0.42 < 1.1 * 0.5 * np.exp(best[0] - 0.5) < 0.5


def test_a_design_rejected_by_a_limit_moves_the_next_design_inside():
    here = refined(NoisyProblem.of())
    first = best_of(here)
    here.learn(first, outcomes([0.3] * 64, 0.55, design=first))
    second = best_of(here, first)
    assert SPACE.scaled(first)[0] - SPACE.scaled(second)[0] == pytest.approx(np.log(1.1), abs=0.05)


def test_runs_without_a_result_are_counted_and_do_not_bias_the_trend():
    problem = NoisyProblem.of(unanswered=0.2)
    trials = refined(problem).trials()
    assert 0.15 < trials.undecided.mean() / 64 < 0.25
    assert abs(trials.trend[0] - problem.tilt(trials.designs[0])) < 0.04
    none = NoisyProblem.of(unanswered=1.1)
    here = refined(none)
    assert here.merit is None
    trials = here.trials()
    assert np.all(np.isnan(trials.value))
    np.testing.assert_array_equal(trials.undecided, 64)
    assert here.equivalent(trials.designs[0]) is None
    assert trials.best_without() is None


def test_proposed_designs_keep_the_limits_that_need_no_run():
    """The body of a heavy bob exceeds its limit on the mass without any motion."""
    mass = 0.12 * float(NoisyProblem.of().scene.block.mass)
    problem = NoisyProblem.of(limits=(tpd.limits.Mass(mass),))
    here = Refinement(problem, unreported, 60)
    here.evaluate(problem.candidates())
    for distance in (0.05, 0.02):
        designs = here.next(8, distance)
        assert 0 < len(designs) <= 8
        assert here.problem.possible(designs).all()
        at = SPACE.logarithms(designs)
        assert (np.linalg.norm(at[:, None] - at, axis=-1) + np.eye(len(at))).min() > distance
    assert not here.problem.possible(SPACE.unscaled(np.array([[0.9, 0.5, 0.4]])))[0]
    # Without a trend designs are drawn from the space.
    assert Refinement(problem, unreported, 60).next(8, 0.05).shape == (8, 3)


def test_designs_with_which_fewer_runs_rest_are_avoided():
    """Of 60 % of the runs that rest without a pendulum a light bob keeps all, and a heavy one few."""

    class Resting(NoisyProblem):
        def runs(self, design, seed, equations="linear"):
            share = 0.6 if design is None else 0.6 - 0.5 * SPACE.scaled(np.asarray(design))[0]
            tilt = 0.3 + 0.05 * np.random.default_rng(seed).random(64)
            return outcomes(np.where(np.arange(64) < 64 * share, 0.0, tilt))

    given = NoisyProblem.of(limits=()).inputs
    here = refined(Resting(**given))
    light, heavy = here.excess(SPACE.unscaled(np.array([[0.05, 0.5, 0.5], [0.9, 0.5, 0.5]])))
    assert light < 0.0 < heavy
    assert SPACE.scaled(here.designs[here.order()[0]])[0] < 0.3


def test_equivalent_designs_enclose_the_best_design_and_keep_the_limit(refinement):
    best = refinement.trials().designs[0]
    low, high = SPACE.scaled(refinement.equivalent(best))
    assert np.all(low <= SPACE.scaled(best))
    assert np.all(SPACE.scaled(best) <= high)
    assert high[0] < 0.5
    assert np.all(high - low < 0.7)
    assert refinement.problem.tilt(SPACE.unscaled((low + high) / 2)) < 0.25


class Falling(NoisyProblem):
    """The block overturns in all runs but one of each design."""

    def runs(self, design, seed, equations="linear"):
        tilt = np.where(np.arange(self.count) == 0, 0.2, np.inf)
        return outcomes(tilt, 0.1, design=RATIOS if design is None else design, seed=seed)


def test_a_limit_without_surviving_runs_counts_as_exceeded():
    here = refined(Falling(**NoisyProblem.of().inputs))
    trials = here.trials()
    assert np.isnan(trials.sizes).all()
    assert not trials.feasible.any()
    assert trials.best_without() is None
    assert here.excess(trials.designs[:1])[0] == np.inf
    found = solve_problem(here.problem)
    assert (found.status, found.validated) == (DesignStatus.none_feasible, ())
    (refusal,) = found.refusals
    assert refusal.startswith("the block overturns in so many trial runs")


def test_a_run_with_unknown_swing_counts_as_over_the_limit():
    class Unknown(NoisyProblem):
        def runs(self, design, seed, equations="linear"):
            found = super().runs(design, seed, equations)
            unknown = (np.arange(self.count) < 16) & (design is not None and design[0] > 0.1)
            return dataclasses.replace(found, settled_swing=np.where(unknown, np.nan, found.settled_swing))

    problem = Unknown(**NoisyProblem.of(limits=(tpd.limits.Stroke(1.5),)).inputs)
    trials = refined(problem).trials()
    heavy = trials.designs[:, 0] > 0.1
    assert np.all(trials.sizes[heavy] > 1.0)
    assert np.all(trials.sizes[~heavy] < 1.0)
    assert problem.over_limit(trials.designs[heavy][0], problem.runs(trials.designs[heavy][0], 1))[0] == 0.25


class Overturning(NoisyProblem):
    """A long pendulum reduces the tilt, and a short one the share of the runs that overturn."""

    def runs(self, design, seed, equations="linear"):
        length = 0.0 if design is None else SPACE.scaled(np.asarray(design))[1]
        lost = np.arange(64) < 64 * (0.5 if design is None else 0.1 + 0.2 * length)
        tilt = 0.7 if design is None else 0.7 - 0.6 * length
        return outcomes(
            np.where(lost, np.inf, tilt), 0.1, design=RATIOS if design is None else design, seed=seed
        )


@pytest.mark.parametrize(("reduce", "length"), [("tilt", 1.0), ("overturning", 0.0), (None, 0.0)])
def test_the_search_minimises_the_measure_of_the_requirements(reduce, length):
    inputs: Any = NoisyProblem.of(limits=(), requirements=tpd.limits.Requirements(reduce=reduce)).inputs
    assert SPACE.scaled(best_of(refined(Overturning(**inputs))))[1] == pytest.approx(length, abs=0.05)
