"""Criteria of a design: bounds of the search, the risk measure over the conditions, limits, and its worth.

A limit is a size that must not exceed one under every condition. A search takes any list of limits: it reads
their sizes and the derivatives of these with respect to (mu, lam, zeta). A user's own limit is a frozen
dataclass that is a subclass of `Limit`: with `name`, `sizes` and, if it needs more than the tilt, the bob's
angle and the design, `of_motion = False`. A user's own objective is a subclass of `Objective`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from tpd.core import checks
from tpd.scene.bob import THICKEST, Bob
from tpd.scene.conditions import Conditions, check_restitution
from tpd.scene.scene import (
    HEAVIEST,
    LARGEST_DAMPING,
    LENGTHS,
    STANDARD_GRAVITY,
    Block,
    Scene,
    check_excitation,
)

__all__ = [
    "DEFAULT_LIMITS",
    "POINT_BOB",
    "Bob",
    "Clearance",
    "Limit",
    "Mass",
    "Multiplier",
    "Objective",
    "Offset",
    "RelativeStroke",
    "Requirements",
    "Reserve",
    "Risk",
    "Size",
    "SteadyTilt",
    "Stroke",
    "Tilt",
    "Worsening",
]
"""Names that `tpd.limits` is for."""

ROCKING, NEAR, REST, UNSTABLE, NONE = range(5)
"""Motions of a design under a condition, the best first."""
HEAVIEST_RATIO = 1.0
"""Largest mass ratio m/M: no bob within a block is heavier than the block."""
LONGEST_RATIO = 2.0
"""Largest length ratio l/b: a pendulum longer than the whole block would swing through the floor."""
MEASURES = "overturning", "tilt"
"""Measures that a pendulum can be required to reduce: the share of runs that overturn, or the mean tilt."""
THICKNESS = "thickness"
"""Name of the bob's half height over the largest share of its rod."""
DEPTH = "depth"
"""Name of the depth of the bob's lower end below the hinge over the block's height."""
_LEAST_TILT = 0.02
"""Tilt, in shares of nu, that a pendulum may leave where the bare block hardly rocks or rests."""

Bounds = checks.Real | tuple[float, float]
"""One number, which is fixed, or a lower and an upper bound, between which the search looks."""
TWINS = {"mass": "mass_ratio", "length": "length_ratio"}
"""Fields of a design space in SI units, and the ratios that state the same."""
USUAL_BOUNDS = {"mass_ratio": (0.01, 0.2), "length_ratio": (0.1, 1.5)}
_RANGES = {
    "mass_ratio": (0.0, HEAVIEST_RATIO),
    "length_ratio": (1e-3, LONGEST_RATIO),
    "damping_ratio": (0.0, LARGEST_DAMPING),
    "mass": (0.0, HEAVIEST),
    "length": LENGTHS,
}
"""Largest ranges of a design space."""


@dataclass(frozen=True, kw_only=True)
class DesignSpace:
    """Bounds of the search: each is one number, which is fixed, or a pair, between which the search looks.

    Mass and length are those of the equivalent point pendulum, the point mass and its distance from the
    hinge. The body as built is heavier on a shorter rod: `tpd.limits.Mass`, in a job `[limits] mass`, limits
    the mass of the body.

    Raises:
        ValueError: a bound out of range, reversed or empty, a ratio beside its value in SI units, or three
            fixed values.
    """

    mass_ratio: Bounds | None = None
    """Ratio m/M of the bob's point mass to the block's mass: one number, which is fixed, or two bounds
    (default 0.01 0.2)."""
    length_ratio: Bounds | None = None
    """Ratio l/b of the pendulum's length to half the block's height: one number, which is fixed, or two
    bounds (default 0.1 1.5)."""
    damping_ratio: Bounds = 0.1
    """Damping ratio zeta of the hinge: one number, which is fixed, or two bounds."""
    mass: Bounds | None = None
    """Mass of the bob as the equivalent point in kg, in place of the ratio: one number, which is fixed, or
    two bounds ([limits] mass limits the heavier body as built)."""
    length: Bounds | None = None
    """Length of the equivalent point pendulum in m, in place of the ratio: one number, which is fixed, or
    two bounds (the rod of the body as built is shorter)."""

    def __post_init__(self) -> None:
        for name, ratio in TWINS.items():
            stated, given = getattr(self, name), getattr(self, ratio)
            if stated is not None and given is not None:
                raise ValueError(f"`{name}` and `{ratio}` state the same: give one of them")
            if stated is None and given is None:
                object.__setattr__(self, ratio, USUAL_BOUNDS[ratio])
        given = [x for x in _RANGES if x == "damping_ratio" or getattr(self, x) is not None]
        for name in given:
            # A bob without mass is no pendulum; a hinge without a damper is one.
            number = checks.within if name == "damping_ratio" else checks.positive
            check = number if np.asarray(getattr(self, name), object).size == 1 else checks.interval
            checks.set_checked(self, check, name, *_RANGES[name])
        if not any(isinstance(getattr(self, name), tuple) for name in given):
            raise ValueError(
                "a search needs two bounds for mass, length or damping ratio, but each has one fixed value: "
                "`tpd check` validates a pendulum without a search"
            )

    def of(self, block: Block) -> DesignSpace:
        """Return the space of a block, with ratios in place of values in SI units.

        Raises:
            ValueError: a bob heavier than the block, or a length out of range.
        """
        out: dict[str, Any] = {}
        for name, unit, size in (("mass", "kg", block.mass), ("length", "m", block.half_height)):
            value, (low, high) = getattr(self, name), _RANGES[TWINS[name]]
            if value is not None:
                # Either bound by itself, so that the message has the one that is out of range.
                for x in np.ravel(value).tolist():
                    checks.within(name, x, low * size, high * size, f" {unit} in this block")
                out |= {name: None, TWINS[name]: np.clip(np.array(value) / size, low, high).tolist()}
        return replace(self, **out)

    @property
    def ends(self) -> np.ndarray:
        """Lower and upper ends of (mu, lam, zeta), shape (2, 3); equal where a value is fixed.

        Raises:
            ValueError: a space in SI units, whose ratios are those of a block.
        """
        if self.mass_ratio is None or self.length_ratio is None:
            raise ValueError("a space in kg or m has ratios only with a block: use `space.of(block)`")
        return np.array([np.broadcast_to(getattr(self, n), 2) for n in (*TWINS.values(), "damping_ratio")]).T

    @property
    def searched(self) -> np.ndarray:
        """Columns of (mu, lam, zeta) that are searched."""
        return np.flatnonzero(np.ptp(self.ends, axis=0))

    @property
    def names(self) -> tuple[str, ...]:
        """Symbols of the searched parameters."""
        return tuple(("mu", "lam", "zeta")[i] for i in self.searched)

    @property
    def bounds(self) -> np.ndarray:
        """Lower and upper bounds of the searched parameters, shape (2, len(names))."""
        return self.ends[:, self.searched]

    def scaled(self, designs: np.ndarray) -> np.ndarray:
        """Searched values of designs (..., 3) as shares of the bounds, shape (..., len(names))."""
        # Searches work in shares: a kilogramme and a metre have no common length of step.
        low, high = self.bounds
        return (np.take(designs, self.searched, axis=-1) - low) / (high - low)

    def unscaled(self, unit: np.ndarray) -> np.ndarray:
        """(mu, lam, zeta) of shares of the bounds, shape (..., len(names)) to (..., 3)."""
        low, high = self.bounds
        out = np.tile(self.ends[0], (*np.shape(unit)[:-1], 1))
        out[..., self.searched] = low + np.asarray(unit) * (high - low)
        return out


@dataclass(frozen=True, kw_only=True)
class Risk:
    """Risk measure: one number made of the tilts under all conditions, the mean of the worst `share`."""

    share: checks.Real
    name: str

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.within, "share", 0.0, 1.0)
        checks.instance("name", self.name, str)

    @staticmethod
    def worst() -> Risk:
        """Largest tilt of all conditions."""
        return Risk(share=0.0, name="worst")

    @staticmethod
    def expected() -> Risk:
        """Mean tilt over all conditions."""
        return Risk(share=1.0, name="expected")

    @staticmethod
    def cvar(share: checks.Real = 0.1) -> Risk:
        """Conditional value at risk: the mean tilt of the worst `share` of the conditions.

        Raises:
            ValueError: a share that is not above 0 and at most 1.
        """
        share = checks.within("share", share, 1e-9, 1.0)
        return Risk(share=share, name=f"mean of the worst {share:.3g}")

    def cap(self, n: int) -> float:
        """Largest weight of one of n conditions."""
        return min(1.0, 1.0 / max(self.share * n, 1.0))

    def of(self, values: np.ndarray) -> np.ndarray:
        """Measure over the last axis: the largest weighted mean with no weight above the cap."""
        n = values.shape[-1]
        # Weights of the worst conditions are as large as the cap allows: this is the mean of the worst share.
        cap = self.cap(n)
        ordered = -np.sort(-values, axis=-1)
        weights = np.clip(1.0 - cap * np.arange(n), 0.0, cap)
        # A condition without weight may be infinite: 0 times infinity must not enter the sum.
        # Of one design the sum is a scalar of NumPy, which is no array.
        return np.asarray(np.sum(np.where(weights > 0.0, ordered, 0.0) * weights, axis=-1))


@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Least benefit and largest harm, over paired runs of the nonlinear equations.

    Raises:
        ValueError: a share out of range.
    """

    at_least: checks.Real = 0.1
    """Least share by which the measure must fall over all runs, significantly at 95 %."""
    measure: str | None = None
    """Measure that must fall: "overturning", the share of runs that overturn, or "tilt", the mean tilt, in
    which an overturning counts as 1. Default: overturning if the block overturns in 1 % or more of the
    validation runs without the pendulum, else tilt."""
    worse: checks.Real = 0.05
    """Largest share by which the mean tilt under one condition, or after one kind of start, may be above that
    without the pendulum."""
    wall_contacts: checks.Real | None = None
    """Largest share of the runs that stand in which the bob may strike a wall, on the way or settled; default
    0.01. On ground motions the share that may break a limit of any kind; default 0.1."""

    def __post_init__(self) -> None:
        shares = "at_least worse" if self.wall_contacts is None else "at_least worse wall_contacts"
        checks.set_checked(self, checks.within, shares, 0.0, 1.0)
        if self.measure is not None:
            checks.one_of("measure", self.measure, MEASURES)

    @property
    def allowed(self) -> float:
        """`wall_contacts` under harmonics."""
        return 0.01 if self.wall_contacts is None else self.wall_contacts

    @property
    def broken(self) -> float:
        """`wall_contacts` on ground motions: share that may break a limit."""
        return 0.1 if self.wall_contacts is None else self.wall_contacts


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """Lengths and ratios of the block under n conditions, for limits that are stated in SI units."""

    half_height: float
    """b, m."""
    block_mass: float
    """M, kg."""
    wall: np.ndarray
    """Half the width between the walls, m, shape (n,)."""
    slenderness: np.ndarray
    """nu, shape (n,)."""
    mass_factor: np.ndarray
    """Factor on the bob's mass, shape (n,)."""
    length_factor: np.ndarray
    """Factor on the pendulum's length, shape (n,)."""
    tilt_without_pendulum: np.ndarray | float = np.nan
    """Tilt over nu of the bare block in the model of the search, shape (n,); NaN where it is not known."""
    bob: Bob = field(default_factory=Bob)
    gravity: float = STANDARD_GRAVITY
    """m/s^2"""

    @staticmethod
    def of(scene: Scene, conditions: Conditions, limits: tuple[Limit, ...] = ()) -> Geometry:
        """Geometry of a scene's block under all conditions, with the bob of the limits."""
        block, slenderness = scene.block, conditions.column("slenderness")
        return Geometry(
            half_height=block.half_height,
            block_mass=block.mass,
            wall=0.5 * block.clear_width * slenderness,
            slenderness=block.slenderness * slenderness,
            mass_factor=conditions.column("mass"),
            length_factor=conditions.column("length"),
            bob=bob_of(limits),
            gravity=float(scene.gravity),
        )

    def rod(self, designs: np.ndarray) -> np.ndarray:
        """Length of the rod, m, (m, n), of designs (m, 3)."""
        return self.half_height * designs[:, 1, None] * self.length_factor

    def mass(self, designs: np.ndarray) -> np.ndarray:
        """Mass of the bob, kg, (m, n)."""
        return self.block_mass * designs[:, 0, None] * self.mass_factor

    def body(self, designs: np.ndarray) -> Body:
        """The bob of designs (m, 3) as it is built: it swings as the point of `mass` at `rod` does."""
        mass, length = self.block_mass * designs[:, 0, None], self.half_height * designs[:, 1, None]
        body, rod, of_body, of_rod = self.bob.built_and_slopes(mass, length, self.gravity)
        exists, out = np.isfinite(body), []
        for value, slopes, point, of_point, factor in (
            (body, of_body, mass, (1.0, 0.0), self.mass_factor),
            (rod, of_rod, length, (0.0, 1.0), self.length_factor),
        ):
            by_mass, by_length = (np.where(exists, *pair) for pair in zip(slopes, of_point, strict=True))
            slope = np.stack([self.block_mass * by_mass, self.half_height * by_length, 0.0 * mass], axis=-1)
            out += [np.where(exists, value, point) * factor, slope * factor[:, None]]
        return Body(exists, *out)


class Body(NamedTuple):
    """The bob of m designs under n conditions as it is built; where no body swings as the point does, the
    point."""

    exists: np.ndarray
    """(m, 1)"""
    mass: np.ndarray
    """kg, (m, n)"""
    mass_slope: np.ndarray
    """Derivatives with respect to (mu, lam, zeta), (m, n, 3)."""
    rod: np.ndarray
    """From the hinge to the bob's centre, m, (m, n)."""
    rod_slope: np.ndarray


class Evaluation(NamedTuple):
    """Designs under conditions: arrays (m, n), derivatives (m, n, 3) with respect to (mu, lam, zeta)."""

    merit: np.ndarray
    """Value of the objective where the block rocks, by default the tilt over nu; minus the uplift margin
    where it rests; above 1 where no motion attracts. Lower is better, and a resting design is better than any
    rocking one. All have derivatives but orbits near a fold."""
    merit_slope: np.ndarray
    tilt: np.ndarray
    """Largest |phi| over nu; 0 at rest. Where no motion attracts, that of the largest orbit, or infinite."""
    tilt_slope: np.ndarray
    swing: np.ndarray
    """Largest |psi| of the same motion, rad."""
    swing_slope: np.ndarray
    margin: np.ndarray
    """Uplift margin."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers; 0 at rest."""
    reserve: np.ndarray
    """Distance of the orbit from where it stops attracting: the least of fold, symmetry and torus in
    `Margins`; 1 at rest."""
    reserve_slope: np.ndarray
    kind: np.ndarray
    """Index into `tpd.design.orbits.KINDS`."""
    turn: np.ndarray
    """phi, psi, phase of the forcing and psi' at the upper turn of the orbit that counts, (m, n, 4)."""
    design: np.ndarray
    """(m, 3)"""
    relative: np.ndarray | None = None
    """Largest |psi - phi|, rad, where it is known by itself."""

    @staticmethod
    def blank(m: int, n: int) -> Evaluation:
        """Evaluation of m designs under n conditions with ones in place of sizes."""
        one, slope = np.ones((m, n)), np.zeros((m, n, 3))
        kind, turn = np.zeros((m, n), int), np.full((m, n, 4), np.nan)
        sizes = one, slope, one, slope, one, slope
        return Evaluation(*sizes, one, one, one, slope, kind, turn, np.ones((m, 3)))

    @property
    def attracts(self) -> np.ndarray:
        """Whether there is a motion to settle into, as far as the objective can tell."""
        return self.kind <= REST

    def at(self, rows: np.ndarray | list[int]) -> Evaluation:
        """Evaluation of some of the designs."""
        return Evaluation(*(None if x is None else x[rows] for x in self))  # type: ignore[arg-type]


class Size(NamedTuple):
    """A quantity over its limit, or over its size of reference, under every condition: at most 1 where the
    limit is kept."""

    name: str
    value: np.ndarray
    """(m, n)"""
    slope: np.ndarray
    """Derivatives with respect to (mu, lam, zeta), (m, n, 3)."""


@dataclass(frozen=True)
class Limit(ABC):
    """A requirement on a design under every condition."""

    name: ClassVar[str]
    """Key in a job file, and in reports."""
    label: ClassVar[str] = ""
    """Words of a report for `name`; where empty, the name itself."""
    unit: ClassVar[str] = ""
    """Unit of the number in a report."""
    of_motion: ClassVar[bool] = True
    """Whether the limit follows from tilt, bob angle and design alone, so that any model can be asked."""

    @abstractmethod
    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """Limited quantities of m designs under n conditions, over their limits."""

    def set_number(self, field: str, check: Callable[[str, object], Any] = checks.positive) -> float:
        """Put what a check returns in the place of a field, and return it; messages have the limit's name."""
        object.__setattr__(self, field, check(self.name, getattr(self, field)))
        return getattr(self, field)

    def set_angle(self) -> None:
        """Check that `angle` is positive and at most a right angle, where the bob is level with its hinge."""
        checks.at_most(self.name, self.set_number("angle"), 0.5 * np.pi, "a right angle in rad")


@dataclass(frozen=True)
class Objective(ABC):
    """A quantity of a settled motion that a search makes small, under every condition.

    Its values apply where a motion attracts and the block rocks. Elsewhere the search uses values of its own:
    minus the uplift margin where the block rests, and more than 1 where no motion attracts. The quantity
    must therefore be divided by a size of reference, so that its values are positive and below 1, except for
    motions that are as bad as none. Limits, penalties and tolerances are made for such values as well.
    """

    name: ClassVar[str]
    """Words for the quantity in reports."""
    of_motion: ClassVar[bool] = True
    """Whether the values follow from tilt, bob angle and design alone, so that a run of any model has one."""

    @abstractmethod
    def values(self, e: Evaluation, g: Geometry) -> Size:
        """Quantity of m designs under n conditions over its size of reference, with its derivatives."""


@dataclass(frozen=True)
class SteadyTilt(Objective):
    """Largest settled tilt over the slenderness: 1 is the tilt at which the block stands on its corner."""

    name: ClassVar[str] = "tilt"

    def values(self, e: Evaluation, g: Geometry) -> Size:
        """The tilt over nu."""
        return Size(self.name, e.tilt, e.tilt_slope)


@dataclass(frozen=True)
class Stroke(Limit):
    """Largest settled |psi|, rad, at most pi/2. The linear equations lose their meaning beyond about 0.5
    rad."""

    angle: checks.Real = 0.5
    name: ClassVar[str] = "stroke"
    unit: ClassVar[str] = "rad"

    def __post_init__(self) -> None:
        self.set_angle()

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """The stroke over the limit."""
        yield Size(self.name, e.swing / self.angle, e.swing_slope / self.angle)


@dataclass(frozen=True)
class RelativeStroke(Limit):
    """Largest settled |psi - phi|, rad, at most pi/2. The sum of both largest angles is limited, which is
    never less."""

    angle: checks.Real
    name: ClassVar[str] = "relative_stroke"
    label: ClassVar[str] = "relative stroke"
    unit: ClassVar[str] = "rad"

    def __post_init__(self) -> None:
        self.set_angle()

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """The sum of both angles over the limit."""
        angle, slope = _relative(e, g)
        yield Size(self.name, angle / self.angle, slope / self.angle)


@dataclass(frozen=True)
class Tilt(Limit):
    """Largest settled |phi|, as a share of nu, at most 1: at nu the block stands on its corner."""

    share: checks.Real
    name: ClassVar[str] = "tilt"
    unit: ClassVar[str] = "of nu"

    def __post_init__(self) -> None:
        checks.at_most(self.name, self.set_number("share"), 1.0, "a block that stands on its corner")

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """The tilt over the limit."""
        yield Size(self.name, e.tilt / self.share, e.tilt_slope / self.share)


@dataclass(frozen=True)
class Mass(Limit):
    """Largest mass of the bob as it is built, kg; where no body swings as the point does, of the point."""

    kg: checks.Real
    name: ClassVar[str] = "mass"
    label: ClassVar[str] = "mass (bob as built)"
    unit: ClassVar[str] = "kg"

    def __post_init__(self) -> None:
        self.set_number("kg")

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """The mass of the body over the limit, nominal under all conditions."""
        body = replace(g, mass_factor=np.ones_like(g.mass_factor)).body(e.design)
        yield Size(self.name, body.mass / self.kg, body.mass_slope / self.kg)


@dataclass(frozen=True)
class Offset(Limit):
    """Largest distance of the settled bob's centre, as it is built, from the block's axis, m."""

    distance: checks.Real
    name: ClassVar[str] = "offset"
    label: ClassVar[str] = "offset (bob from the axis)"
    unit: ClassVar[str] = "m"

    def __post_init__(self) -> None:
        self.set_number("distance")

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """The offset l sin(angle) over the limit."""
        angle, angle_slope = _relative(e, g)
        rod, rod_slope = g.body(e.design)[-2:]
        # Beyond a right angle the bob comes back towards the axis, but it has been a rod's length away.
        inside = angle < 0.5 * np.pi
        sine = np.sin(np.minimum(angle, 0.5 * np.pi))
        across = np.where(inside, rod * np.cos(np.where(inside, angle, 0.0)), 0.0)
        slope = across[..., None] * angle_slope + sine[..., None] * rod_slope
        yield Size(self.name, rod * sine / self.distance, slope / self.distance)


@dataclass(frozen=True)
class Clearance(Limit):
    """Clearance of the bob as built. In the steady state the bob does not touch the walls of the cavity,
    half its height is at most 0.6 of the rod's length, and its lower end is not below the block. In validation
    runs the bob does not touch the walls during the transient either."""

    bob: Bob = field(default_factory=Bob)
    name: ClassVar[str] = "clearance"
    label: ClassVar[str] = "clearance (bob to the wall)"

    def __post_init__(self) -> None:
        checks.instance("bob", self.bob, Bob)

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """The bob's reach over half the width between the walls, its half height over the largest one that
        the rod allows, and the depth of its lower end below the hinge over the block's height."""
        exists, mass, mass_slope, rod, longer = replace(g, bob=self.bob).body(e.design)
        radius, (angle, angle_slope) = np.asarray(self.bob.radius(mass)), _relative(e, g)
        reach, by_radius, by_rod, by_angle = self.bob.reach_and_slopes(radius, rod, angle)
        # The radius of a bob without mass has no derivative; a search never starts there.
        growing = (radius / np.maximum(3.0 * mass, 1e-9 * g.block_mass))[..., None] * mass_slope
        by_all = (by_angle, angle_slope), (by_radius, growing), (by_rod, longer)
        slope = sum(by[..., None] * of for by, of in by_all)
        yield Size(self.name, reach / g.wall, slope / g.wall[:, None])
        high, most = self.bob.slimness * radius, THICKEST * rod
        bulk = (self.bob.slimness * growing - (high / rod)[..., None] * longer) / most[..., None]
        # Where no body swings as the point does, the bob is too thick in any case.
        yield Size(THICKNESS, high / most + ~exists, bulk)
        tall = 2.0 * g.half_height
        yield Size(DEPTH, (rod + high) / tall, (longer + self.bob.slimness * growing) / tall)


@dataclass(frozen=True)
class Worsening(Limit):
    """Largest share by which the settled tilt under any condition may exceed that of the bare block. Where
    the bare block rests, overturns or is not known to settle, there is nothing to exceed."""

    share: checks.Real = 0.05
    name: ClassVar[str] = "worsening"
    label: ClassVar[str] = "worsening (against the bare tilt)"
    unit: ClassVar[str] = "of the bare tilt"
    of_motion: ClassVar[bool] = False

    def __post_init__(self) -> None:
        self.set_number("share", checks.not_negative)

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """The tilt over the bare block's and the share."""
        without = np.broadcast_to(g.tilt_without_pendulum, e.tilt.shape[1:])
        # Relative to next to nothing every tilt would be a worsening.
        most = (1.0 + self.share) * np.maximum(np.where(np.isfinite(without), without, np.inf), _LEAST_TILT)
        with np.errstate(invalid="ignore"):
            # An infinite tilt over an infinite one is no worsening.
            value = np.where(np.isfinite(most), e.tilt / most, 0.0)
        yield Size(self.name, value, e.tilt_slope / most[:, None])


@dataclass(frozen=True)
class Multiplier(Limit):
    """Largest modulus of the Floquet multipliers, below 1. It has no derivative: a search stops at it rather
    than moving along it. `Reserve` has one."""

    largest: checks.Real
    name: ClassVar[str] = "multiplier"
    of_motion: ClassVar[bool] = False

    def __post_init__(self) -> None:
        self.set_number("largest", lambda name, value: checks.within(name, value, 1e-6, 1.0))

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """The modulus over the limit."""
        yield Size(self.name, e.multiplier / self.largest, np.zeros_like(e.tilt_slope))


@dataclass(frozen=True)
class Reserve(Limit):
    """Least distance of a symmetric orbit from where it stops attracting (fold, loss of symmetry, torus).
    Without it a search over orbits ends on the edge of what is stable."""

    least: checks.Real = 0.05
    name: ClassVar[str] = "reserve"
    of_motion: ClassVar[bool] = False

    def __post_init__(self) -> None:
        self.set_number("least")

    def sizes(self, e: Evaluation, g: Geometry) -> Iterable[Size]:
        """A size that is at most one where the reserve is at least `least`."""
        # Sizes are bounded from above, a reserve from below: 2 - x/least is at most 1 where x is at least
        # `least`.
        yield Size(self.name, 2.0 - e.reserve / self.least, -e.reserve_slope / self.least)


KINDS: tuple[type[Limit], ...] = (
    Stroke,
    RelativeStroke,
    Tilt,
    Mass,
    Offset,
    Clearance,
    Worsening,
    Multiplier,
    Reserve,
)
"""All limits, in the order of a report."""
LABELS = {kind.name: kind.label or kind.name for kind in KINDS} | {
    THICKNESS: "thickness (bob off the hinge)",
    DEPTH: "depth (bob within the block's height)",
}
"""Words of a report, by the names of limited sizes."""

STILL = THICKNESS, DEPTH, Mass.name
"""Names of the limited sizes that no motion changes."""
POINT_BOB: tuple[Limit, ...] = (Stroke(), Reserve())
"""Limits on a bob without size, as in the paper."""
DEFAULT_LIMITS: tuple[Limit, ...] = (Stroke(), Clearance(), Worsening(), Reserve())


def limit_of(limits: tuple[Limit, ...], kind: type[Limit]) -> Limit | None:
    """The limit of a kind, or None."""
    return next((limit for limit in limits if isinstance(limit, kind)), None)


def bob_of(limits: tuple[Limit, ...]) -> Bob:
    """The bob as a body: that of the room, or by default a ball of steel."""
    clearance = limit_of(limits, Clearance)
    return clearance.bob if isinstance(clearance, Clearance) else Bob()


def stroke_limit(limits: tuple[Limit, ...]) -> float:
    """Largest settled |psi| allowed, rad; infinite without such a limit."""
    limit = limit_of(limits, Stroke)
    return limit.angle if isinstance(limit, Stroke) else np.inf


def check_limits(limits: Iterable[Limit]) -> tuple[Limit, ...]:
    """The limits as a tuple in the order of a report.

    Raises:
        ValueError: something that is not a limit, or two limits of one kind.
    """
    # Two limits of one kind would leave open which of them a report means.
    given = isinstance(limits, Iterable) and not isinstance(limits, (str, bytes, Mapping))
    if not given or checks.is_concrete(limits):
        raise ValueError(f"`limits` must be a list of objects of `tpd.limits`, but is {checks.shown(limits)}")
    listed = tuple(limits)
    for limit in listed:
        if not isinstance(limit, Limit):
            raise ValueError(f"`limits` must hold objects of `tpd.limits`, but has {checks.shown(limit)}")
        # Its numbers are what tells two searches apart, and its name what a report has.
        if "__dataclass_fields__" not in vars(type(limit)) or not hasattr(limit, "name"):
            raise ValueError(f"`limits` must hold dataclasses with a `name`, but has {type(limit).__name__}")
    kinds = [type(limit) for limit in listed]
    for kind in kinds:
        if kinds.count(kind) > 1:
            raise ValueError(f"`limits` must hold one limit of a kind, but has two of {kind.__name__}")
    # Limits of the user's own come last.
    return tuple(sorted(listed, key=lambda x: KINDS.index(type(x)) if type(x) in KINDS else len(KINDS)))


def check_objective(objective: object) -> Objective:
    """Return the objective.

    Raises:
        ValueError: anything but an object of a dataclass with a `name` that is a subclass of `Objective`.
    """
    # Its numbers are what tells two searches apart, and its name what a report has.
    whole = "__dataclass_fields__" in vars(type(objective)) and hasattr(objective, "name")
    if isinstance(objective, Objective) and whole:
        return objective
    raise ValueError(
        "`objective` must be an object of a dataclass with a `name` that is a subclass of "
        f"`tpd.limits.Objective`, but is {checks.shown(objective)}"
    )


def _relative(e: Evaluation, g: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Largest angle between bob and block, rad, and its derivatives: where it is not known by itself the sum
    of the largest bob angle and the largest tilt. Both need not occur at once, so that the sum is safe."""
    if e.relative is not None:
        return e.relative, np.zeros((*e.relative.shape, 3))
    nu = g.slenderness[None, :]
    return e.swing + e.tilt * nu, e.swing_slope + e.tilt_slope * nu[..., None]


def check_moves(scene: Scene, conditions: Conditions) -> None:
    """Raise `ValueError` where nothing moves the block, or more than any base."""
    if not scene.motion.amplitude > 0.0:
        raise ValueError(
            f"`amplitude` must be above 0 in a search, but is {scene.motion.amplitude:g}: nothing shakes the "
            "block"
        )
    motion, factor = scene.motion, conditions.column
    check_excitation(motion.amplitude * factor("amplitude"), motion.frequency * factor("frequency"))


def check_cavity(block: Block, limits: tuple[Limit, ...]) -> None:
    """Raise `ValueError` where limits need room inside a block whose cavity is not stated."""
    if limit_of(limits, Clearance) is None or block.cavity_width is not None:
        return
    raise ValueError(
        "`cavity_width`, the width in m between the walls that the bob swings within, must be given, but is "
        "not, and no pendulum hangs inside a solid block: state it (--cavity, or `cavity_width` in [block] "
        "or of `Block`), or leave out the walls (--no-walls, `clearance = false` in [limits], or limits "
        "without `Clearance`)"
    )


def check_scatter(scene: Scene, names: Iterable[str], space: DesignSpace | None = None) -> None:
    """Raise `ValueError` for a name out of `FACTORS` of a quantity that is zero or absent: a factor on it
    would change nothing."""
    zero = {
        "friction": scene.block.friction == 0.0,
        "damping": space is not None and space.damping_ratio == 0.0,
    }
    for name in names:
        if zero.get(name, False):
            raise ValueError(f"`{name}` cannot scatter by a share of itself: it is 0")
        if name == "restitution":
            check_restitution(scene)


def first_apart(
    units: np.ndarray, order: np.ndarray, most: int, apart: float = 0.02, fixed: int = 0
) -> list[int]:
    """The first of an ordered list of designs that are no neighbours: at least `apart` from each other, in
    shares of the bounds. The first `fixed` are taken in any case."""
    taken = [int(i) for i in order[:fixed]]
    nearest = np.min([np.full(len(units), np.inf), *(_distances(units, i) for i in taken)], axis=0)
    for i in map(int, order[fixed:]):
        if len(taken) < most and nearest[i] > apart:
            taken.append(i)
            nearest = np.minimum(nearest, _distances(units, i))
    return taken


def _distances(units: np.ndarray, i: int) -> np.ndarray:
    """Distances of all designs from design i."""
    return np.linalg.norm(units - units[i], axis=1)
