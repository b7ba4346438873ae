"""Design problem under harmonic excitation: the search uses the settled orbits under all conditions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tpd.answers.attractors import StartKind, Starts
from tpd.answers.ensemble import Ensemble, outcomes
from tpd.answers.run_table import Runs
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, follow
from tpd.core import checks
from tpd.core.formatting import number, percent
from tpd.core.progress import Progress
from tpd.design.corrections import Corrections
from tpd.design.orbits import SMOOTHED, Orbits, prepare_step
from tpd.design.problem import MOST_MOTIONS, STATED, Problem, Variation, Words
from tpd.design.reasons import ReasonKind
from tpd.design.risk import Risk
from tpd.design.settings import VALIDATION_RUNS, Descent, GroundSearch
from tpd.design.sizes import Evaluation, evaluate_sizes
from tpd.design.space import DesignSpace, check_moves, check_scatter
from tpd.limits import (
    DEFAULT_LIMITS,
    Objective,
    Settling,
    Worsening,
    check_objective,
    limit_of,
    usual_stroke,
)
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed
from tpd.scene.conditions import Conditions, train_of, under_all
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.scene import NO_PENDULUM, Block, Harmonic, Scene
from tpd.scene.status import Status, code_of, names_of
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import AtRest, lightest_pendulum, uplift

TRIAL_RUNS, _MORE_RUNS, TRIAL_PERIODS = 96, 1024, 50
"""Numbers of runs of a trial and of a comparison, and largest number of forcing periods of each run."""
_COMPARISON_RUNS = 256
"""Number of paired runs of the linear equations for comparisons with changed scenes."""
_RTOL = 1e-6
"""Relative tolerance of the steps of validation runs. Their means are those of 1e-8, in 30 % less time."""
_SEARCH_CONDITIONS = 64
"""Largest number of conditions of the descents. The trials use all conditions."""
_MATCH_TOLERANCE = 1e-6
"""Relative difference of tilts below which a simulated motion is identified with an orbit."""
_LEAST_RESTITUTION = 0.2
"""Smallest velocity ratio of impacts for which descents use smoothed impacts."""


@dataclass(frozen=True, kw_only=True)
class ExactMotions:
    """Motions of a design under all n conditions by the linear equations.

    They are the settled orbits in closed form, and the motions from rest by the exact solution. Arrays have
    the shape (n,), angles are in rad.
    """

    value: float
    """Risk of the merits of the orbits, see `Evaluation`."""
    orbits: Evaluation
    """Settled orbits, with a leading axis of length 1."""
    margin: np.ndarray
    """Uplift margin."""
    status: np.ndarray
    """Names of the outcomes after a start from rest."""
    settled_tilt: np.ndarray
    """Settled |phi| after a start from rest; infinite if the block overturns."""
    settled_swing: np.ndarray
    """Settled |psi| after a start from rest."""
    tilt: np.ndarray
    """Largest |phi| during the whole run from rest."""
    swing: np.ndarray
    """Largest |psi| during the whole run from rest."""
    multiplier: np.ndarray
    """Largest modulus of the Floquet multipliers if the settled motion is the orbit; else NaN."""


@dataclass(frozen=True, kw_only=True, repr=False)
class HarmonicProblem(Problem):
    """Design problem under harmonic excitation."""

    starts: Starts
    """Initial states of the search."""
    objective: Objective
    """Quantity that the descents minimise. Trials and validation reduce what `requirements.reduce` states."""
    defaults = Problem.defaults | {
        "risk": Risk.cvar(),
        "limits": DEFAULT_LIMITS,
        "method": Descent(),
        "ensemble": Ensemble(size=VALIDATION_RUNS),
        "starts": Starts.any(),
        "objective": Settling(),
    }
    pictures = *Problem.pictures, "motion"
    has_earthquakes = False
    attempts = 3
    # Other reasons than limits are those of the best design, so that no other one is better.
    retries = frozenset({ReasonKind.breaks_limit, ReasonKind.touches_wall, ReasonKind.exceeds_limit})

    @staticmethod
    def of(
        scene: Scene | Block,
        space: DesignSpace | None = None,
        *,
        conditions: Conditions | None = None,
        **inputs: Any,
    ) -> HarmonicProblem:
        """Return the problem of a scene from the arguments of `tpd.optimise`. None stands for the default.

        Raises:
            ValueError: an input is out of range, or does not fit the excitation.
            RuntimeError: JAX is in 32-bit mode.
        """
        if isinstance(scene, Block) or isinstance(inputs.get("method"), GroundSearch):
            raise ValueError("a block alone, or a `GroundSearch`, needs `conditions=Conditions.records(...)`")
        checks.instance("scene", scene, Scene)
        hint = ": pass pulses and records as `conditions=tpd.Conditions.records(...)`"
        checks.instance("scene.excitation", scene.excitation, Harmonic, hint)
        checked = HarmonicProblem.checked(scene, space=space, **inputs)
        conditions = Conditions.around(scene) if conditions is None else conditions
        check_moves(scene, conditions)
        varied = {name for name, factors in conditions.factors.items() if np.ptp(factors) > 0.0}
        check_scatter(scene, varied, checked["space"])
        check_objective(checked["objective"])
        if checked["starts"].kind is StartKind.sampled:
            raise ValueError(
                "`starts` of a design must be Starts.any() or Starts.rest(), but is a sampled set: "
                "`ensemble` defines the initial states of the runs"
            )
        checked["ensemble"] = checked["ensemble"].seeded(checked["seed"])
        problem = HarmonicProblem(scene=scene, conditions=conditions, **checked)
        # The model is chosen now, because it may not fit the block.
        _ = problem.model
        return problem

    @property
    def rest_counts(self) -> bool:  # type: ignore[override]
        """See `Problem.rest_counts`."""
        return self.starts.kind is StartKind.rest

    @property
    def _parameters(self) -> Parameters:
        """Parameters of the block without a pendulum, with the hinge of the designs."""
        return as_arrays(replace(self.scene.parameters(), kappa=self.hinge_ratio))

    @cached_property
    def model(self) -> Any:
        """Model that gives the gradients of the descents.

        Raises:
            ValueError: the symmetric orbits of the model cannot be computed, or it does not fit the block.
        """
        # Housner's coefficient of restitution is smallest for the heaviest bob, so check that end of the
        # space.
        heaviest = under_all(self._parameters, self.space.ends[1:], self.conditions)
        # If impacts lose much energy, the error of smoothed impacts approaches the tolerance of the search.
        is_smooth = np.all(np.asarray(heaviest.velocity_ratio) >= _LEAST_RESTITUTION)
        named = {"smoothed": SMOOTHED, "piecewise": Piecewise(), None: SMOOTHED if is_smooth else Piecewise()}
        model: Any = self.method.model
        if model is None or isinstance(model, str):
            model = named[model]
        is_linear = isinstance(model, Smoothed) and model.terms is Terms.linear
        if not (is_linear or isinstance(model, Piecewise)):
            raise ValueError(
                "`model` must be Smoothed() with linear terms, or Piecewise(), because only their symmetric "
                f"orbits can be followed, but is {checks.quote(model)}"
            )
        model.check(heaviest)
        return model

    @cached_property
    def orbits(self) -> Orbits:
        """Symmetric orbits of designs under all conditions."""
        common = self._parameters, self.conditions, self.space, self.risk, self.limits
        orbits = Orbits(*common, self.geometry, self.rest_counts, self.objective)
        if limit_of(self.limits, Worsening) is None:
            return orbits
        # This limit compares with the tilts of the block without a pendulum.
        e = orbits.evaluate(np.array([NO_PENDULUM]))
        tilt = np.where(e.attracts[0], e.tilt[0], np.nan)
        return replace(orbits, geometry=replace(self.geometry, tilt_without_pendulum=tilt))

    @property
    def words(self) -> Words:
        """See `Problem.words`."""
        motion, e, g = self.scene.excitation, self.ensemble, number(self.scene.gravity)
        more = "" if len(self.conditions) == 1 else ", with the changes of the conditions"
        sine = f"{number(motion.amplitude)} m · sin(2π · {number(motion.frequency)} Hz · t)"
        column, own = self.conditions.column, float(motion.frequency)
        share, most = percent(e.disturbed), max(e.tilt, e.tilt_rate)
        growth = ", or ".join(
            f"grows over {x:g} periods ({number(x / own, 3)} s)" if x else "begins suddenly" for x in e.growth
        )
        hertz, metres = motion.frequency * column("frequency"), motion.amplitude * column("amplitude")
        low, high = (number(x, 3) for x in (hertz.min(), hertz.max()))
        size = f"{'up to ' if metres.min() < metres.max() else ''}{number(float(metres.max()), 3)} m"
        return Words(
            excitation=f"{motion.in_words}, largest acceleration {number(self.scene.peak, 3)} g",
            scope=f"a harmonic of {low if low == high else f'{low} to {high}'} Hz and {size}",
            assumed="horizontal harmonic motion of the base in the plane of the block, "
            f"{sine}{more}; g = {g} m/s²",
            starts=f"block and bob begin at rest. Of the runs {share} begin after a disturbance: a tilt "
            f"of up to {percent(most)} of the toppling tilt, a bob angle of up to {number(e.swing)} rad, and "
            "rates of the same size per unit of dimensionless time. The excitation "
            f"{growth}, in equal shares of the runs",
            duration=f"runs of {e.periods} periods ({number(e.periods / own, 3)} s), or until the motion "
            "repeats",
        )

    def isolation(self, level: float) -> tuple[np.ndarray, float]:
        """Return the period for the lowest frequency only; see `Problem.isolation`."""
        lowest = float(self.scene.excitation.frequency * np.min(self.conditions.column("frequency")))
        return np.array([math.sqrt(1.0 + level / self.at_rest.uplift) / lowest]), 0.0

    @property
    def usual_level(self) -> tuple[float, str]:
        """See `Problem.usual_level`."""
        return self.at_rest.peak, "strongest condition"

    @property
    def at_rest(self) -> AtRest:
        """See `Problem.at_rest`."""
        q = under_all(self._parameters, np.array([NO_PENDULUM]), self.conditions)
        return AtRest.of(q.nu, q.k, q.f, self.scene.block.base_friction)

    @property
    def objective_in_words(self) -> str:  # type: ignore[override]
        """See `Problem.objective_in_words`."""
        return self.objective.label or self.objective.name

    @cached_property
    def searched(self) -> Orbits:
        """Symmetric orbits under the conditions of the descents."""
        return replace(self, conditions=self.conditions.subset(_SEARCH_CONDITIONS, self.seed)).orbits

    def improver(self, guess: np.ndarray | None, progress: Progress) -> Corrections:
        """See `Problem.improver`."""
        if isinstance(self.model, Smoothed):
            prepare_step(self.searched, self.model)
        # The model is chosen by the block, unless the settings state it.
        method = replace(self.method, model=self.model)
        return Corrections(self, self.orbits, self.searched, method, progress, guess)

    def fixed_sizes(self, designs: np.ndarray, swing: float = 0.0) -> dict[str, np.ndarray]:
        """See `Problem.fixed_sizes`."""
        out, e = super().fixed_sizes(designs, swing), self.orbits.evaluate(designs)
        for limit in self.limits:
            for size in evaluate_sizes([limit], e, self.orbits.geometry):
                # Without an attracting orbit there is no settled motion to limit: the trial runs show what
                # happens.
                value = np.where(e.attracts | (not limit.of_motion), size.value, 0.0).max(axis=1)
                value = np.nan_to_num(value, nan=np.inf, posinf=np.inf)
                at_rest = out.get(size.name)
                out[size.name] = value if at_rest is None else np.maximum(at_rest, value)
        return out

    def risk_of(self, severity: np.ndarray) -> float:
        """Return the mean, which is what the benefit compares. Only the descents use the risk measure."""
        return float(severity.mean())

    def trial_runs(self, design: np.ndarray | None, seed: int, equations: str = Terms.linear.value) -> Runs:
        """See `Problem.trial_runs`."""
        # If there are more conditions than runs, other conditions are used with another seed.
        order = np.random.default_rng([seed, 13]).permutation(len(self.conditions))
        some = Conditions({name: x[order] for name, x in self.conditions.factors.items()})
        ensemble = self._short(min(TRIAL_RUNS, self.ensemble.size), seed)
        if equations == Terms.nonlinear.value:
            # As long as in the validation: in a longer run the bob swings further.
            ensemble = replace(self.ensemble, size=min(_MORE_RUNS, self.ensemble.size), seed=seed)
        pendulum = None if design is None else self.pendulum(design)
        settings: dict[str, Any] = {"equations": equations, "rtol": _RTOL}
        return outcomes(self.scene, pendulum, ensemble=ensemble, conditions=some, **settings)

    def _short(self, size: int, seed: int) -> Ensemble:
        """Return an ensemble of few runs over few periods, for comparisons by the linear equations."""
        # The excitation must have its full size in at least half of the periods.
        least = int(2.0 * max(self.ensemble.growth))
        periods = min(max(TRIAL_PERIODS, least), self.ensemble.periods)
        return replace(self.ensemble, size=size, periods=periods, seed=seed)

    @property
    def rule_sizes(self) -> tuple[float, float, float]:
        """See `Problem.rule_sizes`: the length of the lightest pendulum that prevents uplift of a settled
        block."""
        length = float(lightest_pendulum(self.scene.parameters(), usual_stroke(self.limits)).lam)
        return length, length, 0.0

    def validation_runs(
        self, design: np.ndarray | None, seed: int, varied: Variation = STATED, progress: Any = None
    ) -> Runs:
        """See `Problem.validation_runs`."""
        # One half of the validation runs decides and the other half is reported, so each call simulates one
        # half.
        runs = replace(self.ensemble, size=max(1, self.ensemble.size // 2), seed=seed)
        if varied.equations == Terms.linear.value:
            runs = self._short(min(_COMPARISON_RUNS, self.ensemble.size), seed)
        runs = replace(runs, restitution=0.0) if varied.fixes_restitution else runs
        pendulum = None if design is None else self.pendulum(design)
        how: dict[str, Any] = {"equations": varied.equations, "rtol": _RTOL, "progress": progress}
        how |= {"ensemble": runs, "conditions": self.conditions * varied.more}
        return outcomes(varied.scene or self.scene, pendulum, **how)

    def _groups_of(self, runs: Runs) -> dict[str, Any]:
        """Return the condition of each run."""
        labels = tuple(map(self.conditions.label, range(len(self.conditions))))
        return {"group": runs.condition, "labels": labels}

    def exact(self, design: np.ndarray | None) -> ExactMotions:
        """Return the exact motions of a design under all conditions; None for the design means no
        pendulum."""
        orbits = self.orbits
        row = np.array([NO_PENDULUM if design is None else design])
        e, q = orbits.evaluate(row), under_all(orbits.p, row, self.conditions)
        run = follow(Terms.linear, row_of(q), HarmonicForcing())
        # Runs from rest by the exact solution, for comparison with the orbits in closed form.
        outcome, lift = code_of(run.status), uplift(q)
        sizes = {name: getattr(run, name) for name in ("tilt", "settled_tilt", "swing", "settled_swing")}
        # A run ends when the block comes to rest, but the bob may still swing. Its settled swing has a closed
        # form.
        sizes["settled_swing"] = np.where(outcome == code_of(Status.rest), lift.swing, sizes["settled_swing"])
        # A run only approaches an orbit, but the orbit itself is known to rounding: use its values.
        amplitude = e.tilt[0] * np.asarray(q.nu)
        is_orbit = (np.abs(sizes["settled_tilt"] - amplitude) <= _MATCH_TOLERANCE * amplitude) & (
            amplitude > 0.0
        )
        for name, exact in (("settled_tilt", amplitude), ("settled_swing", e.swing[0])):
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

    @property
    def stated_motions(self) -> list[GroundMotion]:
        """See `Problem.stated_motions`. The motions are trains of sines that start from rest."""
        factors = (self.conditions.column(name) for name in ("amplitude", "frequency"))
        return [train_of(self.scene.excitation, *map(float, pair)) for pair in zip(*factors, strict=True)]

    def strongest_motions(self, design: np.ndarray) -> list[GroundMotion]:
        """See `Problem.strongest_motions`."""
        # Rod and damper are loaded most near the natural frequency of the pendulum, and not by the strongest
        # excitation.
        swing = self.orbits.evaluate(design[None]).swing[0]
        order = np.argsort(-np.nan_to_num(swing, posinf=-1.0, nan=-1.0), kind="stable")
        motions = self.stated_motions
        return [motions[i] for i in order[:MOST_MOTIONS]]
