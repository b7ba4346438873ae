"""The march: its bounds hold, it meets the events of the careful search, and rattles end where hops do."""

import jax
import numba
import numpy as np
import pytest
from tpd.compiled.arcs import steady
from tpd.compiled.contact_kernel import decide, sign
from tpd.compiled.events import BOB

from tests.compiled.plants import plants_of
from tests.reference import box, exact, parameters
from tpd import Piecewise, simulate
from tpd.compiled import march
from tpd.compiled.columns import REST, SLIP, TILT, TILT_RATE
from tpd.compiled.motion import GRID, LEG, MOTION, WORKSPACE
from tpd.compiled.period_map import Limits, follow_periods

RATTLES = (0.25, 0.0986, 0.6, 0.1, 0.05, 0.37, 2.67), (0.25, 0.4, 0.4, 0.3, 0.0, 0.37, 2.67, 0.91)
"""The paper's block with a long pendulum, and a block that loses energy at impacts."""
PERIODS, CAPACITY = 3, 4000


@numba.njit
def followed(plants, y0, marches, legs, counts, ends):
    """Legs of some periods from each state, by the march or by the careful search alone."""
    motions, workspaces, f = np.zeros(1, MOTION), np.zeros(1, WORKSPACE), steady(np.empty((0, 4)))
    m, workspace = motions[0], workspaces[0]
    for n in range(len(plants)):
        q = plants[n]
        march.prepare_march(q, workspace.march)
        if not marches:
            # Without steps, and in a hurry that no flight is short for, nothing is proved.
            workspace.march.jump, workspace.march.quickest = 0.0, np.inf
        for i in range(4):
            m.y[i] = y0[n, i]
        decide(q, m.y, sign(m.y[TILT]), sign(m.y[TILT_RATE]), 0.0, m)
        ends[n] = follow_periods(
            q, f, m, legs[n], workspace, Limits(2e-7 * q.nu, 2000, (0, 13), 1.0), PERIODS
        )
        counts[n] = m.n_legs
    return len(motions) + len(workspaces)


@numba.njit
def store_bounds(plants, y, kind, bounds, sizes):
    """Bounds on fourth and fifth derivatives of both angles, and the largest sizes of these over a step."""
    motions, workspaces = np.zeros(1, MOTION), np.zeros(1, WORKSPACE)
    m, a, q = motions[0], workspaces[0].march, plants[0]
    march.prepare_march(q, a)
    m.kind, m.tilt, m.direction, a.share, a.growth, a.sine, a.cosine = kind, 1.0, -1.0, 0.4, 0.02, 0.6, 0.8
    for i in range(4):
        m.y[i] = y[i]
    held, angles = kind != SLIP, march._parts_of(q, m, a)
    for k in range(2):
        bounds[k] = march.bounds_of(a, held, angles[k], a.step)
    for n in range(GRID + 1):
        for k in range(2):
            onward = march._onward(q, a, n, held, angles[k])
            march._store_series(q, held, onward, a.series[k])
            for j in range(2):
                grown = a.orders[j].rising * abs(onward.rising)
                sizes[k, j] = max(sizes[k, j], abs(a.series[k, 4 + j]) * (24.0 if j == 0 else 120.0) - grown)
    return len(motions) + len(workspaces)


@pytest.mark.parametrize("kind", [SLIP, REST])
def test_derivatives_of_an_arc_stay_below_their_bounds(kind):
    rng, closest = np.random.default_rng(3), np.zeros((2, 2))
    for zeta in (0.0, 0.1, 0.6, 1.5):
        plants = plants_of([[0.25, 0.2, 0.4, zeta, 0.05, 0.4, 2.7]])
        for _ in range(100):
            bounds, sizes = np.empty((2, 2)), np.zeros((2, 2))
            store_bounds(plants, rng.normal(size=4), float(kind), bounds, sizes)
            assert np.all(sizes <= bounds * (1.0 + 1e-12))
            closest = np.maximum(closest, sizes / bounds)
    # Not far below either: the proofs would fail.
    assert np.all(closest > 0.5)


def test_the_fast_event_search_equals_the_careful_search():
    x, starts = box(60, 5)
    both = []
    for marches in (True, False):
        legs, counts, ends = np.zeros((len(x), CAPACITY), LEG), np.zeros(len(x), int), np.zeros(len(x), int)
        followed(plants_of(x), starts, marches, legs, counts, ends)
        both.append((legs, counts, ends))
    (legs, counts, ends), (expected, many, how) = both
    assert np.array_equal(ends, how)
    assert np.sum(ends == 0) > 40
    for n in range(len(x)):
        # In the closed form of the careful search the shortest hops have few digits left.
        a, b = (found[n, :count] for found, count in ((legs, counts[n]), (expected, many[n])))
        a, b = a[a["duration"] > 1e-4], b[b["duration"] > 1e-4]
        for name in ("kind", "tilt", "direction", "event"):
            assert np.array_equal(a[name], b[name])
        # One hop more before rest is as long as the capture speed says, some 1e-7.
        for name in ("start", "duration", "y"):
            np.testing.assert_allclose(a[name], b[name], rtol=0, atol=1e-6)
    assert np.any(legs["event"] == BOB)


@pytest.mark.parametrize("x", RATTLES)
def test_the_limit_of_a_rattle_equals_the_sum_of_its_impacts(x):
    # With derivatives every hop is followed, without them the limit of the hops is taken.
    x = np.array([*x, *[1.0] * (8 - len(x))])
    y0 = exact(x).steady.state * np.array([1.0, 0.9, 1.0, 0.9])
    times = np.linspace(0.0, 3.0 * 2.0 * np.pi / x[6], 31)

    def states(x):
        return simulate(parameters(x), y0, times, model=Piecewise(max_events=4000)).ys

    hops, _ = jax.jvp(states, (x,), (np.ones(8),))
    np.testing.assert_allclose(states(x), hops, rtol=0, atol=2e-12)
