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
from tpd.scene.conditions import check_half_widths, check_reach, latin_hypercube
from tpd.scene.ground_motion import LONGEST_FREE

MOST_PERIODS = 10_000
"""Largest number of forcing periods of a run. After Ctrl-C the runs that have begun are completed."""
_SCATTERED = (
    *("amplitude", "frequency", "friction", "damping", "restitution"),
    *("slenderness", "mass", "length"),
)
"""Names out of `FACTORS` of the quantities that vary in an ensemble, in the order of the random draws."""
_RESTITUTION = 0.02
"""Default relative half width of e."""
_DRAWS = 10, 1, 3
"""Number of columns that each random generator draws. A new generator for new columns leaves the earlier
columns unchanged."""


@checks.keywords
@dataclass(frozen=True, kw_only=True)
class Ensemble:
    """Seeded set of runs with different initial states, beginnings of the excitation, and properties.

    All ranges are covered evenly (Latin hypercube). The first run is the nominal one: it starts at rest, the
    excitation begins suddenly at tau = 0, and all quantities have their nominal values.

    The fields are the number of runs (`size`), their `seed`, and the largest number of forcing `periods`; the
    ranges of the initial state (`tilt`, `tilt_rate`, `swing`, `swing_rate`); the beginning of the excitation
    (`any_phase`, and `ramps` in s); and the relative half widths of uncertain quantities.

    Raises:
        ValueError: a number is out of range.

    Example:
        >>> import tpd
        >>> ensemble = tpd.Ensemble(size=64, seed=1, ramps=(0.0,))
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
    tilt: checks.Real = 0.05
    """Largest initial |phi|, as a share of nu."""
    tilt_rate: checks.Real = 0.05
    """Largest initial |phi'|, as a share of nu."""
    swing: checks.Real = 0.05
    """Largest initial |psi|, rad."""
    swing_rate: checks.Real = 0.05
    """Largest initial |psi'|, rad per unit of tau."""
    any_phase: bool = True
    """Whether the excitation may begin at any phase. Otherwise it begins at a zero of the base
    acceleration."""
    ramps: tuple[float, ...] = (0.0, 2.0)
    """Durations (s) over which the excitation grows, distributed evenly over the runs; 0 is a sudden
    beginning. (With dimensionless parameters the unit is that of tau.) The excitation grows linearly,
    beginning at the last zero of the base acceleration before the start of the run. A run that starts at
    another phase therefore starts with the share that is reached at this phase."""
    amplitude: checks.Real = 0.01
    """Relative half width of the amplitude of the base motion."""
    frequency: checks.Real = 0.01
    """Relative half width of the frequency; the amplitude of the displacement does not change."""
    friction: checks.Real = 0.2
    """Relative half width of the friction k."""
    damping: checks.Real = 0.2
    """Relative half width of the damping ratio zeta."""
    restitution: checks.Real | None = None
    """Relative half width of e; e never exceeds 1. Default: 0.02, or half of 1 - e if this is smaller; 0 if e
    follows from the shape of the block."""
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
        checks.flag("any_phase", self.any_phase)
        # A restitution of None keeps its meaning: the default depends on the block.
        for name, width in check_half_widths(self.half_widths).items():
            if getattr(self, name) is not None:
                object.__setattr__(self, name, width)
        # A single number stands for one duration.
        ramps = checks.plain("ramps", self.ramps)
        ramps = ramps if isinstance(ramps, (tuple, list)) or np.ndim(ramps) else (ramps,)
        if not len(ramps):
            raise ValueError("`ramps` must contain at least one duration, but is empty")
        ramps = tuple(checks.not_negative("ramps", ramp, 0.0, LONGEST_FREE) for ramp in ramps)
        object.__setattr__(self, "ramps", ramps)

    @property
    def half_widths(self) -> dict[str, float]:
        """Relative half widths of the varied quantities, by name."""
        widths = {name: getattr(self, name) for name in _SCATTERED}
        return widths | {"restitution": 0.0 if self.restitution is None else self.restitution}

    def widths(self, restitution: Any) -> dict[str, float]:
        """Return the relative half widths of the varied quantities for a block with this e.

        e is None or a word if it follows from the shape of the block.
        """
        if self.restitution is not None or restitution is None or isinstance(restitution, str):
            return self.half_widths
        # Use at most half of the loss, so that every run has a loss.
        e = float(restitution)
        return self.half_widths | {"restitution": min(_RESTITUTION, 0.5 * (1.0 - e)) if e > 0.0 else 0.0}

    def seeded(self, seed: int) -> Ensemble:
        """Return the ensemble with this seed, unless it already has a seed."""
        return self if self.seed is not None else replace(self, seed=seed)

    def dealt(self, conditions: int) -> np.ndarray:
        """Return the index of the condition of every run, shape (size,). The runs are distributed evenly over
        the conditions."""
        # A separate generator ensures that the number of conditions does not change the draws of the runs.
        return np.random.default_rng([self.seed or 0, 1]).permutation(self.size) % conditions

    def draws(self) -> np.ndarray:
        """Return the points of the runs in the unit cube, shape (size, 14).

        The columns are the four components of the initial state, the phase, the ramp, and the varied
        quantities. The first row is the nominal run.
        """
        seed = self.seed or 0
        draws = zip((seed, [seed, 5], [seed, 6]), _DRAWS, strict=True)
        unit = np.hstack([latin_hypercube(np.random.default_rng(s), self.size, n) for s, n in draws])
        # The middle of every range is the nominal value. Phase and ramp are nominal at zero.
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
        """Return an object that stands for any initial state: the problem concerns all symmetric orbits that
        attract."""
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
