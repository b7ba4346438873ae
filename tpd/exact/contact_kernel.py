"""The block's contact with its base in compiled scalar code: what holds it, its impacts and its modes.

The rules are the same for the linear and for the nonlinear equations. The impacts are those of
`tpd.scene.impacts`.
"""

from __future__ import annotations

import math

from tpd.exact.events import FIRST
from tpd.exact.plant import compiled, shared
from tpd.exact.terms import REST, SLIP, STICK, SWING, SWING_RATE, TILT, TILT_PULL, TILT_RATE
from tpd.scene import impacts

linear_ratio, linear_bob_change = shared(impacts.linear_ratio), shared(impacts.linear_bob_change)
velocity_ratio, bob_change = shared(impacts.velocity_ratio), shared(impacts.bob_change)


@compiled
def moment(q, y0, y1, y3, eta):
    """Moment R on a block held still (phi' = 0): it stays held while friction and weight balance R. Row 1 of
    (25) contains psi'', which row 2 gives for phi'' = 0: f (1 + 2 mu) becomes f, since the bob's share of the
    forcing goes into its own motion."""
    return q.up * y0 - q.f * eta - (q.up - 1.0) * y1 + q.bias * y3


@compiled
def ratio(q):
    """phi' after an impact of the linear equations, over phi' before."""
    return linear_ratio(q.e, q.nu, q.mu, q.lam, q.m22 / q.lam)


@compiled
def jump(q, share):
    """Changes of phi' and psi', over phi' before, in an impact that leaves this share of phi'."""
    return share - 1.0, linear_bob_change(share, q.e, q.nu, q.mu, q.lam, q.m22 / q.lam)


@compiled
def rates_after_impact(q, rests, y2, y3):
    """Rates of block and bob after an impact, or after the last of the impacts that end in rest."""
    # Each hop is smaller than the last by the ratio, and infinitely many of them end in finite time: together
    # they do what one perfectly plastic impact would, with an error of the order of the square of the rate.
    block, bob = jump(q, 0.0 * q.e if rests else ratio(q))
    return y2 + block * y2, y3 + bob * y2


@compiled
def sign(x):
    """Sign of a number, 0 of zero."""
    return 0.0 if x == 0.0 else math.copysign(1.0, x)


@compiled
def beyond_return(q):
    """Tilt (rad) from which the block does not return; see `tpd.theory.equations.Linear`."""
    return 10.0 * (q.weight + q.k + q.f * q.up) / q.up


@compiled
def mode_of(up, down, friction, tilt, direction):
    """Kind and signs of the mode of a state.

    `up` and `down` are the moments on the held block, less what its weight balances, against a move to
    positive and to negative tilt; off the base both are equal. `friction` is its largest moment. `tilt` and
    `way` are the signs of phi, 0 on the base, and of phi', 0 at a turn.
    """
    # A block that does not move stays where it is as long as friction balances the excess. On its base it has
    # an excess for either direction, because weight resists both. From there it tilts to the side to which it
    # goes.
    lifts = 1.0 if up > friction else (-1.0 if down < -friction else 0.0)
    new_direction = direction if direction != 0.0 else lifts
    held = STICK if tilt != 0.0 else REST
    return (SLIP if new_direction != 0.0 else held), (tilt if tilt != 0.0 else new_direction), new_direction


@compiled
def decide(q, y, tilt, direction, eta, mode):
    """Put the mode of a state into `mode`; `tilt` and `way` are the signs of phi and phi', zero included."""
    held, side = moment(q, y[TILT], y[SWING], y[SWING_RATE], eta), (1.0 if tilt == 0.0 else tilt)
    other = -1.0 if tilt == 0.0 else tilt
    up, down = held - side * q.weight, held - other * q.weight
    mode.kind, mode.tilt, mode.direction = mode_of(up, down, q.k + q.slack, tilt, direction)


@compiled
def held_on_base(q, psi, rate, eta):
    """Whether weight and friction would hold the block at phi = 0 if it did not move."""
    return abs(moment(q, 0.0 * psi, psi, rate, eta)) <= q.weight + q.k


@compiled
def release_margin(q, kind, tilt, event, y0, y1, y3, eta):
    """Distance of the moment on a held block from the limit at which it is released upwards, or downwards."""
    direction = 1.0 if event == FIRST else -1.0
    # Off its base the block has one weight to overcome, on its base one to either side.
    level = tilt * q.weight if kind == STICK else direction * q.weight
    return q.k - direction * (moment(q, y0, y1, y3, eta) - level)


@compiled
def handle_event(q, event, capture, eta, y, mode):
    """Change the state and the mode at an event of the block; see `tpd.exact.events.watch_block`. Return
    whether the block came to rest there out of hops slower than `capture`: this is how a rattle ends."""
    if mode.kind != SLIP:
        side = 1.0 if event == FIRST else -1.0
        mode.tilt = side if mode.kind == REST else mode.tilt
        mode.kind, mode.direction = SLIP, side
        return False
    if event == FIRST:
        # A turn this low belongs to hops slower than the capture speed, whose height is of its square.
        low = abs(y[TILT]) <= capture * capture
        y[TILT], y[TILT_RATE] = 0.0 if low else y[TILT], 0.0
        decide(q, y, 0.0 if low else mode.tilt, 0.0, eta, mode)
        return low
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
    """How transversally a slipping block meets an event, over what is usual; infinite for other events.
    `rate` is the usual one of the motion, and `now` a state with its accelerations."""
    # The derivative of an event's time has this rate as its denominator: where it vanishes the motion grazes.
    # A crossing after which the block could be held is one of the hops of a rattle. These are as slow as one
    # likes on every orbit that comes to rest, and say nothing about grazing.
    if before != SLIP or after != SLIP:
        return math.inf
    usual = rate * q.weight
    if event == FIRST:
        return abs(now[TILT_PULL]) / (rate * usual)
    return math.inf if held_on_base(q, now[SWING], now[SWING_RATE], eta) else abs(now[TILT_RATE]) / usual
