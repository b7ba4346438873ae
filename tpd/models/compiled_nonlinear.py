"""The nonlinear equations (4) for many motions at once, by a compiled event loop on all cores.

`Segmented` solves the same equations with derivatives. Here are values alone, sooner, and no motion waits for
another one of its batch. Numbers cross between JAX and the compiled code at the edges only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tpd.core import checks
from tpd.core.parameters import Parameters
from tpd.models import compiling
from tpd.models.base import Settled
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
