"""The contact between block and base: the moment on a held block, the modes, impacts and releases.

The rules stand here once, for the linear equations (25) and for the nonlinear equations (4). `q.linear` says
which of them a plant belongs to. The impact laws are those of `tpd.scene.impacts`: the linear ones are the
nonlinear ones for a hanging bob.
"""

from __future__ import annotations

import math

import numpy as np

from tpd.compiled.columns import REST, SLIP, STICK, SWING, SWING_RATE, TILT, TILT_RATE
from tpd.compiled.plant import compiled, shared
from tpd.scene import impacts

# Register the impact laws of the package for use in compiled code.
velocity_ratio, bob_change = shared(impacts.velocity_ratio), shared(impacts.bob_change)


@compiled
def excess(q, y0, y1, y3, side, eta):
    """Return the moment on a block that is held still (phi' = 0), minus that of its weight, over M g b.

    The block stays held while friction balances it. `side` is the side of the base about which the weight
    acts. Row 1 of the equations contains psi'', which row 2 gives for phi'' = 0. In (25), f (1 + kappa mu)
    then becomes f, because the bob's share of the forcing accelerates the bob.
    """
    # The signs are those of `tpd.theory`: a positive moment tilts the block to the right.
    weight = side * q.weight
    if q.linear.real != 0.0:
        return q.up * y0 - q.f * eta - (q.up - 1.0) * y1 + q.bias * y3 - weight
    # Lever arms of the rod's pull about the corner, along and across the rod.
    sp, cp, relative = np.sin(y0), np.cos(y0), y0 - y1
    big_s = side * q.nu * np.sin(relative) + q.kappa * np.cos(relative)
    big_c = side * q.nu * np.cos(relative) - q.kappa * np.sin(relative)
    # Acceleration of the bob under a held block, from row 2 of (4).
    swing = (q.f * np.cos(y1) * eta - np.sin(y1) - q.c2 * y3) / q.m22
    on_block = q.up * sp - weight * cp - q.f * eta * (weight * sp + q.up * cp)
    return on_block + q.c1 * y3 - q.pull * big_c * y3 * y3 + q.pull * big_s * swing


@compiled
def sign(x):
    """Return the sign of a number, and 0 for zero."""
    return 0.0 if x == 0.0 else math.copysign(1.0, x)


@compiled
def beyond_return(q):
    """Return the tilt (rad) at which a block counts as overturned.

    In (25) it is so large that no motion returns from it, see `tpd.theory.equations.Linear`.
    """
    return 10.0 * (q.weight + q.k + q.f * q.up) / q.up if q.linear != 0.0 else 0.5 * math.pi


@compiled
def decide(q, y, tilt, direction, eta, mode):
    """Determine the mode of a state and write it into `mode`.

    `tilt` is the sign of phi, 0 on the base, and `direction` the sign of phi', 0 at a turning point. `eta` is
    the forcing.
    """
    lifts = 0.0
    if direction == 0.0:
        # A block that does not move stays held as long as friction balances the excess moment. On the base
        # each direction has another excess, because weight resists both. From the base the block tilts
        # to the side to which it moves.
        side, friction = (1.0 if tilt == 0.0 else tilt), q.k + q.slack
        up = excess(q, y[TILT], y[SWING], y[SWING_RATE], side, eta)
        down = excess(q, y[TILT], y[SWING], y[SWING_RATE], -1.0, eta) if tilt == 0.0 else up
        lifts = 1.0 if up > friction else (-1.0 if down < -friction else 0.0)
    heading = direction if direction != 0.0 else lifts
    held_kind = STICK if tilt != 0.0 else REST
    mode.kind = SLIP if heading != 0.0 else held_kind
    mode.tilt, mode.direction = tilt if tilt != 0.0 else heading, heading


@compiled
def start_mode(q, y, eta, mode):
    """Determine the mode of an initial state and write it into `mode`."""
    decide(q, y, sign(y[TILT]), sign(y[TILT_RATE]), eta, mode)


@compiled
def impact(q, rests, side, psi):
    """Return the changes of phi' and psi' in an impact of a block that lands from a side, divided by phi'
    before it.

    If the block `rests` afterwards, the impact is the last one of a rattle. Each hop of a rattle is smaller
    than the last by a ratio, and infinitely many hops take a finite time. Together they act like one
    perfectly plastic impact, with an error of the order of the square of the rate.
    """
    # In the linear equations the rod hangs vertically at an impact.
    sine, cosine = (0.0 * psi, 0.0 * psi + 1.0) if q.linear.real != 0.0 else (np.sin(psi), np.cos(psi))
    after = velocity_ratio(q.e, q.nu, q.mu, q.lam, q.rho, q.kappa, side, sine, cosine)
    after = 0.0 * after if rests else after
    return after - 1.0, bob_change(after, q.e, q.nu, q.lam, q.kappa, side, sine, cosine)


@compiled
def land(q, y, capture, eta, mode):
    """Change rates and mode at an impact. Return whether the block rests after it, and whether it could.

    A slow impact on a block that can be held ends a rattle: no rate remains.
    """
    # First the question whether the block could be held, with the rates before the impact.
    before, side = y[TILT_RATE], mode.tilt
    decide(q, y, 0.0, 0.0, eta, mode)
    can_rest = mode.kind == REST
    rests = can_rest and abs(before) <= capture
    block, bob = impact(q, rests, side, y[SWING])
    y[TILT_RATE], y[SWING_RATE] = 0.0 if rests else (1.0 + block) * before, y[SWING_RATE] + bob * before
    # The impact changes the rate of the bob, and so the moment on a block that stops.
    decide(q, y, 0.0, sign(y[TILT_RATE]), eta, mode)
    return rests, can_rest


@compiled
def turn(q, y, at_once, eta, mode):
    """Change the mode at a turning point. `at_once` is true if the block was released just before."""
    decide(q, y, mode.tilt, 0.0, eta, mode)
    if at_once and mode.kind == SLIP:
        # The block was released at a moment that only touched the limit. It does not move.
        mode.kind = STICK if y[TILT] != 0.0 else REST
