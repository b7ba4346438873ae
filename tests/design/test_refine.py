"""Refinement: the minimum of noisy runs under a limit, which no single trial shows."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.designs import RATIOS, SPACE, NoisyProblem, outcomes
from tpd.core.progress import unreported
from tpd.design.optimise import solve_problem
from tpd.design.problem import Problem
from tpd.design.reasons import DesignStatus
from tpd.design.refine import Refinement, apart, refine


def refined(problem: Problem, progress=unreported) -> Refinement:
    return refine(problem, problem.candidates(unreported)[0], progress)


@pytest.fixture(scope="module")
def found():
    return refined(NoisyProblem.of())


def test_the_trend_leads_to_the_minimum_within_the_limit(found):
    """The limit on the stroke cuts mu off below a half of its range; the minimum there is at (.5, .5, .4)."""
    trials, problem = found.trials(), found.problem
    best = SPACE.scaled(trials.designs[0])
    assert trials.feasible[0]
    # A share of 1 % of the runs may exceed the limit, and the deviation of a run is 2 %.
    assert 0.40 < best[0] < 0.5
    np.testing.assert_allclose(best[1:], [0.5, 0.4], atol=0.12)
    least = 0.2 + 0.5 * (best[0] - 0.6) ** 2
    assert problem.tilt(trials.designs[0]) < least + 0.01
    # The trial of the least mean tilt is the most favourable by chance, and is a worse design.
    lucky = np.argmin(np.where(trials.feasible, trials.value, np.inf))
    assert trials.value[lucky] < trials.trend[0]
    assert problem.tilt(trials.designs[0]) <= problem.tilt(trials.designs[lucky])
    assert abs(trials.trend[0] - problem.tilt(trials.designs[0])) < 0.015


def test_without_the_limit_the_minimum_is_that_of_all_designs():
    problem = NoisyProblem.of(limits=())
    trials = refined(problem).trials()
    np.testing.assert_allclose(SPACE.scaled(trials.designs[0]), [0.6, 0.5, 0.4], atol=0.12)
    assert (trials.names, trials.sizes.shape) == ((), (len(trials.designs), 0))


def test_trials_are_a_table_the_best_first(found):
    trials = found.trials()
    m = len(trials.designs)
    assert m == 24 + 4 * 8 == found.total
    assert trials.names == ("stroke",)
    assert trials.sizes.shape == (m, 1)
    assert np.all(np.diff(trials.feasible.astype(int)) <= 0)
    assert np.all(np.diff(trials.trend[trials.feasible]) >= 0.0)
    assert trials.without_pendulum == pytest.approx(0.6, abs=0.05)
    np.testing.assert_array_equal(trials.undecided, 0)
    # The size over the limit is exceeded in the allowed share of the runs.
    largest = 0.5 * np.exp(SPACE.scaled(trials.designs)[:, 0] - 0.5) / 0.5
    np.testing.assert_allclose(trials.sizes[:, 0], largest * np.exp(0.02 * 2.51), rtol=0.03)
    i = trials.best_without("stroke")
    assert trials.trend[i] == trials.trend.min()
    assert trials.best_without() is None or trials.sizes[trials.best_without(), 0] <= 1.0


def test_every_trial_has_its_own_runs():
    problem, counts = NoisyProblem.of(), []
    here = refined(problem, lambda *count: counts.append(count))
    seeds = [seed for _, seed in problem.asked]
    assert len(set(seeds)) == len(seeds) == 1 + len(here.runs)
    assert counts == [("trial runs", i, here.total) for i in range(1, here.total + 1)]
    again = refined(NoisyProblem.of())
    np.testing.assert_array_equal(again.designs, here.designs)
    other = NoisyProblem.of(ensemble=tpd.Ensemble(size=64, seed=1))
    refined(other)
    assert not set(seeds) & {seed for _, seed in other.asked}


def test_runs_without_an_answer_are_counted_and_change_no_estimate():
    problem = NoisyProblem.of(unanswered=0.2)
    trials = refined(problem).trials()
    assert 0.15 < trials.undecided.mean() / 64 < 0.25
    assert abs(trials.trend[0] - problem.tilt(trials.designs[0])) < 0.02
    none = NoisyProblem.of(unanswered=1.1)
    here = refined(none)
    assert here.process is None
    trials = here.trials()
    assert np.all(np.isnan(trials.value))
    np.testing.assert_array_equal(trials.undecided, 64)
    assert here.equivalent(trials.designs[0]) is None
    assert trials.best_without() is None


def test_a_design_without_a_known_run_comes_last(found):
    problem = NoisyProblem.of()
    here = Refinement(problem, unreported, 9)
    designs = SPACE.unscaled(np.random.default_rng(0).random((8, 3)) * [0.4, 1.0, 1.0])
    here.evaluate(designs)
    best = designs[here.order()[0]] + [0.0, 0.0, 1e-3]
    here.add(best, outcomes([np.nan] * 64, design=best))
    here.fit()
    assert here.order()[-1] == 8
    assert len(here.process.seen.value) == 8


def test_proposed_designs_keep_to_the_limits_that_need_no_run():
    """The body of a heavy bob exceeds its limit on the mass without any motion."""
    mass = 0.12 * float(NoisyProblem.of().scene.block.mass)
    problem = NoisyProblem.of(limits=(tpd.limits.Mass(mass),))
    here = Refinement(problem, unreported, 60)
    here.evaluate(problem.candidates(unreported)[0])
    for last in (False, True):
        designs = here.next(0, 8, last)
        assert 0 < len(designs) <= 8
        assert here.problem.possible(designs).all()
        units = SPACE.scaled(designs)
        apart_by = np.linalg.norm(units[:, None] - units, axis=-1) + np.eye(len(units))
        assert apart_by.min() > 0.02
    assert not here.problem.possible(SPACE.unscaled(np.array([[0.9, 0.5, 0.4]])))[0]
    # Without a process designs are drawn from the space.
    assert Refinement(problem, unreported, 60).next(0, 8, False).shape == (8, 3)


def test_where_fewer_blocks_rest_than_without_a_pendulum_designs_give_way():
    """Of 60 % of the runs that rest without a pendulum a light bob keeps all, and a heavy one none."""

    class Resting(NoisyProblem):
        def runs(self, design, seed, equations="linear"):
            share = 0.6 if design is None else 0.6 * (SPACE.scaled(np.asarray(design))[0] < 0.3)
            tilt = 0.3 + 0.05 * np.random.default_rng(seed).random(64)
            return outcomes(np.where(np.arange(64) < 64 * share, 0.0, tilt))

    given = NoisyProblem.of(limits=()).inputs
    here = Refinement(Resting(**given), unreported, 40)
    here.evaluate(here.problem.candidates(unreported)[0])
    light, heavy = (SPACE.scaled(SPACE.unscaled(np.array([[x, 0.5, 0.5]]))) for x in (0.1, 0.9))
    assert here.keeps(light)[0] > 0.5 > here.keeps(heavy)[0]
    assert SPACE.scaled(here.designs[here.order()[0]])[0] < 0.3


def test_equivalent_designs_surround_the_best_and_keep_to_the_limit(found):
    best = found.trials().designs[0]
    low, high = SPACE.scaled(found.equivalent(best))
    assert np.all(low <= SPACE.scaled(best))
    assert np.all(SPACE.scaled(best) <= high)
    assert high[0] < 0.5
    assert np.all(high - low < 0.7)
    assert found.problem.tilt(SPACE.unscaled((low + high) / 2)) < 0.25


def test_neighbours_of_designs_are_left_out():
    problem = NoisyProblem.of()
    designs = SPACE.unscaled(np.array([[0.5, 0.5, 0.5], [0.51, 0.5, 0.5], [0.7, 0.5, 0.5]]))
    np.testing.assert_array_equal(apart(problem, designs, [designs[0]]), designs[2:])
    np.testing.assert_array_equal(apart(problem, designs, []), designs)


@pytest.mark.parametrize("count", [6, 12])
def test_a_limit_holds_for_trials_of_few_runs(count):
    """The limit on the stroke cuts mu off below a half of its range."""
    trials = refined(NoisyProblem.of(count=count)).trials()
    share = SPACE.scaled(trials.designs)[:, 0]
    assert trials.feasible[0]
    assert np.all(share[trials.feasible] < 0.52)
    assert np.isfinite(trials.sizes).all()
    assert np.all(trials.sizes[share > 0.6] > 1.0)


class Falling(NoisyProblem):
    """The block overturns in all runs but one of each design."""

    def runs(self, design, seed, equations="linear"):
        tilt = np.where(np.arange(self.count) == 0, 0.2, np.inf)
        return outcomes(tilt, 0.1, design=RATIOS if design is None else design, seed=seed)


def test_a_limit_that_no_run_can_show_is_not_kept():
    here = refined(Falling(**NoisyProblem.of().inputs))
    trials = here.trials()
    assert np.isnan(trials.sizes).all()
    assert not trials.feasible.any()
    assert trials.best_without() is None
    assert here.keeps(SPACE.scaled(trials.designs[:1]))[0] == 0.0
    found = solve_problem(here.problem)
    assert (found.status, found.validated) == (DesignStatus.none_feasible, ())
    (refusal,) = found.refusals
    assert refusal.startswith("the block overturns in so many trial runs")


def test_a_run_of_unknown_swing_counts_against_a_design():
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
