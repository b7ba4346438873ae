"""First guess of a pendulum: rules of thumb that need no search."""

import numpy as np
import pytest

import tpd
from tests.designs import BLOCK, GROUND, NoisyProblem
from tpd.design.first_guess import first_guess, follow_guess
from tpd.design.optimise import problem_of
from tpd.theory import relative_length


def test_the_first_guess_under_a_harmonic_is_the_lightest_pendulum_without_uplift(harmonic):
    problem = harmonic.problem
    guess = first_guess(problem)
    excitation, pendulum = problem.scene.excitation, problem.pendulum(guess)
    # l = g/omega^2 + alpha/swing.
    length = float(problem.scene.gravity) / excitation.rate**2 + excitation.amplitude / 0.5
    assert pendulum.length == pytest.approx(length, rel=1e-12)
    assert pendulum.damping_ratio == pytest.approx(np.clip(0.3, *problem.space.ends[:, 2]))
    assert problem.possible(guess[None])[0]
    # A heavier bob on the same rod exceeds a limit or the space.
    heavier = guess * [1.2, 1.0, 1.0]
    assert heavier[0] > problem.space.ends[1, 0] or not problem.possible(heavier[None])[0]


def test_the_first_guess_is_one_of_the_trial_designs(harmonic):
    design = harmonic
    assert np.isclose(design.trials.designs, first_guess(design.problem)).all(axis=1).any()


def test_the_first_guess_for_records_has_a_longer_period_than_the_ground_motion():
    problem = problem_of(BLOCK, **GROUND)
    guess = first_guess(problem)
    motions = [m for m in problem.conditions.motions if not isinstance(m, tpd.Harmonic)]
    length = float(problem.pendulum(guess).length)
    assert np.median([float(relative_length(length, m)) for m in motions]) >= 1.5
    assert guess[1] <= 0.65
    # The bob keeps its clearance at the largest angle that is allowed.
    assert problem.possible(guess[None], swing=0.5)[0]


def test_a_space_that_excludes_the_length_of_the_rule_has_no_first_guess(harmonic):
    problem = harmonic.problem
    space = tpd.DesignSpace(length_ratio=(0.01, 0.02))
    shorter = problem_of(problem.scene, space=space, limits=problem.limits)
    assert first_guess(shorter) is None
    assert follow_guess(shorter, 0) is None
    assert first_guess(NoisyProblem.of()) is None
