"""The nonlinear equations (4) for many motions at once, by a compiled event loop on all cores.

`Segmented` solves the same equations with derivatives. Here are values alone, sooner, and no motion waits for
another one of its batch. Numbers cross between JAX and the compiled code at the edges only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.core.parameters import Parameters
from tpd.models import compiling
from tpd.models.base import Settled
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
    compiling.wait("tpd.models.nonlinear_settling")
    from tpd.models.nonlinear_settling import FLOATS, STATUSES, WHOLES, settle_rows

    n = len(starts)
    floats, wholes = np.empty((n, FLOATS)), np.empty((n, WHOLES), dtype=np.int64)

    def run(first: int, last: int) -> int:
        limits = int(periods), float(rtol), int(max_events)
        settle_rows(rows, starts, begins, ramps, first, last, *limits, floats, wholes)
        return last - first

    shared(run, n, workers, progress)
    return settled_of(floats, wholes, STATUSES)


def shake_nonlinear(
    parameters: np.ndarray,
    records: Sequence[np.ndarray],
    which: np.ndarray,
    free: np.ndarray,
    *,
    y0: np.ndarray | None = None,
    rtol: float = 1e-8,
    max_events: int = 100_000,
    brief: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Followed, None]:
    """Follow n motions under ground motions by the nonlinear equations (4).

    Arguments and result are those of `tpd.models.compiled_shaken.follow_all`, without derivatives; impacts,
    times, the angle between rod and block and the growing coordinate are not counted (NaN, or 0). The block
    has overturned where its tilt exceeds pi/2. `brief` changes nothing.
    """
    del brief
    compiling.wait("tpd.models.nonlinear_ground")
    from tpd.models.nonlinear_ground import COLUMNS, shake_rows

    n, lengths = len(parameters), np.array([len(r) for r in records])
    firsts = np.cumsum(lengths) - lengths
    pieces = np.ascontiguousarray(-np.concatenate([np.asarray(r, dtype=float) for r in records]))
    x = np.ascontiguousarray(parameters, dtype=float)
    starts = np.zeros((n, 4)) if y0 is None else np.ascontiguousarray(y0, dtype=float)
    place = np.ascontiguousarray(firsts[which]), np.ascontiguousarray(lengths[which])
    late, out = np.ascontiguousarray(free, dtype=float), np.zeros((n, COLUMNS))

    def run(first: int, last: int) -> int:
        shake_rows(x, starts, pieces, *place, late, first, last, rtol, max_events, out)
        return last - first

    shared(run, n, workers, progress)
    unknown, none, sure = np.full(n, np.nan), np.zeros(n), np.ones(n)
    lifted, times = np.where(out[:, 6] > 0.0, unknown, np.inf), np.full((n, 3), np.nan)
    tilt, swing, state = out[:, 0], out[:, 1], out[:, 2:6]
    seen = unknown, out[:, 8], none, lifted, out[:, 7], sure
    return Followed(tilt, swing, unknown, times, state, *seen), None
