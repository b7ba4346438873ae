"""The smoothed model against the exact one: how near, how it gets nearer, and what it does not see."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.compiled.test_trajectory import STICKING
from tests.models.test_piecewise import E, moved
from tests.reference import (
    MOVING,
    NAMES,
    OVERTURNING,
    REST,
    STILL,
    WITH,
    EventDriven,
    assert_overturned,
    differences,
    exact,
    named,
    parameters,
    smoothed,
    solver,
)
from tpd import Nonlinear, Parameters, Piecewise, Smoothed, Terms, simulate, status_name, steady_state
from tpd.models.smoothed import rocking_scale
from tpd.scene.impacts import housner
from tpd.scene.parameters import uniform_inertia_ratio
from tpd.scene.status import SETTLED, names_of
from tpd.theory.equations import smoothed_rates


@pytest.mark.parametrize("case", MOVING[::2], ids=named)
def test_the_default_smoothed_model_is_within_a_thousandth_of_the_linear_model(case):
    found, expected = smoothed(case.x, case.y0), exact(case.x, case.y0)
    assert found.status == "rocking"
    assert found.amplitude == pytest.approx(expected.amplitude, rel=1e-3)
    np.testing.assert_allclose(found.slopes[0], expected.slopes[0], rtol=5e-3, atol=1e-12)
    if case in WITH:
        assert found.swing == pytest.approx(expected.swing, rel=1e-3)
        assert found.steady.multiplier == pytest.approx(float(expected.steady.multiplier), rel=1e-3)
        assert found.steady.periods == expected.steady.periods


STRUCK = (
    (0.13, 0.0346, 0.1043, 0.598, 0.0, 0.2356, 4.7, 0.5),
    (0.2, 0.1, 0.5, 0.2, 0.0, 0.3, 4.0, 0.8),
    (0.2, 0.1, 0.5, 0.2, 0.0, 0.3, 4.0, housner(0.2, uniform_inertia_ratio(0.2), 0.1)),
    (0.2, 0.05, 0.8, 0.1, 0.05, 0.3, 3.0, 0.6),
    (0.15, 0.2, 0.3, 0.3, 0.01, 0.25, 5.5, 0.65),
    (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 0.97),
)
"""Scenes with impacts, e last: that of the third is Housner's. From rest all come to symmetric rocking."""
WRONG_BASIN = (0.2082, 0.0, 0.4, 0.4166, 0.0449, 0.2894, 2.4994, 0.3954)
"""From rest the exact block sticks with a tenth of the tilt at which the smoothed one rocks."""
DESIGN = slice(1, 4)
"""Places of mu, lam and zeta."""
WIDE, NARROW = 5.0, 0.5
"""Widths over the default's: `sharpness` of 1e-2 and 1e-3."""


parametric, nonlinear = (solver(Smoothed(terms=t)) for t in (Terms.parametric, Terms.nonlinear))


@pytest.mark.parametrize(
    ("solve", "x", "places"),
    [
        (smoothed, STRUCK[1], (1, 5, E)),
        (smoothed, (0.2, 0.05, 0.6, 0.1, 0.0, 0.3, 3.0, 0.9, 1.3), (8,)),
        (parametric, (0.2, 0.05, 0.6, 0.1, 0.05, 0.3, 3.0, 0.9, 1.3), (8,)),
        (nonlinear, (0.2, 0.05, 0.6, 0.1, 0.05, 0.3, 3.0, 1.0, 1.3), (8,)),
    ],
)
def test_the_smoothed_gradient_equals_finite_differences(solve, x, places):
    # Started from the settled state, so that a far step cannot end on another orbit. Steps of 1 % are far
    # above the integration tolerance (1e-12), and the extrapolation is of sixth order.
    answer = solve(x)

    def sizes(x):
        steady = solve(x, answer.steady.state).steady
        return np.array([steady.amplitude, steady.swing, *steady.state])

    for i in places:
        expected = differences(sizes, x, i)
        np.testing.assert_allclose(answer.slopes[:, i], expected, rtol=1e-5, atol=1e-5, err_msg=NAMES[i])
        assert answer.slopes[0, i] == pytest.approx(expected[0], rel=1e-5)


def off(found, expected):
    """Largest error of the derivatives in mu, lam and zeta over the largest of these."""
    apart = np.abs(found.slopes[0, DESIGN] - expected.slopes[0, DESIGN])
    return apart.max() / np.abs(expected.slopes[0, DESIGN]).max()


@pytest.mark.parametrize("x", STRUCK[::2], ids=lambda x: f"xi = {x[6]:g}, e = {x[E]:.3g}")
def test_smoothed_impacts_give_nearly_the_amplitude_of_the_linear_model(x):
    found, expected = smoothed(x), exact(x)
    assert found.status == expected.status == "rocking"
    assert bool(found.steady.symmetric) is bool(expected.steady.symmetric) is True
    hard = x[E] < 0.8
    assert found.amplitude == pytest.approx(expected.amplitude, rel=5e-4 if hard else 5e-5)
    assert off(found, expected) < (5e-3 if hard else 1e-3)
    assert found.slopes[0, E] == pytest.approx(expected.slopes[0, E], rel=2e-3)


@pytest.mark.parametrize("x", STRUCK[::4], ids=lambda x: f"xi = {x[6]:g}, e = {x[E]:.3g}")
def test_the_error_of_smoothed_impacts_is_proportional_to_their_width(x):
    wide, narrow, truth = smoothed(x, coarser=WIDE), smoothed(x, coarser=NARROW), exact(x)
    ratio = (wide.amplitude - truth.amplitude) / (narrow.amplitude - truth.amplitude)
    assert ratio == pytest.approx(WIDE / NARROW, rel=0.1)
    assert off(wide, truth) / off(narrow, truth) == pytest.approx(WIDE / NARROW, rel=0.1)


def test_a_resting_block_has_amplitude_zero_in_the_smoothed_model():
    for x in (STILL.x, (*STILL.x, 0.8)):
        answer = smoothed(x)
        assert answer.status == exact(x).status == "rest"
        assert answer.amplitude == 0.0
        np.testing.assert_array_equal(answer.slopes[0], 0.0)
        assert answer.swing == pytest.approx(exact(x).swing, rel=1e-2)


def test_an_overturned_block_has_no_gradient():
    assert_overturned(smoothed(OVERTURNING))
    assert_overturned(smoothed((0.25, 0.1, 0.2, 0.1, 0.0, 1.6, 2.67, 0.8)))


def test_smoothing_widths_scale_with_the_expected_orbit():
    p, usual = parameters(WITH[0].x), Smoothed()
    found = Smoothed(sharpness=4.0 * usual.sharpness).widths(p)
    np.testing.assert_allclose(found, [4.0 * width for width in usual.widths(p)], rtol=1e-15)
    width, rate_width = Smoothed(sharpness=0.01).widths(p)
    assert width == pytest.approx(0.01 * rocking_scale(p), rel=1e-14)
    assert rate_width == pytest.approx(p.xi * width, rel=1e-14)
    # One harmonic of free rocking, no forcing: 3 % above (11) here.
    without = parameters((0.2, 0.0, 0.4, 0.2, 0.0, 0.0, 4.0))
    assert rocking_scale(without) == pytest.approx(0.2 * (1 - 1 / np.cosh(np.pi / 2 / 4.0)), rel=0.05)


def test_the_smoothed_parametric_orbit_agrees_with_the_event_loop():
    x = (0.2, 0.1, 0.5, 0.2, 0.02, 0.3, 4.0)
    e = float(housner(x[0], uniform_inertia_ratio(x[0]), x[1]))
    *_, status, _, s = parametric((*x, e))
    assert status == "rocking"
    loop, y = EventDriven((*x, e), parametric=True), np.asarray(s.state)
    for _ in range(12):
        (amplitude, _), y = loop.period(y)
    assert amplitude == pytest.approx(0.0336586, rel=5e-6)
    assert float(s.amplitude) == pytest.approx(amplitude, rel=2e-5)
    # No exact model has the parametric term: there is nothing to compare the motion with.
    assert np.isnan(s.estimate)
    # Without the parametric term the motion is another one.
    assert abs(exact((*x, e)).amplitude / amplitude - 1.0) > 1e-3


def test_the_smoothed_nonlinear_orbit_agrees_with_unsmoothed_friction():
    def known(x):
        return float(steady_state(parameters(x), model=Nonlinear()).amplitude)

    for x in (WITH[3].x, WRONG_BASIN[:7]):
        amplitude, _, status, slopes, steady = nonlinear(x)
        assert status == "rocking"
        assert amplitude == pytest.approx(known(x), rel=1e-4)
        # The model compares itself with the nonlinear motion.
        assert float(steady.estimate) == pytest.approx(abs(amplitude / known(x) - 1.0), abs=5e-6)
        for i in (1, 2, 4) if x == WITH[3].x else ():
            assert slopes[0, i] == pytest.approx(differences(known, x, i, share=0.02), rel=5e-3, abs=1e-4)


def test_a_late_period_equals_the_first_one():
    x = STICKING[:7]
    y0, period = np.asarray(exact(x).steady.state), 2.0 * np.pi / x[6]
    solve = jax.jit(lambda times: simulate(parameters(x), y0, times, model=Smoothed(rtol=1e-9)).ys)
    first = solve(np.array([0.0, 0.4, 1.0]) * period)
    for count in (1, 1_000, 1_000_000):
        ys = solve((count + np.array([0.0, 0.4, 1.0])) * period)
        np.testing.assert_allclose(ys, first, rtol=0, atol=1e-5)


# Where impacts all but stop


def test_a_smoothed_motion_that_almost_sticks_is_not_called_settled():
    x = (0.2, 0.1, 0.4, 0.2, 0.0, 0.25, 4.0, 0.5)
    answer = smoothed(x)
    assert exact(x).status == "sticking"
    assert answer.status in ("not_settled", "unstable")
    assert np.all(np.isnan(answer.slopes))


def test_impacts_sharper_than_a_step_are_accurate_or_have_a_status():
    # Steps that pass over an impact's layer lose no energy there.
    x = (*WITH[0].x, 0.5)
    answer = smoothed(x, coarser=0.005)
    if answer.status in names_of(SETTLED):
        assert answer.amplitude == pytest.approx(exact(x).amplitude, rel=1e-4)
    else:
        assert answer.status in ("not_settled", "unstable", "event_bound", "overturned")
        assert np.all(np.isnan(answer.slopes))


def test_too_many_solver_steps_have_the_status_event_bound():
    # The resting block hums in a layer a two thousandth of the default's: 4096 steps see no period through.
    model = Smoothed(sharpness=1e-6)
    settled = jax.jit(lambda x: model.settle(parameters(x), jnp.zeros(4)))(np.array(STILL.x))
    assert status_name(settled.status) == "event_bound"
    for size in (settled.settled_tilt, settled.settled_swing, settled.state):
        assert np.all(np.isfinite(np.asarray(size)))


# What has no smoothed counterpart


@pytest.mark.parametrize("e", [0.0, -0.1])
def test_a_traced_restitution_that_cannot_be_smoothed_has_a_status(e):
    answer = smoothed(moved(STRUCK[1], E, e))
    assert answer.status == "event_bound"
    assert np.all(np.isnan(answer.slopes))


def test_smoothed_nonlinear_equations_with_impact_loss_are_nan():
    y = jnp.array([1e-3, 0.1, 0.2, 0.0])

    @jax.jit
    def rates(e):
        p = parameters((*WITH[0].x, e))
        return smoothed_rates(p, *Smoothed().widths(p), Terms.nonlinear)(jnp.zeros(()), y, None)

    assert np.all(np.isfinite(rates(1.0)))
    assert np.isnan(rates(0.9)[2])


@pytest.mark.parametrize(
    ("terms", "e", "message"),
    [
        (Terms.nonlinear, 0.9, r"`e` must be between 1 and 1 in the smoothed equations \(4\).*but is 0\.9"),
        (Terms.linear, 0.0, r"`e` must be between 0\.001 and 1 in the smoothed model.*but is 0"),
        (Terms.parametric, 0.0, r"`e` must be between 0\.001 and 1 in the smoothed model.*but is 0"),
    ],
)
@pytest.mark.parametrize(
    "call", [steady_state, lambda p, **o: simulate(p, np.array(REST), np.array([0.0, 1.0]), **o)]
)
def test_impacts_that_cannot_be_smoothed_are_rejected(call, terms, e, message):
    with pytest.raises(ValueError, match=message):
        call(parameters((*WITH[0].x, e)), model=Smoothed(terms=terms))


@pytest.mark.parametrize("model", [Piecewise, Smoothed])
def test_a_model_follows_at_least_one_period(model):
    with pytest.raises(ValueError, match="`max_periods` must be a whole number, 1 or more, but is 0"):
        model(max_periods=0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sharpness": 0.0}, "`sharpness` must be between 1e-06 and 1, but is 0"),
        ({"sharpness": 2.0}, "`sharpness` must be between 1e-06 and 1, but is 2"),
        ({"rtol": -1e-6}, "`rtol` must be positive and finite, but is -1e-06"),
    ],
)
def test_settings_out_of_range_are_rejected(options, message):
    with pytest.raises(ValueError, match=message):
        Smoothed(**options)


def test_a_smoothed_motion_on_another_attractor_is_inexact():
    found, expected = smoothed(WRONG_BASIN), exact(WRONG_BASIN)
    assert (found.status, expected.status) == ("inexact", "sticking")
    apart = found.amplitude / expected.amplitude - 1.0
    assert found.steady.estimate == pytest.approx(apart, rel=1e-4)
    assert apart > 5.0
    # Amplitude and gradient are those of the smoothed motion, so a descent goes on.
    assert np.all(np.isfinite(found.slopes[0]))
    text = str(found.steady)
    assert text.startswith("inexact: From the same initial state, the model with")
    assert "another motion than the exact model" in text
    assert "Change the model" in text


def test_the_error_estimate_is_equal_in_batches():
    xs = jnp.array([WRONG_BASIN, STRUCK[3], STRUCK[4]])
    found = jax.jit(jax.vmap(lambda x: steady_state(parameters(x), model=Smoothed())))(xs)
    assert names_of(found.status).tolist() == ["inexact", "rocking", "rocking"]
    for x, error in zip(xs[1:], found.estimate[1:], strict=True):
        known = exact(np.asarray(x)).amplitude
        assert error == pytest.approx(abs(smoothed(np.asarray(x)).amplitude / known - 1.0), abs=2e-6)


def test_an_early_overturning_ends_a_long_trajectory():
    p = Parameters(nu=0.25, mu=0.1, lam=0.5, zeta=0.1, k=0.05, f=0.5, xi=2.5)
    motion = simulate(p, np.zeros(4), [0.0, 0.5, 500.0], model=Smoothed())
    assert status_name(motion.status) == "overturned"
    assert np.isfinite(motion.ys[:2]).all()
