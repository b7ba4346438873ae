"""The exact model: known answers and gradients, losses next to folds and events, and its limits."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.answers.test_bifurcations import TOUCHING, Kind, lost
from tests.answers.test_bifurcations import WITHOUT as FOLDING
from tests.compiled.orbit_cases import among
from tests.compiled.orbit_cases import solve as orbits
from tests.compiled.test_trajectory import STICKING
from tests.reference import (
    CASES,
    LEANING,
    NAMES,
    OVERTURNING,
    REST,
    STILL,
    WITH,
    WITHOUT,
    EventDriven,
    assert_overturned,
    differences,
    exact,
    named,
    parameters,
)
from tpd import (
    Nonlinear,
    Parameters,
    Piecewise,
    simulate,
    status_name,
    steady_state,
)
from tpd.scene.impacts import housner
from tpd.scene.status import SETTLED, names_of

NU, MU, LAM, ZETA, K, F, XI, E = range(8)


def moved(x, i, value):
    """All eight parameters, one of them changed."""
    out = np.ones(8)
    out[: len(x)] = x
    out[i] = value
    return out


def power(distances, values):
    """The exponent of a power law."""
    return float(np.polyfit(np.log(distances), np.log(values), 1)[0])


# Known answers


@pytest.mark.parametrize("case", CASES, ids=named)
def test_amplitude_and_gradient_equal_stored_references(case):
    answer = exact(case.x, case.y0)
    assert answer.status == ("rest" if case is STILL else "rocking")
    assert answer.amplitude == pytest.approx(case.amplitude, rel=case.amplitude_rtol, abs=case.amplitude_atol)
    known = np.isfinite(case.gradient)
    found, expected = answer.slopes[0][known], np.array(case.gradient)[known]
    np.testing.assert_allclose(found, expected, rtol=case.gradient_rtol, atol=case.gradient_atol)


@pytest.mark.parametrize("x", [STILL.x, (*WITH[3].x, 0.8)], ids=["rest", "impacts"])
def test_gradients_of_amplitude_and_swing_equal_finite_differences(x):
    # From the settled state, since far steps from elsewhere may end on another orbit. The amplitude is known
    # to about 1e-14 of itself, hence its differences to 1e-8 even where they are small.
    answer = exact(x)
    for i in range(len(x)):
        expected = differences(
            lambda x: np.array([(a := exact(x, answer.steady.state)).amplitude, a.swing]), x, i
        )
        np.testing.assert_allclose(answer.slopes[:2, i], expected, rtol=1e-7, atol=1e-11, err_msg=NAMES[i])


def test_the_gradient_without_a_pendulum_is_the_effect_of_a_light_bob():
    case = WITHOUT[0]
    without, h = exact(case.x, case.y0), 1e-4
    values = [exact(moved(case.x, MU, mu), case.y0).amplitude for mu in (0, h, 2 * h, 3 * h)]
    assert without.slopes[0, MU] == pytest.approx(np.dot([-11, 18, -9, 2], values) / (6 * h), rel=1e-6)


def test_an_estimate_that_was_not_computed_has_no_derivative():
    def estimate(mu):
        return jnp.asarray(steady_state(parameters((0.25, mu, *WITH[0].x[2:]))).estimate)

    assert np.isnan(jax.grad(estimate)(0.05))


# Folds, breaking of symmetry, grazing, sticking


def test_the_gradient_at_a_fold_is_nan_with_status_near_fold():
    x = moved(FOLDING, F, (b := lost(Kind.fold)).value * (1.0 + 5e-14))
    o = orbits([x])
    assert list(o.status[0, :2]) == ["near_fold", "near_fold"]
    assert np.all(np.isnan(o.slopes[0, :2]))
    np.testing.assert_allclose(o.amplitude[0, :2], b.amplitude, rtol=1e-5)
    settled = exact(x, o.state[0, 0])
    assert settled.status == "near_fold"
    assert np.all(np.isnan(settled.slopes))
    assert settled.amplitude == pytest.approx(b.amplitude, rel=1e-5)


def test_the_gradient_at_a_grazing_impact_is_nan_with_status_grazing():
    b, distances = lost(Kind.grazing), 10.0 ** np.linspace(-9.0, -3.0, 7)
    o = among(TOUCHING, "f", b.value * (1.0 - distances))
    # The margin vanishes in proportion: below 1e-7 of what is usual it is called grazing.
    assert power(distances, o.grazing[:, 1]) == pytest.approx(1.0, abs=0.01)
    told = o.status[:, 1] == "grazing"
    np.testing.assert_array_equal(told, o.grazing[:, 1] < 1e-7)
    assert 2 <= told.sum() <= 4
    assert np.all(np.isnan(o.slopes[told, 1]))
    assert np.all(np.isfinite(o.slopes[~told, 1]))
    np.testing.assert_allclose(o.amplitude[told, 1], b.amplitude, rtol=1e-6)
    assert among(TOUCHING, "f", np.array([b.value * (1.0 + 1e-6)])).status[0, 1] == "no_orbit"


# Overturning


def test_an_overturned_block_has_no_gradient():
    assert_overturned(exact(OVERTURNING))


def test_initial_states_near_overturning_reach_an_attractor_or_have_a_status():
    answers, low, high = [], 0.16, 0.3
    for _ in range(45):
        tilt = 0.5 * (low + high)
        answers.append(exact(WITHOUT[1].x, (tilt, 0.0, 0.0, 0.0)))
        low, high = (low, tilt) if answers[-1].status == "overturned" else (tilt, high)
    # Every one is the attractor with its gradient, or rest, or lost, or the saddle in between, refused.
    assert {a.status for a in answers} == {"rocking", "rest", "overturned", "unstable"}
    saddle = next(a.amplitude for a in answers if a.status == "unstable")
    assert saddle > 0.2
    sizes = {"rocking": WITHOUT[1].amplitude, "rest": 0.0, "overturned": np.inf, "unstable": saddle}
    for a in answers:
        assert a.amplitude == pytest.approx(sizes[a.status], rel=1e-6)
        assert np.all(np.isfinite(a.slopes[0])) == (a.status in names_of(SETTLED))


# Limits


def test_the_resonant_swing_above_a_resting_block_is_set_by_damping():
    nu, lam, f = 0.25, 0.8, 0.1
    xi = np.sqrt((1.0 + nu**2) / (0.75 * lam))
    for zeta in (1e-1, 1e-3, 1e-6):
        light = exact((nu, 0.0, lam, zeta, 0.05, f, xi))
        assert light.status == "rest"
        assert light.swing == pytest.approx(f / (2.0 * zeta), rel=1e-9)
        assert light.slopes[1, ZETA] == pytest.approx(-f / (2.0 * zeta**2), rel=1e-6)
    for zeta in (1e-2, 1e-8, 0.0):
        heavy = exact((nu, 0.1, lam, zeta, 0.05, f, xi))
        assert heavy.status in ("overturned", "event_bound")
        assert np.all(np.isnan(heavy.slopes))


def test_too_long_a_period_has_the_status_event_bound():
    answer = exact((0.2, 0.1, 0.4, 0.2, 0.05, 0.1, 1e-6))
    assert answer.status == "event_bound"
    assert np.all(np.isnan(answer.slopes))


@pytest.mark.parametrize("f", [1e1, 1e100, 1e300])
def test_a_huge_excitation_overturns_or_has_the_status_failed(f):
    answer = exact((0.2, 0.1, 0.4, 0.2, 0.05, f, 3.5))
    assert answer.status == ("failed" if f == 1e300 else "overturned")
    assert np.all(np.isnan(answer.slopes))


@pytest.mark.parametrize("x", [WITH[0].x, WITH[3].x, STICKING, STILL.x, OVERTURNING], ids=str)
def test_a_nonlinear_steady_state_equals_an_independent_integration(x):
    ours, loop = steady_state(parameters(x), model=Nonlinear()), EventDriven(x, nonlinear=True)
    times = np.linspace(0.0, 40.0 * loop.period_of_excitation, 41)
    if status_name(ours.status) == "overturned":
        assert len(loop.run(REST, times)) < len(times)
        assert math.isnan(ours.multiplier)
        return
    assert 0.0 <= ours.multiplier < 1.0
    sizes, end = loop.period(ours.state, int(ours.periods))
    np.testing.assert_allclose([ours.amplitude, ours.swing], sizes, rtol=2e-6, atol=2e-8 * x[0])
    # Capture at rest neglects a motion whose size is the square of the capture speed.
    np.testing.assert_allclose(end, ours.state, rtol=0, atol=1e-6)
    held = {kind for kind in loop.kinds if kind != "slip"}
    assert bool(held) == (status_name(ours.status) != "rocking")


def test_the_error_of_the_linear_model_falls_as_the_square_of_the_angles():
    """Proportional nu, k and f scale the linear motion only; rho stays."""
    scales, apart, sizes = np.geomspace(0.5, 0.01, 4), [], lambda s: np.array([s.amplitude, s.swing])
    for s in scales:
        x = np.array(WITH[3].x) * np.array([s, 1, 1, 1, s, s, 1])
        x = np.array([*x, housner(x[0], 0.75 / (1.0 + x[0] ** 2), x[1])])
        nonlinear, linear = steady_state(parameters(x), model=Nonlinear()), exact(x).steady
        assert (nonlinear.periods, nonlinear.symmetric) == (linear.periods, linear.symmetric)
        apart.append(np.abs(sizes(nonlinear) / sizes(linear) - 1.0))
    slopes = np.diff(np.log(apart), axis=0) / np.diff(np.log(scales))[:, None]
    np.testing.assert_allclose(np.polyfit(np.log(scales), np.log(apart), 1)[0], 2.0, atol=0.1)
    assert np.all(np.abs(slopes - 2.0) < 0.2)


@pytest.mark.parametrize(
    ("x", "y0", "periods"),
    [
        (WITH[3].x, REST, 5),
        ((0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0), (0.16, 0.0, 0.0, 0.0), 5),
        ((0.2, 0.1, 0.5, 0.1, 0.08, 0.3, 3.0, 0.7), (0.1, 0.1, 0.0, 0.3), 4),
        ((0.25, 0.05, 0.8, 0.1, 0.2, 0.5, 3.5), (0.08, 0.1, 0.0, 0.0), 4),
    ],
    ids=["pendulum", "no pendulum", "impacts", "sticking"],
)
def test_motions_of_both_models_equal_the_event_loop(x, y0, periods):
    felt = [0, 2] if x[1] == 0 else [0, 1, 2, 3]
    for nonlinear, model in ((False, Piecewise()), (True, Nonlinear())):
        loop = EventDriven(x, nonlinear=nonlinear)
        times = np.linspace(0.0, periods * loop.period_of_excitation, 11)
        motion, known = (
            simulate(parameters(x), np.array(y0), times, model=model),
            loop.run(y0, times, quiet=1e-7),
        )
        assert (status_name(motion.status) == "overturned") == (len(known) < len(times))
        ys = np.asarray(motion.ys)[: len(known), felt]
        np.testing.assert_allclose(ys, known[:, felt], rtol=0, atol=2e-6 * x[0])


def test_a_tilted_block_that_friction_holds_has_the_status_held():
    found = steady_state(parameters(LEANING[0]), y0=np.array(LEANING[1]), model=Nonlinear())
    assert status_name(found.status) == "held"
    assert found.amplitude == pytest.approx(LEANING[1][0], rel=1e-12)


def test_nonlinear_values_and_derivatives_are_equal_under_jit():
    x = WITH[3].x

    def amplitude(nu):
        return steady_state(parameters((nu, *x[1:])), model=Nonlinear()).amplitude

    known = steady_state(parameters(x), model=Nonlinear()).amplitude
    assert jax.jit(amplitude)(x[0]) == jax.vmap(amplitude)(np.array([x[0]]))[0] == known
    slope = jax.grad(amplitude)(x[0])
    assert slope == jax.jit(jax.grad(amplitude))(x[0])
    assert slope == pytest.approx(exact(x).slopes[0, 0], rel=0.1)


@pytest.mark.parametrize("count", [0, 40])
def test_nonlinear_states_over_time_equal_an_independent_integration(count):
    p, y0 = parameters(STICKING), np.array([0.02, 0.1, 0.0, -0.1])
    times = (count + np.array([0.3, 0.31, 1.0, 1.7, 4.25])) * 2.0 * np.pi / STICKING[6]
    ours = simulate(p, y0, times, model=Nonlinear())
    assert status_name(ours.status) == "rocking"
    loop = EventDriven(STICKING, nonlinear=True)
    known = loop.run(y0, times, quiet=1e-7)
    np.testing.assert_allclose(ours.ys, known, rtol=0, atol=1e-7)


def test_a_trajectory_is_nan_after_overturning():
    found = simulate(parameters(OVERTURNING), np.zeros(4), np.linspace(0.0, 60.0, 13), model=Nonlinear())
    assert status_name(found.status) == "overturned"
    finite = np.isfinite(found.ys).all(axis=1)
    assert finite[0]
    assert not finite[-1]


@pytest.mark.parametrize("model", [Piecewise(max_events=1), Nonlinear(max_events=1)])
def test_too_few_events_have_the_status_event_bound_and_a_last_state_of_nan(model):
    p = Parameters(nu=0.25, mu=0.1, lam=0.6, zeta=0.1, k=0.05, f=0.4, xi=2.5)
    assert status_name(steady_state(p, model=model).status) == "event_bound"
    motion = simulate(p, np.zeros(4), [0.0, 9.0], model=model)
    assert status_name(motion.status) == "event_bound"
    assert np.all(np.isnan(motion.ys[-1]))
