"""Table of runs: one block, bare and with pendulums, under many pulses and records, on all cores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from tpd.cluster.cluster import Cluster, check_where
from tpd.core import checks
from tpd.exact import runs
from tpd.exact.rows import ground_row_of
from tpd.exact.runs import GroundForcing
from tpd.exact.terms import FAILED, MU, OVERTURNED, F
from tpd.scene.ground_motion import LONGEST_FREE, STANDARD_GRAVITY, GroundMotion
from tpd.scene.pytrees import single
from tpd.scene.scene import Block, Pendulum, Scene
from tpd.theory.equations import Terms

Progress = Callable[[int, int], None]
_PIECES = 1 << 21
"""Pieces of ground motion in a chunk for a cluster: some tenths of a second of work."""


class Runs(NamedTuple):
    """Outcomes of a batch of motions, NumPy arrays of its shape; angles in rad."""

    tilt: np.ndarray
    """Largest |phi|; infinite where the block overturns."""
    swing: np.ndarray
    """Largest |psi|."""
    relative: np.ndarray
    """Largest |psi - phi|."""
    impacts: np.ndarray
    lifted: np.ndarray
    """Whether the block has left its base."""
    overturned: np.ndarray
    undecided: np.ndarray
    """Whether the bound on events, or a failure of numbers, ended the motion: then nothing else holds."""


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
    nonlinear: bool = False,
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
        nonlinear: whether to integrate the nonlinear equations (4) instead of the exact linear ones.
        brief: whether only tilt, uplift, impacts before an overturning and the verdict are wanted.
        how: workers, cluster and progress, as in `follow_rows`.

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
    x = np.concatenate([rows_of(block, hung, motions, gravity)[which] for hung in pendulums])
    x[:, F] *= np.tile(factors.ravel(), len(pendulums))
    records = [np.asarray(m.pieces(), dtype=float) for m in motions]
    late = np.full(len(x), free * single(Scene(block, motions[0], gravity).rate))
    batch = {"x": x, "which": np.tile(which, len(pendulums)), "free": late}
    found = follow_rows(batch, records, nonlinear, brief, **how)
    return Runs(*(a.reshape(len(pendulums), *factors.shape) for a in found))


def follow_rows(
    batch: dict[str, np.ndarray],
    records: list[np.ndarray],
    nonlinear: bool,
    brief: bool,
    *,
    workers: int | None = None,
    cluster: Cluster | None = None,
    progress: Progress | None = None,
) -> Runs:
    """Follow motions from rest, in threads or on a cluster.

    Args:
        batch: "x", parameters of the compiled code, shape (n, 9); "which", index of the record of each,
            shape (n,); "free", free time after it in tau, shape (n,).
        records: pieces of each ground motion.
        nonlinear, brief: as in `follow_scaled`.
        workers: threads; all cores by default.
        cluster: processes or machines in place of threads.
        progress: called with the motions done and in all.
    """
    check_where(workers, cluster, progress)
    if cluster is None:
        return Runs(**_followed(batch, records, nonlinear, brief, workers, progress))
    # A bound on the work of a chunk: it grows with the pieces of a record.
    chunk = int(np.clip(_PIECES // max(map(len, records)), 128, 16_384))
    shared = records, nonlinear, brief
    return Runs(**cluster.map("motions", _followed, batch, shared, chunk=chunk, progress=progress))


def _followed(
    batch: dict[str, np.ndarray],
    records: list[np.ndarray],
    nonlinear: bool,
    brief: bool,
    # The processes of a cluster share the cores.
    workers: int | None = 1,
    progress: Progress | None = None,
) -> dict[str, np.ndarray]:
    """Fields of `Runs` of motions: rows of parameters, index of the record and free time of each."""
    x, how = batch["x"], {"brief": brief, "workers": workers, "progress": progress}
    forcing = GroundForcing(records, batch["free"], batch["which"])
    found = runs.follow(Terms.nonlinear if nonlinear else Terms.linear, x, forcing, **how)
    status, has_bob = found.status.astype(int), x[:, MU] > 0.0
    return {
        "tilt": found.tilt,
        "swing": np.where(has_bob, found.swing, 0.0),
        "relative": np.where(has_bob, found.relative, 0.0),
        "impacts": np.asarray(found.impacts).astype(int),
        "lifted": ~np.isposinf(found.lifted),
        "overturned": status == OVERTURNED,
        "undecided": (status > OVERTURNED) & (status <= FAILED),
    }
