"""Initial states that a question is about. `tpd.answers.attractors` follows them."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np

from tpd.core import checks
from tpd.scene.conditions import check_reach, latin_hypercube


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
