"""Data that a report shows beside a design: the pendulum as it is built, with its loads and readings on
site, how the benefit moves with what is not known exactly, motions from rest, responses, and lighter bobs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tpd.answers.response import Response
from tpd.answers.shaking_history import shaking_history
from tpd.answers.statistics import Interval
from tpd.scene.bob import Bob
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import status_name
from tpd.theory import turning_tilts

STANDING = "stood", "rocked"
"""Statuses of a block that stands at the end of a motion."""
_PULLED, _HALF, _MOST = 0.1, 0.5, 400
"""Tilt of a pull test over that of toppling, the share of it that is waited for, and most impacts counted."""


class Loads(NamedTuple):
    """Largest values over the motions in which the block stands, by the linear equations, without impacts.
    They need not occur at once."""

    tension: float
    """Force along the rod, N."""
    hinge: float
    """Force of the hinge on the block, N."""
    rate: float
    """Angular rate between rod and block, rad/s."""
    friction: float
    """Horizontal over vertical force at the base: with a smaller coefficient of friction the base slides."""
    motions: int
    """Motions that were followed over time."""


class PullTest(NamedTuple):
    """The bare block is pulled at its top, released, and left alone: its losses follow from its turns."""

    tilt: float
    """rad; a tenth of that of toppling."""
    sway: float
    """Way of the top, m."""
    force: float
    """Horizontal force at the top that lifts the resting block, N."""
    impacts: int
    """Impacts until the tilt at a turn is at most half of the first; 0 if that takes too many, or friction
    holds the block."""
    seconds: float
    """Time until then."""


class Moved(NamedTuple):
    """Benefit where a quantity is not what it was said to be."""

    name: str
    """Name in `tpd.scene.conditions.FACTORS`; empty where nothing was moved."""
    width: float
    """Share by which it was moved to either side."""
    low: Interval
    """Fall of the mean tilt with the quantity less by its width."""
    high: Interval


@dataclass(frozen=True, kw_only=True)
class Build:
    """A pendulum as it is built; SI units."""

    bob: Bob
    mass: float
    """Mass of the body, kg: a part of it swings as the point of the equations, the rest loads the top; NaN
    where no body does that."""
    dead: float
    """Mass of body and rod that loads the top and does not swing, kg."""
    bob_width: float
    bob_height: float
    rod: float
    """From the hinge to the centre of the bob, that then swings as often as the point of the equations;
    NaN where no rod does that."""
    rod_share: float
    """Mass of a steel rod for ten times the bob's weight, over that of the bob."""
    depth: float
    """From the hinge to the lower end of the bob that hangs."""
    wall: float
    """From the axis of the block to the wall; NaN where no cavity is known."""
    reach: float
    """How far the body comes from the axis in all but the allowed share of the runs of `Design.turned`; NaN
    where none is known."""
    frequency: float
    """Own frequency without the damper in the block that stands, Hz."""
    damping: float
    """Moment of the hinge per angular rate, N m s/rad."""
    rebound: float
    """Angle that the pendulum reaches on the other side after a release, over that of the release."""
    weight: float
    """Weight of the bob on the top of the block, N."""
    loads: Loads | None
    """None where the block stands in none of the motions."""
    lifts: tuple[float, float] | None
    """Acceleration of the base over gravity at which the resting block lifts under the harmonic, with the
    pendulum that has settled and without; None on ground motions."""
    lifts_slow_fast: tuple[float, float]
    """This with the pendulum under shakings that are very slow and very fast for it."""
    pull: PullTest
    moved: tuple[Moved, ...]

    @property
    def damper_moment(self) -> float:
        """Largest moment of the damper, N m; NaN without loads."""
        return self.damping * self.loads.rate if self.loads else math.nan

    @property
    def damper_power(self) -> float:
        """Largest power of the damper, W; NaN without loads."""
        return self.damper_moment * self.loads.rate if self.loads else math.nan


class FrontPoint(NamedTuple):
    """Answer with a bob of at most a mass."""

    most: float
    """kg"""
    status: str
    """Name of the status."""
    pendulum: Pendulum | None
    """None where none is offered."""
    saved: tuple[float, float, float]
    """Share by which the mean tilt falls, and its interval of 95 %, on runs that no choice has seen; NaN
    without a pendulum."""


@dataclass(frozen=True, kw_only=True)
class TimeHistory:
    """One motion from rest under the scene's own shaking, shapes (times,)."""

    with_pendulum: bool
    time: np.ndarray
    """s"""
    tilt: np.ndarray
    """phi, rad; NaN after an overturning, and where the model has no answer."""
    bob: np.ndarray
    """psi, rad."""
    overturned: bool
    """Whether the block overturns."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Everything that a report shows beside the design; None where a part does not apply. A
    design on ground motions has the build and the front alone."""

    build: Build | None = None
    """None where no pendulum is offered."""
    histories: tuple[TimeHistory, ...] | None = None
    """First 24 periods from rest."""
    responses: tuple[Response, ...] | None = None
    """Over frequency from rest: the bare block and, if there is one, the block with the pendulum. Only for
    the scene's own shaking."""
    usage: tuple[tuple[str, float], ...] = ()
    """Limited quantities of the best design over their limits, the largest of all conditions."""
    front: tuple[FrontPoint, ...] = ()


def loads_of(scenes: Sequence[Scene], pendulum: Pendulum) -> Loads | None:
    """Largest loads over the motions of scenes in which the block stands; None where it stands in none."""
    found = [shaking_history(scene, pendulum) for scene in scenes]
    # A block that falls takes its pendulum along.
    stands = [h for h in found if status_name(h.status) in STANDING]
    if not stands:
        return None
    each = np.array([(*h.loads(pendulum), h.needed_friction) for h in stands])
    tension, hinge, rate, friction = map(float, each.max(axis=0))
    return Loads(tension, hinge, rate, friction, len(stands))


def pull_test(scene: Scene) -> PullTest:
    """Pull-and-release test of the bare block: what to expect if it loses as much as was said."""
    block, g = scene.block, float(scene.gravity)
    nu, k = float(block.slenderness), float(block.friction or 0.0)
    tilt, rate, impacts = _PULLED * nu, float(scene.rate), 0
    taus = np.zeros(1)
    if tilt < nu - k:
        turns, taus = turning_tilts(nu, k, float(block.velocity_ratio), tilt, _MOST)
        reached = np.flatnonzero(turns <= _HALF * tilt)
        impacts = int(reached[0]) if reached.size else 0
    return PullTest(
        tilt=tilt,
        sway=tilt * float(block.height),
        # The force acts at twice the height of the weight.
        force=0.5 * (nu + k) * float(block.mass) * g,
        impacts=impacts,
        seconds=float(taus[impacts]) / rate if impacts else math.nan,
    )
