"""The nonlinear equations (4) for many motions at once, by a compiled event loop on all cores.

`Segmented` solves the same equations with derivatives. Here are values alone, sooner, and no motion waits for
another one of its batch. Numbers cross between JAX and the compiled code at the edges only.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tpd.core import checks
from tpd.core.parameters import Parameters, uniform_inertia_ratio
from tpd.core.status import Status
from tpd.exact.contact import Mode
from tpd.models.base import Settled

_CHUNK = 16
"""Motions of one piece of work, at most."""


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
        p: parameters, of shape (n,) or single numbers for all.
        y0: starts, shape (n, 4).
        begin: dimensionless times at which the shaking and the motion begin, within the first forcing
            period; shape (n,) or one for all. The default is tau = 0.
        ramp: forcing periods over which the shaking grows linearly to its full size, counted from tau = 0
            also for motions that begin later; shape (n,) or one for all. The default is sudden.
        periods: largest number of forcing periods of a motion.
        rtol: relative tolerance of a step.
        max_events: bound on the events of one forcing period.
        workers: threads; default the number of cores.
        progress: called with (motions done, of how many) now and then.

    Returns:
        A `Settled` with NumPy leaves of leading axis n, in the order of the batch.

    Raises:
        ValueError: an empty batch, leaves of different lengths, a number out of range, or workers below one.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    checks.positive("rtol", rtol)
    for name, value in (("periods", periods), ("max_events", max_events)):
        checks.count(name, value)
    if workers is not None:
        checks.count("workers", workers)
    starts, rows, begins, ramps = _rows(p, y0, begin, ramp)
    # Loaded here, and not with the package: it loads Numba, and compiles.
    from tpd.models.nonlinear_settling import FLOATS, STATUSES, WHOLES, settle_rows

    n = len(starts)
    floats, wholes = np.empty((n, FLOATS)), np.empty((n, WHOLES), dtype=np.int64)

    def run(first: int, last: int) -> int:
        limits = int(periods), float(rtol), int(max_events)
        settle_rows(rows, starts, begins, ramps, first, last, *limits, floats, wholes)
        return last - first

    _shared(run, n, (os.cpu_count() or 1) if workers is None else workers, progress)
    return _settled(floats, wholes, STATUSES)


def _shared(
    run: Callable[[int, int], int], n: int, cores: int, progress: Callable[[int, int], None] | None
) -> None:
    """Do all pieces of work on so many threads."""
    # Each piece writes rows of its own, so that the order in which they end is no matter.
    size = max(1, min(_CHUNK, -(-n // (4 * cores))))
    done = 0
    with ThreadPoolExecutor(min(cores, n)) as crew:
        pieces = [crew.submit(run, i, min(i + size, n)) for i in range(0, n, size)]
        for piece in as_completed(pieces):
            done += piece.result()
            if progress is not None:
                progress(done, n)


def _rows(p: Parameters, y0: Any, begin: Any, ramp: Any) -> tuple[np.ndarray, ...]:
    """Starts (n, 4), parameters (n, 9), beginnings and ramps (n,)."""
    starts = np.array(y0, dtype=float, order="C")
    n = len(starts) if starts.ndim else 0
    shapes = sorted({np.shape(x) for x in jax.tree.leaves((p, begin, ramp))} - {()})
    if starts.shape != (n, 4) or n == 0 or shapes not in ([], [(n,)]):
        raise ValueError(
            f"`p`, `begin` and `ramp` must have shape (n,) and `y0` (n, 4), but have {shapes} and "
            f"{starts.shape}"
        )
    rho = uniform_inertia_ratio(np.asarray(p.nu)) if p.rho is None else p.rho
    values = (p.nu, p.mu, p.lam, p.zeta, p.k, p.f, p.xi, rho, p.e, begin, ramp)
    columns = [np.broadcast_to(np.asarray(x, dtype=float), n) for x in values]
    begins, ramps = (np.array(x) for x in columns[9:])
    late = (begins < 0.0) | (begins * columns[6] > 2.0 * np.pi * (1.0 + 1e-12))
    if np.any(late | ~np.isfinite(begins)):
        raise ValueError(f"`begin` must lie within the first forcing period, but is {begins[late]}")
    checks.not_negative("ramp", ramps)
    return starts, np.array(np.transpose(columns[:9]), order="C"), begins, ramps


@lru_cache(maxsize=1)
def _structure() -> Any:
    """Structure of the pytree of a `Settled`."""
    none, count = jnp.zeros(()), jnp.zeros((), int)
    memory = Mode(count, none, none)
    return jax.tree.structure(
        Settled(jnp.zeros(4), memory, count, none, none, Status.failed, count, none, none)
    )


def _settled(floats: np.ndarray, wholes: np.ndarray, names: tuple[str, ...]) -> Settled:
    """Results of a batch from columns of numbers."""
    statuses = np.array([jax.tree.leaves(getattr(Status, name))[0] for name in names])
    amplitude, stroke, peak, peak_stroke, kind, *signs = floats.T[4:].copy()
    memory, sizes = (kind.astype(int), *signs), (amplitude, stroke)
    status, periods, elapsed = statuses[wholes[:, 0]], wholes[:, 1].copy(), wholes[:, 2].copy()
    # From its leaves, because fields are annotated with the shapes of a single motion.
    leaves = [floats[:, :4].copy(), *memory, periods, *sizes, status, elapsed, peak, peak_stroke]
    return jax.tree.unflatten(_structure(), leaves)
