"""Table of runs, for ensembles, paired runs, fragility, spectra, critical scales and trial runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.statistics import Share, quantile_of
from tpd.compiled import simulate
from tpd.compiled.columns import LAM, MU, NU
from tpd.compiled.rows import ground_row_of
from tpd.compiled.simulate import GroundForcing, HarmonicForcing
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular, aligned
from tpd.scene.ground_motion import LONGEST_FREE, STANDARD_GRAVITY, GroundMotion
from tpd.scene.pytrees import single
from tpd.scene.scene import Block, Pendulum, Scene
from tpd.scene.status import SETTLED, UNANSWERED, Status, code_of, is_one_of, names_of
from tpd.theory.equations import Terms

Progress = Callable[[int, int], None]
"""Function that is called with (number of finished runs, number of all runs)."""
ANGLES = ("tilt", "settled_tilt", "swing", "settled_swing", "rod_angle", "settled_rod_angle")
"""Names of the angles of a run, which are fields of `Runs`."""
_QUANTILES = {
    "largest tilt, rad": "tilt",
    "settled tilt, rad": "settled_tilt",
    "bob's angle, rad": "swing",
}
UNANSWERED_ROW = "runs without a result"
"""Label of the number of runs without a result, in tables."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Runs(Printed, Tabular):
    """Runs of one block: NumPy arrays of the same shape.

    Angles are in rad. They are infinite in a run in which the block overturns, because their values would
    depend on the time at which the run was stopped. A run has no result if it reached the limit on events, or
    ended without finite numbers. All its results are NaN, and shares and quantiles do not count it. Without a
    pendulum the angles of the rod are those of a bob that is too light to act on the block.

    Attributes:
        equations: equations of the runs.
        seed: seed of the ensemble.
        condition: index of the condition, or of the ground motion.
        growth: number of periods over which the excitation grows.
        disturbed: whether the run begins with a disturbance, and not at rest.
        nu, mu, lam: slenderness, mass ratio and length ratio.
        tilt, settled_tilt: largest and settled |phi|.
        swing, settled_swing: largest and settled |psi|.
        rod_angle, settled_rod_angle: largest and settled angle between rod and block.
        impacts: number of impacts.
        outcome: number of the status.
        cluster: number of the earthquake.
    """

    equations: Terms
    """Equations of the runs: linear or nonlinear."""
    seed: int = 0
    """Seed of the ensemble."""
    condition: np.ndarray
    """Index of the condition, or of the ground motion, of each run."""
    growth: np.ndarray
    """Number of periods over which the excitation grows; 0 under a ground motion."""
    disturbed: np.ndarray
    """Whether each run begins with a disturbance, and not at rest."""
    nu: np.ndarray
    """Slenderness of the block in each run, including its scatter."""
    mu: np.ndarray
    """Mass ratio of the pendulum."""
    lam: np.ndarray
    """Length ratio."""
    tilt: np.ndarray
    """Largest |phi|, transient included."""
    settled_tilt: np.ndarray
    """Settled |phi|, or the largest of the last periods. Under a ground motion the largest of the run."""
    swing: np.ndarray
    """Largest |psi|, transient included."""
    settled_swing: np.ndarray
    """Settled |psi|, or the largest of the last periods. Under a ground motion the largest of the run."""
    rod_angle: np.ndarray
    """Largest angle between rod and block, |psi - phi|. Runs under a harmonic do not record this angle. Then
    it is the sum of the largest tilt and the largest swing, which is an upper bound."""
    settled_rod_angle: np.ndarray
    """Largest angle between rod and block of the settled motion, with the same bound under a harmonic."""
    impacts: np.ndarray
    """Number of impacts under a ground motion; NaN under a harmonic."""
    outcome: np.ndarray
    """Numbers of statuses, see `tpd.scene.status`. The status is not_settled if a run has not settled within
    its periods."""
    cluster: np.ndarray | None = None
    """Number of the earthquake of each run; None if all runs are independent."""

    @property
    def is_overturned(self) -> np.ndarray:
        """Whether the block overturns in each run."""
        return self.outcome == code_of(Status.overturned)

    @property
    def is_unanswered(self) -> np.ndarray:
        """Whether each run has no result."""
        return is_one_of(self.outcome, *UNANSWERED)

    @property
    def is_at_rest(self) -> np.ndarray:
        """Whether the block comes to rest for good in each run."""
        return self.outcome == code_of(Status.rest)

    @property
    def is_lifted(self) -> np.ndarray:
        """Whether the block certainly leaves its base in each run. The runs must begin at rest."""
        return self.tilt > 0.0

    @property
    def stands(self) -> np.ndarray:
        """Whether the block certainly does not overturn in each run."""
        return ~(self.is_overturned | self.is_unanswered)

    @property
    def severity(self) -> np.ndarray:
        """Settled tilt divided by the slenderness, from 0 to 1.

        It is 1 if the block overturns, and NaN without a result.
        """
        # The upper bound of 1 keeps means finite. An overturned block counts as much as one on its corner.
        return np.where(self.is_unanswered, np.nan, np.fmin(self.settled_tilt / self.nu, 1.0))

    @property
    def share_overturned(self) -> Share:
        """Share of the runs in which the block overturns."""
        return self._share(self.is_overturned)

    @property
    def share_at_rest(self) -> Share:
        """Share of the runs in which the block comes to rest for good."""
        return self._share(self.is_at_rest)

    @property
    def share_settled(self) -> Share:
        """Share of the runs that reach a periodic motion, or rest."""
        return self._share(is_one_of(self.outcome, *SETTLED))

    def _share(self, hits: np.ndarray) -> Share:
        answered = ~self.is_unanswered
        return Share.of(hits[answered], None if self.cluster is None else self.cluster[answered])

    @property
    def starts(self) -> dict[str, np.ndarray]:
        """Whether each run has a kind of start, by the label of the kind: from rest by the growth of the
        excitation, then after a disturbance."""
        at_rest = ~self.disturbed
        kinds = {label_of_growth(x): at_rest & (self.growth == x) for x in np.unique(self.growth[at_rest])}
        return kinds | ({DISTURBED: self.disturbed} if self.disturbed.any() else {})

    def share_by_start(self) -> dict[str, Share]:
        """Return the share of overturned runs for each kind of start."""
        return {label: self.of(rows).share_overturned for label, rows in self.starts.items()}

    def quantiles(self, angle: str, at: tuple[float, ...] = (0.5, 0.9, 0.99)) -> tuple[float, ...]:
        """Return quantiles of one of the angles of `tpd.answers.run_table.ANGLES`.

        A quantile is the smallest value that at least the share `at` of the runs does not exceed. It is
        infinite if so many runs can only be reached with runs that overturn.
        """
        # Overturned runs have infinite angles, so that they come last in the order.
        values = getattr(self, angle)[~self.is_unanswered]
        return tuple(quantile_of(values, checks.within("at", q, 0.0, 1.0)) for q in at)

    def ended(self, overturns: bool) -> Runs:
        """Return the runs with an outcome for each run without a result: overturned, or at rest."""
        size, status = (math.inf, Status.overturned) if overturns else (0.0, Status.rest)
        # Angles, and with them the severity, follow from the outcome. Answered runs keep their values.
        ends = dict.fromkeys(ANGLES, size) | {"outcome": code_of(status)}
        return replace(
            self, **{name: np.where(self.is_unanswered, x, getattr(self, name)) for name, x in ends.items()}
        )

    @property
    def _arrays(self) -> dict[str, np.ndarray]:
        # Equations and seed are common to all runs, and not every table has earthquakes.
        return {name: x for name, x in vars(self).items() if isinstance(x, np.ndarray)}

    def reshape(self, *shape: int) -> Runs:
        """Return the runs as arrays of another shape."""
        return replace(self, **{name: x.reshape(shape) for name, x in self._arrays.items()})

    def of(self, rows: np.ndarray | slice) -> Runs:
        """Return some of the runs, by their indices or by whether each belongs to them."""
        return replace(self, **{name: x[rows] for name, x in self._arrays.items()})

    def columns(self) -> dict[str, Any]:
        """Columns of a table with a row for each run: its inputs, its results and the name of its outcome."""
        table = {name: x.ravel() for name, x in self._arrays.items()}
        return table | {"outcome": names_of(table["outcome"])}

    def summary(self) -> dict[str, Any]:
        """Return equations, shares with their intervals, and quantiles, for JSON."""
        shares = {n: tuple(getattr(self, f"share_{n}")) for n in ("overturned", "at_rest", "settled")}
        return {
            "equations": self.equations.value,
            "undecided": int(self.is_unanswered.sum()),
            "shares": shares,
            "quantiles_50_90_99": {angle: self.quantiles(angle) for angle in ANGLES[:4]},
        }

    def rows(self, *, has_bob: bool = True) -> list[tuple[str, str]]:
        """Return the rows of a table: a label, and a share or quantiles as text.

        Without a pendulum the angle of the bob has no meaning, and its text is empty.
        """
        out = [("overturned", str(self.share_overturned))]
        # Ground motions have a single kind of start.
        if len(self.starts) > 1:
            out += [(f"  {kind}", f"{100.0 * x.value:.1f} %") for kind, x in self.share_by_start().items()]
        # The report shows the same rows.
        out.append(("at rest in the end", str(self.share_at_rest)))
        for name, angle in _QUANTILES.items():
            values = self.quantiles(angle) if has_bob or angle != "swing" else ()
            sizes = (
                f"{v:.4f}" if math.isfinite(v) else "unknown" if math.isnan(v) else "overturns"
                for v in values
            )
            out.append((f"{name}: 50, 90, 99 %", "  ".join(sizes)))
        return out

    def __str__(self) -> str:
        head = f"{self.outcome.size} runs of the {self.equations.value} model, seed {self.seed}"
        rows = self.rows()
        if self.is_unanswered.any():
            rows.append((UNANSWERED_ROW, str(self.is_unanswered.sum())))
        return "\n".join([head, *(f"  {line}" for line in aligned(rows))])


class Cases(Tabular):
    """Base class of results without a pendulum and, if there is a pendulum, with it."""

    cases: Any
    """Results of the cases. The first is the case without the pendulum."""

    @property
    def without_pendulum(self) -> Any:
        """Result without the pendulum."""
        return self.cases[0]

    @property
    def with_pendulum(self) -> Any:
        """Result with the pendulum; None if there is no pendulum."""
        return self.cases[1] if len(self.cases) > 1 else None


CASE_KEYS = ("without_pendulum", "with_pendulum")
"""Keys of the cases in tables and files."""


def cases_of(pendulum: Pendulum | None) -> tuple[Pendulum | None, ...]:
    """Return the cases of a comparison: None, which is the block without a pendulum, and the pendulum."""
    return (None,) if pendulum is None else (None, pendulum)


DISTURBED = "after a disturbance"
"""Label of the runs that do not begin at rest."""


def label_of_growth(periods: float) -> str:
    """Return a label for the runs from rest in which the excitation grows over some periods."""
    return "sudden start from rest" if periods == 0.0 else f"growth over {periods:g} periods"


def follow_runs(
    equations: Terms,
    rows: np.ndarray,
    forcing: HarmonicForcing | GroundForcing,
    *,
    y0: np.ndarray | None = None,
    events: int | None = None,
    rtol: checks.Real = 1e-8,
    brief: bool = False,
    condition: Any = 0,
    growth: Any = 0.0,
    disturbed: Any = False,
    seed: int = 0,
    workers: checks.Whole | None = None,
    progress: Progress | None = None,
) -> Runs:
    """Follow runs in threads.

    Args:
        equations, rows, forcing, y0, events, rtol, brief: see `tpd.compiled.simulate.follow`; of n runs.
        condition, growth, disturbed, seed: inputs of the runs that are only recorded in the table.
        workers: number of threads; all cores by default.
        progress: function that is called with (number of finished runs, number of all runs).
    """
    checks.function("progress", progress)
    settings: dict[str, Any] = {"y0": y0, "workers": workers, "progress": progress, "rtol": rtol}
    run = simulate.follow(equations, rows, forcing, events=events, brief=brief, **settings)
    outcome = code_of(run.status)
    unanswered = is_one_of(outcome, *UNANSWERED)
    # Overturned runs have infinite angles. Runs without a result have NaN, see `Runs`.
    numbers = {n: np.where(unanswered, np.nan, getattr(run, n)) for n in (*ANGLES, "impacts")}
    recorded = {"condition": condition, "growth": growth, "disturbed": disturbed}
    inputs = {name: np.broadcast_to(x, len(rows)) for name, x in recorded.items()}
    # Slenderness and pendulum may scatter, so that the table records them for each run.
    design = {"nu": rows[:, NU], "mu": rows[:, MU], "lam": rows[:, LAM], "outcome": outcome.astype(np.int8)}
    return Runs(equations=equations, seed=seed, **inputs, **design, **numbers)


def forcing_of(motions: Sequence[GroundMotion], free: Any, which: Any = 0) -> GroundForcing:
    """Return ground motions in the form of compiled code, see `GroundForcing`."""
    return GroundForcing([np.asarray(m.pieces(), dtype=float) for m in motions], free, which)


def follow_scaled(
    block: Block,
    pendulums: Sequence[Pendulum | None],
    motions: Sequence[GroundMotion],
    factors: np.ndarray,
    *,
    gravity: float = STANDARD_GRAVITY,
    free: float,
    equations: Terms = Terms.linear,
    brief: bool = False,
    **options: Any,
) -> Runs:
    """Follow a block with each pendulum, from rest, under every motion multiplied by each of its factors.

    Args:
        block: block with its friction and restitution.
        pendulums: pendulums; None for the block without a pendulum.
        motions: pulses or records.
        factors: factors on the motions, shape (motions, ...), at least 0.
        gravity: acceleration of gravity, m/s^2.
        free: duration of the free motion after each ground motion, s.
        equations: linear or nonlinear.
        brief: whether only the tilt, the uplift, the impacts before an overturning and the outcome are
            needed.
        options: `workers` and `progress`, see `follow_runs`.

    Returns:
        Runs of the shape (pendulums, motions, ...).

    Raises:
        ValueError: a shape that does not fit, or a number out of range.
    """
    if len(factors) != len(motions) or not len(motions):
        expected = f"a row for each of {len(motions)} motions"
        raise ValueError(f"`factors` must have {expected}, but has {factors.shape}")
    checks.not_negative("factors", factors, every=True)
    free = checks.within("free", free, 0.0, LONGEST_FREE, " s")
    # The runs of one record are neighbours, so that its samples stay in the cache of the processor.
    which = np.tile(np.repeat(np.arange(len(motions)), factors[0].size), len(pendulums))
    scenes = [Scene(block, motion, gravity) for motion in motions]
    # With NumPy numbers JAX compiles no program.
    rows = [
        ground_row_of(single(scene.ground_parameters(pendulum)), size=sizes.ravel())
        for pendulum in pendulums
        for scene, sizes in zip(scenes, factors, strict=True)
    ]
    # Compiled code has dimensionless times, hence the rate of the block.
    forcing = forcing_of(motions, free * single(scenes[0].rate), which)
    table = follow_runs(equations, np.concatenate(rows), forcing, brief=brief, condition=which, **options)
    return table.reshape(len(pendulums), *factors.shape)
