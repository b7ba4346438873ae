"""Block, base motion and pendulum in SI units, and the dimensionless parameters that follow from them.

Every class here is a pytree whose leaves are its numbers (`tpd.scene.pytrees`): `jax.grad`, `jax.jit` and
`jax.vmap` take a whole `Block`, `Harmonic`, `Pendulum` or `Scene` as an argument. Plain numbers and arrays
are checked when an object is made; traced values pass unchecked. Symbols are those of the paper's (1) to (6)
and (25).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.core.checks import Real
from tpd.scene.ground_motion import FREQUENCIES, STANDARD_GRAVITY, GroundMotion
from tpd.scene.impacts import housner
from tpd.scene.parameters import SLENDERNESS_LIMIT, Parameters, uniform_inertia_ratio

HOUSNER = "housner"
"""Value of `Block.restitution` that ties e to block and bob by `tpd.scene.impacts.housner`."""
LEAST_SLENDERNESS = 0.01
"""Least width over height of a block: below it one of both is in another unit."""
DENSITIES = (10.0, 5e5)
"""Plausible kg/m^3 of a block that is as deep as it is wide. Hollow blocks and walls, which are deeper, lie
within; lengths in mm or cm, and masses in t or g, do not."""
LARGEST_SHAKING = 10.0
"""Largest plausible acceleration of a harmonic base motion, in shares of the standard gravity. The strongest
motions on record reach a few g."""
LARGEST_COEFFICIENT = 2.0
"""Largest plausible coefficient of friction: that of rubber on concrete is about 1."""
LEAST_GYRATION = 0.01
"""Least radius of gyration of a block, as a share of half its diagonal."""
HEAVIEST, LENGTHS = 1e12, (1e-6, 1e6)
"""Largest mass (kg) of a pendulum, and its least and largest length (m)."""
LARGEST_DAMPING = 2.0
"""Largest damping ratio of a hinge, as in a design space: a ratio, and no per cent."""
GRAVITIES = (1.5, 30.0)
"""Plausible m/s^2: the Moon's lies within, 1 g as a number, 981 cm/s^2 and 32.2 ft/s^2 do not."""


def _convert_numbers(thing: Any) -> None:
    """Turn the numbers among the fields of a frozen dataclass into floats, and the arrays into plain ones."""
    # `jax.grad` refuses integers, and `Block(width=1, ...)` means a metre.
    checks.set_checked(thing, checks.plain, " ".join(f.name for f in fields(thing)))


@dataclass(frozen=True, kw_only=True)
class Block:
    """A rigid block, its base 2a wide and 2b high in the paper's symbols.

    By default it loses energy at impacts alone, as a rigid block on a rigid base does in Housner's model.

    Raises:
        ValueError: a size, mass, friction or restitution out of range, a block too wide for linear equations
            or implausibly narrow, or a mass that is implausible for the size.
    """

    width: Real
    """Whole width of the base, m."""
    height: Real
    """Whole height of the block, m; the pendulum hangs from the middle of the top."""
    mass: Real
    """Mass of the block, kg."""
    friction: Real = 0.0
    """k: dry friction moment of the rocking contact over M g b, dimensionless."""
    radius_of_gyration: Real | None = None
    """Radius of gyration about the centroid, m. None is that of a uniform rectangle, which follows `width`
    and `height` in gradients."""
    restitution: Real | str = HOUSNER
    """e: velocity ratio across an impact of the base, in (0, 1], with whatever pendulum hangs in the block.
    "housner" ties it to the block's shape and to the mass ratio of bob and block, also in gradients. 1 is no
    impact loss."""
    cavity_width: Real | None = None
    """Width (m) of the space inside the block in which the bob swings. None is not stated: a search that asks
    for room then asks for it."""
    base_friction: Real | None = None
    """Coefficient of friction between the base and what it stands on, dimensionless. None is not known. It
    decides whether the block slides before it rocks, and changes no motion."""

    def __post_init__(self) -> None:
        _convert_numbers(self)
        for name in ("width", "height", "mass"):
            checks.positive(name, getattr(self, name), every=True)
        check_proportions(self.width, self.height, self.mass)
        self._check_losses()
        if self.radius_of_gyration is not None:
            checks.positive("radius_of_gyration", self.radius_of_gyration, every=True)
            # No body has more: all of its mass would lie in the corners.
            most = 0.5 * (self.width**2 + self.height**2) ** 0.5
            checks.at_most(
                "radius_of_gyration", self.radius_of_gyration, most, "half the diagonal of the block"
            )
            if checks.is_concrete(most) and np.any(self.radius_of_gyration < LEAST_GYRATION * most):
                raise ValueError(
                    f"`radius_of_gyration` must be at least {LEAST_GYRATION:g} of half the diagonal of the "
                    f"block, but is {np.min(self.radius_of_gyration):g} m"
                )
        self._check_cavity()
        if self.base_friction is not None:
            checks.positive("base_friction", self.base_friction, 0.0, LARGEST_COEFFICIENT, every=True)
        if checks.is_concrete(self.slenderness) and np.any(self.slenderness > SLENDERNESS_LIMIT):
            raise ValueError(
                f"`width` must be at most {SLENDERNESS_LIMIT:g} of `height` (the linear equations "
                f"drop terms of order (width/height)**2), but is {np.max(self.slenderness):g} of it"
            )

    def _check_losses(self) -> None:
        if self.restitution is None or isinstance(self.restitution, str):
            if self.restitution != HOUSNER:
                raise ValueError(
                    f"`restitution` must be a number or {HOUSNER!r}, but is {self.restitution!r}"
                )
        else:
            checks.positive("restitution", self.restitution, 0.0, 1.0, every=True)
        checks.not_negative("friction", self.friction, every=True)
        # The moment of the block's weight about its corner is M g a = nu M g b, and it falls with the tilt:
        # a greater friction moment holds the block at any tilt, so that it neither falls back nor over.
        checks.at_most(
            "friction",
            self.friction,
            self.slenderness,
            "width/height (a moment over M g b, no coefficient of sliding; a greater one holds the block at "
            "any tilt)",
        )

    def _check_cavity(self) -> None:
        if self.cavity_width is None:
            return
        checks.positive("cavity_width", self.cavity_width, every=True)
        if all(map(checks.is_concrete, (self.cavity_width, self.width))) and np.any(
            np.asarray(self.cavity_width) >= self.width
        ):
            raise ValueError(
                f"`cavity_width` must be less than the outside width, {np.max(self.width):g} m (walls of no "
                f"thickness cannot be built), but is {np.max(self.cavity_width):g} m"
            )

    @property
    def clear_width(self) -> Real:
        """Width (m) between the walls that the bob swings within; infinite where no cavity is stated, so that
        nothing is known of walls."""
        return math.inf if self.cavity_width is None else self.cavity_width

    @property
    def half_height(self) -> Real:
        """b, m."""
        return 0.5 * self.height

    @property
    def slenderness(self) -> Real:
        """nu = a/b."""
        return self.width / self.height

    @property
    def inertia_ratio(self) -> Real:
        """rho = b^2/(a^2 + b^2 + c^2), with c the radius of gyration."""
        return _inertia_ratio(self.width, self.height, self.radius_of_gyration)

    @property
    def velocity_ratio(self) -> Real:
        """e of the bare block: the restitution as a number; 1 without impact loss."""
        if isinstance(self.restitution, str):
            return housner(self.slenderness, self.inertia_ratio)
        return self.restitution


@dataclass(frozen=True, kw_only=True)
class Pendulum:
    """A point bob on a rod from the middle of the block's top.

    Raises:
        ValueError: a mass, length or damping ratio out of range.
    """

    mass: Real
    """kg; 0 is no pendulum."""
    length: Real
    """m"""
    damping_ratio: Real
    """zeta: share of critical damping of the pendulum hung from a fixed point."""

    def __post_init__(self) -> None:
        _convert_numbers(self)
        checks.not_negative("mass", self.mass, 0.0, HEAVIEST, " kg", every=True)
        checks.positive("length", self.length, *LENGTHS, " m", every=True)
        checks.not_negative("damping_ratio", self.damping_ratio, every=True)
        check_damping("damping_ratio", self.damping_ratio)

    def hinge_damping(self, gravity: Real = STANDARD_GRAVITY) -> Real:
        """Moment of the hinge per angular rate, N m s/rad: 2 zeta m l^1.5 g^0.5."""
        gravity = checks.positive("gravity", gravity)
        return 2.0 * self.damping_ratio * self.mass * self.length**1.5 * gravity**0.5


@dataclass(frozen=True, kw_only=True)
class Harmonic:
    """Horizontal base motion x = amplitude sin(2 pi frequency t).

    Raises:
        ValueError: an amplitude or frequency out of range, or an implausible acceleration of both.
    """

    amplitude: Real
    """Amplitude of the base motion, m."""
    frequency: Real
    """Frequency of the base motion, Hz."""

    def __post_init__(self) -> None:
        _convert_numbers(self)
        checks.not_negative("amplitude", self.amplitude, every=True)
        checks.positive("frequency", self.frequency, *FREQUENCIES, " Hz", every=True)
        check_excitation(self.amplitude, self.frequency)

    @property
    def rate(self) -> Real:
        """omega, rad/s."""
        return 2.0 * math.pi * self.frequency


@dataclass(frozen=True)
class Scene:
    """A block and the motion of its base: a `Harmonic`, a `Pulse` or a `Record`.

    `parameters` makes it dimensionless under a harmonic, and `ground_parameters` under any other motion.

    Raises:
        ValueError: an object of another class, or a gravity out of range.
    """

    block: Block
    motion: Any
    """A `Harmonic`, a `Pulse` or a `Record`."""
    gravity: Real = STANDARD_GRAVITY
    """Gravity, m/s^2."""

    def __post_init__(self) -> None:
        _convert_numbers(self)
        checks.instance("block", self.block, Block)
        checks.instance("motion", self.motion, (Harmonic, GroundMotion))
        told = " m/s^2 (the Earth's is 9.80665)"
        checks.positive("gravity", self.gravity, *GRAVITIES, told, every=True)

    @property
    def rate(self) -> Real:
        """omega0 = sqrt(g rho / b), rad/s: dimensionless time is tau = omega0 t."""
        return _rate(self.gravity, self.block.inertia_ratio, self.block.half_height)

    @property
    def peak(self) -> Real:
        """Largest acceleration of the base over that of gravity, f."""
        motion = self.motion
        largest = motion.amplitude * motion.rate**2 if isinstance(motion, Harmonic) else motion.pga
        return largest / self.gravity

    @property
    def uplift(self) -> Real:
        """Acceleration of the base over that of gravity which lifts the resting block without a pendulum,
        nu + k, see (5)."""
        return self.block.slenderness + self.block.friction

    def parameters(self, pendulum: Pendulum | None = None) -> Parameters:
        """Return the dimensionless parameters with a pendulum, or of the bare block (mu = 0).

        Differentiable with respect to the scene and the pendulum: every dependence on an SI quantity is
        followed. In the parameters themselves rho is None (tied to nu) for a uniform rectangle, and e is None
        (tied to nu, rho and mu) for Housner's restitution.

        Raises:
            ValueError: a motion that is not harmonic, a bob heavier than the block, or a rod longer than it.
        """
        checks.instance("motion", self.motion, Harmonic, ": other motions are for `tpd.transient`")
        return Parameters(**dimensionless(self.quantities(pendulum)))

    def ground_parameters(self, pendulum: Pendulum | None = None) -> Parameters:
        """Return the dimensionless parameters under a pulse or a record: f is its largest acceleration over
        that of gravity, and 2 pi/xi the dimensionless duration of one of its pieces. Otherwise as
        `parameters`.

        Raises:
            ValueError: a harmonic, a bob heavier than the block, or a rod longer than it.
        """
        checks.instance("motion", self.motion, GroundMotion, ": harmonics are for `tpd.steady_state`")
        return Parameters(**dimensionless(self.quantities(pendulum)))

    def quantities(self, pendulum: Pendulum | None = None) -> dict[str, Any]:
        """Return the SI quantities that `parameters` depends on, by name. Those of the pendulum begin with
        `pendulum_`; without one its mass is zero. Housner's restitution is left out, since it depends on the
        others.

        Raises:
            ValueError: a bob heavier than the block, or a rod longer than it.
        """
        block, motion = self.block, self.motion
        if pendulum is not None:
            checks.instance("pendulum", pendulum, Pendulum)
            checks.at_most("pendulum.mass", pendulum.mass, block.mass, "the mass of the block")
            checks.at_most("pendulum.length", pendulum.length, block.height, "the height of the block")
        # At mu = 0 the bob does not act on the block, but the equations of the pair still contain its length:
        # any usual value serves.
        with_it = (
            Pendulum(mass=0.0, length=block.half_height, damping_ratio=0.3) if pendulum is None else pendulum
        )
        own = {} if block.radius_of_gyration is None else {"radius_of_gyration": block.radius_of_gyration}
        shaking = (
            {"amplitude": motion.amplitude, "frequency": motion.frequency}
            if isinstance(motion, Harmonic)
            else {"peak": motion.pga, "frequency": 1.0 / motion.piece}
        )
        lost = {} if isinstance(block.restitution, str) else {"restitution": block.velocity_ratio}
        return {
            "width": block.width,
            "height": block.height,
            "mass": block.mass,
            "friction": block.friction,
            **lost,
            **own,
            **shaking,
            "gravity": self.gravity,
            "pendulum_mass": with_it.mass,
            "pendulum_length": with_it.length,
            "pendulum_damping": with_it.damping_ratio,
        }

    def pendulum(self, *, mass_ratio: Real, length_ratio: Real, damping_ratio: Real) -> Pendulum:
        """Return the pendulum in SI units that has these mu, lam and zeta."""
        mass_ratio = checks.not_negative("mass_ratio", mass_ratio, every=True)
        length_ratio = checks.not_negative("length_ratio", length_ratio, every=True)
        return Pendulum(
            mass=mass_ratio * self.block.mass,
            length=length_ratio * self.block.half_height,
            damping_ratio=damping_ratio,
        )


def check_proportions(width: Any, height: Any, mass: Any) -> None:
    """Raise `ValueError` for sizes and a mass that no block has together: a quantity in another unit. Traced
    values pass.

    Args:
        width, height: of the block, m.
        mass: of the block, kg.
    """
    if not all(map(checks.is_concrete, (width, height, mass))):
        return
    width, height, mass = np.broadcast_arrays(width, height, mass)
    narrow = width < LEAST_SLENDERNESS * height
    if np.any(narrow):
        wide, high = width[narrow][0], height[narrow][0]
        raise ValueError(
            f"`width` must be at least {LEAST_SLENDERNESS:g} of `height`, but is {wide:g} m of {high:g} m: "
            "are both in m?"
        )
    with np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore"):
        density = mass / (width**2 * height)
    beyond = ~((density >= DENSITIES[0]) & (density <= DENSITIES[1]))
    if np.any(beyond):
        wide, high, heavy, of = (float(x[beyond][0]) for x in (width, height, mass, density))
        raise ValueError(
            f"`mass` must make between {DENSITIES[0]:g} and {DENSITIES[1]:g} kg/m^3 of a block as deep as "
            f"it is wide, but {heavy:g} kg in {wide:g} m x {high:g} m make {of:.3g} kg/m^3: are the lengths "
            "in m and the mass in kg?"
        )


def check_excitation(amplitude: Any, frequency: Any) -> None:
    """Raise `ValueError` for a harmonic base motion of an acceleration that no ground has. Traced values
    pass.

    Args:
        amplitude: m.
        frequency: Hz.
    """
    if not all(map(checks.is_concrete, (amplitude, frequency))):
        return
    amplitude, frequency = np.broadcast_arrays(amplitude, frequency)
    # A frequency beyond the range of numbers is refused as any other that is too large.
    with np.errstate(over="ignore"):
        shares = amplitude * (2.0 * np.pi * frequency) ** 2 / STANDARD_GRAVITY
    i = np.unravel_index(np.argmax(shares), shares.shape)
    if shares[i] > LARGEST_SHAKING:
        raise ValueError(
            f"`amplitude` and `frequency` must make at most {LARGEST_SHAKING:g} g, but {amplitude[i]:g} m at "
            f"{frequency[i]:g} Hz make {shares[i]:.3g} g: are they in m and Hz?"
        )


def check_damping(name: str, value: Any) -> None:
    """Raise `ValueError` for a damping ratio that is a per cent. Traced values pass."""
    checks.at_most(name, value, LARGEST_DAMPING, "twice critical damping (a ratio: 5 % is 0.05)")


def dimensionless(q: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters, by name and unchecked, of `Scene.quantities`: numbers, arrays that broadcast, or
    traced values. rho is None without a `radius_of_gyration`, e without a `restitution`."""
    half_height, radius = 0.5 * q["height"], q.get("radius_of_gyration")
    rho = _inertia_ratio(q["width"], q["height"], radius)
    nu = q["width"] / q["height"]
    rate = _rate(q["gravity"], rho, half_height)
    omega = 2.0 * math.pi * q["frequency"]
    peak = q["peak"] if "peak" in q else q["amplitude"] * omega * omega
    # The paper's (25) takes lam as l/b; its Table 1 lists l/(2b), half of it.
    return {
        "nu": nu,
        "mu": q["pendulum_mass"] / q["mass"],
        "lam": q["pendulum_length"] / half_height,
        "zeta": q["pendulum_damping"],
        "k": q["friction"],
        "f": peak / q["gravity"],
        "xi": omega / rate,
        # None keeps rho and e tied to the other parameters where these are varied later.
        "rho": None if radius is None else rho,
        "e": q.get("restitution"),
    }


def _inertia_ratio(width: Any, height: Any, radius: Any) -> Any:
    if radius is None:
        return uniform_inertia_ratio(width / height)
    a, b = 0.5 * width, 0.5 * height
    return b**2 / (a**2 + b**2 + radius**2)


def _rate(gravity: Any, rho: Any, half_height: Any) -> Any:
    return (gravity * rho / half_height) ** 0.5


def paper_scene() -> Scene:
    """Return the case study of Collini et al. (2016), section 5: a block of 0.1 x 0.2 x 0.4 m and
    2028 kg/m^3 on a base moving 15 mm at 2.5 Hz; friction as in the paper's section 3, and no impact loss.
    The paper states no cavity: the one of 80 mm here leaves walls of 10 mm."""
    return Scene(
        Block(width=0.1, height=0.4, mass=16.224, friction=0.05, restitution=1.0, cavity_width=0.08),
        Harmonic(amplitude=0.015, frequency=2.5),
    )
