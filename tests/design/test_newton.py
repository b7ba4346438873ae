"""Newton's method on a smoothed worst case: the smoothing with its derivatives, and known minima of small
problems."""

import numpy as np
import pytest

import tpd
from tests.design.minimax import FREE, LIMITED, STARTS, WORST
from tpd.design.newton import NARROW, PENALTY, Linearisation, _updated, newton, smoothed, width_at
from tpd.design.search import descend

LEAST = 1.9522245
"""Minimax of `FREE`."""


def descended(problem, starts=STARTS, cap=1.0, risk=WORST, **settings):
    """Ends of the descents, far from the optimum and then near it as in a search."""
    wide = descend("newton", problem, starts, problem(starts), cap, risk, **{"steps": 40} | settings)
    return descend("newton", problem, wide.x, wide.local, cap, risk, steps=40, widths=NARROW)


def test_the_width_decreases_geometrically_and_then_remains():
    widths = [width_at(step, 40, (1e-2, 1e-4)) for step in range(40)]
    np.testing.assert_allclose(widths[0::15][:3], [1e-2, 1e-3, 1e-4])
    np.testing.assert_allclose(widths[30:], 1e-4)


@pytest.mark.parametrize("cap", [1.0, 0.5, 1.0 / 3.0])
def test_the_smoothed_measure_tends_to_the_risk_to_first_order(cap):
    risk, at = tpd.Risk.cvar(1.0 / (3.0 * cap)), LIMITED(STARTS)
    sharp = risk.of(at.value) + PENALTY * np.maximum(at.limit[:, 0], 0.0)
    np.testing.assert_allclose(smoothed(at, cap, 1e-7).value, sharp, atol=1e-5)
    # Two functions are equal and the limit is active: there the error is largest.
    none = np.zeros((1, 3, 2)), np.zeros((1, 1)), np.zeros((1, 1, 2))
    kink = Linearisation(np.array([[1.0, 1.0, 0.9]]), *none)
    sharp = risk.of(kink.value)
    errors = [float((smoothed(kink, cap, width).value - sharp)[0]) for width in (4e-3, 2e-3, 1e-3)]
    np.testing.assert_allclose(np.log2(np.array(errors[:2]) / errors[1:]), 1.0, atol=1e-3)


@pytest.mark.parametrize("width", [0.03, 0.3])
@pytest.mark.parametrize("cap", [1.0, 0.5, 1.0 / 3.0])
def test_the_slope_and_the_curvature_of_the_measure_equal_differences(cap, width):
    """The curvature is that of planes, so it is compared along the tangent planes of the functions."""
    at = LIMITED(STARTS)
    found = smoothed(at, cap, width)

    def moved(x):
        value, limit = at.value + at.slope @ x, at.limit + at.limit_slope @ x
        return smoothed(at._replace(value=value, limit=limit), cap, width)

    for i in range(2):
        # The error of a central difference is step^2 / width^2, and that of rounding 1e-16 / step.
        step = 1e-5 * width * np.eye(2)[i]
        up, down = smoothed(LIMITED(STARTS + step), cap, width), smoothed(LIMITED(STARTS - step), cap, width)
        slope = (up.value - down.value) / (2e-5 * width)
        np.testing.assert_allclose(found.slope[:, i], slope, rtol=1e-6, atol=1e-6)
        curved = (moved(step).slope - moved(-step).slope) / (2e-5 * width)
        np.testing.assert_allclose(found.curvature[:, i], curved, rtol=1e-5, atol=1e-5)


def test_an_infinite_value_gives_an_infinite_measure_and_no_slope():
    at = FREE(STARTS)
    found = smoothed(at._replace(value=np.where(np.arange(4)[:, None] == 2, np.inf, at.value)), 1.0, 0.01)
    np.testing.assert_array_equal(np.isinf(found.value), [False, False, True, False])
    assert np.isfinite(found.slope).all()


def test_an_update_of_the_curvature_is_positive_and_explains_the_change_of_the_slope():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(50, 3, 3))
    before = root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(3)
    moved, change = rng.normal(size=(2, 50, 3))
    after = _updated(before, moved, change)
    assert np.linalg.eigvalsh(after).min() > 0.0
    # The secant equation holds wherever the change has at least a fifth of the curvature before.
    gained, old = np.sum(moved * change, axis=1), np.einsum("mi,mij,mj->m", moved, before, moved)
    enough = gained >= 0.2 * old
    assert 5 < enough.sum() < 45
    np.testing.assert_allclose(np.einsum("mij,mj->mi", after, moved)[enough], change[enough], atol=1e-9)
    # Without a step, or with an unknown change, nothing is learnt.
    np.testing.assert_array_equal(_updated(before, np.zeros_like(moved), change), before)
    np.testing.assert_array_equal(_updated(before, moved, np.full_like(change, np.nan)), before)


def test_descents_reach_a_known_minimax_from_every_start():
    """A narrow kink is a curved valley here: 40 steps end within 0.1 %, and 160 steps at the minimum."""
    np.testing.assert_allclose(descended(FREE).merit, LEAST, rtol=1e-3)
    ends = descended(FREE, steps=160)
    # The narrowest width is 1e-5, and the three functions add at most the width times log 3.
    np.testing.assert_allclose(ends.merit, LEAST, atol=1e-5)
    np.testing.assert_allclose(6.0 * ends.x - 3.0, [[1.13904, 0.89956]] * 4, atol=1e-3)
    assert ends.converged.all()
    few = descend("newton", FREE, STARTS, FREE(STARTS), 1.0, WORST, steps=4)
    assert not few.converged.any(), "where the steps run out"


def test_descents_minimise_the_conditional_value_at_risk():
    """Of three functions the mean of the worst two, least on the limit where two of them are equal: there
    x^2 + (1.5 - x)^4 = 2 e^(1.5 - 2 x)."""
    risk = tpd.Risk.cvar(2.0 / 3.0)
    ends = descended(LIMITED, cap=risk.cap(3), risk=risk.of)
    np.testing.assert_allclose(ends.merit, 2.20740775, atol=5e-5)


def test_descents_stop_at_the_bounds_and_move_along_them():
    """The free minimum lies beyond the upper bound of the first variable, and beyond no bound of the
    second."""

    def valley(unit):
        x, y = (unit - [1.4, 0.3]).T
        value = (x + y) ** 2 + 4.0 * (x - 2.0 * y) ** 2
        slope = np.stack([2.0 * (x + y) + 8.0 * (x - 2.0 * y), 2.0 * (x + y) - 16.0 * (x - 2.0 * y)], axis=1)
        none = np.full((len(unit), 1), -1.0), np.zeros((len(unit), 1, 2))
        return Linearisation(value[:, None], slope[:, None], *none)

    ends = descended(valley, np.array([[0.2, 0.9], [1.0, 1.0], [0.0, 0.0]]))
    # At x = 1: 2 (y' - .4) + 16 (2 y' + .4) = 0 with y' = y - .3.
    np.testing.assert_allclose(ends.x, [[1.0, 0.3 - 5.6 / 34.0]] * 3, atol=1e-6)


def test_a_step_that_does_not_lower_the_measure_is_taken_back_and_damped():
    method = newton(1.0, 40, (1e-2, 1e-2))
    x = np.array([[0.35, 0.8]])
    step, state = method.update(None, method.init(x), x, at=FREE(x))
    worse = FREE(x)._replace(value=FREE(x).value + 1.0)
    back, after = method.update(None, state, x + step, at=worse)
    np.testing.assert_array_equal(after.x, x)
    assert after.damping > state.damping
    assert np.linalg.norm(x + step + back - x) < np.linalg.norm(step)
