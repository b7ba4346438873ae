"""Design problem: the inputs of `tpd.optimise`, complete and checked, and the runs that evaluate a design.

`HarmonicProblem` and `GroundMotionProblem` define the search, trial runs, paired runs, and what else depends
on the kind of excitation. Validation and report are written once, for `Problem`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from tpd.answers.ensemble import Ensemble
from tpd.answers.paired import OVERTURNS, PairedRuns
from tpd.answers.run_table import Runs, follow_scaled
from tpd.answers.statistics import quantile_of
from tpd.answers.transient import FREE
from tpd.core import checks
from tpd.core.formatting import pair_of
from tpd.core.progress import Progress, unreported
from tpd.design.geometry import Geometry
from tpd.design.job import Job
from tpd.design.reasons import AFTER_PUSH, STAYS, VALIDATED, DesignStatus, Reason, ReasonKind
from tpd.design.risk import Risk
from tpd.design.sizes import Evaluation, evaluate_sizes
from tpd.design.space import DesignSpace
from tpd.limits import (
    STILL,
    Clearance,
    Limit,
    Mass,
    Requirements,
    bob_of,
    check_cavity,
    check_limits,
    limit_of,
)
from tpd.scene.conditions import Conditions, HalfWidth, Normal, check_restitution
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.hazard import HOW_TO
from tpd.scene.record import Record
from tpd.scene.scene import HOUSNER, Block, Pendulum, Scene
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import AtRest

_DEVIATIONS, _LEAST_SHARE = 2.0, 0.25
"""Number of standard deviations by which the share of the runs that exceed a limit stays below the allowed
share, as a margin for chance in the validation runs; and smallest ratio of both shares."""
MOST_MOTIONS = 24
"""Largest number of motions for which the loads on the pendulum are computed."""

_SCATTER_LABELS = {
    "mass": "the bob's mass",
    "length": "the rod's length",
    "damping": "the hinge's damping",
    "amplitude": "amplitude of the excitation",
}
"""Labels of quantities that scatter, if the name of the quantity alone is not clear."""


VariationKind = Literal["stated", "quantity", "losses", "width", "hinge", "records", "failure", "base"]
"""Kinds of variations: the stated design, another value of one quantity, another loss of energy, a narrower
base as with worn edges or a soft bearing, a hinge at mid-height, records of another set, a part that fails,
and a wider base without a pendulum."""


class Variation(NamedTuple):
    """Change of paired runs with respect to the validation runs."""

    kind: VariationKind = "stated"
    """Kind of the variation."""
    name: str = ""
    """Name of what changes, see `tpd.design.variations.Dependence`."""
    share: float = 0.0
    """Relative change, or level of the records."""
    words: str = ""
    """Words for the varied design."""
    equations: str = Terms.nonlinear.value
    """Equations of the runs. With the linear equations the runs are fewer and shorter; they serve
    comparisons."""
    scene: Scene | None = None
    """Scene with another block, under the same motions in SI units; None for the scene of the problem."""
    more: Conditions = Conditions.exactly()
    """Further condition, in addition to all others."""
    problem: Problem | None = None
    """Problem with another hinge; None for the stated one."""
    records: tuple[Record, ...] = ()
    """Records of another set; empty for the stated excitation."""
    without_pendulum: Runs | None = None
    """Runs without a pendulum, if they are those of another variation."""

    @property
    def fixes_restitution(self) -> bool:
        """Whether e does not vary, because the variation states e. Another block has e as stated."""
        is_stated = self.scene is not None and self.scene.block.restitution != HOUSNER
        return is_stated and self.kind not in ("base", "failure")


STATED = Variation()
"""No change: the validation runs."""


class Words(NamedTuple):
    """Words for the excitation and for the validation runs of a problem."""

    excitation: str
    """The excitation."""
    scope: str
    """The excitations for which a verdict holds."""
    assumed: str
    """The excitation as the runs assume it."""
    starts: str
    """Initial states of the validation runs and beginning of the excitation."""
    duration: str
    """Duration of the validation runs."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Problem(ABC):
    """Inputs of `tpd.optimise`, complete and checked, and the runs that evaluate a design."""

    scene: Scene
    """Block and excitation. Under ground motions: the block with the first motion."""
    space: DesignSpace
    """Bounds in ratios, reduced to the limit on the mass of the bob if there is one."""
    conditions: Conditions
    """Excitations of the search. Ground motions that only the validation uses are not among them."""
    risk: Risk
    """Risk measure over the conditions."""
    limits: tuple[Limit, ...]
    """Limits, in the order of a report."""
    method: Any
    """Settings of the search."""
    ensemble: Ensemble
    """Validation runs. Under ground motions its half widths are those of the block and of the
    installation."""
    requirements: Requirements
    """Smallest benefit and largest harm of a recommended pendulum."""
    seed: int
    """Seed of all random choices."""
    job: Job | None = None
    """Job that states the problem; None for a problem of Python objects."""
    defaults: ClassVar[dict[str, Any]] = {"space": DesignSpace(), "requirements": Requirements(), "seed": 0}
    """Inputs that this kind of problem has, with their defaults."""
    attempts: ClassVar[int]
    """Largest number of designs that are validated."""
    retries: ClassVar[frozenset[ReasonKind]] = frozenset(ReasonKind)
    """Reasons against a design after which another design is validated."""
    passing_status: ClassVar[DesignStatus] = DesignStatus.recommended
    """Status of a design that passes the validation, as far as the excitation allows a verdict."""
    groups: ClassVar[tuple[Any, ...]] = ()
    """Groups of ground motions; none under harmonic excitation."""
    edges: ClassVar[np.ndarray] = np.array([])
    """Ends of the strata of the levels, in the unit of their intensity."""
    levels: ClassVar[Mapping[str, np.ndarray]] = {}
    """Whether each validation run under ground motions belongs to a stratum of the intensity, by the ends of
    the stratum; empty if there is one level, and under harmonic excitation."""
    earthquakes: ClassVar[np.ndarray | None] = None
    """Number of the earthquake of each validation run; None under harmonic excitation."""
    usual_contacts: ClassVar[float] = 0.01
    """Default share of the standing runs that may exceed a limit. The usual limit is the clearance."""
    rest_counts: ClassVar[bool] = False
    """Whether rest counts wherever the block can stay at rest, even if it rocks from other initial states."""
    spare: ClassVar[float] = 0.0
    """Share of every limit on runs that trial runs leave unused."""
    pictures: ClassVar[tuple[str, ...]] = "landscape", "drawing", "benefit"
    """Pictures that `tpd.plot` can draw of a design."""
    crossed: ClassVar[tuple[Any, ...]] = ()
    """For each group of cross-fitting the problem whose search does not use the group, and whether each
    validation run belongs to it; empty without cross-fitting."""
    has_earthquakes: ClassVar[bool]
    """Whether the validation runs include earthquakes or pulses. Then the stated motions are a sample, a
    share of them has an interval, and the same runs decide and are reported."""

    def __post_init__(self) -> None:
        is_rate, n = self.requirements.reduce == "rate", len(self.levels)
        if is_rate and (n < 2 or self.conditions.hazard is None):
            have = f"{'several' if n else 'no'} levels and {'a' if self.conditions.hazard else 'no'} hazard"
            raise ValueError(
                "`reduce` can be rate only with a hazard and ground motions of 2 levels (`scales`) or more, "
                f"but there are {have}"
            )

    @classmethod
    def checked(cls, scene: Scene, **inputs: Any) -> dict[str, Any]:
        """Return the inputs, checked and with defaults instead of None and of missing inputs.

        The design space of the result is in ratios, and within the limit on the mass of the bob.

        Raises:
            TypeError: the name of an input is unknown.
            ValueError: an input is of another class than its default, or does not fit the scene.
            RuntimeError: JAX is in 32-bit mode.
        """
        # 32-bit numbers would give wrong results without an error, so check this first.
        checks.require_x64()
        defaults = cls.defaults
        if unknown := inputs.keys() - defaults.keys():
            raise TypeError(f"a problem has no input `{min(unknown)}`: its inputs are {', '.join(defaults)}")
        # None means the default, so that a caller can pass on an option that it was not given.
        checked = {n: default if inputs.get(n) is None else inputs[n] for n, default in defaults.items()}
        for name in defaults.keys() - {"limits", "seed", "objective", "validation_share"}:
            checks.instance(name, checked[name], type(defaults[name]))
        seed, limits = checks.seed("seed", checked["seed"]), check_limits(checked["limits"])
        checked |= {"seed": seed, "limits": limits}
        check_cavity(scene.block, checked["limits"])
        if checked["ensemble"].restitution:
            check_restitution(scene, in_runs=True)
        space = checked["space"].of(scene.block)
        return checked | {"space": within_mass(space, scene.block, checked["limits"])}

    @property
    def inputs(self) -> dict[str, Any]:
        """Arguments of `tpd.optimise` that state this problem, by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "job"}

    @property
    def allowed(self) -> float:
        """Largest share of the runs that may exceed a limit, among those in which the block stands."""
        stated = self.requirements.wall_contacts
        return self.usual_contacts if stated is None else stated

    @property
    def limit_runs(self) -> int:
        """Number of validation runs that show at once whether a design keeps the limits."""
        return max(1, self.ensemble.size // 2)

    @property
    def scatter(self) -> dict[str, HalfWidth]:
        """Relative half widths of the quantities that vary in the validation runs, by name, or the normal
        distribution of e."""
        widths = self.ensemble.widths(self.scene.block.restitution)
        # A factor on a friction of zero would have no effect.
        absent = () if self.scene.block.friction else ("friction",)
        return {name: width for name, width in widths.items() if width != 0.0 and name not in absent}

    def scatter_in_words(self, *, without_pendulum: bool = False) -> str:
        """List the quantities that vary in the validation runs, with their half widths in per cent.

        Args:
            without_pendulum: whether to leave out the quantities of the pendulum.
        """
        by_width, normal = dict[float, list[str]](), list[str]()
        for name, width in self.scatter.items():
            # A normal distribution is no range, so it comes last.
            if isinstance(width, Normal):
                normal.append(str(width))
            elif not (without_pendulum and name in ("mass", "length", "damping")):
                by_width.setdefault(width, []).append(_SCATTER_LABELS.get(name, name))
        listed = (f"{', '.join(names)} ±{100.0 * width:.2g} %" for width, names in sorted(by_width.items()))
        return "; ".join([*listed, *normal]) or "none"

    @property
    def safe_level(self) -> float:
        """Share of the runs that must keep a limit, with a margin for chance in the validation."""
        # Single runs decide at a limit of one per cent, so that a design on the limit fails every other time.
        chance = _DEVIATIONS * np.sqrt(self.allowed * (1.0 - self.allowed) / self.limit_runs)
        return 1.0 - max(self.allowed - chance, _LEAST_SHARE * self.allowed)

    @property
    def run_limits(self) -> tuple[Limit, ...]:
        """Limits that single runs must keep, apart from the allowed share of them."""
        return tuple(limit for limit in self.limits if limit.of_motion)

    @cached_property
    def geometry(self) -> Geometry:
        """Lengths of the block under all conditions, with the bob of the limits."""
        return Geometry.of(self.scene, self.conditions, bob_of(self.limits), self.hinge_ratio)

    @property
    def hinge_ratio(self) -> float:
        """Height of the hinge over that of the centroid of the block, kappa."""
        return self.space.hinge_ratio(self.scene.block)

    def pendulum(self, design: np.ndarray) -> Pendulum:
        """Return a design (mu, lam, zeta) in SI units."""
        mu, lam, zeta = map(float, design)
        height = self.space.hinge_height
        return self.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta, hinge_height=height)

    def ratios(self, pendulum: Pendulum) -> np.ndarray:
        """Return the design (mu, lam, zeta) of a pendulum in SI units."""
        block = self.scene.block
        ratios = pendulum.mass / block.mass, pendulum.length / block.centroid, pendulum.damping_ratio
        return np.array([float(x) for x in ratios])

    def exact(self, design: np.ndarray | None) -> Any:
        """Return the exact motions of a design under all conditions; None for the design means no pendulum.

        The result is None if only runs can evaluate a design.
        """
        return None

    @cached_property
    def without_pendulum(self) -> Any:
        """Exact motions without a pendulum; None if only runs can evaluate a design."""
        return self.exact(None)

    objective_in_words: ClassVar[str] = ""
    """Words for the quantity that descents minimise; empty without descents."""

    @property
    @abstractmethod
    def words(self) -> Words:
        """Words for the excitation and for the validation runs."""

    @abstractmethod
    def isolation(self, level: float) -> tuple[np.ndarray, float]:
        """Return the smallest periods (s) of a base isolation that transmits less acceleration than lifts the
        block, one for each motion with the peak acceleration `level` (g), and the damping ratio of the
        isolation."""

    @property
    @abstractmethod
    def usual_level(self) -> tuple[float, str]:
        """Peak acceleration (g) for which measures without a pendulum are estimated, and words for it."""

    @property
    @abstractmethod
    def at_rest(self) -> AtRest:
        """Resting block without a pendulum under the condition that comes nearest to lifting it."""

    @property
    def needs_none(self) -> DesignStatus | None:
        """Status if the excitation does not make the resting block rock; None if it does.

        A strong enough push may still make the block rock or overturn.
        """
        if self.at_rest.slides:
            return DesignStatus.slides
        return DesignStatus.no_uplift if self.at_rest.safety_factor >= 1.0 else None

    @property
    def needless(self) -> str:
        """Sentences about a block that does not rock under the excitation, with its safety factor."""
        status, alone = self.needs_none, self.at_rest
        if status is DesignStatus.slides:
            at, uplift = pair_of(alone.base_friction or 0.0, alone.uplift)
            return f"{status.value} It slides at {at} g, and lifts at {uplift} g. {status.remedy}"
        stays, times = f"{DesignStatus.no_uplift.head}: {STAYS}", pair_of(alone.safety_factor, 1.0)[0]
        return f"{stays}, and an excitation that is {times} times as strong would lift it. {AFTER_PUSH}"

    @property
    def missing(self) -> list[str]:
        """Sentence on what the search leaves out although a design to be built needs it; empty if nothing."""
        parts = ["considered only one excitation"] * (len(self.conditions) == 1)
        parts += ["assumed a bob without size and no walls"] * (limit_of(self.limits, Clearance) is None)
        return [f"the search {' and '.join(parts)}"] if parts else []

    def parts_of(self, runs: PairedRuns, most: int = 16) -> list[tuple[str, np.ndarray]]:
        """Return the parts of paired runs that are compared: each kind of start, or up to `most` ranges of
        levels. A part has a name and whether each run belongs to it; there are none for a single part."""
        counted = runs.is_answered if runs.counted is None else runs.is_answered & runs.counted
        # Under a harmonic the start decides most, and under ground motions the level.
        parts = self.level_ranges(most) or runs.with_pendulum.starts
        return [(name, rows & counted) for name, rows in parts.items()] if len(parts) > 1 else []

    def level_ranges(self, most: int) -> dict[str, np.ndarray]:
        """Return up to `most` ranges of the levels of ground motions, in the form of `levels`."""
        return {}

    def headline(self, status: DesignStatus, reasons: Sequence[str]) -> str:
        """Return the sentence of a status: for which excitations a pendulum is valid, or the first reason
        against it."""
        if status not in VALIDATED:
            return status.headline(reasons or self.missing)
        because = "".join(f", because {x}" for x in self.missing)
        # A smaller tilt does not mean that fewer runs overturn.
        by = ", by the mean tilt" if self.requirements.reduce == "tilt" else ""
        return f"{status.head} for {self.words.scope}{by}{because}. This is not a safety assessment."

    @abstractmethod
    def improver(self, guess: np.ndarray | None, progress: Progress) -> Any:
        """Return the method that finds the next design to validate: `Corrections` of descents, or a
        `Refinement` by trial runs.

        Args:
            guess: first guess, (3,), or None.
            progress: function of (stage, done, total).
        """

    @abstractmethod
    def trial_runs(self, design: np.ndarray | None, seed: int, equations: str = Terms.linear.value) -> Runs:
        """Simulate inexpensive runs of a design; None for the design means no pendulum.

        With the nonlinear equations, which compare the best designs, the runs are more.
        """

    @abstractmethod
    def validation_runs(
        self, design: np.ndarray | None, seed: int, varied: Variation = STATED, progress: Any = None
    ) -> Runs:
        """Simulate the validation runs of a design under a variation; None for the design means no
        pendulum."""

    def runs_under(
        self, cases: Sequence[Pendulum | None], motions: Sequence[GroundMotion], factors: Any, **how: Any
    ) -> Any:
        """Simulate the stated block from rest by the nonlinear equations; see `follow_scaled`."""
        block, gravity = self.scene.block, float(self.scene.gravity)
        how |= {"gravity": gravity, "free": FREE, "equations": Terms.nonlinear}
        return follow_scaled(block, cases, motions, factors, **how)

    @property
    @abstractmethod
    def rule_sizes(self) -> tuple[float, float, float]:
        """Longest and shortest length ratio that a rule of thumb allows for, and the bob angle (rad) at which
        its pendulum must keep the limits; 0 if orbits show it."""

    @abstractmethod
    def _groups_of(self, runs: Runs) -> dict[str, Any]:
        """Return `group`, `labels` and `counted` of paired runs, see `PairedRuns`."""

    def paired_runs(
        self, design: np.ndarray, seed: int, varied: Variation = STATED, progress: Progress = unreported
    ) -> PairedRuns:
        """Simulate runs with and without the pendulum of a design.

        Args:
            design: (mu, lam, zeta), shape (3,); or (runs, 3) if it differs between runs.
            seed: seed of the runs. Runs of different seeds are independent.
            varied: change with respect to the validation runs.
            progress: function of (stage, runs done, total).
        """
        # Both cases have the same seed and conditions, so that the runs are paired.
        how = seed, varied, partial(progress, "validation runs")
        runs = self.validation_runs(design, *how)
        alone = varied.without_pendulum or self.validation_runs(None, *how)
        own = self._groups_of(runs) | {"cluster": runs.cluster, "worse": self.requirements.worse}
        # Linear runs compare variations at other levels.
        if varied.equations == Terms.nonlinear.value:
            own["annual"] = lambda of: self.annual_rates((of.without_pendulum, of.with_pendulum), of.counted)
        return PairedRuns(with_pendulum=runs, without_pendulum=alone, **own)

    def annual_rates(self, cases: Sequence[Runs], counted: np.ndarray | None = None) -> Any:
        """Return the `AnnualRates` of overturning in validation runs; None without a hazard.

        Args:
            cases: runs without the pendulum and, if there is one, with it.
            counted: whether each run counts; None for all.
        """
        return None

    def first_overturning(self, runs: Runs) -> str:
        """Return a clause with the shortest period and the smallest PGA of several pulses that overturn the
        block; empty without pulses."""
        return ""

    def yearly(self, rates: Any) -> tuple[str, ...]:
        """Return the sentences of annual rates. If they are None, the result is one sentence on how to state
        a hazard under ground motions of several levels, else empty. Sentences have no full stop."""
        # One level determines no rate, so that a hazard would not help.
        return (HOW_TO,) * bool(self.levels) if rates is None else rates.sentences

    def run_seed(self, *numbers: int) -> int:
        """Return a seed of runs. The first number is that of the stage, the other numbers count within the
        stage."""
        base = self.seed if self.ensemble.seed is None else self.ensemble.seed
        return int(np.random.SeedSequence([base, *numbers]).generate_state(1)[0])

    @property
    @abstractmethod
    def stated_motions(self) -> list[GroundMotion]:
        """All excitations as ground motions with their sizes, those of validation groups included."""

    @abstractmethod
    def strongest_motions(self, design: np.ndarray) -> list[GroundMotion]:
        """Return the motions in which the rod of a design rotates most relative to the block, at most 24."""

    def reduces(self, without_pendulum: Runs) -> str:
        """Return the measure that a pendulum must reduce, from runs without it; see `Requirements.reduce`."""
        overturns = without_pendulum.share_overturned.value >= OVERTURNS
        return self.requirements.reduce or ("overturning" if overturns else "tilt")

    def value_of(self, runs: Runs) -> float:
        """Return the risk measure of the severities of all runs that have a result; NaN if there are none."""
        severity = runs.severity[~runs.is_unanswered]
        return self.risk_of(severity) if len(severity) else np.nan

    def risk_of(self, severity: np.ndarray) -> float:
        """Return the risk measure by which trial runs compare designs."""
        return float(self.risk.of(severity))

    def fixed_sizes(self, designs: np.ndarray, swing: float = 0.0) -> dict[str, np.ndarray]:
        """Return the limited quantities that need no run, over their limits, by name, (m,).

        Each is the largest over all conditions. The quantities are those of the bob that hangs at rest, or at
        the angle `swing` (rad), and, under harmonic excitation, of the settled orbit.
        """
        m, n = len(designs), len(self.conditions)
        # A block at rest with a bob at rest: only the size of the bob and its distance from the walls matter.
        zeros = np.zeros((m, n))
        at_rest = Evaluation.blank(m, n)._replace(tilt=zeros, swing=zeros + swing, design=designs)
        return {
            size.name: np.max(size.value, axis=1)
            for size in evaluate_sizes(self.run_limits, at_rest, self.geometry)
        }

    @property
    def of_all(self) -> Problem:
        """The problem whose validation counts all runs, for a design that none of them chose."""
        return self

    def possible(self, designs: np.ndarray, swing: float = 0.0) -> np.ndarray:
        """Return whether designs (m, 3) keep the limits that need no run, (m,), see `fixed_sizes`."""
        # A quantity that is unknown is no limit that is kept.
        keeps = (x <= 1.0 for x in self.fixed_sizes(designs, swing).values())
        return np.all([np.ones(len(designs)), *keeps], axis=0)

    def excess(self, name: str, size: float) -> Reason:
        """Return the reason against a design that a limited quantity of this size, over its limit, gives."""
        limit = next((x for x in self.limits if x.name == name), None)
        quantity, most = (size, 1.0) if limit is None else limit.quantity(size)
        return Reason(kind=ReasonKind.breaks_limit, limit=name, value=quantity, reference=most)

    def sizes_in_runs(self, design: np.ndarray, runs: Runs) -> dict[str, np.ndarray]:
        """Return limited quantities over their limits, by name, in each run in which the block stands.

        Sizes such as the thickness do not depend on the motion: they are checked without runs.
        """
        stands, g = runs.stands, self.geometry
        nu, mu, lam = (np.asarray(x)[stands] for x in (runs.nu, runs.mu, runs.lam))
        # The block of a run differs from the nominal one: with a narrower block the walls are closer
        # together.
        own = replace(
            g,
            wall=0.5 * float(self.scene.block.clear_width) * nu / float(self.scene.block.slenderness),
            slenderness=nu,
            mass_factor=mu / design[0],
            length_factor=lam / design[1],
        )

        out = dict[str, np.ndarray]()
        for limit in self.run_limits:
            # The bob must not touch the walls during the transient either: the clearance applies to the whole
            # run. Every other limit applies to the settled motion.
            before = "" if isinstance(limit, Clearance) else "settled_"
            angles = (getattr(runs, before + name) for name in ("tilt", "swing", "rod_angle"))
            tilt, swing, rod_angle = (x[stands][None] for x in angles)
            e = Evaluation.blank(1, len(nu))._replace(tilt=tilt / nu, swing=swing, rod_angle=rod_angle)
            every = evaluate_sizes([limit], e._replace(design=design[None]), own)
            out |= {size.name: size.value[0] for size in every if size.name not in STILL}
        return out

    def reached(self, values: np.ndarray) -> float:
        """Return the value of a run that only the allowed share of the runs exceeds; NaN without runs."""
        return quantile_of(values, 1.0 - self.allowed)

    def over_limit(self, design: np.ndarray, runs: Runs) -> tuple[float, str]:
        """Return the share of the runs that exceed a limit, and the name of the limit that most of them
        exceed.

        The share counts the runs in which the block stands; it is NaN if there are none. A run whose limited
        quantity is unknown counts as one that exceeds the limit.
        """
        sizes = {name: ~(x <= 1.0) for name, x in self.sizes_in_runs(design, runs).items()}
        if not sizes or not runs.stands.any():
            return (np.nan if sizes else 0.0), ""
        shares = {name: float(np.mean(x)) for name, x in sizes.items()}
        # Too frequent wall contact is reported first, because it is a danger.
        worst = max(shares, key=lambda n: (n == Clearance.name and shares[n] > self.allowed, shares[n]))
        return float(np.mean(np.any(list(sizes.values()), axis=0))), worst


def within_mass(space: DesignSpace, block: Block, limits: tuple[Limit, ...]) -> DesignSpace:
    """Return the design space reduced to the limit on the mass of the bob, if there is one.

    Raises:
        ValueError: the limit is not above the smallest mass of the space.
    """
    limit, ((low, *_), (high, *_)) = limit_of(limits, Mass), space.ends.tolist()
    if limit is None:
        return space
    # Every search keeps a bound exactly, but a constraint only within its tolerance: state the limit as a
    # bound.
    most = limit.kg / float(block.mass)
    if most <= low:
        raise ValueError(
            f"the limit `mass` must be above the smallest point mass of the design space, "
            f"{low * block.mass:g} kg, but is {limit.kg:g} kg"
        )
    return space if low == high else replace(space, mass_ratio=(low, min(high, most)))
