"""Initial states of a problem (`tpd.answers.attractors`), and sets of runs (`tpd.answers.ensemble`).

A set of runs consists of initial states, of the ways in which the excitation begins, and of samples of
uncertain quantities.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.scene.conditions import MEASURED, HalfWidth, check_half_widths, check_reach, latin_hypercube

MOST_PERIODS = 10_000
"""Largest number of forcing periods of a run. After Ctrl-C the runs that have begun are completed."""
_SCATTERED = (
    *("amplitude", "frequency", "friction", "damping", "restitution"),
    *("slenderness", "mass", "length"),
)
"""Names out of `FACTORS` of the quantities that vary in an ensemble, in the order of the random draws."""
_RESTITUTION = 0.02
"""Default relative half width of e."""
DISTURBANCE = "tilt", "tilt_rate", "swing", "swing_rate"
"""Names of the fields with the ranges of a disturbance."""
_DRAWS = 10, 1, 3
"""Number of columns that each random generator draws. A new generator for new columns leaves the earlier
columns unchanged."""


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class Ensemble:
    """Seeded set of runs with different initial states, beginnings of the excitation, and properties.

    All ranges are covered evenly (Latin hypercube). The first run is the nominal one: it starts at rest, the
    excitation begins suddenly at tau = 0, and all quantities have their nominal values. Housner's
    e has its measured mean instead.

    The fields are the number of runs (`size`), their `seed`, and the largest number of forcing `periods`; the
    share of the runs that begin with a disturbance (`disturbed`), and its ranges (`tilt`, `tilt_rate`,
    `swing`, `swing_rate`); the beginning of the excitation (`any_phase`, and `growth` in periods); and the
    relative half widths of uncertain quantities.

    Raises:
        ValueError: a number is out of range.

    Example:
        >>> import tpd
        >>> ensemble = tpd.Ensemble(size=64, seed=1, growth=(0.0,))
        >>> ensemble.half_widths["friction"]
        0.2
    """

    size: checks.Whole = 512
    """Number of runs."""
    seed: checks.Whole | None = None
    """Seed of the runs; default the seed of the search whose result they validate, and 0 elsewhere."""
    periods: checks.Whole = 100
    """Largest number of forcing periods of a run. A run ends earlier if its motion repeats or the block
    overturns."""
    disturbed: checks.Real = 0.25
    """Share of the runs that begin with a disturbance: the block has a tilt and a rate, and the bob swings.
    The other runs begin at rest, as a building does before the shaking."""
    tilt: checks.Real = 0.05
    """Largest initial |phi| of a disturbance, as a share of nu."""
    tilt_rate: checks.Real = 0.05
    """Largest initial |phi'|, as a share of nu."""
    swing: checks.Real = 0.05
    """Largest initial |psi|, rad."""
    swing_rate: checks.Real = 0.05
    """Largest initial |psi'|, rad per unit of tau."""
    any_phase: bool = True
    """Whether the excitation may begin at any phase. Otherwise it begins at a zero of the base
    acceleration."""
    growth: tuple[float, ...] = (0.0, 10.0)
    """Numbers of forcing periods over which the excitation grows, distributed evenly over the runs; 0 is a
    sudden start. The excitation grows linearly, beginning at the last zero of the base acceleration before
    the start of the run. A run that starts at another phase therefore starts with the share that is reached
    at this phase."""
    amplitude: checks.Real = 0.01
    """Relative half width of the amplitude of the excitation."""
    frequency: checks.Real = 0.01
    """Relative half width of the frequency; the amplitude of the displacement does not change."""
    friction: checks.Real = 0.2
    """Relative half width of the friction k."""
    damping: checks.Real = 0.2
    """Relative half width of the damping ratio zeta."""
    restitution: checks.Real | None = None
    """Relative half width of e; e never exceeds 1. Default: 0.02, or half of 1 - e if this is smaller. With
    Housner's restitution a number is the half width of the difference from Housner's e. The default is then a
    normal difference with mean -0.01 and standard deviation 0.03, as measured in 134 free-rocking trials of
    limestone blocks (Colombo and others, 2026, DOI 10.60756/uminho-jh25, CC BY 4.0)."""
    slenderness: checks.Real = 0.02
    """Relative half width of nu, the uncertainty of the measured block."""
    mass: checks.Real = 0.02
    """Relative half width of the mass of the bob, the tolerance of its manufacture."""
    length: checks.Real = 0.02
    """Relative half width of the length of the rod, the tolerance of its manufacture."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "size")
        checks.set_checked(self, checks.count, "periods", 1, MOST_PERIODS)
        if self.seed is not None:
            checks.set_checked(self, checks.seed, "seed")
        check_reach(self)
        checks.set_checked(self, checks.within, "disturbed", 0.0, 1.0)
        checks.flag("any_phase", self.any_phase)
        # A restitution of None keeps its meaning: the default depends on the block.
        for name, width in check_half_widths(self.half_widths).items():
            if getattr(self, name) is not None:
                object.__setattr__(self, name, width)
        # A single number stands for all runs.
        growth = checks.plain("growth", self.growth)
        growth = growth if isinstance(growth, (tuple, list)) or np.ndim(growth) else (growth,)
        if not len(growth):
            raise ValueError("`growth` must contain at least one number of periods, but is empty")
        growth = tuple(checks.not_negative("growth", x) for x in growth)
        checks.at_most("growth", max(growth), float(self.periods), "the periods of a run")
        object.__setattr__(self, "growth", growth)

    @property
    def half_widths(self) -> dict[str, float]:
        """Relative half widths of the varied quantities, by name."""
        widths = {name: getattr(self, name) for name in _SCATTERED}
        return widths | {"restitution": 0.0 if self.restitution is None else self.restitution}

    def widths(self, restitution: Any) -> dict[str, HalfWidth]:
        """Return the relative half widths of the varied quantities for a block with this e.

        e is None or a word if it follows from the shape of the block. Its scatter is then the measured one.
        """
        if self.restitution is not None:
            return {**self.half_widths}
        # Real blocks differ from Housner's formula, and runs are compared with real blocks.
        if restitution is None or isinstance(restitution, str):
            return {**self.half_widths, "restitution": MEASURED}
        # Use at most half of the loss, so that every run has a loss.
        e = float(restitution)
        return {**self.half_widths, "restitution": min(_RESTITUTION, 0.5 * (1.0 - e)) if e > 0.0 else 0.0}

    def seeded(self, seed: int) -> Ensemble:
        """Return the ensemble with this seed, unless it already has a seed."""
        return self if self.seed is not None else replace(self, seed=seed)

    def dealt(self, conditions: int) -> np.ndarray:
        """Return the index of the condition of every run, shape (size,). The runs are distributed evenly over
        the conditions."""
        # A separate generator ensures that the number of conditions does not change the draws of the runs.
        return np.random.default_rng([self.seed or 0, 1]).permutation(self.size) % conditions

    def starts(self, unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the growth of the excitation in periods, and whether each run begins with a disturbance.

        `unit` has numbers between 0 and 1 that select the kinds of start, shape (size,).
        """
        # Shares of the interval from 0 to 1: a disturbance comes last, because the nominal run is at zero.
        disturbed = self.disturbed if any(getattr(self, name) for name in DISTURBANCE) else 0.0
        is_disturbed = unit >= 1.0 - disturbed
        share = np.where(is_disturbed, disturbed, 1.0 - disturbed)
        within = (unit - np.where(is_disturbed, 1.0 - disturbed, 0.0)) / share
        growth = np.array(self.growth)
        return growth[np.minimum((within * len(growth)).astype(int), len(growth) - 1)], is_disturbed

    def draws(self) -> np.ndarray:
        """Return the points of the runs in the unit cube, shape (size, 14).

        The columns are the four components of the disturbance, the phase, the kind of start, and the varied
        quantities. The first row is the nominal run.
        """
        seed = self.seed or 0
        draws = zip((seed, [seed, 5], [seed, 6]), _DRAWS, strict=True)
        unit = np.hstack([latin_hypercube(np.random.default_rng(s), self.size, n) for s, n in draws])
        # The middle of every range is the nominal value. Phase and kind of start are nominal at zero.
        unit[0] = 0.5
        unit[0, 4:6] = 0.0
        return unit


class StartKind(enum.Enum):
    """Kind of initial states of a problem."""

    rest = "block and bob at rest at tau = 0"
    any = "whichever initial state: every symmetric orbit that is found to attract"
    sampled = "a seeded set of initial states"


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class Starts:
    """Initial states at tau = 0: a seeded set that covers a box evenly, whose first state is at rest.

    `Starts.rest()` is a single state at rest. `Starts.any()` stands for any initial state.

    The fields are the number of states (`size`), their `seed`, and the largest `tilt` and `tilt_rate` (shares
    of nu), `swing` (rad) and `swing_rate` (rad per unit of tau).

    Raises:
        ValueError: the size is below one, or a range is negative.

    Example:
        >>> import tpd
        >>> tpd.Starts(size=8).states(nu=0.25).shape
        (8, 4)
    """

    size: checks.Whole = 64
    """Number of states."""
    seed: checks.Whole = 0
    """Seed of the states."""
    tilt: checks.Real = 0.8
    """Largest |phi|, as a share of nu."""
    tilt_rate: checks.Real = 0.5
    """Largest |phi'|, as a share of nu."""
    swing: checks.Real = 0.2
    """Largest |psi|, rad."""
    swing_rate: checks.Real = 0.2
    """Largest |psi'|, rad per unit of tau."""
    kind: StartKind = StartKind.sampled
    """Kind of initial states."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "size")
        checks.set_checked(self, checks.seed, "seed")
        check_reach(self)
        checks.instance("kind", self.kind, StartKind)

    @staticmethod
    def rest() -> Starts:
        """Return a single state with block and bob at rest."""
        return Starts(size=1, kind=StartKind.rest)

    @staticmethod
    def any() -> Starts:
        """Return an object that stands for any initial state: the problem concerns all stable symmetric
        orbits."""
        return Starts(size=1, kind=StartKind.any)

    def states(self, nu: float) -> np.ndarray:
        """Return the states (phi, psi, phi', psi'), shape (size, 4), as a Latin hypercube.

        Raises:
            ValueError: the object is `Starts.any()`, which has no states.
        """
        if self.kind is StartKind.any:
            raise ValueError("`starts` must be a set of states here, but is Starts.any()")
        rng = np.random.default_rng(self.seed)
        reach = np.array([self.tilt * nu, self.swing, self.tilt_rate * nu, self.swing_rate])
        unit = 2.0 * latin_hypercube(rng, self.size, 4) - 1.0
        # The first state is the centre of the box, which is the state at rest.
        unit[0] = 0.0
        return unit * reach
