"""The compiled loops: Numba's closed-form arcs, and the event codes' gradients over many processes."""

import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache

import numpy as np

from tests.benchmarks import peers
from tests.benchmarks.precision.methods import Method, Scene, Unable

PERIODS = (15, 25, 50, 100, 200, 400)
STEP = 3e-5
"""Of a difference over the parameter. Arcs are exact to round-off, so that it may be small."""
SIDES = np.array([1.0, -1.0])
WEIGHTS = np.array([0.5, -0.5])
FLOOR = 0.1
"""Smallest parameter that a step is a share of."""


def numba_gradients(xs: np.ndarray, y0s: np.ndarray, wrt: tuple[int, ...], periods: float) -> np.ndarray:
    """Central differences of all designs, every side of every one a run of its own on some core."""
    sides = _sides(xs, wrt)
    starts = np.repeat(y0s, len(wrt) * len(SIDES), axis=0)
    sizes, statuses = peers.numba_settle(sides.reshape(-1, 8), starts, int(periods), last=1)
    if np.any(statuses == peers.EVENT_BOUND):
        raise Unable("event bound")
    return sizes.reshape(sides.shape[:3]) @ WEIGHTS / _steps(xs, wrt)


def _steps(xs: np.ndarray, wrt: tuple[int, ...]) -> np.ndarray:
    return STEP * np.maximum(np.abs(xs[:, list(wrt)]), FLOOR)


def _sides(xs: np.ndarray, wrt: tuple[int, ...]) -> np.ndarray:
    """Moved designs, shape (designs, parameters, sides, 8)."""
    out = np.tile(xs[:, None, None, :], (1, len(wrt), len(SIDES), 1))
    steps = _steps(xs, wrt)
    for j, i in enumerate(wrt):
        out[:, j, :, i] += steps[:, j, None] * SIDES
    return out


def _one(x: np.ndarray, y0: tuple[float, ...], periods: float) -> float:
    size, status = peers.numba_settle_one(x, y0, int(periods), last=1)
    if status == peers.EVENT_BOUND:
        raise Unable("event bound")
    return size


def _value(scene: Scene, periods: float) -> Callable[[], float]:
    return lambda: _one(np.array(scene.x), scene.y0, periods)


def _gradient(scene: Scene, periods: float) -> Callable[[], np.ndarray]:
    def work() -> np.ndarray:
        x = np.array([scene.x])
        sides = _sides(x, scene.wrt)[0]
        sizes = np.array([[_one(side, scene.y0, periods) for side in row] for row in sides])
        return sizes @ WEIGHTS / _steps(x, scene.wrt)[0]

    return work


def _batch(xs: np.ndarray, y0s: np.ndarray, wrt: tuple[int, ...], periods: float) -> Callable[[], np.ndarray]:
    return lambda: numba_gradients(xs, y0s, wrt, periods)


METHODS = (Method("Numba event loop", False, "forcing periods", PERIODS, _value, _gradient, _batch),)


@lru_cache(maxsize=1)
def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn"))


def _each(method: str, module: str, scenes: list[Scene], setting: float) -> np.ndarray:
    """In a worker: the gradients of some scenes, NaN where there is none."""
    from importlib import import_module

    found = {m.name: m for m in import_module(module).METHODS}[method]
    out = np.full((len(scenes), 3), np.nan)
    for i, scene in enumerate(scenes):
        try:
            out[i] = found.gradient(scene, setting)()
        except (Unable, np.linalg.LinAlgError):
            continue
    return out


def with_processes(method: Method, module: str) -> Method:
    """With a batch that shares the designs out to a process per core; the pool and what is compiled in it
    stay for later calls."""

    def batch(xs, y0s, wrt, setting):
        scenes = [
            Scene("", tuple(x), tuple(y), (0.0,) * 4, wrt)
            for x, y in zip(xs.tolist(), y0s.tolist(), strict=True)
        ]
        chunk = max(1, min(64, len(scenes) // (4 * (os.cpu_count() or 1))))
        parts = [scenes[i : i + chunk] for i in range(0, len(scenes), chunk)]

        def work() -> np.ndarray:
            tasks = [_pool().submit(_each, method.name, module, part, setting) for part in parts]
            return np.concatenate([task.result() for task in tasks])

        return work

    return method._replace(batch=batch)
