"""Design problem under harmonic excitation: the settled orbits under all conditions guide the search."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from tpd.answers.attractors import StartKind, Starts
from tpd.answers.ensemble import Ensemble, Outcomes, outcomes
from tpd.answers.paired import PairedRuns, paired_runs
from tpd.answers.steady_state import steady_state
from tpd.core import checks
from tpd.core.batch import aside
from tpd.core.progress import Progress, unreported
from tpd.design.criteria import (
    DEFAULT_LIMITS,
    REST,
    DesignSpace,
    Evaluation,
    Limit,
    Objective,
    Risk,
    Room,
    SteadyTilt,
    Worth,
    check_cavity,
    check_limits,
    check_moves,
    check_objective,
)
from tpd.design.orbits import Orbits, margins
from tpd.design.problem import MOST_MOTIONS, Problem, check_given, within_mass
from tpd.design.search import Search, search
from tpd.design.settings import VALIDATION_RUNS, Descent
from tpd.design.smoothed_orbits import SMOOTHED, prepare_step
from tpd.exact.calling import load_compiled
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, follow
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed
from tpd.scene.conditions import Conditions, check_restitution, latin_hypercube, under, under_all
from tpd.scene.ground_motion import GroundMotion, Pulse
from tpd.scene.parameters import as_arrays
from tpd.scene.scene import Harmonic, Scene
from tpd.scene.status import names_of, status_name
from tpd.theory.equations import Terms

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
_RESTS = 24
"""Most conditions under which the nonlinear equations confirm that the block stays at rest."""
_CYCLES = 40
"""Periods of a harmonic from rest in which the loads are largest."""
_POLISHED = 32
"""Most conditions under which exact amplitudes are polished by Newton's method to round-off."""
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
    stroke: np.ndarray
    """Settled |psi|."""
    peak: np.ndarray
    """Largest |phi| from the beginning on."""
    peak_stroke: np.ndarray
    """Largest |psi| from the beginning on."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers; NaN where unknown."""


@dataclass(frozen=True, kw_only=True, repr=False)
class HarmonicProblem(Problem):
    """A design problem under harmonic excitation."""

    starts: Starts
    model: Any
    """Model whose gradients the descents take."""
    objective: Objective
    """Quantity that the descents make small; the trials and the validation compare tilts."""
    attempts: ClassVar[int] = 3
    holds_back: ClassVar[bool] = True

    @staticmethod
    def of(
        scene: Scene,
        space: DesignSpace | None = None,
        *,
        conditions: Conditions | None = None,
        starts: Starts | None = None,
        risk: Risk | None = None,
        limits: Iterable[Limit] | None = None,
        objective: Objective | None = None,
        method: Descent | None = None,
        ensemble: Ensemble | None = None,
        worth: Worth | None = None,
        seed: checks.Whole = 0,
    ) -> HarmonicProblem:
        """Return the problem of a scene; None stands for the default everywhere.

        Raises:
            ValueError: bad input.
            RuntimeError: JAX is in 32-bit mode.
        """
        given = {"space": space, "conditions": conditions, "risk": risk}
        seed = check_given(seed, **given, ensemble=ensemble, worth=worth)
        checks.instance("scene", scene, Scene)
        checks.optional("method", method, Descent)
        checks.optional("starts", starts, Starts)
        if not isinstance(scene.motion, Harmonic):
            raise ValueError(
                "the motion of `scene` must be a harmonic: give pulses and records by "
                "`conditions=tpd.Conditions.records(...)`"
            )
        conditions = Conditions.around(scene) if conditions is None else conditions
        space = DesignSpace() if space is None else space
        check_moves(scene, conditions, space)
        # Housner's restitution is least with the heaviest bob.
        heaviest = under_all(as_arrays(scene.parameters()), space.full(space.bounds[1])[None], conditions)
        method = Descent() if method is None else method
        # Where impacts lose much, the bias of smoothed ones comes near the tolerance of the ends.
        smooth = bool(np.all(np.asarray(heaviest.velocity_ratio) >= _SMOOTH))
        model = _model_of(method.model, smooth)
        model.check(heaviest)
        limits = check_limits(DEFAULT_LIMITS if limits is None else limits)
        check_cavity(scene.block, limits)
        starts = Starts.any() if starts is None else starts
        if starts.kind is StartKind.sampled:
            raise ValueError(
                "`starts` of a design must be Starts.any() or Starts.rest(), but is a sampled set: its runs "
                "begin where `ensemble` says"
            )
        ensemble = (Ensemble(size=VALIDATION_RUNS) if ensemble is None else ensemble).seeded(seed)
        if ensemble.restitution:
            check_restitution(scene)
        return HarmonicProblem(
            scene=scene,
            space=within_mass(space, scene.block, limits),
            conditions=conditions,
            starts=starts,
            risk=Risk.worst() if risk is None else risk,
            limits=limits,
            objective=SteadyTilt() if objective is None else check_objective(objective),
            method=method,
            model=model,
            ensemble=ensemble,
            worth=Worth() if worth is None else worth,
            seed=seed,
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
    def allowed(self) -> float:
        """See `Problem.allowed`."""
        return self.worth.allowed

    @property
    def run_limits(self) -> tuple[Limit, ...]:
        """See `Problem.run_limits`: the clearance. The other limits are those of the settled orbits."""
        return tuple(limit for limit in self.limits if isinstance(limit, Room))

    @cached_property
    def orbits(self) -> Orbits:
        """Symmetric orbits of designs under all conditions."""
        common = as_arrays(self.scene.parameters()), self.conditions, self.space, self.risk, self.limits
        orbits = Orbits(*common, self.geometry, self.rest_counts, self.objective)
        # Limits that compare with the block without a pendulum know its tilts.
        return orbits.against_bare()

    @property
    def _none(self) -> np.ndarray:
        """A bob without mass, which the block does not feel."""
        p = self.orbits.p
        return np.array([0.0, float(p.lam), float(p.zeta)])

    def stays_at_rest(self) -> bool:
        """See `Problem.stays_at_rest`: by the exact orbits under all conditions and by the nonlinear
        equations from rest under a choice of them."""
        if not np.all(self.orbits.evaluate(self._none[None]).kind == REST):
            return False
        few = self.conditions.subset(_RESTS, self.seed)
        q = under_all(self.orbits.p, self._none[None], few)
        settled = follow(Terms.nonlinear, row_of(q), HarmonicForcing(self.ensemble.periods))
        return not np.any(np.asarray(settled.amplitude))

    def candidates(self, progress: Progress) -> tuple[np.ndarray, Search]:
        """See `Problem.candidates`: ends of the descents that the exact solution confirms, designs on their
        paths, and designs spread over the space."""
        few = self.orbits.over(self.conditions.subset(_SEARCHED, self.seed))
        if isinstance(self.model, Smoothed):
            prepare_step(few, self.model)
        # Trial runs need the compiled engine; it loads while the descents run.
        aside(load_compiled)
        found = search(few, replace(self.method, model=self.model), self.seed, progress)
        if len(few.conditions) < len(self.conditions):
            part = f" under {len(few.conditions)} of the {len(self.conditions)} conditions"
            found = replace(found, description=found.description + part)
        rng = np.random.default_rng([self.seed, 9])
        drawn = self.space.unscaled(latin_hypercube(rng, _DRAWN, self.space.bounds.shape[1]))
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

    def value_of(self, runs: Outcomes) -> float:
        """See `Problem.value_of`: the mean, which the benefit compares; the risk measure is for the
        descents."""
        known = runs.severity[~runs.undecided]
        return float(known.mean()) if len(known) else np.nan

    def trial_runs(self, design: np.ndarray | None, seed: int) -> Outcomes:
        """See `Problem.trial_runs`."""
        size = min(TRIAL_RUNS, self.ensemble.size) * (_WITHOUT if design is None else 1)
        # If there are more conditions than runs, every trial has others.
        order = np.random.default_rng([seed, 13]).permutation(len(self.conditions))
        some = Conditions({name: x[order] for name, x in self.conditions.factors.items()})
        hung = None if design is None else self.pendulum(design)
        return outcomes(self.scene, hung, ensemble=self._short(size, seed), conditions=some)

    def _short(self, size: int, seed: int) -> Ensemble:
        """Few runs of few periods, for comparisons by the linear equations."""
        periods = min(TRIAL_PERIODS, self.ensemble.periods)
        return replace(self.ensemble, size=size, periods=periods, seed=seed)

    def paired_runs(
        self,
        design: np.ndarray,
        seed: int,
        *,
        equations: str = "nonlinear",
        scene: Scene | None = None,
        more: Conditions | None = None,
        progress: Progress = unreported,
    ) -> PairedRuns:
        """See `Problem.paired_runs`."""
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
        return replace(found, worse=self.worth.worse)

    def exact(self, design: np.ndarray | None) -> ExactMotions:
        """Return the exact motions of a design, or without a pendulum, under all conditions."""
        orbits, n = self.orbits, len(self.conditions)
        row = self._none if design is None else design
        e = orbits.evaluate(row[None])
        q = under_all(orbits.p, row[None], self.conditions)
        settled = follow(Terms.linear, row_of(q), HarmonicForcing(self.ensemble.periods))
        names, unknown = names_of(settled.status), np.full(n, np.nan)
        sizes = {x: np.asarray(getattr(settled, x)) for x in ("amplitude", "stroke", "peak", "peak_stroke")}
        if n <= _POLISHED:
            steady = [
                steady_state(as_arrays(under(orbits.p, row, factors)), model=Piecewise())
                for factors in self.conditions.factor_rows()
            ]
            names = np.array([status_name(s.status) for s in steady])
            columns = ("amplitude", "stroke", "multiplier")
            amplitude, stroke, unknown = (np.array([float(getattr(s, x)) for s in steady]) for x in columns)
            sizes |= {"amplitude": amplitude, "stroke": stroke}
        lost = names == "overturned"
        return ExactMotions(
            value=float(orbits.value(e)[0]),
            orbits=e,
            margin=margins(orbits, row[None])[0],
            status=names,
            multiplier=unknown,
            **{name: np.where(lost, np.inf, x) for name, x in sizes.items()},
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
        stroke = self.orbits.evaluate(design[None]).stroke[0]
        order = np.argsort(-np.nan_to_num(stroke, posinf=-1.0, nan=-1.0), kind="stable")
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
