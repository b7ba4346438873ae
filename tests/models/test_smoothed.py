"""The smoothed model against the exact one: how near, how it gets nearer, and its derivatives."""

import jax
import numpy as np
import pytest

from tests.reference import (
    BARE,
    HUNG,
    MOVING,
    NAMES,
    OVERTURNING,
    REST,
    STILL,
    assert_overturned,
    differences,
    exact,
    named,
    parameters,
    smoothed,
)
from tpd import Parameters, Segmented, Smoothed, Status, Terms, simulate, status_name, steady_state
from tpd.models.smoothed import rocking_scale
from tpd.scene.impacts import housner
from tpd.scene.parameters import uniform_inertia_ratio

COARSER = 4.0


@pytest.mark.parametrize("case", MOVING, ids=named)
def test_default_settings_are_within_a_thousandth_of_the_exact_amplitude(case):
    answer = smoothed(case.x, case.y0)
    assert answer.status == "rocking"
    assert answer.amplitude == pytest.approx(exact(case.x, case.y0).amplitude, rel=1e-3)


@pytest.mark.parametrize("case", MOVING, ids=named)
def test_the_gradient_is_near_the_exact_one(case):
    found, expected = (solve(case.x, case.y0).slopes[0] for solve in (smoothed, exact))
    np.testing.assert_allclose(found, expected, rtol=5e-3, atol=1e-12)


@pytest.mark.parametrize("case", HUNG, ids=named)
def test_stroke_and_multiplier_are_near_the_exact_ones(case):
    found, expected = smoothed(case.x), exact(case.x)
    assert found.stroke == pytest.approx(expected.stroke, rel=1e-3)
    assert found.steady.multiplier == pytest.approx(float(expected.steady.multiplier), rel=1e-3)
    assert found.steady.periods == expected.steady.periods


@pytest.mark.parametrize("case", [HUNG[0], BARE[1]], ids=named)
def test_the_bias_falls_in_proportion_to_the_sharpness(case):
    few, many = (smoothed(case.x, case.y0, times) for times in (1.0, COARSER))
    truth = exact(case.x, case.y0)
    ratio = (many.amplitude - truth.amplitude) / (few.amplitude - truth.amplitude)
    assert 0.8 < np.log(ratio) / np.log(COARSER) < 1.2
    ratio = np.abs(many.slopes[0] - truth.slopes[0]).max() / np.abs(few.slopes[0] - truth.slopes[0]).max()
    assert 0.8 < np.log(ratio) / np.log(COARSER) < 1.2


@pytest.mark.parametrize("case", [HUNG[0], HUNG[3]], ids=named)
@pytest.mark.parametrize("i", range(7), ids=NAMES[:7])
def test_the_gradient_is_that_of_differences_of_the_same_amplitude(case, i):
    # Started from the settled state, so that a far step cannot end on another orbit. Steps of 1 %
    # are far above the integration tolerance (1e-12), and the extrapolation is of sixth order.
    state = smoothed(case.x).steady.state
    expected = differences(lambda x: smoothed(x, state).amplitude, case.x, i)
    assert smoothed(case.x).slopes[0, i] == pytest.approx(expected, rel=1e-5)


def test_a_resting_block_is_at_rest_although_the_smoothed_one_hums():
    answer = smoothed(STILL.x)
    assert answer.status == "rest"
    assert answer.amplitude == 0.0
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    assert answer.stroke == pytest.approx(exact(STILL.x).stroke, rel=1e-2)


def test_a_coarse_sharpness_overturns_a_block_that_rocks():
    # The transient from rest feels the widths more than the orbit does: why the default is small.
    x, periods = HUNG[1].x, 10
    assert exact(x).status == smoothed(x).status == "rocking"
    times = np.linspace(0.0, periods * 2 * np.pi / x[6], 51)
    assert (
        simulate(parameters(x), np.array(REST), times, model=Smoothed(sharpness=0.1)).status
        == Status.overturned
    )


def test_an_overturning_has_a_status_and_no_gradient():
    assert_overturned(smoothed(OVERTURNING))


def test_a_trajectory_is_near_the_exact_one():
    x = HUNG[3].x
    times = np.linspace(0.0, 3 * 2 * np.pi / x[6], 51)
    found, expected = (
        simulate(parameters(x), np.array([0.05, 0.0, 0.0, 0.0]), times, **options).ys
        for options in ({"model": Smoothed()}, {})
    )
    np.testing.assert_allclose(found[:, :2], expected[:, :2], rtol=0, atol=1e-3)
    assert np.abs(expected[:, 0]).max() > 0.05


def test_widths_follow_the_orbit_that_is_expected():
    p = parameters(HUNG[0].x)
    coarser = [COARSER * width for width in Smoothed().widths(p)]
    np.testing.assert_allclose(
        Smoothed(sharpness=COARSER * Smoothed().sharpness).widths(p), coarser, rtol=1e-15
    )
    width, rate_width = Smoothed(sharpness=0.01).widths(p)
    assert width == pytest.approx(0.01 * rocking_scale(p), rel=1e-14)
    assert rate_width == pytest.approx(p.xi * width, rel=1e-14)
    # One harmonic of free rocking, no forcing: 3 % above (11) here.
    bare = parameters((0.2, 0.0, 0.4, 0.2, 0.0, 0.0, 4.0))
    assert rocking_scale(bare) == pytest.approx(0.2 * (1 - 1 / np.cosh(np.pi / 2 / 4.0)), rel=0.05)


STRUCK = (
    (0.13, 0.0346, 0.1043, 0.598, 0.0, 0.2356, 4.7, 0.5),
    (0.13, 0.0346, 0.1043, 0.598, 0.0, 0.2356, 4.7, 0.95),
    (0.2, 0.1, 0.5, 0.2, 0.0, 0.3, 4.0, 0.5),
    (0.2, 0.1, 0.5, 0.2, 0.0, 0.3, 4.0, 0.8),
    (0.2, 0.1, 0.5, 0.2, 0.0, 0.3, 4.0, housner(0.2, uniform_inertia_ratio(0.2), 0.1)),
    (0.2, 0.05, 0.8, 0.1, 0.05, 0.3, 3.0, 0.6),
    (0.15, 0.2, 0.3, 0.3, 0.01, 0.25, 5.5, 0.65),
    (0.25, 0.3, 0.4, 0.3, 0.0, 0.4, 3.0, 0.7),
    (0.25, 0.1, 0.8, 0.1, 0.05, 0.5, 3.5, 0.8),
    (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 0.97),
)
"""Scenes with impacts, e last: that of the fifth is Housner's. From rest all come to symmetric rocking."""
E, DESIGN = 7, slice(1, 4)
"""Places of e, and of mu, lam and zeta."""
WIDE, NARROW = 5.0, 0.5
"""Widths over the default's: `sharpness` of 1e-2 and 1e-3."""


def off(found, expected):
    """Largest error of the derivatives in mu, lam and zeta over the largest of these."""
    apart = np.abs(found.slopes[0, DESIGN] - expected.slopes[0, DESIGN])
    return apart.max() / np.abs(expected.slopes[0, DESIGN]).max()


@pytest.mark.parametrize("x", STRUCK, ids=lambda x: f"xi = {x[6]:g}, e = {x[E]:.3g}")
def test_impacts_are_near_the_exact_ones_in_amplitude_and_gradient(x):
    found, expected = smoothed(x), exact(x)
    assert found.status == expected.status == "rocking"
    assert bool(found.steady.symmetric)
    assert bool(expected.steady.symmetric)
    hard = x[E] < 0.8
    assert found.amplitude == pytest.approx(expected.amplitude, rel=5e-4 if hard else 5e-5)
    assert off(found, expected) < (5e-3 if hard else 1e-3)
    assert found.slopes[0, E] == pytest.approx(expected.slopes[0, E], rel=2e-3)


@pytest.mark.parametrize("x", STRUCK, ids=lambda x: f"xi = {x[6]:g}, e = {x[E]:.3g}")
def test_the_error_of_impacts_falls_in_proportion_to_the_sharpness(x):
    wide, narrow, truth = smoothed(x, coarser=WIDE), smoothed(x, coarser=NARROW), exact(x)
    ratio = (wide.amplitude - truth.amplitude) / (narrow.amplitude - truth.amplitude)
    assert ratio == pytest.approx(WIDE / NARROW, rel=0.1)
    assert off(wide, truth) / off(narrow, truth) == pytest.approx(WIDE / NARROW, rel=0.1)


def test_the_derivative_in_e_is_that_of_differences_of_the_same_amplitude():
    x = STRUCK[3]
    state = smoothed(x).steady.state
    expected = differences(lambda x: smoothed(x, state).amplitude, x, E)
    assert smoothed(x).slopes[0, E] == pytest.approx(expected, rel=1e-5)


RUBBING = (0.2, 0.1, 0.5, 0.2, 0.02, 0.3, 4.0)


def of_housner(model):
    """Amplitude of `RUBBING` with Housner's impacts, which follow nu and mu, and its derivatives."""

    @jax.jit
    def solve(x):
        def amplitude(x):
            p = Parameters(**dict(zip(NAMES, x, strict=False)), e=None)
            steady = steady_state(p, model=model)
            return steady.amplitude, steady.status

        return jax.value_and_grad(amplitude, has_aux=True)(x)

    (amplitude, status), slopes = solve(np.array(RUBBING))
    assert status_name(status) == "rocking"
    return float(amplitude), np.asarray(slopes)


def test_with_parametric_terms_impacts_are_those_of_true_signs_and_housner_s_follow_block_and_bob():
    smooth, true = (of_housner(model(terms=Terms.parametric)) for model in (Smoothed, Segmented))
    assert smooth[0] == pytest.approx(true[0], rel=5e-5)
    np.testing.assert_allclose(smooth[1], true[1], rtol=1e-3)
    # Without the parametric term it is another motion.
    e = float(housner(RUBBING[0], uniform_inertia_ratio(RUBBING[0]), RUBBING[1]))
    assert abs(exact((*RUBBING, e)).amplitude / true[0] - 1.0) > 1e-3


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
def test_impacts_without_a_smoothed_counterpart_are_refused(call, terms, e, message):
    with pytest.raises(ValueError, match=message):
        call(parameters((*HUNG[0].x, e)), model=Smoothed(terms=terms))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sharpness": 0.0}, "`sharpness` must be between 1e-06 and 1, but is 0"),
        ({"sharpness": 2.0}, "`sharpness` must be between 1e-06 and 1, but is 2"),
        ({"rtol": -1e-6}, "`rtol` must be positive and finite, but is -1e-06"),
        ({"max_periods": 0}, "`max_periods` must be a whole number, 1 or more, but is 0"),
    ],
)
def test_settings_out_of_range_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Smoothed(**options)
