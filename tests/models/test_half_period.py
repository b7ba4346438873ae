"""One step of an orbit by half a forcing period: sizes, slopes and stability against the exact orbit."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tpd.core.conditions import FACTORS, under
from tpd.core.parameters import Parameters, as_arrays
from tpd.models import compiled_orbits
from tpd.models.half_period import _reserve, _spectral_radius, half_period
from tpd.models.smoothed import Smoothed

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
STEP = jax.jit(half_period(MODEL))


def exact(p, design):
    """Amplitude and stroke of the largest orbit with their slopes, and the orbits."""

    def sizes(x):
        o = tpd.symmetric_orbits(under(p, x, ONE))
        return jnp.stack([o.amplitude[0], o.stroke[0]]), o

    slopes, orbits = jax.jit(jax.jacfwd(sizes, has_aux=True))(design)
    return sizes(design)[0], slopes, orbits


def turn_of(p, design):
    """phi, psi, phase of the forcing and psi' at the upper turn of the largest orbit."""
    o = compiled_orbits.solve_all(compiled_orbits.row_of(under(p, design, ONE))[None])[0, 0]
    return jnp.array([o["sizes"][0], o["bob"], o["sizes"][1], o["bob_rate"]])


def parameters(scene):
    """Parameters as arrays, and the design."""
    p = as_arrays(Parameters(**dict(zip(NAMES, scene, strict=True))))
    return p, jnp.asarray(scene[1:4])


@pytest.mark.parametrize("scene", SCENES, ids=lambda x: f"e={x[-1]:g} k={x[4]:g}")
def test_a_few_steps_give_the_exact_orbit_and_its_slopes(scene):
    p, design = parameters(scene)
    sizes, slopes, orbits = exact(p, design)
    turn = turn_of(p, design)
    np.testing.assert_allclose(turn[0], sizes[0], rtol=1e-12)
    residuals = []
    for _ in range(3):
        step = STEP((p, design, ONE, turn))
        turn = step.turn
        residuals.append(float(step.residual))
    # Newton's method: the exact orbit is a layer's width away, and the square of that after a step.
    assert residuals[0] < 1e-3
    assert residuals[2] < 1e-9
    assert bool(step.solved)
    np.testing.assert_allclose([step.turn[0], step.stroke], sizes, rtol=5e-4)
    for mine, other in ((step.slope[0], slopes[0]), (step.stroke_slope, slopes[1])):
        assert np.max(np.abs(mine - other)) < 2e-3 * np.max(np.abs(other))
    m = orbits.margins
    least = min(float(x[0]) for x in (m.fold, m.symmetry, m.torus))
    assert float(step.reserve) == pytest.approx(least, rel=5e-3)
    assert float(step.multiplier) == pytest.approx(float(np.abs(orbits.multipliers[0]).max()), rel=5e-3)


def test_the_slope_is_that_of_the_smoothed_orbit():
    """Central differences of converged orbits: no error of the smoothing is in them."""
    p, design = parameters(SCENES[2])
    begin = turn_of(p, design)

    def settled(x):
        turn = begin
        for _ in range(4):
            step = STEP((p, x, ONE, turn))
            turn = step.turn
        return step

    here = settled(design)
    for i in range(3):
        moved = 1e-4 * design[i] * jnp.eye(3)[i]
        up, down = settled(design + moved), settled(design - moved)
        quotient = (up.turn - down.turn) / (2.0 * moved[i])
        np.testing.assert_allclose(here.slope[:, i], quotient, rtol=1e-5, atol=1e-5)


def test_stability_is_that_of_the_eigenvalues():
    turned = np.array([[0.6, -0.5], [0.5, 0.6]])
    double = np.kron(np.eye(2), turned) + np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(2))
    bare = np.diag([1.3, 0.0, -0.2, 0.0])
    for m in (*np.random.default_rng(5).normal(size=(20, 4, 4)), double, bare, np.zeros((4, 4))):
        g = np.linalg.eigvals(m)
        products = [np.prod([1.0 - g[i] * g[j] for i in range(4) for j in range(i)])]
        least = np.min(np.real([np.prod(1.0 - g), np.prod(1.0 + g), *products]))
        # NumPy knows the eigenvalues of `double` to the root of rounding.
        assert float(_spectral_radius(jnp.asarray(m))) == pytest.approx(np.abs(g).max(), rel=1e-7, abs=1e-12)
        assert float(_reserve(jnp.asarray(m))) == pytest.approx(least, rel=1e-6, abs=1e-12)


def test_what_is_no_orbit_is_said():
    """A wild start keeps the bound on the steps, and neither hangs nor passes for an orbit."""
    p, design = parameters(SCENES[2])
    for turn in ([0.1, 40.0, 0.3, -90.0], [np.nan, 0.0, 0.0, 0.0], [50.0, 0.0, 0.0, 0.0]):
        step = STEP((p, design, ONE, jnp.array(turn)))
        assert not bool(step.solved) or float(step.residual) > 1.0
