"""Requirements on the benefit of a design: below them it is not worth hanging."""

from __future__ import annotations

from dataclasses import dataclass

from tpd.core import checks


@dataclass(frozen=True, kw_only=True)
class Worth:
    """Least benefit and largest harm, over paired runs of the nonlinear equations.

    Raises:
        ValueError: a share out of range.
    """

    at_least: float = 0.1
    """Least share by which the mean tilt over all runs must fall."""
    worse: float = 0.05
    """Largest share by which the mean tilt under one condition may be above the bare block's."""
    strikes: float | None = None
    """Largest share of the runs that stand in which the bob may strike a wall, on the way or settled; default
    0.01. On ground motions the share that may break a limit of any kind; default 0.1."""
    runs: int | None = None
    """Most runs, with the pendulum and without, by the nonlinear equations; default all of the ensemble."""

    def __post_init__(self) -> None:
        checks.within("at_least", self.at_least, 0.0, 1.0)
        checks.within("worse", self.worse, 0.0, 1.0)
        if self.strikes is not None:
            checks.within("strikes", self.strikes, 0.0, 1.0)
        if self.runs is not None:
            checks.count("runs", self.runs)

    @property
    def allowed(self) -> float:
        """`strikes` under harmonics."""
        return 0.01 if self.strikes is None else self.strikes

    @property
    def broken(self) -> float:
        """`strikes` on ground motions: share that may break a limit."""
        return 0.1 if self.strikes is None else self.strikes
