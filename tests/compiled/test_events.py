"""The first event of an arc: the first zero among all its signals, against a dense sample and SciPy."""

import numba
import numpy as np
from scipy.optimize import brentq
from tpd.compiled.arcs import Forcing, beginning, forcing_signal, instant, launch, load_at, state_at
from tpd.compiled.events import END, FIRST, SECOND, WINDOWS

from tests.compiled.plants import plants_of
from tpd.compiled import events
from tpd.compiled.motion import MOTION, WORKSPACE, YES

STEADY = Forcing(YES, 1.0, 0.0, 0, np.empty((0, 4)))


@numba.njit
def first_event(plants, modes, workspaces, f, y, s, end):
    """The event and its time on the arc that leaves `y` at the time s, within the time `end`."""
    q, m, w = plants[0], modes[0], workspaces[0]
    e = load_at(q, f, 0, s)
    arc = launch(q, m.kind, m.tilt, m.direction, y[0], y[1], y[2], y[3], e)
    w.has_second, w.count = events.watch_block(q, arc, m, forcing_signal(e), w), events.BOB
    w.shortest, w.longest, w.window, w.limit, w.budget = 1e-10, 0.3, 0.3, 100.0, 50 * WINDOWS
    return events.next_event(arc, w, beginning(arc), 0.0, end)


@numba.njit
def followed(plants, modes, f, y, s, times, out):
    q, m = plants[0], modes[0]
    arc = launch(q, m.kind, m.tilt, m.direction, y[0], y[1], y[2], y[3], load_at(q, f, 0, s))
    for i in range(len(times)):
        now = state_at(arc, instant(arc, times[i]), times[i])
        for k in range(6):
            out[i, k] = now[k]


def found(plants, y, mode, s, end):
    modes, workspaces = np.zeros(1, MOTION), np.zeros(1, WORKSPACE)
    modes["kind"], modes["tilt"], modes["direction"] = mode
    which, t = first_event(plants, modes, workspaces, STEADY, y, s, end)

    def signal(k, times):
        out = np.empty((len(times), 6))
        followed(plants, modes, STEADY, y, s, times, out)
        return out[:, k]

    return which, t, signal


def test_the_event_is_the_first_zero_of_tilt_or_rate():
    rng, met = np.random.default_rng(3), {END: 0, FIRST: 0, SECOND: 0}
    for _ in range(60):
        x = rng.uniform([0.1, 0.0, 0.1, 0.0, 0.0, 0.1, 0.8], [0.3, 0.4, 1.5, 1.2, 0.1, 0.6, 6.0])
        y, end = rng.normal(size=4) * [0.1, 0.3, 0.2, 0.5], rng.uniform(0.2, 1.5)
        tilt, way = np.sign(y[0]), np.sign(y[2])
        which, t, signal = found(plants_of(x[None]), y, (0.0, tilt, way), rng.random() * 2.0, end)
        grid = np.linspace(0.0, end, 4001)
        zeros = []
        for kind, k, sign in ((FIRST, 2, way), (SECOND, 0, tilt)):
            values = sign * signal(k, grid)
            for i in np.flatnonzero((values[:-1] > 0.0) & (values[1:] <= 0.0))[:1]:
                root = brentq(
                    lambda u, k=k, signal=signal: signal(k, np.array([u]))[0],
                    grid[i],
                    grid[i + 1],
                    xtol=1e-14,
                )
                zeros.append((root, kind))
        first, kind = min(zeros, default=(end, END))
        assert which == kind
        assert abs(t - first) < 1e-9
        met[kind] += 1
    assert min(met.values()) > 5


def test_the_event_search_detects_two_close_zeros_of_the_rate():
    # A block that all but turns as it falls: its rate is 1e-7 beyond zero at most, for some 1e-3 of time.
    x, mode, end = np.array([0.2, 0.0, 0.4, 0.2, 0.03, 0.7, 3.0]), (0.0, 1.0, -1.0), 0.9
    plants, begin = plants_of(x[None]), (1.5 * np.pi - 0.4) / 3.0

    def highest(v):
        signal = found(plants, np.array([0.15, 0.0, -v, 0.0]), mode, begin, end)[2]
        grid = np.linspace(0.0, end, 601)
        i = int(np.argmax(signal(2, grid)))
        return signal(2, np.linspace(grid[i - 1], grid[i + 1], 2001)).max()

    v = brentq(lambda v: highest(v) - 1e-7, 0.25, 0.3)
    which, t, signal = found(plants, np.array([0.15, 0.0, -v, 0.0]), mode, begin, end)
    assert which == FIRST
    assert abs(signal(2, np.array([t]))[0]) < 1e-12
    assert found(plants, np.array([0.15, 0.0, -v - 2e-7, 0.0]), mode, begin, end)[0] == END


def test_a_signal_that_starts_at_a_turning_point_has_one_zero():
    prove, rng, proved = numba.njit(lambda *args: events.prove_window(*args)), np.random.default_rng(4), 0
    s = np.linspace(0.0, 1.0, 2001)
    for _ in range(2000):
        # 1 - b s^2 + c s^3 + d s^4/24: its fourth derivative is d.
        b, c, d = rng.uniform(0.0, 8.0), rng.uniform(-4.0, 6.0), rng.uniform(-60.0, 60.0)
        g = 1.0 - b * s**2 + c * s**3 + d * s**4 / 24.0
        slope = -2.0 * b + 3.0 * c + d / 6.0
        proof = prove(1.0, 0.0, g[-1], slope, 1.0, abs(d))
        proved += proof == events.ONE
        if proof != events.UNKNOWN:
            changes = np.sum(np.diff(np.sign(g)) != 0.0)
            assert changes == (1 if proof == events.ONE else 0)
    assert proved > 300
