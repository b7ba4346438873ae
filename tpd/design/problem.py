"""A design problem: the inputs of `tpd.optimise`, complete and checked, and the runs that answer it.

`HarmonicProblem` and `GroundMotionProblem` say which designs are candidates, what a trial run and a paired
run are, and what only their kind of excitation needs. Search, refinement, validation and report are written
once, for `Problem`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from tpd.answers.ensemble import Ensemble
from tpd.answers.paired import PairedRuns
from tpd.answers.runs import Runs
from tpd.core import checks
from tpd.core.progress import Progress, unreported
from tpd.design.criteria import (
    DEFAULT_LIMITS,
    KINDS,
    STILL,
    Clearance,
    DesignSpace,
    Evaluation,
    Geometry,
    Limit,
    Mass,
    Requirements,
    Risk,
    check_cavity,
    check_limits,
    limit_of,
)
from tpd.design.job import Job, job_of
from tpd.design.job_keys import TABLES
from tpd.design.reasons import DesignStatus
from tpd.scene.conditions import Conditions, check_restitution
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.scene import Block, Pendulum, Scene
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import AtRest

MOST_MOTIONS = 24
"""Most motions that are followed over time for the loads."""


class Variation(NamedTuple):
    """How paired runs differ from those that validate."""

    equations: str = Terms.nonlinear.value
    """By the linear ones the runs are fewer and shorter: they compare."""
    scene: Scene | None = None
    """With another block or gravity; None for that of the problem."""
    more: Conditions | None = None
    """One further condition, on top of all others."""


STATED = Variation()
"""Runs that validate."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Problem(ABC):
    """Inputs of `tpd.optimise`, complete and checked, and the runs that answer them."""

    scene: Scene
    """Under ground motions its motion is the first of them."""
    space: DesignSpace
    """Within the limit on the bob's mass, if there is one."""
    conditions: Conditions
    """Under ground motions those of the group that a design is tuned to."""
    risk: Risk
    limits: tuple[Limit, ...]
    method: Any
    """Settings of the search."""
    ensemble: Ensemble
    """Validation runs; under ground motions its half widths are those of block and installation."""
    requirements: Requirements
    seed: int
    attempts: ClassVar[int]
    """Most designs that are validated, each by runs of its own."""
    groups: ClassVar[tuple[Any, ...]] = ()
    """Groups of ground motions; none under harmonic excitation."""
    rest_counts: ClassVar[bool] = False
    """Whether rest counts wherever it holds, though the block rocks from other initial states."""
    spare: ClassVar[float] = 0.0
    """Share of every limit on runs that the trials leave unused."""
    has_validation_runs: ClassVar[bool]
    """Whether some validation runs take no part in the decision, and are those that are quoted."""

    @property
    def inputs(self) -> dict[str, Any]:
        """Arguments of `tpd.optimise` that pose this problem again, by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def job(self) -> Job:
        """The job that poses this problem again.

        Raises:
            ValueError: a problem that no job file can describe: motions, a limit or an objective that exist
                only in Python.
        """
        asked = self.tables
        try:
            job = job_of({table: _said(values) for table, values in asked.items()})
        except ValueError as error:
            raise ValueError(f"a job file cannot say what this design was asked: {error}") from None
        for name in ("space", "risk", "limits", "method", "ensemble", "requirements", "seed"):
            # Models and optimisers of one kind are equal by what they print.
            if repr(getattr(job, name)) != repr(getattr(self, name)):
                raise ValueError(f"a job file cannot say the `{name}` of this design, {getattr(self, name)}")
        return job

    @property
    def tables(self) -> dict[str, dict[str, Any]]:
        """Tables of the job, as far as a file can say it."""
        scene, risk = self.scene, self.risk
        limits: dict[str, Any] = {
            kind.name: False
            for kind in KINDS
            if limit_of(DEFAULT_LIMITS, kind) and limit_of(self.limits, kind) is None
        }
        bob = {}
        for limit in self.limits:
            if type(limit) not in KINDS:
                raise ValueError(
                    f"a job file cannot say the limit `{limit.name}`, which exists only in Python"
                )
            limits[limit.name] = next((x for x in vars(limit).values() if isinstance(x, (int, float))), True)
            bob |= vars(limit.bob) if isinstance(limit, Clearance) else {}
        if bob.get("shape") == "ball":
            bob.pop("aspect")
        search = {name: value for name, value in vars(self.method).items() if name in TABLES["search"]}
        if not isinstance(search.get("model"), str):
            search["model"] = None
        measure = {0.0: "worst", 1.0: "expected"}.get(risk.share, "cvar")
        return {
            "block": vars(scene.block),
            "site": {"gravity": scene.gravity},
            "bob": bob,
            "space": vars(self.space),
            "risk": {"measure": measure, "share": risk.share if measure == "cvar" else None},
            "limits": limits,
            "search": search | {"seed": self.seed},
        }

    @property
    @abstractmethod
    def rounds(self) -> tuple[int, int]:
        """Rounds of further trials after the candidates, and how many designs each has."""

    @property
    @abstractmethod
    def allowed(self) -> float:
        """Largest share of the runs in which the block stands that may exceed a limit."""

    @property
    def scatter(self) -> dict[str, float]:
        """Relative half widths of what scatters in the validation runs, by name."""
        widths = self.ensemble.widths(self.scene.block.restitution)
        absent = () if self.scene.block.friction else ("friction",)
        return {name: width for name, width in widths.items() if width > 0.0 and name not in absent}

    @property
    def evidence(self) -> DesignStatus:
        """Status of a design that passes the validation, as far as the excitation allows a verdict."""
        return DesignStatus.recommended

    @property
    def run_limits(self) -> tuple[Limit, ...]:
        """Limits that single runs must keep, all but the allowed share of them."""
        return tuple(limit for limit in self.limits if limit.of_motion)

    @cached_property
    def geometry(self) -> Geometry:
        """Lengths of the block under all conditions, with the bob of the limits."""
        return Geometry.of(self.scene, self.conditions, self.limits)

    def pendulum(self, design: np.ndarray) -> Pendulum:
        """Return a design (mu, lam, zeta) in SI units."""
        mu, lam, zeta = map(float, design)
        return self.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)

    def ratios(self, pendulum: Pendulum) -> np.ndarray:
        """Return the design (mu, lam, zeta) of a pendulum in SI units."""
        block = self.scene.block
        ratios = pendulum.mass / block.mass, pendulum.length / block.half_height, pendulum.damping_ratio
        return np.array([float(x) for x in ratios])

    def exact(self, design: np.ndarray | None) -> Any:
        """Return the exact motions of a design, or without a pendulum, under all conditions; None where only
        runs answer."""
        return None

    @cached_property
    def without_pendulum(self) -> Any:
        """Exact motions without a pendulum; None where only runs answer."""
        return self.exact(None)

    def lifts(self, pendulum: Pendulum) -> tuple[float, float] | None:
        """Return the base acceleration over gravity that lifts the resting block, with a pendulum that has
        settled and without; None where no motion settles."""
        return None

    @property
    @abstractmethod
    def at_rest(self) -> AtRest:
        """The resting block without a pendulum under the condition that comes nearest to lifting it."""

    @property
    def needs_none(self) -> DesignStatus | None:
        """Status of a problem in which the excitation does not make the resting block rock; None if it does.

        A strong enough push may still make the block rock or overturn.
        """
        if self.at_rest.slides:
            return DesignStatus.slides
        return DesignStatus.no_uplift if self.at_rest.margin >= 1.0 else None

    @abstractmethod
    def candidates(self, progress: Progress) -> tuple[np.ndarray, Any]:
        """Return designs that are worth a trial, (m, 3), and the history of the search that found them (None
        where there was no search)."""

    @abstractmethod
    def trial_runs(self, design: np.ndarray | None, seed: int) -> Runs:
        """Follow cheap runs of a design by the linear equations; of None without a pendulum."""

    @abstractmethod
    def runs_alone(self, seed: int, progress: Any = None) -> Runs:
        """Follow the runs of the nonlinear equations that validate, without a pendulum."""

    @abstractmethod
    def paired_runs(
        self, design: np.ndarray, seed: int, varied: Variation = STATED, progress: Progress = unreported
    ) -> PairedRuns:
        """Follow runs with and without the pendulum of a design.

        Args:
            design: (mu, lam, zeta), shape (3,).
            seed: of the runs, which are independent of those of all other seeds.
            varied: how they differ from those that validate.
            progress: called with (stage, runs done, of how many).
        """

    def run_seed(self, *numbers: int) -> int:
        """Return the seed of runs: the first number is that of their stage, the others count within it."""
        base = self.seed if self.ensemble.seed is None else self.ensemble.seed
        return int(np.random.SeedSequence([base, *numbers]).generate_state(1)[0])

    @abstractmethod
    def strongest_motions(self, design: np.ndarray) -> list[GroundMotion]:
        """Return the motions of the conditions in which the rod of a design turns most, at most 24."""

    def value_of(self, runs: Runs) -> float:
        """Return the risk of the severities of runs that have an answer; NaN without any."""
        known = runs.severity[~runs.is_unanswered]
        return float(self.risk.of(known)) if len(known) else np.nan

    def fixed_sizes(self, designs: np.ndarray) -> dict[str, np.ndarray]:
        """Return limited quantities over their limits that need no run, the largest of all conditions, by
        name, (m,): of the bob that hangs at rest, and with harmonic excitation of the settled orbit."""
        m, n = len(designs), len(self.conditions)
        zeros = np.zeros((m, n))
        at_rest = Evaluation.blank(m, n)._replace(tilt=zeros, swing=zeros, design=designs)
        return {
            size.name: np.max(size.value, axis=1)
            for limit in self.limits
            if limit.of_motion
            for size in limit.sizes(at_rest, self.geometry)
        }

    def sizes_in_runs(self, design: np.ndarray, runs: Runs) -> dict[str, np.ndarray]:
        """Return limited quantities over their limits, by name, in each run in which the block stands."""
        stands, g = runs.stands, self.geometry
        nu, mu, lam = (np.asarray(x)[stands] for x in (runs.nu, runs.mu, runs.lam))
        # The walls come nearer with the block's width.
        own = replace(
            g,
            wall=0.5 * float(self.scene.block.clear_width) * nu / float(self.scene.block.slenderness),
            slenderness=nu,
            mass_factor=mu / design[0],
            length_factor=lam / design[1],
        )

        def motion(tilt: np.ndarray, swing: np.ndarray, relative: np.ndarray) -> Evaluation:
            shaped = {"tilt": tilt / runs.nu, "swing": swing, "relative": relative}
            rows = {k: x[stands][None] for k, x in shaped.items()}
            return Evaluation.blank(1, len(nu))._replace(**rows, design=design[None])

        settled = motion(runs.settled_tilt, runs.settled_swing, runs.settled_rod_angle)
        # The bob must keep off the walls from the first moment on, and not only in the settled motion.
        largest = motion(runs.tilt, runs.swing, runs.rod_angle)
        return {
            size.name: size.value[0]
            for limit in self.run_limits
            for size in limit.sizes(largest if isinstance(limit, Clearance) else settled, own)
        }

    def over_limit(self, design: np.ndarray, runs: Runs) -> tuple[float, str]:
        """Return the share of the runs in which the block stands whose motion exceeds a limit, 0 without any
        such run, and the name of the limit that most of them exceed."""
        sizes = {name: x > 1.0 for name, x in self.sizes_in_runs(design, runs).items() if name not in STILL}
        if not sizes or not runs.stands.any():
            return 0.0, ""
        worst = max(sizes, key=lambda name: float(np.mean(sizes[name])))
        return float(np.mean(np.any(list(sizes.values()), axis=0))), worst


def _said(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values that a file can hold, without those that are left out."""
    plain = {key: x.tolist() if isinstance(x, np.generic) else x for key, x in values.items()}
    return {key: list(x) if isinstance(x, tuple) else x for key, x in plain.items() if x is not None}


def complete(scene: Scene, usual: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the inputs that all problems have, checked, with usual ones in place of None and of those that
    are left out; the space is in ratios and within the limit on the bob's mass.

    Raises:
        TypeError: a name that is not among the usual inputs.
        ValueError: an input of another class than the usual one, or that does not fit the scene.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    if unknown := given.keys() - usual.keys():
        raise TypeError(f"a problem has no input `{min(unknown)}`, but {', '.join(usual)}")
    found = {name: default if given.get(name) is None else given[name] for name, default in usual.items()}
    for name in usual.keys() - {"limits", "seed"}:
        checks.instance(name, found[name], type(usual[name]))
    found |= {"seed": checks.seed("seed", found["seed"]), "limits": check_limits(found["limits"])}
    check_cavity(scene.block, found["limits"])
    if found["ensemble"].restitution:
        check_restitution(scene)
    space = found["space"].of(scene.block)
    return found | {"space": within_mass(space, scene.block, found["limits"])}


def within_mass(space: DesignSpace, block: Block, limits: tuple[Limit, ...]) -> DesignSpace:
    """Return the space within the limit on the bob's mass, if there is one.

    Raises:
        ValueError: a mass below the least bob of the space.
    """
    limit, (low, high) = limit_of(limits, Mass), space.ends[:, 0].tolist()
    if not isinstance(limit, Mass):
        return space
    # Every method keeps a bound exactly, and a constraint only to its tolerance.
    most = limit.kg / float(block.mass)
    if most <= low:
        raise ValueError(
            f"the limit `mass` must be above the least point mass of the design space, {low * block.mass:g} "
            f"kg, but is {limit.kg:g} kg"
        )
    return space if low == high else replace(space, mass_ratio=(low, min(high, most)))
