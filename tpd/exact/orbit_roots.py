"""Where the scalar equation of `tpd.exact.orbit_equation` has its roots: brackets, and Newton's method.

Both branches of gamma are sampled over half a period, and every change of sign is followed up. Two
roots within one interval leave none, but the product of the branches dips there.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Int, UInt

from tpd.core.parameters import Number
from tpd.exact.batch_branches import where_needed
from tpd.exact.orbit_equation import Crossing, Half, branches, conditions, crossing, per_time
from tpd.exact.propagator import exponential
from tpd.exact.trigonometry import Turn, kept, turn

NODES = 64
"""Samples of the crossing time over half a period, between which roots are looked for."""
ROOTS = 4
"""Most roots followed up per design, of those that begin above the base."""
DIPS = 1
"""Most pairs of roots within one interval of the sampling."""


class Bracket(NamedTuple):
    """An interval of t with one root; the branch is 0 for the product of both."""

    low: Number
    high: Number
    branch: Number
    start: Number
    """Where to begin in it."""

    @staticmethod
    def of(low: Number, high: Number, branch: Number) -> Bracket:
        """One to begin in the middle of."""
        return Bracket(low, high, branch, 0.5 * (low + high))


class Found(NamedTuple):
    """The brackets of one design; those beyond `number` are empty, and `number` may exceed the places."""

    brackets: tuple[Bracket, ...]
    number: Int[Array, ""]

    def note(self, hit: Bool[Array, ""], bracket: Bracket) -> Found:
        """One more, if `hit`."""
        slots = []
        for i, slot in enumerate(self.brackets):
            here = hit & (self.number == i)
            slots.append(Bracket(*(jnp.where(here, a, b) for a, b in zip(bracket, slot, strict=True))))
        return Found(tuple(slots), self.number + hit)


class _Sample(NamedTuple):
    """Both branches at one crossing time."""

    upper: Number
    lower: Number
    product: Number
    inside: Number
    tall: Number
    """phi(0) on the upper branch."""
    low: Number
    """phi(0) on the lower branch."""


@jax.jit
def _sample(half: Half, at: Crossing) -> _Sample:
    c = conditions(half, at)
    b = branches(c)
    root = b.apart * jnp.sqrt(jnp.maximum(b.inside, 0.0))
    heights = (c.height.at(b.phase(branch)) for branch in (1.0, -1.0))
    return _Sample(b.middle + root, b.middle - root, b.on(jnp.zeros_like(root)), b.inside, *heights)


class _Seen(NamedTuple):
    """The intervals in which a root was seen, a bit for each: three numbers to carry along."""

    upper: UInt[Array, ""]
    ends: UInt[Array, ""]
    """Where the branches end."""
    lower: UInt[Array, ""]

    @staticmethod
    def nothing() -> _Seen:
        """No root so far."""
        return _Seen(*(jnp.zeros((), jnp.uint64) for _ in range(3)))

    def note(self, i: Int[Array, ""], *hits: Bool[Array, ""]) -> _Seen:
        """With those in interval i."""
        bit = jnp.left_shift(jnp.ones((), jnp.uint64), i.astype(jnp.uint64))
        none = jnp.zeros((), jnp.uint64)
        return _Seen(*(old | jnp.where(hit, bit, none) for old, hit in zip(self, hits, strict=True)))

    def listed(self, spacing: Number) -> Found:
        """The first of them as brackets, in order."""
        upper, lower = self.upper | self.ends, self.lower
        number = (jax.lax.population_count(upper) + jax.lax.population_count(lower)).astype(int)
        slots = []
        for _ in range(ROOTS):
            first, second = _lowest(upper), _lowest(lower)
            i, on_upper = jnp.minimum(first, second), first <= second
            at_end = (jnp.right_shift(self.ends, i.astype(jnp.uint64)) & 1) == 1
            branch = jnp.where(on_upper, jnp.where(at_end, 0.0, 1.0), -1.0)
            slots.append(Bracket.of(spacing * i, spacing * (i + 1.0), branch))
            upper = jnp.where(on_upper, upper & (upper - 1), upper)
            lower = jnp.where(on_upper, lower, lower & (lower - 1))
        return Found(tuple(slots), number)


def _lowest(bits: UInt[Array, ""]) -> Int[Array, ""]:
    """Place of the lowest bit; 64 if there is none."""
    return jax.lax.population_count(~bits & (bits - 1)).astype(int)


class _Dip(NamedTuple):
    """Where the product of both branches seems to dip below zero between samples of one sign: two
    roots that lie within one interval, as near a fold."""

    at: Number
    depth: Number
    """Depth of the parabola through three samples, over the middle one; 2 for none."""


def brackets(half: Half) -> Found:
    """Sample both branches over (0, h), and note every change of sign, and every pair of them."""
    # A root within an interval changes the sign of a branch there. Three things can hide one: a branch may
    # begin or end between two samples (`leaving`, `entering`: both meet there, so that one of them has a root
    # if they differ in sign); two roots may lie in one interval, as just before a fold (`_Dip`); or the root
    # may belong to an orbit that turns below the base (`tall`, `low`: such a root is dropped at once, which
    # saves places for others). exp(A t) of each sample is that of the last times one fixed factor.
    spacing, rates = half.span / NODES, half.plant.slip
    onward, backward = exponential(rates, spacing), exponential(rates, -spacing)
    turning = turn(half.plant.linear.xi * spacing)

    def step(i: Int[Array, ""], carry: tuple) -> tuple:
        seen, dips, at, old, earlier, quiet0 = carry
        rest = at.rest.times(backward, rates)
        # exp(s2 (h - t)) starts from a number that may underflow, and products would never leave zero.
        rest = rest._replace(at_s2=jnp.exp(rates.s2 * (half.span - spacing * (i + 1.0))))
        at = Crossing(at.flow.times(onward, rates), rest, at.forcing.then(turning))
        now = _sample(half, at)
        both = (now.inside >= 0) & (old.inside >= 0)
        # Where the branches end between two samples one of them has a root if they differ in sign.
        leaving = (old.inside >= 0) & (now.inside < 0) & (old.upper * old.lower <= 0)
        entering = (old.inside < 0) & (now.inside >= 0) & (now.upper * now.lower <= 0)
        tall, low = (now.tall > 0) | (old.tall > 0), (now.low > 0) | (old.low > 0)
        up, down = both & (now.upper * old.upper <= 0), both & (now.lower * old.lower <= 0)
        seen = seen.note(i, up & tall, (leaving | entering) & (tall | low), down & low)
        quiet = ~(up | down | leaving | entering)
        a, b, c = earlier, old.product, now.product
        depth = 1.0 - (c - a) ** 2 / (8.0 * b * (c - 2.0 * b + a))
        lowest = quiet & quiet0 & (b > 0) & (b < a) & (b <= c)
        depth = jnp.where(lowest, depth, 2.0)
        dips = _deepest(dips, _Dip(spacing * i, depth))
        return seen, dips, at, now, b, quiet

    none = jnp.zeros_like(spacing)
    start = crossing(half, none)
    dips = (_Dip(none, none + 2.0),) * DIPS
    sample = _sample(half, start)
    first = (_Seen.nothing(), dips, start, sample, sample.product, jnp.zeros((), bool))
    seen, dips = jax.lax.fori_loop(0, NODES, step, first)[:2]
    found = seen.listed(spacing)
    for dip in dips:
        before, after, hit = where_needed(dip.depth < 1.0, _split, half, dip)
        found = found.note(hit, before).note(hit, after)
    return found


def _deepest(dips: tuple[_Dip, ...], new: _Dip) -> tuple[_Dip, ...]:
    """The deepest of them, deepest first."""
    out = []
    for old in dips:
        deeper = new.depth < old.depth
        out.append(jax.tree.map(lambda a, b, d=deeper: jnp.where(d, a, b), new, old))
        new = jax.tree.map(lambda a, b, d=deeper: jnp.where(d, b, a), new, old)
    return tuple(out)


def _split(half: Half, dip: _Dip) -> tuple[Bracket, Bracket, Bool[Array, ""]]:
    """Brackets of both roots of a dip, and whether its lowest point is below zero."""
    spacing = half.span / NODES
    low, high = dip.at - spacing, dip.at + spacing

    def product(at: Crossing) -> Number:
        return branches(conditions(half, at)).on(jnp.zeros_like(spacing))

    def slope(t: Number) -> Number:
        at = crossing(half, t)
        return jax.jvp(product, (at,), (per_time(half, at),))[1]

    def step(i: Array, carry: tuple) -> tuple:
        # Illinois' method: an end that stays twice counts for half. Two steps before give the slopes at both
        # ends, so that these are compiled with the others.
        (left, g_left), (right, g_right), side, t = carry
        t = left - g_left * (right - left) / (g_right - g_left)
        t = jnp.where((t > left) & (t < right), t, 0.5 * (left + right))
        t = jnp.where(i < 2, jnp.where(i == 0, low, high), t)
        g = slope(t)
        beyond = (g > 0) & (i > 1) | (i == 1)
        g_left = jnp.where(beyond, g_left * jnp.where(side > 0, 0.5, 1.0), g)
        g_right = jnp.where(beyond, g, g_right * jnp.where(side < 0, 0.5, 1.0))
        left, right = jnp.where(beyond, left, t), jnp.where(beyond, t, right)
        side = jnp.where(i < 2, 0.0, jnp.where(beyond, 1.0, -1.0))
        return (left, g_left), (right, g_right), side, t

    # The slope of the product changes its sign between the outer samples.
    zero = jnp.zeros_like(spacing)
    first = ((low, zero), (high, zero), zero, zero)
    left, right, _, t = jax.lax.fori_loop(0, 10, step, first)
    lowest = kept(t)
    s = _sample(half, crossing(half, lowest))
    hit = jnp.asarray((dip.depth < 1.0) & (s.product < 0) & ((s.tall > 0) | (s.low > 0)))
    # Far from a pair Newton's method would only halve the distance in each step.
    reach = jnp.sqrt(jnp.maximum(-2.0 * s.product * (right[0] - left[0]) / (right[1] - left[1]), 0.0))
    before = Bracket(low, lowest, zero, jnp.maximum(lowest - reach, low))
    after = Bracket(lowest, high, zero, jnp.minimum(lowest + reach, high))
    return before, after, hit


class Root(NamedTuple):
    """A solution of both conditions, or nearly."""

    t: Number
    """Time from the turn to the crossing."""
    gamma: Number
    """Phase of the forcing at the turn, rad."""


@jax.jit
def refine(half: Half, bracket: Bracket) -> Root:
    """The root in one bracket: Newton's method, kept inside by bisection."""
    branch = bracket.branch

    def value(at: Crossing) -> Number:
        return branches(conditions(half, at)).on(branch)

    low, high = bracket.low, bracket.high
    rising = jnp.sign(value(crossing(half, high)) - value(crossing(half, low)))

    def step(_: Array, carry: tuple) -> tuple:
        low, high, t = carry
        at = crossing(half, t)
        g, slope = jax.jvp(value, (at,), (per_time(half, at),))
        right = g * rising > 0
        low, high = jnp.where(right, low, t), jnp.where(right, t, high)
        onward = t - g / jnp.where(slope == 0.0, 1.0, slope)
        # A converged iterate may step over itself by rounding.
        good = (onward >= low - 1e-9 * half.span) & (onward <= high + 1e-9 * half.span)
        return low, high, jnp.where(good, onward, 0.5 * (low + high))

    t = jax.lax.fori_loop(0, 5, step, (low, high, bracket.start))[2]
    b = branches(conditions(half, crossing(half, t)))
    branch = jnp.where(branch == 0.0, -jnp.sign(b.middle * b.apart), branch)
    phase = b.phase(branch)
    return Root(t, jnp.arctan2(phase.sine, phase.cosine))


def converge(half: Half, root: Root, there: Bool[Array, ""]) -> tuple[Root, Bool[Array, ""]]:
    """Newton's method on both conditions, for a root that is `there`: the root, and whether it was
    reached. Few steps do, except close to a fold, where each only halves the error."""

    def going(carry: tuple) -> Bool[Array, ""]:
        _, moved, count = carry
        return there & (moved > 1e-9) & (count < 30)

    def step(carry: tuple) -> tuple:
        root, _, count = carry
        root, moved, _ = _newton_step(half, half, root)
        return root, moved, count + 1

    first = (root, jnp.full_like(root.t, jnp.inf), jnp.zeros((), int))
    root, moved, _ = jax.lax.while_loop(going, step, first)
    return root, moved < 1e-7


def differentiable(half: Half, root: Root) -> tuple[Root, Number]:
    """One more step, which carries the derivatives of the root with respect to the parameters; and
    the height of the orbit, with its own."""
    fixed = jax.tree.map(stop_gradient, half)
    step = _newton_step(half, fixed, Root(*(stop_gradient(x) for x in root)))
    return step.root, step.height


class _Step(NamedTuple):
    root: Root
    moved: Number
    """Its length, in shares of h and rad."""
    height: Number
    """phi(0) after it."""


@jax.jit
def _newton_step(half: Half, fixed: Half, root: Root) -> _Step:
    """One step, with the Jacobian of `fixed` and the residual of `half`."""
    # Where `half` carries derivatives and `fixed` does not, the step's derivative is that of the implicit
    # function theorem. The two conditions stay regular in (t, gamma) at a fold of the branches, where the
    # scalar equation in t alone has a square root: hence Newton's method on both in the end.
    t, gamma = root
    at, phase = crossing(fixed, t), turn(gamma)

    def values(at: Crossing, phase: Turn, half: Half) -> tuple[Number, Number, Number]:
        c = conditions(half, at)
        return c.turning.at(phase), c.crossing.at(phase), c.height.at(phase)

    still = jax.tree.map(jnp.zeros_like, (at, phase))
    quarter = Turn(-phase.sine, phase.cosine)
    a, c, by_t = jax.jvp(lambda a, p: values(a, p, fixed), (at, phase), (per_time(fixed, at), still[1]))[1]
    b, d, by_gamma = jax.jvp(lambda a, p: values(a, p, fixed), (at, phase), (still[0], quarter))[1]
    r1, r2, height = values(crossing(half, t), phase, half)
    determinant = a * d - b * c
    dt, dgamma = (d * r1 - b * r2) / determinant, (a * r2 - c * r1) / determinant
    moved = jnp.abs(dt) / fixed.span + jnp.abs(dgamma)
    return _Step(Root(t - dt, gamma - dgamma), moved, height - by_t * dt - by_gamma * dgamma)
