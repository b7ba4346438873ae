"""Solutions (t, gamma) of the two conditions of a symmetric orbit, without start values, in compiled scalar
code.

Turning, phi'(0) = 0, leaves two values of gamma, the branches. On each of them phi(t-) is a function of t,
which is sampled over half a period. Every change of sign is followed up. Two roots within one interval leave
none, but the product of both branches dips there. Where the branches meet, and beyond, this product is
analytic and takes their place.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from tpd.exact.half_period_kernel import Flow, conditions, conditions_at, flow, solution_at
from tpd.exact.plant import compiled, places

NODES = np.int64(64)
"""Intervals of the crossing time over half a period, in which roots are looked for."""
BRACKETS = np.int64(12)
"""Most intervals with a root that are followed up."""
BRACKET = np.dtype([(name, np.float64) for name in ("low", "high", "branch", "at_low", "at_high")])
"""An interval of t with one root: its ends, the branch (+1, -1, or 0 for the product of both) and the
branch's values at the ends."""
_E1, _E2, _U, _V, _UPPER, _LOWER, _INSIDE, _PRODUCT = places(8)
"""Rows of a table of samples: a flow, both branches, whether they are there, and their product."""
TABLE = (8, int(NODES) + 1)
_TURNED = np.pi * np.arange(NODES + 1) / NODES
_SINES, _COSINES = np.sin(_TURNED), np.cos(_TURNED)
_CLOSE, _REACHED, _SHARP = 1e-9, 1e-7, 1e-13
"""Share of a bracket by which rounding may lead a root out of it; the last step of Newton's method, in shares
of h and rad, with which a root counts as reached; and after which there is no use in another."""
_GOLDEN = 0.5 * (3.0 - math.sqrt(5.0))
Branches = namedtuple("Branches", "middle apart inside size")
"""|turning|^2 phi(t-) = middle +- apart sqrt(inside) on the two branches of gamma; none where inside < 0."""


@compiled
def branches(x):
    """Both branches for a crossing time with the conditions `x`."""
    # Turning fixes how far (sin gamma, cos gamma) reaches along one direction, c + |(s, u)| cos(gamma -
    # direction) = 0. A unit vector has two values across it, and none if that share exceeds one. The factor
    # |(s, u)|^2 saves divisions, and no root is lost or gained by it.
    a, b = x.turning, x.crossing
    size = a.s * a.s + a.u * a.u
    middle = b.c * size - a.c * (b.s * a.s + b.u * a.u)
    return Branches(middle, b.u * a.s - b.s * a.u, size - a.c * a.c, size)


@compiled
def _value(q, m, t, branch):
    """Value on branch +1 or -1 at a crossing time; at 0 the product of both, also where neither exists."""
    b = branches(conditions_at(q, m, t))
    if branch == 0.0:
        return b.middle * b.middle - b.apart * b.apart * b.inside
    return b.middle + branch * b.apart * math.sqrt(max(b.inside, 0.0))


@compiled
def _phase(q, m, t, branch):
    """gamma on a branch; at 0 on that which is nearer to a root."""
    x = conditions_at(q, m, t)
    if branch == 0.0:
        b = branches(x)
        branch = -1.0 if b.middle * b.apart > 0.0 else 1.0
    a = x.turning
    across = branch * math.sqrt(max(a.s * a.s + a.u * a.u - a.c * a.c, 0.0))
    return math.atan2(-a.c * a.s - across * a.u, -a.c * a.u + across * a.s)


@compiled
def _sample(q, m, table):
    """Put the samples of both branches into a table."""
    onward = flow(q, m.span / NODES)
    e1, e2, u, v = 1.0, 1.0, 1.0, 0.0
    for i in range(NODES + 1):
        table[_E1, i], table[_E2, i], table[_U, i], table[_V, i] = e1, e2, u, v
        e1, e2, before = e1 * onward.e1, e2 * onward.e2, u
        u = u * onward.u - q.q * v * onward.v
        v = before * onward.v + v * (onward.u - q.p * onward.v)
    for i in range(NODES + 1):
        j = NODES - i
        f = Flow(table[_E1, i], table[_E2, i], table[_U, i], table[_V, i])
        g = Flow(table[_E1, j], table[_E2, j], table[_U, j], table[_V, j])
        b = branches(conditions(m, f, g, _SINES[i], _COSINES[i]))
        root = b.apart * math.sqrt(max(b.inside, 0.0))
        table[_UPPER, i], table[_LOWER, i], table[_INSIDE, i] = b.middle + root, b.middle - root, b.inside
        # Free of the factor that changes from sample to sample.
        table[_PRODUCT, i] = (b.middle * b.middle - b.apart * b.apart * b.inside) / (b.size * b.size)


@compiled
def _add_bracket(brackets, count, low, high, branch, at_low, at_high):
    """Write a bracket down where there is room for it, and return how many there are."""
    if count < BRACKETS:
        x = brackets[count]
        x.low, x.high, x.branch, x.at_low, x.at_high = low, high, branch, at_low, at_high
    return count + 1


@compiled
def store_brackets(q, m, table, brackets):
    """Put all intervals in which a root was seen into `brackets`; return their number, which may exceed the
    room."""
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
            # Both branches end in between, where they meet: one of them has a root if they differ in sign.
            at = i - 1 if here else i
            if table[_UPPER, at] * table[_LOWER, at] <= 0.0:
                quiet = False
                count = _add_bracket(brackets, count, low, high, 0.0, 0.0, 0.0)
        if i > 1 and quiet and quiet_before:
            # Two roots within an interval, as just before a fold: the parabola through three samples of the
            # product dips below zero.
            a, b, c = table[_PRODUCT, i - 2], table[_PRODUCT, i - 1], table[_PRODUCT, i]
            if 0.0 < b < a and b <= c:
                depth = 1.0 - (c - a) ** 2 / (8.0 * b * (c - 2.0 * b + a))
                if depth < deepest:
                    deepest, dip = depth, i - 1
        quiet_before = quiet
    if deepest < 1.0:
        lowest = _lowest(q, m, spacing * (dip - 1), spacing * (dip + 1))
        if _value(q, m, lowest, 0.0) < 0.0:
            count = _add_bracket(brackets, count, spacing * (dip - 1), lowest, 0.0, 0.0, 0.0)
            count = _add_bracket(brackets, count, lowest, spacing * (dip + 1), 0.0, 0.0, 0.0)
    return count


@compiled
def _lowest(q, m, low, high):
    """Crossing time between two at which the product of both branches is least, or below zero."""
    # By golden section, in which each step costs one value. A value below zero ends it, because it already
    # shows that there are two roots.
    a, b = low + _GOLDEN * (high - low), high - _GOLDEN * (high - low)
    at_a, at_b = _value(q, m, a, 0.0), _value(q, m, b, 0.0)
    for _ in range(34):
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
def _newton(q, m, t, gamma, most):
    """Newton's method on both conditions: (t, gamma), and the last step."""
    # The two conditions stay regular in (t, gamma) where branches meet and phi(t-) has a square root. Steps
    # go on to rounding: near the fold of two orbits each only halves the error, and derivatives lose digits.
    step = math.inf
    for _ in range(most):
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
    """Whether a solution is the root that a bracket is of."""
    beyond = _CLOSE * (x.high - x.low)
    if not x.low - beyond < t < x.high + beyond:
        return False
    a = conditions_at(q, m, t).turning
    across = math.cos(gamma) * a.s - math.sin(gamma) * a.u
    # Where the branches meet, rounding decides on which of them it is.
    return x.branch == 0.0 or across * x.branch >= 0.0 or a.s * a.s + a.u * a.u - a.c * a.c < 1e-9


@compiled
def root_in(q, m, x):
    """The solution (t, gamma) in a bracket, and whether it was reached."""
    share = x.at_low / (x.at_low - x.at_high) if x.branch != 0.0 and x.at_low != x.at_high else 0.5
    t = x.low + share * (x.high - x.low)
    t, gamma, step = _newton(q, m, t, _phase(q, m, t, x.branch), 12)
    if step < _CLOSE and _is_root_of(q, m, x, t, gamma):
        return t, gamma, True
    # From afar it may lead anywhere: first by Illinois' method, in which an end that stays twice counts for
    # half.
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
