"""Bob as a body: its size, its clearance inside the block, and its own moment of inertia.

The equations of motion contain a point on a massless rod. The body determines whether such a point can be
built: whether the bob fits between the walls, and how much its own inertia and the mass of a rod change the
motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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
        return checks.namespace(mass).cbrt(mass / (self.density * math.pi * solid))

    def half_height(self, mass: Any) -> Any:
        """Return half the height along the rod (m) for a mass in kg."""
        return self.slimness * self.radius(mass)

    def reach(self, mass: Any, length: Any, angle: Any) -> Any:
        """Return the largest distance (m) of the body from the axis of the block, up to `angle`.

        The angle (rad) is that between rod and block. Arguments are numbers or arrays.
        """
        # The distance is l sin(angle) + r for a ball, and (l + h) sin(angle) + r cos(angle) for the lower
        # edge of a cylinder. The latter has its maximum below 90 degrees, and a body at a larger angle has
        # passed the maximum.
        xp, radius, ball = checks.namespace(mass, length, angle), self.radius(mass), self.shape == "ball"
        tail, width = (0.0, 0.0) if ball else (self.slimness * radius, radius)
        least = xp.minimum(angle, xp.arctan2(length + tail, width))
        return (length + tail) * xp.sin(least) + (radius if ball else radius * xp.cos(least))

    def inertia_share(self, mass: float, length: float) -> float:
        """Return the moment of inertia of the bob about its centre over m l^2, that of the point."""
        radius = float(self.radius(mass))
        if self.shape == "ball":
            return 0.4 * (radius / length) ** 2
        height = 2.0 * self.aspect * radius
        return (3.0 * radius**2 + height**2) / (12.0 * length**2)

    def rod_share(self, length: Any, gravity: Any) -> Any:
        """Return the mass of a steel rod that carries ten times the weight of the bob, over the mass of the
        bob."""
        return STEEL * length * 10.0 * gravity / _STRESS

    def built(self, mass: Any, length: Any, gravity: Any) -> tuple[Any, Any]:
        """Return the mass (kg) of a body and the distance (m) from the hinge to its centre that replace a
        point.

        The body with its rod has the same frequency and exerts the same forces as a point of `mass` at
        `length`. Arguments are numbers or arrays; the result is NaN if there is no such body.

        A body with its rod has the moments S = m d (1 + r/2) and I = m d^2 (1 + i + r/3) about the hinge. It
        moves like a point of mass S/l at l = I/S. The rest of its mass moves with the hinge.
        """
        # A body has the same pull m l as the point, for any distance of its centre.
        xp, pull, share = checks.namespace(mass, length), mass * length, self.rod_share(1.0, gravity)
        own = self.inertia_share(1.0, float(self.radius(1.0)))

        def lever(at: Any) -> Any:
            return at * (1.0 + 0.5 * share * at)

        def improve(at: Any, pull: Any, length: Any) -> Any:
            inertia, turn = own * self.radius(pull / lever(at)) ** 2, 1.0 + share * at
            value = at**2 * (1.0 + share * at / 3.0) + inertia - length * lever(at)
            slope = at * (1.0 + turn) - length * turn - inertia * turn / (1.5 * lever(at))
            return xp.where((slope > 0.0) & (at > 0.0), at - value / slope, np.nan)

        # The distance is a root of a convex function, and Newton's method approaches the root from above.
        # Arguments without a solution become NaN, without warnings of NumPy.
        with np.errstate(all="ignore"):
            at = _repeat(improve, 1.5 * length + 0.0 * pull, pull, length)
            # At the root the derivative of one more step is that of the root.
            at = improve(at, pull, length)
            return (pull / lever(at))[()], at[()]


def _repeat(step: Callable[..., Any], x: Any, *fixed: Any) -> Any:
    """Return `x` after many steps x = step(x, *fixed), without derivatives."""
    if checks.namespace(x, *fixed) is np:
        for _ in range(_TURNS):
            x = step(x, *fixed)
        return x
    from jax import lax

    x, fixed = lax.stop_gradient((x, fixed))

    def moves(state: tuple[Any, Any, Any]) -> Any:
        i, before, now = state
        return (i < _TURNS) & (abs(now - before) > 1e-16 * now)

    # A loop in JAX has no derivative in reverse mode; the caller makes one from the converged value.
    return lax.while_loop(moves, lambda s: (s[0] + 1, s[2], step(s[2], *fixed)), (0, 2.0 * x, x))[2]
