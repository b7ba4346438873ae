"""The symmetric period-one orbits of a design with their derivatives, in compiled scalar code.

The orbits are the solutions (t, gamma) of two conditions in closed form (`tpd.exact.half_period_kernel`)
on whose paths the tilt falls all the way from turn to turn. Without friction (k = 0) a block that turns back
and goes on meets no event, so that there the path may turn as often as it likes between two impacts. With
friction each such turn is one more unknown, and these orbits are not solved for.

Derivatives follow from the implicit function theorem: with x the parameters and r the conditions,
d(t, gamma)/dx = -(dr/d(t, gamma))^-1 dr/dx, where parameters with imaginary parts give dr/dx and, with those
of t and gamma, the derivatives of everything else. Two orbits merge where the determinant of dr/d(t, gamma)
vanishes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tpd.exact.arcs import instant, rate_of, state_at, value_of
from tpd.exact.events import (
    BOB,
    FIRST,
    LONGEST,
    RELATIVE,
    SECOND,
    SMALL,
    next_event,
    turn_over,
    watch_block,
    watch_turns,
)
from tpd.exact.half_map_kernel import characteristic, determinants, is_neutral, store_half_map, store_roots
from tpd.exact.half_period_kernel import half, path_of, solution_at, state_after
from tpd.exact.motion import WORKSPACE
from tpd.exact.orbit_roots_kernel import BRACKET, BRACKETS, TABLE, root_in, store_brackets
from tpd.exact.plant import COMPLEX_PLANT, PLANT, STEP, compiled, places, plant
from tpd.exact.terms import (
    BROKEN,
    CROSSED,
    FLAT,
    GRAZING,
    MANY,
    MERGED,
    NEAR_FOLD,
    SIZES,
    SLIP,
    STATUSES,
    STUCK,
    SWING,
    SWING_PULL,
    SWING_RATE,
    TILT,
    TILT_PULL,
    TILT_RATE,
    TOUCHED,
    TURNING,
)

ORBITS: Any = np.int64(3)
"""Most orbits of a design."""
_ROCKING, _UNSTABLE, _NEUTRAL, _NEAR_FOLD, _GRAZING_STATUS, _NO_ORBIT = range(len(STATUSES))
_AMPLITUDE, _PHASE, _CROSSING, _STROKE, _FOLD, _SYMMETRY, _TORUS, _STATE = places(8)
NUMBERS: Any = np.int64(SIZES["state"].stop)
"""Numbers with derivatives."""
VANISHING = np.int64(FLAT + 1)
"""Numbers of `vanishing`."""
_T, _GAMMA, _S, _PARAMETERS = places(4)
"""Numbers that these depend on; parameters follow from the fourth on."""
MOVED = _PARAMETERS + MANY
"""How many."""
SAMPLES = np.int64(199)
"""Times between the turns at which `survey` looks."""
_PATH_FIELDS = tuple((name, np.float64) for name in ("height", "leaving", "arriving"))
PATH_SAMPLES = np.dtype([*_PATH_FIELDS, ("rates", np.float64, (int(SAMPLES),))])
"""Findings about a way, see `survey`."""
_MORE = "status", "sticking", "grazing", "bob", "bob_rate", "peak", "overflow"
ORBIT = np.dtype(
    [
        ("sizes", np.float64, (int(NUMBERS),)),
        ("multipliers", np.complex128, (4,)),
        *((name, np.float64) for name in _MORE),
    ]
)
"""An orbit: its sizes; the multipliers over a forcing period; its status; the margins without derivatives;
psi and psi' at the upper turn; when |psi| is largest, from that turn on; and whether the design may have more
orbits."""
_NONE = np.full(1, np.nan, "f8").repeat(ORBIT.itemsize // 8).view(ORBIT)
_NONE["status"] = _NO_ORBIT
WORK = np.dtype(
    [
        ("plant", PLANT),
        ("complex_plant", COMPLEX_PLANT),
        ("table", np.float64, TABLE),
        ("brackets", BRACKET, (int(BRACKETS),)),
        ("orbit", ORBIT),
        ("workspace", WORKSPACE),
        ("map", np.float64, (4, 4)),
        ("complex_map", np.complex128, (4, 4)),
        ("sizes", np.complex128, (int(NUMBERS),)),
        ("vanishing", np.complex128, (int(VANISHING),)),
        ("x", np.complex128, (MANY,)),
    ]
)
"""Working memory."""
_BROKEN, _COMPLETE, _UNPROVED = range(3)
"""Outcomes of a path: no orbit; an orbit; or more events than `_LOOKS` looks at the motion can prove."""
_WINDOWS = 8192
_EQUAL = 1e-11
"""Relative difference below which two turns of an orbit are equally large."""
_ON_TIME = 1e-6
"""Share of h by which an event may differ from that of the conditions."""
_DENTS = RELATIVE
"""Row of the signal phi'', whose changes of sign are extremes of the falling rate."""


@compiled
def _status(q, largest, nearest, grazing):
    """Status of an orbit by its largest multiplier, the distance of the nearest from 1, and the grazing
    margin."""
    if nearest < NEAR_FOLD:
        return _NEAR_FOLD
    if grazing < GRAZING:
        return _GRAZING_STATUS
    if is_neutral(q.k, q.e, q.mu, q.zeta, largest):
        return _NEUTRAL
    return _ROCKING if largest < 1.0 else _UNSTABLE


@compiled
def _follow_path(q, m, t, gamma, path, w, orbit):
    """Follow a solution from turn to turn, past all turns of the bob and of the falling rate, and without
    friction of the block, put what it meets into `orbit`, and return whether it is one."""
    sizes, mode, swing, smallest_rate = orbit.sizes, w.trial, -1.0, math.inf
    sizes[_PHASE], sizes[_CROSSING] = gamma, t
    for after_impact in range(2):
        arc, arc_start, duration = (path.second, t, m.span - t) if after_impact else (path.first, 0.0, t)
        time, here = 0.0, instant(arc, 0.0)
        now = state_at(arc, here, time)
        if not after_impact:
            if not (now[TILT] > 0.0 and now[TILT_PULL] < 0.0):
                return _BROKEN
            sizes[_AMPLITUDE], orbit.bob, orbit.bob_rate = now[TILT], now[SWING], now[SWING_RATE]
            # Friction's share of phi'' while the tilt falls: it points the other way just before the turn.
            pull = q.k * q.m22 / (q.m11 * q.m22 - q.m12 * q.m21)
            orbit.sticking = now[TILT_PULL] / (now[TILT_PULL] - 2.0 * pull)
        # The impact may turn the bob: |psi| may be largest where an arc begins.
        if abs(now[SWING]) > swing:
            swing, orbit.peak = abs(now[SWING]), arc_start
        mode.kind, mode.tilt, mode.direction = SLIP, (-1.0 if after_impact else 1.0), -1.0
        # The signals of a block that slips do not depend on the forcing: any does.
        w.has_second, w.count = watch_block(q, arc, mode, arc.tilt, w), _DENTS + 1
        # A bob that turns with the block has no rate but rounding there.
        bob_motion = now[SWING_RATE] if abs(now[SWING_RATE]) > 1e-12 else now[SWING_PULL]
        watch_turns(w, BOB, 1.0 if bob_motion > 0.0 else -1.0, arc.bob, arc)
        slows = 1.0 if now[TILT_PULL] > 0.0 else -1.0
        watch_turns(w, _DENTS, slows, rate_of(arc, arc.tilt), arc)
        w.longest = LONGEST / max(q.xi, max(q.s1, math.sqrt(q.q)))
        w.shortest, w.limit = SMALL * m.span, math.inf
        w.window, w.budget, horizon = w.longest, _WINDOWS, duration + 2.0 * _ON_TIME * m.span
        event, turns = BOB, False
        while event >= BOB or turns:
            event, time = next_event(arc, w, here, time, horizon)
            here = instant(arc, time)
            now = state_at(arc, here, time)
            turns = event == FIRST and q.k == 0.0 and time < duration - _ON_TIME * m.span
            if turns:
                # The orbit is counted once, from the largest of its turns. Without any loss it may have two
                # that are equal, and rounding must not decide: the first is the one before the impact.
                if abs(now[TILT]) > sizes[_AMPLITUDE] * (1.0 - _EQUAL if after_impact else 1.0 + _EQUAL):
                    return _BROKEN
                smallest_rate, mode.direction = min(smallest_rate, q.xi * abs(now[TILT])), -mode.direction
                w.has_second = watch_block(q, arc, mode, arc.tilt, w)
            if event == BOB and abs(now[SWING]) > swing:
                swing, orbit.peak = abs(now[SWING]), arc_start + time
            if event == _DENTS:
                # From less to more: where it fell faster before, this is its quickest moment and no dent.
                if slows > 0.0 and q.k > 0.0:
                    smallest_rate = min(smallest_rate, -now[TILT_RATE])
                slows = -slows
            if event >= BOB:
                turn_over(w, event)
        if w.budget <= 0:
            return _UNPROVED
        if event != (FIRST if after_impact else SECOND) or not abs(time - duration) < _ON_TIME * m.span:
            return _BROKEN
    sizes[_STROKE], orbit.grazing = swing, smallest_rate / (q.xi * sizes[_AMPLITUDE])
    return _COMPLETE


@compiled
def _store_state(q, m, t, gamma, path, sizes):
    """Put the state at tau = 0 into the sizes."""
    since, sign = (2.0 * math.pi * math.ceil(gamma.real / (2.0 * math.pi)) - gamma) / q.xi, 1.0
    if since.real >= m.span.real:
        since, sign = since - m.span, -1.0
    now = state_after(path, t, since)
    for i in range(4):
        sizes[_STATE + i] = sign * now[i]


@compiled
def _store_margins(q, m, t, path, matrix, sizes):
    """Put what vanishes at a fold, a loss of symmetry, and a torus into the sizes; return the coefficients of
    the characteristic polynomial of the half map."""
    store_half_map(q, m, t, path, matrix)
    c = characteristic(matrix)
    sizes[_FOLD], sizes[_SYMMETRY], sizes[_TORUS] = determinants(c)
    return c


@compiled
def solve(x, work, orbits):
    """Put the orbits of a design into `orbits`, the largest first."""
    q, new = work.plant, work.orbit
    plant(x, q)
    m = half(q)
    bracket_count, count = store_brackets(q, m, work.table, work.brackets), 0
    overflow = bracket_count > BRACKETS
    for i in range(ORBITS):
        orbits[i] = _NONE[FIRST]
    for i in range(min(bracket_count, BRACKETS)):
        t, gamma, reached = root_in(q, m, work.brackets[i])
        if not reached:
            continue
        gamma -= 2.0 * math.pi * math.ceil((gamma - math.pi) / (2.0 * math.pi))
        path = path_of(q, m, t, gamma)
        outcome = _follow_path(q, m, t, gamma, path, work.workspace, new)
        overflow = overflow or outcome == _UNPROVED
        if outcome != _COMPLETE:
            continue
        rank, is_duplicate = 0, False
        for j in range(count):
            rank += 1 if orbits[j].sizes[_AMPLITUDE] >= new.sizes[_AMPLITUDE] else 0
            apart = abs(orbits[j].sizes[_AMPLITUDE] - new.sizes[_AMPLITUDE])
            # A root on the border of two intervals is in both.
            is_duplicate = is_duplicate or abs(orbits[j].sizes[_CROSSING] - t) + apart < 1e-13 * m.span
        overflow = overflow or (count == ORBITS and not is_duplicate)
        if is_duplicate or rank == ORBITS:
            continue
        _store_state(q, m, t, gamma, path, new.sizes)
        store_roots(_store_margins(q, m, t, path, work.map, new.sizes), new.multipliers)
        largest, nearest = 0.0, math.inf
        for j in range(4):
            z = new.multipliers[j]
            largest, nearest = max(largest, abs(z)), min(nearest, abs(1.0 - z))
            new.multipliers[j] = z * z
        new.status = _status(q, largest, nearest, new.grazing)
        count = min(count + 1, ORBITS)
        for j in range(count - 1, rank, -1):
            orbits[j] = orbits[j - 1]
        orbits[rank] = new
    for i in range(ORBITS):
        orbits[i].overflow = 1.0 if overflow else 0.0


@compiled
def differentiate(x, orbits, directions, first, last, work, slopes):
    """Put the derivatives of the sizes from `first` to before `last` of a design's orbits in each of the
    `directions` (d, 9) of the parameters into `slopes` (orbits, d, sizes). There is none of an orbit near a
    fold, one that grazes, or of what is not asked for: NaN."""
    q, sizes, any_has = work.complex_plant, work.sizes, False
    slopes[:] = math.nan
    for i in range(ORBITS):
        any_has = any_has or orbits[i].status <= _NEUTRAL
    for j in range(len(directions) if any_has else 0):
        for k in range(len(x)):
            work.x[k] = complex(x[k], STEP * directions[j, k])
        plant(work.x, q)
        m = half(q)
        for i in range(ORBITS):
            orbit = orbits[i]
            if orbit.status > _NEUTRAL:
                continue
            t, gamma = complex(orbit.sizes[_CROSSING], 0.0), complex(orbit.sizes[_PHASE], 0.0)
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
                    # Where the bob turns, psi does not change with the time of the turn: only the crossing's
                    # moves |psi|.
                    arc, time = path.second, (complex(orbit.peak, 0.0) if orbit.peak != t.real else t) - t
                    if orbit.peak < t.real:
                        arc, time = path.first, complex(orbit.peak, 0.0)
                    swing = value_of(arc.bob, instant(arc, time), time)
                    sizes[_STROKE] = swing if swing.real >= 0.0 else -swing
                if first <= _FOLD < last:
                    _store_margins(q, m, t, path, work.complex_map, sizes)
                if last > _STATE:
                    _store_state(q, m, t, gamma, path, sizes)
            for k in range(first, last):
                slopes[i, j, k] = sizes[k].imag / STEP


@compiled
def vanishing(x, u, work, out, by):
    """Put functions of u = (t, gamma, s) and the parameters into `out` that vanish where orbits are lost, and
    their derivatives into `by` (7, 12): phi'(0), phi(t), the determinant of the derivatives of both in (t,
    gamma) (two orbits merge), det(I + G) (symmetry is lost), phi''(0+) (sticking), phi'(s) and phi''(s)
    (grazing), or without friction phi(s) and phi'(s)."""
    q, numbers = work.complex_plant, work.vanishing
    for j in range(MOVED):
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
    """Put phi at the turn, phi'' just after it, -phi'' just before the next turn, and phi' at `SAMPLES` equal
    steps between them into `out`, for a solution u = (t, gamma); without friction, in place of phi', phi with
    the sign that is negative on the right side of the base. It is an orbit if the first is > 0 and all the
    others are < 0."""
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
