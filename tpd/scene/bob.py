"""Bob as a body: its size, its clearance inside the block, and its own moment of inertia.

The equations of motion contain a point on a massless rod. The body determines whether such a point can be
built: whether the bob fits between the walls, and how much its own inertia and the mass of a rod change the
motion.
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
"""Shapes of a bob."""
THICKEST = 0.6
"""Largest half height of a bob as built, over the length of its rod. The rest of the rod keeps the body away
from the hinge."""
_STRESS = 2e8
"""Stress (Pa) of the steel rod under ten times the weight of the bob, from which the mass of the rod is
estimated."""

_TURNS = 50
"""Number of steps of Newton's method for the distance of a body. Each step gives at least one digit, and
later steps double the number of digits."""


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class Bob:
    """Solid body of uniform density with its centre at the end of the rod. The rod is the axis of a cylinder.

    The fields are the `shape`, the `density` in kg/m^3, and the `aspect`, height over diameter of a cylinder.

    Raises:
        ValueError: the shape is unknown, or a number is out of range.

    Example:
        >>> import tpd
        >>> bob = tpd.limits.Bob()
        >>> print(bob, round(float(bob.radius(50.0)), 4))
        a solid ball of steel 0.115
    """

    shape: str = "ball"
    """Shape of the bob: ball or cylinder."""
    density: checks.Real = STEEL
    """Density of the bob, kg/m^3."""
    aspect: checks.Real = 2.0
    """Height over diameter of a cylinder; no effect for a ball."""

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
        """Half the height over the radius."""
        return 1.0 if self.shape == "ball" else self.aspect

    def radius(self, mass: Any) -> Any:
        """Return the radius (m) for a mass in kg; numbers or arrays."""
        solid = 4.0 / 3.0 if self.shape == "ball" else 2.0 * self.aspect
        return np.cbrt(mass / (self.density * math.pi * solid))

    def half_height(self, mass: Any) -> Any:
        """Return half the height along the rod (m) for a mass in kg."""
        return self.slimness * self.radius(mass)

    def reach(self, mass: Any, length: Any, angle: Any) -> Any:
        """Return the largest distance (m) of the body from the axis of the block, up to `angle`.

        The angle (rad) is that between rod and block.
        """
        return self.reach_and_slopes(self.radius(mass), length, angle)[0]

    def reach_and_slopes(self, radius: Any, length: Any, angle: Any) -> tuple[Any, Any, Any, Any]:
        """Return `reach` and its derivatives with respect to radius, length and angle; arrays."""
        # The distance is l sin(angle) + r for a ball, and (l + h) sin(angle) + r cos(angle) for the lower
        # edge of a cylinder. The latter has its maximum below 90 degrees, and a body at a larger angle has
        # passed the maximum.
        ball = self.shape == "ball"
        tail = 0.0 if ball else self.slimness * radius
        widest = np.arctan2(length + tail, 0.0 if ball else radius)
        sine, cosine = np.sin(np.minimum(angle, widest)), np.cos(np.minimum(angle, widest))
        reach = (length + tail) * sine + (radius if ball else radius * cosine)
        by_radius = np.ones_like(reach) if ball else cosine + self.slimness * sine
        turning = (length + tail) * cosine - (0.0 if ball else radius * sine)
        return reach, by_radius, sine * np.ones_like(reach), np.where(angle < widest, turning, 0.0)

    def inertia_share(self, mass: float, length: float) -> float:
        """Return the moment of inertia of the bob about its centre over m l^2, that of the point."""
        radius = float(self.radius(mass))
        if self.shape == "ball":
            return 0.4 * (radius / length) ** 2
        height = 2.0 * self.aspect * radius
        return (3.0 * radius**2 + height**2) / (12.0 * length**2)

    def rod_share(self, length: float, gravity: float) -> float:
        """Return the mass of a steel rod that carries ten times the weight of the bob, over the mass of the
        bob."""
        return STEEL * length * 10.0 * gravity / _STRESS

    def built(self, mass: Any, length: Any, gravity: float) -> tuple[Any, Any]:
        """Return the mass (kg) of a body and the distance (m) from the hinge to its centre that replace a
        point.

        The body with its rod has the same frequency and exerts the same forces as a point of `mass` at
        `length`. Arguments are numbers or arrays; the result is NaN if there is no such body.

        A body with its rod has the moments S = m d (1 + r/2) and I = m d^2 (1 + i + r/3) about the hinge. It
        moves like a point of mass S/l at l = I/S. The rest of its mass moves with the hinge.
        """
        return self.built_and_slopes(mass, length, gravity)[:2]

    def built_and_slopes(
        self, mass: Any, length: Any, gravity: float
    ) -> tuple[Any, Any, tuple[Any, Any], tuple[Any, Any]]:
        """Return `built`, and the derivatives of the mass and of the distance of the body.

        The derivatives are with respect to mass and length of the point.
        """
        # A body has the same pull m l as the point, for any distance of its centre.
        pull, share = np.asarray(mass * length, dtype=float), self.rod_share(1.0, gravity)
        own, at = self.inertia_share(1.0, float(self.radius(1.0))), 1.5 * length + 0.0 * pull

        def terms(at: Any) -> tuple[Any, ...]:
            lever, turn = at * (1.0 + 0.5 * share * at), 1.0 + share * at
            inertia = own * self.radius(pull / lever) ** 2
            value = at**2 * (1.0 + share * at / 3.0) + inertia - length * lever
            slope = at * (1.0 + turn) - length * turn - inertia * turn / (1.5 * lever)
            return lever, turn, inertia, value, slope

        # Arguments without a solution become NaN, without warnings of NumPy.
        with np.errstate(all="ignore"):
            # The distance is a root of a convex function, and Newton's method approaches the root from above.
            for _ in range(_TURNS):
                *_, value, slope = terms(at)
                at = np.where((slope > 0.0) & (at > 0.0), at - value / slope, np.nan)
            lever, turn, inertia, _, slope = terms(at)
            # Derivatives by the implicit function theorem at the root.
            by_size = inertia / (1.5 * slope)
            by_pull = (1.0 + turn * by_size / lever) / lever
            of_body = by_pull * length, by_pull * mass - pull * turn / (lever * slope)
            # For a bob without mass the rod has no derivative; it counts as zero.
            of_rod = -by_size / np.maximum(mass, np.finfo(float).tiny), lever / slope - by_size / length
        return (pull / lever)[()], at[()], of_body, of_rod
