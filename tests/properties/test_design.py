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
@given(tilts, shares, shares, st.floats(0.0, 3.0), st.floats(0.0, 3.0), st.randoms(use_true_random=False))
def test_a_risk_is_coherent_and_lies_between_mean_and_worst(values, share, other, shift, factor, random):
    mean, worst = (float(r.of(values)) for r in (tpd.Risk.expected(), tpd.Risk.worst()))
    large, small = (float(tpd.Risk.cvar(s).of(values)) for s in sorted((share, other)))
    assert mean == pytest.approx(np.mean(values), abs=1e-12)
    assert worst == pytest.approx(np.max(values), abs=1e-12)
    assert mean - 1e-12 <= small <= large + 1e-12 <= worst + 3e-12
    risk = tpd.Risk.cvar(share)
    value = float(risk.of(values))
    mixed, more = list(values), values + [random.random() for _ in values]
    random.shuffle(mixed)
    assert float(risk.of(np.array(mixed))) == pytest.approx(value, abs=1e-12)
    assert float(risk.of(factor * values + shift)) == pytest.approx(factor * value + shift, abs=1e-10)
    assert value <= float(risk.of(more)) + 1e-12


@bounded(60)
@given(st.floats(0.01, 0.1), st.floats(0.01, 0.9), st.tuples(*3 * [st.floats(0.0, 1.0)]))
def test_scaling_and_unscaling_a_design_are_inverse(low, width, unit):
    space = tpd.DesignSpace(mass_ratio=(low, low + width), damping_ratio=(0.05, 0.6))
    designs = space.unscaled(np.array([unit]))
    np.testing.assert_allclose(space.scaled(designs), [unit], atol=1e-12)
    bottom, top = space.bounds
    assert np.all((designs[0] >= bottom - 1e-12) & (designs[0] <= top + 1e-12))


@bounded(60)
@given(st.floats(0.1, 10.0), st.floats(0.2, 5.0))
def test_a_scale_model_of_a_scene_has_equal_dimensionless_numbers(length, gravity):
    # Lengths by one factor and gravity by another; the frequency by the root of gravity over length.
    one = tpd.paper_scene()
    assume(1.5 < one.gravity * gravity < 30.0)
    block, motion = one.block, one.excitation
    sizes = {name: getattr(block, name) * length for name in ("width", "height", "cavity_width")}
    rate = motion.frequency * np.sqrt(gravity / length)
    other = tpd.Scene(
        replace(block, **sizes, mass=block.mass * length**3),
        tpd.Harmonic(amplitude=motion.amplitude * length, frequency=rate),
        gravity=one.gravity * gravity,
    )
    both = ([float(x) for x in jax.tree.leaves(scene.parameters())] for scene in (one, other))
    np.testing.assert_allclose(*both, rtol=1e-12)


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
