"""Design problem under harmonic excitation: the settled orbits under all conditions guide the search."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from tpd.answers.attractors import StartKind, Starts
from tpd.answers.ensemble import Ensemble, outcomes
from tpd.answers.paired import PairedRuns, paired_runs
from tpd.answers.runs import Runs
from tpd.core import checks
from tpd.core.batch import aside
from tpd.core.progress import Progress, unreported
from tpd.design.criteria import (
    DEFAULT_LIMITS,
    DesignSpace,
    Evaluation,
    Objective,
    Requirements,
    Risk,
    SteadyTilt,
    check_moves,
    check_objective,
    check_scatter,
)
from tpd.design.job import Job
from tpd.design.orbits import SMOOTHED, Orbits, prepare_step
from tpd.design.problem import MOST_MOTIONS, STATED, Problem, Variation, complete
from tpd.design.search import Search, search
from tpd.design.settings import VALIDATION_RUNS, Descent
from tpd.exact.calling import load_compiled
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, follow
from tpd.models.compiled import Piecewise
from tpd.models.smoothed import Smoothed
from tpd.scene.conditions import Conditions, latin_hypercube, under_all
from tpd.scene.ground_motion import GroundMotion, Pulse
from tpd.scene.parameters import as_arrays
from tpd.scene.scene import Harmonic, Pendulum, Scene
from tpd.scene.status import Status, code_of, names_of
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import AtRest, uplift

TRIAL_RUNS, TRIAL_PERIODS = 128, 50
"""Runs of a trial, and their most forcing periods."""
_ROUNDS = 6, 8
"""Rounds of further trials, and how many designs each has."""
_WITHOUT = 8
"""How many times as many runs estimate the mean tilt without a pendulum, which every design is compared
with."""
_COMPARED = 256
"""Paired runs by the linear equations that compare changed scenes."""
_RTOL = 1e-6
"""Relative tolerance of the steps of validation runs: their means are those of 1e-8, for 30 % less time."""
_SEARCHED = 64
"""Most conditions under which the descents work; all of them count in the trials."""
_PATHS, _SPREAD, _DRAWN = 16, 48, 1024
"""Candidates from the paths of the descents, from the whole space, and designs drawn to find the latter."""
_CYCLES = 40
"""Periods of a harmonic from rest in which the loads are largest."""
_SAME = 1e-6
"""Relative difference of tilts up to which a motion is the orbit."""
_USUAL = {
    "space": DesignSpace(),
    "risk": Risk.worst(),
    "limits": DEFAULT_LIMITS,
    "method": Descent(),
    "ensemble": Ensemble(size=VALIDATION_RUNS),
    "requirements": Requirements(),
    "seed": 0,
}
"""Inputs by default."""
_SMOOTH = 0.2
"""Least velocity ratio of impacts under which descents smooth them."""


@dataclass(frozen=True, kw_only=True)
class ExactMotions:
    """A design under all n conditions by the linear equations: its settled orbits in closed form, and its
    motions from rest by the exact solution. Arrays of shape (n,), angles in rad."""

    value: float
    """Risk of the merits of the orbits, see `Evaluation`."""
    orbits: Evaluation
    """Settled orbits, leading axis 1."""
    margin: np.ndarray
    """Uplift margin."""
    status: np.ndarray
    """Names of the outcomes from rest."""
    amplitude: np.ndarray
    """Settled |phi| from rest; infinite where the block overturns."""
    swing: np.ndarray
    """Settled |psi|."""
    peak: np.ndarray
    """Largest |phi| from the beginning on."""
    peak_swing: np.ndarray
    """Largest |psi| from the beginning on."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers where the motion is the orbit; NaN elsewhere."""


@dataclass(frozen=True, kw_only=True, repr=False)
class HarmonicProblem(Problem):
    """A design problem under harmonic excitation."""

    starts: Starts
    model: Any
    """Model whose gradients the descents take."""
    objective: Objective
    """Quantity that the descents make small; the trials and the validation compare tilts."""
    attempts: ClassVar[int] = 3
    has_validation_runs: ClassVar[bool] = True

    @staticmethod
    def of(
        scene: Scene,
        space: DesignSpace | None = None,
        *,
        conditions: Conditions | None = None,
        starts: Starts | None = None,
        objective: Objective | None = None,
        **given: Any,
    ) -> HarmonicProblem:
        """Return the problem of a scene with arguments of `tpd.optimise`; None stands for the default
        everywhere.

        Raises:
            ValueError: bad input.
            RuntimeError: JAX is in 32-bit mode.
        """
        checks.instance("scene", scene, Scene)
        checks.optional("conditions", conditions, Conditions)
        checks.optional("starts", starts, Starts)
        if not isinstance(scene.motion, Harmonic):
            raise ValueError(
                "the motion of `scene` must be a harmonic: give pulses and records by "
                "`conditions=tpd.Conditions.records(...)`"
            )
        found = complete(scene, _USUAL, given | {"space": space})
        searched: DesignSpace = found["space"]
        conditions = Conditions.around(scene) if conditions is None else conditions
        check_moves(scene, conditions)
        check_scatter(scene, {name for name, v in conditions.factors.items() if np.ptp(v) > 0.0}, searched)
        # Housner's restitution is least with the heaviest bob.
        heaviest = under_all(as_arrays(scene.parameters()), searched.ends[1:], conditions)
        # Where impacts lose much, the bias of smoothed ones comes near the tolerance of the ends.
        smooth = bool(np.all(np.asarray(heaviest.velocity_ratio) >= _SMOOTH))
        model = _model_of(found["method"].model, smooth)
        model.check(heaviest)
        starts = Starts.any() if starts is None else starts
        if starts.kind is StartKind.sampled:
            raise ValueError(
                "`starts` of a design must be Starts.any() or Starts.rest(), but is a sampled set: its runs "
                "begin where `ensemble` says"
            )
        return HarmonicProblem(
            scene=scene,
            conditions=conditions,
            starts=starts,
            objective=SteadyTilt() if objective is None else check_objective(objective),
            model=model,
            **found | {"ensemble": found["ensemble"].seeded(found["seed"])},
        )

    @property
    def rest_counts(self) -> bool:  # type: ignore[override]
        """See `Problem.rest_counts`."""
        return self.starts.kind is StartKind.rest

    @property
    def rounds(self) -> tuple[int, int]:
        """See `Problem.rounds`."""
        return _ROUNDS

    @property
    def inputs(self) -> dict[str, Any]:
        """See `Problem.inputs`: the model follows from the method."""
        return {name: x for name, x in super().inputs.items() if name != "model"}

    @property
    def job(self) -> Job:
        """See `Problem.job`."""
        job = super().job
        if self.objective != SteadyTilt():
            raise ValueError("a job file cannot state an objective, which exists only in Python")
        conditions = Conditions.around(self.scene) if job.conditions is None else job.conditions
        rows = conditions.factor_rows(), self.conditions.factor_rows()
        if job.scene != self.scene or not np.array_equal(*rows):
            raise ValueError(
                "a job file cannot say the conditions of this design: it has bands, amplitudes and scatter, "
                f"and these are {', '.join(self.conditions.description) or 'of Python'}"
            )
        return job

    @property
    def tables(self) -> dict[str, dict[str, Any]]:
        """See `Problem.tables`; those of the conditions are from their factors and the phrases that describe
        them."""
        asked = super().tables | {
            "motion": vars(self.scene.motion),
            "requirements": vars(self.requirements),
            # Runs without a seed of their own use the seed of the search.
            "ensemble": vars(self.ensemble) | ({"seed": None} if self.ensemble.seed == self.seed else {}),
            "starts": {"kind": "rest" if self.rest_counts else "any"},
        }
        found, phrases = self.conditions, " * ".join(self.conditions.description)
        if np.array_equal(found.factor_rows(), Conditions.around(self.scene).factor_rows()):
            return asked
        if len(found) == 1 and not found.factors:
            return asked | {"conditions": {"exactly": True}}
        table: dict[str, Any] = {}
        if said := re.search(r"(\d+) frequencies from (\S+) to (\S+) Hz", phrases):
            table |= {"band": [float(said[2]), float(said[3])], "frequencies": int(said[1])}
        if said := re.search(r"amplitudes ([^a-z]+) times", phrases):
            table["amplitudes"] = [float(x) for x in said[1].split(",")]
        scatter = {}
        if said := re.search(r"(\d+) samples of", phrases):
            table["samples"] = int(said[1])
            scatter = {name: 0.01 * float(x) for name, x in re.findall(r"(\w+) within (\d+)%", phrases)}
        return asked | {"conditions": table, "scatter": scatter}

    @property
    def allowed(self) -> float:
        """See `Problem.allowed`."""
        return self.requirements.allowed

    @cached_property
    def orbits(self) -> Orbits:
        """Symmetric orbits of designs under all conditions."""
        common = as_arrays(self.scene.parameters()), self.conditions, self.space, self.risk, self.limits
        orbits = Orbits(*common, self.geometry, self.rest_counts, self.objective)
        # Limits that compare with the block without a pendulum know its tilts.
        return orbits.compared_without_pendulum()

    @property
    def _none(self) -> np.ndarray:
        """A bob without mass, which the block does not feel."""
        p = self.orbits.p
        return np.array([0.0, float(p.lam), float(p.zeta)])

    def lifts(self, pendulum: Pendulum) -> tuple[float, float]:
        """See `Problem.lifts`."""
        both = self.scene.parameters(pendulum), self.scene.parameters()
        with_it, without = (float(p.f / (1.0 - uplift(p).margin)) for p in both)
        return with_it, without

    @property
    def at_rest(self) -> AtRest:
        """See `Problem.at_rest`."""
        q = under_all(as_arrays(self.scene.parameters()), self._none[None], self.conditions)
        return AtRest.of(q.nu, q.k, q.f, self.scene.block.base_friction)

    def candidates(self, progress: Progress) -> tuple[np.ndarray, Search]:
        """See `Problem.candidates`: ends of the descents that the exact solution confirms, designs on their
        paths, and designs spread over the space."""
        few = replace(self, conditions=self.conditions.subset(_SEARCHED, self.seed)).orbits
        if isinstance(self.model, Smoothed):
            prepare_step(few, self.model)
        # Trial runs need the compiled engine; it loads while the descents run.
        aside(load_compiled)
        found = search(few, replace(self.method, model=self.model), self.seed, progress)
        if len(few.conditions) < len(self.conditions):
            part = f" under {len(few.conditions)} of the {len(self.conditions)} conditions"
            found = replace(found, description=found.description + part)
        rng = np.random.default_rng([self.seed, 9])
        drawn = self.space.unscaled(latin_hypercube(rng, _DRAWN, len(self.space.names)))
        sizes = self.fixed_sizes(drawn)
        # Designs that exceed a limit without any run come last: some remain, to show what the limit costs.
        over = np.max([np.zeros(len(drawn)), *sizes.values()], axis=0) > 1.0
        spread = drawn[np.argsort(over, kind="stable")[:_SPREAD]]
        return np.concatenate([found.confirmed, found.passed[:_PATHS], spread]), found

    def fixed_sizes(self, designs: np.ndarray) -> dict[str, np.ndarray]:
        """See `Problem.fixed_sizes`."""
        out, e = super().fixed_sizes(designs), self.orbits.evaluate(designs)
        for limit in self.limits:
            for size in limit.sizes(e, self.orbits.geometry):
                # Without a motion that attracts there is none to limit: the runs show what happens.
                value = np.where(e.attracts | (not limit.of_motion), size.value, 0.0).max(axis=1)
                value = np.nan_to_num(value, nan=np.inf, posinf=np.inf)
                known = out.get(size.name)
                out[size.name] = value if known is None else np.maximum(known, value)
        return out

    def value_of(self, runs: Runs) -> float:
        """See `Problem.value_of`: the mean, which the benefit compares; the risk measure is for the
        descents."""
        known = runs.severity[~runs.is_unanswered]
        return float(known.mean()) if len(known) else np.nan

    def trial_runs(self, design: np.ndarray | None, seed: int) -> Runs:
        """See `Problem.trial_runs`."""
        size = min(TRIAL_RUNS, self.ensemble.size) * (_WITHOUT if design is None else 1)
        # If there are more conditions than runs, every trial has others.
        order = np.random.default_rng([seed, 13]).permutation(len(self.conditions))
        some = Conditions({name: x[order] for name, x in self.conditions.factors.items()})
        with_it = None if design is None else self.pendulum(design)
        return outcomes(self.scene, with_it, ensemble=self._short(size, seed), conditions=some)

    def _short(self, size: int, seed: int) -> Ensemble:
        """Few runs of few periods, for comparisons by the linear equations."""
        periods = min(TRIAL_PERIODS, self.ensemble.periods)
        return replace(self.ensemble, size=size, periods=periods, seed=seed)

    def runs_alone(self, seed: int, progress: Any = None) -> Runs:
        """See `Problem.runs_alone`."""
        half = replace(self.ensemble, size=max(1, self.ensemble.size // 2), seed=seed)
        how: dict[str, Any] = {"equations": Terms.nonlinear.value, "rtol": _RTOL, "progress": progress}
        return outcomes(self.scene, ensemble=half, conditions=self.conditions, **how)

    def paired_runs(
        self, design: np.ndarray, seed: int, varied: Variation = STATED, progress: Progress = unreported
    ) -> PairedRuns:
        """See `Problem.paired_runs`."""
        equations, scene, more = varied
        if equations == Terms.linear.value:
            runs = self._short(min(_COMPARED, self.ensemble.size), seed)
        else:
            runs = replace(self.ensemble, size=max(1, self.ensemble.size // 2), seed=seed)
        if scene is not None:
            # A restitution that is changed does not scatter as well.
            runs = replace(runs, restitution=0.0)
        conditions = self.conditions if more is None else self.conditions * more
        found = paired_runs(
            self.scene if scene is None else scene,
            self.pendulum(design),
            ensemble=runs,
            conditions=conditions,
            equations=equations,
            rtol=_RTOL,
            progress=partial(progress, "paired runs"),
        )
        return replace(found, worse=self.requirements.worse)

    def exact(self, design: np.ndarray | None) -> ExactMotions:
        """Return the exact motions of a design, or without a pendulum, under all conditions."""
        orbits = self.orbits
        row = self._none if design is None else design
        e = orbits.evaluate(row[None])
        q = under_all(orbits.p, row[None], self.conditions)
        settled = follow(Terms.linear, row_of(q), HarmonicForcing())
        outcome, lift = code_of(settled.status), uplift(q)
        sizes = {x: np.asarray(getattr(settled, x)) for x in ("amplitude", "swing", "peak", "peak_swing")}
        # The run ends when the block rests, and the bob may still swing: its settled swing has a closed form.
        sizes["swing"] = np.where(outcome == code_of(Status.rest), lift.swing, sizes["swing"])
        # A run comes near an orbit, which is known to round-off.
        amplitude = e.tilt[0] * np.asarray(q.nu)
        is_orbit = (np.abs(sizes["amplitude"] - amplitude) <= _SAME * amplitude) & (amplitude > 0.0)
        for name, exact in (("amplitude", amplitude), ("swing", e.swing[0])):
            sizes[name] = np.where(is_orbit, exact, sizes[name])
        overturned = outcome == code_of(Status.overturned)
        return ExactMotions(
            value=float(orbits.value(e)[0]),
            orbits=e,
            margin=np.asarray(lift.margin),
            status=names_of(outcome),
            multiplier=np.where(is_orbit, e.multiplier[0], np.nan),
            **{name: np.where(overturned, np.inf, x) for name, x in sizes.items()},
        )

    def strongest_motions(self, design: np.ndarray) -> list[GroundMotion]:
        """See `Problem.strongest_motions`: trains of sines that begin at rest."""
        motion, c = self.scene.motion, self.conditions
        pulses = [
            Pulse.sine_train(
                acceleration=float(motion.amplitude * a * (motion.rate * w) ** 2),
                frequency=float(motion.frequency * w),
                cycles=_CYCLES,
            )
            for a, w in zip(c.column("amplitude"), c.column("frequency"), strict=True)
        ]
        # Rod and damper are loaded most near the pendulum's own frequency, not by the strongest excitation.
        swing = self.orbits.evaluate(design[None]).swing[0]
        order = np.argsort(-np.nan_to_num(swing, posinf=-1.0, nan=-1.0), kind="stable")
        return [pulses[i] for i in order[:MOST_MOTIONS]]


def _model_of(model: Any, smooth: bool) -> Any:
    """Model of a descent; raise `ValueError` unless its symmetric orbits are known."""
    named = {"smoothed": SMOOTHED, "piecewise": Piecewise(), None: SMOOTHED if smooth else Piecewise()}
    if model is None or isinstance(model, str):
        return named[model]
    if isinstance(model, Piecewise) or (isinstance(model, Smoothed) and model.terms is Terms.linear):
        return model
    raise ValueError(
        "`model` must be Smoothed() with linear terms, or Piecewise(), whose symmetric orbits are known, but "
        f"is {checks.shown(model)}"
    )
