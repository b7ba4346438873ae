"""What a user would pick instead of tpd for a settled amplitude and its gradient.

    .venv/bin/python -m tests.benchmarks.precision.peers [WORD ...]

prints, per scene, method and setting, the errors of value and gradient and the seconds of the second
call, for the methods whose names contain a word. A package that is not installed leaves its methods
out, with a line that says so.
"""

import contextlib
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from tests.benchmarks.precision.loops import with_processes
from tests.benchmarks.precision.methods import Method, Unable
from tests.benchmarks.precision.scenes import SCENES, load

MODULES = ("scipy_peers", "smoothed_peers", "loops", "sundials_peers", "taylor_peers", "rigid")
BATCHED = ("SciPy DOP853, events", "SUNDIALS CVODE, roots", "heyoka, settled", "heyoka, Newton")
"""Whose gradients are also shared out to processes."""
LONGEST = 60.0
"""Seconds of a call after which finer settings are left out of the table."""


def _methods() -> tuple[Method, ...]:
    out: list[Method] = []
    for name in MODULES:
        path = f"tests.benchmarks.precision.{name}"
        try:
            if name == "loops":
                import_module("numba")
            methods = import_module(path).METHODS
        except ImportError as error:
            print(f"left out, {name}: {error}", file=sys.stderr)
            continue
        out += [with_processes(m, path) if m.name in BATCHED else m for m in methods]
    return tuple(out)


PEERS: tuple[Method, ...] = _methods()


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """The answer and the seconds of the second call, or of the first where that takes long."""
    for _ in range(2):
        begun = time.perf_counter()
        answer = work()
        seconds = time.perf_counter() - begun
        if seconds > 5.0:
            break
    return answer, seconds


def compile_all(methods: list[Method]) -> None:
    """What belongs to first calls only, on a quick scene."""
    for method in methods:
        for kind in (method.value, method.gradient):
            with contextlib.suppress(Unable):
                kind(SCENES[-1], method.settings[0])()


def main(words: list[str]) -> None:
    """Print the table."""
    truth = load()
    chosen = [m for m in PEERS if not words or any(word.lower() in m.name.lower() for word in words)]
    compile_all(chosen)
    for scene in SCENES:
        value, slopes = truth[scene.name]
        print(f"\n{scene.name}", flush=True)
        for method in chosen:
            for setting in method.settings:
                row, longest, answered = [], 0.0, False
                for kind, exact in ((method.value, value), (method.gradient, slopes)):
                    try:
                        answer, seconds = timed(kind(scene, setting))
                        error = np.max(np.abs(answer - exact)) / np.max(np.abs(exact))
                        row.append(f"{error:8.1e} {seconds:9.4f} s")
                        longest, answered = max(longest, seconds), True
                    except Unable as reason:
                        row.append(f"{reason!s:>20}")
                print(f"{method.name:30} {setting:8.2g}  {row[0]}  {row[1]}", flush=True)
                if longest > LONGEST or not answered:
                    break


if __name__ == "__main__":
    main(sys.argv[1:])
