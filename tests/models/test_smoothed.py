"""The smoothed model against the exact one: how near, how it gets nearer, and its derivatives."""

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
from tpd import Smoothed, Status, simulate, steady_state
from tpd.models.smoothed import rocking_scale

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


@pytest.mark.parametrize(
    "call", [steady_state, lambda p, **o: simulate(p, np.array(REST), np.array([0.0, 1.0]), **o)]
)
def test_an_impact_loss_is_refused(call):
    with pytest.raises(ValueError, match=r"`e` must be between 1 and 1 in the smoothed model.*but is 0\.9"):
        call(parameters((*HUNG[0].x, 0.9)), model=Smoothed())


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
