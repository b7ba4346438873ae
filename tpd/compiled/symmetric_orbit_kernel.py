"""The symmetric period-one orbits of a design and their derivatives.

The orbits are the solutions (t, gamma) of two conditions in closed form (`tpd.compiled.half_period_kernel`),
if the tilt decreases all the way from one turning point to the next. Without friction (k = 0) a turning point
changes nothing in the equations, so that the tilt may turn any number of times between two impacts. With
friction each such turning point is one more unknown, and these orbits are not computed.

The derivatives follow from the implicit function theorem. With the parameters x and the conditions r, d(t,
gamma)/dx = -(dr/d(t, gamma))^-1 dr/dx. Parameters with imaginary parts give dr/dx. Together with the
imaginary parts of t and gamma they give the derivatives of all other numbers. Two orbits merge where the
determinant of dr/d(t, gamma) vanishes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tpd.compiled import series
from tpd.compiled.columns import (
    BROKEN,
    CROSSED,
    FLAT,
    GRAZING,
    GRAZING_STATUS,
    MERGED,
    NEAR_FOLD,
    NEAR_FOLD_STATUS,
    NEUTRAL,
    NO_ORBIT,
    ROCKING,
    SIZES,
    SLIP,
    STUCK,
    SWING,
    SWING_RATE,
    TILT,
    TILT_PULL,
    TILT_RATE,
    TOUCHED,
    TURNING,
    UNSTABLE,
    WIDTH,
)
from tpd.compiled.follow import first_event
from tpd.compiled.forcing import Load
from tpd.compiled.half_map_kernel import (
    characteristic,
    determinants,
    is_neutral,
    remaining,
    store_half_map,
    store_roots,
)
from tpd.compiled.half_period_kernel import (
    half,
    instant,
    path_of,
    solution_at,
    state_after,
    state_at,
    value_of,
)
from tpd.compiled.motion import CONTINUES, LANDING, MOTION, TURN
from tpd.compiled.orbit_roots_kernel import BRACKET, BRACKETS, TABLE, root_in, store_brackets
from tpd.compiled.plant import COMPLEX_PLANT, NONE, ONLY, PLANT, STEP, compiled, places, plant

ORBITS: Any = np.int64(3)
"""Largest number of orbits of a design."""
_AMPLITUDE, _PHASE, _CROSSING, _STROKE, _FOLD, _SYMMETRY, _TORUS, _REMAINING, _STATE = places(9)
NUMBERS: Any = np.int64(SIZES["state"].stop)
"""Number of sizes with derivatives."""
VANISHING = np.int64(FLAT + 1)
"""Number of functions in `vanishing`."""
_T, _GAMMA, _S, _PARAMETERS = places(4)
"""Indices of the variables of these functions: t, gamma, s, and from the fourth on the parameters."""
MOVED = _PARAMETERS + WIDTH
"""Number of these variables."""
SAMPLES = np.int64(199)
"""Number of times between the turning points in `sample_path`."""
_PATH_FIELDS = tuple((name, np.float64) for name in ("height", "leaving", "arriving"))
PATH_SAMPLES = np.dtype([*_PATH_FIELDS, ("rates", np.float64, (int(SAMPLES),))])
"""Samples of a path: phi at the turning point (`height`), phi'' just after it (`leaving`), -phi'' just before
the next turning point (`arriving`), and the `rates` between both, see `sample_path`."""
_MORE = "status", "sticking", "grazing", "bob", "bob_rate", "peak", "overflow"
ORBIT = np.dtype(
    [
        ("sizes", np.float64, (int(NUMBERS),)),
        ("multipliers", np.complex128, (4,)),
        *((name, np.float64) for name in _MORE),
    ]
)
"""An orbit: its `sizes`; the multipliers over a forcing period; its status; the margins `sticking` and
`grazing`, which have no derivatives; psi and psi' at the upper turning point (`bob`, `bob_rate`); the time
after it at which |psi| is largest (`peak`); and whether the design may have more orbits (`overflow`)."""
_NONE = np.full(1, np.nan, "f8").repeat(ORBIT.itemsize // 8).view(ORBIT)
_NONE["status"] = NO_ORBIT
WORK = np.dtype(
    [
        ("plant", PLANT),
        ("complex_plant", COMPLEX_PLANT),
        ("table", np.float64, TABLE),
        ("brackets", BRACKET, (int(BRACKETS),)),
        ("orbit", ORBIT),
        ("motion", MOTION),
        ("workspace", series.WORK),
        ("map", np.float64, (4, 4)),
        ("complex_map", np.complex128, (4, 4)),
        ("power", np.float64, (2, 4, 4)),
        ("complex_power", np.complex128, (2, 4, 4)),
        ("sizes", np.complex128, (int(NUMBERS),)),
        ("vanishing", np.complex128, (int(VANISHING),)),
        ("x", np.complex128, (WIDTH,)),
    ]
)
"""Workspace of all functions in this module."""
_BROKEN, _COMPLETE, _UNPROVED = range(3)
"""Outcomes of a path: it is no orbit; it is an orbit; or it has more than `_STEPS` series."""
_STEPS, _RTOL = 4096, 1e-13
"""Largest number of series of an arc, and their relative tolerance."""
_EQUAL = 1e-11
"""Relative difference below which two turning points of an orbit have the same tilt."""
_ON_TIME = 1e-6
"""Share of h by which an event may differ from the time that the conditions give."""


@compiled
def _status(q, largest, nearest, grazing):
    """Return the status of an orbit.

    Args:
        largest: modulus of its largest multiplier.
        nearest: distance of the nearest multiplier from 1.
        grazing: grazing margin.
    """
    if nearest < NEAR_FOLD:
        return NEAR_FOLD_STATUS
    if grazing < GRAZING:
        return GRAZING_STATUS
    if is_neutral(q.k, q.e, q.mu, q.zeta, largest):
        return NEUTRAL
    return ROCKING if largest < 1.0 else UNSTABLE


@compiled
def _smallest_dent(w, order, h, slows):
    """Return the smallest |phi'| where a falling block moves slowest within the time h.

    The second result is the sign of phi'' at the end. `slows` is that sign at the start.
    """
    smallest, t, c = math.inf, 0.0, w.series
    for n in range(order):
        c[series.ACCELERATION, n] = (n + 1.0) * c[series.V, n + 1]
    for _ in range(2 * order):
        # phi' has an extreme value where phi'' vanishes. Where phi'' turns positive, the block moves fastest.
        # Where it turns negative, the block moves slowest and may stop: this is a dent in the rate.
        t, turns = series.first_zero(w, series.ACCELERATION, slows, order - 1, NONE, t, h)
        if t >= h:
            break
        if turns:
            if slows > 0.0:
                smallest = min(smallest, -series.value_at(w, series.V, order, t))
            slows = -slows
    return smallest, slows


@compiled
def _follow_path(q, m, t, gamma, path, motion, w, orbit):
    """Follow a solution from turning point to turning point, and return whether it is an orbit.

    The sizes of the orbit are stored in `orbit`.

    The path passes all turning points of the bob, all extreme values of phi', and without friction turning
    points of the block.
    """
    sizes, swing, smallest_rate, y = orbit.sizes, -1.0, math.inf, motion.y
    sizes[_PHASE], sizes[_CROSSING], late = gamma, t, _ON_TIME * m.span
    series.set_accuracy(q, _RTOL, w)
    w.rate, w.swing, w.relative = q.nu * max(q.xi, 1.0), (q.nu + q.f) * max(q.xi, 1.0), False
    for after_impact in range(2):
        # First the arc before the impact, then the one after it.
        arc, arc_start, duration = (path.second, t, m.span - t) if after_impact else (path.first, 0.0, t)
        now, time = state_at(arc, instant(arc, 0.0)), 0.0
        if not after_impact:
            # The path must start at an upper turning point.
            if not (now[TILT] > 0.0 and now[TILT_PULL] < 0.0):
                return _BROKEN
            sizes[_AMPLITUDE], orbit.bob, orbit.bob_rate = now[TILT], now[SWING], now[SWING_RATE]
            # The share of friction in phi'' while the tilt decreases. It had the opposite sign just before
            # the turning point.
            pull = q.k * q.m22 / (q.m11 * q.m22 - q.m12 * q.m21)
            orbit.sticking = now[TILT_PULL] / (now[TILT_PULL] - 2.0 * pull)
        # The impact may reverse the bob, so that |psi| may be largest at the start of an arc.
        if abs(now[SWING]) > swing:
            swing, orbit.peak = abs(now[SWING]), arc_start
        y[TILT], y[SWING] = (0.0 if after_impact else now[TILT]), now[SWING]
        y[TILT_RATE], y[SWING_RATE] = (now[TILT_RATE] if after_impact else 0.0), now[SWING_RATE]
        motion.kind, motion.tilt, motion.direction = SLIP, (-1.0 if after_impact else 1.0), -1.0
        slows, horizon, event = (1.0 if now[TILT_PULL] > 0.0 else -1.0), duration + 2.0 * late, CONTINUES
        for _ in range(_STEPS):
            e = Load(q.xi, gamma + q.xi * (arc_start + time), 1.0, 0.0, 0.0, 0.0)
            # Call the series of (25) alone: Numba would also compile those of (4) for `series.expand`.
            series.set_errors(q, y, w)
            order = series.expand_linear(q, motion, e, horizon - time, w.order, w)
            order, h = series.step_of(order, horizon - time, w)
            if not h > 0.0:
                return _BROKEN
            event, h = first_event(q, motion, order, h, w)
            if q.k > 0.0:
                dent, slows = _smallest_dent(w, order, h, slows)
                smallest_rate = min(smallest_rate, dent)
            angle, turn = series.largest_turn(w, series.PSI, order, h, swing)
            if abs(angle) > swing:
                swing, orbit.peak = abs(angle), arc_start + time + turn
            series.store_state(w, order, h, y)
            time += h
            if event == TURN and q.k == 0.0 and time < duration - late:
                # An orbit with several turning points is counted once, from the largest of them. Without any
                # loss two of them may be equal, and rounding must not decide. Then the orbit is counted from
                # the one before the impact.
                if abs(y[TILT]) > sizes[_AMPLITUDE] * (1.0 - _EQUAL if after_impact else 1.0 + _EQUAL):
                    return _BROKEN
                smallest_rate = min(smallest_rate, q.xi * abs(y[TILT]))
                motion.direction, y[TILT_RATE] = -motion.direction, 0.0
            elif event != CONTINUES or time >= horizon:
                break
        else:
            return _UNPROVED
        # The events must come in the right order, and at the times that the conditions give.
        if event != (TURN if after_impact else LANDING) or not abs(time - duration) < late:
            return _BROKEN
    sizes[_STROKE], orbit.grazing = swing, smallest_rate / (q.xi * sizes[_AMPLITUDE])
    return _COMPLETE


@compiled
def _store_state(q, m, t, gamma, path, sizes):
    """Write the state at tau = 0 into the sizes."""
    since, sign = (2.0 * math.pi * math.ceil(gamma.real / (2.0 * math.pi)) - gamma) / q.xi, 1.0
    # In the second half of the period the state is the mirror image of that half a period earlier.
    if since.real >= m.span.real:
        since, sign = since - m.span, -1.0
    now = state_after(path, t, since)
    for i in range(4):
        sizes[_STATE + i] = sign * now[i]


@compiled
def _store_margins(q, m, t, path, matrix, power, sizes):
    """Write the margins to a fold, to a loss of symmetry and to a torus bifurcation into the sizes, and what
    remains of a disturbance.

    The margins vanish at the bifurcations. `power` is a workspace for powers of the matrix.

    Returns the coefficients of the characteristic polynomial of the half map.
    """
    store_half_map(q, m, t, path, matrix)
    c = characteristic(matrix)
    sizes[_FOLD], sizes[_SYMMETRY], sizes[_TORUS] = determinants(c)
    sizes[_REMAINING] = remaining(matrix, q.xi, power)
    return c


@compiled
def solve(x, work, orbits):
    """Compute the orbits of a design, and write them into `orbits`, the largest amplitude first."""
    q, new = work.plant, work.orbit
    plant(x, q)
    m = half(q)
    bracket_count, count = store_brackets(q, m, work.table, work.brackets), 0
    overflow = bracket_count > BRACKETS
    for i in range(ORBITS):
        orbits[i] = _NONE[ONLY]
    for i in range(min(bracket_count, BRACKETS)):
        t, gamma, reached = root_in(q, m, work.brackets[i])
        if not reached:
            continue
        # The phase is unique between -pi and pi.
        gamma -= 2.0 * math.pi * math.ceil((gamma - math.pi) / (2.0 * math.pi))
        path = path_of(q, m, t, gamma)
        outcome = _follow_path(q, m, t, gamma, path, work.motion, work.workspace, new)
        overflow = overflow or outcome == _UNPROVED
        if outcome != _COMPLETE:
            continue
        rank, is_duplicate = 0, False
        for j in range(count):
            rank += 1 if orbits[j].sizes[_AMPLITUDE] >= new.sizes[_AMPLITUDE] else 0
            apart = abs(orbits[j].sizes[_AMPLITUDE] - new.sizes[_AMPLITUDE])
            # A root on the border of two intervals is a root of both.
            is_duplicate = is_duplicate or abs(orbits[j].sizes[_CROSSING] - t) + apart < 1e-13 * m.span
        overflow = overflow or (count == ORBITS and not is_duplicate)
        if is_duplicate or rank == ORBITS:
            continue
        # A new orbit: compute its state, margins and multipliers.
        _store_state(q, m, t, gamma, path, new.sizes)
        c = _store_margins(q, m, t, path, work.map, work.power, new.sizes)
        store_roots(c, new.multipliers)
        largest, nearest = 0.0, math.inf
        for j in range(4):
            z = new.multipliers[j]
            largest, nearest = max(largest, abs(z)), min(nearest, abs(1.0 - z))
            # The multipliers of a whole period are the squares of those of half a period.
            new.multipliers[j] = z * z
        new.status = _status(q, largest, nearest, new.grazing)
        count = min(count + 1, ORBITS)
        # Insert the orbit at its rank.
        for j in range(count - 1, rank, -1):
            orbits[j] = orbits[j - 1]
        orbits[rank] = new
    for i in range(ORBITS):
        orbits[i].overflow = 1.0 if overflow else 0.0


@compiled
def differentiate(x, orbits, directions, first, last, work, slopes):
    """Compute derivatives of the sizes of a design's orbits, and write them into `slopes` (orbits, d, sizes).

    The sizes are those from `first` to before `last`, and the `directions` (d, 10) are in the space of the
    parameters. Orbits near a fold and orbits that graze have no derivatives (NaN). Sizes outside of the range
    are NaN.
    """
    q, sizes, any_has = work.complex_plant, work.sizes, False
    slopes[:] = math.nan
    for i in range(ORBITS):
        any_has = any_has or orbits[i].status <= NEUTRAL
    for j in range(len(directions) if any_has else 0):
        for k in range(len(x)):
            work.x[k] = complex(x[k], STEP * directions[j, k])
        plant(work.x, q)
        m = half(q)
        for i in range(ORBITS):
            orbit = orbits[i]
            if orbit.status > NEUTRAL:
                continue
            t, gamma = complex(orbit.sizes[_CROSSING], 0.0), complex(orbit.sizes[_PHASE], 0.0)
            # Implicit function theorem: solve for the derivatives of t and gamma.
            r = solution_at(q, m, t, gamma)
            a, b, c, d = r.turning_t.real, r.turning_g.real, r.crossing_t.real, r.crossing_g.real
            by, turning, crossing = 1.0 / (a * d - b * c), r.turning.imag, r.crossing.imag
            dt, dg = by * (b * crossing - d * turning), by * (c * turning - a * crossing)
            t, gamma = complex(t.real, dt), complex(gamma.real, dg)
            sizes[_AMPLITUDE] = r.height + complex(0.0, r.height_t.real * dt + r.height_g.real * dg)
            sizes[_PHASE], sizes[_CROSSING] = gamma, t
            if last > _STROKE:
                path = path_of(q, m, t, gamma)
                if first <= _STROKE:
                    # Where the bob turns, psi does not change with the time of the turning point. Only the
                    # time of the crossing changes |psi|.
                    arc, time = path.second, (complex(orbit.peak, 0.0) if orbit.peak != t.real else t) - t
                    if orbit.peak < t.real:
                        arc, time = path.first, complex(orbit.peak, 0.0)
                    swing = value_of(arc.bob, instant(arc, time))
                    sizes[_STROKE] = swing if swing.real >= 0.0 else -swing
                if first <= _FOLD < last:
                    _store_margins(q, m, t, path, work.complex_map, work.complex_power, sizes)
                if last > _STATE:
                    _store_state(q, m, t, gamma, path, sizes)
            for k in range(first, last):
                slopes[i, j, k] = sizes[k].imag / STEP


@compiled
def vanishing(x, u, work, out, by):
    """Compute functions of u = (t, gamma, s) and of the parameters that vanish where orbits are lost.

    `out` gets the values and `by` (7, 13) the derivatives: phi'(0); phi(t); the determinant of their
    derivatives in (t, gamma) (two orbits merge); det(I + G) (the symmetry is lost); phi''(0+) (sticking);
    phi'(s) and phi''(s) (grazing), or without friction phi(s) and phi'(s).
    """
    q, numbers = work.complex_plant, work.vanishing
    for j in range(MOVED):
        # One complex evaluation for each variable gives the derivatives in that variable.
        for i in range(len(x)):
            work.x[i] = complex(x[i], STEP if j == i + _PARAMETERS else 0.0)
        plant(work.x, q)
        m = half(q)
        t, gamma = complex(u[_T], STEP if j == _T else 0.0), complex(u[_GAMMA], STEP if j == _GAMMA else 0.0)
        s = complex(u[_S], STEP if j == _S else 0.0)
        r, path = solution_at(q, m, t, gamma), path_of(q, m, t, gamma)
        store_half_map(q, m, t, path, work.complex_map)
        fall = state_after(path, t, s)
        numbers[TURNING], numbers[CROSSED] = r.turning, r.crossing
        numbers[MERGED] = r.turning_t * r.crossing_g - r.turning_g * r.crossing_t
        _, numbers[BROKEN], _ = determinants(characteristic(work.complex_map))
        numbers[STUCK] = state_after(path, t, 0.0 * t)[TILT_PULL]
        first = TILT if q.k.real == 0.0 else TILT_RATE
        numbers[TOUCHED], numbers[FLAT] = fall[first], fall[first + 2]
        for i in range(VANISHING):
            out[i], by[i, j] = numbers[i].real, numbers[i].imag / STEP


@compiled
def sample_path(x, u, work, out):
    """Sample the path of a solution u = (t, gamma) from one turning point to the next.

    The samples are written into `out`.

    These are phi at the turning point, phi'' just after it, -phi'' just before the next turning point, and
    phi' at `SAMPLES` equal steps between both. Without friction phi replaces phi', with the sign that is
    negative on the right side of the base. The solution is an orbit if the first number is positive and all
    others are negative.
    """
    q = work.plant
    plant(x, q)
    m = half(q)
    t, path = u[_T], path_of(q, m, u[_T], u[_GAMMA])
    start, end = state_after(path, t, 0.0), state_after(path, t, m.span)
    out.height, out.leaving, out.arriving = start[TILT], start[TILT_PULL], -end[TILT_PULL]
    for i in range(SAMPLES):
        s = m.span * (i + 1.0) / (SAMPLES + 1.0)
        now = state_after(path, t, s)
        out.rates[i] = now[TILT_RATE] if q.k > 0.0 else (now[TILT] if s > t else -now[TILT])
