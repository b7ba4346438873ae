"""Comparison of a design in an engine and with the nonlinear equations (4), on the same paired runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tpd.answers.ensemble import Ensemble, Plan, plan
from tpd.answers.run_table import follow_runs, forcing_of
from tpd.answers.statistics import Share, quantile_of
from tpd.compiled.rows import ground_row_of, row_of
from tpd.compiled.simulate import GroundForcing, HarmonicForcing
from tpd.core import checks
from tpd.core.formatting import Printed, aligned, number
from tpd.core.progress import Progress, bar_for
from tpd.engines.rigid_body import SLIDING, RigidBody, body_of, parameters_under
from tpd.engines.rollouts import Accelerations, EngineRuns, available, follow, free_rocking
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.parameters import Parameters
from tpd.scene.scene import Harmonic, Pendulum, Scene
from tpd.theory.equations import Terms

_MEANING = (
    "Rows in % are shares of the runs, the others quantiles. If a fifth of the time step changes nothing, "
    "differences from the equations are the effects of sliding and of the law of impacts."
)
RUNS = 64
"""Default number of runs."""
FINE = 16
"""Number of runs that are repeated with the finer time step."""
_FINER = 5
"""Divisor of the finer time step."""
_PERIODS = 100
"""Default number of forcing periods of a run."""
_LAST = 10
"""Number of periods at the end of a run whose largest tilt counts as settled."""
_FREE = 10.0
"""Duration of the free motion after a ground motion, s."""
MATCH = 0.01
"""Largest difference between the coefficients of restitution of two impacts that count as equal."""
_RESOLVED = 0.02
"""Smallest change of the mean tilt, in units of the tilt of static overturning, whose sign is reported."""


@dataclass(frozen=True, kw_only=True, repr=False)
class EngineVerdict(Printed):
    """Runs in an engine and with the equations (4), each with and without the pendulum.

    Attributes:
        engine: name and version of the engine.
        scene: block and excitation.
        pendulum: pendulum; None if the block has none.
        ensemble: number, seed and spreads of the runs.
        sliding: coefficient of friction against sliding.
        with_engine: runs in the engine, with and without the pendulum.
        finer: first of these runs with a fifth of the time step.
        with_equations: the same runs with the nonlinear model.
        restitution: coefficient of restitution of impacts in the engine.
        step: time step, s.
    """

    engine: str
    """Name and version of the engine."""
    scene: Scene
    """Block and excitation."""
    pendulum: Pendulum | None
    """Pendulum; None if the block has none."""
    ensemble: Ensemble
    """Number, seed and spreads of the runs."""
    sliding: float
    """Coefficient of friction of the corners against sliding."""
    with_engine: tuple[EngineRuns, EngineRuns]
    """Runs in the engine, with and without the pendulum."""
    finer: tuple[EngineRuns, EngineRuns]
    """The first of these runs with a fifth of the time step."""
    with_equations: tuple[EngineRuns, EngineRuns]
    """Runs with the nonlinear model and the losses of the scene, without sliding and
    bouncing."""
    restitution: float
    """Coefficient of restitution of impacts in the engine, measured with free rocking."""
    step: float
    """Time step, s."""

    @property
    def benefit(self) -> float:
        """Reduction of the mean tilt in the engine, in units of the tilt of static overturning.

        The tilt of a run is at most 1 in these units, and 1 if the block overturns.
        """
        return self._benefit(self.with_engine)

    @property
    def expected_benefit(self) -> float:
        """Reduction of the mean tilt with the equations (4), see `benefit`."""
        return self._benefit(self.with_equations)

    @property
    def disagrees(self) -> bool:
        """Whether the pendulum helps in the engine and harms with the equations, or the other way round."""
        ours, theirs = self.expected_benefit, self.benefit
        # The sign of a small change is not significant.
        return ours * theirs < 0.0 and min(abs(ours), abs(theirs)) > _RESOLVED

    @property
    def step_matters(self) -> bool:
        """Whether the sign of the benefit in the first runs depends on the time step."""
        # Only runs that both time steps have can be compared.
        few = tuple(runs.first(len(self.finer[0].tilt)) for runs in self.with_engine)
        coarse, fine = self._benefit(few), self._benefit(self.finer)
        return coarse * fine < 0.0 and min(abs(coarse), abs(fine)) > _RESOLVED

    @property
    def losses(self) -> str:
        """Sentences that compare the losses of the engine and the block."""
        # The engine has the friction of rocking of the block, but impacts of its own.
        e, friction = float(self.scene.block.velocity_ratio), float(self.scene.block.friction)
        engine = f"{self.restitution:.3f} in the engine (from free rocking)"
        text = f"Velocity ratio of an impact: {engine}, {e:.3f} for the block"
        if abs(e - self.restitution) > MATCH:
            text += ": the losses differ, because the engine has Housner's impacts"
        if friction > 0.0:
            text += ". The engine also has the friction of rocking of the block"
        return f"{text}."

    @property
    def warning(self) -> str:
        """Danger that must precede the results; empty if there is none."""
        # A disagreement is the more serious warning, so it comes first.
        if self.disagrees:
            changes = f"{-100.0 * self.benefit:+.1f} points in {self.engine}"
            expected = f"{-100.0 * self.expected_benefit:+.1f} points in the nonlinear model"
            disagree = "the models disagree. The pendulum changes the mean tilt by"
            return f"{disagree} {changes}, and by {expected}."
        if self.step_matters:
            return f"whether the pendulum helps in {self.engine} depends on its time step."
        return ""

    def table(self) -> str:
        """Return shares and quantiles of all runs as a table."""
        few = len(self.finer[0].tilt)
        rows = [["", self.engine, f"its first {few}", "a fifth of its step", "equations (4)"]]
        # Each row has the values of the engine, its first runs, the finer time step, and the equations.
        # Quantiles are comparable only for the same runs, hence the column of the first runs.
        first = tuple(runs.first(few) for runs in self.with_engine)
        groups = (self.with_engine, first, self.finer, self.with_equations)
        sizes = [("tilt", "median", "tilt", 0.5), ("tilt", "90 %", "tilt", 0.9)]
        if isinstance(self.scene.excitation, Harmonic):
            sizes.append(("settled", "median", "settled_tilt", 0.5))
        for i, case in enumerate((" with the pendulum", " without") if self.pendulum is not None else ("",)):
            runs_of = [group[i] for group in groups]
            rows.append([f"overturned{case}", *(f"{Share.of(r.overturned).value:.1%}" for r in runs_of)])
            for what, share, name, at in sizes:
                rows.append([f"{what}{case}: {share}, rad", *(_size(getattr(r, name), at) for r in runs_of)])
        # The equations include neither sliding nor flight, so their column is empty in these rows.
        bodies = [group[0] for group in groups[:3]]
        if self.pendulum is not None:
            rows.append(["rod to block: 90 %, rad", *(_size(r.rod_angle, 0.9) for r in bodies), "–"])
        rows.append(["slid: 90 %, mm", *(_size(1e3 * r.slid, 0.9) for r in bodies), "–"])
        rows.append(["left the floor", *(f"{np.mean(r.bounced):.1%}" for r in bodies), "–"])
        return "\n".join(aligned(rows))

    def __str__(self) -> str:
        e = self.ensemble
        head = (
            f"{e.size} paired runs, seed {e.seed}; time step {number(1e3 * self.step, 3)} ms, friction "
            f"coefficient {self.sliding:g} against sliding."
        )
        # A result that differs between engines must be read before any number.
        danger = [f"DANGER: {self.warning}"] if self.warning else []
        return "\n".join([*danger, head, self.losses, "", self.table(), _MEANING])

    def _benefit(self, pair: tuple[EngineRuns, ...]) -> float:
        # Infinite tilts of overturned runs count as 1, see `benefit`.
        toppling = math.atan(float(self.scene.block.slenderness))
        with_pendulum, without = (np.minimum(runs.tilt / toppling, 1.0).mean() for runs in pair)
        return float(without - with_pendulum)


def mujoco(
    scene: Scene,
    pendulum: Pendulum | None = None,
    *,
    runs: checks.Whole = RUNS,
    seed: checks.Whole = 0,
    periods: checks.Whole = _PERIODS,
    sliding: checks.Real = SLIDING,
    workers: checks.Whole | None = None,
    progress: Progress | bool | None = None,
) -> EngineVerdict:
    """Follow paired runs in MuJoCo, and the same runs with the nonlinear equations (4).

    Args:
        scene: block with any excitation.
        pendulum: pendulum of the block; None for the block without a pendulum.
        runs: number of runs. The first starts from rest and has no scatter.
        seed: seed of the ensemble.
        periods: length of a run under a harmonic, in forcing periods.
        sliding: coefficient of friction of the corners on the floor.
        workers: number of threads; all cores by default.
        progress: True for a progress bar on stderr, or a function that is called with (stage, number of
            finished runs, number of all runs).

    Raises:
        ValueError: bad input, MuJoCo is not installed, or the impacts in MuJoCo are not Housner's.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.instance("scene", scene, Scene)
    checks.optional("pendulum", pendulum, Pendulum)
    sliding = checks.positive("sliding", sliding)
    # Impacts in an engine are Housner's, so e does not scatter.
    ensemble = Ensemble(size=runs, seed=seed, periods=periods, restitution=0.0)
    version = available()
    with bar_for(progress) as report:
        case = _Case(scene, ensemble, sliding, workers, report)
        # An engine with other impacts than Housner's is rejected before the long runs.
        e = case.restitution()
        few = min(FINE, runs)
        coarse = _pair(pendulum, lambda pendulum: case.runs(pendulum, 1, runs))
        finer = _pair(pendulum, lambda pendulum: case.runs(pendulum, _FINER, few))
        equations = _pair(pendulum, case.equations)
    return EngineVerdict(
        engine=f"MuJoCo {version}",
        scene=scene,
        pendulum=pendulum,
        ensemble=ensemble,
        sliding=sliding,
        with_engine=coarse,
        finer=finer,
        with_equations=equations,
        restitution=e,
        step=case.bodies(None, 1)[0].step,
    )


def _pair(
    pendulum: Pendulum | None, runs_with: Callable[[Pendulum | None], EngineRuns]
) -> tuple[EngineRuns, EngineRuns]:
    """Return the runs with and without the pendulum. Without a pendulum both are the same."""
    without = runs_with(None)
    return (without if pendulum is None else runs_with(pendulum)), without


@dataclass(frozen=True)
class _Case:
    """Runs of an ensemble in SI units."""

    scene: Scene
    """Block and excitation."""
    ensemble: Ensemble
    """Number, seed and spreads of the runs."""
    sliding: float
    """Coefficient of friction against sliding."""
    workers: int | None
    """Number of threads; None for all cores."""
    report: Progress
    """Function that reports the progress."""

    def restitution(self) -> float:
        """Return the coefficient of restitution of the impacts in the engine.

        Raises:
            ValueError: the impacts are not Housner's.
        """
        # If the contact is too soft or too hard for the time step, the engine has impacts of another kind.
        # Friction of rocking would also reduce the energy between two impacts.
        body = replace(self.bodies(None, _FINER)[0], friction=0.0)
        e = free_rocking(body)
        if not abs(e - body.housner) <= MATCH:
            wanted, actual = f"{body.housner:.3f} of the velocity (Housner)", f"keeps {e:.3f}"
            raise ValueError(
                f"impacts of the engine must keep {wanted}, but a block that rocks freely {actual}"
            )
        return e

    def plan(self, pendulum: Pendulum | None) -> Plan:
        """Return initial states and parameters of all runs."""
        return plan(parameters_under(self.scene, pendulum), self.ensemble)

    def bodies(self, pendulum: Pendulum | None, steps: int) -> list[RigidBody]:
        """Return the bodies of all runs, including their scatter."""
        q, n = vars(self.plan(pendulum).p), self.ensemble.size
        # Parameters without scatter are repeated for all runs.
        columns = {name: np.broadcast_to(np.ravel(x), n) for name, x in q.items() if x is not None}
        runs = ({name: float(x[i]) for name, x in columns.items()} for i in range(n))
        return [body_of(self.scene, Parameters(**run), self.sliding, steps) for run in runs]

    def runs(self, pendulum: Pendulum | None, steps: int, few: int) -> EngineRuns:
        """Follow the first `few` runs in the engine."""
        runs, rate = self.plan(pendulum), float(self.scene.rate)
        # The engine has rates per second.
        y = runs.y0[:few] * [1.0, 1.0, rate, rate]
        _, shaking, duration, late = self._excitation(runs, few)
        case = "with the pendulum" if pendulum is not None else "without"
        stage = f"engine, {case}" + (", finer step" if steps > 1 else "")

        def count(share: float) -> None:
            self.report(stage, round(share * few), few)

        # The bodies of all runs are sampled before the first are selected, so that the first runs do not
        # depend on `few`.
        bodies = self.bodies(pendulum, steps)[:few]
        return follow(bodies, y, shaking, duration, late, workers=self.workers, progress=count)

    def equations(self, pendulum: Pendulum | None) -> EngineRuns:
        """Follow all runs with the nonlinear model."""
        runs, n = self.plan(pendulum), self.ensemble.size
        (x, forcing), *_ = self._excitation(runs, n)
        # A run without a result counts as overturned, because it must not look safe.
        table = follow_runs(Terms.nonlinear, x, forcing, y0=runs.y0).ended(True)
        # The equations have no sliding and no flight. Zeros fill these fields.
        none, bounced = np.zeros(n), np.zeros(n, dtype=bool)
        return EngineRuns(table.is_overturned, table.tilt, table.settled_tilt, none, none, bounced)

    def _excitation(
        self, runs: Plan, few: int
    ) -> tuple[tuple[np.ndarray, GroundForcing | HarmonicForcing], Accelerations, np.ndarray, np.ndarray]:
        """Return rows and forcing for the equations, and the base acceleration as a function of time for the
        engine with two times for each of its first `few` runs.

        The times are the duration of the run, and the time from which a tilt counts as settled, both in s
        from the beginning of the run.
        """
        rate, g = float(self.scene.rate), float(self.scene.gravity)
        f = np.broadcast_to(np.asarray(runs.p.f, dtype=float), self.ensemble.size)[:few, None] * g
        if isinstance(self.scene.excitation, GroundMotion):
            motion = self.scene.excitation
            # A ground motion has its own time scale. The scatter of the frequency applies to harmonics only.
            x = ground_row_of(runs.p, piece=float(motion.piece) * rate)
            forcing = forcing_of([motion], _FREE * rate)
            # The tilt of the equations is positive against the acceleration of the base.
            size = -f / (float(motion.pga))
            end = np.full(few, float(motion.duration) + _FREE)
            return (x, forcing), (lambda t: size * motion.acceleration_at(t)[None]), end, end
        w = np.broadcast_to(np.asarray(runs.p.xi, dtype=float), self.ensemble.size)[:few, None] * rate
        # Times in s, shape (runs, 1), so that they combine with the times of the steps.
        begin, grow = runs.begin[:few, None] / rate, runs.growth[:few, None] * 2.0 * np.pi / w

        def shaking(t: np.ndarray) -> np.ndarray:
            # As in the ensemble, the excitation grows from tau = 0, and not from the beginning of a run.
            since = begin + t[None]
            share = np.where(since < grow, since / np.where(grow > 0.0, grow, 1.0), 1.0)
            return f * share * np.sin(w * since)

        period = 2.0 * np.pi / w.ravel()
        end = self.ensemble.periods * period
        forcing = HarmonicForcing(self.ensemble.periods, runs.begin, runs.growth)
        return (row_of(runs.p), forcing), shaking, end, end - _LAST * period


def _size(values: np.ndarray, share: float) -> str:
    """Return a quantile as text. Overturned runs have an infinite tilt, larger than all others."""
    x = quantile_of(values, share)
    return "overturns" if math.isinf(x) else number(x, 3)
