"""Designs for tests of several folders: runs and problems made by hand, and small real designs, each of which
is made once in a session."""

import functools
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

import tpd
from tpd.answers.paired import PairedRuns
from tpd.answers.run_table import ANGLES, Runs
from tpd.design.design import Design
from tpd.design.problem import STATED, Problem, Words
from tpd.design.refine import refine
from tpd.scene.conditions import Conditions
from tpd.scene.ensemble import Ensemble
from tpd.scene.status import Status
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import AtRest

SCENE = tpd.paper_scene()
NU = float(SCENE.block.slenderness)
PENDULUM = tpd.Pendulum(mass=1.6224, length=0.12, damping_ratio=0.1)
RATIOS = (0.1, 0.6, 0.1)
SPACE = tpd.DesignSpace(mass_ratio=(0.01, 0.2), damping_ratio=(0.05, 0.4))
BLOCK = tpd.Block(width=0.9, height=5.4, mass=4000.0, restitution=0.93, cavity_width=0.7)
"""A block for ground motions: walls of 0.1 m and 2300 kg/m^3."""
SMALL = {
    "conditions": Conditions.band(SCENE, 2.2, 2.8, 2),
    "limits": tpd.limits.POINT_BOB,
    "requirements": tpd.limits.Requirements(at_least=0.05, wall_contacts=0.05),
    "method": tpd.Descent(searches=2, screening=32, steps=3, corrections=1, polish=10, model=tpd.Piecewise()),
    "ensemble": Ensemble(size=96, periods=30),
}
"""Settings of a search of a few seconds."""


def with_block(scene: tpd.Scene, **changes: Any) -> tpd.Scene:
    """Return the scene with other fields of its block."""
    return replace(scene, block=replace(scene.block, **changes))


def outcomes(tilt, swing=0.0, peak=1.0, equations: str = "nonlinear", design=RATIOS, seed: int = 0) -> Runs:
    """Runs of these settled tilts over nu: 0 is rest, infinity an overturning, NaN no answer; and of these
    bob angles in rad. The largest angles on the way are `peak` times the settled ones."""
    tilt = np.asarray(tilt, dtype=float)
    status = np.where(np.isinf(tilt), "overturned", np.where(tilt == 0.0, "rest", "rocking"))
    status = np.where(np.isnan(tilt), "failed", status)
    swing = np.where(np.isfinite(tilt), swing, tilt)
    sizes = tilt * NU, swing, tilt * NU + swing
    angles = (peak * size if largest else size for size in sizes for largest in (True, False))
    inputs = {
        "condition": 0.0,
        "growth": 0.0,
        "disturbed": False,
        "nu": NU,
        "mu": design[0],
        "lam": design[1],
        "impacts": np.nan,
    }
    return Runs(
        equations=Terms(equations),
        seed=seed,
        outcome=np.array([Status.__names__.index(name) for name in status]),
        **dict(zip(ANGLES, angles, strict=True)),
        **{name: np.full(len(tilt), x) for name, x in inputs.items()},
    )


def paired(with_pendulum, without, group=None, swing=0.0, design=RATIOS, **more) -> PairedRuns:
    """Paired runs of these settled tilts over nu."""
    group = np.zeros(len(with_pendulum), int) if group is None else np.asarray(group)
    labels = tuple(f"condition {i}" for i in range(int(group.max()) + 1))
    cases = outcomes(with_pendulum, swing, design=design), outcomes(without)
    return PairedRuns(with_pendulum=cases[0], without_pendulum=cases[1], group=group, labels=labels, **more)


@dataclass(frozen=True, kw_only=True, repr=False)
class NoisyProblem(Problem):
    """Trials of which the mean tilt over nu is 0.2 + |x - (.6, .5, .4)|^2 / 2 in shares x of the space, with
    a deviation of 0.02; the bob swings by 0.5 rad in the mean where mu is at half of its range. The tilt
    without a pendulum is 0.6. Most of the noise is common to all designs with the same seed."""

    attempts: ClassVar[int] = 3
    has_earthquakes: ClassVar[bool] = False
    usual_level: ClassVar = (0.3, "noise")  # type: ignore[misc]
    # A longest length below the shortest one is no rule of thumb.
    rule_sizes: ClassVar[tuple[float, float, float]] = 0.0, 1.0, 0.0  # type: ignore[misc]
    words: ClassVar = Words("noise", "noise", "noise", "any", "runs of any duration")  # type: ignore[misc]
    count: int = 64
    unanswered: float = 0.0
    """Share of the runs without a result."""
    calm: bool = False
    asked: list = None  # type: ignore[assignment]
    """Seeds of trial runs and of paired runs."""

    @staticmethod
    def of(**changes) -> "NoisyProblem":
        given = {
            "scene": SCENE,
            "space": SPACE,
            "conditions": Conditions(),
            "risk": tpd.Risk.expected(),
            "limits": (tpd.limits.Stroke(0.5),),
            "method": None,
            "ensemble": Ensemble(size=64, seed=0),
            "requirements": tpd.limits.Requirements(),
            "seed": 0,
            "asked": [],
        }
        return NoisyProblem(**(given | changes))

    def tilt(self, design) -> float:
        """Mean tilt over nu without noise."""
        return float(0.2 + 0.5 * np.sum((SPACE.scaled(np.asarray(design)) - [0.6, 0.5, 0.4]) ** 2))

    def isolation(self, level):
        return np.array([1.0]), 0.0

    @property
    def at_rest(self) -> AtRest:
        return AtRest.of(0.3, 0.0, 0.15 if self.calm else 0.6)

    def improver(self, guess, progress):
        spread = self.candidates()
        return refine(self, spread if guess is None else np.concatenate([guess[None], spread]), 32, progress)

    def candidates(self) -> np.ndarray:
        """Designs of the first trials."""
        return SPACE.unscaled(np.random.default_rng(self.seed).uniform(0.0, 1.0, (24, 3)))

    def validation_runs(self, design, seed, varied=STATED, progress=None):
        return self.runs(design, seed, varied.equations)

    def runs(self, design, seed, equations="linear") -> Runs:
        rng = np.random.default_rng(seed)
        if design is None:
            return outcomes(0.6 + 0.1 * rng.standard_normal(self.count), equations=equations, seed=seed)
        fine = np.random.default_rng([seed, *np.int64(1e9 * np.asarray(design))])
        noise = 0.14 * rng.standard_normal(self.count) + 0.08 * fine.standard_normal(self.count)
        tilt = np.clip(self.tilt(design) + noise, 0.01, 1.0)
        tilt = np.where(rng.random(self.count) < self.unanswered, np.nan, tilt)
        swing = 0.5 * np.exp(
            SPACE.scaled(np.asarray(design))[0] - 0.5 + 0.02 * rng.standard_normal(self.count)
        )
        return outcomes(tilt, swing, equations=equations, design=design, seed=seed)

    def trial_runs(self, design, seed, equations="linear"):
        self.asked.append((f"{equations} trial", seed))
        return self.runs(design, seed, equations)

    def paired_runs(self, design, seed, *more, **how):
        self.asked.append(("paired", seed))
        return super().paired_runs(design, seed, *more, **how)

    def _groups_of(self, runs):
        return {"group": np.zeros(self.count, int), "labels": ("all",)}

    @property
    def stated_motions(self):
        return []

    def strongest_motions(self, design):
        return []


def noise(seed: int, event: str | None = None, n: int = 300) -> tpd.Record:
    """A record of filtered noise under an envelope, its peak 1 m/s^2, of an earthquake of its own."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 0.02
    white = np.convolve(rng.standard_normal(n + 30), np.hanning(31), "valid")[:n]
    a = white * np.sin(np.pi * t / t[-1]) ** 2
    event = f"noise {seed}" if event is None else event
    return tpd.Record(a / np.max(np.abs(a)), 0.02, name=f"noise {seed}", event=event)


@functools.cache
def records(count: int = 20) -> tuple[tpd.Record, ...]:
    """Two records of each earthquake."""
    return tuple(noise(seed, f"event {seed // 2}") for seed in range(count))


GROUND = {
    "conditions": Conditions.records(records(60), (1.5, 2.5, 4.0)),
    "requirements": tpd.limits.Requirements(at_least=0.02, reduce="tilt"),
    "method": tpd.GroundSearch(designs=6, steps=3),
    "limits": (tpd.limits.Stroke(),),
}


@functools.cache
def harmonic_design(seed: int = 0) -> Design:
    """A recommended pendulum under harmonic excitation."""
    return tpd.optimise(SCENE, SPACE, seed=seed, **SMALL)


@functools.cache
def rejected_design() -> Design:
    """The same problem, but a benefit is required that no pendulum has."""
    requirements = tpd.limits.Requirements(at_least=0.97, reduce="tilt")
    return tpd.optimise(SCENE, SPACE, **(SMALL | {"requirements": requirements}))


@functools.cache
def ground_design(seed: int = 0) -> Design:
    """A pendulum that is tuned to fifteen earthquakes and validated on fifteen others."""
    return tpd.optimise(BLOCK, seed=seed, **GROUND)
