"""Error and time of the settled amplitudes of many designs at once, by `tpd` and by a Numba loop."""

import statistics
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np

import tpd
from tests.benchmarks.engine import designs
from tests.benchmarks.precision.methods import OTHER, seconds
from tests.benchmarks.precision.numba_loop import settle_all
from tests.benchmarks.precision.ours import _attracting
from tests.reference import parameters
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, follow
from tpd.scene.parameters import as_arrays

SCENE = "designs"
LOOP, SETTLED = (15, 25, 50, 100, 200), (1e-3, 1e-5, 1e-7, 1e-10)
"""Periods of the Numba loop, and differences between two periods that count as settled."""


def rows_of(count: int, rounds: int) -> list[dict[str, Any]]:
    """Return a row for each method and setting, in which the error is the median over `count` designs.

    A design counts if its motion settles and the loop confirms its amplitude after 2000 periods. The row
    also has the share of designs whose amplitude is wrong by more than 30 %.
    """
    x, rest = designs(count), np.zeros((count, 4))
    p = row_of(as_arrays(parameters(list(x.T))))

    def run(tolerance: float) -> Any:
        return follow(tpd.Terms.linear, p, HarmonicForcing(2000), tolerance=tolerance)

    truth, exact = settle_all(x, rest, 2000), run(1e-13)
    known = (exact.status == tpd.Status.rocking) & (np.abs(exact.settled_tilt / truth - 1.0) < 1e-9)
    works: list[tuple[str, bool, float, Callable[[], Any]]] = [
        ("orbit equation, in_chunks", True, 0.0, lambda: tpd.in_chunks(_attracting, jnp.asarray(x))),
        *(("runs until they repeat", True, t, lambda t=t: run(t).settled_tilt) for t in SETTLED),
        *(("Numba event loop", False, n, lambda n=n: settle_all(x, rest, n)) for n in LOOP),
    ]
    out = []
    for method, ours, setting, work in works:
        errors = np.abs(np.asarray(work()) / truth - 1.0)[known]
        away = ~(errors <= OTHER)
        row = {"scene": SCENE, "kind": "ensemble", "method": method, "ours": ours, "setting": setting}
        out.append(row | {"error": float(np.median(errors[~away])), "wrong": float(away.mean()), "note": ""})
    spent = [[seconds(work) for _, _, _, work in works] for _ in range(rounds)]
    for row, times in zip(out, zip(*spent, strict=True), strict=True):
        row |= {"ms": 1e3 * statistics.median(times) / count, "designs": int(known.sum())}
    return out
