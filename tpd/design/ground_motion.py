"""Design problem under ground motions: pulses and records, and their use by the search and the validation.

Two records of one earthquake are similar. All records of an earthquake therefore belong to the same group.
Runs of one earthquake are not independent observations: they are the clusters of `tpd.answers.statistics`.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, compress
from typing import Any

import numpy as np

from tpd.answers.annual_rates import AnnualRates, rates_of_outcomes
from tpd.answers.ensemble import Ensemble
from tpd.answers.run_table import Runs, follow_runs, forcing_of
from tpd.answers.transient import FREE, MAX_EVENTS
from tpd.compiled.columns import NU, F, K
from tpd.compiled.rows import ground_row_of
from tpd.core import checks
from tpd.core.formatting import number, pair_of
from tpd.core.progress import Progress
from tpd.design.problem import MOST_MOTIONS, STATED, Problem, Variation, Words
from tpd.design.reasons import DesignStatus, ReasonKind
from tpd.design.refine import Refinement, refine
from tpd.design.risk import Risk
from tpd.design.settings import SCATTERED, GroundSearch
from tpd.design.space import DesignSpace
from tpd.limits import LIMIT_KINDS, Clearance, Stroke, usual_stroke
from tpd.records.intensity import SPECTRAL_DAMPING, intensity_of, measure_of, spectral_acceleration
from tpd.scene.conditions import Conditions, HalfWidth, under_each
from tpd.scene.ground_motion import LEAST_EARTHQUAKES, STANDARD_GRAVITY, GroundMotion, Pulse, earthquakes_of
from tpd.scene.parameters import unchecked
from tpd.scene.record import Record
from tpd.scene.scene import NO_PENDULUM, Block, Scene
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import AtRest
from tpd.theory.relative_length import relative_length

LEVELS = 16
"""Number of validation runs of each motion, at levels between the smallest and the largest stated one. With
four levels the standard deviation of the reduction is half as large again."""
_UNIT = Pulse.one_sine(acceleration=1.0, frequency=1.0)
"""Motion with a peak of 1 m/s^2."""
_TRIAL_RUNS, _MORE_RUNS, _PULSES = 192, 384, 2
"""Numbers of runs of a trial and of a comparison, and their factor if all motions are pulses, whose runs are
shorter. With fewer conditions each has several runs, with other samples of the quantities that vary."""
_EVENTS = 20_000
"""Largest number of events of a trial run, in addition to one for each piece of the motion. This is
sufficient also for a bob that swings for a long time."""
PERIODS = 0.05, 8.0
"""Shortest and longest period (s) of a base isolation under ground motions."""
_CODE_PERIOD = 475
"""Return period in years for which codes design ordinary structures."""
_USUAL_LENGTH, _SLOW = 0.65, 1.5
"""Length ratio of the rule of thumb for earthquakes, and smallest x = l omega^2/g of a pendulum that is
slower than the ground motion."""
_STEP, _STEEPEST = 0.02, 20.0
"""Smallest step between two periods, relative, and largest slope of the logarithm of a response spectrum over
the logarithm of the period that the steps allow for. With 5 % damping the slope is at most 10 near a
resonance."""


class Role(enum.Enum):
    """Use of a group of motions: by the search, by the validation, or by both with cross-fitting."""

    tuned = "search"
    validation = "validation"
    both = "all"


@dataclass(frozen=True)
class Group:
    """Ground motions that are counted together."""

    name: str
    """Name in reports."""
    role: Role
    """Whether the search, the validation or both use the group."""
    motions: tuple[GroundMotion, ...]
    """Ground motions of the group."""
    events: np.ndarray
    """Number of the earthquake of every motion, shape (motions,). The numbers are common to all groups of a
    design."""


@dataclass(frozen=True, kw_only=True, repr=False)
class GroundMotionProblem(Problem):
    """Design problem under ground motions."""

    groups: tuple[Group, ...]  # type: ignore[misc]
    """Motions that the search uses, followed by the motions that are kept for the validation."""
    # The same earthquakes validate all designs. A second design of the search is validated only if the
    # benefit of the first is sufficient and limits are the only reason against it. Otherwise several designs
    # could be validated until the benefit of one of them is large by chance.
    attempts = 2
    retries = frozenset(
        {ReasonKind.breaks_limit, ReasonKind.touches_wall, ReasonKind.exceeds_limit, ReasonKind.slides}
    )
    # The design reaches its limits under the motions of the search. Other earthquakes may cause a
    # larger swing, so the trials leave a part of every limit unused.
    spare = 0.05
    defaults = Problem.defaults | {
        "risk": Risk.expected(),
        "limits": (Stroke(), Clearance()),
        "method": GroundSearch(),
        "ensemble": Ensemble(),
        "validation_share": None,
    }
    has_earthquakes = True
    usual_contacts = 0.1

    @staticmethod
    def of(
        subject: Scene | Block, conditions: Conditions, space: DesignSpace | None = None, **inputs: Any
    ) -> GroundMotionProblem:
        """Return the problem of a block under ground motions. None stands for the default.

        Args:
            subject: the block, or a scene for its gravity. The motion of the scene is not used.
            conditions: result of `Conditions.records`.
            space: bounds of the search; default `DesignSpace()`.
            inputs: further arguments of `tpd.optimise`. Some have another meaning or default. The default
                risk is `Risk.expected()` over the severities of all trial runs. The default limits are the
                stroke and the clearance to the walls, at all times. In `requirements`, `wall_contacts` is the
                share of the standing runs that may exceed any limit, and `at_least` is the smallest reduction
                of the measure over all validation motions. The half widths in `ensemble` are those of block
                and installation in the validation runs.

        Raises:
            ValueError: an input is out of range, or does not fit the excitation.
            RuntimeError: JAX is in 32-bit mode.
        """
        checks.instance("scene", subject, (Scene, Block))
        scene = Scene(subject, conditions.motions[0]) if isinstance(subject, Block) else subject
        checked = GroundMotionProblem.checked(scene, space=space, **inputs)
        for limit in checked["limits"]:
            if not limit.of_motion:
                names = ", ".join(kind.__name__ for kind in LIMIT_KINDS if kind.of_motion)
                has = checks.quote(limit)
                raise ValueError(f"`limits` under ground motions must be {names}, but has {has}")
        groups = grouped(conditions.motions, checked.pop("validation_share"), checked["seed"])
        inside = _with_motions(conditions, groups[0].motions)
        # Reject settings without effect, because a user would rely on them.
        for name, usual in vars(GroundMotionProblem.defaults["ensemble"]).items():
            if name not in SCATTERED and getattr(checked["ensemble"], name) != usual:
                raise ValueError(f"`ensemble.{name}` needs harmonics, but the conditions are ground motions")
        if conditions.hazard is not None:
            conditions.hazard.factor(measure_of(conditions.intensity, scene.block, scene.gravity, None))
        scene = Scene(scene.block, inside.motions[0], float(scene.gravity))
        return GroundMotionProblem(scene=scene, conditions=inside, groups=groups, **checked)

    @property
    def inputs(self) -> dict[str, Any]:
        """Inputs as in `Problem.inputs`, with the validation motions instead of the groups."""
        inputs, others = super().inputs, {g.name: g.motions for g in self.groups if g.role is Role.validation}
        is_crossed = inputs.pop("groups")[0].role is Role.both
        return inputs | {"validation_share": None if is_crossed else others or 0.0}

    @property
    def scatter(self) -> dict[str, HalfWidth]:
        """See `Problem.scatter`: only properties of the block and of the installation vary."""
        return {name: width for name, width in super().scatter.items() if name in SCATTERED}

    @property
    def passing_status(self) -> DesignStatus:  # type: ignore[override]
        """See `Problem.passing_status`."""
        counts = {
            role: len(np.unique(np.concatenate([g.events for g in self.groups if g.role is role])))
            for role in {g.role for g in self.groups}
        }
        if [*counts] == [Role.tuned]:
            return DesignStatus.tuned_only
        few = min(counts.values()) < LEAST_EARTHQUAKES
        return DesignStatus.too_few if few else DesignStatus.recommended

    @property
    def of_all(self) -> GroundMotionProblem:
        """The problem in which all earthquakes validate a design, because none of them chose it."""
        motions, events = (m for g in self.groups for m in g.motions), [g.events for g in self.groups]
        every = Group("all records", Role.both, tuple(motions), np.concatenate(events))
        # Without motions for the validation a verdict is on these motions only.
        return self if len(self.groups) == 1 else replace(self, groups=(every,))

    @property
    def crossed(self) -> tuple[tuple[GroundMotionProblem, np.ndarray], ...]:  # type: ignore[override]
        """For each group of earthquakes the problem whose search does not use it, and whether each validation
        run belongs to the group; empty without cross-fitting, or with fewer earthquakes than groups."""
        first = self.groups[0]
        if first.role is not Role.both or len(np.unique(first.events)) < self.method.groups:
            return ()
        # The numbers of earthquakes follow from their accelerations, in an order of chance.
        events, out = np.unique(first.events, return_inverse=True)[1] % self.method.groups, []
        for k in range(self.method.groups):
            used = tuple(compress(first.motions, events != k))
            conditions = _with_motions(self.conditions, used)
            group = Group(first.name, Role.tuned, used, first.events[events != k])
            other = replace(self, conditions=conditions, groups=(group,))
            out.append((other, np.repeat(events == k, self._count)))
        return tuple(out)

    @property
    def at_rest(self) -> AtRest:
        """See `Problem.at_rest`."""
        # The validation motions count as well, at the largest stated level. Conditions of the search with
        # factors on other quantities than the amplitude are additional conditions.
        every = replace(
            self._every_motion(), factors={"amplitude": np.full(self.limit_runs, self._scales[-1])}
        )
        cases = [every, *([self.conditions] if len(self.conditions.factors) > 1 else [])]
        # The excitation of a condition is the peak of its motion times its factor.
        rows = np.concatenate([self._rows(None, self.scene, case) for case in cases])
        return AtRest.of(rows[:, NU], rows[:, K], rows[:, F], self.scene.block.base_friction)

    @property
    def words(self) -> Words:
        """See `Problem.words`."""
        listed = ", ".join(f"{g.name}: {len(g.motions)}" for g in self.groups)
        return Words(
            excitation=f"ground motions from rest ({listed})",
            scope=f"ground motions from rest ({listed})",
            assumed=f"horizontal ground motions from rest: {'; '.join(self.conditions.description)}",
            starts="block and bob begin at rest",
            duration=f"runs over the whole motion, and {FREE:g} s beyond its end",
        )

    def isolation(self, level: float) -> tuple[np.ndarray, float]:
        """See `Problem.isolation`. The period is the one from which on the response spectrum stays below the
        acceleration."""
        lifts, weakest = self.at_rest.uplift * float(self.scene.gravity), self._weakest
        # The strongest of the motions has the peak acceleration of the level.
        factor = level * float(self.scene.gravity) / max(float(motion.pga) for motion in weakest)
        periods = [isolation_period(motion.scaled(factor), lifts) for motion in weakest]
        return np.array(periods), SPECTRAL_DAMPING

    @property
    def _weakest(self) -> list[GroundMotion]:
        """Every motion at its lowest level."""
        return self._scaled(self._every_motion(stated=True))[:: len(self._scales)]

    @property
    def usual_level(self) -> tuple[float, str]:
        """See `Problem.usual_level`. With a hazard it is the level that is exceeded once in 475 years, and
        otherwise the lowest level of the job, for the motion with the largest peak acceleration."""
        # The strongest level of a job would ask for a tie that no code requires.
        hazard, gravity = self.conditions.hazard, float(self.scene.gravity)
        if hazard is not None and hazard.intensity == "pga":
            return hazard.level(1.0 / _CODE_PERIOD), f"once in {_CODE_PERIOD} years"
        return max(float(motion.pga) for motion in self._weakest) / gravity, "lowest level"

    def first_overturning(self, runs: Runs) -> str:
        """See `Problem.first_overturning`."""
        motions: list[Any] = [m for g in self.groups for m in g.motions]
        if not _are_pulses(motions) or len(motions) == 1:
            return ""
        falls: list[Any] = list(compress(self.stated_motions, runs.is_overturned))
        if not falls:
            return "no pulse of the band overturns the block"
        period, pga = 1.0 / max(m.frequency for m in falls), min(m.pga for m in falls) / STANDARD_GRAVITY
        least = f"a period of {number(period, 3)} s and from a PGA of {number(pga, 3)} g"
        return f"pulses overturn the block from {least} on, in {len(falls)} of {len(runs.nu)} runs"

    def improver(self, guess: np.ndarray | None, progress: Progress) -> Refinement:
        """See `Problem.improver`: the first trials are spread over the design space."""
        spread = self.space.sample(np.random.default_rng([self.seed, 7]), self.method.designs)
        candidates = spread if guess is None else np.concatenate([guess[None], spread])
        return refine(self, candidates, self.method.steps, progress)

    def trial_runs(self, design: np.ndarray | None, seed: int, equations: str = Terms.linear.value) -> Runs:
        """See `Problem.trial_runs`. The runs are every motion at every scale, with blocks that vary as in the
        validation."""
        # Without this variation the trials would show a smaller swing than the validation.
        least = _TRIAL_RUNS if equations == Terms.linear.value else _MORE_RUNS
        least *= _PULSES if _are_pulses(self.conditions.motions) else 1
        repeats = max(1, round(least / len(self.conditions))) if self.scatter else 1
        some = (self.conditions * Conditions({"amplitude": np.ones(repeats)})).scattered(seed, **self.scatter)
        return self._simulate(design, some, Variation(equations=equations))

    @property
    def rule_sizes(self) -> tuple[float, float, float]:
        """See `Problem.rule_sizes`. For earthquakes a rod of about a third of the height is best, and one
        that is not slower than the ground motion may do harm."""
        z, gravity = float(self.scene.block.centroid), float(self.scene.gravity)
        motions = [m for m in self.conditions.motions if isinstance(m, (Pulse, Record))]
        x = np.median([float(relative_length(z, m, gravity=gravity)) for m in motions])
        return _USUAL_LENGTH, _SLOW / float(x), usual_stroke(self.limits)

    def validation_runs(
        self, design: np.ndarray | None, seed: int, varied: Variation = STATED, progress: Any = None
    ) -> Runs:
        """See `Problem.validation_runs`. The runs are every motion of every group at every level. A design
        may differ between runs: then it has a row for each run."""
        scatter = self.scatter
        if varied.fixes_restitution:
            scatter.pop("restitution", None)
        # Linear runs only compare variations, for which the stated levels suffice.
        is_linear = varied.equations == Terms.linear.value
        conditions = self._every_motion(scatter, seed, stated=is_linear) * varied.more
        runs = self._simulate(design, conditions, varied, seed=seed, progress=progress)
        events = np.concatenate([g.events for g in self.groups])
        return replace(runs, cluster=np.repeat(events, len(conditions) // len(events)))

    def _groups_of(self, runs: Runs) -> dict[str, Any]:
        """Return the group of motions of each run, and whether the benefit counts it: it counts only the
        motions that are kept for the validation, if there are any."""
        # Every motion has the same number of runs.
        sizes = np.array([len(g.motions) for g in self.groups])
        group = np.repeat(np.arange(len(self.groups)), sizes * (len(runs.nu) // sizes.sum()))
        counted = np.array([g.role is Role.validation for g in self.groups])[group]
        labels = tuple(g.name for g in self.groups)
        return {"group": group, "labels": labels, "counted": counted if counted.any() else None}

    @property
    def _scales(self) -> list[float]:
        return sorted(set(self.conditions.scales))

    @property
    def _count(self) -> int:
        """Number of validation runs of each motion."""
        return LEVELS if len(self._scales) > 1 else 1

    @property
    def edges(self) -> np.ndarray:  # type: ignore[override]
        """Ends of the strata of the levels, shape (levels + 1,)."""
        return np.geomspace(self._scales[0], self._scales[-1], self._count + 1)

    @property
    def levels(self) -> dict[str, np.ndarray]:  # type: ignore[override]
        """See `Problem.levels`."""
        return self.level_ranges(LEVELS)

    def level_ranges(self, most: int) -> dict[str, np.ndarray]:
        """See `Problem.level_ranges`."""
        if self._count == 1:
            return {}
        level, edges = np.tile(np.arange(LEVELS), self.limit_runs // LEVELS), self.edges.tolist()
        ranges = np.array_split(np.arange(LEVELS), min(LEVELS, most))
        ends = (pair_of(edges[i[0]], edges[i[-1] + 1], 3) for i in ranges)
        return {" to ".join(pair): np.isin(level, i) for pair, i in zip(ends, ranges, strict=True)}

    def annual_rates(self, cases: Sequence[Runs], counted: np.ndarray | None = None) -> AnnualRates | None:
        """See `Problem.annual_rates`."""
        if (hazard := self.conditions.hazard) is None:
            return None
        measure = measure_of(self.conditions.intensity, self.scene.block, self.scene.gravity, None)
        # Consecutive runs have one motion at all levels.
        n, hits = self._count, [np.where(x.is_unanswered, np.nan, x.is_overturned) for x in cases]
        motions = slice(None) if counted is None else counted[::n]
        outcomes = np.reshape(hits, (len(cases), -1, n))[:, motions]
        edges, quakes = self.edges * hazard.factor(measure), self.earthquakes[::n][motions]
        return None if n == 1 else rates_of_outcomes(hazard, edges, outcomes, quakes)

    @property
    def earthquakes(self) -> np.ndarray:  # type: ignore[override]
        """See `Problem.earthquakes`."""
        return np.repeat(np.concatenate([g.events for g in self.groups]), self._count)

    @property
    def stated_motions(self) -> list[GroundMotion]:
        """See `Problem.stated_motions`."""
        return self._scaled(self._every_motion())

    def _scaled(self, conditions: Conditions) -> list[GroundMotion]:
        """Return the motion of every condition with its size."""
        factors, which = motion_factors(self.scene, conditions), np.asarray(conditions.which)
        return [conditions.motions[i].scaled(float(x)) for i, x in zip(which, factors, strict=True)]

    @property
    def limit_runs(self) -> int:
        """See `Problem.limit_runs`."""
        return self._count * sum(len(group.motions) for group in self.groups)

    def _every_motion(
        self, scatter: Mapping[str, HalfWidth] | None = None, seed: int = 0, *, stated: bool = False
    ) -> Conditions:
        """Return every motion of every group at every level, with the stated block or blocks that vary.

        Several levels are drawn from the strata between `edges`, for each motion by its accelerations. They
        are therefore the same in all cases, for all seeds and in all commands. With `stated` the levels are
        the stated ones.
        """
        motions, edges = [m for g in self.groups for m in g.motions], np.log(self.edges)
        scales = self._scales if stated else self.edges[1:]
        out = Conditions.records(motions, scales, intensity=self.conditions.intensity)
        if self._count > 1 and not stated:
            draws = [np.random.default_rng(int(m.digest[:16], 16)).random(LEVELS) for m in motions]
            levels = np.exp(edges[:-1] + np.diff(edges) * np.array(draws))
            out = replace(out, factors={"amplitude": levels.ravel()})
        return out.scattered(seed, **(scatter or {}))

    def strongest_motions(self, design: np.ndarray) -> list[GroundMotion]:
        """See `Problem.strongest_motions`."""
        runs = self._simulate(design, self.conditions, Variation(equations=Terms.linear.value))
        # Overturning runs come last and are then left out, because their loads do not matter.
        order = np.argsort(-np.where(runs.stands, np.nan_to_num(runs.rod_angle), -1.0))
        strongest = [i for i in order if runs.stands[i]][:MOST_MOTIONS]
        motions = self._scaled(self.conditions)
        return [motions[i] for i in strongest]

    def _simulate(
        self, design: np.ndarray | None, conditions: Conditions, varied: Variation, **how: Any
    ) -> Runs:
        """Simulate a design from rest through the motions of all conditions, and the free motion
        afterwards."""
        most = MAX_EVENTS if varied.equations == Terms.nonlinear.value else _EVENTS
        scene, condition = varied.scene or self.scene, np.asarray(conditions.which)
        forcing = forcing_of(conditions.motions, FREE * float(scene.rate), condition)
        how |= {"events": most, "condition": condition}
        return follow_runs(Terms(varied.equations), self._rows(design, scene, conditions), forcing, **how)

    def _rows(self, design: np.ndarray | None, scene: Scene, conditions: Conditions) -> np.ndarray:
        """Return the parameters of a design under all conditions as rows (n, 10) of compiled code."""
        which, motions = np.asarray(conditions.which), conditions.motions
        # Another block has the same motions as the stated one.
        factor = motion_factors(self.scene, conditions)
        unit = Scene(scene.block, _UNIT, scene.gravity)
        # The factor on the amplitude is in units of the intensity, and is applied to each motion below.
        factors = {**conditions.factors, "amplitude": np.ones(len(which))}
        p = replace(unit.ground_parameters(), kappa=self.space.hinge_ratio(scene.block))
        # A block with another centroid has the same rod.
        own = [1.0, float(self.scene.block.centroid / scene.block.centroid), 1.0]
        rows = np.broadcast_to(NO_PENDULUM if design is None else design * np.array(own), (len(which), 3))
        q = under_each(p, rows.T, replace(conditions, factors=factors).factor_rows().T)
        # The parameters were computed for a peak of 1 m/s^2: scale f by the peaks, and the pieces by their
        # durations.
        f = np.array([float(x.pga) for x in motions])
        h = np.array([float(x.piece) for x in motions]) * float(unit.rate)
        # With a higher frequency the pieces of a motion are shorter.
        pieces = h[which] / conditions.column("frequency")
        return ground_row_of(unchecked(q, f=q.f * f[which]), size=factor, piece=pieces)


def _are_pulses(motions: Sequence[Any]) -> bool:
    return all(isinstance(motion, Pulse) for motion in motions)


def _with_motions(conditions: Conditions, motions: Sequence[GroundMotion]) -> Conditions:
    """Return the conditions with some of their motions."""
    # Compare by identity, because two equal records may belong to the search and to the validation.
    used = [i for i, m in enumerate(conditions.motions) if any(m is own for own in motions)]
    which = np.asarray(conditions.which)
    rows = np.isin(which, used)
    return replace(
        conditions,
        factors={name: factor[rows] for name, factor in conditions.factors.items()},
        motions=tuple(conditions.motions[i] for i in used),
        which=np.searchsorted(used, which[rows]),
    )


def motion_factors(scene: Scene, conditions: Conditions) -> np.ndarray:
    """Return the factor of every condition on its ground motion, (n,)."""
    measure = intensity_of(conditions.intensity, scene.block, float(scene.gravity), None)
    # A scale is a value of the intensity, which is proportional to the motion.
    one = np.array([measure.value(m) for m in conditions.motions])
    return conditions.column("amplitude") / one[np.asarray(conditions.which)]


def isolation_period(motion: GroundMotion, acceleration: float) -> float:
    """Return the period (s) from which on the response spectrum of a motion stays below an acceleration
    (m/s^2); infinite if it is above at 8 s, and 0 if it is below at all periods."""
    shortest, period = PERIODS

    def excess(t: float) -> float:
        return math.log(spectral_acceleration(motion, t) / acceleration)

    if (above := excess(period)) > 0.0:
        return math.inf
    # A spectrum may fall and rise again, so that the search begins at the longest period. Far below the
    # acceleration its steps may be longer.
    while period > shortest:
        longer, period = period, period / (1.0 + max(_STEP, -above / _STEEPEST))
        if (above := excess(period)) > 0.0:
            # The import takes a third of a second, and other searches do without it.
            from scipy.optimize import root_scalar

            return float(root_scalar(excess, bracket=(period, longer), xtol=1e-4).root)
    return 0.0


def grouped(
    motions: Sequence[GroundMotion],
    validation_share: float | Mapping[str, Sequence[GroundMotion]] | None,
    seed: int,
) -> tuple[Group, ...]:
    """Return the group that the search uses, followed by the groups for the validation.

    By default there is one group, which the search and the validation use.

    Args:
        motions: motions of the conditions.
        validation_share: share of the motions that is kept for the validation, by a seeded choice of whole
            earthquakes; or groups of other motions by name. A motion of an earthquake that the search uses is
            left out of these groups. None stands for cross-fitting.
        seed: seed of the choice.

    Raises:
        ValueError: the share is outside 0 to 0.9, a group has no motions, or no motion remains for the
            search.
    """
    if isinstance(validation_share, Mapping):
        return _others(motions, validation_share)
    numbers = earthquakes_of(motions)
    if validation_share is None:
        return (_group(Role.both, motions, numbers),)
    share = checks.within("validation_share", validation_share, 0.0, 0.9)
    events = np.random.default_rng([seed, 9]).permutation(np.unique(numbers))
    # Move whole earthquakes to the validation, one after the other, until the share is reached. At least one
    # of several earthquakes remains for the search.
    is_outside = np.zeros(len(numbers), dtype=bool)
    for event in events[: max(1, len(events) - 1)]:
        if is_outside.sum() >= share * len(numbers):
            break
        is_outside |= numbers == event
    inside, outside = (tuple(compress(motions, is_outside == out)) for out in (False, True))
    if not inside:
        raise ValueError(
            f"`validation_share` must leave an earthquake for the search, but it uses all {len(events)}: "
            "give more records, state their earthquakes by `records.events` (--event FILE=NAME), or give 0 "
            "to use all of them in the search"
        )
    tuned = _group(Role.tuned, inside, numbers[~is_outside])
    return (tuned, _group(Role.validation, outside, numbers[is_outside])) if outside else (tuned,)


def _group(role: Role, motions: Sequence[GroundMotion], events: np.ndarray) -> Group:
    """Return the group with a role, by which it is named. A pulse is no record."""
    is_record = any(isinstance(motion, Record) for motion in motions)
    name = f"{role.value} {'records' if is_record else 'pulses'}"
    return Group(name, role, tuple(motions), events)


def _others(
    motions: Sequence[GroundMotion], validation_share: Mapping[str, Sequence[GroundMotion]]
) -> tuple[Group, ...]:
    for name, listed in validation_share.items():
        for i, motion in enumerate(listed):
            checks.instance(f"validation_share[{name!r}][{i}]", motion, GroundMotion)
    # Number the earthquakes over all groups together: an earthquake, or copies of one motion, in two groups
    # must have the same number.
    numbers = earthquakes_of([*motions, *chain(*validation_share.values())])
    used, *parts = np.split(numbers, np.cumsum([len(motions), *map(len, validation_share.values())])[:-1])
    groups = [_group(Role.tuned, motions, used)]
    for (name, listed), events in zip(validation_share.items(), parts, strict=True):
        # An earthquake that the search uses does not test the design, so its motions are left out of the
        # group. A motion without the name of its earthquake is never left out.
        is_new = ~np.isin(events, used)
        if not is_new.any():
            raise ValueError(
                "`validation_share` must contain motions of earthquakes that the search does not use, but "
                f"{name!r} has none"
            )
        groups.append(Group(name, Role.validation, tuple(compress(listed, is_new)), events[is_new]))
    return tuple(groups)
