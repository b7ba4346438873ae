"""Solutions (t, gamma) of the two conditions of a symmetric orbit, without initial guesses.

The first condition, phi'(0) = 0, leaves two values of gamma, called branches. On each branch phi(t-) is a
function of t, which is sampled over half a period. Each change of sign gives an interval with a root. If an
interval has two roots, there is no change of sign, but the product of both branches has a minimum there.
Where the branches meet and end, this product is analytic and replaces them.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.compiled.half_period_kernel import Flow, conditions, conditions_at, flow, solution_at
from tpd.compiled.plant import compiled, places

NODES = np.int64(64)
"""Number of intervals of the crossing time over half a period that are checked for roots."""
BRACKETS = np.int64(12)
"""Largest number of intervals with a root that are stored."""
BRACKET = np.dtype([(name, np.float64) for name in ("low", "high", "branch", "at_low", "at_high")])
"""An interval of t with one root: its ends `low` and `high`, the branch (+1, -1, or 0 for the product of
both) and the values of the branch at both ends."""
_E1, _E2, _U, _V, _UPPER, _LOWER, _INSIDE, _PRODUCT = places(8)
"""Rows of the table of samples: a flow, the values of both branches, the number whose sign says whether they
exist, and their product."""
TABLE = (8, int(NODES) + 1)
"""Shape of the table of samples."""
_TURNED = np.pi * np.arange(NODES + 1) / NODES
"""Phase of the forcing at the samples (rad)."""
_SINES, _COSINES = np.sin(_TURNED), np.cos(_TURNED)
_CLOSE, _REACHED, _SHARP = 1e-9, 1e-7, 1e-13
"""Share of a bracket by which rounding may move a root out of it; the last Newton step of a converged root,
in shares of h and in rad; and the step after which another one is useless."""
_GOLDEN = 0.5 * (3.0 - math.sqrt(5.0))
"""Ratio of the golden section."""
Branches = namedtuple("Branches", "middle apart inside size")
"""The branches in the form size phi(t-) = middle +- apart sqrt(inside). They exist if inside >= 0."""


@compiled
def branches(x):
    """Return both branches for a crossing time with the conditions `x`."""
    # The condition phi'(0) = 0 fixes the component of the unit vector (sin gamma, cos gamma) along one
    # direction, c + |(s, u)| cos(gamma - direction) = 0. There are two such vectors, or none if that
    # component exceeds one. The factor |(s, u)|^2 saves divisions, and changes no root.
    a, b = x.turning, x.crossing
    size = a.s * a.s + a.u * a.u
    middle = b.c * size - a.c * (b.s * a.s + b.u * a.u)
    return Branches(middle, b.u * a.s - b.s * a.u, size - a.c * a.c, size)


@compiled
def _value(q, m, t, branch):
    """Return the value of a branch (+1 or -1) at a crossing time.

    For 0, return the product of both branches, which also exists where the branches do not.
    """
    b = branches(conditions_at(q, m, t))
    if branch == 0.0:
        return b.middle * b.middle - b.apart * b.apart * b.inside
    return b.middle + branch * b.apart * math.sqrt(max(b.inside, 0.0))


@compiled
def _phase(q, m, t, branch):
    """Return gamma on a branch, or for 0 on the branch that is closer to a root."""
    x = conditions_at(q, m, t)
    if branch == 0.0:
        b = branches(x)
        branch = -1.0 if b.middle * b.apart > 0.0 else 1.0
    a = x.turning
    across = branch * math.sqrt(max(a.s * a.s + a.u * a.u - a.c * a.c, 0.0))
    return math.atan2(-a.c * a.s - across * a.u, -a.c * a.u + across * a.s)


@compiled
def _sample(q, m, table):
    """Fill the table with samples of both branches."""
    onward = flow(q, m.span / NODES)
    # The flow over n intervals is the product of n flows over one, which saves exponentials.
    e1, e2, u, v = 1.0, 1.0, 1.0, 0.0
    for i in range(NODES + 1):
        table[_E1, i], table[_E2, i], table[_U, i], table[_V, i] = e1, e2, u, v
        e1, e2, before = e1 * onward.e1, e2 * onward.e2, u
        u = u * onward.u - q.q * v * onward.v
        v = before * onward.v + v * (onward.u - q.p * onward.v)
    for i in range(NODES + 1):
        # The second flow of a sample belongs to the time h - t.
        j = NODES - i
        f = Flow(table[_E1, i], table[_E2, i], table[_U, i], table[_V, i])
        g = Flow(table[_E1, j], table[_E2, j], table[_U, j], table[_V, j])
        b = branches(conditions(m, f, g, _SINES[i], _COSINES[i]))
        root = b.apart * math.sqrt(max(b.inside, 0.0))
        table[_UPPER, i], table[_LOWER, i], table[_INSIDE, i] = b.middle + root, b.middle - root, b.inside
        # The division removes a factor that changes from sample to sample.
        table[_PRODUCT, i] = (b.middle * b.middle - b.apart * b.apart * b.inside) / (b.size * b.size)


@compiled
def _add_bracket(brackets, count, low, high, branch, at_low, at_high):
    """Store a bracket if there is memory for it. Return the number of brackets."""
    if count < BRACKETS:
        x = brackets[count]
        x.low, x.high, x.branch, x.at_low, x.at_high = low, high, branch, at_low, at_high
    return count + 1


@compiled
def store_brackets(q, m, table, brackets):
    """Store all intervals in which a root was detected. Return their number, which may exceed the memory."""
    _sample(q, m, table)
    spacing, count, quiet_before, deepest, dip = m.span / NODES, 0, False, 1.0, 0
    for i in range(1, NODES + 1):
        low, high, quiet = spacing * (i - 1), spacing * i, True
        here, there = table[_INSIDE, i - 1] >= 0.0, table[_INSIDE, i] >= 0.0
        if here and there:
            for branch in (1.0, -1.0):
                row = _UPPER if branch > 0.0 else _LOWER
                if table[row, i - 1] * table[row, i] <= 0.0:
                    quiet = False
                    count = _add_bracket(brackets, count, low, high, branch, table[row, i - 1], table[row, i])
        elif here or there:
            # Both branches end between these samples, where they meet. One of them has a root if their values
            # differ in sign.
            at = i - 1 if here else i
            if table[_UPPER, at] * table[_LOWER, at] <= 0.0:
                quiet = False
                count = _add_bracket(brackets, count, low, high, 0.0, 0.0, 0.0)
        if i > 1 and quiet and quiet_before:
            # Two roots in one interval, as just before a fold: the parabola through three samples of the
            # product becomes negative.
            a, b, c = table[_PRODUCT, i - 2], table[_PRODUCT, i - 1], table[_PRODUCT, i]
            if 0.0 < b < a and b <= c:
                depth = 1.0 - (c - a) ** 2 / (8.0 * b * (c - 2.0 * b + a))
                if depth < deepest:
                    deepest, dip = depth, i - 1
        quiet_before = quiet
    if deepest < 1.0:
        lowest = _lowest(q, m, spacing * (dip - 1), spacing * (dip + 1))
        # The minimum is negative: there is a root on either side of it.
        if _value(q, m, lowest, 0.0) < 0.0:
            count = _add_bracket(brackets, count, spacing * (dip - 1), lowest, 0.0, 0.0, 0.0)
            count = _add_bracket(brackets, count, lowest, spacing * (dip + 1), 0.0, 0.0, 0.0)
    return count


@compiled
def _lowest(q, m, low, high):
    """Return the crossing time at which the product of both branches is smallest, or negative.

    The time lies between `low` and `high`.
    """
    # Golden section search needs one value per step. It ends at a negative value, which already shows that
    # there are two roots.
    a, b = low + _GOLDEN * (high - low), high - _GOLDEN * (high - low)
    at_a, at_b = _value(q, m, a, 0.0), _value(q, m, b, 0.0)
    for _ in range(34):
        # The caller needs only the sign.
        if min(at_a, at_b) < 0.0:
            break
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = low + _GOLDEN * (high - low)
            at_a = _value(q, m, a, 0.0)
        else:
            low, a, at_a = a, b, at_b
            b = high - _GOLDEN * (high - low)
            at_b = _value(q, m, b, 0.0)
    return a if at_a < at_b else b


@compiled
def _newton(q, m, t, gamma, max_steps):
    """Solve both conditions by Newton's method. Return (t, gamma) and the size of the last step."""
    # The two conditions stay regular in (t, gamma) where the branches meet and phi(t-) has a square root. The
    # iteration continues to rounding: near a fold each step only halves the error, and derivatives would lose
    # digits.
    step = math.inf
    for _ in range(max_steps):
        x, before = solution_at(q, m, t, gamma), step
        determinant = x.turning_t * x.crossing_g - x.turning_g * x.crossing_t
        dt = (x.crossing_g * x.turning - x.turning_g * x.crossing) / determinant
        dg = (x.turning_t * x.crossing - x.crossing_t * x.turning) / determinant
        t, gamma, step = t - dt, gamma - dg, abs(dt) / m.span + abs(dg)
        if step <= _SHARP or (before < _CLOSE and step >= before):
            break
        if not -m.span < t < 2.0 * m.span or math.isnan(step):
            return t, gamma, math.inf
    return t, gamma, step


@compiled
def _is_root_of(q, m, x, t, gamma):
    """Whether a solution is the root of a bracket."""
    beyond = _CLOSE * (x.high - x.low)
    if not x.low - beyond < t < x.high + beyond:
        return False
    a = conditions_at(q, m, t).turning
    across = math.cos(gamma) * a.s - math.sin(gamma) * a.u
    # Where the branches meet, rounding decides to which of them the solution belongs.
    return x.branch == 0.0 or across * x.branch >= 0.0 or a.s * a.s + a.u * a.u - a.c * a.c < 1e-9


@compiled
def root_in(q, m, x):
    """Return the solution (t, gamma) in a bracket, and whether the iteration has converged."""
    # Initial guess by linear interpolation.
    share = x.at_low / (x.at_low - x.at_high) if x.branch != 0.0 and x.at_low != x.at_high else 0.5
    t = x.low + share * (x.high - x.low)
    t, gamma, step = _newton(q, m, t, _phase(q, m, t, x.branch), 12)
    if step < _CLOSE and _is_root_of(q, m, x, t, gamma):
        return t, gamma, True
    # Newton's method may have left the bracket. Shrink the bracket first by the Illinois method, in which the
    # value at an end that is kept twice is halved.
    low, high, side = x.low, x.high, 0
    at_low, at_high = _value(q, m, low, x.branch), _value(q, m, high, x.branch)
    for _ in range(60):
        t = low - at_low * (high - low) / (at_high - at_low) if at_high != at_low else 0.5 * (low + high)
        t = t if low < t < high else 0.5 * (low + high)
        value = _value(q, m, t, x.branch)
        if value * at_high > 0.0:
            at_low = 0.5 * at_low if side == 1 else at_low
            high, at_high, side = t, value, 1
        else:
            at_high = 0.5 * at_high if side == -1 else at_high
            low, at_low, side = t, value, -1
        if value == 0.0 or high - low < _CLOSE * (x.high - x.low):
            break
    t, gamma, step = _newton(q, m, t, _phase(q, m, t, x.branch), 40)
    return t, gamma, step < _REACHED and _is_root_of(q, m, x, t, gamma)
