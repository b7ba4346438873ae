"""Errors and times of all methods on all scenes, in one process, warm runs interleaved."""

import math
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tests.benchmarks.precision.methods import Call, Method, Scene, Unable

KINDS = ("value", "gradient")
OTHER = 0.3
"""Relative error from which on a number is that of another motion, or none at all."""
PATIENCE = 1.0
"""Seconds from which on a warm run is timed once only."""
TOO_LONG = 15.0
"""Seconds of a call after which finer settings of a method are left out on a scene."""
SHORT = 0.05
"""Seconds that a timing lasts at least: quicker calls are repeated."""


@dataclass
class Row:
    """One method with one setting on one scene."""

    scene: str
    kind: str
    method: str
    ours: bool
    knob: str
    setting: float
    error: float = float("nan")
    """Relative to the truth; of a gradient, its largest component relative to the largest."""
    cold: float = float("nan")
    """Seconds of the first call, compiling included where it had not been compiled for another scene."""
    warm: float = float("nan")
    """Median seconds."""
    note: str = ""
    """Why there is no answer."""


def error(out: Any, truth: Any) -> float:
    """Relative, by the largest component."""
    out, truth = np.atleast_1d(np.asarray(out, dtype=float)), np.atleast_1d(truth)
    return float(np.max(np.abs(out - truth)) / np.max(np.abs(truth)))


def once(call: Call) -> tuple[Any, float]:
    """What a call gives, and its seconds."""
    begun = time.perf_counter()
    out = call()
    return out, time.perf_counter() - begun


def seconds(call: Call) -> float:
    """Seconds of a call, the mean over `SHORT`."""
    count, begun = 0, time.perf_counter()
    while True:
        call()
        count += 1
        spent = time.perf_counter() - begun
        if spent > SHORT:
            return spent / count


def first_calls(
    methods: Iterable[Method], scenes: Iterable[Scene], truth: dict[str, tuple[float, np.ndarray]]
) -> list[tuple[Row, Call | None]]:
    """Every method, setting, scene and kind once. Ctrl-C leaves out the rest."""
    out: list[tuple[Row, Call | None]] = []
    try:
        for row_and_call in _each(methods, tuple(scenes), truth):
            out.append(row_and_call)
    except KeyboardInterrupt:
        print("interrupted: what has not been called yet is left out", file=sys.stderr, flush=True)
    return out


def _each(
    methods: Iterable[Method], scenes: tuple[Scene, ...], truth: dict[str, tuple[float, np.ndarray]]
) -> Iterator[tuple[Row, Call | None]]:
    long: set[tuple[str, str, str]] = set()
    for method in methods:
        for setting in method.settings:
            for kind in KINDS:
                make: Callable[[Scene, float], Call] | None = getattr(method, kind)
                if make is None:
                    continue
                for scene in scenes:
                    row = Row(scene.name, kind, method.name, method.ours, method.knob, setting)
                    curve = (scene.name, kind, method.name)
                    if curve in long:
                        row.note = f"a coarser setting took {TOO_LONG:g} s"
                        yield row, None
                        continue
                    known = truth[scene.name][kind == "gradient"]
                    yield row, _first(row, make, scene, setting, known)
                    if not method.ours and row.cold > TOO_LONG and setting != method.settings[0]:
                        long.add(curve)
            print(f"{method.name}, {method.knob} {setting:g}", file=sys.stderr, flush=True)


def _first(row: Row, make: Callable[[Scene, float], Call], scene: Scene, setting: float, truth: Any) -> Any:
    try:
        begun = time.perf_counter()
        call = make(scene, setting)
        value = call()
        row.cold = time.perf_counter() - begun
    except Unable as told:
        row.note = str(told)
    except (ArithmeticError, RuntimeError, ValueError) as failure:
        row.note = f"{type(failure).__name__}: {str(failure).splitlines()[0][:40]}"
    else:
        row.error = error(value, truth)
        if not np.isfinite(row.error):
            row.note = "no number"
        elif row.error > OTHER:
            row.note = "another motion or a wrong number"
        else:
            return call
    return None


def warm(rows: list[tuple[Row, Call | None]], rounds: int) -> None:
    """Fill in the warm times: so many rounds over everything."""
    spent: list[list[float]] = [[] for _ in rows]
    for turn in range(rounds):
        for (row, call), times in zip(rows, spent, strict=True):
            if call is None or (turn >= 1 and times[0] > PATIENCE):
                continue
            times.append(seconds(call))
            row.warm = statistics.median(times)
        print(f"round {turn + 1} of {rounds}", file=sys.stderr, flush=True)


def plain(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Rows as JSON holds them: NaN is null and infinity a string, see `read`."""
    names = {math.inf: "infinite"}
    return [{k: None if v != v else names.get(v, v) for k, v in asdict(row).items()} for row in rows]


def read(rows: Iterable[dict[str, Any]]) -> list[Row]:
    """Rows from what `plain` wrote."""
    numbers = {None: math.nan, "infinite": math.inf}
    return [Row(**{k: numbers.get(v, v) for k, v in row.items()}) for row in rows]
