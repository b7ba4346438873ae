"""Loads on the parts of a pendulum under ground motions, so that somebody can buy them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tpd.analysis.shaking_history import shaking_history
from tpd.core.scene import Pendulum, Scene
from tpd.design.ground.objective import GroundObjective, Runs

_MOTIONS = 24
"""Motions that are followed over time: those with the largest angles between rod and block."""


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Largest loads over the motions in which the block stands; linear equations but for the angle, impacts
    left out."""

    weight: float
    """Weight of the bob on the block's top, N."""
    rod_tension: float
    """Largest force along the rod, N."""
    hinge_force: float
    """Largest force of the hinge on the block, N."""
    damper: float
    """Moment of the hinge's damper per angular rate, N m s/rad."""
    damper_moment: float
    """N m"""
    damper_power: float
    """W"""
    rate: float
    """Largest angular rate between rod and block, rad/s."""
    angle: float
    """Largest angle between rod and block, rad, by the nonlinear equations: it sizes the room."""
    linear_angle: float
    """This angle by the linear equations."""
    motions: int
    """Motions that were followed over time."""


def parts_of(objective: GroundObjective, pendulum: Pendulum, runs: Runs, nonlinear: Runs) -> Parts | None:
    """Loads on a pendulum whose runs, of one design, are known by both sets of equations; None where the
    block stands in none."""
    # A block that falls takes its pendulum along: loads are of those that stand, by both.
    stands = np.isfinite(runs.relative[0]) & np.isfinite(nonlinear.relative[0])
    relative = np.where(stands, runs.relative[0], -1.0)
    order = [int(i) for i in np.argsort(-relative, kind="stable")[:_MOTIONS] if relative[i] >= 0.0]
    if not order:
        return None
    # Each quantity is the largest of all motions; they need not occur at once.
    each = np.array([_loads(objective, pendulum, i) for i in order])
    tension, force, rate = map(float, each.max(axis=0))
    damper = float(pendulum.hinge_damping(objective.gravity))
    return Parts(
        weight=float(pendulum.mass) * objective.gravity,
        rod_tension=tension,
        hinge_force=force,
        damper=damper,
        damper_moment=damper * rate,
        damper_power=damper * rate**2,
        rate=rate,
        angle=float(np.max(nonlinear.relative[0][np.isfinite(nonlinear.relative[0])])),
        linear_angle=float(relative[order[0]]),
        motions=len(order),
    )


def _loads(objective: GroundObjective, pendulum: Pendulum, i: int) -> tuple[float, float, float]:
    """Largest tension, force and rate of the nominal block under the motion of condition i."""
    c = objective.conditions
    motion = c.motions[int(np.asarray(c.which)[i])].scaled(float(objective.factors[i]))
    history = shaking_history(
        Scene(objective.block, motion, objective.gravity), pendulum, free=objective.free
    )
    return history.loads(pendulum)
