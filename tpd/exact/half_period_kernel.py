"""The half period of a symmetric period-one orbit as two arcs in closed form, in compiled scalar code.

Such an orbit turns at phi > 0 (tau = 0 here, the forcing being sin(xi tau + gamma)), falls through phi = 0 at
tau = t, and half a forcing period h = pi/xi after the turn is its own mirror image, y(h) = -y(0). Between its
events the system is linear with constant loads, (16) to (18) of the paper. Its (19) fixes t at h/2, one
condition too many once k > 0; here t is unknown. With K = 1 + 2 mu, w = (1 + mu) nu, M = [1 + exp(A h)]^-1,
e1 the tilt, V = phi'(t-) and V d the jump of the rates in the impact, d = (0, 0, *`contact_kernel.jump`), the
mirror condition gives the two arcs, s being counted from the start of each:

    y(s) = exp(A s) M {(2k/K) e1 - exp(A (h - t)) [(2w/K) e1 + V d]} + (w - k)/K e1 + harmonic(s)
    y(t + s) = exp(A s) M {exp(A t) (2k/K) e1 + (2w/K) e1 + V d} - (w + k)/K e1 + harmonic(t + s)

Turning, phi'(0) = 0, and crossing, phi(t-) = 0, are linear in (sin gamma, cos gamma) and are the two
conditions for (t, gamma). All functions take real or complex numbers, see `tpd.exact.plant`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from tpd.exact.arcs import Arc, Instant, Signal, exponential, instant, pair, sincos, state_at
from tpd.exact.contact_kernel import jump, ratio
from tpd.exact.plant import compiled

Half = namedtuple(
    "Half",
    "xi tilt_sin tilt_cos span step slack balance per_fall tilt_whole rate_whole kick_whole thrown_whole "
    "tilt rate kick thrown bob bob_kick",
)
"""Numbers that depend on the parameters alone: three of the plant's; h; the jumps 2w/K and 2k/K of the
balance tilt at the crossing and at a turn, and (w - k)/K; one over the factor of phi'(t-) that closes the
impact's loop; and functionals of g, `Part`: components of g(A) M x, of x = e1 phi, phi' and psi (tilt, rate,
bob), of x = d the same (kick, thrown, bob_kick). Names that end in `whole` are of values at g = exp(A h)."""
Part = namedtuple("Part", "s1 s2 u v")
"""A functional of flows by its factors of what a flow does."""
Flow = namedtuple("Flow", "e1 e2 u v")
"""exp(A t) by what it does to the modes s1 and s2 and to the pair: u + v A there."""
Phased = namedtuple("Phased", "c s u")
"""A quantity c + s sin gamma + u cos gamma."""
Conditions = namedtuple("Conditions", "turning crossing impact height")
"""phi'(0), phi(t-), V and phi(0), each `Phased`."""
Solution = namedtuple(
    "Solution", "turning crossing height turning_t crossing_t height_t turning_g crossing_g height_g"
)
"""phi'(0), phi(t-), phi(0) and their derivatives with respect to t and gamma."""
Path = namedtuple("Path", "first second crossing end")
"""The arcs until the crossing and from there to the next turn, and the instants at their ends."""


@compiled
def flow(q, t):
    """exp(A t)."""
    u, v = pair(q.p, q.q, t)
    return Flow(exponential(q.s1 * t), exponential(q.s2 * t), u, v)


@compiled
def rate_of_flow(q, g):
    """A exp(A t)."""
    return Flow(q.s1 * g.e1, q.s2 * g.e2, -q.q * g.v, g.u - q.p * g.v)


@compiled
def apply(x, g):
    """Value of a functional at a flow."""
    return x.s1 * g.e1 + x.s2 * g.e2 + x.u * g.u + x.v * g.v


@compiled
def _after(q, x, g):
    """The functional `x` after a flow: f -> x(f g)."""
    return Part(x.s1 * g.e1, x.s2 * g.e2, x.u * g.u + x.v * g.v, x.v * (g.u - q.p * g.v) - q.q * x.u * g.v)


@compiled
def _rate_of(q, x):
    """The functional of the rate of a component."""
    return Part(q.s1 * x.s1, q.s2 * x.s2, x.v, -q.q * x.u - q.p * x.v)


@compiled
def half(q):
    """All numbers that depend on the parameters alone."""
    span, step, slack = np.pi / q.xi, 2.0 * q.weight / q.up, 2.0 * q.k / q.up
    lost, thrown_by = jump(q, ratio(q))
    whole = flow(q, span)
    # M on the pair: the inverse of a + b A, where A^2 = -q - p A.
    a, b = 1.0 + whole.u, whole.v
    norm = a * a - q.p * a * b + q.q * b * b
    closing = Flow(1.0 / (1.0 + whole.e1), 1.0 / (1.0 + whole.e2), (a - q.p * b) / norm, -b / norm)
    # The shares of e1 and d in both real modes; the pair has the rest of the component and of its rate.
    x, y, d, z = q.al0, q.bl0, lost * q.al2 + thrown_by * q.al3, lost * q.bl2 + thrown_by * q.bl3
    of_tilt = Part(x * q.a0, y * q.b0, 1.0 - x * q.a0 - y * q.b0, -x * q.a2 - y * q.b2)
    of_kick = Part(d * q.a0, z * q.b0, -d * q.a0 - z * q.b0, lost - d * q.a2 - z * q.b2)
    of_bob = Part(x * q.a1, y * q.b1, -x * q.a1 - y * q.b1, -x * q.a3 - y * q.b3)
    of_bob_kick = Part(d * q.a1, z * q.b1, -d * q.a1 - z * q.b1, thrown_by - d * q.a3 - z * q.b3)
    tilt, kick = _after(q, of_tilt, closing), _after(q, of_kick, closing)
    rate, thrown = _rate_of(q, tilt), _rate_of(q, kick)
    thrown_whole = apply(thrown, whole)
    # V depends on phi'(t-), which depends on V again through the mirror condition.
    per_fall = 1.0 / (1.0 + thrown_whole)
    integers_at = apply(tilt, whole), apply(rate, whole), apply(kick, whole), thrown_whole
    bob, bob_kick = _after(q, of_bob, closing), _after(q, of_bob_kick, closing)
    of_plant = q.xi, q.tilt_sin, q.tilt_cos, span, step, slack, 0.5 * (step - slack), per_fall
    return Half(*of_plant, *integers_at, tilt, rate, kick, thrown, bob, bob_kick)


@compiled
def at_phase(x, sine, cosine):
    """Value of a `Phased` quantity."""
    return x.c + x.s * sine + x.u * cosine


@compiled
def conditions(m, f, g, sine, cosine):
    """The conditions, with f = exp(A t), g = exp(A (h - t)), and sine and cosine of xi t."""
    xi, s0, u0 = m.xi, m.tilt_sin, m.tilt_cos
    s1, u1 = s0 * cosine - u0 * sine, s0 * sine + u0 * cosine
    falling = m.per_fall * (m.slack * apply(m.rate, f) - m.step * m.rate_whole)
    v = Phased(falling, -m.per_fall * xi * u1, m.per_fall * xi * s1)
    still_rate, still_tilt = m.rate.s1 + m.rate.s2 + m.rate.u, m.tilt.s1 + m.tilt.s2 + m.tilt.u
    thrown, kick = apply(m.thrown, g), apply(m.kick, g)
    turning = m.slack * still_rate - m.step * apply(m.rate, g)
    crossing = m.slack * apply(m.tilt, f) - m.step * m.tilt_whole + m.balance
    height = m.slack * still_tilt - m.step * apply(m.tilt, g) + m.balance
    return Conditions(
        Phased(turning - thrown * v.c, -xi * u0 - thrown * v.s, xi * s0 - thrown * v.u),
        Phased(crossing - m.kick_whole * v.c, s1 - m.kick_whole * v.s, u1 - m.kick_whole * v.u),
        v,
        Phased(height - kick * v.c, s0 - kick * v.s, u0 - kick * v.u),
    )


@compiled
def conditions_at(q, m, t):
    """The conditions for a crossing at `t`."""
    sine, cosine = sincos(q.xi * t)
    return conditions(m, flow(q, t), flow(q, m.span - t), sine, cosine)


@compiled
def solution_at(q, m, t, gamma):
    """Both conditions and the height at (t, gamma), with their derivatives there."""
    f, g, (sine, cosine), (sg, cg) = flow(q, t), flow(q, m.span - t), sincos(q.xi * t), sincos(gamma)
    x = conditions(m, f, g, sine, cosine)
    xi, s0, u0 = m.xi, m.tilt_sin, m.tilt_cos
    s1, u1 = s0 * cosine - u0 * sine, s0 * sine + u0 * cosine
    # exp(A (h - t)) changes by -A exp(A (h - t)), and the harmonic at t by its rate.
    df, dg = rate_of_flow(q, f), rate_of_flow(q, g)
    harmonic_rate, harmonic_pull = xi * (s1 * cg - u1 * sg), -xi * xi * (s1 * sg + u1 * cg)
    v, dv = at_phase(x.impact, sg, cg), m.per_fall * (m.slack * apply(m.rate, df) + harmonic_pull)
    return Solution(
        at_phase(x.turning, sg, cg),
        at_phase(x.crossing, sg, cg),
        at_phase(x.height, sg, cg),
        m.step * apply(m.rate, dg) + apply(m.thrown, dg) * v - apply(m.thrown, g) * dv,
        m.slack * apply(m.rate, f) + harmonic_rate - m.kick_whole * dv,
        m.step * apply(m.tilt, dg) + apply(m.kick, dg) * v - apply(m.kick, g) * dv,
        x.turning.s * cg - x.turning.u * sg,
        x.crossing.s * cg - x.crossing.u * sg,
        x.height.s * cg - x.height.u * sg,
    )


@compiled
def _signal(q, unit, kick, still, moved, h, constant, along, across):
    """Component (functionals `unit` of e1 and `kick` of d) of what stays and what is carried on by `h`, each
    as factors of e1 and d, with its constant and its harmonic."""
    (c, d), (a, b), zero = still, moved, 0.0 * along
    real = a * unit.s1 + b * kick.s1, a * unit.s2 + b * kick.s2
    x = _after(q, Part(*real, a * unit.u + b * kick.u, a * unit.v + b * kick.v), h)
    s1, s2 = x.s1 + c * unit.s1 + d * kick.s1, x.s2 + c * unit.s2 + d * kick.s2
    u, v = x.u + c * unit.u + d * kick.u, x.v + c * unit.v + d * kick.v
    return Signal(constant, s1, s2, u, v, along, across, zero, zero)


@compiled
def path_of(q, m, t, gamma):
    """Both arcs of the solution (t, gamma)."""
    f, g, (sine, cosine), (sg, cg) = flow(q, t), flow(q, m.span - t), sincos(q.xi * t), sincos(gamma)
    impact, zero = at_phase(conditions(m, f, g, sine, cosine).impact, sg, cg), 0.0 * gamma
    thrown, released, back = (m.step, impact), (m.slack, zero), (-m.step, -impact)
    tilt = _signal(q, m.tilt, m.kick, released, back, g, m.balance, q.tilt_sin, q.tilt_cos)
    bob = _signal(q, m.bob, m.bob_kick, released, back, g, zero, q.bob_sin, q.bob_cos)
    first = Arc(tilt, bob, q.s1, q.s2, q.p, q.q, q.xi, gamma)
    tilt = _signal(q, m.tilt, m.kick, thrown, released, f, m.balance - m.step, q.tilt_sin, q.tilt_cos)
    bob = _signal(q, m.bob, m.bob_kick, thrown, released, f, zero, q.bob_sin, q.bob_cos)
    second = Arc(tilt, bob, q.s1, q.s2, q.p, q.q, q.xi, gamma + q.xi * t)
    # The forcing turns by xi t until the crossing, and by pi until the end.
    crossing = Instant(f.e1, f.e2, f.u, f.v, sg * cosine + cg * sine, cg * cosine - sg * sine)
    return Path(first, second, crossing, Instant(g.e1, g.e2, g.u, g.v, -sg, -cg))


@compiled
def state_after(path, t, s):
    """(phi, psi, phi', psi', phi'', psi'') at the time `s` after the upper turn, at `t` just after the
    impact."""
    arc, time = (path.second, s - t) if s.real >= t.real else (path.first, s)
    return state_at(arc, instant(arc, time), time)
