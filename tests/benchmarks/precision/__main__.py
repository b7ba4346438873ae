"""Error against time, of the steady amplitude and of its gradient, ours and what a user would pick instead.

    .venv/bin/pip install --quiet --editable '.[benchmarks]' && .venv/bin/python -m tests.benchmarks.precision

Writes four pictures into notebooks/pictures, of chosen methods and of all, and tables and all numbers into
tests/benchmarks/results. Takes an hour on two cores, most of it compiling and SciPy; leave the machine alone
meanwhile. `--only` measures some methods, `--draw` only draws what was measured last, and Ctrl-C keeps what
was measured.
"""

import argparse
import datetime
import json
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

from tests.benchmarks.precision import chart  # noqa: E402
from tests.benchmarks.precision.measure import Row, error, first_calls, once, plain, read, warm  # noqa: E402
from tests.benchmarks.precision.methods import Method, Unable  # noqa: E402
from tests.benchmarks.precision.scenes import PENDULUM, SCENES, load  # noqa: E402
from tests.benchmarks.tables import compact  # noqa: E402

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "tests" / "benchmarks" / "results"
PICTURES = ROOT / "notebooks" / "pictures"
PACKAGES = ("tpd", "jax", "diffrax", "numpy", "scipy", "numba", "scikit-sundae", "heyoka", "mujoco")
KEPT = RESULTS / "precision.json"
BATCH, FEW, SHARE = 512, 8, 0.03
"""Designs in the batch, of what is slow, and how far they lie about two of the scenes."""
SLOW = ("SciPy", "SUNDIALS")
"""Methods that take a second a gradient."""


def batch() -> tuple[np.ndarray, np.ndarray]:
    """Designs (n, 8) about the light and the heavy pendulum, and their starts."""
    xs = np.array([SCENES[1 + i % 2].x for i in range(BATCH)])
    xs[:, 1:4] *= np.random.default_rng(0).uniform(1.0 - SHARE, 1.0 + SHARE, (BATCH, 3))
    return xs, np.zeros((BATCH, 4))


def batches(methods: list[Method], rounds: int) -> list[str]:
    """Gradients of a batch: seconds a design, and errors against the Taylor integrator. Of what takes a
    second a design a few are enough, timed once."""
    xs, y0s = batch()
    calls = []
    for method in methods:
        slow = method.name.startswith(SLOW)
        n = FEW if slow else BATCH
        for setting in method.settings[-3:-1] if slow else method.settings:
            if method.batch is None:
                continue
            try:
                call = method.batch(xs[:n], y0s[:n], PENDULUM, setting)
                out, first = once(call)
            except Unable:
                continue
            spent = [first] if slow else [once(call)[1] for _ in range(rounds)]
            calls.append((method, setting, out, float(np.median(spent)) / n))
    # Of another's making, if there is one: ours would agree with itself.
    other = [c for c in calls if c[0].name == "heyoka, Newton"]
    exact, fastest = (other or calls)[-1][2], calls[0][3]
    lines = [
        "| gradients of a batch | designs | us a design | ratio | error: median, 90 % | no answer |",
        "|---" * 6 + "|",
    ]
    for method, setting, out, took in calls:
        errors = [error(o, e) for o, e in zip(out, exact, strict=False)]
        middle, high = np.nanquantile(errors, [0.5, 0.9])
        knob = "" if method.knob == "none" else f", {method.knob} {setting:g}"
        cells = f"{len(out)} | {1e6 * took:.3g} | {took / fastest:.3g} | {middle:.0e}, {high:.0e}"
        lines.append(f"| {method.name}{knob} | {cells} | {np.sum(~np.isfinite(errors))} |")
    return lines


def versions() -> dict[str, str]:
    """Of everything that was run."""
    out = {"python": platform.python_version(), "cores": str(os.cpu_count())}
    for name in PACKAGES:
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "not installed"
    return out


def draw(rows: list[Row], more: list[str], about: dict[str, str]) -> None:
    """Pictures and tables."""
    names = [s.name for s in SCENES]
    chart.save(rows, names, PICTURES)
    text = "\n\n".join(
        (
            ", ".join(f"{k} {v}" for k, v in about.items()),
            chart.tables(rows, names),
            "\n".join(more),
            chart.compiling(rows),
        )
    )
    (RESULTS / "precision.md").write_text(text + "\n")
    print(text)


def stored() -> tuple[list[Row], list[str], dict[str, str]]:
    """What was measured last: rows, the table of batches, and what it stands for."""
    held = json.loads(KEPT.read_text())
    return read(held["rows"]), held["batch"], held["about"]


def main() -> None:
    """Measure, write and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="draw what was measured last")
    parser.add_argument("--only", nargs="+", metavar="WORD", help="methods whose names hold a word")
    parser.add_argument("--sparse", action="store_true", help="every other setting of SciPy and CVODE")
    parser.add_argument("--rounds", type=int, default=5, help="warm runs of everything (default 5)")
    options = parser.parse_args()
    if options.draw:
        draw(*stored())
        return
    from tests.benchmarks.precision.ours import OURS
    from tests.benchmarks.precision.peers import PEERS

    methods = [m for m in (*OURS, *PEERS) if any(w in m.name for w in options.only or [""])]
    if options.sparse:
        methods = [
            m._replace(settings=m.settings[::-2][::-1]) if m.name.startswith(SLOW) else m for m in methods
        ]
    measured = first_calls(methods, SCENES, load())
    warm(measured, options.rounds)
    rows = [row for row, _ in measured]
    more, about = batches(methods, options.rounds), {"date": str(datetime.date.today()), **versions()}
    KEPT.write_text(compact({"about": about, "batch": more, "rows": plain(rows)}))
    draw(rows, more, about)


if __name__ == "__main__":
    main()
