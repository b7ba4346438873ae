"""Initial states that a question is about, which `tpd.answers.attractors` follows, and sets of runs, which
`tpd.answers.ensemble` follows: initial states, how the excitation begins, and which numbers are uncertain."""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.scene.conditions import check_half_widths, check_reach, latin_hypercube
from tpd.scene.ground_motion import LONGEST_FREE

MOST_PERIODS = 10_000
"""Most forcing periods of a run. Ctrl-C waits for the runs that have begun."""
_SCATTERED = (
    *("amplitude", "frequency", "friction", "damping", "restitution"),
    *("slenderness", "mass", "length"),
)
"""Names, out of `FACTORS`, of what an ensemble scatters, in the order of its draws."""
_RESTITUTION = 0.02
"""Relative half width of e where nothing is said of it."""
_DRAWS = 10, 1, 3
"""Draws of each generator: a later one leaves those before it as they are."""


@dataclass(frozen=True, kw_only=True)
class Ensemble:
    """A seeded set of runs. All ranges are covered evenly (a Latin hypercube); the first run is the nominal
    one: at rest, sudden shaking from tau = 0, no scatter.

    Raises:
        ValueError: a number out of range.
    """

    size: checks.Whole = 512
    """Number of runs."""
    seed: checks.Whole | None = None
    """Seed of the runs; by default that of the search which they verify, and 0 elsewhere."""
    periods: checks.Whole = 100
    """Largest number of forcing periods of a run; a run ends early where its motion repeats or is lost."""
    tilt: checks.Real = 0.05
    """Largest |phi| at the start, in shares of nu."""
    tilt_rate: checks.Real = 0.05
    """Largest |phi'|, in shares of nu."""
    swing: checks.Real = 0.05
    """Largest |psi|, rad."""
    swing_rate: checks.Real = 0.05
    """Largest |psi'|, rad per unit tau."""
    any_phase: bool = True
    """Whether the shaking may begin at any of its phases; else at a zero of the base's acceleration."""
    ramps: tuple[float, ...] = (0.0, 2.0)
    """Seconds over which the shaking grows, dealt out evenly; 0 is sudden. (With dimensionless parameters:
    units of tau.) It grows linearly from the zero of the base's acceleration before the run begins: a run
    that begins at another phase begins under the share that is reached by then."""
    amplitude: checks.Real = 0.01
    """Relative half width of the base's amplitude."""
    frequency: checks.Real = 0.01
    """Relative half width of its frequency; the amplitude of the base's displacement stays."""
    friction: checks.Real = 0.2
    """Relative half width of k."""
    damping: checks.Real = 0.2
    """Relative half width of zeta."""
    restitution: checks.Real | None = None
    """Relative half width of e, which stays at most 1; default 0.02, or half of 1 - e
    if that is less, where e is a number, else 0."""
    slenderness: checks.Real = 0.02
    """Relative half width of nu: the block as it was measured."""
    mass: checks.Real = 0.02
    """Relative half width of the bob's mass, as it was hung."""
    length: checks.Real = 0.02
    """Relative half width of the rod's length, as it was hung."""

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "size")
        checks.set_checked(self, checks.count, "periods", 1, MOST_PERIODS)
        if self.seed is not None:
            checks.set_checked(self, checks.seed, "seed")
        check_reach(self)
        checks.flag("any_phase", self.any_phase)
        for name, width in check_half_widths(self.half_widths).items():
            if getattr(self, name) is not None:
                object.__setattr__(self, name, width)
        ramps = checks.plain("ramps", self.ramps)
        ramps = ramps if isinstance(ramps, (tuple, list)) or np.ndim(ramps) else (ramps,)
        if not len(ramps):
            raise ValueError("`ramps` must hold at least one duration, but is empty")
        object.__setattr__(
            self, "ramps", tuple(checks.not_negative("ramps", ramp, 0.0, LONGEST_FREE) for ramp in ramps)
        )

    @property
    def half_widths(self) -> dict[str, float]:
        """Relative half widths of the scattered numbers by name."""
        widths = {name: getattr(self, name) for name in _SCATTERED}
        return widths | {"restitution": 0.0 if self.restitution is None else self.restitution}

    def widths(self, restitution: Any) -> dict[str, float]:
        """Relative half widths of the scattered numbers of a block with this e (None or a word where it
        follows the block's shape)."""
        if self.restitution is not None or restitution is None or isinstance(restitution, str):
            return self.half_widths
        # At most half of the loss, so that no run has none.
        e = float(restitution)
        return self.half_widths | {"restitution": min(_RESTITUTION, 0.5 * (1.0 - e)) if e > 0.0 else 0.0}

    def seeded(self, seed: int) -> Ensemble:
        """Return the ensemble with this seed, unless it has one of its own."""
        return self if self.seed is not None else replace(self, seed=seed)

    def dealt(self, conditions: int) -> np.ndarray:
        """Index of the condition of every run, out of so many, shape (size,): dealt out evenly."""
        # A generator of its own, so that conditions leave the draws of the runs as they are.
        return np.random.default_rng([self.seed or 0, 1]).permutation(self.size) % conditions

    def draws(self) -> np.ndarray:
        """Places of the runs in the unit cube, shape (size, 14): the four components of the start, the phase,
        the growth, and the scattered numbers. The first row is the nominal run."""
        seed = self.seed or 0
        drawn = zip((seed, [seed, 5], [seed, 6]), _DRAWS, strict=True)
        cubes = (latin_hypercube(np.random.default_rng(s), self.size, n) for s, n in drawn)
        unit = np.hstack(list(cubes))
        unit[0] = 0.5
        unit[0, 4:6] = 0.0
        return unit


class StartKind(enum.Enum):
    """Initial states that a question is about."""

    rest = "block and bob at rest at tau = 0"
    any = "whichever initial state: every symmetric orbit that is found to attract"
    sampled = "a seeded set of initial states"


@dataclass(frozen=True, kw_only=True)
class Starts:
    """Initial states at tau = 0: a seeded set, spread evenly over a box, whose first state is at rest.

    `Starts.rest()` is one start at rest; `Starts.any()` stands for whichever start.

    Raises:
        ValueError: a size below one, or a spread below zero.
    """

    size: checks.Whole = 64
    seed: checks.Whole = 0
    tilt: checks.Real = 0.8
    """Largest |phi|, as a share of nu."""
    tilt_rate: checks.Real = 0.5
    """Largest |phi'|, as a share of nu."""
    swing: checks.Real = 0.2
    """Largest |psi|, rad."""
    swing_rate: checks.Real = 0.2
    """Largest |psi'|, rad per unit tau."""
    kind: StartKind = StartKind.sampled

    def __post_init__(self) -> None:
        checks.set_checked(self, checks.count, "size")
        checks.set_checked(self, checks.seed, "seed")
        check_reach(self)
        checks.instance("kind", self.kind, StartKind)

    @staticmethod
    def rest() -> Starts:
        """One start: block and bob at rest."""
        return Starts(size=1, kind=StartKind.rest)

    @staticmethod
    def any() -> Starts:
        """Whichever start: a question about all symmetric orbits that attract."""
        return Starts(size=1, kind=StartKind.any)

    def states(self, nu: float) -> np.ndarray:
        """The states (phi, psi, phi', psi'), shape (size, 4): a Latin hypercube.

        Raises:
            ValueError: `Starts.any()`, which has no states.
        """
        if self.kind is StartKind.any:
            raise ValueError("`starts` must be a set of states here, but is Starts.any()")
        rng = np.random.default_rng(self.seed)
        reach = np.array([self.tilt * nu, self.swing, self.tilt_rate * nu, self.swing_rate])
        unit = 2.0 * latin_hypercube(rng, self.size, 4) - 1.0
        # The centre of the box, scaled below: the state at rest.
        unit[0] = 0.0
        return unit * reach
