"""How the time grows: with designs, parameters, periods followed, tolerance and cores.

    .venv/bin/pip install --quiet --editable '.[benchmarks]' && .venv/bin/python -m tests.benchmarks.growth

Medians of interleaved repeats, warm, and the exponent fitted over the sizes named: the slope of log(time)
over log(size). Prints a Markdown table, writes `results/growth.json` and draws `growth.png`. About four
minutes on two idle cores, most of it compiling; leave the machine alone meanwhile. `--quick` takes smaller
sizes, and `--draw` what is stored.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator

jax.config.update("jax_enable_x64", True)

from tests.benchmarks.engine import batch, describe  # noqa: E402
from tests.benchmarks.tables import compact, table, timed  # noqa: E402
from tests.reference import HUNG, parameters  # noqa: E402
from tpd import Piecewise, Smoothed, in_chunks, simulate, symmetric_orbits  # noqa: E402
from tpd.core.files import as_json, place, versions  # noqa: E402
from tpd.models.compiled_linear import settle  # noqa: E402
from tpd.models.rows import settle_all  # noqa: E402
from tpd.plot import style as canvas  # noqa: E402
from tpd.scene.parameters import as_arrays  # noqa: E402

COMMAND = "python -m tests.benchmarks.growth"
RESULTS = Path(__file__).with_name("results") / "growth.json"
PICTURE = Path(__file__).parents[2] / "notebooks" / "pictures" / "growth.png"
REPEATS = 5
ENDLESS = 1e-300
"""A tolerance that no motion meets, so that all periods are followed."""

Work = Callable[[], Any]


class Growth(NamedTuple):
    """Work by the size of something."""

    what: str
    over: str
    """What the size is of, with its unit."""
    calls: dict[float, Work]
    fitted: tuple[float, float]
    """Sizes between which the exponent is fitted."""


def designs(quick: bool) -> Growth:
    """All symmetric orbits with their gradients, in chunks."""
    sizes = (1, 10, 100, 1_000, 10_000) if quick else (1, 10, 100, 1_000, 10_000, 100_000)
    rows = {n: batch(n) for n in sizes}
    calls: dict[float, Work] = {n: lambda x=x: in_chunks(describe, x) for n, x in rows.items()}
    return Growth("symmetric orbits, gradient in 3", "designs (-)", calls, (1e3, 1e5))


def slopes(quick: bool) -> tuple[Growth, Growth]:
    """Their gradient in the first few parameters, forward; and in all of them, reverse, of one amplitude."""
    x = batch(512 if quick else 2048)

    def largest(head: jax.Array, tail: jax.Array) -> jax.Array:
        return symmetric_orbits(parameters(jnp.concatenate([head, tail]))).amplitude[0]

    def forward(count: int) -> Work:
        one = jax.jacfwd(largest)
        function = lambda x: one(x[:count], x[count:])  # noqa: E731
        return lambda: in_chunks(function, x)

    def reverse(x: jax.Array) -> jax.Array:
        return jax.grad(largest)(x, x[:0])

    counts = (1, 8) if quick else (1, 2, 4, 8)
    ahead = Growth(f"{len(x)} designs, forward", "parameters (-)", {n: forward(n) for n in counts}, (1, 8))
    back = Growth(f"{len(x)} designs, reverse", "parameters (-)", {8: lambda: in_chunks(reverse, x)}, (8, 8))
    return ahead, back


def periods(quick: bool) -> tuple[Growth, Growth]:
    """Following one motion by events, and `simulate` at 65 times."""
    p, model = as_arrays(parameters(HUNG[0].x)), Piecewise(tolerance=ENDLESS)
    counts = (8, 32, 128) if quick else (8, 32, 128, 512)
    follow = jax.jit(lambda n: settle(p, jnp.zeros(4), n, model.max_events, ENDLESS, model.rest_rate).peak)
    times = {n: jnp.linspace(0.0, 1.0, 65) * n * p.period for n in counts}
    by_events: dict[float, Work] = {n: lambda n=n: follow(jnp.asarray(n)) for n in counts}
    sampled: dict[float, Work] = {n: lambda t=t: simulate(p, jnp.zeros(4), t).ys for n, t in times.items()}
    unit, fitted = "forcing periods (-)", (32, 512)
    return Growth("Piecewise followed", unit, by_events, fitted), Growth("simulate", unit, sampled, fitted)


class Loose(Smoothed):
    """`Smoothed` of any solver tolerance, compiled once for all; follows 40 periods, settled or not."""

    rtol: Array = eqx.field(kw_only=True)
    tolerance: float = eqx.field(default=ENDLESS, static=True, kw_only=True)
    max_periods: int = eqx.field(default=40, static=True, kw_only=True)


class Patient(Piecewise):
    """`Piecewise` of any tolerance of repetition."""

    tolerance: Array = eqx.field(kw_only=True)


def tolerances(quick: bool) -> tuple[Growth, Growth]:
    """All four known scenes from rest: smoothed by the solver's tolerance, exact by the repetition's."""
    rows = (1e-4, 1e-6, 1e-8) if quick else (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
    scenes = [as_arrays(parameters(case.x)) for case in HUNG]

    def calls(model: Callable) -> dict[float, Work]:
        settle = jax.jit(lambda p, tolerance: model(tolerance).settle(p, jnp.zeros(4)).y)
        return {t: lambda t=t: [settle(p, jnp.asarray(t)) for p in scenes] for t in rows}

    span = (rows[-1], rows[0])
    return (
        Growth("Smoothed, 40 periods", "rtol (-)", calls(lambda t: Loose(rtol=t)), span),
        Growth("Piecewise until settled", "tolerance (-)", calls(lambda t: Patient(tolerance=t)), span),
    )


def cores(quick: bool) -> tuple[Growth, Growth]:
    """A batch on one core and on two."""
    x = batch(2_000 if quick else 20_000)
    y = x[: 500 if quick else 2_000]
    p, rest = as_arrays(parameters(list(y.T))), np.zeros((len(y), 4))
    orbits: dict[float, Work] = {n: lambda n=n: in_chunks(describe, x, workers=n) for n in (1, 2)}
    settled: dict[float, Work] = {n: lambda n=n: settle_all(p, rest, workers=n) for n in (1, 2)}
    return (
        Growth(f"in_chunks, {len(x)} designs", "workers (-)", orbits, (1, 2)),
        Growth(f"settle_all, {len(y)} motions", "workers (-)", settled, (1, 2)),
    )


def measured(growth: Growth, repeats: int) -> dict[str, Any]:
    """Median seconds by size, the sizes taking turns, and the exponent."""
    for call in growth.calls.values():
        timed(call)
    seconds: dict[float, list[float]] = {size: [] for size in growth.calls}
    for _ in range(repeats):
        for size, call in growth.calls.items():
            seconds[size].append(timed(call))
    sizes = list(growth.calls)
    medians = [statistics.median(seconds[size]) for size in sizes]
    spread = [max(seconds[size]) / min(seconds[size]) for size in sizes]
    use = [i for i, size in enumerate(sizes) if growth.fitted[0] <= size <= growth.fitted[1]]
    logs = np.log([[sizes[i], medians[i]] for i in use])
    exponent = float(np.polyfit(*logs.T, 1)[0]) if len(use) > 1 else float("nan")
    return {
        "what": growth.what,
        "over": growth.over,
        "sizes": [float(size) for size in sizes],
        "seconds": medians,
        "spread": spread,
        "exponent": exponent,
        "fitted": [float(sizes[use[0]]), float(sizes[use[-1]])],
    }


def told(results: dict[str, Any]) -> None:
    """Print the table."""
    print(results["command"], results["date"], results["versions"])
    print(f"{results['cores']} cores, load {results['load']:.1f} before, {results['repeats']} repeats")
    rows = []
    for r in results["rows"]:
        each = ", ".join(f"{s:g}: {t:.3g} s" for s, t in zip(r["sizes"], r["seconds"], strict=True))
        low, high = r["fitted"]
        fit = "" if isinstance(r["exponent"], str) else f"{r['exponent']:.2f} ({low:g} to {high:g})"
        rows.append((r["what"], r["over"], each, fit, f"{max(r['spread']):.2f}"))
    table(("work", "over", "median time by size", "exponent (fitted over)", "largest over least"), rows)


def draw(results: dict[str, Any], path: Path) -> None:
    """Time over size, a panel for each thing that grows."""
    panels: dict[str, list[dict[str, Any]]] = {}
    for r in results["rows"]:
        panels.setdefault("tolerance (-)" if "tol" in r["over"] else r["over"], []).append(r)
    figure = Figure(figsize=(9.0, 2.9 * -(-len(panels) // 2)), layout="constrained", dpi=110)
    FigureCanvasAgg(figure)
    axes = figure.subplots(-(-len(panels) // 2), 2).ravel()
    for ax in axes[len(panels) :]:
        ax.set_axis_off()
    styles = ((canvas.INK, "-", "o"), (canvas.BLUE, (0, (5, 2)), "s"))
    for ax, (over, rows) in zip(axes, panels.items(), strict=False):
        for r, (color, line, mark) in zip(rows, styles, strict=False):
            known = not isinstance(r["exponent"], str)
            label = f"{r['what']}: exponent {r['exponent']:.2f}" if known else r["what"]
            ax.plot(
                r["sizes"], r["seconds"], color=color, ls=line, marker=mark, ms=5, mfc="white", label=label
            )
        ax.set(xscale="log", yscale="log", xlabel=over, ylabel="time (s)")
        every = [seconds for r in rows for seconds in r["seconds"]]
        ax.set_ylim(10.0 ** np.floor(np.log10(min(every))), 10.0 ** np.ceil(np.log10(2.0 * max(every))))
        ax.yaxis.set_minor_formatter(NullFormatter())
        sizes = rows[0]["sizes"]
        if max(sizes) < 10.0 * min(sizes):
            ax.set_xticks(sizes, [f"{size:g}" for size in sizes])
            ax.xaxis.set_minor_locator(NullLocator())
        ax.grid(color="#e5e5e5", lw=0.6)
        ax.legend(fontsize=8, loc="best")
    place(path, canvas.png(figure))


def main() -> None:
    """Measure, print and draw."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--quick", action="store_true", help="smaller sizes, nothing stored")
    options.add_argument("--draw", action="store_true", help="what is stored, without measuring")
    given = options.parse_args()
    if given.draw:
        results = json.loads(RESULTS.read_text())
    else:
        load, repeats = os.getloadavg()[0], 2 if given.quick else REPEATS
        works = (designs, slopes, periods, tolerances, cores)
        found = (growth for work in works for growth in _all(work(given.quick)))
        results = {
            "command": COMMAND,
            "date": str(datetime.date.today()),
            "versions": versions(),
            "cores": os.cpu_count(),
            "load": load,
            "repeats": repeats,
            "rows": [measured(growth, repeats) for growth in found],
        }
        results = json.loads(as_json(results))
    told(results)
    if not given.quick:
        place(RESULTS, compact(results))
        draw(results, PICTURE)


def _all(growths: Growth | tuple[Growth, ...]) -> tuple[Growth, ...]:
    return (growths,) if isinstance(growths, Growth) else growths


if __name__ == "__main__":
    main()
