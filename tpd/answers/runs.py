"""Table of runs. Ensembles, paired runs, fragility, spectra, critical scales and trial runs use it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tpd.answers.statistics import Share
from tpd.cluster.cluster import Cluster, check_where
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular
from tpd.exact import runs
from tpd.exact.rows import ground_row_of
from tpd.exact.runs import GroundForcing, HarmonicForcing, Settled
from tpd.exact.terms import LAM, MU, NU, SHAKEN, F
from tpd.scene.ground_motion import LONGEST_FREE, STANDARD_GRAVITY, GroundMotion
from tpd.scene.pytrees import single
from tpd.scene.scene import Block, Pendulum, Scene
from tpd.scene.status import SETTLED, UNANSWERED, Status, code_of, codes_of, is_one_of, names_of
from tpd.theory.equations import Terms

Progress = Callable[[int, int], None]
ANGLES = ("tilt", "settled_tilt", "swing", "settled_swing", "rod_angle", "settled_rod_angle")
"""Names of the angles of a run."""
_QUANTILES = {
    "largest tilt, rad": "tilt",
    "settled tilt, rad": "settled_tilt",
    "bob's angle, rad": "swing",
}
_KEYS = {"peak": "tilt", "amplitude": "settled_tilt", "peak_swing": "swing", "swing": "settled_swing"}
"""Angles by their keys in JSON."""
UNANSWERED_ROW = "runs without an answer"
_SHAKEN = codes_of(SHAKEN)
"""Numbers of outcomes by those of compiled code under ground motions."""
_CHUNKS = {Terms.linear: 2048, Terms.nonlinear: 128}
"""Runs under a harmonic in a chunk for a cluster: some tenths of a second of work."""
_PIECES = 1 << 21
"""Pieces of ground motion in such a chunk."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Runs(Printed, Tabular):
    """Runs of one block: NumPy arrays of one shape.

    Angles are in rad. They are infinite in a run in which the block overturns, because their sizes at that
    moment depend on when the run was stopped. All results are NaN in a run without an answer, which reached
    the bound on events or ended without finite numbers. Shares and quantiles count the runs with an answer.
    Without a pendulum the angles of the rod are those of a bob too light to act on the block.
    """

    equations: Terms
    seed: int = 0
    condition: np.ndarray
    """Index of the condition or of the ground motion of every run."""
    ramp: np.ndarray
    """Seconds (or units of tau) over which the excitation grows."""
    nu: np.ndarray
    """Slenderness of the block in every run, as it scatters."""
    mu: np.ndarray
    """Mass ratio of the pendulum."""
    lam: np.ndarray
    """Length ratio."""
    tilt: np.ndarray
    """Largest |phi| from the initial state on."""
    settled_tilt: np.ndarray
    """Settled |phi|, or the largest of the last periods; under a ground motion the largest of the run."""
    swing: np.ndarray
    """Largest |psi| from the initial state on."""
    settled_swing: np.ndarray
    """Settled |psi|, or the largest of the last periods; under a ground motion the largest of the run."""
    rod_angle: np.ndarray
    """Largest angle between rod and block, |psi - phi|. Under a harmonic, of which runs do not record it, the
    sum of the largest tilt and the largest swing, which is never less."""
    settled_rod_angle: np.ndarray
    """Largest angle between rod and block of the settled motion, recorded as `rod_angle` is."""
    impacts: np.ndarray
    """Number of impacts under a ground motion; NaN under a harmonic."""
    outcome: np.ndarray
    """Numbers of statuses, see `tpd.scene.status`. A run that has not settled within its periods is
    not_settled."""

    @property
    def is_overturned(self) -> np.ndarray:
        """Whether the block overturns in a run."""
        return self.outcome == code_of(Status.overturned)

    @property
    def is_unanswered(self) -> np.ndarray:
        """Whether a run has no answer."""
        return is_one_of(self.outcome, *UNANSWERED)

    @property
    def is_at_rest(self) -> np.ndarray:
        """Whether the block comes to rest for good in a run."""
        return self.outcome == code_of(Status.rest)

    @property
    def is_lifted(self) -> np.ndarray:
        """Whether the block is known to leave its base in a run that begins at rest."""
        return self.tilt > 0.0

    @property
    def stands(self) -> np.ndarray:
        """Whether the block is known not to overturn in a run."""
        return ~(self.is_overturned | self.is_unanswered)

    @property
    def severity(self) -> np.ndarray:
        """Settled tilt over the slenderness, from 0 to 1; 1 where the block overturns, NaN where a run has no
        answer."""
        # A bound at 1 keeps means finite: an overturned block is as bad as one on its corner, and no worse.
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
        return Share.of(hits[~self.is_unanswered])

    def share_by_ramp(self) -> dict[float, Share]:
        """Share overturned for each duration over which the excitation grows."""
        known = ~self.is_unanswered
        return {
            float(r): Share.of(self.is_overturned[known & (self.ramp == r)]) for r in np.unique(self.ramp)
        }

    def quantiles(self, angle: str, at: tuple[float, ...] = (0.5, 0.9, 0.99)) -> tuple[float, ...]:
        """Quantiles of one of `ANGLES`: the least number that at least such a share of the runs does not
        exceed, infinite if that needs runs that overturn."""
        # Runs that overturn have infinite angles, so that quantiles of all runs are defined.
        values = np.sort(getattr(self, angle)[~self.is_unanswered])
        if not len(values):
            return (math.nan,) * len(at)
        return tuple(float(values[min(len(values) - 1, math.ceil(q * len(values)) - 1)]) for q in at)

    def ended(self, overturns: bool) -> Runs:
        """The runs with an end for each that has no answer: an overturning, or rest."""
        size, status = (math.inf, Status.overturned) if overturns else (0.0, Status.rest)
        ends = dict.fromkeys(ANGLES, size) | {"outcome": code_of(status)}
        return replace(
            self, **{name: np.where(self.is_unanswered, x, getattr(self, name)) for name, x in ends.items()}
        )

    def reshape(self, *shape: int) -> Runs:
        """The runs as arrays of another shape."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("equations", "seed")}
        return replace(self, **{name: x.reshape(shape) for name, x in arrays.items()})

    def columns(self) -> dict[str, Any]:
        """A row for every run: its inputs, and its results with the name of its outcome."""
        table = {name: x.ravel() for name, x in vars(self).items() if name not in ("equations", "seed")}
        return table | {"outcome": names_of(table["outcome"])}

    def summary(self) -> dict[str, Any]:
        """Equations, shares with their intervals, and quantiles, for JSON."""
        shares = {n: tuple(getattr(self, f"share_{n}")) for n in ("overturned", "at_rest", "settled")}
        return {
            "equations": self.equations.value,
            "undecided": int(self.is_unanswered.sum()),
            "shares": shares,
            "quantiles_50_90_99": {key: self.quantiles(angle) for key, angle in _KEYS.items()},
        }

    def rows(self) -> list[tuple[str, str]]:
        """Lines of a table: a name, and a share or quantiles as text."""
        out = [("overturned", str(self.share_overturned))]
        out += [(f"  {label_of_ramp(r)}", f"{x.value:.1%}") for r, x in self.share_by_ramp().items()]
        out.append(("at rest in the end", str(self.share_at_rest)))
        for name, angle in _QUANTILES.items():
            sizes = (
                f"{v:.4f}".replace("nan", "unknown").replace("inf", "lost") for v in self.quantiles(angle)
            )
            out.append((f"{name}: 50, 90, 99 %", "  ".join(sizes)))
        return out

    def __str__(self) -> str:
        head = f"{self.outcome.size} runs of the {self.equations.value} equations, seed {self.seed}"
        lines = [head, *(f"  {name:36}{text:>26}" for name, text in self.rows())]
        if self.is_unanswered.any():
            lines.append(f"  {UNANSWERED_ROW:36}{self.is_unanswered.sum():>26}")
        return "\n".join(lines)


class Cases(Tabular):
    """Base of results without a pendulum and, if there is one, with it."""

    cases: Any
    """Results without the pendulum first."""

    @property
    def without_pendulum(self) -> Any:
        """Result without the pendulum."""
        return self.cases[0]

    @property
    def with_pendulum(self) -> Any:
        """Result with the pendulum; None if there is none."""
        return self.cases[1] if len(self.cases) > 1 else None


CASE_KEYS = ("without_pendulum", "with_pendulum")
"""Keys of the cases in tables and files."""


def label_of_ramp(ramp: float) -> str:
    """Name the duration in seconds over which the excitation grows."""
    return "sudden starts" if ramp == 0.0 else f"starts over {ramp:g} s"


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
    ramp: Any = 0.0,
    seed: int = 0,
    workers: checks.Whole | None = None,
    cluster: Cluster | None = None,
    progress: Progress | None = None,
) -> Runs:
    """Follow runs in threads, or on a cluster.

    Args:
        equations, rows, forcing, y0, events, rtol, brief: as in `tpd.exact.runs.follow`, of runs (n,).
        condition, ramp, seed: inputs of the runs, which only stand in the table.
        workers: threads; all cores by default.
        cluster: processes or machines in place of threads.
        progress: called with (runs done, of how many).
    """
    check_where(workers, cluster, progress)
    n, ground = len(rows), isinstance(forcing, GroundForcing)
    own = {name: getattr(forcing, name) for name in (("free", "which") if ground else ("begin", "ramp"))}
    # What differs from run to run is divided among the chunks of a cluster, and the rest is sent once.
    batch = {name: np.broadcast_to(x, n) for name, x in own.items()}
    batch |= {"rows": rows, "y0": np.zeros((n, 4)) if y0 is None else y0}
    limits = {"events": events, "rtol": rtol, "brief": brief}
    shared = equations, forcing._replace(**dict.fromkeys(own, 0)), limits
    if cluster is None:
        results = _results(batch, *shared, workers, progress)
    else:
        # A chunk under long ground motions has fewer runs.
        chunk = _CHUNKS[equations]
        if isinstance(forcing, GroundForcing):
            chunk = int(np.clip(_PIECES // max(map(len, forcing.records)), 128, 16_384))
        results = cluster.map("runs", _results, batch, shared, chunk=chunk, progress=progress)
    inputs = {"condition": np.broadcast_to(condition, n), "ramp": np.broadcast_to(ramp, n)}
    design = {"nu": rows[:, NU], "mu": rows[:, MU], "lam": rows[:, LAM]}
    return Runs(equations=equations, seed=seed, **inputs, **design, **results)


def _results(
    batch: dict[str, np.ndarray],
    equations: Terms,
    forcing: HarmonicForcing | GroundForcing,
    limits: dict[str, Any],
    # The processes of a cluster share the cores.
    workers: int | None = 1,
    progress: Progress | None = None,
) -> dict[str, np.ndarray]:
    """Results of runs by the names of `Runs`. `batch` has rows, initial states and what the forcing has for
    each run."""
    forcing = forcing._replace(**{name: x for name, x in batch.items() if name in forcing._fields})
    how = {"y0": batch["y0"], "workers": workers, "progress": progress}
    found = runs.follow(equations, batch["rows"], forcing, **how, **limits)
    if isinstance(found, Settled):
        tilt, settled, swing, settled_swing = map(
            np.asarray, (found.peak, found.amplitude, found.peak_swing, found.swing)
        )
        sizes = tilt, settled, swing, settled_swing, swing + tilt, settled_swing + settled
        outcome, impacts = np.asarray(code_of(found.status)), np.full(len(tilt), np.nan)
    else:
        # A run under a ground motion has no steady state: its largest angles count.
        sizes = found.tilt, found.tilt, found.swing, found.swing, found.relative, found.relative
        outcome, impacts = _SHAKEN[found.status.astype(int)], found.impacts
    overturned, unanswered = outcome == code_of(Status.overturned), is_one_of(outcome, *UNANSWERED)

    def known(x: np.ndarray) -> np.ndarray:
        return np.where(unanswered, np.nan, x)

    angles = {n: known(np.where(overturned, np.inf, x)) for n, x in zip(ANGLES, sizes, strict=True)}
    return {**angles, "impacts": known(impacts), "outcome": outcome.astype(np.int8)}


def rows_of(
    block: Block, pendulum: Pendulum | None, motions: Sequence[GroundMotion], gravity: float
) -> np.ndarray:
    """Parameters of the compiled code for each of the motions at its own size, shape (motions, 9)."""
    # Numbers of NumPy throughout: no program is compiled for them.
    shaken = (Scene(block, motion, gravity).ground_parameters(pendulum) for motion in motions)
    return np.array([ground_row_of(p) for p in map(single, shaken)])


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
    **how: Any,
) -> Runs:
    """Follow a block with each pendulum from rest through every motion times each of its factors.

    Args:
        block: with its friction and restitution.
        pendulums: None is the bare block.
        motions: pulses or records.
        factors: shape (motions, ...), at least 0.
        gravity: m/s^2.
        free: free motion after each ground motion, s.
        equations: linear or nonlinear.
        brief: whether only tilt, uplift, impacts before an overturning and the verdict are wanted.
        how: workers, cluster and progress, as in `follow_runs`.

    Returns:
        Runs of the shape (pendulums, motions, ...).

    Raises:
        ValueError: a size that does not fit, or a number out of range.
    """
    for i, motion in enumerate(motions):
        checks.instance(f"motions[{i}]", motion, GroundMotion)
    if len(factors) != len(motions) or not len(motions):
        wanted = f"a row for each of {len(motions)} motions"
        raise ValueError(f"`factors` must have {wanted}, but has {factors.shape}")
    checks.not_negative("factors", factors, every=True)
    free = checks.within("free", free, 0.0, LONGEST_FREE, " s")
    # Rows of one record stand together, so that a thread finds its samples in the cache.
    which = np.repeat(np.arange(len(motions)), factors[0].size)
    x = np.concatenate([rows_of(block, pendulum, motions, gravity)[which] for pendulum in pendulums])
    x[:, F] *= np.tile(factors.ravel(), len(pendulums))
    records = [np.asarray(m.pieces(), dtype=float) for m in motions]
    late = free * single(Scene(block, motions[0], gravity).rate)
    forcing = GroundForcing(records, late, np.tile(which, len(pendulums)))
    found = follow_runs(equations, x, forcing, brief=brief, condition=forcing.which, **how)
    return found.reshape(len(pendulums), *factors.shape)
