"""All symmetric period-one orbits of a design with their derivatives, in compiled scalar code.

The orbits are the solutions (t, gamma) of two conditions in closed form (`tpd.exact.half_period_kernel`)
whose paths keep to their signs. Their derivatives follow from the implicit function theorem: with x the
parameters and r the conditions, d(t, gamma)/dx = -(dr/d(t, gamma))^-1 dr/dx, where parameters with imaginary
parts give dr/dx and, with those of t and gamma, the derivatives of everything else. Two orbits merge where
the determinant of dr/d(t, gamma) vanishes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tpd.core.orbit_terms import CONSERVED, GRAZING, NEAR_FOLD, SIZES, STATUSES, UNDECIDED
from tpd.exact.arcs import instant, state_at, value_of
from tpd.exact.half_map_kernel import characteristic, determinants, put_half_map, put_roots
from tpd.exact.half_period_kernel import COMPLEX_HALF, HALF, motion, put_half, solution_at
from tpd.exact.motion import ROOM
from tpd.exact.orbit_path_kernel import PATH, UNPROVED, WHOLE, put_path
from tpd.exact.orbit_roots_kernel import BRACKET, BRACKETS, TABLE, put_brackets, root_in
from tpd.exact.plant import COMPLEX_PLANT, PLANT, STEP, compiled, places, plant

ORBITS: Any = np.int64(3)
"""Most orbits of a design."""
_ROCKING, _UNSTABLE, _NEUTRAL, _NEAR_FOLD, _GRAZES, _NO_ORBIT = range(len(STATUSES))
_AMPLITUDE, _PHASE, _CROSSING, _STROKE, _FOLD, _SYMMETRY, _TORUS, _STATE = places(8)
NUMBERS: Any = np.int64(len(SIZES) + 4)
"""Numbers with derivatives: the sizes and the state."""
VANISHING = np.int64(7)
"""Numbers of `vanishing`."""
MOVED = np.int64(12)
"""Numbers that these depend on: t, gamma, s and the parameters."""
SAMPLES = np.int64(199)
"""Times between the turns at which `survey` looks."""
ORBIT = np.dtype(
    [
        ("sizes", np.float64, (int(NUMBERS),)),
        ("real", np.float64, (4,)),
        ("imag", np.float64, (4,)),
        *(
            (name, np.float64)
            for name in [
                "status",
                "sticking",
                "grazing",
                "bob",
                "bob_rate",
                "late",
                "corner",
                "time",
                "overflow",
            ]
        ),
    ]
)
"""An orbit: its sizes, the multipliers over half a period, its status, the margins without derivatives, psi
and psi' at the upper turn, where |psi| is largest (see `PATH`), and whether the design may have more
orbits."""
_PLACES = ORBITS + 1
WORK = np.dtype(
    [
        ("plant", PLANT),
        ("half", HALF),
        ("complex_plant", COMPLEX_PLANT),
        ("complex_half", COMPLEX_HALF),
        ("table", np.float64, TABLE),
        ("brackets", BRACKET, (int(BRACKETS),)),
        ("paths", PATH, (int(_PLACES),)),
        ("room", ROOM),
        ("matrices", np.float64, (3, 4, 4)),
        ("complex_matrices", np.complex128, (3, 4, 4)),
        ("sizes", np.complex128, (int(NUMBERS),)),
        ("vanishing", np.complex128, (int(VANISHING),)),
        ("x", np.complex128, (9,)),
    ]
)
"""Working memory."""


@compiled
def _put_stroke(t, way, orbit, sizes):
    """Put the largest |psi| of an orbit whose path is known into the sizes."""
    # Where the bob turns, psi does not change with the time of the turn: only the crossing's moves |psi|.
    if orbit.corner != 0.0:
        swing = state_at(way.first, way.before, t)[1]
    else:
        arc, time = (way.second if orbit.late != 0.0 else way.first), orbit.time + 0.0 * t
        swing = value_of(arc.bob, instant(arc, time), time)
    sizes[_STROKE] = swing if swing.real >= 0.0 else -swing


@compiled
def _put_state(q, m, t, gamma, way, sizes):
    """Put the state at tau = 0 into the sizes."""
    since, sign = (2.0 * math.pi * math.ceil(gamma.real / (2.0 * math.pi)) - gamma) / q.xi, 1.0
    if since.real >= m.span.real:
        since, sign = since - m.span, -1.0
    arc, since = (way.second, since - t) if since.real >= t.real else (way.first, since)
    now = state_at(arc, instant(arc, since), since)
    for i in range(4):
        sizes[_STATE + i] = sign * now[i]


@compiled
def _put_margins(q, m, t, way, matrices, sizes):
    """Put what vanishes at a fold, a loss of symmetry, and a torus into the sizes; return the coefficients of
    the characteristic polynomial of the half map."""
    put_half_map(q, m, t, way, matrices)
    c = characteristic(matrices[2])
    sizes[_FOLD], sizes[_SYMMETRY], sizes[_TORUS] = determinants(c[0], c[1], c[2], c[3])
    return c


@compiled
def _status(q, largest, nearest, grazing):
    """Status of an orbit by its largest multiplier, the distance of the nearest from 1, and the grazing
    margin."""
    if nearest < NEAR_FOLD:
        return _NEAR_FOLD
    if grazing < GRAZING:
        return _GRAZES
    # Nothing takes energy from the block: no friction, no impact loss, no hinge damping that it can feel.
    conserves = q.k == 0.0 and q.e == 1.0 and (q.mu == 0.0 or q.zeta == 0.0)
    if (conserves and largest < 1.0 + CONSERVED) or abs(largest - 1.0) < UNDECIDED:
        return _NEUTRAL
    return _ROCKING if largest < 1.0 else _UNSTABLE


@compiled
def _describe(q, m, path, matrices, orbit):
    """Put all about an orbit into `orbit`."""
    t, gamma = path.t, path.gamma - 2.0 * math.pi * math.ceil((path.gamma - math.pi) / (2.0 * math.pi))
    way, sizes = motion(q, m, t, gamma), orbit.sizes
    orbit.late, orbit.corner, orbit.time = path.late, path.corner, path.time
    sizes[_AMPLITUDE], sizes[_PHASE], sizes[_CROSSING] = path.height, gamma, t
    _put_stroke(t, way, orbit, sizes)
    _put_state(q, m, t, gamma, way, sizes)
    c = _put_margins(q, m, t, way, matrices, sizes)
    put_roots(c, orbit.real, orbit.imag)
    largest, nearest = 0.0, math.inf
    for i in range(4):
        largest = max(largest, math.hypot(orbit.real[i], orbit.imag[i]))
        nearest = min(nearest, math.hypot(1.0 - orbit.real[i], orbit.imag[i]))
    # Friction's share of phi'' while the tilt falls: it points the other way just before the turn.
    pull = q.k * q.m22 / (q.m11 * q.m22 - q.m12 * q.m21)
    orbit.sticking = path.leaving / (path.leaving - 2.0 * pull)
    orbit.grazing = path.least_fall / (q.xi * path.height)
    orbit.status = _status(q, largest, nearest, orbit.grazing)
    start = state_at(way.first, way.start, 0.0)
    orbit.bob, orbit.bob_rate = start[1], start[3]


@compiled
def _nothing(orbit):
    """Put what is said where there is no orbit."""
    for i in range(NUMBERS):
        orbit.sizes[i] = math.nan
    for i in range(4):
        orbit.real[i], orbit.imag[i] = math.nan, math.nan
    orbit.sticking, orbit.grazing, orbit.bob, orbit.bob_rate = math.nan, math.nan, math.nan, math.nan
    orbit.status = _NO_ORBIT


@compiled
def _found(q, m, work):
    """Put the orbits of a design into the working memory, the largest first; return their number, and whether
    there may be more."""
    paths, count = work.paths, 0
    found = put_brackets(q, m, work.table, work.brackets)
    overflow = found > BRACKETS
    for i in range(min(found, BRACKETS)):
        t, gamma, reached = root_in(q, m, work.brackets[i])
        if not reached:
            continue
        # The last place is for the one that is being looked at.
        path = paths[ORBITS]
        outcome = put_path(q, m, t, gamma, work.room, path)
        overflow = overflow or outcome == UNPROVED
        if outcome != WHOLE:
            continue
        rank, again = 0, False
        for j in range(count):
            rank += 1 if paths[j].height >= path.height else 0
            # A root on the border of two intervals is in both.
            again = again or abs(paths[j].t - t) + abs(paths[j].height - path.height) < 1e-13 * m.span
        if again:
            continue
        overflow = overflow or count == ORBITS
        if rank < ORBITS:
            count = min(count + 1, ORBITS)
            for j in range(count - 1, rank, -1):
                paths[j] = paths[j - 1]
            paths[rank] = path
    return count, overflow


@compiled
def solve(x, work, orbits):
    """Put the orbits of a design into `orbits`, the largest first."""
    q, m = work.plant, work.half
    plant(x, q)
    put_half(q, m)
    count, overflow = _found(q, m, work)
    for i in range(ORBITS):
        if i < count:
            _describe(q, m, work.paths[i], work.matrices, orbits[i])
        else:
            _nothing(orbits[i])
        orbits[i].overflow = 1.0 if overflow else 0.0


@compiled
def differentiate(x, orbits, directions, asked, work, slopes):
    """Put the derivatives of the sizes of a design's orbits in each of the `directions` (d, 9) of the
    parameters into `slopes` (orbits, d, sizes); those of stroke, margins and state only if `asked`, in this
    order. There is none of an orbit near a fold, one that grazes, or of what is not asked for: NaN."""
    z, n, sizes = work.complex_plant, work.complex_half, work.sizes
    for j in range(len(directions)):
        filled = False
        for i in range(ORBITS):
            orbit = orbits[i]
            for k in range(NUMBERS):
                sizes[k] = complex(0.0, math.nan)
            if orbit.status == _ROCKING or orbit.status == _UNSTABLE or orbit.status == _NEUTRAL:
                if not filled:
                    for k in range(9):
                        work.x[k] = complex(x[k], STEP * directions[j, k])
                    plant(work.x, z)
                    put_half(z, n)
                    filled = True
                _put_moved(z, n, orbit, asked, work.complex_matrices, sizes)
            for k in range(NUMBERS):
                slopes[i, j, k] = sizes[k].imag / STEP


@compiled
def _put_moved(z, n, orbit, asked, matrices, sizes):
    """Put the sizes of an orbit with the derivatives of `differentiate` as imaginary parts into `sizes`."""
    t, gamma = orbit.sizes[_CROSSING], orbit.sizes[_PHASE]
    r = solution_at(z, n, complex(t, 0.0), complex(gamma, 0.0))
    a, b, c, d = r.turning_t.real, r.turning_g.real, r.crossing_t.real, r.crossing_g.real
    by, turning, crossing = 1.0 / (a * d - b * c), r.turning.imag, r.crossing.imag
    dt, dg = by * (b * crossing - d * turning), by * (c * turning - a * crossing)
    sizes[_AMPLITUDE] = r.height + complex(0.0, r.height_t.real * dt + r.height_g.real * dg)
    sizes[_PHASE], sizes[_CROSSING] = complex(gamma, dg), complex(t, dt)
    if asked[0] == 0.0 and asked[1] == 0.0 and asked[2] == 0.0:
        return
    way = motion(z, n, sizes[_CROSSING], sizes[_PHASE])
    if asked[0] != 0.0:
        _put_stroke(sizes[_CROSSING], way, orbit, sizes)
    if asked[1] != 0.0:
        _put_margins(z, n, sizes[_CROSSING], way, matrices, sizes)
    if asked[2] != 0.0:
        _put_state(z, n, sizes[_CROSSING], sizes[_PHASE], way, sizes)


@compiled
def _put_vanishing(q, m, t, gamma, s, matrices, out):
    """Put the numbers of `vanishing` into `out`."""
    x, way = solution_at(q, m, t, gamma), motion(q, m, t, gamma)
    put_half_map(q, m, t, way, matrices)
    c = characteristic(matrices[2])
    arc, time = (way.second, s - t) if s.real > t.real else (way.first, s)
    fall = state_at(arc, instant(arc, time), time)
    out[0], out[1] = x.turning, x.crossing
    out[2] = x.turning_t * x.crossing_g - x.turning_g * x.crossing_t
    out[3] = determinants(c[0], c[1], c[2], c[3])[1]
    out[4] = state_at(way.first, way.start, 0.0 * t)[4]
    out[5], out[6] = fall[2], fall[4]


@compiled
def vanishing(x, u, work, out, by):
    """Put functions of u = (t, gamma, s) and the parameters into `out` that vanish where orbits are lost, and
    their derivatives into `by` (7, 12): phi'(0), phi(t), the determinant of the derivatives of both in (t,
    gamma) (two orbits merge), det(I + G) (symmetry is lost), phi''(0+) (sticking), phi'(s) and phi''(s)
    (grazing)."""
    z, n = work.complex_plant, work.complex_half
    for j in range(MOVED):
        for i in range(9):
            work.x[i] = complex(x[i], STEP if j == i + 3 else 0.0)
        plant(work.x, z)
        put_half(z, n)
        t, gamma = complex(u[0], STEP if j == 0 else 0.0), complex(u[1], STEP if j == 1 else 0.0)
        s = complex(u[2], STEP if j == 2 else 0.0)
        _put_vanishing(z, n, t, gamma, s, work.complex_matrices, work.vanishing)
        for i in range(VANISHING):
            out[i], by[i, j] = work.vanishing[i].real, work.vanishing[i].imag / STEP


@compiled
def survey(x, u, work, out):
    """Put phi at the turn, phi'' just after it, -phi'' just before the next turn, and phi' at `SAMPLES` equal
    steps between them into `out`, for a solution u = (t, gamma). It is an orbit if the first is > 0 and all
    the others are < 0."""
    q, m = work.plant, work.half
    plant(x, q)
    put_half(q, m)
    t, way = u[0], motion(q, m, u[0], u[1])
    start, end = state_at(way.first, way.start, 0.0), state_at(way.second, way.end, m.span - t)
    out[0], out[1], out[2] = start[0], start[4], -end[4]
    for i in range(SAMPLES):
        s = m.span * (i + 1.0) / (SAMPLES + 1.0)
        arc, time = (way.second, s - t) if s > t else (way.first, s)
        out[3 + i] = state_at(arc, instant(arc, time), time)[2]
