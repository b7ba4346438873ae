"""Limits and objectives of a design, and requirements on its benefit.

A limit is stated by a size, a quantity over its largest allowed value, which must not exceed 1 under any
condition. The search accepts any list of limits, because it uses only their sizes and the derivatives of the
sizes with respect to (mu, lam, zeta).

A limit of a user is a frozen dataclass that is a subclass of `Limit`, with a `name` and one method `size`.
JAX differentiates the method. If it uses more than the tilt, the angles of the bob and the design, the class
also has `of_motion = False`. An objective of a user is a subclass of `Objective` with the same method.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any, ClassVar, Literal, NamedTuple, TypeVar, get_args

import numpy as np

from tpd.core import checks
from tpd.design.geometry import DEPTH, TOP, Geometry, Ratios
from tpd.scene.bob import THICKEST, Bob
from tpd.scene.scene import Block

__all__ = [
    "DEFAULT_LIMITS",
    "POINT_BOB",
    "Bob",
    "Clearance",
    "Limit",
    "Mass",
    "Motion",
    "Multiplier",
    "Objective",
    "Offset",
    "Ratios",
    "RelativeStroke",
    "Requirements",
    "Reserve",
    "Settling",
    "SteadyTilt",
    "Stroke",
    "Tilt",
    "Worsening",
]
"""Public names, in the order of the reference."""
Measure = Literal["overturning", "tilt", "rate"]
"""Measures that a pendulum can be required to reduce: the share of runs that overturn, the mean tilt, or the
annual rate of overturning."""
MEASURED = {"overturning": "share of runs that overturn", "tilt": "mean tilt", "rate": "rate of overturning"}
"""Words for the measures."""
THICKNESS = "thickness"
"""Name of the size: half the height of the bob over the largest share of its rod."""
_RIGHT_ANGLE = 0.5 * np.pi, "a right angle in rad"
"""Largest angle of a limit. At pi/2 the bob is level with its hinge."""
_LEAST_TILT = 0.02
"""Tilt as a share of nu that a pendulum may always leave. Without this value, a block that rests or almost
rests without a pendulum would reject every design."""


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class Requirements:
    """Smallest benefit and largest harm of a recommended pendulum, over paired runs of the nonlinear
    equations.

    All fields are shares between 0 and 1, except `reduce`.

    Raises:
        ValueError: a share is out of range, or the measure is unknown.

    Example:
        >>> import tpd
        >>> tpd.limits.Requirements(at_least=0.2, wall_contacts=0.02).wall_contacts
        0.02
    """

    at_least: checks.Real = 0.1
    """Smallest reduction of what `reduce` names with which a pendulum is recommended, as a share. The
    reduction must also be significant at 95 %."""
    reduce: Measure | None = None
    """Quantity that the pendulum must reduce: "overturning" (share of runs that overturn), "tilt" (mean tilt;
    a run that overturns counts as 1), or "rate" (annual rate of overturning under ground motions, which needs
    a hazard and at least two levels). Default: overturning if the block overturns in at least 1 % of the
    validation runs without the pendulum, else tilt."""
    worse: checks.Real = 0.05
    """Largest relative increase of the mean tilt under any one condition, or in any one group of motions."""
    wall_contacts: checks.Real | None = None
    """Largest share of the surviving runs that may exceed a limit, which includes wall contact: by default
    0.01, and 0.1 under ground motions."""

    def __post_init__(self) -> None:
        shares = "at_least worse" if self.wall_contacts is None else "at_least worse wall_contacts"
        checks.set_checked(self, checks.within, shares, 0.0, 1.0)
        if self.reduce is not None:
            checks.one_of("reduce", self.reduce, get_args(Measure))


class Motion(NamedTuple):
    """Settled motion of one design under one condition, for limits: numbers.

    Tilt, swing, rod angle, reserve and remaining have exact derivatives with respect to the design. The
    margin and the multiplier have none: a search stops at a limit on them and does not move along it.

    Example:
        >>> import tpd
        >>> motion = tpd.limits.Motion(0.3, 0.2, 0.25, -0.1, 0.8, 0.1, 0.9)
        >>> motion.rod_angle
        0.25
    """

    tilt: Any
    """Largest |phi| over nu; 0 at rest."""
    swing: Any
    """Largest |psi|, rad."""
    rod_angle: Any
    """Largest angle |psi - phi| between rod and block, rad. In the search it is the sum of the largest swing
    and the largest tilt, which is an upper bound."""
    margin: Any
    """Uplift margin: positive if the settled block stays at rest."""
    multiplier: Any
    """Largest modulus of the Floquet multipliers; 0 at rest."""
    reserve: Any
    """Margin of the orbit to the loss of its stability, from 0 to 1; 1 at rest."""
    remaining: Any
    """Factor per period by which a disturbance of the block falls, see `Settling`; 0 at rest."""


class _Sized(ABC):
    """Base class of limits and objectives: a name, and a function of one motion that JAX differentiates."""

    name: ClassVar[str]
    """Key in a job file and in reports."""
    label: ClassVar[str] = ""
    """Words in a report; if empty, the name itself."""
    of_motion: ClassVar[bool] = True
    """Whether the function uses only tilt, angles of the bob and design, and not margin, multiplier, reserve
    and remaining. Only then the runs of all models have a value."""

    @abstractmethod
    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return the quantity over its limit or over its reference value, one number."""

    def sizes(self, motion: Motion, design: Ratios, geometry: Geometry) -> dict[str, Any]:
        """Return all quantities by their names; by default the only one."""
        return {self.name: self.size(motion, design, geometry)}


@dataclass(frozen=True)
class Limit(_Sized):
    """Inequality constraint on a design under every condition; base class of all limits.

    A subclass is a frozen dataclass with a class attribute `name` and a method `size` of one motion, one
    design and the geometry of one condition. Its result is the quantity over its largest allowed value. All
    arguments are numbers, and the method is differentiated by JAX: use `jax.numpy`, and no `if` on them.

    Example:
        >>> import dataclasses, tpd
        >>> from typing import ClassVar
        >>> @dataclasses.dataclass(frozen=True)
        ... class LongestRod(tpd.limits.Limit):
        ...     length: float
        ...     name: ClassVar[str] = "rod"
        ...
        ...     def size(self, motion, design, geometry):
        ...         return geometry.rod(design) / self.length
        >>> LongestRod(0.5).name
        'rod'
    """

    unit: ClassVar[str] = ""
    """Unit of the number in a report."""

    def quantity(self, size: float) -> tuple[float, float]:
        """Return the limited quantity that has this size, and its limit."""
        return size, 1.0

    def utilisation(self, size: float) -> float:
        """Return the limited quantity that has this size, divided by its limit."""
        quantity, limit = self.quantity(size)
        # A quantity that does not grow uses nothing of a limit on its increase.
        return quantity / limit if quantity > 0.0 and limit else np.inf if quantity > 0.0 else 0.0


@dataclass(frozen=True)
class _OneNumber(Limit):
    """Limit that has one number. Messages about the number use the name of the limit."""

    limited: ClassVar[str] = ""
    """Field of `Motion` that must not exceed the number; empty if the limit has another size."""
    check: ClassVar[Callable[[str, object], Any]] = staticmethod(checks.positive)
    """Check of the number, which returns it."""
    most: ClassVar[tuple[float, str]] = (np.inf, "")
    """Largest number, and its meaning."""

    def __post_init__(self) -> None:
        (field,) = fields(self)
        number = self.check(self.name, getattr(self, field.name))
        object.__setattr__(self, field.name, number)
        checks.at_most(self.name, number, *self.most)

    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return the field `limited` of the motion over the number."""
        (limit,) = vars(self).values()
        return getattr(motion, self.limited) / limit

    def quantity(self, size: float) -> tuple[float, float]:
        """See `Limit.quantity`."""
        (limit,) = vars(self).values()
        return size * limit, limit


@dataclass(frozen=True)
class Objective(_Sized):
    """Quantity of a settled motion that a search minimises, under every condition; base class of all
    objectives.

    A subclass has the form of a `Limit`. Its values apply where a motion attracts and the block rocks.
    Elsewhere the search uses other values: minus the uplift margin where the block rests, more than 2 where
    there is no orbit, and the quantity plus 1 where the orbit does not attract. The quantity must therefore
    be divided by a reference value, and be between 0 and 1 for most acceptable motions. The smoothing of the
    worst condition and the penalties are scaled for such values as well.

    Example:
        >>> import dataclasses, tpd
        >>> from typing import ClassVar
        >>> @dataclasses.dataclass(frozen=True)
        ... class Swing(tpd.limits.Objective):
        ...     name: ClassVar[str] = "swing"
        ...
        ...     def size(self, motion, design, geometry):
        ...         return motion.swing / 1.5
        >>> Swing().name
        'swing'
    """


@dataclass(frozen=True)
class Settling(Objective):
    """Factor per forcing period by which a small disturbance of the steady motion falls. The default
    objective under harmonic excitation.

    With or without a pendulum a block that rocks has a steady motion of much the same size. A pendulum
    changes how fast the block returns to it after a start or a push, and a block that returns slowly
    overturns more often. Let D_n be the derivative of the motion of the block after n forcing periods with
    respect to a disturbance of the block (tilt over nu, rate over xi nu; the bob moves freely), a 2 x 2
    matrix at the symmetric orbit. With the root mean square |D| over all directions the factor is the
    geometric mean of |D_2|^(1/2) and |D_4|^(1/4). In 28 scenes its rank correlation with the share of the
    runs that overturn is +0.3 to +1.0 (median 0.9, see the guide), and that of the steady tilt -0.8 to +0.1.

    The largest Floquet multiplier is the same factor after infinitely many periods. It has no derivative
    where multipliers meet, and does not show how a disturbance grows before it falls.

    Example:
        >>> import tpd
        >>> tpd.limits.Settling().name
        'settling'
    """

    name = "settling"
    label = "what remains of a disturbance, per period"
    of_motion = False

    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return the factor."""
        return motion.remaining


@dataclass(frozen=True)
class SteadyTilt(Objective):
    """Largest settled tilt over the slenderness. At 1 the block stands on its corner and topples.

    A pendulum of small steady tilt need not prevent overturning: see `Settling`.

    Example:
        >>> import tpd
        >>> tpd.limits.SteadyTilt().name
        'tilt'
    """

    name = "tilt"
    label = "steady tilt over ν"

    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return the tilt over nu."""
        return motion.tilt


@dataclass(frozen=True)
class Stroke(_OneNumber):
    """Largest settled bob angle |psi| from the vertical, rad, at most pi/2. Beyond about 0.5 rad the linear
    equations are inaccurate.

    Example:
        >>> import tpd
        >>> tpd.limits.Stroke(0.4).angle
        0.4
    """

    angle: checks.Real = 0.5
    """Largest bob angle, rad."""
    name = "stroke"
    unit = "rad"
    most = _RIGHT_ANGLE
    limited = "swing"


@dataclass(frozen=True)
class RelativeStroke(_OneNumber):
    """Largest settled angle |psi - phi| between bob and block, rad, at most pi/2. The search limits the sum
    of the largest bob angle and the largest tilt, which is an upper bound.

    Example:
        >>> import tpd
        >>> tpd.limits.RelativeStroke(0.4).angle
        0.4
    """

    angle: checks.Real
    """Largest angle between bob and block, rad."""
    name = "relative_stroke"
    label = "relative stroke"
    unit = "rad"
    most = _RIGHT_ANGLE
    limited = "rod_angle"


@dataclass(frozen=True)
class Tilt(_OneNumber):
    """Largest settled tilt |phi|, as a share of nu, at most 1. At nu the block stands on its corner.

    Example:
        >>> import tpd
        >>> tpd.limits.Tilt(0.5).share
        0.5
    """

    share: checks.Real
    """Largest tilt over nu."""
    name = "tilt"
    unit = "of nu"
    most = 1.0, "a block that stands on its corner"
    limited = "tilt"


@dataclass(frozen=True)
class Mass(_OneNumber):
    """Largest mass of the bob as built, kg. If no body swings like the point pendulum, the mass of the point.

    Example:
        >>> import tpd
        >>> tpd.limits.Mass(500.0).kg
        500.0
    """

    kg: checks.Real
    """Largest mass, kg."""
    name = "mass"
    label = "mass (bob as built)"
    unit = "kg"

    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return the mass of the body over the limit, with the nominal mass under all conditions."""
        # The tolerance of the mass is not part of the limit.
        return geometry.body(design).mass / geometry.mass_factor / self.kg


@dataclass(frozen=True)
class Offset(_OneNumber):
    """Largest distance of the centre of the settled bob, as built, from the axis of the block, m.

    Example:
        >>> import tpd
        >>> tpd.limits.Offset(0.3).distance
        0.3
    """

    distance: checks.Real
    """Largest distance, m."""
    name = "offset"
    label = "offset (bob from the axis)"
    unit = "m"

    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return the distance l sin(angle) from the axis over the limit."""
        # Beyond a right angle the bob comes back towards the axis, but on the way it was a rod's length from
        # the axis.
        xp = checks.namespace(*motion, *design)
        across = xp.sin(xp.minimum(motion.rod_angle, 0.5 * np.pi))
        return geometry.body(design).rod * across / self.distance


@dataclass(frozen=True)
class Clearance(Limit):
    """Clearance of the bob as built. In the steady state the bob does not touch the walls of the cavity, half
    its height is at most 0.6 of the length of the rod, and its lower end is not below the block. In
    validation runs the bob does not touch the walls during the transient either.

    Example:
        >>> import tpd
        >>> tpd.limits.Clearance(tpd.limits.Bob(shape="cylinder")).bob.shape
        'cylinder'
    """

    bob: Bob = field(default_factory=Bob)
    """Shape, density and proportions of the bob."""
    name = "clearance"
    label = "clearance (bob to the wall)"

    def __post_init__(self) -> None:
        checks.instance("bob", self.bob, Bob)

    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return the largest distance of the bob from the axis over half the distance between the walls."""
        _, mass, rod = replace(geometry, bob=self.bob).body(design)
        return self.bob.reach(mass, rod, motion.rod_angle) / geometry.wall

    def sizes(self, motion: Motion, design: Ratios, geometry: Geometry) -> dict[str, Any]:
        """Return the sizes of the bob: distance from the axis, thickness and depth, each over its limit.

        The second is half the height of the bob over the largest value that the rod allows. The third is the
        depth of the lower end below the hinge over that of the base or, in a frame, of the top of the block.
        """
        exists, mass, rod = replace(geometry, bob=self.bob).body(design)
        high = self.bob.half_height(mass)
        # If no body swings like the point pendulum, `~exists` adds 1, and the bob counts as too thick.
        sizes = {
            THICKNESS: high / (THICKEST * rod) + ~exists,
            geometry.obstacle: (rod + high) / geometry.depth,
        }
        return super().sizes(motion, design, geometry) | sizes


@dataclass(frozen=True)
class Worsening(_OneNumber):
    """Largest relative increase of the settled tilt under any condition, compared with the block without a
    pendulum. The limit has no effect under conditions in which that block rests, overturns or has no known
    settled motion.

    Example:
        >>> import tpd
        >>> tpd.limits.Worsening(0.1).share
        0.1
    """

    share: checks.Real = 0.05
    """Largest relative increase of the tilt."""
    name = "worsening"
    label = "worsening (compared with no pendulum)"
    unit = "of the tilt without pendulum"
    of_motion = False
    check = staticmethod(checks.not_negative)

    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return the tilt over the largest tilt that the limit allows."""
        xp = checks.namespace(*motion, *design, geometry.tilt_without_pendulum)
        without = geometry.tilt_without_pendulum
        # Compared with a tilt close to zero every tilt would be a large increase, hence the lower bound.
        most = (1.0 + self.share) * xp.maximum(without, _LEAST_TILT)
        # Where the reference is unknown the limit has no effect.
        return xp.where(xp.isfinite(without), motion.tilt / most, 0.0)

    def quantity(self, size: float) -> tuple[float, float]:
        """See `Limit.quantity`: the increase of the tilt, which is negative if the tilt falls."""
        return (1.0 + self.share) * size - 1.0, self.share


@dataclass(frozen=True)
class Multiplier(_OneNumber):
    """Largest modulus of the Floquet multipliers, below 1. This limit has no derivative: a search
    stops at it and does not move along it. `Reserve` has a derivative.

    Example:
        >>> import tpd
        >>> tpd.limits.Multiplier(0.9).largest
        0.9
    """

    largest: checks.Real
    """Largest modulus."""
    name = "multiplier"
    of_motion = False
    check = staticmethod(partial(checks.within, low=1e-6, high=1.0))
    limited = "multiplier"


@dataclass(frozen=True)
class Reserve(_OneNumber):
    """Smallest margin of a symmetric orbit to the loss of its stability (fold, loss of symmetry or torus),
    from 0 to 1. Without this limit a search over orbits ends at the boundary of stability.

    Example:
        >>> import tpd
        >>> tpd.limits.Reserve(0.1).least
        0.1
    """

    least: checks.Real = 0.05
    """Smallest margin."""
    name = "reserve"
    of_motion = False

    def size(self, motion: Motion, design: Ratios, geometry: Geometry) -> Any:
        """Return a size that is at most 1 if the reserve is at least `least`."""
        # A size has an upper bound, but a reserve has a lower bound: 2 - x/least is at most 1 if x is at
        # least `least`.
        return 2.0 - motion.reserve / self.least

    def quantity(self, size: float) -> tuple[float, float]:
        """See `Limit.quantity`."""
        return (2.0 - size) * self.least, self.least

    def utilisation(self, size: float) -> float:
        """Return the smallest allowed reserve over the reserve, because this limit is a lower bound."""
        reserve, _ = self.quantity(size)
        return self.least / reserve if reserve > 0.0 else np.inf


OBJECTIVES: dict[str, Objective] = {"settling": Settling(), "steady tilt": SteadyTilt()}
"""Objectives by their names in a job file."""
LIMIT_KINDS: tuple[type[Limit], ...] = (
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
LABELS = {kind.name: kind.label or kind.name for kind in LIMIT_KINDS} | {
    THICKNESS: "thickness (half the height of the bob)",
    DEPTH: "depth (lower end of the bob)",
    TOP: "top of the block (lower end of the bob)",
}
"""Words of a report, by the names of the limited sizes."""
STILL = THICKNESS, DEPTH, TOP, Mass.name
"""Names of the limited sizes that do not depend on the motion."""
POINT_BOB: tuple[Limit, ...] = (Stroke(), Reserve())
"""Limits on a bob without size, as in the paper."""
DEFAULT_LIMITS: tuple[Limit, ...] = (Stroke(), Clearance(), Worsening(), Reserve())
"""Default limits under harmonic excitation."""


_L = TypeVar("_L", bound=Limit)


def limit_of(limits: tuple[Limit, ...], kind: type[_L]) -> _L | None:
    """Return the limit of a kind, or None."""
    return next((limit for limit in limits if isinstance(limit, kind)), None)


def bob_of(limits: tuple[Limit, ...]) -> Bob:
    """Return the bob as a body: that of the limit `Clearance`, or by default a ball of steel."""
    return (limit_of(limits, Clearance) or Clearance()).bob


def stroke_limit(limits: tuple[Limit, ...]) -> float:
    """Return the largest settled |psi| that is allowed, rad; infinite without such a limit."""
    stroke = limit_of(limits, Stroke)
    return np.inf if stroke is None else stroke.angle


def usual_stroke(limits: tuple[Limit, ...]) -> float:
    """Return the largest |psi| of a first estimate, rad: the limit on it, or the default of this limit."""
    return min(stroke_limit(limits), float(Stroke().angle))


def check_limits(limits: Iterable[Limit]) -> tuple[Limit, ...]:
    """Return the limits as a tuple in the order of a report.

    Raises:
        ValueError: an element is not a limit, or two limits are of the same kind.
    """
    # A string and a table are iterable as well, but are never a list of limits.
    is_list = isinstance(limits, Iterable) and not isinstance(limits, (str, bytes, Mapping))
    if not is_list or checks.is_concrete(limits):
        raise ValueError(f"`limits` must be a list of objects of `tpd.limits`, but is {checks.quote(limits)}")
    listed = tuple(limits)
    for limit in listed:
        if not isinstance(limit, Limit):
            raise ValueError(f"`limits` must contain objects of `tpd.limits`, but has {checks.quote(limit)}")
        if not _is_complete(limit):
            raise ValueError(f"`limits` must be dataclasses with a `name`, but has {type(limit).__name__}")
        # With two limits of one kind a report could not say which one is active.
        if [type(other) for other in listed].count(kind := type(limit)) > 1:
            raise ValueError(f"`limits` must have one limit of each kind, but has two of {kind.__name__}")
    # Limits that a user has defined come last.
    order = dict(zip(LIMIT_KINDS, range(len(LIMIT_KINDS)), strict=True))
    return tuple(sorted(listed, key=lambda limit: order.get(type(limit), len(order))))


def check_objective(objective: object) -> Objective:
    """Return the objective.

    Raises:
        ValueError: the objective is not an object of a dataclass with a `name` that is a subclass of
            `Objective`.
    """
    if isinstance(objective, Objective) and _is_complete(objective):
        return objective
    raise ValueError(
        "`objective` must be an object of a dataclass with a `name` that is a subclass of "
        f"`tpd.limits.Objective`, but is {checks.quote(objective)}"
    )


def _is_complete(sized: _Sized) -> bool:
    # The fields of the dataclass distinguish two searches, and the name appears in reports.
    return "__dataclass_fields__" in vars(type(sized)) and hasattr(sized, "name")


def check_cavity(block: Block, limits: tuple[Limit, ...]) -> None:
    """Raise `ValueError` if a limit depends on the width of cavity or frame and the block states none."""
    if limit_of(limits, Clearance) is None or (block.cavity_width, block.frame_width) != (None, None):
        return
    raise ValueError(
        "`cavity_width` must be given, but is missing. It is the distance in m between the walls on both "
        "sides of the bob: a pendulum needs a cavity in the block, or a frame above it. State the width "
        "(--cavity, `cavity_width` in [block] or of `Block`; --frame-width, [frame], `frame_width`), or "
        "ignore the walls (--no-walls, `clearance = false` in [limits], or limits without `Clearance`)"
    )
