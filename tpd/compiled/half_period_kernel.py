"""The half period of a symmetric period-one orbit, as two arcs in closed form.

Such an orbit turns at phi > 0, which is tau = 0 here with the forcing sin(xi tau + gamma). The tilt decreases
and crosses phi = 0 at tau = t. Half a forcing period h = pi/xi after the turning point the state is its own
mirror image, y(h) = -y(0). Between its events the system is linear with constant loads, (16) to (18) of the
paper. Equation (19) fixes t at h/2, which is one condition too many if k > 0. Here t is an unknown.

Let K = 1 + kappa mu, w = (1 + mu) nu, M = [1 + exp(A h)]^-1, e1 the unit vector of the tilt, V = phi'(t-),
and V d the jump of the rates in the impact, d = (0, 0, *`contact.impact`). The mirror condition gives
both arcs, with s measured from the start of each:

    y(s) = exp(A s) M {(2k/K) e1 - exp(A (h - t)) [(2w/K) e1 + V d]} + (w - k)/K e1 + harmonic(s)
    y(t + s) = exp(A s) M {exp(A t) (2k/K) e1 + (2w/K) e1 + V d} - (w + k)/K e1 + harmonic(t + s)

The turning point, phi'(0) = 0, and the crossing, phi(t-) = 0, are linear in (sin gamma, cos gamma). They are
the two conditions for (t, gamma). All functions take real or complex numbers, see `tpd.compiled.plant`.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from tpd.compiled.contact import impact
from tpd.compiled.plant import compiled

_SERIES = 1e-3
"""Value of |w t|^2 below which the solutions of the pair are summed as power series."""
Signal = namedtuple("Signal", "constant on_s1 on_s2 on_u on_v along across")
"""A quantity along an arc: a constant, the factors of the four free solutions, and the response to the
forcing, along sin + across cos."""
Arc = namedtuple("Arc", "tilt bob s1 s2 p q xi phase")
"""An arc: tilt and bob angle as signals, the time scales, and the phase of the forcing at the start."""
Instant = namedtuple("Instant", "e1 e2 u v sine cosine")
"""The functions of time at an instant of an arc, from which signals are evaluated."""
Half = namedtuple(
    "Half",
    "xi tilt_sin tilt_cos span step slack balance per_fall tilt_whole rate_whole kick_whole kick_rate_whole "
    "tilt rate kick kick_rate bob bob_kick",
)
"""Numbers of a half period that depend on the parameters alone.

They are three numbers of the plant; the duration h (`span`); the jumps 2w/K (`step`) and 2k/K (`slack`) of
the equilibrium tilt at the crossing and at a turning point, and (w - k)/K (`balance`); `per_fall`, the factor
that solves the impact condition for phi'(t-); and functionals of a flow g (`Part`). These are the components
phi, phi' and psi of g(A) M e1 (`tilt`, `rate`, `bob`) and of g(A) M d (`kick`, `kick_rate`, `bob_kick`).
Names that end in `whole` are their values at g = exp(A h).
"""
Part = namedtuple("Part", "s1 s2 u v")
"""A functional of flows: the factors of the four numbers of a `Flow`."""
Flow = namedtuple("Flow", "e1 e2 u v")
"""The flow exp(A t): the factors e1 and e2 of the modes s1 and s2, and u + v A for the pair."""
Phased = namedtuple("Phased", "c s u")
"""A quantity c + s sin gamma + u cos gamma."""
Conditions = namedtuple("Conditions", "turning crossing impact height")
"""phi'(0), phi(t-), V and phi(0), each as a `Phased` quantity."""
Solution = namedtuple(
    "Solution", "turning crossing height turning_t crossing_t height_t turning_g crossing_g height_g"
)
"""phi'(0), phi(t-) and phi(0), and their derivatives with respect to t and gamma."""
Path = namedtuple("Path", "first second crossing end")
"""The path of a solution: the arcs before and after the crossing, and the instants at the ends of both."""


@compiled
def exponential(x):
    """Return e^x. The imaginary part is so small that its square vanishes."""
    return np.exp(x.real) * (1.0 + (x - x.real))


@compiled
def sincos(x):
    """Return sine and cosine of x. The imaginary part is so small that its square vanishes."""
    sine, cosine, rest = np.sin(x.real), np.cos(x.real), x - x.real
    return sine + cosine * rest, cosine - sine * rest


@compiled
def pair(p, q, t):
    """Return the solutions u and v of x'' + p x' + q x = 0.

    The initial values are (u, u') = (1, 0) and (v, v') = (0, 1) at t = 0.

    With w^2 = q - p^2/4, v = exp(-pt/2) sin(wt)/w and u = exp(-pt/2) cos(wt) + p/2 v.
    """
    # Where w^2 changes its sign, cos and sin become cosh and sinh. Near zero both formulas divide by a small
    # w, and their derivatives by its square. There the power series in w^2 is one function for both signs.
    w2 = q - 0.25 * p * p
    x2 = w2 * t * t
    half = 0.5 * p
    if abs(x2.real) < _SERIES:
        decay = exponential(-half * t)
        c = decay * (1.0 - x2 / 2.0 * (1.0 - x2 / 12.0 * (1.0 - x2 / 30.0 * (1.0 - x2 / 56.0))))
        v = decay * t * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0 * (1.0 - x2 / 72.0))))
    elif w2.real < 0.0:
        w = np.sqrt(-w2)
        # Two exponentials, because cosh and the decay overflow separately.
        slow, fast = exponential((w - half) * t), exponential((-w - half) * t)
        c, v = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
    else:
        w, decay = np.sqrt(w2), np.exp(-half * t)
        c, v = decay * np.cos(w * t), decay * np.sin(w * t) / w
    return c + half * v, v


@compiled
def instant(arc, t):
    """Return the functions of time at the local time `t` of an arc."""
    u, v = pair(arc.p, arc.q, t)
    sine, cosine = sincos(arc.phase + arc.xi * t)
    return Instant(exponential(arc.s1 * t), exponential(arc.s2 * t), u, v, sine, cosine)


@compiled
def _rate_of_signal(arc, x):
    """Return the time derivative of a signal."""
    free = arc.s1 * x.on_s1, arc.s2 * x.on_s2, x.on_v, -arc.q * x.on_u - arc.p * x.on_v
    return Signal(0.0 * arc.xi, *free, -arc.xi * x.across, arc.xi * x.along)


@compiled
def value_of(x, now):
    """Return the value of a signal."""
    free = x.on_s1 * now.e1 + x.on_s2 * now.e2 + x.on_u * now.u + x.on_v * now.v
    return x.constant + free + x.along * now.sine + x.across * now.cosine


@compiled
def state_at(arc, now):
    """Return (phi, psi, phi', psi', phi'', psi'') at an instant."""
    tilt, bob = _rate_of_signal(arc, arc.tilt), _rate_of_signal(arc, arc.bob)
    pulls = value_of(_rate_of_signal(arc, tilt), now), value_of(_rate_of_signal(arc, bob), now)
    return value_of(arc.tilt, now), value_of(arc.bob, now), value_of(tilt, now), value_of(bob, now), *pulls


@compiled
def flow(q, t):
    """Return exp(A t)."""
    u, v = pair(q.p, q.q, t)
    return Flow(exponential(q.s1 * t), exponential(q.s2 * t), u, v)


@compiled
def rate_of_flow(q, g):
    """Return A exp(A t)."""
    return Flow(q.s1 * g.e1, q.s2 * g.e2, -q.q * g.v, g.u - q.p * g.v)


@compiled
def apply(x, g):
    """Return the value of a functional at a flow."""
    return x.s1 * g.e1 + x.s2 * g.e2 + x.u * g.u + x.v * g.v


@compiled
def _after(q, x, g):
    """Return the functional `x` after a flow g, which takes f to x(f g)."""
    return Part(x.s1 * g.e1, x.s2 * g.e2, x.u * g.u + x.v * g.v, x.v * (g.u - q.p * g.v) - q.q * x.u * g.v)


@compiled
def _rate_of(q, x):
    """Return the functional of the rate of a component."""
    return Part(q.s1 * x.s1, q.s2 * x.s2, x.v, -q.q * x.u - q.p * x.v)


@compiled
def half(q):
    """Return all numbers of a half period that depend on the parameters alone."""
    span, step, slack = np.pi / q.xi, 2.0 * q.weight / q.up, 2.0 * q.k / q.up
    block_jump, bob_jump = impact(q, False, 1.0, 0.0 * span)
    whole = flow(q, span)
    # M on the pair is the inverse of a + b A, where A^2 = -q - p A.
    a, b = 1.0 + whole.u, whole.v
    norm = a * a - q.p * a * b + q.q * b * b
    closing = Flow(1.0 / (1.0 + whole.e1), 1.0 / (1.0 + whole.e2), (a - q.p * b) / norm, -b / norm)
    # The components of e1 and d along both real modes. The pair has the rest of each component and of its
    # rate.
    x, y, d, z = q.al0, q.bl0, block_jump * q.al2 + bob_jump * q.al3, block_jump * q.bl2 + bob_jump * q.bl3
    of_tilt = Part(x * q.a0, y * q.b0, 1.0 - x * q.a0 - y * q.b0, -x * q.a2 - y * q.b2)
    of_kick = Part(d * q.a0, z * q.b0, -d * q.a0 - z * q.b0, block_jump - d * q.a2 - z * q.b2)
    of_bob = Part(x * q.a1, y * q.b1, -x * q.a1 - y * q.b1, -x * q.a3 - y * q.b3)
    of_bob_kick = Part(d * q.a1, z * q.b1, -d * q.a1 - z * q.b1, bob_jump - d * q.a3 - z * q.b3)
    tilt, kick = _after(q, of_tilt, closing), _after(q, of_kick, closing)
    rate, kick_rate = _rate_of(q, tilt), _rate_of(q, kick)
    kick_rate_whole = apply(kick_rate, whole)
    # V depends on phi'(t-), which depends on V again through the mirror condition.
    per_fall = 1.0 / (1.0 + kick_rate_whole)
    wholes = apply(tilt, whole), apply(rate, whole), apply(kick, whole), kick_rate_whole
    bob, bob_kick = _after(q, of_bob, closing), _after(q, of_bob_kick, closing)
    of_plant = q.xi, q.tilt_sin, q.tilt_cos, span, step, slack, 0.5 * (step - slack), per_fall
    return Half(*of_plant, *wholes, tilt, rate, kick, kick_rate, bob, bob_kick)


@compiled
def at_phase(x, sine, cosine):
    """Return the value of a `Phased` quantity."""
    return x.c + x.s * sine + x.u * cosine


@compiled
def conditions(m, f, g, sine, cosine):
    """Return the conditions for a crossing at t.

    The arguments are f = exp(A t), g = exp(A (h - t)), and sine and cosine of xi t.
    """
    xi, s0, u0 = m.xi, m.tilt_sin, m.tilt_cos
    s1, u1 = s0 * cosine - u0 * sine, s0 * sine + u0 * cosine
    # phi' before the impact, as a function of gamma.
    falling = m.per_fall * (m.slack * apply(m.rate, f) - m.step * m.rate_whole)
    v = Phased(falling, -m.per_fall * xi * u1, m.per_fall * xi * s1)
    # The functionals at the flow of zero duration, which is the identity.
    still_rate, still_tilt = m.rate.s1 + m.rate.s2 + m.rate.u, m.tilt.s1 + m.tilt.s2 + m.tilt.u
    kick_rate, kick = apply(m.kick_rate, g), apply(m.kick, g)
    turning = m.slack * still_rate - m.step * apply(m.rate, g)
    crossing = m.slack * apply(m.tilt, f) - m.step * m.tilt_whole + m.balance
    height = m.slack * still_tilt - m.step * apply(m.tilt, g) + m.balance
    return Conditions(
        Phased(turning - kick_rate * v.c, -xi * u0 - kick_rate * v.s, xi * s0 - kick_rate * v.u),
        Phased(crossing - m.kick_whole * v.c, s1 - m.kick_whole * v.s, u1 - m.kick_whole * v.u),
        v,
        Phased(height - kick * v.c, s0 - kick * v.s, u0 - kick * v.u),
    )


@compiled
def conditions_at(q, m, t):
    """Return the conditions for a crossing at `t`."""
    sine, cosine = sincos(q.xi * t)
    return conditions(m, flow(q, t), flow(q, m.span - t), sine, cosine)


@compiled
def solution_at(q, m, t, gamma):
    """Return both conditions and phi(0) at (t, gamma), with their derivatives there."""
    f, g, (sine, cosine), (sg, cg) = flow(q, t), flow(q, m.span - t), sincos(q.xi * t), sincos(gamma)
    x = conditions(m, f, g, sine, cosine)
    xi, s0, u0 = m.xi, m.tilt_sin, m.tilt_cos
    s1, u1 = s0 * cosine - u0 * sine, s0 * sine + u0 * cosine
    # The derivative of exp(A (h - t)) in t is -A exp(A (h - t)), and the harmonic at t changes by its rate.
    df, dg = rate_of_flow(q, f), rate_of_flow(q, g)
    harmonic_rate, harmonic_pull = xi * (s1 * cg - u1 * sg), -xi * xi * (s1 * sg + u1 * cg)
    v, dv = at_phase(x.impact, sg, cg), m.per_fall * (m.slack * apply(m.rate, df) + harmonic_pull)
    return Solution(
        at_phase(x.turning, sg, cg),
        at_phase(x.crossing, sg, cg),
        at_phase(x.height, sg, cg),
        m.step * apply(m.rate, dg) + apply(m.kick_rate, dg) * v - apply(m.kick_rate, g) * dv,
        m.slack * apply(m.rate, f) + harmonic_rate - m.kick_whole * dv,
        m.step * apply(m.tilt, dg) + apply(m.kick, dg) * v - apply(m.kick, g) * dv,
        x.turning.s * cg - x.turning.u * sg,
        x.crossing.s * cg - x.crossing.u * sg,
        x.height.s * cg - x.height.u * sg,
    )


@compiled
def _signal(q, unit, kick, still, moved, h, constant, along, across):
    """Return a component of an arc as a signal.

    The arc is a constant part `still` plus a part `moved` that is carried on by the flow `h`. Each part has
    the factors of e1 and d. `unit` and `kick` are the functionals of the component for e1 and d.
    """
    (c, d), (a, b) = still, moved
    real = a * unit.s1 + b * kick.s1, a * unit.s2 + b * kick.s2
    x = _after(q, Part(*real, a * unit.u + b * kick.u, a * unit.v + b * kick.v), h)
    s1, s2 = x.s1 + c * unit.s1 + d * kick.s1, x.s2 + c * unit.s2 + d * kick.s2
    u, v = x.u + c * unit.u + d * kick.u, x.v + c * unit.v + d * kick.v
    return Signal(constant, s1, s2, u, v, along, across)


@compiled
def path_of(q, m, t, gamma):
    """Return the path of the solution (t, gamma)."""
    f, g, (sine, cosine), (sg, cg) = flow(q, t), flow(q, m.span - t), sincos(q.xi * t), sincos(gamma)
    impact, zero = at_phase(conditions(m, f, g, sine, cosine).impact, sg, cg), 0.0 * gamma
    crossing_jump, turn_jump, mirrored_jump = (m.step, impact), (m.slack, zero), (-m.step, -impact)
    tilt = _signal(q, m.tilt, m.kick, turn_jump, mirrored_jump, g, m.balance, q.tilt_sin, q.tilt_cos)
    bob = _signal(q, m.bob, m.bob_kick, turn_jump, mirrored_jump, g, zero, q.bob_sin, q.bob_cos)
    first = Arc(tilt, bob, q.s1, q.s2, q.p, q.q, q.xi, gamma)
    tilt = _signal(q, m.tilt, m.kick, crossing_jump, turn_jump, f, m.balance - m.step, q.tilt_sin, q.tilt_cos)
    bob = _signal(q, m.bob, m.bob_kick, crossing_jump, turn_jump, f, zero, q.bob_sin, q.bob_cos)
    second = Arc(tilt, bob, q.s1, q.s2, q.p, q.q, q.xi, gamma + q.xi * t)
    # The phase of the forcing advances by xi t until the crossing, and by pi until the end.
    crossing = Instant(f.e1, f.e2, f.u, f.v, sg * cosine + cg * sine, cg * cosine - sg * sine)
    return Path(first, second, crossing, Instant(g.e1, g.e2, g.u, g.v, -sg, -cg))


@compiled
def state_after(path, t, s):
    """Return (phi, psi, phi', psi', phi'', psi'') at the time `s` after the upper turning point.

    At the crossing time t this is the state after the impact.
    """
    arc, time = (path.second, s - t) if s.real >= t.real else (path.first, s)
    return state_at(arc, instant(arc, time))
