"""Methods of the benchmark, and the measurement of their error and time over the accuracy setting."""

import contextlib
import math
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from tests.benchmarks.precision.scenes import Scene

Call = Callable[[], Any]
"""Work that is timed; its first call includes compilation."""
KINDS = ("value", "gradient")
OTHER = 0.3
"""Relative error above which a number belongs to another motion, or is meaningless."""
PATIENCE = 0.5
"""Seconds above which a call is timed once only."""
SHORT = 0.05
"""Smallest duration of a timing in seconds; faster calls are repeated."""


class Unable(Exception):
    """A method has no result for a scene. The message of a few words is a cell of the table."""


class Method(NamedTuple):
    """A method: its functions take a scene and a setting and return the work, or raise `Unable`."""

    name: str
    ours: bool
    settings: tuple[float, ...]
    """Settings from coarse to fine; (0.0,) if the method has none."""
    value: Callable[[Scene, float], Call] | None = None
    """Settled amplitude, rad."""
    gradient: Callable[[Scene, float], Call] | None = None
    """Derivatives of the amplitude in the parameters `wrt`, shape (3,)."""


def error(out: Any, truth: Any) -> float:
    """Return the relative error, divided by the largest component."""
    out, truth = np.atleast_1d(np.asarray(out, dtype=float)), np.atleast_1d(truth)
    return float(np.max(np.abs(out - truth)) / np.max(np.abs(truth)))


def seconds(call: Call) -> float:
    """Return the seconds of a call, as a mean over at least `SHORT`."""
    count, begun = 0, time.perf_counter()
    while True:
        call()
        count += 1
        spent = time.perf_counter() - begun
        if spent > SHORT:
            return spent / count


def measured(
    methods: Iterable[Method],
    scenes: Sequence[Scene],
    truth: dict[str, tuple[float, np.ndarray]],
    rounds: int,
) -> list[dict[str, Any]]:
    """Every method, setting, scene and kind: first called once, then timed in rounds over all of them, so
    that a busy minute falls on all alike."""
    rows, calls = [], []
    for method in methods:
        if not method.ours:
            # What is compiled once for all scenes belongs to none of them.
            with contextlib.suppress(Unable):
                method.value(scenes[-1], method.settings[0])()
        for setting in method.settings:
            for kind in KINDS:
                if (make := getattr(method, kind)) is None:
                    continue
                for scene in scenes:
                    row = {"scene": scene.name, "kind": kind, "method": method.name, "ours": method.ours}
                    row |= {"setting": setting, "error": math.nan, "ms": math.nan, "note": ""}
                    rows.append(row)
                    calls.append(_first(row, make, scene, setting, truth[scene.name][kind == "gradient"]))
        print(f"  {method.name}", file=sys.stderr, flush=True)
    spent: list[list[float]] = [[] for _ in rows]
    for turn in range(rounds):
        for row, call, times in zip(rows, calls, spent, strict=True):
            if call is None or (turn and times[0] > PATIENCE):
                continue
            slow = not row["ours"] and row["first"] > PATIENCE
            times.append(row["first"] if slow else seconds(call))
            row["ms"] = 1e3 * statistics.median(times)
    return rows


def _first(row: dict[str, Any], make: Callable, scene: Scene, setting: float, truth: Any) -> Call | None:
    """Call the work once, and put its first time, and its error or the reason for none, into the row."""
    try:
        begun = time.perf_counter()
        call = make(scene, setting)
        value = call()
        row["first"] = time.perf_counter() - begun
    except Unable as told:
        row["note"] = str(told)
    except (ArithmeticError, RuntimeError, ValueError) as failure:
        row["note"] = f"{type(failure).__name__}: {str(failure).splitlines()[0][:40]}"
    else:
        row["error"] = error(value, truth)
        if row["error"] <= OTHER:
            return call
        row["note"] = "wrong" if np.isfinite(row["error"]) else "no number"
    return None
