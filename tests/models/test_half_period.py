"""One step of an orbit by half a forcing period: sizes, slopes and stability against the exact orbit."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tpd.compiled import orbits
from tpd.compiled.rows import row_of
from tpd.models.half_period import half_period, newton
from tpd.models.smoothed import Smoothed
from tpd.scene.conditions import FACTORS, under
from tpd.scene.parameters import Parameters, as_arrays

NAMES = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e")
SCENES = np.array(
    [
        (0.13, 0.0346, 0.1043, 0.598, 0.0, 0.2356, 4.7, 0.5),
        (0.13, 0.0346, 0.1043, 0.598, 0.0, 0.2356, 4.7, 0.95),
        (0.2, 0.1, 0.5, 0.2, 0.0, 0.3, 4.0, 0.8),
        (0.25, 0.1, 0.8, 0.1, 0.05, 0.5, 3.5, 1.0),
    ]
)
ONE = jnp.ones(len(FACTORS))
MODEL = Smoothed(rtol=1e-9)
HALVES = {model: jax.jit(half_period(model)) for model in (MODEL, Smoothed())}


def stepped(p, design, turn, model=MODEL):
    """One step of an orbit."""
    half = jax.tree.map(lambda x: np.asarray(x)[None], HALVES[model]((p, design, ONE, turn)))
    return jax.tree.map(lambda x: x[0], newton(np.asarray(turn)[None], half))


def exact(p, design):
    """Amplitude and swing of the largest orbit with their slopes, and the orbits."""

    def sizes(x):
        o = tpd.symmetric_orbits(under(p, x, ONE))
        return jnp.stack([o.amplitude[0], o.swing[0]]), o

    slopes, orbits = jax.jit(jax.jacfwd(sizes, has_aux=True))(design)
    return sizes(design)[0], slopes, orbits


def turn_of(p, design):
    """phi, psi, phase of the forcing and psi' at the upper turn of the largest orbit."""
    o = orbits.solve_orbits(row_of(under(p, design, ONE))[None])[0, 0]
    return jnp.array([o["sizes"][0], o["bob"], o["sizes"][1], o["bob_rate"]])


def parameters(scene):
    """Parameters as arrays, and the design."""
    p = as_arrays(Parameters(**dict(zip(NAMES, scene, strict=True))))
    return p, jnp.asarray(scene[1:4])


@pytest.mark.parametrize("scene", SCENES, ids=lambda x: f"e={x[-1]:g} k={x[4]:g}")
def test_a_few_newton_steps_reach_the_orbit_and_its_derivatives(scene):
    p, design = parameters(scene)
    sizes, slopes, orbits = exact(p, design)
    turn = turn_of(p, design)
    np.testing.assert_allclose(turn[0], sizes[0], rtol=1e-12)
    residuals = []
    for _ in range(3):
        step = stepped(p, design, turn)
        turn = step.turn
        residuals.append(float(step.residual))
    # Newton's method: the exact orbit is a layer's width away, and the square of that after a step.
    assert residuals[0] < 1e-3
    assert residuals[2] < 1e-9
    assert bool(step.solved)
    np.testing.assert_allclose([step.turn[0], step.swing], sizes, rtol=5e-4)
    for mine, other in ((step.slope[0], slopes[0]), (step.swing_slope, slopes[1])):
        assert np.max(np.abs(mine - other)) < 2e-3 * np.max(np.abs(other))
    m = orbits.margins
    least = min(float(x[0]) for x in (m.fold, m.symmetry, m.torus))
    assert float(step.reserve) == pytest.approx(least, rel=5e-3)
    assert float(step.multiplier) == pytest.approx(float(np.abs(orbits.multipliers[0]).max()), rel=5e-3)


def test_derivatives_are_accurate_at_the_default_tolerance():
    p, design = parameters(SCENES[1])
    _, slopes, _ = exact(p, design)
    turn = turn_of(p, design)
    for _ in range(3):
        step = stepped(p, design, turn, Smoothed())
        turn = step.turn
    assert np.max(np.abs(step.slope[0] - slopes[0])) < 5e-4 * np.max(np.abs(slopes[0]))


def test_a_guess_far_from_an_orbit_is_not_accepted_as_solved():
    """A wild start keeps the bound on the steps, and neither hangs nor passes for an orbit."""
    p, design = parameters(SCENES[2])
    for turn in ([0.1, 40.0, 0.3, -90.0], [np.nan, 0.0, 0.0, 0.0], [50.0, 0.0, 0.0, 0.0]):
        step = stepped(p, design, jnp.array(turn))
        assert not bool(step.solved) or float(step.residual) > 1.0


def test_an_unsolvable_orbit_does_not_affect_other_orbits():
    p, design = parameters(SCENES[2])
    turn = turn_of(p, design)
    half = jax.tree.map(lambda x: np.stack([x] * 3), HALVES[MODEL]((p, design, ONE, turn)))
    half.end[1, 1:] = -np.eye(8, 4)
    half.end[2, 5, 0] = np.nan
    step = newton(np.stack([turn] * 3), half)
    assert list(step.solved) == [True, False, False]
    np.testing.assert_array_equal(step.slope[0], stepped(p, design, turn).slope)
