"""Design problem under ground motions: pulses and records, some of which are held out for the validation.

Two records of one earthquake are alike. Hence an earthquake is on one side only, and runs of one earthquake
are no independent observations: they are the clusters of `tpd.answers.statistics`."""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from tpd.answers.ensemble import Ensemble
from tpd.answers.paired import PairedRuns
from tpd.answers.runs import Runs, follow_runs
from tpd.answers.transient import FREE, MAX_EVENTS
from tpd.core import checks
from tpd.core.progress import Progress, unreported
from tpd.design.criteria import (
    KINDS,
    Clearance,
    DesignSpace,
    Limit,
    Requirements,
    Risk,
    Stroke,
)
from tpd.design.problem import MOST_MOTIONS, STATED, Problem, Variation, complete
from tpd.design.reasons import DesignStatus
from tpd.design.settings import DEFAULT_SPACE, SCATTERED, VALIDATION_SHARE, GroundSearch
from tpd.exact.rows import row_of
from tpd.exact.runs import GroundForcing
from tpd.exact.terms import F
from tpd.records.intensity import intensity_of
from tpd.records.read import BUILT_IN
from tpd.scene.conditions import Conditions, latin_hypercube, under_all
from tpd.scene.ground_motion import GroundMotion, Pulse, events_of
from tpd.scene.parameters import Parameters, unchecked
from tpd.scene.record import Record
from tpd.scene.scene import STANDARD_GRAVITY, Block, Scene
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import AtRest

_USUAL = {
    "space": DEFAULT_SPACE,
    "risk": Risk.expected(),
    "limits": (Stroke(), Clearance()),
    "method": GroundSearch(),
    "ensemble": Ensemble(),
    "requirements": Requirements(),
    "seed": 0,
}
"""Inputs by default."""
LEAST_EARTHQUAKES = 5
"""Earthquakes that a design must be tuned to, and as many that it must be validated on: of fewer the spread
between earthquakes is hardly known."""
_MASSLESS = np.array([0.0, 1.0, 0.3])
"""A bob without mass, which the block does not feel."""
_EVENTS = 20_000
"""Events of a trial run beyond one for each piece: a bob that swings for long needs no more."""


class Role(enum.Enum):
    """Part of a group in the search."""

    tuned = "tuned to"
    validation = "validation"


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


@dataclass(frozen=True, kw_only=True, repr=False)
class GroundMotionProblem(Problem):
    """A design problem under ground motions."""

    groups: tuple[Group, ...]  # type: ignore[misc]
    """Motions that the design is tuned to, and those that are held out."""
    # The held-out earthquakes are few: only one design can be validated on them.
    attempts: ClassVar[int] = 1
    has_validation_runs: ClassVar[bool] = False
    # Other earthquakes take more room than those that a design is tuned to, which lies on its limits there.
    spare: ClassVar[float] = 0.05

    @staticmethod
    def of(
        subject: Scene | Block,
        conditions: Conditions,
        space: DesignSpace | None = None,
        *,
        validation_share: float | Mapping[str, Sequence[GroundMotion]] | None = None,
        **given: Any,
    ) -> GroundMotionProblem:
        """Return the problem of a block; None stands for the default everywhere.

        Args:
            subject: the block, or a scene with its gravity, whose motion is not used.
            conditions: from `Conditions.records`.
            space: bounds of the search; default `DesignSpace(damping_ratio=(0.05, 1))`.
            validation_share: share of the motions, whole earthquakes by a seeded choice, that validate the
                design and that the search does not use; or groups of other motions by name; default 0.5.
            given: further arguments of `tpd.optimise`. By default the risk is `Risk.expected()`, of the
                severities of all trial runs, and the limits are the stroke and the clearance between the
                walls, at all times. In `requirements`, `wall_contacts` is the share of the runs in which the
                block stands that may exceed a limit, and `at_least` the least share by which the measure over
                all validation motions must fall. The half widths in `ensemble` are those of block and
                installation in the validation runs.

        Raises:
            ValueError: bad input.
            RuntimeError: JAX is in 32-bit mode.
        """
        checks.instance("scene", subject, (Scene, Block))
        scene = Scene(subject, conditions.motions[0]) if isinstance(subject, Block) else subject
        found = complete(scene, _USUAL, given | {"space": space})
        check_ground_limits(found["limits"])
        groups = grouped(
            conditions.motions,
            VALIDATION_SHARE if validation_share is None else validation_share,
            found["seed"],
        )
        # By identity: two records may be equal, and belong to both sides.
        kept = [i for i, m in enumerate(conditions.motions) if any(m is own for own in groups[0].motions)]
        which = np.asarray(conditions.which)
        rows = np.isin(which, kept)
        inside = replace(
            conditions,
            factors={name: factor[rows] for name, factor in conditions.factors.items()},
            motions=tuple(conditions.motions[i] for i in kept),
            which=np.searchsorted(kept, which[rows]),
        )
        # A setting without effect would let somebody believe in it.
        for name, usual in vars(_USUAL["ensemble"]).items():
            if name not in SCATTERED and getattr(found["ensemble"], name) != usual:
                raise ValueError(f"`ensemble.{name}` is for harmonics, but the conditions are ground motions")
        scene = Scene(scene.block, inside.motions[0], float(scene.gravity))
        return GroundMotionProblem(scene=scene, conditions=inside, groups=groups, **found)

    @property
    def inputs(self) -> dict[str, Any]:
        """See `Problem.inputs`."""
        held = {g.name: g.motions for g in self.groups if g.role is Role.validation}
        given = super().inputs
        del given["groups"]
        return given | {"validation_share": held or 0.0}

    @property
    def tables(self) -> dict[str, dict[str, Any]]:
        """See `Problem.tables`: each motion must be a built-in record, or the only one a pulse."""
        held = [_name_of(m) for g in self.groups for m in g.motions if g.role is Role.validation]
        motions, of = self.conditions.motions, self.conditions
        # A job states PGA in g.
        unit = STANDARD_GRAVITY if of.intensity == "pga" else 1.0
        scales = [float(f"{x / unit:.12g}") for x in of.scales]
        motion: dict[str, Any] = {"scales": scales, "intensity": of.intensity.removesuffix("_g")}
        if len(motions) == 1 and isinstance(pulse := motions[0], Pulse) and not held:
            motion |= {"pulse": pulse.kind, "pulse_frequency": pulse.frequency}
            motion["pga"] = float(pulse.pga) / STANDARD_GRAVITY
            if "-" in pulse.kind[6:]:
                motion |= {name: getattr(pulse, name) for name in ("cycles", "phase")}
        else:
            motion |= {"records": [_name_of(m) for m in motions], "validation_share": held or 0.0}
        return super().tables | {
            "motion": motion,
            "requirements": vars(self.requirements),
            "ensemble": {name: getattr(self.ensemble, name) for name in SCATTERED},
        }

    @property
    def rounds(self) -> tuple[int, int]:
        """See `Problem.rounds`: one design after the other."""
        return self.method.steps, 1

    @property
    def allowed(self) -> float:
        """See `Problem.allowed`."""
        return self.requirements.broken

    @property
    def scatter(self) -> dict[str, float]:
        """See `Problem.scatter`: only block and installation scatter."""
        return {name: width for name, width in super().scatter.items() if name in SCATTERED}

    @property
    def evidence(self) -> DesignStatus:
        """See `Problem.evidence`."""
        events = ([g.events for g in self.groups if g.role is role] for role in Role)
        tuned, held = (len(np.unique(np.concatenate([*found, []]))) for found in events)
        if not held:
            return DesignStatus.tuned_only
        return DesignStatus.recommended if min(tuned, held) >= LEAST_EARTHQUAKES else DesignStatus.too_few

    @property
    def at_rest(self) -> AtRest:
        """See `Problem.at_rest`."""
        q, rows = self._rows(_MASSLESS, self.scene, self.conditions)
        return AtRest.of(q.nu, q.k, rows[:, F], self.scene.block.base_friction)

    def candidates(self, progress: Progress) -> tuple[np.ndarray, None]:
        """See `Problem.candidates`: designs spread over the space."""
        rng = np.random.default_rng([self.seed, 7])
        return self.space.unscaled(latin_hypercube(rng, self.method.starts, len(self.space.names))), None

    def trial_runs(self, design: np.ndarray | None, seed: int) -> Runs:
        """See `Problem.trial_runs`: every motion at every scale, with blocks that scatter as those of the
        validation runs do."""
        # Without scatter the trials would see less swing than the validation.
        drawn = (
            Conditions.scatter(len(self.conditions), seed, **self.scatter) if self.scatter else Conditions()
        )
        factors = {name: self.conditions.column(name) * x for name, x in drawn.factors.items()}
        some = replace(self.conditions, factors={**self.conditions.factors, **factors})
        return self._followed(design, self.scene, some, Terms.linear.value)

    def runs_alone(self, seed: int, progress: Any = None) -> Runs:
        """See `Problem.runs_alone`."""
        every, equations = self._every_motion(self.scatter, seed), Terms.nonlinear.value
        return self._followed(None, self.scene, every, equations, seed, progress)

    def _every_motion(self, scatter: Mapping[str, float], seed: int) -> Conditions:
        """Every motion of every group at every scale, with blocks that scatter."""
        motions = [m for g in self.groups for m in g.motions]
        scales, intensity = sorted(set(self.conditions.scales)), self.conditions.intensity
        return Conditions.records(motions, scales, intensity=intensity, scatter=scatter, seed=seed)

    def paired_runs(
        self, design: np.ndarray, seed: int, varied: Variation = STATED, progress: Progress = unreported
    ) -> PairedRuns:
        """See `Problem.paired_runs`: every motion of every group at every scale, with the same scattered
        blocks in both cases. The benefit counts the motions that are held out, if there are any."""
        equations, scene, more = varied.equations, varied.scene or self.scene, varied.more
        scales = sorted(set(self.conditions.scales))
        scatter = self.scatter
        if scene is not self.scene:
            # A restitution that is changed does not scatter as well.
            scatter.pop("restitution", None)
        conditions = self._every_motion(scatter, seed)
        conditions = conditions if more is None else conditions * more
        cases = []
        for name, pendulum in (("with the pendulum", design), ("without", None)):
            after = partial(progress, f"validation runs {name}")
            cases.append(self._followed(pendulum, scene, conditions, equations, seed, after))
        sizes = [len(g.motions) * len(scales) for g in self.groups]
        held = np.array([g.role is Role.validation for g in self.groups])
        group = np.repeat(np.arange(len(self.groups)), sizes)
        return PairedRuns(
            with_pendulum=cases[0],
            without_pendulum=cases[1],
            group=group,
            labels=tuple(g.name for g in self.groups),
            cluster=np.repeat(np.concatenate([g.events for g in self.groups]), len(scales)),
            counted=held[group] if held.any() else None,
            worse=self.requirements.worse,
        )

    def strongest_motions(self, design: np.ndarray) -> list[GroundMotion]:
        """See `Problem.strongest_motions`."""
        runs = self._followed(design, self.scene, self.conditions, Terms.linear.value)
        order = np.argsort(-np.where(runs.stands, np.nan_to_num(runs.rod_angle), -1.0))
        known = [i for i in order if runs.stands[i]][:MOST_MOTIONS]
        motions, which = self.conditions.motions, np.asarray(self.conditions.which)
        factors = motion_factors(self.scene, self.conditions)
        return [motions[int(which[i])].scaled(float(factors[i])) for i in known]

    def _followed(
        self,
        design: np.ndarray | None,
        scene: Scene,
        conditions: Conditions,
        equations: str,
        seed: int = 0,
        progress: Any = None,
    ) -> Runs:
        """Follow a design from rest through the motions of all conditions, and freely afterwards."""
        most = MAX_EVENTS if equations == Terms.nonlinear.value else _EVENTS
        # A bob without mass does not act on the block, and shares its scattered properties.
        row = _MASSLESS if design is None else design
        _, rows = self._rows(row, scene, conditions)
        condition = np.asarray(conditions.which)
        pieces = [np.asarray(m.pieces(), dtype=float) for m in conditions.motions]
        forcing = GroundForcing(pieces, FREE * float(scene.rate), condition)
        return follow_runs(
            Terms(equations), rows, forcing, events=most, condition=condition, seed=seed, progress=progress
        )

    def _rows(
        self, design: np.ndarray, scene: Scene, conditions: Conditions
    ) -> tuple[Parameters, np.ndarray]:
        """Parameters of a design under all conditions, and as rows (n, 9) of the compiled code."""
        which, motions = np.asarray(conditions.which), conditions.motions
        factor = motion_factors(scene, conditions)
        first = Scene(scene.block, motions[0], scene.gravity)
        # The factor on the amplitude is in units of the intensity, and is applied motion by motion.
        factors = {**conditions.factors, "amplitude": np.ones(len(which))}
        q = under_all(first.ground_parameters(), design[None], replace(conditions, factors=factors))
        f = np.array([float(x.pga) for x in motions]) / float(motions[0].pga)
        h = np.array([float(x.piece) for x in motions]) * float(first.rate)
        # A quicker motion passes its pieces sooner.
        pieces = h[which] / conditions.column("frequency")
        return q, row_of(unchecked(q, f=q.f * f[which] * factor), piece=pieces)


def _name_of(motion: GroundMotion) -> str:
    """Name of a built-in record."""
    for name, make in BUILT_IN.items():
        known = make()
        if isinstance(motion, Record) and motion.name == known.name and motion.pga == known.pga:
            return name
    raise ValueError(
        "a job file cannot say motions that exist only in Python: it names files, folders and sets of records"
    )


def motion_factors(scene: Scene, conditions: Conditions) -> np.ndarray:
    """Return the factor on its ground motion of every condition, (n,)."""
    measure = intensity_of(conditions.intensity, scene.block, float(scene.gravity), None)
    # A scale counts an intensity, which is proportional to the motion.
    one = np.array([measure.value(m) for m in conditions.motions])
    return conditions.column("amplitude") / one[np.asarray(conditions.which)]


def check_ground_limits(limits: tuple[Limit, ...]) -> None:
    """Raise `ValueError` for a limit of settled motions."""
    for limit in limits:
        if not limit.of_motion:
            names = ", ".join(kind.__name__ for kind in KINDS if kind.of_motion)
            raise ValueError(f"`limits` of ground motions must be of {names}, but has {checks.shown(limit)}")


def grouped(
    motions: Sequence[GroundMotion], validation_share: float | Mapping[str, Sequence[GroundMotion]], seed: int
) -> tuple[Group, ...]:
    """The group that a design is tuned to, first, and those that are held out.

    Args:
        motions: of the conditions.
        validation_share: the share of the motions, whole earthquakes by a seeded choice, that the search does
            not use; or groups of other motions by name, without those of an earthquake that the search uses.
        seed: of the choice.

    Raises:
        ValueError: a share outside 0 to 0.9, a group without motions, or no motion left on one side.
    """
    if isinstance(validation_share, Mapping):
        return _others(motions, validation_share)
    share = checks.within("validation_share", validation_share, 0.0, 0.9)
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
            f"`validation_share` must leave an earthquake for the search, but it takes all {len(events)}: "
            "give more records, name their earthquakes, or give 0, which leaves all of them to the search"
        )
    numbers = np.unique(names, return_inverse=True)[1]
    held = np.array([name in out for name in names])
    tuned = Group("tuned to", Role.tuned, inside, numbers[~held])
    return (tuned, Group("validation", Role.validation, outside, numbers[held])) if outside else (tuned,)


def _others(
    motions: Sequence[GroundMotion], validation_share: Mapping[str, Sequence[GroundMotion]]
) -> tuple[Group, ...]:
    # An earthquake that the search has seen is no test.
    others = {}
    for name, listed in validation_share.items():
        for i, motion in enumerate(listed):
            checks.instance(f"validation_share[{name!r}][{i}]", motion, GroundMotion)
        # A motion without a name of its earthquake may be any: it stays.
        events = events_of([*motions, *listed])
        left = tuple(
            m
            for m, event in zip(listed, events[len(motions) :], strict=True)
            if event not in events[: len(motions)]
        )
        if not left:
            raise ValueError(
                "`validation_share` must hold motions of other earthquakes than the design is tuned to, but "
                f"{name!r} has none"
            )
        others[name] = left
    # Over all groups together: an earthquake, or copies of one motion, in two of them are still one.
    every = [*motions, *(m for left in others.values() for m in left)]
    numbers = np.unique(events_of(every), return_inverse=True)[1]
    ends = np.cumsum([len(motions), *(len(left) for left in others.values())])
    parts = np.split(numbers, ends[:-1])
    held = (Group(n, Role.validation, m, x) for (n, m), x in zip(others.items(), parts[1:], strict=True))
    return (Group("tuned to", Role.tuned, tuple(motions), parts[0]), *held)
