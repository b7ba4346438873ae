"""First guess of a pendulum: rules of thumb that need no search."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.designs import BLOCK, GROUND, NoisyProblem, records
from tpd.answers.statistics import quantile_of
from tpd.design.first_guess import first_guess, follow_guess, rule_of_thumb
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


def test_the_first_guess_for_records_has_a_longer_period_than_the_ground_motion():
    problem = problem_of(BLOCK, **GROUND)
    guess = first_guess(problem)
    motions = [m for m in problem.conditions.motions if not isinstance(m, tpd.Harmonic)]
    length = float(problem.pendulum(guess).length)
    assert np.median([float(relative_length(length, m)) for m in motions]) >= 1.5
    assert guess[1] <= 0.65
    # The bob keeps its clearance at the largest angle that is allowed.
    assert problem.possible(guess[None], swing=0.5)[0]


def test_in_a_cavity_a_heavy_bob_on_a_shorter_rod_is_preferred_to_a_light_bob_on_the_longest():
    block = tpd.Block(width=1.6, height=8.0, mass=13_000.0, cavity_width=1.28)
    conditions = tpd.Conditions.records([tpd.records.el_centro()], [2.0, 3.0])
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.1), damping_ratio=(0.05, 1.0))
    problem = problem_of(block, space, conditions=conditions, validation_share=0.0)
    guess, (longest, _, swing) = first_guess(problem), problem.rule_sizes
    lengths = np.linspace(guess[1], longest, 50)
    light = np.array([(space.ends[0, 0], length, guess[2]) for length in lengths])
    assert problem.possible(light, swing).sum() > 5
    assert guess[0] > 5.0 * space.ends[0, 0]
    # No pendulum of the same damping that keeps the limits has a clearly larger product.
    rng = np.random.default_rng(0)
    others = np.stack(
        [rng.uniform(0.01, 0.1, 500), rng.uniform(0.02, longest, 500), np.full(500, guess[2])], 1
    )
    keeps = problem.possible(others, swing)
    products = np.sqrt(others[:, 0]) * np.cbrt(others[:, 1])
    assert products[keeps].max() < 1.03 * np.sqrt(guess[0]) * np.cbrt(guess[1])


def test_the_rule_has_the_largest_mass_that_keeps_the_limits_in_runs():
    conditions = tpd.Conditions.records(records(12), (1.5, 4.0))
    tower = tpd.Block(width=1.6, height=8.0, mass=13_000.0)
    for width, is_bound in ((1.28, True), (None, False)):
        block = dataclasses.replace(tower, cavity_width=width)
        limits = [tpd.limits.Stroke(), *([tpd.limits.Clearance()] if width else [])]
        made = problem_of(block, conditions=conditions, limits=limits)
        rule = rule_of_thumb(made)

        def excess(design, made=made):
            runs = made.validation_runs(design, made.run_seed(1, 1))
            sizes = made.sizes_in_runs(design, runs)
            return max(quantile_of(x, made.safe_level) for x in sizes.values())

        assert excess(rule) <= 1.0
        if not is_bound:
            # No limit binds, and the first guess remains.
            np.testing.assert_array_equal(rule, first_guess(made))
            continue
        # The damper is the strongest one, and a slightly larger bob on a longer rod exceeds a limit.
        assert rule[2] == made.space.ends[1, 2]
        longer = rule * [1.3, 1.15, 1.0]
        assert not made.possible(longer[None])[0] or excess(longer) > 1.0
        # A smaller cavity leaves less of the mass.
        narrow = dataclasses.replace(tower, cavity_width=1.0)
        narrow = problem_of(narrow, conditions=conditions, limits=limits)
        assert rule_of_thumb(narrow)[0] < rule[0]


def test_a_space_that_excludes_the_length_of_the_rule_has_no_first_guess(harmonic):
    problem = harmonic.problem
    space = tpd.DesignSpace(length_ratio=(0.01, 0.02))
    shorter = problem_of(problem.scene, space=space, limits=problem.limits)
    assert first_guess(shorter) is None
    assert follow_guess(shorter, harmonic.runs) is None
    assert first_guess(NoisyProblem.of()) is None
