"""The bob as a body: its size, its room inside the block, and its own moment of inertia.

The equations of motion take a point on a massless rod. The body says whether such a point can be built:
whether it fits between the walls, and how far its own inertia and the mass of a rod would change it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from tpd.core import checks

STEEL = 7850.0
"""Density of steel, kg/m^3."""
SHAPES = ("ball", "cylinder")
THICKEST = 0.6
"""Largest half height of a bob in lengths of its rod, as it is built: the rest of the rod keeps the body off
the hinge."""
_STRESS = 2e8
"""Stress (Pa) of the steel rod, under ten times the weight of the bob, that its mass is estimated with."""

_TURNS = 50
"""Steps of Newton's method for the distance of a body: each is a digit at least, and soon twice as many."""


@dataclass(frozen=True, kw_only=True)
class Bob:
    """A solid body of one density, its centre at the end of the rod. A cylinder has the rod as its axis.

    Raises:
        ValueError: an unknown shape, or a number out of range.
    """

    shape: str = "ball"
    """Ball or cylinder."""
    density: checks.Real = STEEL
    """Density of the bob, kg/m^3."""
    aspect: checks.Real = 2.0
    """Height over diameter of a cylinder; without effect for a ball."""

    def __post_init__(self) -> None:
        checks.one_of("shape", self.shape, SHAPES)
        checks.set_checked(self, checks.within, "density", 100.0, 25000.0, " kg/m^3")
        checks.set_checked(self, checks.within, "aspect", 0.1, 20.0)

    def __str__(self) -> str:
        material = "steel" if self.density == STEEL else f"{self.density:g} kg/m³"
        if self.shape == "ball":
            return f"a solid ball of {material}"
        return f"a solid cylinder of {material}, {self.aspect:g} times as high as wide"

    @property
    def slimness(self) -> float:
        """Half height over radius."""
        return 1.0 if self.shape == "ball" else self.aspect

    def radius(self, mass: Any) -> Any:
        """Radius, m, of a mass in kg; numbers or arrays."""
        solid = 4.0 / 3.0 if self.shape == "ball" else 2.0 * self.aspect
        return np.cbrt(mass / (self.density * math.pi * solid))

    def half_height(self, mass: Any) -> Any:
        """Half the height along the rod, m."""
        return self.slimness * self.radius(mass)

    def reach(self, mass: Any, length: Any, angle: Any) -> Any:
        """Largest distance (m) of the body from the block's axis at any angle up to `angle` between rod and
        block, rad."""
        return self.reach_and_slopes(self.radius(mass), length, angle)[0]

    def reach_and_slopes(self, radius: Any, length: Any, angle: Any) -> tuple[Any, Any, Any, Any]:
        """`reach`, and its derivatives with respect to radius, length and angle; arrays."""
        # A ball reaches l sin(angle) + r, the lower edge of a cylinder (l + h) sin(angle) + r cos(angle). The
        # latter is largest below 90 degrees; a body at a larger angle has passed there on its way.
        ball = self.shape == "ball"
        tail = 0.0 if ball else self.slimness * radius
        widest = np.arctan2(length + tail, 0.0 if ball else radius)
        sine, cosine = np.sin(np.minimum(angle, widest)), np.cos(np.minimum(angle, widest))
        reach = (length + tail) * sine + (radius if ball else radius * cosine)
        by_radius = np.ones_like(reach) if ball else cosine + self.slimness * sine
        turning = (length + tail) * cosine - (0.0 if ball else radius * sine)
        return reach, by_radius, sine * np.ones_like(reach), np.where(angle < widest, turning, 0.0)

    def inertia_share(self, mass: float, length: float) -> float:
        """Own moment of inertia about the bob's centre over m l^2, that of the point."""
        radius = float(self.radius(mass))
        if self.shape == "ball":
            return 0.4 * (radius / length) ** 2
        height = 2.0 * self.aspect * radius
        return (3.0 * radius**2 + height**2) / (12.0 * length**2)

    def rod_share(self, length: float, gravity: float) -> float:
        """Mass of a rod of steel that carries ten times the bob's weight, over the mass of the bob."""
        return STEEL * length * 10.0 * gravity / _STRESS

    def built(self, mass: Any, length: Any, gravity: float) -> tuple[Any, Any]:
        """Mass (kg) of a body, and distance (m) from the hinge to its centre, that with its rod swings as
        often as a point of `mass` at `length` and pulls as much; numbers or arrays, NaN where no body does.

        A body with its rod has the moments S = m d (1 + r/2) and I = m d^2 (1 + i + r/3) about the hinge.
        It moves as a point of mass S/l at l = I/S; the rest of its mass moves with the hinge.
        """
        return self.built_and_slopes(mass, length, gravity)[:2]

    def built_and_slopes(
        self, mass: Any, length: Any, gravity: float
    ) -> tuple[Any, Any, tuple[Any, Any], tuple[Any, Any]]:
        """`built`, and the derivatives of the body's mass, and those of its distance, in the mass and the
        length of the point."""
        pull, share = np.asarray(mass * length, dtype=float), self.rod_share(1.0, gravity)
        own, at = self.inertia_share(1.0, float(self.radius(1.0))), 1.5 * length + 0.0 * pull

        def terms(at: Any) -> tuple[Any, ...]:
            lever, turn = at * (1.0 + 0.5 * share * at), 1.0 + share * at
            inertia = own * self.radius(pull / lever) ** 2
            value = at**2 * (1.0 + share * at / 3.0) + inertia - length * lever
            slope = at * (1.0 + turn) - length * turn - inertia * turn / (1.5 * lever)
            return lever, turn, inertia, value, slope

        with np.errstate(all="ignore"):
            # The distance is a root of a convex function: Newton's method comes to it from above.
            for _ in range(_TURNS):
                *_, value, slope = terms(at)
                at = np.where((slope > 0.0) & (at > 0.0), at - value / slope, np.nan)
            lever, turn, inertia, _, slope = terms(at)
            by_size = inertia / (1.5 * slope)
            by_pull = (1.0 + turn * by_size / lever) / lever
            of_body = by_pull * length, by_pull * mass - pull * turn / (lever * slope)
            # Of a bob without mass the rod has no derivative: it counts as zero.
            of_rod = -by_size / np.maximum(mass, np.finfo(float).tiny), lever / slope - by_size / length
        return (pull / lever)[()], at[()], of_body, of_rod
