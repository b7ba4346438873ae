"""Following a motion, one forcing period after another, until it repeats: what every peer shares.

A peer brings the integration of one arc: `slip(t, y, s, sigma, end)`, with constant signs, gives (time,
state, event) where it ends, the event "turn", "zero", "gone" or, at `end`, "end"; `held(t, y, s, end)` gives
(time, state, direction) where a held block is freed, direction 0 at `end`. The loop over arcs, the rules
between them, the settling and the differences are here. They are those of the linear equations (25) without
the parametric term; the time starts anew with every period, so that its map is always the same function.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from tests.benchmarks.precision.methods import Unable
from tests.benchmarks.precision.scenes import Scene

MOST = 400
"""Forcing periods after which a motion has not settled."""
EVENTS = 3000
"""Bound on the arcs of one forcing period."""
GONE = 2.0
"""A tilt (rad) from which nothing returns."""
WINDOW = 4
"""Forcing periods over which the decay of a transient is taken."""
STEP = 0.25
"""Longest step of an integrator over the forcing period, so that no two turning points share one."""


class Plant(NamedTuple):
    """The constants of one design; for compiled code, an array of them in this order."""

    i11: float
    i12: float
    i21: float
    i22: float
    up: float
    hinge: float
    drag: float
    f: float
    xi: float
    inertia: float
    weight: float
    k: float
    mu: float
    by_rate: float
    lam: float
    nu: float
    e: float

    @property
    def period(self) -> float:
        """Of the forcing."""
        return 2.0 * math.pi / self.xi

    def held_step(self) -> float:
        """Longest step while held: a sixteenth of the shorter of the forcing's and the bob's period,
        so that a short peak of the moment over the friction is seen."""
        return min(self.period, 2.0 * math.pi * math.sqrt(self.inertia)) / 16.0


def plant(x: tuple[float, ...]) -> Plant:
    """Of nu, mu, lam, zeta, k, f, xi, e, the block being a uniform rectangle."""
    nu, mu, lam, zeta, k, f, xi, e = map(float, x)
    rho = 3.0 / (4.0 * (1.0 + nu * nu))
    inertia, hinge = lam * rho, 2.0 * zeta * math.sqrt(lam * rho)
    m11, m12, m21 = 1.0 + mu * rho * (4.0 + nu * nu), -2.0 * mu * rho * lam, -2.0 * rho
    det = m11 * inertia - m12 * m21
    inverse = (inertia / det, -m12 / det, -m21 / det, m11 / det)
    drag, by_rate = mu * lam * hinge, mu * hinge * (lam - 2.0)
    shape = (1.0 + 2.0 * mu, hinge, drag, f, xi, inertia, (1.0 + mu) * nu, k, mu, by_rate, lam, nu, e)
    return Plant(*inverse, *shape)


@njit
def fill_slip(t: float, y: np.ndarray, out: np.ndarray, c: np.ndarray, load: float) -> None:
    """The rates of a slipping block, from the numbers of its plant; `load` is s weight + sigma k."""
    i11, i12, i21, i22, up, hinge, drag = c[0], c[1], c[2], c[3], c[4], c[5], c[6]
    push, slide = c[7] * math.sin(c[8] * t), y[2] - y[3]
    block = up * (y[0] - push) - load - drag * slide
    bob = push - y[1] + hinge * slide
    out[0], out[1] = y[2], y[3]
    out[2], out[3] = i11 * block + i12 * bob, i21 * block + i22 * bob


@njit
def fill_held(t: float, y: np.ndarray, out: np.ndarray, c: np.ndarray) -> None:
    """The same of a block that sticks or rests."""
    hinge, inertia = c[5], c[9]
    out[0], out[1], out[2] = 0.0, y[3], 0.0
    out[3] = (c[7] * math.sin(c[8] * t) - y[1] - hinge * y[3]) / inertia


@njit
def slip_rates(t: float, y: np.ndarray, c: np.ndarray, load: float) -> np.ndarray:
    """As a new array."""
    out = np.empty(4)
    fill_slip(t, y, out, c, load)
    return out


@njit
def held_rates(t: float, y: np.ndarray, c: np.ndarray) -> np.ndarray:
    """As a new array."""
    out = np.empty(4)
    fill_held(t, y, out, c)
    return out


def moment(p: Plant, t: float, y: Any) -> float:
    """What weight and friction must balance while the block is held."""
    push = p.f * math.sin(p.xi * t)
    return p.up * y[0] - push - 2.0 * p.mu * y[1] + p.by_rate * y[3]


class Mode(NamedTuple):
    """Held or slipping, with the signs of the tilt and of its rate."""

    held: bool
    s: float
    sigma: float


def mode(p: Plant, t: float, y: Any) -> Mode:
    """From a state."""
    s, sigma = float(np.sign(y[0])), float(np.sign(y[2]))
    if sigma:
        return Mode(False, s or sigma, sigma)
    excess = moment(p, t, y) - s * p.weight
    if abs(excess) <= p.k + (0.0 if s else p.weight):
        return Mode(True, s, 0.0)
    way = math.copysign(1.0, excess)
    return Mode(False, s or way, way)


class Overturned(Exception):
    """The block has gone beyond return."""


def impact(p: Plant, t: float, y: np.ndarray, quiet: float) -> np.ndarray:
    """The state after the tilt has crossed zero; one slower than `quiet` ends a rattle."""
    speed, y = y[2], y.copy()
    y[0] = 0.0
    slow = abs(speed) <= quiet and abs(moment(p, t, y)) <= p.weight + p.k
    y[2] = 0.0 if slow else p.e * speed
    # The rod pulls along itself only: the bob keeps lam psi' - 2 phi'.
    y[3] += 2.0 / p.lam * (y[2] - speed)
    return y


def one_period(p: Plant, arcs: Any, y: np.ndarray, quiet: float) -> tuple[np.ndarray, float]:
    """State at the end of a forcing period and largest |phi| within it, from the state at its begin."""
    t, end, peak = 0.0, p.period, 0.0
    held, s, sigma = mode(p, t, y)
    for _ in range(EVENTS):
        if held:
            peak = max(peak, abs(y[0]))
            t, y, way = arcs.held(t, y, s, end)
            if not way:
                return y, peak
            held, s, sigma = False, s or way, way
            continue
        t, y, event = arcs.slip(t, y, s, sigma, end)
        if event == "end":
            return y, peak
        if event == "gone":
            raise Overturned
        if event == "turn":
            y[2] = 0.0
            peak = max(peak, abs(y[0]))
        else:
            y = impact(p, t, y, quiet)
        held, s, sigma = mode(p, t, y)
    raise Unable("endless rattle")


def quiet(p: Plant, tolerance: float) -> float:
    """Rate at an impact below which a rattle is over: what is left out is of its square."""
    return p.nu * min(1e-4, max(1e-8, 0.1 * math.sqrt(tolerance)))


class Settled(NamedTuple):
    """The state at the begin of a forcing period, the largest |phi| in it, and the periods it took."""

    y: np.ndarray
    amplitude: float
    periods: int


def settle(
    p: Plant, period: Callable[[np.ndarray], tuple[np.ndarray, float]], y0: Any, tolerance: float
) -> Settled:
    """Apply the map of a period until what is left of the transient is below the tolerance, as the
    decay of the changes over a few periods tells, or the changes are noise that no longer falls."""
    y, changes, peak = np.array(y0, dtype=float), [], 0.0
    while len(changes) < MOST:
        before, (y, peak) = y, period(y)
        changes.append(_change(p, before, y, peak))
        if changes[-1] <= tolerance and _left(changes, tolerance) <= tolerance:
            break
    return Settled(y, peak, len(changes))


def _left(changes: list[float], tolerance: float) -> float:
    """What is left of the transient, from the change of every period so far. The decay need not be
    monotone, so it is that of the largest of a few changes over as many periods."""
    now, then = max(changes[-WINDOW:]), max(changes[-2 * WINDOW : -WINDOW], default=math.inf)
    if now <= 0.01 * tolerance:
        return 0.0
    if len(changes) > 5 * WINDOW and now <= 100.0 * tolerance and now > 0.5 * min(changes[: -4 * WINDOW]):
        return 0.0
    share = (now / then) ** (1.0 / WINDOW) if now < then else 1.0
    return now * share / (1.0 - share) if share < 1.0 else math.inf


def _change(p: Plant, before: np.ndarray, after: np.ndarray, peak: float) -> float:
    """Relative to the sizes of the motion; without mass the bob does not matter."""
    bob = math.hypot(after[1], after[3] / p.xi) + 1e-12 if p.mu else math.inf
    tilt = max(peak, 1e-12)
    scale = np.array([tilt, bob, p.xi * tilt, p.xi * bob])
    return float(np.max(np.abs(after - before) / scale))


def amplitude(result: Callable[[], Settled]) -> float:
    """Of a settled motion; infinite for one that overturned."""
    try:
        return result().amplitude
    except Overturned:
        return math.inf


def differences(
    scene: Scene, settled: Callable[[Scene, Any, float], Settled], tolerance: float, floor: float = 0.1
) -> np.ndarray:
    """Central differences of the amplitude in the parameters `wrt`. The steps are a share of the
    parameter, or of `floor` if that is larger: the cube root of the relative error, times what was best
    on most of the scenes. The sides start where the scene has settled."""
    share = 0.3 * tolerance ** (1.0 / 3.0)
    slopes = np.full(len(scene.wrt), math.nan)
    try:
        start = settled(scene, scene.y0, tolerance).y
        for n, i in enumerate(scene.wrt):
            step = share * max(abs(scene.x[i]), floor)
            up, down = (settled(scene.moved(i, way * step), start, tolerance) for way in (1.0, -1.0))
            slopes[n] = (up.amplitude - down.amplitude) / (2.0 * step)
    except Overturned:
        pass
    return slopes
