"""What holds for every question about a design: risks, spaces, conditions, units, wider limits and spaces."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import tpd
from tests.properties.bounded import bounded
from tpd.design.harmonic import HarmonicProblem
from tpd.design.search import search

tilts = arrays.arrays(float, st.integers(1, 20), elements=st.floats(0.0, 1.0))
shares = st.floats(0.01, 1.0)


@bounded(60)
@given(tilts, shares, shares)
def test_a_risk_lies_between_mean_and_worst_and_falls_with_its_share(values, share, other):
    mean, worst = (float(r.of(values)) for r in (tpd.Risk.expected(), tpd.Risk.worst()))
    small, large = sorted((share, other))
    of_small, of_large = (float(tpd.Risk.cvar(s).of(values)) for s in (small, large))
    rounding = 1e-12
    assert mean == pytest.approx(np.mean(values), abs=1e-12)
    assert worst == pytest.approx(np.max(values), abs=1e-12)
    assert mean - rounding <= of_large <= of_small + rounding <= worst + 2.0 * rounding


@bounded(60)
@given(tilts, shares, st.floats(0.0, 3.0), st.floats(0.0, 3.0), st.randoms(use_true_random=False))
def test_a_risk_does_not_depend_on_order_and_follows_shift_and_scale(values, share, shift, factor, random):
    risk = tpd.Risk.cvar(share)
    mixed = list(values)
    random.shuffle(mixed)
    assert float(risk.of(np.array(mixed))) == pytest.approx(float(risk.of(values)), abs=1e-12)
    moved = float(risk.of(factor * values + shift))
    assert moved == pytest.approx(factor * float(risk.of(values)) + shift, abs=1e-10)


@bounded(60)
@given(tilts, tilts, shares)
def test_more_tilt_under_every_condition_does_not_reduce_a_risk(values, more, share):
    assume(values.size == more.size)
    risk = tpd.Risk.cvar(share)
    assert float(risk.of(values)) <= float(risk.of(values + more)) + 1e-12


@bounded(60)
@given(st.floats(0.01, 0.1), st.floats(0.01, 0.9), st.tuples(*3 * [st.floats(0.0, 1.0)]))
def test_scaling_and_unscaling_a_design_are_inverse(low, width, unit):
    space = tpd.DesignSpace(mass_ratio=(low, low + width), damping_ratio=(0.05, 0.6))
    designs = space.unscaled(np.array([unit]))
    np.testing.assert_allclose(space.scaled(designs), [unit], atol=1e-12)
    bottom, top = space.bounds
    assert np.all((designs[0] >= bottom - 1e-12) & (designs[0] <= top + 1e-12))


pendulums = st.tuples(st.floats(0.01, 0.5), st.floats(0.05, 1.9), st.floats(0.0, 1.0))


@bounded(60)
@given(pendulums, st.floats(0.05, 3.0), st.floats(3.0, 9.0))
def test_a_pendulum_can_be_recovered_from_its_ratios(design, width, slender):
    mu, lam, zeta = design
    block = tpd.Block(
        width=width, height=width * slender, mass=1500.0 * width**3 * slender, friction=0.05, restitution=1.0
    )
    scene = tpd.Scene(block, tpd.Harmonic(amplitude=0.01 * width, frequency=1.0 / np.sqrt(width)))
    p = scene.parameters(scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta))
    assert (float(p.mu), float(p.lam), float(p.zeta)) == pytest.approx(design, rel=1e-12)


@bounded(60)
@given(st.floats(0.1, 10.0), st.floats(0.2, 5.0))
def test_a_scale_model_of_a_scene_has_equal_dimensionless_numbers(length, gravity):
    # Lengths by one factor and gravity by another; the frequency by the root of gravity over length.
    one = tpd.paper_scene()
    assume(1.5 < one.gravity * gravity < 30.0)
    block, motion = one.block, one.excitation
    other = tpd.Scene(
        replace(
            block,
            width=block.width * length,
            height=block.height * length,
            mass=block.mass * length**3,
            cavity_width=block.cavity_width * length,
        ),
        tpd.Harmonic(
            amplitude=motion.amplitude * length, frequency=motion.frequency * np.sqrt(gravity / length)
        ),
        gravity=one.gravity * gravity,
    )
    np.testing.assert_allclose(
        [float(x) for x in jax.tree.leaves(other.parameters())],
        [float(x) for x in jax.tree.leaves(one.parameters())],
        rtol=1e-12,
    )


@bounded(40)
@given(st.integers(1, 60), st.integers(0, 1000), st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_scattered_conditions_stay_within_their_widths(size, seed, mass, friction):
    conditions = tpd.Conditions.scatter(size, seed, mass=mass, friction=friction)
    for name, width in (("mass", mass), ("friction", friction)):
        factors = conditions.column(name)
        assert factors.shape == (size,)
        assert np.all(np.abs(factors - 1.0) <= width)
    assert np.all(conditions.column("length") == 1.0)
    again = tpd.Conditions.scatter(size, seed, mass=mass, friction=friction)
    np.testing.assert_array_equal(again.factor_rows(), conditions.factor_rows())


@bounded(40)
@given(st.integers(2, 40), st.integers(1, 40), st.integers(0, 100))
def test_a_subset_contains_only_conditions_of_the_set(count, most, seed):
    band = tpd.Conditions.band(tpd.paper_scene(), 1.0, 4.0, count)
    some = band.subset(most, seed)
    assert len(some) == min(most, count)
    assert set(some.column("frequency")) <= set(band.column("frequency"))


SCENE = tpd.paper_scene()
METHOD = tpd.Descent(searches=8, screening=48, steps=12, model=tpd.Piecewise())
BAND = tpd.Conditions.band(SCENE, 2.0, 3.5, 4)


def optimum(swing, heaviest):
    """Least risk over nu of what the searches find on exact orbits within a limit and a space."""
    space = tpd.DesignSpace(mass_ratio=(0.01, heaviest), damping_ratio=(0.05, 0.4))
    limits = (tpd.limits.Stroke(swing),)
    given = {"conditions": BAND, "limits": limits, "method": METHOD, "objective": tpd.limits.SteadyTilt()}
    problem = HarmonicProblem.of(SCENE, space, **given)
    best = float(np.min(search(problem.orbits, METHOD, 0).end_values))
    assert np.isfinite(best)
    return best


@pytest.mark.parametrize(
    "questions",
    [((0.25, 0.1), (0.4, 0.1), (0.7, 0.1)), ((0.4, 0.03), (0.4, 0.1), (0.4, 0.25))],
    ids=["limit", "space"],
)
def test_a_wider_limit_or_space_does_not_worsen_the_optimum(questions):
    values = [optimum(*question) for question in questions]
    # To what the searches leave: they stop where a step gains less than a thousandth.
    assert np.all(np.diff(values) <= 1e-3 * np.abs(values[:-1]))
    assert values[-1] < values[0] - 1e-3 * abs(values[0])
