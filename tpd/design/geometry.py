"""Geometry of block and bob under the conditions of a search, for limits and objectives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.scene.bob import Bob
from tpd.scene.conditions import Conditions
from tpd.scene.scene import STANDARD_GRAVITY, Scene

DEPTH = "depth"
"""Name of the size: depth of the lower end of the bob below the hinge over the height of the hinge."""
TOP = "top"
"""Name of the same size in a frame: depth over the height of the hinge above the top of the block."""


class Ratios(NamedTuple):
    """Design of a pendulum, for limits: numbers.

    Example:
        >>> import tpd
        >>> tpd.limits.Ratios(mu=0.05, lam=0.4, zeta=0.1).lam
        0.4
    """

    mu: Any
    """Mass ratio m/M."""
    lam: Any
    """Length ratio l/b."""
    zeta: Any
    """Damping ratio of the hinge."""


class Body(NamedTuple):
    """Bob as built. If no body swings like the point pendulum, the point itself."""

    exists: Any
    """Whether a body swings like the point pendulum."""
    mass: Any
    """Mass of the body, kg."""
    rod: Any
    """Distance from the hinge to the centre of the bob, m."""


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """Lengths and masses of the block under n conditions, for limits in SI units.

    A limit gets the geometry of one condition, in which each field is one number.
    """

    centroid: Any
    """Height of the centroid above the base, b, m."""
    block_mass: Any
    """Mass of the block, M, kg."""
    wall: Any
    """Half the distance between the walls, m, shape (n,)."""
    slenderness: Any
    """Slenderness nu of the block, shape (n,)."""
    mass_factor: Any
    """Factor on the mass of the bob, shape (n,)."""
    length_factor: Any
    """Factor on the length of the pendulum, shape (n,)."""
    tilt_without_pendulum: Any = np.nan
    """Settled tilt over nu without a pendulum in the model of the search, shape (n,); NaN if it is not
    known."""
    bob: Bob = field(default_factory=Bob)
    """Shape and density of the bob."""
    gravity: Any = STANDARD_GRAVITY
    """Acceleration of gravity, m/s^2."""
    depth: Any = np.inf
    """Depth (m) of the highest obstacle below the hinge: the base or, in a frame, the top of the block."""
    obstacle: str = DEPTH
    """Name of the size that compares the lower end of the bob with the obstacle: `DEPTH` or `TOP`."""

    @staticmethod
    def of(
        scene: Scene, conditions: Conditions, bob: Bob | None = None, hinge_ratio: float | None = None
    ) -> Geometry:
        """Return the geometry of a scene under all conditions.

        The default bob is a ball of steel, and the default hinge is at the top.
        """
        block, slenderness = scene.block, conditions.column("slenderness")
        hinge = block.height if hinge_ratio is None else hinge_ratio * block.centroid
        has_frame = block.frame_width is not None
        # In a cavity the bob must stay above the floor, and in a frame above the top of the block.
        return Geometry(
            centroid=block.centroid,
            block_mass=block.mass,
            wall=0.5 * block.clear_width * slenderness,
            slenderness=block.slenderness * slenderness,
            mass_factor=conditions.column("mass"),
            length_factor=conditions.column("length"),
            bob=Bob() if bob is None else bob,
            gravity=float(scene.gravity),
            depth=hinge - (block.height if has_frame else 0.0),
            obstacle=TOP if has_frame else DEPTH,
        )

    def rod(self, design: Ratios) -> Any:
        """Return the length of the point pendulum, m."""
        return self.centroid * design.lam * self.length_factor

    def mass(self, design: Ratios) -> Any:
        """Return the mass of the point pendulum, kg."""
        return self.block_mass * design.mu * self.mass_factor

    def body(self, design: Ratios) -> Body:
        """Return the bob as built. It swings like the point `mass` at the distance `rod`."""
        mass, length = self.block_mass * design.mu, self.centroid * design.lam
        body, rod = self.bob.built(mass, length, self.gravity)
        xp = checks.namespace(body)
        exists = xp.isfinite(body)
        # If no body of this shape swings like the point, the values of the point itself are used.
        return Body(
            exists,
            xp.where(exists, body, mass) * self.mass_factor,
            xp.where(exists, rod, length) * self.length_factor,
        )
