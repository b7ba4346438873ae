"""What smoothing the signs costs in accuracy, and where its solvers fail: `Smoothed` against the exact model.

    .venv/bin/python -m tests.benchmarks.bias

Both smoothed signs together, and each alone, the other being next to sharp. Every error is that of the orbit
near the exact one, so that no transient ends elsewhere; what happens from the scene's own start is counted
apart, by solver. Prints Markdown tables, writes `results/bias.json` and draws `bias.png`; `--draw` draws and
prints the stored results anew. Five minutes on one core.
"""

from __future__ import annotations

import argparse
import datetime
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

jax.config.update("jax_enable_x64", True)

from tests.benchmarks.engine import table  # noqa: E402
from tests.counting import counted  # noqa: E402
from tests.reference import MOVING, STILL, Case, exact, parameters  # noqa: E402
from tpd import Parameters, Smoothed, canvas, status_name, steady_state  # noqa: E402
from tpd.files import as_json, place, versions  # noqa: E402
from tpd.models.smoothed import rocking_scale  # noqa: E402
from tpd.parameters import Number  # noqa: E402

COMMAND = "python -m tests.benchmarks.bias"
RESULTS = Path(__file__).with_name("results") / "bias.json"
PICTURE = Path(__file__).parents[2] / "notebooks" / "pictures" / "bias.png"

DEFAULT = Smoothed().sharpness
SHARP = 1e-9
"""Width, as a share like `sharpness`, of a sign that is to be next to sharp."""
SHARES = tuple(float(x) for x in np.geomspace(1e-6, 1e-1, 21))
"""Widths over the expected tilt, and over xi times it."""
WAYS = {
    "together": lambda e: (e, e),
    "tilt alone": lambda e: (e, SHARP),
    "rate alone": lambda e: (SHARP, e),
}
"""Which signs are smoothed: (tilt, rate) by a width."""
FITTED = (1e-5, 1e-2)
"""Range of the widths over which slopes are fitted."""
FLOORS = {"amplitude": 1e-9, "gradient": 1e-8}
"""Relative errors below which integration counts, which works to 1e-12 of what varies."""
SOLVERS = {"Tsit5": diffrax.Tsit5(), "Dopri8": diffrax.Dopri8(), "Kvaerno5": diffrax.Kvaerno5()}
FAR = tuple(float(x) for x in 10.0 ** np.arange(-1.0, -12.5, -0.5))
"""Widths at which the solvers are tried, on from where `Smoothed` refuses."""
SAME = 0.05
"""Relative distance of the amplitude up to which it is that of the same motion."""


class Widths(Smoothed):
    """`Smoothed` with two widths of any size, compiled once for all of them."""

    shares: Float[Array, "2"] = eqx.field(kw_only=True)
    """Of tilt and rate, as `sharpness` is of both."""

    def widths(self, p: Parameters) -> tuple[Number, Number]:
        """See `Smoothed`."""
        scale = rocking_scale(p)
        return self.shares[0] * scale, self.shares[1] * p.xi * scale


def solver(method: diffrax.AbstractSolver) -> Callable[..., tuple[float, np.ndarray, str, int]]:
    """From a scene, a start and shares: amplitude, its gradient, status and periods followed."""

    @jax.jit
    def run(x: Array, y0: Array, shares: Array) -> Any:
        def amplitude(x: Array) -> tuple[Array, Any]:
            steady = steady_state(parameters(x), model=Widths(shares=shares, solver=method), y0=y0)
            return steady.amplitude, (steady.amplitude, steady.status, steady.elapsed)

        return jax.jacrev(amplitude, has_aux=True)(x)

    def solve(x: Any, y0: Any, shares: Any) -> tuple[float, np.ndarray, str, int]:
        slopes, (amplitude, status, elapsed) = run(np.array(x), np.array(y0), np.array(shares))
        return float(amplitude), np.asarray(slopes), status_name(status), int(elapsed)

    return solve


def errors(cases: tuple[Case, ...], shares: tuple[float, ...]) -> dict[str, Any]:
    """Of every scene and way: relative errors of amplitude and gradient (of its largest component) by width,
    NaN where there is no orbit near the exact one."""
    solve, out = solver(diffrax.Tsit5()), {}
    for case in cases:
        truth = exact(case.x, case.y0)
        state, size = np.asarray(truth.steady.state), np.abs(truth.slopes[0]).max()
        out[case.name] = {}
        for way, pair in WAYS.items():
            rows = []
            for share in shares:
                amplitude, slopes, status, _ = solve(case.x, state, pair(share))
                off = abs(amplitude / truth.amplitude - 1.0)
                tilted = float(np.abs(slopes - truth.slopes[0]).max() / size)
                rows.append((off, tilted) if status == "rocking" and off < 0.5 else (np.nan, np.nan))
            columns = zip(FLOORS, zip(*rows, strict=True), strict=True)
            out[case.name][way] = {name: [float(v) for v in column] for name, column in columns}
    return out


def slope(shares: Any, error: Any, floor: float) -> float:
    """d log(error) / d log(width) where it is neither coarse nor that of the integration."""
    shares, error = np.array(shares, float), np.array(error, float)
    with np.errstate(invalid="ignore"):
        use = (shares >= FITTED[0]) & (shares <= FITTED[1]) & (error > floor)
    return float(np.polyfit(np.log(shares[use]), np.log(error[use]), 1)[0]) if use.sum() >= 4 else np.nan


def starts(cases: tuple[Case, ...], shares: tuple[float, ...]) -> dict[str, Any]:
    """Of every solver and scene, from its own start: status, solver steps in all and in the worst period, and
    whether the motion is the exact one's, by width."""
    out: dict[str, Any] = {}
    for name, method in SOLVERS.items():
        solve = solver(method)
        with counted() as steps:

            @jax.jit
            def follow(x: Array, y0: Array, shares: Array, method: Any = method) -> Array:
                return Widths(shares=shares, solver=method).settle(parameters(x), y0).amplitude

            for case in cases:
                truth = exact(case.x, case.y0)
                rows = []
                for share in shares:
                    pair = np.array(WAYS["together"](share))
                    jax.block_until_ready(follow(np.array(case.x), np.array(case.y0), pair))
                    taken = steps.taken()
                    amplitude, _, status, periods = solve(case.x, case.y0, pair)
                    same = status == truth.status and abs(amplitude - truth.amplitude) <= SAME * amplitude
                    rows.append(
                        {
                            "width": share,
                            "status": status,
                            "finite": bool(np.isfinite(amplitude)),
                            "same": bool(same),
                            "periods": periods,
                            "steps": sum(taken),
                            "worst": max(taken),
                        }
                    )
                out.setdefault(name, {})[case.name] = rows
    return out


def told(results: dict[str, Any]) -> None:
    """Print the tables."""
    print(results["command"], results["date"], results["versions"])
    shares, apart = results["shares"], results["errors"]
    head = ("scene", *(f"{q}, {way}" for q in FLOORS for way in WAYS))
    rows = []
    for scene, ways in apart.items():
        fits = (slope(shares, ways[way][q], floor) for q, floor in FLOORS.items() for way in WAYS)
        rows.append((scene, *(f"{s:.2f}" for s in fits)))
    print("\nSlope of log(error) over log(width):")
    table(head, rows)
    print("\nLargest relative error over the scenes, by width:")
    rows = []
    for i, share in enumerate(shares):
        worst = (max(w[way][q][i] for w in apart.values()) for q in FLOORS for way in WAYS)
        rows.append((f"{share:.2e}", *(f"{v:.1e}" for v in worst)))
    table(("width", *head[1:]), rows)
    print("\nFrom the scene's own start (steps until settled, in all; most in a period; bound 4096):")
    for name, scenes in results["starts"].items():
        print(f"\n{name}")
        first = next(iter(scenes.values()))
        rows = []
        for i, row in enumerate(first):
            cells = (_cell(of[i]) for of in scenes.values())
            rows.append((f"{row['width']:.1e}", *cells))
        table(("width", *scenes), rows)


def _cell(row: dict[str, Any]) -> str:
    ends = row["status"] if row["same"] else f"{row['status']} (other)"
    return f"{ends}: {row['steps']}, {row['worst']}"


def draw(results: dict[str, Any], path: Path) -> None:
    """Errors over the width: a line a scene, thick their median."""
    axes = canvas.new_axes(2, (7.0, 7.4))
    styles = {
        "together": (canvas.INK, "-", 2.4),
        "tilt alone": (canvas.BLUE, (0, (5, 2)), 2.0),
        "rate alone": (canvas.ORANGE, (0, (1, 1)), 2.4),
    }
    shares = np.array(results["shares"])
    for ax, quantity in zip(axes, FLOORS, strict=True):
        for way, (color, style, width) in styles.items():
            lines = np.array([w[way][quantity] for w in results["errors"].values()], float)
            for line in lines:
                ax.plot(shares, line, color=color, ls=style, lw=0.6, alpha=0.45)
            ax.plot(shares, np.nanmedian(lines, axis=0), color=color, ls=style, lw=width, label=way)
        for power, at in ((1, 1e-4), (2, 1e-3)):
            x = np.array([at, 10.0 * at])
            y = 0.02 * (x / 0.1) ** power * (4.0 if power == 1 else 1.0)
            del y
        ax.axvline(DEFAULT, color=canvas.GREY, lw=1.0, zorder=0)
        ax.text(1.12 * DEFAULT, 0.03, "default", color="#555555", fontsize=8, transform=ax.get_xaxis_transform())
        ax.set(xscale="log", yscale="log", ylabel=f"relative error of the {quantity} (-)")
        ax.grid(color="#e5e5e5", lw=0.6)
    axes[0].legend(title="signs smoothed; thin: each scene, thick: median", fontsize=8, title_fontsize=8)
    axes[-1].set_xlabel(r"smoothing width $\varepsilon$ over the expected tilt, and rate over its (-)")
    place(path, canvas.png(axes[0].figure))


def main() -> None:
    """Measure, print and draw."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--draw", action="store_true", help="what is stored, without measuring")
    if not options.parse_args().draw:
        results = {
            "command": COMMAND,
            "date": str(datetime.date.today()),
            "versions": versions(),
            "default": DEFAULT,
            "shares": SHARES,
            "errors": errors(MOVING, SHARES),
            "starts": starts((*MOVING, STILL), FAR),
        }
        place(RESULTS, as_json(results))
    results = json.loads(RESULTS.read_text())
    told(results)
    draw(results, PICTURE)


if __name__ == "__main__":
    main()
