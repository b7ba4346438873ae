"""Batches on several processes: how fast, what a killed process costs, and Dask beside JAX's distribution.

    .venv/bin/python -m tests.benchmarks.cluster [rates] [kills] [jax]

Rates: a map of 640 000 designs without a start, one of 14 400 designs followed from rest, and a fragility of
44 records with 40 stripes, bare and with a pendulum, by both equations; by threads, and by 1, 2 and 4
processes, in turns. Kills: a worker, and the whole sweep, at 20 random moments each. JAX: the same map by two
processes of `jax.distributed`, and what becomes of the second when the first is killed. The table stands in
results/cluster.md; each part replaces its own section.
"""

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

import tpd  # noqa: E402

RESULT = Path(__file__).parent / "results" / "cluster.md"
ROUNDS = 3
KILLS = 20
BLOCK = tpd.Block(width=0.45, height=1.8, mass=900.0, restitution="housner")
BOB = tpd.Pendulum(mass=90.0, length=0.6, damping_ratio=0.2)
Where = tpd.Cluster | None


def by_map(cluster: Where, shift: float = 0.0, points: int = 800) -> np.ndarray:
    """Amplitudes of a map; a small `shift` makes it another map, so that nothing is there already."""
    scene = tpd.paper_scene()
    hung = scene.pendulum(mass_ratio=0.1, length_ratio=0.4, damping_ratio=0.1)
    x, y = np.linspace(0.02, 0.3 + shift, points), np.linspace(0.1, 1.0, points)
    return tpd.design_map(scene, ("mu", x), ("lam", y), pendulum=hung, cluster=cluster).amplitude


def by_runs(cluster: Where, shift: float = 0.0, points: int = 120) -> np.ndarray:
    """Amplitudes of a map from rest."""
    scene = tpd.paper_scene()
    hung = scene.pendulum(mass_ratio=0.1, length_ratio=0.4, damping_ratio=0.1)
    x, y = np.linspace(0.02, 0.3 + shift, points), np.linspace(0.1, 1.0, points)
    axes = ("mu", x), ("lam", y)
    return tpd.design_map(scene, *axes, pendulum=hung, start=np.zeros(4), cluster=cluster).amplitude


def by_records(cluster: Where, shift: float = 0.0, motions: int = 44) -> np.ndarray:
    """Tilts of a fragility under noise with the envelope of an earthquake."""
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 40.0, 0.01)
    shape = np.minimum(t / 4.0, 1.0) * np.exp(-np.maximum(t - 12.0, 0.0) / 8.0)
    smooth = np.exp(-np.arange(0.0, 1.0, 0.01) / 0.08)
    noise = [np.convolve(rng.normal(size=t.size), smooth)[: t.size] * shape for _ in range(motions)]
    records = [tpd.Record(0.1 * x, 0.01, name=f"noise {i}") for i, x in enumerate(noise)]
    stripes = np.linspace(0.5, 4.0 + shift, 40)
    found = tpd.fragility(BLOCK, records, scales=stripes, pendulum=BOB, cluster=cluster)
    return np.stack([x for x in found.tilts if x is not None])


WORK: dict[str, tuple[Callable[..., np.ndarray], int, str]] = {
    "map of orbits": (by_map, 640_000, "designs"),
    "map from rest": (by_runs, 14_400, "designs"),
    "fragility": (by_records, 44 * 40 * 4, "runs of 40 s"),
}


def rates() -> list[str]:
    """Table of the rates."""
    lines = ["| work | threads | 1 process | 2 | 4 | 2 over 1 | 4 over 2 |", "|---" * 7 + "|"]
    truth = {name: work(None) for name, (work, _, _) in WORK.items()}
    seconds: dict[tuple[str, int], list[float]] = {}
    for _ in range(ROUNDS):
        for n in (0, 1, 2, 4):
            # One cluster at a time: processes that wait take memory, and page faults are slow here.
            with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
                cluster = stack.enter_context(tpd.Cluster(folder, workers=n)) if n else None
                for name, (work, _, _) in WORK.items():
                    # Programs are loaded before the time is taken.
                    work(cluster, -1e-9)
                    begun = time.perf_counter()
                    found = work(cluster)
                    seconds.setdefault((name, n), []).append(time.perf_counter() - begun)
                    assert np.array_equal(found, truth[name], equal_nan=True)
                    print(name, n, f"{seconds[name, n][-1]:.2f} s", flush=True)
    for name, (_, count, unit) in WORK.items():
        t = {n: median(seconds[name, n]) for n in (0, 1, 2, 4)}
        row = " | ".join(f"{x:.2f} s" for x in t.values())
        lines.append(f"| {name}, {count} {unit} | {row} | {t[1] / t[2]:.2f} | {t[2] / t[4]:.2f} |")
    return lines


def kills() -> list[str]:
    """Table of what was killed and what came out."""
    rng, truth = np.random.default_rng(1), by_records(None)
    lines = ["| killed | moments | same digits | longest s |", "|---" * 4 + "|"]
    same, longest = 0, 0.0
    for _ in range(KILLS):
        with tempfile.TemporaryDirectory() as folder, tpd.Cluster(folder, workers=2) as cluster:
            victims = list(cluster.client.run(os.getpid).values())
            stop = threading.Timer(rng.uniform(0.0, 8.0), _kill, [victims[rng.integers(2)]])
            stop.start()
            begun = time.perf_counter()
            found = by_records(cluster)
            longest = max(longest, time.perf_counter() - begun)
            stop.cancel()
            same += np.array_equal(found, truth, equal_nan=True)
    lines.append(f"| a worker | {KILLS} | {same} of {KILLS} | {longest:.1f} |")
    print(lines[-1], flush=True)
    same, moments, folder = 0, 0, tempfile.mkdtemp()
    # One sweep after another, each stopped until all moments are used up, and then finished.
    while moments < KILLS:
        shutil.rmtree(folder)
        for _ in range(5):
            process = subprocess.Popen([sys.executable, "-m", "tests.benchmarks.cluster", "sweep", folder])
            try:
                process.wait(rng.uniform(3.0, 9.0))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                moments += 1
        with tpd.Cluster(folder, workers=2) as cluster:
            same += np.array_equal(by_records(cluster), truth, equal_nan=True)
    lines.append(f"| the whole sweep | {moments} | {same} of {same} sweeps | |")
    print(lines[-1], flush=True)
    return lines


def _kill(process: int) -> None:
    os.kill(process, signal.SIGKILL)


def by_jax() -> list[str]:
    """Table of the same map by two processes of `jax.distributed`."""
    out = []
    for wish in ("finish", "killed"):
        with socket.socket() as s:
            s.bind(("127.0.0.1", 0))
            port = s.getsockname()[1]
        command = [sys.executable, "-m", "tests.benchmarks.cluster", "process", str(port)]
        processes = [
            subprocess.Popen([*command, str(i)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            for i in range(2)
        ]
        if wish == "finish":
            text = processes[0].communicate()[0]
            processes[1].communicate()
            (seconds,) = re.findall(r"seconds (\S+)", text)
            out.append(f"| two processes of jax.distributed, map of orbits | {float(seconds):.2f} s |")
        else:
            assert processes[0].stdout is not None
            processes[0].stdout.readline()
            processes[1].kill()
            begun = time.perf_counter()
            try:
                processes[0].communicate(timeout=150)
                ended = f"exit status {processes[0].returncode}"
            except subprocess.TimeoutExpired:
                processes[0].kill()
                processes[0].communicate()
                ended = "still waits after 150 s"
            seconds = f"{time.perf_counter() - begun:.0f} s"
            out.append(f"| the other process after kill -9 of one | {ended} after {seconds} |")
        print(out[-1], flush=True)
    return ["| what | result |", "|---|---|", *out]


def process(port: str, number: str) -> None:
    """One of two processes of `jax.distributed`."""
    jax.distributed.initialize(f"127.0.0.1:{port}", num_processes=2, process_id=int(number))
    from jax.experimental import multihost_utils
    from jax.sharding import Mesh, NamedSharding, PartitionSpec

    from tpd.answers.design_map import _designs
    from tpd.scene.quantities import Setup

    scene = tpd.paper_scene()
    hung = scene.pendulum(mass_ratio=0.1, length_ratio=0.4, damping_ratio=0.1)
    axes = {"mu": np.linspace(0.02, 0.3, 800), "lam": np.linspace(0.1, 1.0, 800)}
    designs = jax.tree.map(np.asarray, _designs(Setup.of(scene, hung), axes))
    mesh = Mesh(np.array(jax.devices()), ("designs",))
    spread = NamedSharding(mesh, PartitionSpec("designs"))

    def solve(p: Any) -> Any:
        # Chunks that fit the cache, one after the other, within each device's share.
        def one(q: Any) -> Any:
            # All of it, as a map takes it: otherwise the compiler would leave most of the work out.
            return jax.tree.leaves(tpd.symmetric_orbits(q))

        return jax.lax.map(one, p, batch_size=128)

    def spread_out(whole: np.ndarray) -> Any:
        return jax.make_array_from_callback(whole.shape, spread, lambda i: whole[i])

    inputs = jax.tree.map(spread_out, designs)
    part = PartitionSpec("designs")
    run = jax.jit(jax.shard_map(solve, mesh=mesh, in_specs=part, out_specs=part, check_vma=False))
    jax.block_until_ready(run(inputs))
    multihost_utils.sync_global_devices("ready")
    print("ready", flush=True)
    times = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        found = run(inputs)
        multihost_utils.process_allgather(found, tiled=True)
        times.append(time.perf_counter() - begun)
    print(f"seconds {median(times)}", flush=True)


PARTS = {"rates": rates, "kills": kills, "jax": by_jax}


def main() -> None:
    if sys.argv[1:2] == ["process"]:
        process(*sys.argv[2:])
        return
    if sys.argv[1:2] == ["sweep"]:
        with tpd.Cluster(sys.argv[2], workers=2) as cluster:
            by_records(cluster)
        return
    for name in sys.argv[1:] or PARTS:
        lines = PARTS[name]()
        made = datetime.now(UTC).strftime("%Y-%m-%d")
        versions = ", ".join(f"{p} {version(p)}" for p in ("tpd", "distributed", "jax"))
        about = f"`python -m tests.benchmarks.cluster {name}`, {made}, two cores, {versions};"
        about += f" medians of {ROUNDS}."
        text = RESULT.read_text() if RESULT.exists() else "# Batches on several processes\n"
        text = re.sub(rf"\n## {name}\n.*?(?=\n## |\Z)", "", text, flags=re.DOTALL)
        RESULT.write_text("\n".join([text.rstrip("\n"), "", f"## {name}", "", about, "", *lines]) + "\n")


if __name__ == "__main__":
    main()
