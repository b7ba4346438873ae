"""Where explicit solvers go unstable on the smoothed block, and how one that cannot keep up ends."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.benchmarks.stability import SCENES, eigenvalues, limit, measured, polynomial, theory
from tests.reference import HUNG, STILL, parameters
from tpd import Segmented, Smoothed, status_name

SWINGING = "default width, friction k = 0.0005"


@pytest.mark.parametrize(
    ("solver", "real"),
    [
        (diffrax.Euler(), 2.0),
        (diffrax.Heun(), 2.0),
        (diffrax.Bosh3(), 2.51274532661),
        (diffrax.Dopri5(), 3.3066),
    ],
    ids=lambda v: type(v).__name__,
)
def test_limits_on_the_real_axis_are_the_textbooks(solver, real):
    # Hairer and Wanner, Solving Ordinary Differential Equations II, table IV.2.
    assert limit(polynomial(solver), -1.0 + 0.0j) == pytest.approx(real, abs=1e-4)


@pytest.mark.parametrize("solver", [diffrax.Bosh3(), diffrax.Tsit5(), diffrax.Dopri8()])
def test_a_stability_polynomial_is_the_exponential_to_the_solvers_order(solver):
    order = solver.order(None)
    factorials = np.cumprod([1.0, *range(1, order + 1)])
    np.testing.assert_allclose(polynomial(solver)[: order + 1] * factorials, 1.0, rtol=1e-10)


def test_the_layer_is_overdamped_by_default_and_swings_with_little_friction():
    assert eigenvalues(*SCENES["default width"])[0].imag == 0.0
    pair = eigenvalues(*SCENES[SWINGING])
    assert abs(pair[0].imag) > 20.0 * abs(pair[0].real)


@pytest.mark.parametrize(
    ("solver", "scene"),
    [(diffrax.Heun(), "default width"), (diffrax.Tsit5(), SWINGING)],
    ids=["Heun", "Tsit5, swinging"],
)
def test_a_push_grows_from_the_theoretical_step_on(solver, scene):
    expected = theory(solver, *SCENES[scene])
    assert measured(solver, *SCENES[scene], expected) == pytest.approx(expected, rel=0.02)


def test_a_solver_that_cannot_keep_up_says_so_by_name_and_without_a_nan():
    # The resting block hums in a layer a two thousandth of the default's: 4096 steps see no period through.
    model = Smoothed(sharpness=1e-6)
    settled = jax.jit(lambda x: model.settle(parameters(x), jnp.zeros(4)))(np.array(STILL.x))
    assert status_name(settled.status) == "event_bound"
    for size in (settled.amplitude, settled.stroke, settled.y):
        assert np.all(np.isfinite(np.asarray(size)))


def test_segments_that_run_out_of_steps_are_told_by_name_and_without_a_nan():
    model = Segmented(max_steps=4, max_periods=3)
    settled = jax.jit(lambda x: model.settle(parameters(x), jnp.zeros(4)))(np.array(HUNG[0].x))
    assert status_name(settled.status) == "event_bound"
    for size in (settled.amplitude, settled.stroke, settled.y):
        assert np.all(np.isfinite(np.asarray(size)))
