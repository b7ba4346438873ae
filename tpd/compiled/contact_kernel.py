"""The contact between block and base: the holding moment, the modes and the impacts.

The rules are the same for the linear and for the nonlinear model. The impact laws are those of
`tpd.scene.impacts`.
"""

from __future__ import annotations

import math

from tpd.compiled.columns import REST, SLIP, STICK, SWING, SWING_RATE, TILT, TILT_PULL, TILT_RATE
from tpd.compiled.events import FIRST
from tpd.compiled.plant import compiled, shared
from tpd.scene import impacts

# Register the impact laws of the package for use in compiled code.
linear_ratio, linear_bob_change = shared(impacts.linear_ratio), shared(impacts.linear_bob_change)
velocity_ratio, bob_change = shared(impacts.velocity_ratio), shared(impacts.bob_change)


@compiled
def moment(q, y0, y1, y3, eta):
    """Return the moment R on a block that is held still (phi' = 0), divided by M g b.

    The block stays held while friction and weight balance R. Row 1 of (25) contains psi'', which row 2 gives
    for phi'' = 0. So f (1 + kappa mu) becomes f, because the bob's share of the forcing accelerates the bob.
    """
    return q.up * y0 - q.f * eta - (q.up - 1.0) * y1 + q.bias * y3


@compiled
def ratio(q):
    """Return the ratio of phi' after and before an impact, for the linear model."""
    return linear_ratio(q.e, q.nu, q.mu, q.lam, q.m22 / q.lam, q.kappa)


@compiled
def jump(q, share):
    """Return the changes of phi' and psi' in an impact, divided by phi' before it.

    `share` is the ratio of phi' after and before the impact.
    """
    return share - 1.0, linear_bob_change(share, q.e, q.nu, q.mu, q.lam, q.m22 / q.lam, q.kappa)


@compiled
def rates_after_impact(q, rests, y2, y3):
    """Return the rates of block and bob after an impact.

    If `rests`, return the rates after a whole rattle that ends in rest.
    """
    # Each hop of a rattle is smaller than the last by the ratio, and infinitely many hops take a finite time.
    # Together they act like one perfectly plastic impact, with an error of the order of the square of the
    # rate.
    block, bob = jump(q, 0.0 * q.e if rests else ratio(q))
    return y2 + block * y2, y3 + bob * y2


@compiled
def sign(x):
    """Return the sign of a number, and 0 for zero."""
    return 0.0 if x == 0.0 else math.copysign(1.0, x)


@compiled
def beyond_return(q):
    """Return the tilt (rad) from which the block does not return, see `tpd.theory.equations.Linear`."""
    return 10.0 * (q.weight + q.k + q.f * q.up) / q.up


@compiled
def mode_of(up, down, friction, tilt, direction):
    """Return the kind and the signs of the mode of a state.

    `up` and `down` are the moments on the held block minus the moment of its weight, which acts against
    positive and against negative tilt. Off the base both are equal. `friction` is the largest moment of
    friction. `tilt` is the sign of phi, 0 on the base, and `direction` the sign of phi', 0 at a turning
    point.
    """
    # A block that does not move stays held as long as friction balances the excess moment. On the base each
    # direction has an excess of its own, because weight resists both. From the base the block tilts to the
    # side to which it moves.
    lifts = 1.0 if up > friction else (-1.0 if down < -friction else 0.0)
    heading = direction if direction != 0.0 else lifts
    held_kind = STICK if tilt != 0.0 else REST
    return ((SLIP if heading != 0.0 else held_kind), (tilt if tilt != 0.0 else heading), heading)


@compiled
def decide(q, y, tilt, direction, eta, mode):
    """Determine the mode of a state and write it into `mode`.

    `tilt` and `direction` are the signs of phi and phi', and may be zero. `eta` is the forcing.
    """
    pull, side = moment(q, y[TILT], y[SWING], y[SWING_RATE], eta), (1.0 if tilt == 0.0 else tilt)
    other = -1.0 if tilt == 0.0 else tilt
    up, down = pull - side * q.weight, pull - other * q.weight
    mode.kind, mode.tilt, mode.direction = mode_of(up, down, q.k + q.slack, tilt, direction)


@compiled
def held_on_base(q, psi, rate, eta):
    """Whether weight and friction can hold the block at phi = 0 if it does not move."""
    return abs(moment(q, 0.0 * psi, psi, rate, eta)) <= q.weight + q.k


@compiled
def hold_margin(q, kind, tilt, event, y0, y1, y3, eta):
    """Return the margin between the moment on a held block and the limit at which it is released.

    The block is released upwards at the event FIRST, and downwards at SECOND.
    """
    direction = 1.0 if event == FIRST else -1.0
    # Off its base the block has its weight on one side. On its base it has to overcome the weight to either
    # side.
    level = tilt * q.weight if kind == STICK else direction * q.weight
    return q.k - direction * (moment(q, y0, y1, y3, eta) - level)


@compiled
def handle_event(q, event, capture, eta, y, mode):
    """Change the state and the mode at an event of the block, see `tpd.compiled.events.watch_block`.

    Returns whether the block came to rest at the end of a rattle, that is, from hops slower than `capture`.
    """
    if mode.kind != SLIP:
        side = 1.0 if event == FIRST else -1.0
        # Release of a held block.
        mode.tilt = side if mode.kind == REST else mode.tilt
        mode.kind, mode.direction = SLIP, side
        return False
    if event == FIRST:
        # The height of a hop is of the square of its speed. Such a low turning point belongs to hops below
        # the capture speed.
        low = abs(y[TILT]) <= capture * capture
        y[TILT], y[TILT_RATE] = 0.0 if low else y[TILT], 0.0
        decide(q, y, 0.0 if low else mode.tilt, 0.0, eta, mode)
        return low
    # Landing.
    rests = abs(y[TILT_RATE]) <= capture and held_on_base(q, y[SWING], y[SWING_RATE], eta)
    y[TILT] = 0.0
    y[TILT_RATE], y[SWING_RATE] = rates_after_impact(q, rests, y[TILT_RATE], y[SWING_RATE])
    if y[TILT_RATE] == 0.0:
        decide(q, y, 0.0, 0.0, eta, mode)
    else:
        mode.kind, mode.tilt = SLIP, mode.direction
    return rests


@compiled
def transversality(q, rate, event, before, after, now, eta):
    """Return the rate at which a slipping block crosses an event, divided by its usual value.

    The result is infinite for other events.

    `rate` is the usual rate of the motion, `before` and `after` are the kinds of the modes, and `now` is the
    state with its accelerations.
    """
    # The derivative of an event's time has this rate in its denominator. Where the rate vanishes, the motion
    # grazes the event. Impacts after which the block could be held are excluded. They belong to the hops of a
    # rattle, which occur at arbitrarily small rates on every orbit that comes to rest, and do not indicate
    # grazing.
    if before != SLIP or after != SLIP:
        return math.inf
    usual = rate * q.weight
    if event == FIRST:
        return abs(now[TILT_PULL]) / (rate * usual)
    return math.inf if held_on_base(q, now[SWING], now[SWING_RATE], eta) else abs(now[TILT_RATE]) / usual
