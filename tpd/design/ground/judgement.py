"""Groups of ground motions, those that a design is tuned to and those that it never saw, and its judgement on
them: paired with the bare block, run by run.

Two records of one earthquake are alike. Hence an earthquake is on one side only, and runs of one are no
independent observations: the clusters of `tpd.answers.statistics`."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from tpd.answers.ensemble import Ensemble
from tpd.answers.statistics import Interval, Lognormal, change, fall, fit_lognormal
from tpd.core import checks
from tpd.design.ground.objective import GroundObjective, Runs
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import GroundMotion, events_of
from tpd.scene.scene import Block

HELD_OUT = 0.5
"""Share of the motions that a design is not tuned to by default."""


class Role(enum.Enum):
    """Part of a group in the search."""

    tuned = "tuned to"
    held_out = "held out"


@dataclass(frozen=True)
class Group:
    """Ground motions that are counted together."""

    name: str
    role: Role
    motions: tuple[GroundMotion, ...]
    events: np.ndarray = field(default=None)  # type: ignore[assignment]
    """Number of the earthquake of every motion, shape (motions,), the same in all groups of a design; by
    default of this group alone."""

    def __post_init__(self) -> None:
        if self.events is None:
            object.__setattr__(self, "events", np.unique(events_of(self.motions), return_inverse=True)[1])


def unnamed(motions: Sequence[GroundMotion]) -> int:
    """Number of the records whose earthquake is not known."""
    return sum(getattr(m, "event", None) == "" for m in motions)


def grouped(
    motions: Sequence[GroundMotion], held_out: float | Mapping[str, Sequence[GroundMotion]], seed: int
) -> tuple[Group, ...]:
    """The group that a design is tuned to, first, and those that are held out.

    Args:
        motions: of the conditions.
        held_out: the share of the motions that are held out, whole earthquakes by a seeded choice; or groups
            of other motions by name, without those of an earthquake that the design is tuned to.
        seed: of the choice.

    Raises:
        ValueError: a share outside 0 to 0.9, a group without motions, or no motion left on one side.
    """
    if isinstance(held_out, Mapping):
        return _others(motions, held_out)
    share = checks.within("held_out", held_out, 0.0, 0.9)
    names = events_of(motions)
    events = np.random.default_rng([seed, 9]).permutation(np.unique(names))
    # Whole earthquakes, one after the other, until there are enough; one of several remains.
    out: set[str] = set()
    for event in events[: max(1, len(events) - 1)]:
        if sum(name in out for name in names) >= share * len(names):
            break
        out.add(str(event))
    inside = tuple(m for m, name in zip(motions, names, strict=True) if name not in out)
    outside = tuple(m for m, name in zip(motions, names, strict=True) if name in out)
    if not inside:
        raise ValueError(
            f"`held_out` must leave an earthquake to be tuned to, but of {len(events)} all are held out: "
            "give more records, name their earthquakes, or give 0, which holds out none"
        )
    numbers = np.unique(names, return_inverse=True)[1]
    held = np.array([name in out for name in names])
    tuned = Group("tuned to", Role.tuned, inside, numbers[~held])
    return (tuned, Group("held out", Role.held_out, outside, numbers[held])) if outside else (tuned,)


def _others(
    motions: Sequence[GroundMotion], held_out: Mapping[str, Sequence[GroundMotion]]
) -> tuple[Group, ...]:
    # An earthquake that the search has seen is no test.
    others = {}
    for name, listed in held_out.items():
        for i, motion in enumerate(listed):
            checks.instance(f"held_out[{name!r}][{i}]", motion, GroundMotion)
        # A motion without a name of its earthquake may be any: it stays.
        events = events_of([*motions, *listed])
        left = tuple(
            m
            for m, event in zip(listed, events[len(motions) :], strict=True)
            if event not in events[: len(motions)]
        )
        if not left:
            raise ValueError(
                "`held_out` must hold motions of other earthquakes than the design is tuned to, but "
                f"{name!r} has none"
            )
        others[name] = left
    # Over all groups together: an earthquake, or copies of one motion, in two of them are still one.
    every = [*motions, *(m for left in others.values() for m in left)]
    numbers = np.unique(events_of(every), return_inverse=True)[1]
    ends = np.cumsum([len(motions), *(len(left) for left in others.values())])
    parts = np.split(numbers, ends[:-1])
    held = (Group(n, Role.held_out, m, x) for (n, m), x in zip(others.items(), parts[1:], strict=True))
    return (Group("tuned to", Role.tuned, tuple(motions), parts[0]), *held)


SCATTERED = "slenderness", "friction", "mass", "length", "damping", "restitution"
"""Names of what is uncertain in a judgement: block and installation, as in the runs of an `Ensemble`."""


class Pairs(NamedTuple):
    """Runs of the nonlinear equations without the pendulum and with it, shape (2, runs)."""

    overturned: np.ndarray
    tilt: np.ndarray
    """Tilt over the slenderness, an overturning as 1."""
    clusters: np.ndarray
    """Number of the earthquake of every run, the same in all groups of a design, shape (runs,)."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A group of ground motions with and without the pendulum; shares are of the runs."""

    name: str
    role: Role
    motions: int
    events: int
    stripes: np.ndarray
    counts: tuple[np.ndarray, np.ndarray]
    """Motions that overturn the block at each stripe by the nonlinear equations, bare and hung."""
    unknown: tuple[np.ndarray, np.ndarray]
    """Motions without an answer at each stripe by these equations, bare and hung: they are in no count."""
    overturned: tuple[float, float]
    """Shares of the pairs with an answer that overturn, over all stripes, bare and hung."""
    difference: Interval
    """Share overturned with the pendulum minus that without, nonlinear equations."""
    linear: Interval
    """Difference by the linear equations, with which the search worked."""
    tilt: Interval
    """Difference of the mean tilt over the slenderness, an overturning as 1; nonlinear equations."""
    strikes: float
    """Share of the standing runs in which a limit is broken; nonlinear equations."""
    linear_strikes: float
    """This share by the linear equations."""
    changed: float
    """Share of the runs whose verdict the nonlinear equations change."""
    undecided: int
    """Runs without an answer, bare and hung, by both sets of equations: shares and means leave them out."""
    fits: tuple[Lognormal, Lognormal]
    """Curves of overturning, bare and hung."""
    runs: Pairs
    """The single runs."""
    ends: tuple[Judged, ...] = ()
    """The group with each run without an answer ended against the pendulum, and with each ended for it; empty
    where all runs have an answer."""

    @property
    def overturns_more(self) -> bool:
        """Whether the pendulum makes the block overturn more often, significantly."""
        return self.difference.is_above or self.linear.is_above


def scatter_of(block: Block, ensemble: Ensemble | None = None) -> dict[str, float]:
    """Relative half widths of what is uncertain in a block and its pendulum."""
    widths = (Ensemble() if ensemble is None else ensemble).widths(block.restitution)
    absent = () if block.friction else ("friction",)
    return {name: widths[name] for name in SCATTERED if widths[name] > 0.0 and name not in absent}


def judge(
    objective: GroundObjective,
    design: np.ndarray,
    group: Group,
    scales: Sequence[float],
    *,
    scatter: Mapping[str, float],
    seed: int,
    progress: Callable[[int, int], None] | None = None,
) -> Judged:
    """Follow the block without and with one design (mu, lam, zeta) through a group of motions at every scale,
    by the linear and the nonlinear equations, on the same scattered blocks."""
    intensity = objective.conditions.intensity
    conditions = Conditions.records(group.motions, scales, intensity=intensity, scatter=scatter, seed=seed)
    there = objective.over(conditions)
    # A bob without mass does not act on the block: both designs meet the same scattered blocks.
    both = np.stack([[0.0, *design[1:]], design])
    linear = there.evaluate(both, progress=progress)
    nonlinear = there.check(both, progress=progress)
    found = _judged(there, both, group, scales, linear, nonlinear)
    if not found.undecided:
        return found
    # Whatever the runs without an answer would have ended in lies between these two.
    ends = []
    for against in (True, False):
        ended = (x.ended(bare=not against, hung=against) for x in (linear, nonlinear))
        one = _judged(there, both, group, scales, *ended)
        # A run that stands may break a limit, which would be against the pendulum as well.
        stands = float(np.sum(~(nonlinear.overturned | nonlinear.undecided)[1]))
        unknown = found.unknown[1].sum()
        broken = found.strikes * stands + (unknown if against else 0.0)
        ends.append(replace(one, strikes=float(broken / max(stands + unknown, 1.0))))
    return replace(found, ends=tuple(ends))


def _judged(
    objective: GroundObjective,
    both: np.ndarray,
    group: Group,
    scales: Sequence[float],
    linear: Runs,
    nonlinear: Runs,
) -> Judged:
    """A group by its runs of the bare block and the hung one; pairs without an answer are left out."""
    every = np.repeat(group.events, len(scales))
    known, known_linear = (~x.undecided.any(axis=0) for x in (nonlinear, linear))
    clusters = every[known]
    fell, tilts = nonlinear.overturned[:, known], nonlinear.severity[:, known]
    fell_linear = linear.overturned[:, known_linear]
    both_known = known & known_linear
    differs = (linear.overturned != nonlinear.overturned)[:, both_known]
    per_stripe = [
        x.reshape(-1, len(scales)).sum(axis=0) for x in (*nonlinear.overturned, *nonlinear.undecided)
    ]
    return Judged(
        name=group.name,
        role=group.role,
        motions=len(group.motions),
        events=len(np.unique(clusters)),
        stripes=np.asarray(scales, dtype=float),
        counts=(per_stripe[0], per_stripe[1]),
        unknown=(per_stripe[2], per_stripe[3]),
        overturned=(_mean(fell[0]), _mean(fell[1])),
        difference=change(fell[1], fell[0], clusters),
        linear=change(fell_linear[1], fell_linear[0], every[known_linear]),
        tilt=change(tilts[1], tilts[0], clusters),
        strikes=objective.broken(nonlinear.at(slice(1, 2)), both[1:]),
        linear_strikes=objective.broken(linear.at(slice(1, 2)), both[1:]),
        changed=_mean(differs),
        undecided=int(linear.undecided.sum() + nonlinear.undecided.sum()),
        fits=(_fit(nonlinear, 0, scales, group.events), _fit(nonlinear, 1, scales, group.events)),
        runs=Pairs(fell, tilts, clusters),
    )


def _mean(values: np.ndarray) -> float:
    """Mean of all values; NaN of none."""
    return float(np.mean(values)) if values.size else math.nan


class Benefit(NamedTuple):
    """Changes by the pendulum over all held-out motions together."""

    overturned: Interval
    """Share of the runs that overturn."""
    tilt: Interval
    """Mean tilt over the slenderness, an overturning as 1."""
    saved: Interval
    """Share by which that mean falls."""


def pairs_of(judged: Sequence[Judged]) -> Pairs | None:
    """All pairs of runs of groups that have an answer; None without any."""
    held = [g.runs for g in judged if g.runs.clusters.size]
    return Pairs(*(np.concatenate(x, axis=-1) for x in zip(*held, strict=True))) if held else None


def benefit_of(judged: Sequence[Judged]) -> Benefit | None:
    """Benefit over all groups that were held out; None without any pair of runs that has an answer."""
    runs = pairs_of([g for g in judged if g.role is Role.held_out])
    if runs is None:
        return None
    fell, tilt, clusters = runs
    both = change(fell[1], fell[0], clusters), change(tilt[1], tilt[0], clusters)
    return Benefit(*both, fall(tilt[1], tilt[0], clusters))


def _fit(runs: Runs, row: int, scales: Sequence[float], events: np.ndarray) -> Lognormal:
    hits = np.where(runs.undecided[row], np.nan, runs.overturned[row])
    return fit_lognormal(np.asarray(scales, dtype=float), hits.reshape(-1, len(scales)), events)
