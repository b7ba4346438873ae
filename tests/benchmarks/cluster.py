"""Compare batches in several processes with threads, and test that results survive a killed process."""

import contextlib
import os
import signal
import tempfile
import threading
import time
from statistics import median
from typing import Any

import numpy as np

import tpd
from tests.benchmarks.stored import columns

QUESTION = "How fast are several processes, and how long does it take if one is killed?"
MEASURES = "cluster", "core/batch"
SEED, ROUNDS, KILLS = 1, 2, 5
BLOCK = tpd.Block(width=0.45, height=1.8, mass=900.0, restitution="housner")
BOB = tpd.Pendulum(mass=90.0, length=0.6, damping_ratio=0.2)
Where = tpd.Cluster | None


def by_map(cluster: Where, shift: float = 0.0, points: int = 400) -> np.ndarray:
    """Return amplitudes of a map. A small `shift` makes it another map, which has no stored chunks yet."""
    scene = tpd.paper_scene()
    with_it = scene.pendulum(mass_ratio=0.1, length_ratio=0.4, damping_ratio=0.1)
    axes = ("mu", np.linspace(0.02, 0.3 + shift, points)), ("lam", np.linspace(0.1, 1.0, points))
    return tpd.design_map(scene, *axes, pendulum=with_it, cluster=cluster).amplitude


def by_records(cluster: Where, shift: float = 0.0, motions: int = 22) -> np.ndarray:
    """Return tilts of a fragility under noise with the envelope of an earthquake."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 40.0, 0.01)
    shape = np.minimum(t / 4.0, 1.0) * np.exp(-np.maximum(t - 12.0, 0.0) / 8.0)
    smooth = np.exp(-np.arange(0.0, 1.0, 0.01) / 0.08)
    noise = [np.convolve(rng.normal(size=t.size), smooth)[: t.size] * shape for _ in range(motions)]
    records = [tpd.Record(0.1 * x, 0.01, name=f"noise {i}", event=f"noise {i}") for i, x in enumerate(noise)]
    stripes = np.linspace(0.5, 4.0 + shift, 40)
    found = tpd.fragility(BLOCK, records, scales=stripes, pendulum=BOB, cluster=cluster)
    return np.stack([x for x in found.tilts if x is not None])


WORK = {"map of 400 × 400 orbits": by_map, "fragility, 22 × 40 × 4 runs": by_records}


def run(quick: bool) -> list[dict[str, Any]]:
    """Return times by threads (0 processes), 1 and 2 processes, and how many calculations survive a kill."""
    sizes = {"points": 40} if quick else {}, {"motions": 2} if quick else {}
    work = {name: (of, more) for (name, of), more in zip(WORK.items(), sizes, strict=True)}
    truth = {name: of(None, **more) for name, (of, more) in work.items()}
    seconds: dict[tuple[str, int], list[float]] = {}
    for _ in range(1 if quick else ROUNDS):
        for n in (0, 1, 2):
            with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
                cluster = stack.enter_context(tpd.Cluster(folder, workers=n)) if n else None
                for name, (of, more) in work.items():
                    # Programs are loaded before the time is taken.
                    of(cluster, -1e-9, **more)
                    begun = time.perf_counter()
                    found = of(cluster, **more)
                    seconds.setdefault((name, n), []).append(time.perf_counter() - begun)
                    assert np.array_equal(found, truth[name], equal_nan=True)
    rates = [{"work": w, "processes": n, "seconds": median(s)} for (w, n), s in seconds.items()]
    return [*rates, killed(1 if quick else KILLS)]


def killed(kills: int) -> dict[str, Any]:
    """Kill a worker at a random moment, several times."""
    rng, truth, same, longest = np.random.default_rng(SEED), by_records(None), 0, 0.0
    for _ in range(kills):
        with tempfile.TemporaryDirectory() as folder, tpd.Cluster(folder, workers=2) as cluster:
            victims = list(cluster.client.run(os.getpid).values())
            stop = threading.Timer(rng.uniform(0.0, 5.0), os.kill, [victims[rng.integers(2)], signal.SIGKILL])
            begun = time.perf_counter()
            stop.start()
            same += np.array_equal(by_records(cluster), truth, equal_nan=True)
            longest = max(longest, time.perf_counter() - begun)
            stop.cancel()
    return {"work": "worker killed", "kills": kills, "same": int(same), "seconds": longest}


def table(rows: list[dict[str, Any]]) -> str:
    """Return the table of times; the last row has the longest time after a kill."""
    return columns(
        rows,
        work="{work}",
        processes="{processes}",
        s="{seconds:.2f}",
        **{"same digits": "{same} of {kills}"},
    )
