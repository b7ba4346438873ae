"""The nonlinear equations (4) for many motions at once, by a compiled event loop on all cores.

`Segmented` solves the same equations with derivatives. Here are values alone, sooner, and no motion waits for
another one of its batch. The code is called as that of the linear equations is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tpd.core import checks
from tpd.exact.derivatives import refused_in
from tpd.models.base import Settled
from tpd.models.calling import numbers_in, shape
from tpd.models.compiled_linear import NONLINEAR
from tpd.models.compiled_shaken import Followed, follow_rows, known, operands
from tpd.models.rows import settle_rows
from tpd.scene.ensemble import MOST_PERIODS
from tpd.scene.parameters import Parameters

TOLERANCE = 1e-6
"""Repetition error that counts as settled, see `tpd.exact.repetition.scales_of`."""
REST_RATE = 1e-4
"""An impact slower than this (phi' in units of nu) that the block can be held after is rest."""


def settle_nonlinear(
    p: Parameters,
    y0: Any,
    *,
    begin: Any = 0.0,
    ramp: Any = 0.0,
    periods: checks.Whole = 400,
    rtol: checks.Real = 1e-8,
    max_events: checks.Whole = 2000,
    workers: checks.Whole | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Settled:
    """Follow every motion of a batch by the nonlinear equations (4) until it repeats, rests or is lost.

    The first call on a machine compiles for some seconds and stores the machine code (`NUMBA_CACHE_DIR` says
    where). Not differentiable, and no motion is `aperiodic`: one that does not repeat is `not_settled`.

    Args:
        p, y0, begin, ramp, workers, progress: as in `tpd.models.rows.settle_all`.
        periods: largest number of forcing periods of a motion.
        rtol: relative tolerance of a step.
        max_events: bound on the events of one forcing period.

    Returns and raises as `settle_all`, and `ValueError` for a bound out of range.
    """
    limits = {
        "periods": checks.count("periods", periods, most=MOST_PERIODS),
        "rtol": checks.tolerance("rtol", rtol),
    }
    limits |= {"events": checks.count("max_events", max_events), "tolerance": TOLERANCE}
    return settle_rows(NONLINEAR, (p, y0, begin, ramp), workers, progress, rest_rate=REST_RATE, **limits)


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
    rest_rate: float = REST_RATE,
    max_events: int = 100_000,
    brief: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Followed, None]:
    """Follow n motions under ground motions by the nonlinear equations (4).

    Arguments and result are those of `tpd.models.compiled_shaken.follow_all`, without derivatives; growing
    coordinate and transversality are none (NaN). Every landing is an impact. The block has overturned where
    its tilt exceeds pi/2. `rtol` is the relative tolerance of a step, and an impact slower than `rest_rate`
    (phi' in units of nu) that the block can be held after is rest. `brief` changes nothing.
    """
    del brief
    limits = {"free": free, "rtol": rtol, "rest_rate": rest_rate, "events": max_events}
    motions = parameters, y0, records, which
    return follow_rows(NONLINEAR, motions, False, workers, progress, **limits)[0], None


def follow_nonlinear(
    p: Parameters, pieces: Any, free: Any, y0: Any, max_events: int, *, rtol: float, rest_rate: float
) -> Followed:
    """Follow a motion from `y0` through `pieces`, shape (n, 4), and freely for `free` (tau), under JAX's
    transformations; further arguments as in `shake_nonlinear`. Derivatives are NaN.

    `p` are parameters of `Scene.ground_parameters`.
    """
    limits = {"free": free, "rtol": rtol, "rest_rate": rest_rate, "events": max_events}
    given = operands(NONLINEAR, p, pieces, y0, **limits)
    x, y, c, settings = (jax.lax.stop_gradient(a) for a in given)
    (out,) = NONLINEAR((shape(numbers_in(NONLINEAR.entry().FOLLOWED)),), settings, x, y, c)
    found = known(out)
    # Angles, times and state depend on all of this in a way that nobody has computed.
    names = ("tilt", "swing", "relative", "times", "state", "lifted", "fell")
    return found._replace(**{name: refused_in(given, getattr(found, name)) for name in names})
