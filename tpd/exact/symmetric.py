"""Symmetric period-one orbits, every one of them, as the roots of one scalar equation.

Such an orbit turns at phi > 0 (tau = 0 here, the forcing being sin(xi tau + gamma)), falls through
phi = 0 at tau = t, and half a forcing period h = pi/xi after the turn is its own mirror image,
y(h) = -y(0). Between its turns the system is linear with constant loads, so that for a given t

    y(0) = [1 + exp(A h)]^-1 {(2k/K) e1 - exp(A (h - t)) [(2 w/K) e1 + V d]} + (w - k)/K e1 + harmonic

with K = 1 + 2 mu, w = (1 + mu) nu, e1 the tilt, and V d the jump of the rates in the impact,
d = (0, 0, 1, 2/lam), V = (e - 1) phi'(t-). Turning, phi'(0) = 0, and crossing, phi(t) = 0, are linear in (sin gamma,
cos gamma). The first leaves two values of gamma; the second is then one equation in t for each.
Where the two values meet, and beyond, the product of both equations is analytic and is used instead.

What is left of a root is checked along its path: the tilt must fall from turn to turn.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.lax import stop_gradient
from jaxtyping import Array, Bool, Int

from tpd.exact.matrix import Factor, Functional, components, exponential, identity
from tpd.exact.multipliers import Matrix, product
from tpd.exact.spectrum import Plant
from tpd.exact.trigonometry import Turn, kept, turn
from tpd.parameters import Number, State

NODES = 64
"""Samples of the crossing time over half a period, between which roots are looked for."""
ROOTS = 4
"""Most roots followed up per design, of those that begin above the base."""
DIPS = 1
"""Most pairs of roots within one interval of the sampling."""
ORBITS = 3
"""Most orbits per design."""
PATH_NODES = 16
"""Samples of each of the two arcs of a half period, between which its extremes are looked for."""
_KINDS = (1.0, -1.0, 0.0)
"""The branches of gamma, and their product."""


class Half(eqx.Module):
    """What the equation needs that depends on the parameters alone.

    As [1 + exp(A h)]^-1 is part of everything, it is part of the functionals.
    """

    plant: Plant
    span: Number
    """h, half a forcing period."""
    whole: Factor
    """exp(A h)"""
    unit: tuple[Functional, ...]
    """The components of g(A) [1 + exp(A h)]^-1 e1, a unit of tilt."""
    kick: tuple[Functional, ...]
    """The same of d, a unit of impact."""

    def __init__(self, plant: Plant) -> None:
        rates = plant.slip
        self.plant = plant
        self.span = jnp.pi / plant.linear.xi
        self.whole = exponential(rates, self.span)
        closing = self.whole.plus(identity(self.span)).inverse(rates)
        zero, one = jnp.zeros_like(self.span), jnp.ones_like(self.span)
        unit = components(plant, jnp.stack([one, zero, zero, zero]))
        kick = components(plant, jnp.stack([zero, zero, one, 2.0 / plant.length_ratio]))
        self.unit = tuple(x.after(closing, rates) for x in unit)
        self.kick = tuple(x.after(closing, rates) for x in kick)

    @property
    def step(self) -> Number:
        """The jump of the balance tilt at the crossing, 2 w/K."""
        return 2.0 * self.plant.linear.weight / self.plant.linear.tilt

    @property
    def slack(self) -> Number:
        """That at a turn, 2 k/K."""
        return 2.0 * self.plant.linear.friction / self.plant.linear.tilt

    def harmonic(self, forcing: Turn, row: int) -> tuple[Number, Number]:
        """The harmonic response of phi or psi (row 0 or 1) once the forcing has turned by so much,
        as factors of sin gamma and cos gamma."""
        along, across = self.plant.response[row, 0], self.plant.response[row, 1]
        cosine, sine = forcing
        return along * cosine - across * sine, along * sine + across * cosine


class Crossing(NamedTuple):
    """A crossing time, by what has happened until then and what is left."""

    flow: Factor
    """exp(A t)"""
    rest: Factor
    """exp(A (h - t))"""
    forcing: Turn
    """By xi t."""


def crossing(half: Half, t: Number) -> Crossing:
    """The crossing at time `t`."""
    rates = half.plant.slip
    forcing = turn(half.plant.linear.xi * t)
    return Crossing(exponential(rates, t), exponential(rates, half.span - t), forcing)


def per_time(half: Half, at: Crossing) -> Crossing:
    """The derivative of a crossing with respect to its time."""
    rates, xi = half.plant.slip, half.plant.linear.xi
    forcing = Turn(-xi * at.forcing.sine, xi * at.forcing.cosine)
    return Crossing(at.flow.rate(rates), at.rest.rate(rates).scaled(-1.0), forcing)


class Phased(NamedTuple):
    """A quantity c + s sin gamma + u cos gamma."""

    c: Number
    s: Number
    u: Number

    def minus(self, x: Number, other: Phased) -> Phased:
        """self - x other."""
        return Phased(*(a - x * b for a, b in zip(self, other, strict=True)))

    def at(self, phase: Turn) -> Number:
        """Its value."""
        return self.c + self.s * phase.sine + self.u * phase.cosine


class Conditions(NamedTuple):
    """What must vanish, and the impact V, as functions of gamma."""

    turning: Phased
    """phi'(0)"""
    crossing: Phased
    """phi(t)"""
    impact: Phased
    height: Phased
    """phi(0)"""


def conditions(half: Half, at: Crossing) -> Conditions:
    """The two conditions for a crossing."""
    lost, xi = half.plant.restitution - 1.0, half.plant.linear.xi
    s0, u0 = half.harmonic(Turn(jnp.ones_like(xi), jnp.zeros_like(xi)), 0)
    s1, u1 = half.harmonic(at.forcing, 0)
    per_fall = lost / (1.0 + lost * half.kick[2].of(half.whole))
    falls = half.slack * half.unit[2].of(at.flow) - half.step * half.unit[2].of(half.whole)
    impact = Phased(per_fall * falls, -per_fall * xi * u1, per_fall * xi * s1)
    turns = half.slack * half.unit[2].of(identity(xi)) - half.step * half.unit[2].of(at.rest)
    tilt = half.slack * half.unit[0].of(at.flow) - half.step * half.unit[0].of(half.whole)
    top = half.slack * half.unit[0].of(identity(xi)) - half.step * half.unit[0].of(at.rest)
    balance = 0.5 * (half.step - half.slack)
    return Conditions(
        Phased(turns, -xi * u0, xi * s0).minus(half.kick[2].of(at.rest), impact),
        Phased(tilt + balance, s1, u1).minus(half.kick[0].of(half.whole), impact),
        impact,
        Phased(top + balance, s0, u0).minus(half.kick[0].of(at.rest), impact),
    )


class Branches(NamedTuple):
    """phi(t) = middle +- apart sqrt(inside) on the two branches of gamma; none where inside < 0."""

    middle: Number
    apart: Number
    inside: Number
    along: Number
    way_s: Number
    way_u: Number

    def phase(self, branch: Number) -> Turn:
        """gamma on branch +1 or -1."""
        across = branch * jnp.sqrt(jnp.maximum(self.inside, 0.0))
        cosine = self.along * self.way_u + across * self.way_s
        return Turn(cosine, self.along * self.way_s - across * self.way_u)

    def on(self, branch: Number) -> Number:
        """phi(t) on branch +1 or -1; at 0 the product of both, also where neither exists."""
        root = self.apart * jnp.sqrt(jnp.maximum(self.inside, 1e-300))
        product = self.middle**2 - self.apart**2 * self.inside
        return jnp.where(branch == 0.0, product, self.middle + branch * root)


def branches(c: Conditions) -> Branches:
    """The two branches: turning fixes how far (sin gamma, cos gamma) reaches along one direction."""
    size = jnp.sqrt(c.turning.s**2 + c.turning.u**2)
    along, way_s, way_u = -c.turning.c / size, c.turning.s / size, c.turning.u / size
    middle = c.crossing.c + along * (c.crossing.s * way_s + c.crossing.u * way_u)
    apart = c.crossing.u * way_s - c.crossing.s * way_u
    return Branches(middle, apart, 1.0 - along**2, along, way_s, way_u)


class _Bracket(NamedTuple):
    """An interval of t with one root; the branch is 0 for the product of both."""

    low: Number
    high: Number
    branch: Number


class _Found(NamedTuple):
    brackets: tuple[_Bracket, ...]
    count: Int[Array, ""]

    def note(self, hit: Bool[Array, ""], bracket: _Bracket) -> _Found:
        """One more, if `hit`."""
        slots = []
        for i, slot in enumerate(self.brackets):
            here = hit & (self.count == i)
            slots.append(_Bracket(*(jnp.where(here, a, b) for a, b in zip(bracket, slot, strict=True))))
        return _Found(tuple(slots), self.count + hit)


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


def _sample(half: Half, at: Crossing) -> _Sample:
    c = conditions(half, at)
    b = branches(c)
    root = b.apart * jnp.sqrt(jnp.maximum(b.inside, 0.0))
    heights = (c.height.at(b.phase(branch)) for branch in (1.0, -1.0))
    return _Sample(b.middle + root, b.middle - root, b.on(jnp.zeros_like(root)), b.inside, *heights)


class _Dip(NamedTuple):
    """Where the product of both branches seems to dip below zero between samples of one sign: two
    roots that lie within one interval, as near a fold."""

    at: Number
    depth: Number
    """Of the parabola through three samples, over the middle one; 2 for none."""


def _brackets(half: Half) -> _Found:
    """Sample both branches over (0, h), and note every change of sign, and every pair of them."""
    spacing, rates = half.span / NODES, half.plant.slip
    onward, backward = exponential(rates, spacing), exponential(rates, -spacing)
    turning = turn(half.plant.linear.xi * spacing)

    def step(i: Int[Array, ""], carry: tuple) -> tuple:
        found, dips, at, old, earlier, quiet0 = carry
        rest = at.rest.times(backward, rates)
        rest = rest._replace(at_s2=jnp.exp(rates.s2 * (half.span - spacing * (i + 1.0))))
        at = Crossing(at.flow.times(onward, rates), rest, at.forcing.then(turning))
        now = _sample(half, at)
        both = (now.inside >= 0) & (old.inside >= 0)
        # Where the branches end between two samples one of them has a root if they differ in sign.
        leaving = (old.inside >= 0) & (now.inside < 0) & (old.upper * old.lower <= 0)
        entering = (old.inside < 0) & (now.inside >= 0) & (now.upper * now.lower <= 0)
        tall, low = (now.tall > 0) | (old.tall > 0), (now.low > 0) | (old.low > 0)
        up, down = both & (now.upper * old.upper <= 0), both & (now.lower * old.lower <= 0)
        first = (up & tall) | ((leaving | entering) & (tall | low))
        begin, end = spacing * i, spacing * (i + 1.0)
        found = found.note(first, _Bracket(begin, end, jnp.where(both, 1.0, 0.0)))
        found = found.note(down & low, _Bracket(begin, end, -jnp.ones_like(spacing)))
        quiet = ~(up | down | leaving | entering)
        a, b, c = earlier, old.product, now.product
        depth = 1.0 - (c - a) ** 2 / (8.0 * b * (c - 2.0 * b + a))
        lowest = quiet & quiet0 & (b > 0) & (b < a) & (b <= c)
        depth = jnp.where(lowest, depth, 2.0)
        dips = _deepest(dips, _Dip(begin, depth))
        return found, dips, at, now, b, quiet

    none = jnp.zeros_like(spacing)
    start = crossing(half, none)
    found = _Found((_Bracket(none, none, none),) * ROOTS, jnp.zeros((), int))
    dips = (_Dip(none, none + 2.0),) * DIPS
    sample = _sample(half, start)
    first = (found, dips, start, sample, sample.product, jnp.zeros((), bool))
    found, dips = jax.lax.fori_loop(0, NODES, step, first)[:2]
    for dip in dips:
        found = _split(half, found, dip)
    return found


def _deepest(dips: tuple[_Dip, ...], new: _Dip) -> tuple[_Dip, ...]:
    """The deepest of them, deepest first."""
    out = []
    for old in dips:
        deeper = new.depth < old.depth
        out.append(jax.tree.map(lambda a, b, d=deeper: jnp.where(d, a, b), new, old))
        new = jax.tree.map(lambda a, b, d=deeper: jnp.where(d, b, a), new, old)
    return tuple(out)


def _split(half: Half, found: _Found, dip: _Dip) -> _Found:
    """Both roots of a dip, if its lowest point is below zero."""
    spacing = half.span / NODES
    low, high = dip.at - spacing, dip.at + spacing

    def product(at: Crossing) -> Number:
        return branches(conditions(half, at)).on(jnp.zeros_like(spacing))

    def slope(t: Number) -> Number:
        at = crossing(half, t)
        return jax.jvp(product, (at,), (per_time(half, at),))[1]

    def step(_: Array, carry: tuple) -> tuple:
        # Illinois' method: an end that stays twice counts for half.
        (left, g_left), (right, g_right), side, t = carry
        t = left - g_left * (right - left) / (g_right - g_left)
        t = jnp.where((t > left) & (t < right), t, 0.5 * (left + right))
        g = slope(t)
        beyond = g > 0
        g_left = jnp.where(beyond, g_left * jnp.where(side > 0, 0.5, 1.0), g)
        g_right = jnp.where(beyond, g, g_right * jnp.where(side < 0, 0.5, 1.0))
        left, right = jnp.where(beyond, left, t), jnp.where(beyond, t, right)
        return (left, g_left), (right, g_right), jnp.where(beyond, 1.0, -1.0), t

    # The slope of the product changes its sign between the outer samples.
    zero = jnp.zeros_like(spacing)
    first = ((low, slope(low)), (high, slope(high)), zero, zero)
    lowest = kept(jax.lax.fori_loop(0, 8, step, first)[3])
    s = _sample(half, crossing(half, lowest))
    hit = (dip.depth < 1.0) & (s.product < 0) & ((s.tall > 0) | (s.low > 0))
    return found.note(hit, _Bracket(low, lowest, zero)).note(hit, _Bracket(lowest, high, zero))


class Root(NamedTuple):
    """A solution of both conditions, or nearly."""

    t: Number
    """Time from the turn to the crossing."""
    gamma: Number
    """Phase of the forcing at the turn, rad."""


def refine(half: Half, bracket: _Bracket) -> Root:
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

    t = jax.lax.fori_loop(0, 5, step, (low, high, 0.5 * (low + high)))[2]
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
        return *_newton(half, half, root), count + 1

    first = (root, jnp.full_like(root.t, jnp.inf), jnp.zeros((), int))
    root, moved, _ = jax.lax.while_loop(going, step, first)
    return root, moved < 1e-7


def differentiable(half: Half, root: Root) -> Root:
    """One more step, which carries the derivative of the root with respect to the parameters."""
    fixed = jax.tree.map(stop_gradient, half)
    return _newton(half, fixed, Root(*(stop_gradient(x) for x in root)))[0]


def _newton(half: Half, fixed: Half, root: Root) -> tuple[Root, Number]:
    """One step, with the Jacobian of `fixed` and the residual of `half`."""
    t, gamma = root
    at, phase = crossing(fixed, t), turn(gamma)

    def values(at: Crossing, phase: Turn, half: Half) -> tuple[Number, Number]:
        c = conditions(half, at)
        return c.turning.at(phase), c.crossing.at(phase)

    still = jax.tree.map(jnp.zeros_like, (at, phase))
    quarter = Turn(-phase.sine, phase.cosine)
    _, (a, c) = jax.jvp(lambda a, p: values(a, p, fixed), (at, phase), (per_time(fixed, at), still[1]))
    _, (b, d) = jax.jvp(lambda a, p: values(a, p, fixed), (at, phase), (still[0], quarter))
    r1, r2 = values(crossing(half, t), phase, half)
    determinant = a * d - b * c
    dt, dgamma = (d * r1 - b * r2) / determinant, (a * r2 - c * r1) / determinant
    return Root(t - dt, gamma - dgamma), jnp.abs(dt) / fixed.span + jnp.abs(dgamma)


class Coordinate(NamedTuple):
    """phi or psi along one arc: constant + functional of exp(A s) + harmonic, s from the arc's start."""

    constant: Number
    free: Functional
    along: Number
    across: Number

    def at(self, flow: Factor, phase: Turn) -> Number:
        """The angle, after exp(A s) and with the forcing at `phase`."""
        return self.constant + self.free.of(flow) + self.along * phase.sine + self.across * phase.cosine


class Instant(NamedTuple):
    """A time on an arc: exp(A s) and the phase of the forcing there."""

    flow: Factor
    phase: Turn

    def rate(self, plant: Plant) -> Instant:
        """Its derivative in time: `Coordinate.at` less its constant is linear in it."""
        xi = plant.linear.xi
        return Instant(self.flow.rate(plant.slip), Turn(-xi * self.phase.sine, xi * self.phase.cosine))


class Orbit(NamedTuple):
    """The half period from the upper turn: two arcs of both coordinates."""

    root: Root
    first: tuple[Coordinate, Coordinate]
    second: tuple[Coordinate, Coordinate]
    impact: Number
    """V"""

    @property
    def height(self) -> Number:
        """phi at the turn."""
        return self.first[0].at(identity(self.root.t), turn(self.root.gamma))


def orbit_of(half: Half, root: Root) -> Orbit:
    """The orbit of a root."""
    rates, plant = half.plant.slip, half.plant
    at, phase = crossing(half, root.t), turn(root.gamma)
    c = conditions(half, at)
    impact = c.impact.at(phase)
    zero = jnp.zeros_like(root.t)
    one = identity(root.t)
    both = one.plus(half.whole)
    first, second = [], []
    for row, balance in ((0, 0.5 * (half.step - half.slack)), (1, zero)):
        unit, kick = half.unit[row], half.kick[row]
        free = unit.after(one.scaled(half.slack).plus(at.rest.scaled(-half.step)), rates)
        free = free.minus(impact, kick.after(at.rest, rates))
        later = free.after(at.flow, rates).minus(-half.step, unit.after(both, rates))
        later = later.minus(-impact, kick.after(both, rates))
        along, across = plant.response[row, 0], plant.response[row, 1]
        first.append(Coordinate(balance, free, along, across))
        step = half.step if row == 0 else zero
        second.append(Coordinate(balance - step, later, along, across))
    return Orbit(root, tuple(first), tuple(second), impact)


class Path(NamedTuple):
    """What an orbit meets on its way from turn to turn."""

    highest_rate: Number
    """Largest phi' between the turns: the orbit is none unless negative."""
    least_fall: Number
    """The least of -phi' where it has a dent; infinite if there is none."""
    leaving: Number
    """phi'' just after the upper turn: the block sticks there unless negative."""
    arriving: Number
    """-phi'' just before the lower turn: the block turns before it unless negative."""
    bob_time: Number
    """Time on its arc at which |psi| is largest."""
    bob_late: Bool[Array, ""]
    """Whether that is on the second arc."""


def path_of(half: Half, orbit: Orbit) -> Path:
    """Follow both arcs, sampled with their accelerations: what peaks between two samples is found
    from these."""
    plant, xi = half.plant, half.plant.linear.xi
    start = turn(orbit.root.gamma)
    met, dent = jnp.full_like(orbit.root.t, -jnp.inf), jnp.full_like(orbit.root.t, jnp.inf)
    bob = (-jnp.ones_like(met), jnp.zeros_like(met), jnp.zeros(met.shape, bool))
    ends = []
    for late, arc in enumerate((orbit.first, orbit.second)):
        length = half.span - orbit.root.t if late else orbit.root.t
        spacing = length / PATH_NODES
        onward, turning = exponential(plant.slip, spacing), turn(xi * spacing)

        def look(now: Instant, arc: tuple = arc) -> tuple[Number, Number, Number]:
            rate = now.rate(plant)
            tilt = arc[0]._replace(constant=jnp.zeros_like(xi))
            return tilt.at(*rate), tilt.at(*rate.rate(plant)), jnp.abs(arc[1].at(*now))

        def step(
            i: Array,
            carry: tuple,
            late: int = late,
            spacing: Number = spacing,
            ahead: tuple[Factor, Turn] = (onward, turning),
        ) -> tuple:
            now, (rate0, pull0, _), met, dent, bob = carry
            now = Instant(now.flow.times(ahead[0], plant.slip), now.phase.then(ahead[1]))
            rate, pull, angle = seen = look(now)
            peaked = (pull0 > 0) & (pull <= 0)
            share = pull0 / jnp.where(peaked, pull0 - pull, 1.0)
            from_left = rate0 + 0.5 * pull0 * share * spacing
            from_right = rate - 0.5 * pull * (1.0 - share) * spacing
            last = (i == PATH_NODES - 1) & (late == 1)
            met = jnp.maximum(met, jnp.where(last, -jnp.inf, rate))
            dent = jnp.minimum(dent, jnp.where(peaked, -jnp.maximum(from_left, from_right), jnp.inf))
            larger = angle > bob[0]
            bob = (
                jnp.where(larger, angle, bob[0]),
                jnp.where(larger, spacing * (i + 1.0), bob[1]),
                jnp.where(larger, late == 1, bob[2]),
            )
            return now, seen, met, dent, bob

        now = Instant(identity(orbit.root.t), start)
        seen = look(now)
        ends.append(seen[1])
        now, seen, met, dent, bob = jax.lax.fori_loop(0, PATH_NODES, step, (now, seen, met, dent, bob))
        ends.append(seen[1])
        start = now.phase
    time = _bob_peak(half, orbit, bob[1], bob[2])
    return Path(jnp.maximum(met, -dent), dent, ends[0], -ends[3], time, bob[2])


def instant(half: Half, orbit: Orbit, s: Number, late: Bool[Array, ""]) -> Instant:
    """The time s after the turn, or after the crossing if `late`."""
    begun = jnp.where(late, orbit.root.t, 0.0)
    phase = turn(orbit.root.gamma + half.plant.linear.xi * (begun + s))
    return Instant(exponential(half.plant.slip, s), phase)


def _choose(late: Bool[Array, ""], orbit: Orbit, row: int) -> Coordinate:
    return jax.tree.map(lambda a, b: jnp.where(late, b, a), orbit.first[row], orbit.second[row])


def _bob_peak(half: Half, orbit: Orbit, s: Number, late: Bool[Array, ""]) -> Number:
    """The turning point of the bob next to a sample, unless the sample is at the end of its arc."""
    length = jnp.where(late, half.span - orbit.root.t, orbit.root.t)
    low = jnp.maximum(s - length / PATH_NODES, 0.0)
    high = jnp.minimum(s + length / PATH_NODES, length)
    bob = _choose(late, orbit, 1)._replace(constant=jnp.zeros_like(s))

    def step(_: Array, s: Number) -> Number:
        rate = instant(half, orbit, s, late).rate(half.plant)
        slope = bob.at(*rate.rate(half.plant))
        return jnp.clip(s - bob.at(*rate) / jnp.where(slope == 0.0, 1.0, slope), low, high)

    return jax.lax.fori_loop(0, 4, step, s)


def state_at(half: Half, orbit: Orbit, s: Number) -> State:
    """The state a time s in [0, 2 h) after the upper turn."""
    mirrored = s >= half.span
    s = jnp.where(mirrored, s - half.span, s)
    late = s >= orbit.root.t
    now = instant(half, orbit, jnp.where(late, s - orbit.root.t, s), late)
    rate = now.rate(half.plant)
    tilt, bob = _choose(late, orbit, 0), _choose(late, orbit, 1)
    y = jnp.stack([tilt.at(*now), bob.at(*now), tilt.at(*rate) - tilt.constant, bob.at(*rate) - bob.constant])
    return jnp.where(mirrored, -y, y)


def half_map(half: Half, orbit: Orbit) -> Matrix:
    """The derivative of -(the map over half a period), cut just after the turn: the flow of both
    arcs, and at its ends the saltation matrices of crossing and turning."""
    plant, at = half.plant, crossing(half, orbit.root.t)
    first, second = _flow_matrix(plant, at.flow), _flow_matrix(plant, at.rest)
    linear, lost = plant.linear, plant.restitution - 1.0
    zero, one = jnp.zeros_like(half.span), jnp.ones_like(half.span)
    # Friction and weight enter the accelerations through the first column of M^-1.
    per_moment = (linear.m22 / linear.determinant, -linear.m21 / linear.determinant)
    before = _rates(half, orbit, orbit.first, at.flow, orbit.root.t)
    after = _rates(half, orbit, orbit.second, identity(one), orbit.root.t)
    jump = (lost, lost * 2.0 / plant.length_ratio)
    # After the impact the flow starts from R y; f_before is carried through R too.
    carried = (
        before[0],
        before[1],
        before[2] * (1.0 + lost),
        before[3] + jump[1] * before[2],
    )
    through = tuple(a - b for a, b in zip(after, carried, strict=True))
    crossing_jump = tuple(
        tuple(
            (one if i == j else zero)
            + (jump[i - 2] if j == 2 and i >= 2 else 0.0)
            + (through[i] / before[0] if j == 0 else 0.0)
            for j in range(4)
        )
        for i in range(4)
    )
    end = _rates(half, orbit, orbit.second, at.rest, half.span)
    slack = 2.0 * linear.friction
    push = (zero, zero, -slack * per_moment[0], -slack * per_moment[1])
    turning_jump = tuple(
        tuple((one if i == j else zero) + (push[i] / end[2] if j == 2 else 0.0) for j in range(4))
        for i in range(4)
    )
    m = product(turning_jump, product(second, product(crossing_jump, first)))
    return tuple(tuple(-x for x in row) for row in m)


def _rates(half: Half, orbit: Orbit, arc: tuple, flow: Factor, tau: Number) -> tuple[Number, ...]:
    """d/dtau of the state at a time on an arc."""
    phase = turn(orbit.root.gamma + half.plant.linear.xi * tau)
    rate = Instant(flow, phase).rate(half.plant)
    pull = rate.rate(half.plant)
    free = tuple(x._replace(constant=jnp.zeros_like(tau)) for x in arc)
    return free[0].at(*rate), free[1].at(*rate), free[0].at(*pull), free[1].at(*pull)


def _flow_matrix(plant: Plant, flow: Factor) -> Matrix:
    columns = []
    for i in range(4):
        unit = jnp.zeros(4).at[i].set(1.0)
        columns.append([c.of(flow) for c in components(plant, unit)])
    return tuple(tuple(columns[j][i] for j in range(4)) for i in range(4))


class Candidates(NamedTuple):
    """The orbits of one design, largest first; leading axis `ORBITS`. Not differentiated."""

    root: Root
    path: Path
    exists: Bool[Array, "orbits"]
    overflow: Bool[Array, ""]
    """Whether there were more roots than places for them."""


def candidates(half: Half) -> Candidates:
    """All orbits whose path keeps to its signs."""
    found = _brackets(half)
    brackets = _Bracket(*(jnp.stack(x) for x in zip(*found.brackets, strict=True)))

    def follow(bracket: _Bracket, there: Array) -> tuple[Root, Path, Number, Bool[Array, ""]]:
        root, reached = converge(half, refine(half, bracket), there)
        orbit = orbit_of(half, root)
        path, height = path_of(half, orbit), orbit.height
        good = (path.highest_rate < 0) & (path.leaving < 0) & (path.arriving < 0) & (height > 0)
        inside = (root.t > bracket.low - 0.5 * width) & (root.t < bracket.high + 0.5 * width)
        return root, path, height, good & reached & inside & there

    width = half.span / NODES
    root, path, height, good = jax.vmap(follow)(brackets, jnp.arange(ROOTS) < found.count)
    ahead = height[None, :] > height[:, None]
    rank = jnp.where(good, jnp.sum(ahead & good[None, :], axis=1), ROOTS)

    def pick(x: Array) -> Array:
        return jnp.stack([jnp.sum(jnp.where(rank == i, x, 0), axis=0, dtype=x.dtype) for i in range(ORBITS)])

    chosen = jax.tree.map(pick, (root, path))
    exists = jnp.arange(ORBITS) < jnp.sum(good)
    return Candidates(*chosen, exists, (found.count > ROOTS) | (jnp.sum(good) > ORBITS))
