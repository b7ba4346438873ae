"""Times of maps and responses, medians of repeated calls, each after one that compiles.

.venv/bin/python -m tests.benchmarks.maps
"""

import os
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402

SCENE, HUNG = tpd.paper_scene(), tpd.Pendulum(mass=0.8, length=0.1, damping_ratio=0.1)
P = SCENE.parameters(HUNG)
LINE = np.linspace(0.0, 1.0, 200)
MAPS: dict[str, Callable[[], Any]] = {
    "200 x 200, mu and lam": lambda: tpd.design_map(P, ("mu", 0.01 + 0.19 * LINE), ("lam", 0.1 + 1.4 * LINE)),
    "200 x 200, frequency and amplitude": lambda: tpd.design_map(
        SCENE, ("frequency", 1.0 + 4.0 * LINE), ("amplitude", 0.002 + 0.048 * LINE), pendulum=HUNG
    ),
    "200 x 200, frequency and length": lambda: tpd.design_map(
        SCENE, ("frequency", 1.0 + 4.0 * LINE), ("pendulum_length", 0.02 + 0.28 * LINE), pendulum=HUNG
    ),
    "branches over frequency, 400 values": lambda: tpd.branches(SCENE, "frequency", 1.0, 5.0, pendulum=HUNG),
}


def timed(function: Callable[[], Any], repeats: int) -> tuple[float, list[float]]:
    """Seconds of the first call, and of the others."""
    times = []
    for _ in range(repeats + 1):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return times[0], times[1:]


def main() -> None:
    """Print a line for each."""
    for name, function in MAPS.items():
        first, times = timed(function, 9)
        spread = f"{min(times):.2f} to {max(times):.2f}"
        load = os.getloadavg()[0]
        print(
            f"{name:36} first {first:5.1f} s, then {np.median(times):.2f} s ({spread}), load {load:.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
