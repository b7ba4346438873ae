"""Block, excitation and pendulum in SI units, and the dimensionless parameters that follow from them.

Every class here is a pytree whose leaves are its numbers (`tpd.scene.pytrees`): `jax.grad`, `jax.jit` and
`jax.vmap` accept a whole `Block`, `Harmonic`, `Pendulum` or `Scene` as an argument. Plain numbers and arrays
are checked when an object is made. Traced values are not checked. Symbols are those of the equations (1) to
(6) and (25) of the paper.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from tpd.core import checks
from tpd.core.checks import Real
from tpd.core.formatting import called, number
from tpd.scene.ground_motion import FREQUENCIES, STANDARD_GRAVITY, GroundMotion
from tpd.scene.impacts import housner
from tpd.scene.parameters import HIGHEST_HINGE, SLENDERNESS_LIMIT, Parameters, uniform_inertia_ratio

HOUSNER = "housner"
"""Value of `Block.restitution` for which e follows from block and bob by `tpd.scene.impacts.housner`."""
NO_PENDULUM = 0.0, 1.0, 0.3
"""Ratios (mu, lam, zeta) of the block without a pendulum: a bob without mass does not act on the block. The
equations still contain its length, which must not be zero. Any usual value serves."""
LEAST_SLENDERNESS = 0.01
"""Smallest width over height of a block. For a smaller ratio, width and height are probably in different
units."""
DENSITIES = (10.0, 5e5)
"""Plausible density, kg/m^3, of a block whose depth equals its width. Hollow blocks and walls, which are
deeper, lie within the range. Lengths in mm or cm, and masses in t or g, lie outside."""
LARGEST_COEFFICIENT = 2.0
"""Largest plausible coefficient of friction; that of rubber on concrete is about 1."""
CENTROIDS = (0.1, 0.9)
"""Smallest and largest height of the centroid, as shares of the height of the block."""
SHAPE = "radius_of_gyration", "centroid_height", "effective_width"
"""Fields of a block with which it is no uniform rectangle."""
LEAST_GYRATION = 0.2
"""Smallest radius of gyration of a block, as a share of the largest possible one. A uniform rectangle has
0.58, and a block with most of its mass near the centroid about half of that."""
DENSEST_WALLS = 5e4
"""Largest plausible density, kg/m^3, of the walls around a cavity in a block whose depth equals its width. A
block of stone may be twenty times as deep."""
HEAVIEST, LENGTHS = 1e12, (1e-6, 1e6)
"""Largest mass (kg) of a pendulum, and its smallest and largest length (m)."""
LARGEST_DAMPING = 2.0
"""Largest damping ratio of a hinge. A larger value is probably in percent."""
GRAVITIES = (1.5, 30.0)
"""Plausible acceleration of gravity, m/s^2. The value of the Moon lies within the range; 1 (in g), 981 (in
cm/s^2) and 32.2 (in ft/s^2) lie outside."""


def _convert_numbers(thing: Any) -> None:
    """Convert the numbers among the fields of a frozen dataclass to floats, and the arrays to plain
    arrays."""
    for f in fields(thing):
        if f.default is MISSING and getattr(thing, f.name) is None:
            use = "`in_axes` of `jax.vmap` must be 0, with an array in every field"
            raise ValueError(f"`{f.name}` must be a number, but is None: {use}")
    # `jax.grad` does not accept integers, but a user may write `Block(width=1, ...)`.
    checks.set_checked(thing, checks.plain, " ".join(f.name for f in fields(thing)))


@dataclass(frozen=True, kw_only=True)
class Block:
    """Rigid block with a base of width 2a, whose centroid is at the height b, in the symbols of the paper.

    By default the block loses energy only at impacts, like a rigid block on a rigid base in Housner's model.
    The centroid lies on the middle line, at half the height unless `centroid_height` is stated.

    Attributes:
        width: width of the base, m.
        height: height of the block, m.
        mass: mass of the block, kg.
        friction: dry friction moment k over M g b, dimensionless; default 0.
        radius_of_gyration: about the centroid, m; default that of a uniform rectangle.
        centroid_height: height of the centroid above the base, m; default half the height.
        restitution: coefficient of restitution e at an impact, in (0, 1], or "housner" (default).
        cavity_width: width of the space in which the bob swings, m; default not stated.
        frame_width: clear width of a frame above the block, instead of a cavity, m; default no frame.
        base_friction: coefficient of friction of the base, dimensionless; default not known.
        effective_width: share of the width on which the block rocks, 0.2 to 1; default all of it.

    Raises:
        ValueError: a size, mass, friction or restitution is out of range, the block is too wide for the
            linear model or implausibly narrow, or the mass is implausible for the size.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=0.5, height=1.5, mass=900.0)
        >>> round(block.slenderness, 4), round(block.velocity_ratio, 4)
        (0.3333, 0.85)
    """

    width: Real
    """Full width of the base, m."""
    height: Real
    """Full height of the block, m; the hinge of the pendulum is at the middle of the top unless its height is
    stated."""
    mass: Real
    """Mass of the block, kg."""
    friction: Real = 0.0
    """k: dry friction moment of the rocking contact over M g b, dimensionless."""
    radius_of_gyration: Real | None = None
    """Radius of gyration about the centroid, m (default: that of a uniform rectangle). Gradients then include
    its dependence on `width` and `height`."""
    centroid_height: Real | None = None
    """Height of the centroid above the base, m (default: half the height). With another height the block is
    no uniform rectangle, and needs a `radius_of_gyration`."""
    restitution: Real | str = HOUSNER
    """e: ratio of the angular velocities after and before an impact of the base, a number in (0, 1], where 1
    means no loss, or "housner" (the default), which follows from block and bob. Housner's r is the ratio of
    the energies, e^2: state its square root. "housner" depends on the shape of the block and on the mass
    ratio of bob and block, also in gradients. A number applies with any pendulum."""
    cavity_width: Real | None = None
    """Width (m) of the space inside the block in which the bob swings. Default: not stated; a search with a
    limit on the clearance then requires it."""
    frame_width: Real | None = None
    """Clear width (m) of a frame or mast above the block in which the bob swings, instead of a cavity. It may
    be wider than the block, and its mass belongs to the block. The hinge is then above the block, and the bob
    must not reach down to its top. Default: no frame."""
    base_friction: Real | None = None
    """Coefficient of friction between the base and the ground, dimensionless. It decides whether the block
    slides before it rocks, and does not change any motion. Default: not known."""
    effective_width: Real | None = None
    """Share of `width` on which the block rocks, 0.2 to 1. A base with worn edges or a soft bearing rocks on
    corners that lie inside: four wooden blocks had shares from 0.70 to 0.91 in tests. It changes nu, rho and
    Housner's e, but not the mass, the cavity or the drawing. Default: the whole width, as with 1."""

    def __post_init__(self) -> None:
        _convert_numbers(self)
        for name in ("width", "height", "mass"):
            checks.positive(name, getattr(self, name), every=True)
        check_proportions(self.width, self.height, self.mass)
        if self.effective_width is not None:
            # A smaller share is probably a width in m.
            checks.within("effective_width", self.effective_width, 0.2, 1.0, every=True)
            # With the whole width rho of a uniform rectangle follows nu, see `dimensionless`.
            if checks.is_concrete(self.effective_width) and np.all(self.effective_width == 1.0):
                object.__setattr__(self, "effective_width", None)
        if self.centroid_height is not None:
            check_centroid(self.centroid_height, self.height, self.radius_of_gyration)
        self._check_losses()
        # A block that is not a uniform rectangle states its radius of gyration.
        if (radius := self.radius_of_gyration) is not None:
            checks.positive("radius_of_gyration", radius, every=True)
            # The radius is largest if all of the mass is in the corners, divided between top and base so that
            # the centroid has its height.
            z, of = self.centroid, "that of a mass in the corners"
            most = (0.25 * self.width**2 + z * (self.height - z)) ** 0.5
            checks.at_most("radius_of_gyration", radius, most, of)
            if checks.is_concrete(most) and np.any(radius < LEAST_GYRATION * most):
                wrong = f"`radius_of_gyration` must be at least {LEAST_GYRATION:g} of {of}"
                raise ValueError(f"{wrong}, but is {np.min(radius):g} m: is it that of the cross-section?")
        self._check_cavity()
        if self.base_friction is not None:
            checks.positive("base_friction", self.base_friction, 0.0, LARGEST_COEFFICIENT, every=True)
        if checks.is_concrete(self.slenderness) and np.any(self.slenderness > SLENDERNESS_LIMIT):
            raise ValueError(
                f"`width` must be at most {SLENDERNESS_LIMIT:g} of `height`, or of twice `centroid_height` "
                "(the linear model neglects terms of the order of its square), but is "
                f"{np.max(self.slenderness):g} of it"
                + (": are width and height exchanged?" if np.any(self.slenderness > 1.0) else "")
            )

    def _check_losses(self) -> None:
        """Check restitution and friction."""
        # The only text that is allowed is "housner": any other text is a misspelling.
        if self.restitution is None or isinstance(self.restitution, str):
            if self.restitution != HOUSNER:
                allowed = f"a number or {HOUSNER!r}"
                raise ValueError(f"`restitution` must be {allowed}, but is {self.restitution!r}")
        else:
            checks.positive("restitution", self.restitution, 0.0, 1.0, every=True)
        checks.not_negative("friction", self.friction, every=True)
        # The moment of the weight about a corner is M g a = nu M g b, and it decreases with the tilt. A
        # larger friction moment would hold the block at any tilt, so it neither returns nor overturns.
        meaning = "it is a moment over M g b, and a larger one holds the block at any tilt"
        most = f"width/height ({meaning}; the coefficient of sliding friction is `base_friction`)"
        checks.at_most("friction", self.friction, self.slenderness, most)

    def _check_cavity(self) -> None:
        """Check the widths of cavity and frame."""
        if self.frame_width is not None:
            checks.positive("frame_width", self.frame_width, *LENGTHS, " m", every=True)
        if self.cavity_width is None:
            return
        if self.frame_width is not None:
            other = called("frame_width")
            raise ValueError(
                f"`cavity_width` must not be stated with {other}: the bob swings in a cavity or in a frame"
            )
        checks.positive("cavity_width", self.cavity_width, every=True)
        sizes = self.width, self.cavity_width, self.height, self.mass
        # Traced values cannot be compared, and pass.
        if not all(map(checks.is_concrete, sizes)):
            return
        wide, hollow, high, mass = np.broadcast_arrays(*sizes)
        if np.any(hollow >= wide):
            most = f"the width of the block, {np.max(wide):g} m, because the walls have a thickness"
            raise ValueError(f"`cavity_width` must be less than {most}, but is {np.max(hollow):g} m")
        density = np.max(mass / ((wide**2 - hollow**2) * high))
        if density > DENSEST_WALLS:
            raise ValueError(
                f"`cavity_width` must leave walls of at most {DENSEST_WALLS:g} kg/m^3 (in a block as deep as "
                f"it is wide), but the walls around {np.max(hollow):g} m have {density:.3g} kg/m^3"
            )

    @property
    def clear_width(self) -> Real:
        """Distance (m) between the walls of cavity or frame on both sides of the bob; infinite without."""
        stated = self.cavity_width if self.frame_width is None else self.frame_width
        return math.inf if stated is None else stated

    def check_hinge(self, height: Real | None) -> None:
        """Raise `ValueError` if a hinge at a height (m; None for the top) does not fit the block's frame."""
        if self.frame_width is not None and (height is None or np.any(height <= self.height)):
            stated = "the top" if height is None else f"{np.min(height):g} m"
            top = f"above the top of the block, {np.max(self.height):g} m"
            raise ValueError(f"{called('hinge_height')} must be {top}, in its frame, but is {stated}")

    @property
    def centroid(self) -> Real:
        """Height of the centroid above the base, b, m: `centroid_height`, or half the height."""
        return _centroid(vars(self))

    @property
    def base_width(self) -> Real:
        """Width on which the block rocks, 2a, m."""
        return self.width if self.effective_width is None else self.width * self.effective_width

    @property
    def slenderness(self) -> Real:
        """Slenderness nu = a/b."""
        return self.base_width / (2.0 * self.centroid)

    @property
    def inertia_ratio(self) -> Real:
        """Inertia ratio rho = b^2/(a^2 + b^2 + c^2), with the radius of gyration c about the centroid."""
        return _inertia_ratio(vars(self))

    @property
    def gyration(self) -> Real:
        """Radius of gyration about the centroid, m, as stated or of a uniform rectangle."""
        return self.centroid * (1.0 / self.inertia_ratio - 1.0 - self.slenderness**2) ** 0.5

    def carrying(self, pendulum: Pendulum) -> Block:
        """Return the heavier rigid block that carries the bob below its hinge, as if the hinge was stuck.

        Example:
            >>> import tpd
            >>> block = tpd.Block(width=0.5, height=1.5, mass=900.0)
            >>> stuck = block.carrying(tpd.Pendulum(mass=100.0, length=0.5, damping_ratio=0.1))
            >>> stuck.mass, stuck.centroid
            (1000.0, 0.775)
        """
        # The bob at rest hangs below its hinge. Its own moment of inertia is that of a point.
        bob = pendulum.hinge_in(self) - pendulum.length
        mass = self.mass + pendulum.mass
        z = (self.mass * self.centroid + pendulum.mass * bob) / mass
        square = self.mass * (self.gyration**2 + (self.centroid - z) ** 2) + pendulum.mass * (bob - z) ** 2
        own = {"mass": mass, "centroid_height": z, "radius_of_gyration": (square / mass) ** 0.5}
        # The height only bounds the place of the mass. The moment of friction k M g b stays as it is.
        high, k = self.height, self.friction * self.mass * self.centroid / (mass * z)
        high = high if checks.is_traced(z) else np.maximum(np.maximum(high, bob), z / CENTROIDS[1])[()]
        return replace(self, height=high, friction=k, **own)

    def widened(self, factor: Real) -> Block:
        """Return the block with a base that is wider by a factor, for example 1.1 for 10 %.

        The whole block becomes wider, with the same density and depth: the width and the mass grow by the
        factor, and the height stays. Slenderness, inertia ratio and Housner's e follow. A radius of gyration
        and a restitution that are stated as numbers, the friction and the cavity stay as they are.

        Raises:
            ValueError: the wider block is out of range, see `Block`.

        Example:
            >>> import tpd
            >>> block = tpd.Block(width=0.5, height=1.5, mass=900.0).widened(1.2)
            >>> float(block.width), float(block.mass), round(block.velocity_ratio, 3)
            (0.6, 1080.0, 0.793)
        """
        factor = checks.positive("factor", factor)
        return replace(self, width=factor * self.width, mass=factor * self.mass)

    @property
    def velocity_ratio(self) -> Real:
        """Coefficient of restitution e of the block without a pendulum, as a number; 1 means no loss."""
        # Without a pendulum Housner's ratio has no mass ratio.
        if isinstance(self.restitution, str):
            return housner(self.slenderness, self.inertia_ratio)
        return self.restitution


@dataclass(frozen=True, kw_only=True)
class Pendulum:
    """Point bob on a massless rod from a hinge on the middle line of the block, usually at its top.

    The fields are the `mass` of the bob in kg, the `length` of the rod in m, the `damping_ratio` of the
    hinge, dimensionless, and the `hinge_height` above the base in m.

    Raises:
        ValueError: the mass, length, damping ratio or height of the hinge is out of range, or the bob would
            hang below the base.

    Example:
        >>> import tpd
        >>> pendulum = tpd.Pendulum(mass=50.0, length=0.4, damping_ratio=0.1)
        >>> round(pendulum.hinge_damping(), 4)
        7.9223
    """

    mass: Real
    """Mass of the equivalent point, kg; 0 means no pendulum."""
    length: Real
    """Distance of the equivalent point from the hinge, m; the rod as built is shorter."""
    damping_ratio: Real
    """Damping ratio zeta: share of the critical damping of the pendulum on a fixed hinge; 5 % is 0.05."""
    hinge_height: Real | None = None
    """Height of the hinge above the base, m, up to twice the height of the block. Default: the top of the
    block. Gradients with the default include its dependence on the height of the block."""

    def __post_init__(self) -> None:
        _convert_numbers(self)
        checks.not_negative("mass", self.mass, 0.0, HEAVIEST, " kg", every=True)
        checks.positive("length", self.length, *LENGTHS, " m", every=True)
        checks.not_negative("damping_ratio", self.damping_ratio, every=True)
        check_damping("damping_ratio", self.damping_ratio)
        # Without a height the rod is compared with the height of its block, see `Scene.quantities`.
        if self.hinge_height is not None:
            checks.positive("hinge_height", self.hinge_height, *LENGTHS, " m", every=True)
            lowest = "the height of the hinge, because the bob would hang below the base"
            checks.at_most("length", self.length, self.hinge_height, lowest)

    def hinge_in(self, block: Block) -> Real:
        """Return the height of the hinge above the base in a block, m."""
        return block.height if self.hinge_height is None else self.hinge_height

    def hinge_damping(self, gravity: Real = STANDARD_GRAVITY) -> Real:
        """Return the moment of the hinge per angular rate, N m s/rad: 2 zeta m l^1.5 g^0.5."""
        gravity = checks.positive("gravity", gravity)
        return 2.0 * self.damping_ratio * self.mass * self.length**1.5 * gravity**0.5


@dataclass(frozen=True, kw_only=True)
class Harmonic:
    """Harmonic horizontal motion of the base: displacement amplitude sin(2 pi frequency t).

    The fields are the `amplitude` in m and the `frequency` in Hz.

    Raises:
        ValueError: the amplitude or the frequency is out of range, or their acceleration is implausible.

    Example:
        >>> import tpd
        >>> motion = tpd.Harmonic(amplitude=0.015, frequency=2.5)
        >>> round(motion.rate, 4)
        15.708
    """

    swing_in_drawing: ClassVar[str] = "settled swing"
    """Name of the bob angle in a drawing."""
    amplitude: Real
    """Amplitude of the displacement of the ground, half of the travel from end to end, m."""
    frequency: Real
    """Frequency of the excitation in cycles per second, Hz."""

    def __post_init__(self) -> None:
        _convert_numbers(self)
        checks.not_negative("amplitude", self.amplitude, every=True)
        checks.positive("frequency", self.frequency, *FREQUENCIES, " Hz", every=True)
        check_excitation(self.amplitude, self.frequency)

    @property
    def quantities(self) -> dict[str, Real]:
        """Part of `Scene.quantities` that states the excitation."""
        return vars(self)

    @property
    def rate(self) -> Real:
        """Angular frequency omega, rad/s."""
        return 2.0 * math.pi * self.frequency

    @property
    def pga(self) -> Real:
        """Largest acceleration, m/s^2."""
        return self.amplitude * self.rate**2

    @property
    def in_drawing(self) -> str:
        """Label of the arrow that shows the excitation in a drawing."""
        return f"±{number(self.amplitude, 3)} m\nat {number(self.frequency)} Hz"

    @property
    def in_words(self) -> str:
        """Amplitude and frequency as text."""
        return f"{number(float(self.amplitude))} m at {number(float(self.frequency))} Hz"


@dataclass(frozen=True)
class Scene:
    """Block with the motion of its base: a `Harmonic`, a `Pulse` or a `Record`.

    The fields are the `block`, its `excitation`, and the `gravity` in m/s^2. `parameters` returns the
    dimensionless parameters under a harmonic, and `ground_parameters` those under any other motion.

    Raises:
        ValueError: an object is of another class, or the gravity is out of range.

    Example:
        >>> import tpd
        >>> block = tpd.Block(width=0.5, height=1.5, mass=900.0)
        >>> scene = tpd.Scene(block, tpd.Harmonic(amplitude=0.01, frequency=2.0))
        >>> round(scene.rate, 4), round(scene.peak, 4), round(scene.uplift, 4)
        (2.9709, 0.161, 0.3333)
    """

    block: Block
    """Block."""
    excitation: Any
    """Excitation, the motion of the base: a `Harmonic`, a `Pulse` or a `Record`."""
    gravity: Real = STANDARD_GRAVITY
    """Acceleration of gravity, m/s^2."""

    def __post_init__(self) -> None:
        _convert_numbers(self)
        checks.instance("block", self.block, Block)
        checks.instance("excitation", self.excitation, (Harmonic, GroundMotion))
        unit = " m/s^2 (on Earth it is 9.80665)"
        checks.positive("gravity", self.gravity, *GRAVITIES, unit, every=True)

    @property
    def rate(self) -> Real:
        """Rate omega0 = sqrt(g rho / b), rad/s, of (6). The dimensionless time is tau = omega0 t."""
        return _rate(self.gravity, self.block.inertia_ratio, self.block.centroid)

    @property
    def peak(self) -> Real:
        """Largest acceleration of the base over gravity, f."""
        return self.excitation.pga / self.gravity

    @property
    def uplift(self) -> Real:
        """Base acceleration over gravity that lifts the resting block without a pendulum, nu + k, see (5)."""
        return self.block.slenderness + self.block.friction

    def parameters(self, pendulum: Pendulum | None = None) -> Parameters:
        """Return the dimensionless parameters with a pendulum, or without one (mu = 0).

        The result is differentiable with respect to the scene and the pendulum, and includes every dependence
        on an SI quantity. In the parameters rho is None for a uniform rectangle, which means that it depends
        on nu. e is None for Housner's restitution, which means that it depends on nu, rho and mu.

        Raises:
            ValueError: the motion is not harmonic, the bob is heavier than the block, or the rod is longer
                than the block is high.
        """
        checks.instance("excitation", self.excitation, Harmonic, ": use `tpd.transient` for other motions")
        return Parameters(**dimensionless(self.quantities(pendulum)))

    def ground_parameters(self, pendulum: Pendulum | None = None) -> Parameters:
        """Return the dimensionless parameters under a pulse or a record.

        f is the largest acceleration over gravity, and 2 pi/xi is the dimensionless duration of one piece of
        the motion. Everything else is as in `parameters`.

        Raises:
            ValueError: the motion is a harmonic, the bob is heavier than the block, or the rod is longer than
                the block is high.
        """
        checks.instance(
            "excitation", self.excitation, GroundMotion, ": use `tpd.steady_state` for a harmonic"
        )
        return Parameters(**dimensionless(self.quantities(pendulum)))

    def quantities(self, pendulum: Pendulum | None = None) -> dict[str, Any]:
        """Return the SI quantities that `parameters` depends on, by name.

        The names of the pendulum begin with `pendulum_`; without a pendulum its mass is zero. Housner's
        restitution is left out, because it depends on the other quantities.

        Raises:
            ValueError: the bob is heavier than the block, or the rod is longer than the block is high.
        """
        block = self.block
        if pendulum is not None:
            checks.instance("pendulum", pendulum, Pendulum)
            checks.at_most("pendulum.mass", pendulum.mass, block.mass, "the mass of the block")
            block.check_hinge(pendulum.hinge_height)
            if (hinge := pendulum.hinge_height) is None:
                checks.at_most("pendulum.length", pendulum.length, block.height, "the height of the block")
            else:
                most = HIGHEST_HINGE * block.height
                checks.at_most("pendulum.hinge_height", hinge, most, "twice the height of the block")
        if pendulum is None:
            mu, lam, zeta = NO_PENDULUM
            pendulum = Pendulum(mass=mu, length=lam * block.centroid, damping_ratio=zeta)
        out = {name: getattr(block, name) for name in ("width", "height", "mass", "friction")}
        # Keys without a value are left out, so that rho and e follow the other quantities.
        if not isinstance(block.restitution, str):
            out["restitution"] = block.restitution
        shape = {name: getattr(block, name) for name in SHAPE}
        out |= {name: value for name, value in shape.items() if value is not None}
        if pendulum.hinge_height is not None:
            out["pendulum_hinge_height"] = pendulum.hinge_height
        out |= self.excitation.quantities
        out |= {"gravity": self.gravity, "pendulum_mass": pendulum.mass, "pendulum_length": pendulum.length}
        return out | {"pendulum_damping": pendulum.damping_ratio}

    def pendulum(
        self, *, mass_ratio: Real, length_ratio: Real, damping_ratio: Real, hinge_height: Real | None = None
    ) -> Pendulum:
        """Return the pendulum in SI units with the ratios mu, lam and zeta, and a hinge at a height in m."""
        mass_ratio = checks.not_negative("mass_ratio", mass_ratio, every=True)
        length_ratio = checks.not_negative("length_ratio", length_ratio, every=True)
        mass, length = mass_ratio * self.block.mass, length_ratio * self.block.centroid
        return Pendulum(mass=mass, length=length, damping_ratio=damping_ratio, hinge_height=hinge_height)


def check_proportions(width: Any, height: Any, mass: Any) -> None:
    """Raise `ValueError` if sizes and mass do not fit together, because one of them is in another unit.

    Traced values are not checked.

    Args:
        width, height: of the block, m.
        mass: of the block, kg.
    """
    if not all(map(checks.is_concrete, (width, height, mass))):
        return
    width, height, mass = np.broadcast_arrays(width, height, mass)
    # Arrays are allowed: the message shows the first element that is out of range.
    narrow = width < LEAST_SLENDERNESS * height
    if np.any(narrow):
        wide, high = width[narrow][0], height[narrow][0]
        least = f"at least {LEAST_SLENDERNESS:g} of `height`"
        raise ValueError(f"`width` must be {least}, but is {wide:g} m of {high:g} m: are both in m?")
    # Extreme numbers must lead to the message below, and not to a warning of NumPy.
    with np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore"):
        density = mass / (width**2 * height)
    beyond = ~((density >= DENSITIES[0]) & (density <= DENSITIES[1]))
    if np.any(beyond):
        wide, high, heavy, of = (float(x[beyond][0]) for x in (width, height, mass, density))
        raise ValueError(
            f"`mass` must give a density between {DENSITIES[0]:g} and {DENSITIES[1]:g} kg/m^3 (for a block "
            f"as deep as it is wide), but {heavy:g} kg in {wide:g} m x {high:g} m give {of:.3g} kg/m^3: are "
            "the lengths in m and the mass in kg?"
        )


def check_centroid(z: Any, height: Any, radius: Any) -> None:
    """Raise `ValueError` if a centroid is too near the base or the top, or needs a radius of gyration.

    Traced values are not checked.

    Args:
        z: height of the centroid above the base, m.
        height: of the block, m.
        radius: radius of gyration about the centroid, m; None if it is not stated.
    """
    if not all(map(checks.is_concrete, (z, height))):
        return
    # A share of the height instead of metres lies below the range for all but small blocks.
    low, high = (share * np.min(height) for share in CENTROIDS)
    checks.within("centroid_height", z, low, high, " m above the base", every=True)
    if radius is None and np.any(z != 0.5 * np.asarray(height)):
        raise ValueError(
            f"`radius_of_gyration` must be stated with a `centroid_height` of {np.max(z):g} m, which is not "
            "half the height: for parts of mass m_i, each with a radius r_i about its own centroid at z_i, "
            "its square is sum(m_i (r_i^2 + (z_i - z)^2))/sum(m_i)"
        )


def check_excitation(amplitude: Any, frequency: Any) -> None:
    """Apply `checks.plausible` to the acceleration of a harmonic excitation.

    Traced values are not checked.

    Args:
        amplitude: m.
        frequency: Hz.
    """
    if not all(map(checks.is_concrete, (amplitude, frequency))):
        return
    amplitude, frequency = np.broadcast_arrays(amplitude, frequency)
    # A frequency whose square overflows gives an infinite acceleration, which is rejected below.
    with np.errstate(over="ignore"):
        shares = amplitude * (2.0 * np.pi * frequency) ** 2 / STANDARD_GRAVITY
    # The message shows the strongest of several excitations.
    i = np.unravel_index(np.argmax(shares), shares.shape)
    of = f"`amplitude` and `frequency` give {amplitude[i]:g} m at {frequency[i]:g} Hz, whose acceleration"
    checks.plausible(of, shares[i], "pga", "are they in m and Hz?")


def check_damping(name: str, value: Any) -> None:
    """Raise `ValueError` if a damping ratio is so large that it is probably in percent.

    Traced values are not checked.
    """
    checks.at_most(name, value, LARGEST_DAMPING, "twice critical damping (a ratio: 5 % is 0.05)")


def dimensionless(q: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters by name from `Scene.quantities`, without checks.

    The quantities are numbers, arrays that broadcast, or traced values. rho is None without the names in
    `SHAPE`, and e is None without a `restitution`. Without a `pendulum_hinge_height` the hinge is at the top.
    """
    z, share, rho = _centroid(q), q.get("effective_width"), _inertia_ratio(q)
    nu = (q["width"] if share is None else q["width"] * share) / (2.0 * z)
    is_rectangle = all(q.get(name) is None for name in SHAPE)
    rate = _rate(q["gravity"], rho, z)
    omega = 2.0 * math.pi * q["frequency"]
    # A ground motion has a peak acceleration, and a harmonic has an amplitude of the displacement.
    peak = q["peak"] if "peak" in q else q["amplitude"] * omega * omega
    # In (25) of the paper lam is l/b. Its Table 1 lists l/(2b), which is half of it.
    return {
        "nu": nu,
        "mu": q["pendulum_mass"] / q["mass"],
        "lam": q["pendulum_length"] / z,
        "zeta": q["pendulum_damping"],
        "k": q["friction"],
        "f": peak / q["gravity"],
        "xi": omega / rate,
        # None means that rho and e follow the other parameters, also if these are varied later.
        "rho": None if is_rectangle else rho,
        "e": q.get("restitution"),
        "kappa": q.get("pendulum_hinge_height", q["height"]) / z,
    }


def _inertia_ratio(q: Mapping[str, Any]) -> Any:
    radius, share = q.get("radius_of_gyration"), q.get("effective_width")
    if all(q.get(name) is None for name in SHAPE):
        return uniform_inertia_ratio(q["width"] / q["height"])
    a, b, z = 0.5 * q["width"], 0.5 * q["height"], _centroid(q)
    # The radius of gyration is that of the whole block, also if it rocks on a part of its width.
    square = (a**2 + b**2) / 3.0 if radius is None else radius**2
    a = a if share is None else a * share
    return z**2 / (a**2 + z**2 + square)


def _centroid(q: Mapping[str, Any]) -> Any:
    return 0.5 * q["height"] if (z := q.get("centroid_height")) is None else z


def _rate(gravity: Any, rho: Any, z: Any) -> Any:
    return (gravity * rho / z) ** 0.5


def paper_scene() -> Scene:
    """Return the case study of Collini et al. (2016), section 5.

    The block has 0.1 x 0.2 x 0.4 m and 2028 kg/m^3, and its base moves 15 mm at 2.5 Hz. The friction is that
    of section 3 of the paper, and impacts lose no energy. The paper states no cavity: the one here has 80 mm,
    which leaves walls of 10 mm.

    Example:
        >>> import tpd
        >>> p = tpd.paper_scene().parameters()
        >>> round(p.nu, 4), round(p.f, 4), round(p.xi, 4)
        (0.25, 0.3774, 2.67)
    """
    return Scene(
        Block(width=0.1, height=0.4, mass=16.224, friction=0.05, restitution=1.0, cavity_width=0.08),
        Harmonic(amplitude=0.015, frequency=2.5),
    )
