"""The answer of `optimise`: what was found, how it was verified, and why a design was refused."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from tpd.answers.attractors import Starts
from tpd.answers.paired import Change
from tpd.answers.statistics import Interval
from tpd.core.formatting import Printed
from tpd.design.by_runs import PairedRuns, turned_in
from tpd.design.criteria import stroke_limit
from tpd.design.problem import Question
from tpd.design.search import Search
from tpd.design.survey import Survey
from tpd.design.verified import GRAVE, Bare, DesignStatus, LossCase, Nearest, Verified, one_of_a_kind
from tpd.scene.conditions import Conditions
from tpd.scene.scene import Pendulum, Scene

_LINES = 12
"""Most lines of a design as text."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One design and the bare block on one set of runs: all that a report says of shares is of these."""

    runs: str
    """Which runs they are."""
    saved: Interval
    """Share by which the mean tilt falls."""
    changes: tuple[Change, ...]
    strikes: float
    """Share of the runs that stand in which the bob strikes a wall, on ground motions any limit is broken;
    NaN where no room is asked for."""
    undecided: int
    """Pairs of runs without an answer, which are left out."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Design(Question, Printed):
    """The answer of `optimise`, with its question: lengths in m, masses in kg, angles in rad."""

    status: DesignStatus
    pendulum: Pendulum | None
    """None where no design is offered."""
    alike: np.ndarray | None = None
    """Least and largest (mu, lam, zeta), shape (2, 3), of designs that do as well as the one that is offered,
    as far as the runs of the search can tell; None where that is not known."""

    @property
    def strikes_allowed(self) -> float:
        """Share of the standing runs that may strike a wall or, on ground motions, break a limit."""
        return self.worth.broken if self.conditions.motions else self.worth.allowed

    def __str__(self) -> str:
        size, benefit = self.pendulum, self.saved
        parts = [self.status.value]
        if size is not None:
            rod = f"{size.mass:.4g} kg on {size.length:.4g} m"
            parts.append(f"pendulum: {rod}, damping ratio {size.damping_ratio:.3g}")
        if benefit is not None:
            parts.append(f"reduction of the mean tilt (95 % interval): {benefit.words()}")
        parts += [f"reason: {reason}" for reason in self.refusals]
        lines = [line for part in parts for line in textwrap.wrap(part, 100, subsequent_indent="  ")]
        return "\n".join(lines if len(lines) <= _LINES else [*lines[: _LINES - 1], "more: see `refusals`"])

    @property
    def swing(self) -> float:
        """Angle of the bob that its drawing shows, rad, 0 without a pendulum: the largest of the motions that
        count in which the block stands, settled under harmonic shaking."""
        raise NotImplementedError

    @property
    def saved(self) -> Interval | None:
        """Share by which the mean tilt falls with the pendulum that is offered, on runs that no choice has
        seen; None where none is offered, or nothing was judged on others."""
        raise NotImplementedError

    @property
    def risks(self) -> tuple[float, float]:
        """Risk with the design that is offered, NaN where none is, and without a pendulum."""
        raise NotImplementedError

    @property
    def comparison(self) -> Comparison | None:
        """The design that is offered or came nearest, on the runs that judged it; None if there are none."""
        raise NotImplementedError

    @property
    def refusals(self) -> tuple[str, ...]:
        """Sentences against the design that came nearest; empty where one is offered."""
        raise NotImplementedError

    @property
    def turned(self) -> np.ndarray:
        """Largest angles between rod and block, rad, of the best design in the runs that stand, on ground
        motions in those that it is tuned to. Empty without any."""
        raise NotImplementedError

    @property
    def harmful(self) -> bool:
        """Whether the block overturns more often, or the bob strikes, with the design that came nearest."""
        raise NotImplementedError

    def saved_under(self, scene: Scene, more: Conditions, runs: int) -> Interval:
        """Fall of the mean tilt with the pendulum that is offered, in a changed scene, under further
        conditions, on at most so many of the runs that judged."""
        raise NotImplementedError

    def again(self, **changed: Any) -> dict[str, Any]:
        """Arguments of `tpd.optimise` that ask the question again, with some of them changed."""
        return {f.name: getattr(self, f.name) for f in fields(Question)} | changed


@dataclass(frozen=True, kw_only=True, repr=False)
class HarmonicDesign(Design):
    """The answer of `optimise` for harmonic shaking. `print` shows a summary."""

    starts: Starts
    verified: tuple[Verified, ...]
    """Designs that were verified, in order; the last one is offered if it has no reason against it."""
    bare: Bare
    nearest: Nearest | None
    search: Search
    surveys: tuple[Survey, ...] = ()
    """Designs followed from rest: by the linear equations, then by the nonlinear."""
    losses: tuple[LossCase, ...] = ()
    """The offered design under other models of the block's losses."""
    settings: dict[str, object] = field(default_factory=dict)

    @property
    def winner(self) -> Verified | None:
        """The design offered, if any."""
        return self.verified[-1] if self.pendulum is not None else None

    @property
    def saved(self) -> Interval | None:
        """See `Design.saved`."""
        gain = None if self.winner is None else self.winner.benefit
        return None if gain is None else Interval(gain.value, gain.low, gain.high)

    @property
    def risks(self) -> tuple[float, float]:
        """See `Design.risks`."""
        return math.nan if self.winner is None else self.winner.value, self.bare.value

    @property
    def comparison(self) -> Comparison | None:
        """See `Design.comparison`."""
        v = self.best
        if v is None or v.paired is None or v.benefit is None:
            return None
        gain, fresh = v.benefit, "" if v.chosen_by is None else "fresh "
        seed = v.paired.hung.ensemble.seed
        return Comparison(
            runs=f"{gain.runs} {fresh}paired runs of the {v.paired.equations} equations, seed {seed}",
            saved=Interval(gain.value, gain.low, gain.high),
            changes=gain.changes,
            strikes=v.strikes,
            undecided=gain.undecided,
        )

    @property
    def refusals(self) -> tuple[str, ...]:
        """See `Design.refusals`: the gravest first, one of a kind."""
        reasons = () if self.best is None else self.best.reasons
        if self.status is DesignStatus.none_feasible and self.nearest is not None:
            reasons = self.nearest.broken
        return tuple(map(str, sorted(one_of_a_kind(reasons), key=lambda reason: reason.kind not in GRAVE)))

    @property
    def turned(self) -> np.ndarray:
        """See `Design.turned`: the sum of the largest bob angle and the largest tilt, never too little."""
        if self.best is None or self.best.paired is None:
            return np.zeros(0)
        return turned_in(self.best.paired.hung)

    @property
    def harmful(self) -> bool:
        """See `Design.harmful`."""
        reasons = () if self.best is None else self.best.reasons
        return any(reason.kind in GRAVE for reason in reasons)

    def saved_under(self, scene: Scene, more: Conditions, runs: int) -> Interval:
        """See `Design.saved_under`."""
        winner = self.winner
        assert winner is not None
        assert winner.paired is not None
        assert self.pendulum is not None
        ensemble = winner.paired.hung.ensemble
        # Where e is what is moved it does not scatter as well.
        width = ensemble.restitution if scene is self.scene else 0.0
        some = replace(ensemble, size=min(ensemble.size, runs), restitution=width)
        gain = PairedRuns(scene, self.conditions * more, some, self.worth, None).of(self.pendulum)[1]
        return Interval(gain.value, gain.low, gain.high)

    def again(self, **changed: Any) -> dict[str, Any]:
        """See `Design.again`."""
        return super().again(**{"starts": self.starts} | changed)

    @property
    def best(self) -> Verified | None:
        """The design offered or, where none is, that which comes nearest to being offered: of those that came
        to the paired runs, if any did, the one that misses its requirements by the least sum."""

        # The largest benefit alone is often that of a bob which strikes the walls in every run.
        def rank(v: Verified) -> tuple[bool, float, float]:
            return v.benefit is None, sum((reason.shortfall for reason in v.reasons), 0.0), v.value

        return self.winner or min(self.verified, key=rank, default=None)

    @property
    def amplitude(self) -> float:
        """Largest exact settled |phi| of all conditions with the pendulum, or without where there is none."""
        return float(np.max((self.bare if self.winner is None else self.winner).exact.amplitude))

    @property
    def amplitude_without(self) -> float:
        """Largest exact settled |phi| of all conditions without a pendulum, rad."""
        return float(np.max(self.bare.exact.amplitude))

    @property
    def stroke(self) -> float:
        """Largest exact settled |psi| of all conditions, rad; 0 without a pendulum."""
        return 0.0 if self.winner is None else float(np.max(self.winner.exact.stroke))

    @property
    def swing(self) -> float:
        """See `Design.swing`."""
        if self.winner is None:
            return 0.0
        # From other starts than rest the search may know larger strokes than the one from rest.
        asked = np.zeros(0) if self.starts == Starts.rest() else self.winner.evaluation.stroke[0]
        strokes = np.concatenate([self.winner.exact.stroke, asked])
        return float(np.max(strokes, where=np.isfinite(strokes), initial=0.0))

    @property
    def stroke_limit(self) -> float:
        """Largest settled |psi| allowed, rad."""
        return stroke_limit(self.limits)
