"""Paired ensemble of a design in an engine, beside that of the equations (4) on the same runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.ensemble import Ensemble, Plan, plan
from tpd.answers.runs import follow_runs
from tpd.answers.statistics import Share
from tpd.core import checks
from tpd.core.formatting import Printed, aligned, number
from tpd.core.progress import Progress, shown
from tpd.engines.rigid_body import SLIDING, RigidBody, body_of, parameters_under
from tpd.engines.rollouts import EngineRuns, available, follow, free_rocking
from tpd.exact.rows import row_of
from tpd.exact.runs import GroundForcing, HarmonicForcing
from tpd.scene.ground_motion import GroundMotion
from tpd.scene.parameters import Parameters
from tpd.scene.scene import Harmonic, Pendulum, Scene
from tpd.theory.equations import Terms

_MEANING = (
    "Rows in % are shares of the runs, the others quantiles over them; where a fifth of the step changes "
    "nothing, a difference from the equations is the effect of sliding and of the law of impacts."
)
RUNS = 64
FINE = 16
"""Runs that are repeated with the finer time step."""
_FINER = 5
"""Divisor of the finer time step."""
_PERIODS = 100
_LAST = 10
"""Periods at the end of a run whose largest tilt counts as settled."""
_FREE = 10.0
"""Free motion after a ground motion, s."""
MATCH = 0.01
"""Difference of a velocity ratio up to which two impacts are the same."""
_SURE = 0.02
"""Change of the mean tilt (in units of that of toppling) below which nothing is said about its sign."""


@dataclass(frozen=True, kw_only=True, repr=False)
class EngineVerdict(Printed):
    """Runs of an engine and of the equations (4), each with the pendulum and without."""

    engine: str
    scene: Scene
    pendulum: Pendulum | None
    ensemble: Ensemble
    sliding: float
    with_engine: tuple[EngineRuns, EngineRuns]
    """With the pendulum and without."""
    finer: tuple[EngineRuns, EngineRuns]
    """The first of the same runs with a fifth of the time step."""
    with_equations: tuple[EngineRuns, EngineRuns]
    """The nonlinear equations with the losses of the scene. Sliding and bouncing are none."""
    restitution: float
    """Velocity ratio measured by free rocking in the engine."""
    step: float
    """Time step, s."""

    @property
    def benefit(self) -> float:
        """Decrease of the mean tilt over that of toppling, an overturning as 1, in the engine."""
        return self._benefit(self.with_engine)

    @property
    def expected_benefit(self) -> float:
        """Decrease of the mean tilt by the equations (4); see `benefit`."""
        return self._benefit(self.with_equations)

    @property
    def disagrees(self) -> bool:
        """Whether the pendulum helps by one of the two and harms by the other."""
        ours, theirs = self.expected_benefit, self.benefit
        # Near zero either sign is luck.
        return ours * theirs < 0.0 and min(abs(ours), abs(theirs)) > _SURE

    @property
    def step_matters(self) -> bool:
        """Whether the verdict of the first runs depends on the time step."""
        # Only the same runs can be compared.
        few = tuple(runs.first(len(self.finer[0].peak)) for runs in self.with_engine)
        coarse, fine = self._benefit(few), self._benefit(self.finer)
        return coarse * fine < 0.0 and min(abs(coarse), abs(fine)) > _SURE

    @property
    def losses(self) -> str:
        """Sentence on the losses of both."""
        without: Any = parameters_under(self.scene, None)
        e = float(without.velocity_ratio)
        # The engine rocks the scene's block, so that its own friction stays.
        block: Any = self.scene.block
        friction = float(block.friction)
        said = f"Velocity ratio of an impact: {self.restitution:.3f} in the engine by free rocking"
        if abs(e - self.restitution) <= MATCH:
            said += f", {e:.3f} of the block."
        else:
            said += f" (Housner's), but {e:.3f} of the block: the losses are not the same."
        if friction > 0.0:
            said += " The block's friction of rocking comes on top of the engine's impacts."
        return said

    @property
    def warning(self) -> str:
        """Sentence that comes before an answer; empty where there is nothing to warn of."""
        if self.disagrees:
            word = "harms" if self.benefit < 0.0 else "helps"
            return (
                f"DANGER: by {self.engine} the pendulum {word} (mean tilt {-self.benefit:+.3f} of toppling), "
                f"by the equations (4) it does the opposite ({-self.expected_benefit:+.3f})."
            )
        if self.step_matters:
            return f"DANGER: whether the pendulum helps in {self.engine} depends on its time step."
        return ""

    def table(self) -> str:
        """Shares and sizes as text."""
        few = len(self.finer[0].peak)
        head = ["", self.engine, f"its first {few}", "a fifth of its step", "equations (4)"]
        return "\n".join(aligned([head, *self._rows(few)]))

    def __str__(self) -> str:
        e = self.ensemble
        head = (
            f"{e.size} paired runs, seed {e.seed}; time step {number(1e3 * self.step, 3)} ms, friction of "
            f"sliding {self.sliding:g}."
        )
        lines = [*([self.warning] if self.warning else []), head, self.losses, "", self.table(), _MEANING]
        return "\n".join(lines)

    def _rows(self, few: int) -> list[list[str]]:
        first = tuple(runs.first(few) for runs in self.with_engine)
        groups, rows = (self.with_engine, first, self.finer, self.with_equations), []
        sizes = [("tilt", "median", "peak", 0.5), ("tilt", "90 %", "peak", 0.9)]
        if isinstance(self.scene.motion, Harmonic):
            sizes.append(("settled", "median", "settled", 0.5))
        for i, who in enumerate((" with the pendulum", " without") if self.pendulum is not None else ("",)):
            of = [group[i] for group in groups]
            rows.append([f"overturned{who}", *(f"{Share.of(r.overturned).value:.1%}" for r in of)])
            for what, share, name, at in sizes:
                rows.append([f"{what}{who}: {share}, rad", *(_size(getattr(r, name), at) for r in of)])
        # The equations know neither slip nor flight.
        bodies = [group[0] for group in groups[:3]]
        if self.pendulum is not None:
            rows.append(["rod to block: 90 %, rad", *(_size(r.relative, 0.9) for r in bodies), "–"])
        rows.append(["slid: 90 %, mm", *(_size(1e3 * r.slid, 0.9) for r in bodies), "–"])
        rows.append(["left the floor", *(f"{np.mean(r.bounced):.1%}" for r in bodies), "–"])
        return rows

    def _benefit(self, pair: tuple[EngineRuns, ...]) -> float:
        topples = math.atan(float(self.scene.block.slenderness))
        with_it, without = (np.minimum(runs.peak / topples, 1.0).mean() for runs in pair)
        return float(without - with_it)


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
    """Follow the paired runs of a verdict in MuJoCo, and by the nonlinear equations (4).

    Args:
        scene: of any motion.
        pendulum: None is the bare block alone.
        runs: in the ensemble; its first is from rest, without scatter.
        seed: of the ensemble.
        periods: length of a run under a harmonic.
        sliding: coefficient of friction of the corners on the floor.
        workers: threads; default the number of cores.
        progress: True for a bar on stderr, or called with (stage, done, of how many).

    Raises:
        ValueError: bad input, MuJoCo is not installed, or its impacts are not Housner's.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.instance("scene", scene, Scene)
    checks.optional("pendulum", pendulum, Pendulum)
    sliding = checks.positive("sliding", sliding)
    # Impacts of an engine are Housner's, whatever e scatters to.
    ensemble = Ensemble(size=runs, seed=seed, periods=periods, restitution=0.0)
    version = available()
    with shown(progress) as report:
        case = _Case(scene, ensemble, sliding, workers, report)
        e = case.restitution()
        few = min(FINE, runs)
        coarse = _pair(pendulum, lambda with_it: case.runs(with_it, 1, runs))
        finer = _pair(pendulum, lambda with_it: case.runs(with_it, _FINER, few))
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
    """Runs with the pendulum and without."""
    without = runs_with(None)
    return (without if pendulum is None else runs_with(pendulum)), without


@dataclass(frozen=True)
class _Case:
    """Runs of an ensemble in SI units."""

    scene: Scene
    ensemble: Ensemble
    sliding: float
    workers: int | None
    report: Progress

    def restitution(self) -> float:
        """Velocity ratio of the engine's impacts.

        Raises:
            ValueError: they are not Housner's.
        """
        # An engine whose contact is too soft or too hard for its step has impacts of its own making.
        body = replace(self.bodies(None, _FINER)[0], friction=0.0)
        e = free_rocking(body)
        if not abs(e - body.housner) <= MATCH:
            raise ValueError(
                f"impacts of the engine must keep {body.housner:.3f} of the velocity (Housner), but a block "
                f"that rocks freely keeps {e:.3f}"
            )
        return e

    def plan(self, pendulum: Pendulum | None) -> Plan:
        """Starts and parameters of every run."""
        return plan(parameters_under(self.scene, pendulum), self.ensemble, float(self.scene.rate))

    def bodies(self, pendulum: Pendulum | None, steps: int) -> list[RigidBody]:
        """Bodies of every run, as scattered."""
        q, n = vars(self.plan(pendulum).p), self.ensemble.size
        columns = {name: np.broadcast_to(np.ravel(x), n) for name, x in q.items() if x is not None}
        runs = ({name: float(x[i]) for name, x in columns.items()} for i in range(n))
        return [body_of(self.scene, Parameters(**run), self.sliding, steps) for run in runs]

    def runs(self, pendulum: Pendulum | None, steps: int, few: int) -> EngineRuns:
        """The first runs in the engine."""
        runs, rate = self.plan(pendulum), float(self.scene.rate)
        y = runs.y0[:few] * [1.0, 1.0, rate, rate]
        shaking, duration, late = self._shaking(runs, few)
        what = "with the pendulum" if pendulum is not None else "without"
        stage = f"engine, {what}" + (", finer step" if steps > 1 else "")

        def count(share: float) -> None:
            self.report(stage, round(share * few), few)

        # All runs are planned, also where few are followed: these are the same runs then.
        bodies = self.bodies(pendulum, steps)[:few]
        return follow(bodies, y, shaking, duration, late, workers=self.workers, progress=count)

    def equations(self, pendulum: Pendulum | None) -> EngineRuns:
        """All runs by the nonlinear equations."""
        runs, n = self.plan(pendulum), self.ensemble.size
        if isinstance(self.scene.motion, GroundMotion):
            # The time scale of a ground motion is its own: the scatter of a frequency is for harmonics.
            h = np.full(n, float(self.scene.motion.piece) * float(self.scene.rate))
            x = row_of(runs.p, piece=h)
            pieces = [np.asarray(self.scene.motion.pieces(), dtype=float)]
            forcing = GroundForcing(pieces, _FREE * float(self.scene.rate))
        else:
            x, forcing = row_of(runs.p), HarmonicForcing(self.ensemble.periods, runs.begin, runs.periods)
        # What is not known must not look like standing.
        found = follow_runs(Terms.nonlinear, x, forcing, y0=runs.y0).ended(True)
        none, bounced = np.zeros(n), np.zeros(n, dtype=bool)
        return EngineRuns(found.is_overturned, found.tilt, found.settled_tilt, none, none, bounced)

    def _shaking(
        self, runs: Plan, few: int
    ) -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray, np.ndarray]:
        """Accelerations at times from the start of the runs, durations, and times from which a tilt counts as
        settled."""
        rate, g = float(self.scene.rate), float(self.scene.gravity)
        f = np.broadcast_to(np.asarray(runs.p.f, dtype=float), self.ensemble.size)[:few, None] * g
        if isinstance(self.scene.motion, GroundMotion):
            one = self.scene.motion
            # The equations turn a tilt against the base's acceleration.
            size = -f / (float(one.pga))
            end = np.full(few, float(one.duration) + _FREE)
            return (lambda t: size * one.acceleration_at(t)[None]), end, end
        w = np.broadcast_to(np.asarray(runs.p.xi, dtype=float), self.ensemble.size)[:few, None] * rate
        begin, grow = runs.begin[:few, None] / rate, runs.periods[:few, None] * 2.0 * np.pi / w

        def shaking(t: np.ndarray) -> np.ndarray:
            # Growth counts from tau = 0, as in the ensemble, and not from the start of a run.
            since = begin + t[None]
            share = np.where(since < grow, since / np.where(grow > 0.0, grow, 1.0), 1.0)
            return f * share * np.sin(w * since)

        period = 2.0 * np.pi / w[:, 0]
        end = self.ensemble.periods * period
        return shaking, end, end - _LAST * period


def _size(values: np.ndarray, share: float) -> str:
    """Quantile as text; a run that overturned is beyond all others."""
    ordered = np.sort(values)
    x = float(ordered[min(len(ordered) - 1, math.ceil(share * len(ordered)) - 1)])
    return "lost" if math.isinf(x) else number(x, 3)
