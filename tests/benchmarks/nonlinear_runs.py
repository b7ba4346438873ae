"""Time of a run of 100 forcing periods by the nonlinear equations: the compiled event loop and diffrax.

    .venv/bin/python -m tests.benchmarks.nonlinear_runs [--runs 64]

The runs are those of the default ensemble of the paper's block. The error is that of the largest tilt, of
runs of ten periods that a change of the start by 1e-9 leaves alone, against a tolerance of 1e-12. The table
stands in `tests/benchmarks/results/nonlinear_runs.md`.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tpd.answers.ensemble import Ensemble, plan  # noqa: E402
from tpd.models.compiled_nonlinear import settle_nonlinear  # noqa: E402

RESULT = Path(__file__).parent / "results" / "nonlinear_runs.md"
PERIODS = 100
HUNG = tpd.Pendulum(mass=3.2448, length=0.203, damping_ratio=0.1)
SCENES = {
    "the paper's block, hung": (tpd.paper_scene(), HUNG),
    "the paper's block, bare": (tpd.paper_scene(), None),
}
FIRST = (
    "import jax; jax.config.update('jax_enable_x64', True); import time, numpy, tpd; "
    "from tpd.models.compiled_nonlinear import settle_nonlinear; p = tpd.paper_scene().parameters(); "
    "begin = time.perf_counter(); settle_nonlinear(p, numpy.zeros((1, 4))); "
    "print(time.perf_counter() - begin)"
)


def spent(work):
    """Processor milliseconds of a call."""
    begin = time.process_time()
    work()
    return 1e3 * (time.process_time() - begin)


def compiled(runs, n):
    """Times (ms) of single runs in one thread, each in a call of its own."""

    def follow(i):
        row = jax.tree.map(lambda x: np.asarray(x)[i : i + 1], runs.p)
        settle_nonlinear(row, runs.y0[i : i + 1], periods=PERIODS, workers=1)

    follow(0)
    return np.array([spent(lambda i=i: follow(i)) for i in range(n)])


def segmented(runs, n):
    """Times (ms) of single runs of `Segmented` with the same tolerance, without compiling."""
    follow = eqx.filter_jit(tpd.Segmented(rtol=1e-8, tolerance=1e-6, max_periods=PERIODS).settle)
    rows = [
        (jax.tree.map(lambda x, i=i: jnp.asarray(x)[i], runs.p), jnp.asarray(runs.y0[i])) for i in range(n)
    ]
    jax.block_until_ready(follow(*rows[0]))
    return np.array([spent(lambda r=r: jax.block_until_ready(follow(*r))) for r in rows])


def error(runs, n):
    """Largest error of the largest tilt after ten periods (rad)."""
    p, y0 = jax.tree.map(lambda x: np.asarray(x)[:n], runs.p), runs.y0[:n]
    ours, near, tight = (
        settle_nonlinear(p, y0 + moved, periods=10, rtol=rtol).peak
        for moved, rtol in ((0.0, 1e-8), (1e-9, 1e-8), (0.0, 1e-12))
    )
    with np.errstate(invalid="ignore"):
        calm = np.abs(ours - near) < 1e-7
        return np.max(np.abs(ours - tight)[calm])


def first_calls():
    """Seconds of the first call of a process, with nothing stored and then with machine code stored."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-c", FIRST]
        calls = (subprocess.run(command, env=environment, capture_output=True, check=True) for _ in range(2))
        return [float(c.stdout) for c in calls]


def ensemble():
    """Seconds of a verdict on the default ensemble, both sides."""
    begin = time.perf_counter()
    tpd.verdict(tpd.paper_scene(), HUNG, ensemble=Ensemble(), equations="nonlinear")
    return time.perf_counter() - begin


def main():
    """Measure, print and store the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--runs", type=int, default=64, help="of each scene (64)")
    n = options.parse_args().runs
    packages = ", ".join(f"{name} {version(name)}" for name in ("jax", "diffrax", "numba", "numpy"))
    day = time.strftime("%Y-%m-%d")
    lines = [
        f"`python -m tests.benchmarks.nonlinear_runs --runs {n}`, {packages}, {day}, two busy cores.",
        f"Processor time of one thread for a run of {PERIODS} periods at most, median and 90 % of the runs;",
        "relative tolerance 1e-8. Reach: 5 ms.",
        "",
        "| scene | compiled loop (ms) | error of the largest tilt (rad) | `Segmented` (ms) | ratio |",
        "|---|---|---|---|---|",
    ]
    for name, (scene, pendulum) in SCENES.items():
        runs = plan(scene.parameters(pendulum), Ensemble(), scene.rate)
        ours, theirs = compiled(runs, n), segmented(runs, n)
        a, b = (np.quantile(x, (0.5, 0.9)) for x in (ours, theirs))
        line = f"| {name} | {a[0]:.2f}, {a[1]:.2f} | {error(runs, n):.1e} | {b[0]:.1f}, {b[1]:.1f} "
        lines.append(f"{line}| {b[0] / a[0]:.0f} |")
    cold, warm = first_calls()
    lines += [
        "",
        f"First call of a process: {cold:.1f} s where it compiles, {warm:.1f} s with stored machine code.",
        f"A verdict on the default ensemble (2 × 512 runs, two threads): {ensemble():.1f} s.",
    ]
    print("\n".join(lines))
    RESULT.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
