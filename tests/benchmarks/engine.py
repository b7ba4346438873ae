"""The exact engine against what a user would write instead, side by side in one run.

    .venv/bin/pip install --quiet --editable '.[benchmarks]' && .venv/bin/python -m tests.benchmarks.engine

Prints Markdown tables: designs a second and how they grow with the batch, the ratios to SciPy and
Numba, and memory against the chunk size. `--quick` stops at batches of 10^4. Takes some six minutes on two
slow cores; leave the machine alone meanwhile.
"""

import argparse
import datetime
import os
import platform
import statistics
import subprocess
import sys
import time
from importlib.metadata import version

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

from tests.benchmarks import peers  # noqa: E402
from tests.benchmarks.tables import table, timed  # noqa: E402
from tests.reference import HUNG, parameters  # noqa: E402
from tpd import Piecewise, in_chunks, symmetric_orbits  # noqa: E402
from tpd.models.rows import settle_all  # noqa: E402
from tpd.scene.parameters import as_arrays  # noqa: E402

PERIODS = 100
SPREAD = 0.1
"""Share by which mass ratio, length ratio and damping ratio of a batch vary about the known scenes."""
FOREVER = Piecewise(max_periods=PERIODS, tolerance=1e-300, lyapunov_periods=1)
"""Follows all the periods that the others do."""


def batch(n, seed=0):
    """Designs (n, 8) about the known scenes."""
    x = np.ones((n, 8))
    x[:, :7] = np.array([HUNG[i % 4].x for i in range(n)])
    x[:, 1:4] *= np.random.default_rng(seed).uniform(1.0 - SPREAD, 1.0 + SPREAD, (n, 3))
    return x


def describe(x):
    """Amplitudes of all symmetric orbits of a design, their gradients in (mu, lam, zeta), multipliers
    and statuses."""

    def sizes(design):
        o = symmetric_orbits(parameters((x[0], *design, *x[4:])))
        return o.amplitude, (o.amplitude, o.multipliers, o.status)

    return jax.jacfwd(sizes, has_aux=True)(x[1:4])


def growth(sizes):
    """Seconds per batch size, warm."""
    out = {}
    for n in sizes:
        x = batch(n)
        out[n] = timed(lambda x=x: in_chunks(describe, x), 3 if n > 20_000 else 5)
    return out


def scipy_seconds(function, repeats):
    """Median seconds of a call over the four scenes."""
    return statistics.median(timed(lambda c=c: function(c.x)) for _ in range(repeats) for c in HUNG)


def orbits(sizes):
    """Designs a second, and against SciPy's."""
    begun = time.perf_counter()
    in_chunks(describe, batch(4))
    first = time.perf_counter() - begun
    per_scene = scipy_seconds(lambda x: peers.scipy_gradient(x, periods=PERIODS), 1)
    seconds = growth(sizes)
    again = scipy_seconds(lambda x: peers.scipy_gradient(x, periods=PERIODS), 1)
    per_scene = 0.5 * (per_scene + again)
    print(f"\nSciPy: {per_scene:.2f} s a design, amplitude and gradient. First call here: {first:.1f} s.")
    head = ("designs", "seconds", "designs a second", "over SciPy's on all cores", "over SciPy's on one")
    cores = os.cpu_count() or 1
    table(
        head,
        (
            (
                f"{n:,}",
                f"{s:.3g}",
                f"{n / s:,.0f}",
                f"{n / s * per_scene / cores:,.0f}",
                f"{n / s * per_scene:,.0f}",
            )
            for n, s in seconds.items()
        ),
    )


def settling(n):
    """Settling from rest, value only."""
    one = jax.jit(lambda p: FOREVER.settle(p, jnp.zeros(4)).amplitude)
    scenes = [as_arrays(parameters(c.x)) for c in HUNG]
    one(scenes[0])
    ours, theirs = [], []
    for _ in range(3):
        for p, c in zip(scenes, HUNG, strict=True):
            ours.append(timed(lambda p=p: one(p), 5))
            theirs.append(timed(lambda c=c: peers.scipy_settle(c.x, periods=PERIODS)))
    mine, other = statistics.median(ours), statistics.median(theirs)
    rows = [
        ("one scene, `steady_state`'s engine", f"{1e3 * mine:.2f} ms", ""),
        ("one scene, SciPy DOP853 with events", f"{1e3 * other:.0f} ms", f"{other / mine:.1f} times ours"),
    ]
    x = batch(n)
    p, rest = as_arrays(parameters(list(x.T))), np.zeros((n, 4))
    few = jax.tree.map(lambda v: v[:300] if np.ndim(v) else v, p)
    settle_all(few, rest[:300], model=FOREVER)
    peers.numba_settle(x[:4], rest[:4], PERIODS)
    pooled, looped = [], []
    for _ in range(3):
        pooled.append(timed(lambda: settle_all(p, rest, model=FOREVER)))
        looped.append(timed(lambda: peers.numba_settle(x, rest, PERIODS)))
    mine, other = statistics.median(pooled) / n, statistics.median(looped) / n
    settle_all(few, rest[:300])
    stopping = timed(lambda: settle_all(p, rest)) / n
    rows += [
        (f"{n:,} scenes, a run, all {PERIODS} periods", f"{1e6 * mine:.0f} us", ""),
        (f"{n:,} scenes, a run, until the motion repeats", f"{1e6 * stopping:.0f} us", ""),
        (
            f"{n:,} scenes, a run, Numba loop on all cores",
            f"{1e6 * other:.0f} us",
            f"{other / mine:.2f} times ours",
        ),
    ]
    table((f"settling from rest, {PERIODS} periods", "time", "ratio"), rows)


def memory(n):
    """Peak memory of a large batch beyond inputs and results, by chunk size, each in its own process."""
    rows = []
    for chunk in (128, 256, 1024):
        command = [sys.executable, "-m", "tests.benchmarks.engine", "--peak", str(n), str(chunk)]
        peak, held = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
        rows.append((chunk, os.cpu_count(), f"{n:,}", f"{held} MB", f"{peak} MB"))
    table(("chunk", "workers", "designs", "inputs and results", "peak beyond these"), rows)


def peak(n, chunk):
    """Print what `memory` asks for."""
    x = batch(n)
    in_chunks(describe, x[: 2 * chunk], chunk=chunk)
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")  # the peak counts from here
    before = resident("VmRSS")
    held = sum(leaf.nbytes for leaf in jax.tree.leaves(in_chunks(describe, x, chunk=chunk))) / 1e6
    print(round(resident("VmHWM") - before - held), round(held + x.nbytes / 1e6))


def resident(kind):
    """Resident memory of this process now (VmRSS) or at most (VmHWM), in MB."""
    with open("/proc/self/status") as file:
        return next(float(line.split()[1]) / 1e3 for line in file if line.startswith(kind))


def main():
    """Print everything."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--quick", action="store_true")
    options.add_argument("--peak", nargs=2, type=int, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.peak:
        return peak(*given.peak)
    quick = given.quick
    names = ("tpd", "jax", "numpy", "scipy", "numba")
    print(", ".join(f"{name} {version(name)}" for name in names), f"Python {platform.python_version()}")
    print(f"{datetime.date.today()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    sizes = (100, 1_000, 10_000) if quick else (100, 1_000, 10_000, 100_000, 1_000_000)
    orbits(sizes)
    settling(1_000 if quick else 10_000)
    memory(sizes[-1])


if __name__ == "__main__":
    main()
