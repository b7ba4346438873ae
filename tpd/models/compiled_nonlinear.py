"""The nonlinear equations (4) for many motions at once, by a compiled event loop on all cores.

`Segmented` solves the same equations with derivatives. Here are values alone, sooner, and no motion waits for
another one of its batch. Numbers cross between JAX and the compiled code at the edges only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tpd.core import checks
from tpd.core.parameters import Parameters
from tpd.exact.derivatives import refused_in
from tpd.models import compiling
from tpd.models.base import Settled
from tpd.models.compiled_linear import packed
from tpd.models.compiled_shaken import Followed
from tpd.models.rows import rows_of, settled_of, shared


def settle_nonlinear(
    p: Parameters,
    y0: Any,
    *,
    begin: Any = 0.0,
    ramp: Any = 0.0,
    periods: int = 400,
    rtol: float = 1e-8,
    max_events: int = 2000,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Settled:
    """Follow every motion of a batch by the nonlinear equations (4) until it repeats, rests or is lost.

    The first call on a machine compiles for some seconds and stores the machine code (`NUMBA_CACHE_DIR` says
    where). Not differentiable, and no motion is `aperiodic`: one that does not repeat is `not_settled`.

    Args:
        p, y0, begin, ramp, workers, progress: as in `tpd.models.batches.settle_all`.
        periods: largest number of forcing periods of a motion.
        rtol: relative tolerance of a step.
        max_events: bound on the events of one forcing period.

    Returns and raises as `settle_all`, and `ValueError` for a bound out of range.
    """
    checks.require_x64()
    checks.positive("rtol", rtol)
    for name, value in (("periods", periods), ("max_events", max_events)):
        checks.count(name, value)
    starts, rows, begins, ramps = rows_of(p, y0, begin, ramp)
    # Loaded here, and not with the package: it loads Numba, and compiles.
    compiling.load("tpd.models.nonlinear_settling")
    from tpd.models.nonlinear_settling import FLOATS, STATUSES, WHOLES, settle_rows

    n = len(starts)
    floats, wholes = np.empty((n, FLOATS)), np.empty((n, WHOLES), dtype=np.int64)

    def run(first: int, last: int) -> int:
        limits = int(periods), float(rtol), int(max_events)
        settle_rows(rows, starts, begins, ramps, first, last, *limits, floats, wholes)
        return last - first

    shared(run, n, workers, progress)
    return settled_of(floats, wholes, STATUSES)


def settle_one(p: Parameters, y0: Any = (0.0, 0.0, 0.0, 0.0)) -> Settled:
    """Follow one motion by the nonlinear equations (4), as `settle_nonlinear` follows a batch.

    Args:
        p: plain numbers.
        y0: the state at tau = 0, shape (4,).
    """
    batch = settle_nonlinear(p, np.asarray(y0, dtype=float)[None], workers=1)
    return jax.tree.map(lambda x: jnp.asarray(x[0]), batch)


def shake_nonlinear(
    parameters: np.ndarray,
    records: Sequence[np.ndarray],
    which: np.ndarray,
    free: np.ndarray,
    *,
    y0: np.ndarray | None = None,
    rtol: float = 1e-8,
    rest_rate: float = 1e-4,
    max_events: int = 100_000,
    brief: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Followed, None]:
    """Follow n motions under ground motions by the nonlinear equations (4).

    Arguments and result are those of `tpd.models.compiled_shaken.follow_all`, without derivatives; the
    growing coordinate is none (NaN). Every landing is an impact. The block has overturned where its tilt
    exceeds pi/2. `rtol` is the relative tolerance of a step, and an impact slower than `rest_rate` (phi' in
    units of nu) that the block can be held after is rest. `brief` changes nothing.
    """
    del brief
    starts = np.zeros((len(parameters), 4)) if y0 is None else y0
    limits = float(rtol), float(rest_rate), int(max_events)
    return _followed(_shaken(parameters, starts, records, which, free, limits, workers, progress)), None


def _shaken(
    parameters: np.ndarray,
    starts: np.ndarray,
    records: Sequence[np.ndarray],
    which: np.ndarray,
    free: np.ndarray,
    limits: tuple[float, float, int],
    workers: int | None,
    progress: Callable[[int, int], None] | None,
) -> np.ndarray:
    """Results of n motions, see `tpd.models.nonlinear_ground.COLUMNS`; `limits` are relative tolerance, rate
    of rest and bound on events."""
    compiling.load("tpd.models.nonlinear_ground")
    from tpd.models.nonlinear_ground import COLUMNS, shake_rows

    n, lengths = len(parameters), np.array([len(r) for r in records])
    firsts = np.cumsum(lengths) - lengths
    pieces = np.ascontiguousarray(-np.concatenate([np.asarray(r, dtype=float) for r in records]))
    x, y = (np.ascontiguousarray(a, dtype=float) for a in (parameters, starts))
    place = np.ascontiguousarray(firsts[which]), np.ascontiguousarray(lengths[which])
    late, out = np.ascontiguousarray(free, dtype=float), np.zeros((n, COLUMNS))

    def run(first: int, last: int) -> int:
        shake_rows(x, y, pieces, *place, late, first, last, *limits, out)
        return last - first

    shared(run, n, workers, progress)
    return out


def follow_nonlinear(
    p: Parameters, pieces: Any, free: Any, y0: Any, max_events: int, *, rtol: float, rest_rate: float
) -> Followed:
    """Follow a motion from `y0` through `pieces`, shape (n, 4), and freely for `free` (tau), under JAX's
    transformations; further arguments as in `shake_nonlinear`. Derivatives are NaN.

    `p` are parameters of `Scene.ground_parameters`.
    """
    # Compiled here, if at all, and not within a program of XLA.
    compiling.load("tpd.models.nonlinear_ground")
    from tpd.models.nonlinear_ground import COLUMNS

    limits = float(rtol), float(rest_rate), int(max_events)
    x = packed(p).at[6].set(2.0 * jnp.pi / jnp.asarray(p.xi, dtype=jnp.float64))
    operands = x, jnp.asarray(pieces), jnp.asarray(free, dtype=jnp.float64), jnp.asarray(y0)

    def on_host(*operands: Any) -> np.ndarray:
        # Copies: JAX's arrays are read-only, for which nothing is compiled.
        wide = [np.array(a, dtype=float) for a in operands]
        batch = wide[0].shape[:-1]
        rows, records, late, starts = (a.reshape(-1, *a.shape[len(batch) :]) for a in wide)
        found = _shaken(rows, starts, list(records), np.arange(len(rows)), late, limits, None, None)
        return found.reshape(*batch, COLUMNS)

    shape = jax.ShapeDtypeStruct((COLUMNS,), np.float64)
    still = (jax.lax.stop_gradient(a) for a in operands)
    out = jax.pure_callback(on_host, shape, *still, vmap_method="broadcast_all")
    known = _followed(jax.lax.stop_gradient(out))
    # Angles, times and state depend on all of this in a way that nobody has computed.
    names = ("tilt", "swing", "relative", "times", "state", "lifted", "fell")
    return known._replace(**{name: refused_in(operands, getattr(known, name)) for name in names})


def _followed(out: Any) -> Followed:
    """Motions from the numbers of the compiled code."""
    # The status is a number in every case.
    sure = 0.0 * out[..., 10] + 1.0
    angles = out[..., 0], out[..., 1], out[..., 2]
    counted = out[..., 10], out[..., 11], out[..., 12], out[..., 13]
    return Followed(*angles, out[..., 3:6], out[..., 6:10], np.nan * sure, *counted, sure)
