"""What smoothing the signs costs in accuracy, and where its solvers fail: `Smoothed` against the exact model.

    .venv/bin/python -m tests.benchmarks.bias

Both smoothed signs together, and each alone, the other being next to sharp. Every error is that of the orbit
near the exact one, so that no transient ends elsewhere; what happens from the scene's own start is counted
apart, by solver. Prints Markdown tables, writes `results/bias.json` and draws `bias.png`; `--draw` draws and
prints the stored results anew. `--impacts` measures scenes with impacts only and keeps the rest of what is
stored; `bias-impacts.png` shows them. Eight minutes on one core.
"""

from __future__ import annotations

import argparse
import datetime
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import diffrax
import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float

jax.config.update("jax_enable_x64", True)

from tests.benchmarks.ladder import scenes  # noqa: E402
from tests.benchmarks.tables import compact, table  # noqa: E402
from tests.counting import counted  # noqa: E402
from tests.reference import BARE, HUNG, MOVING, STILL, Case, exact, parameters  # noqa: E402
from tpd import Parameters, Smoothed, status_name, steady_state  # noqa: E402
from tpd.core.files import as_json, place, versions  # noqa: E402
from tpd.models.smoothed import rocking_scale  # noqa: E402
from tpd.plot import style as canvas  # noqa: E402
from tpd.scene.parameters import Number  # noqa: E402
from tpd.scene.status import SETTLED  # noqa: E402

COMMAND = "python -m tests.benchmarks.bias"
RESULTS = Path(__file__).with_name("results") / "bias.json"
PICTURE = Path(__file__).parents[2] / "notebooks" / "pictures" / "bias.png"
PICTURE_OF_IMPACTS = PICTURE.with_name("bias-impacts.png")

DEFAULT = Smoothed().sharpness
SHARP = 1e-5
"""Width, as a share like `sharpness`, of a sign that is to be next to sharp. Much below it the sensitivities
in its layer are no longer resolved, see the gradients of `together`."""
SHARES = tuple(float(x) for x in np.geomspace(1e-9, 1e-1, 17))
"""Widths over the expected tilt, and over xi times it."""
WAYS = {
    "together": lambda e: (e, e),
    "tilt alone": lambda e: (e, SHARP),
    "rate alone": lambda e: (SHARP, e),
}
"""Which signs are smoothed: (tilt, rate) by a width."""
FITTED = {"together": (1e-4, 1e-2), "tilt alone": (3e-3, 1e-1), "rate alone": (1e-4, 1e-2)}
"""Range of the widths over which slopes are fitted."""
FLOORS = {"amplitude": 1e-9, "gradient": 1e-6}
"""Relative errors below which integration counts."""
SOLVERS = {"Tsit5": diffrax.Tsit5(), "Dopri8": diffrax.Dopri8(), "Kvaerno5": diffrax.Kvaerno5()}
FAR = tuple(float(x) for x in 10.0 ** np.arange(-1.0, -10.5, -1.0))
"""Widths at which the solvers are tried, on from where `Smoothed` refuses."""
TRIED = (HUNG[0], HUNG[3], BARE[1], STILL)
_LABELLED = 14
"""Which of the widths carries the slopes' names."""
SAME = 0.05
"""Relative distance of the amplitude up to which it is that of the same motion."""
RULES = ((1.0, 1.0), (5.0, 5.0), (10.0, 1.0), (3.0, 1.0), (10.0, 0.1), (3.0, 0.1), (1.0, 0.1), (0.1, 0.1))
"""Other rules for the widths of tilt and rate, over the default's."""
RATIOS = (1.0, 0.8, 0.5)
"""Velocity ratios of impacts with which the scenes with a pendulum are measured."""
STRUCK_SHARES = tuple(float(x) for x in np.geomspace(1e-5, 1e-1, 9))
REPEATS = 3
"""Runs of which the median time counts."""
DRAWN = 56
"""Seeded scenes. In those that settle or overturn the motion from rest is compared with the exact one."""


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


def follower(method: diffrax.AbstractSolver) -> Callable[..., tuple[int, int]]:
    """From a scene, a start and shares: solver steps until settled, in all and in the worst period."""
    first = np.array(HUNG[0].x), np.zeros(4), np.full(2, DEFAULT)
    with counted() as steps:

        def settled(x: Array, y0: Array, shares: Array) -> Array:
            return Widths(shares=shares, solver=method).settle(parameters(x), y0).amplitude

        compiled = jax.jit(settled).lower(*first).compile()

    def follow(x: Any, y0: Any, shares: Any) -> tuple[int, int]:
        steps.taken()
        jax.block_until_ready(compiled(*(np.array(v, float) for v in (x, y0, shares))))
        taken = steps.taken()
        return sum(taken), max(taken)

    return follow


def errors(solve: Callable, cases: tuple[Case, ...]) -> dict[str, Any]:
    """Of every scene and way: relative errors of amplitude and gradient (of its largest component) by width,
    NaN where there is no orbit near the exact one, or where a sign alone is not asked for. What the tilt does
    alone is told from what the other sign's rest of a width does by comparing at that width."""
    out: dict[str, Any] = {}
    for case in cases:
        truth = exact(case.x, case.y0)
        state, size = np.asarray(truth.steady.state), np.abs(truth.slopes[0]).max()
        both_sharp = solve(case.x, state, (SHARP, SHARP))[:2]
        out[case.name] = {}
        for way, pair in WAYS.items():
            amplitude, slopes = both_sharp if way == "tilt alone" else (truth.amplitude, truth.slopes[0])
            rows = []
            for share in SHARES:
                if way != "together" and share < 2.0 * SHARP:
                    rows.append((np.nan, np.nan))
                    continue
                found, tilted, status, _ = solve(case.x, state, pair(share))
                near = status == "rocking" and abs(found / truth.amplitude - 1.0) < 0.5
                row = abs(found / amplitude - 1.0), float(np.abs(tilted - slopes).max() / size)
                rows.append(row if near else (np.nan, np.nan))
            columns = zip(FLOORS, zip(*rows, strict=True), strict=True)
            out[case.name][way] = {name: [float(v) for v in column] for name, column in columns}
    return out


def impacts(solve: Callable) -> dict[str, Any]:
    """Of scenes with a pendulum by e: relative errors of amplitude and gradient (of its largest component) of
    the orbit near the exact one by width, those of the extrapolation 2 a(w/2) - a(w), and the warm times (s)
    of value and gradient from the scene's own start; NaN where there is no such orbit."""
    out: dict[str, Any] = {}
    for e in RATIOS:
        of = out[f"e = {e:g}"] = {}
        for case in HUNG:
            x = (*case.x, e)
            truth = exact(x, case.y0)
            state, size = np.asarray(truth.steady.state), np.abs(truth.slopes[0]).max()
            rows = []
            for share in STRUCK_SHARES:
                (a, by), (b, by_half) = (_near(solve, x, state, w) for w in (share, 0.5 * share))
                row = []
                for c, slopes in ((a, by), (2.0 * b - a, 2.0 * by_half - by)):
                    apart = np.abs(slopes - truth.slopes[0]).max() / size
                    row += [abs(c / truth.amplitude - 1.0), float(apart)]
                spent = [_seconds(solve, x, case.y0, w) for w in (share, 0.5 * share)]
                rows.append((*row, spent[0], sum(spent)))
            names = ("amplitude", "gradient", "amplitude, both", "gradient, both", "seconds", "seconds, both")
            of[case.name] = {
                n: [float(v) for v in c] for n, c in zip(names, zip(*rows, strict=True), strict=True)
            }
    return out


def _near(solve: Callable, x: Any, state: Any, share: float) -> tuple[float, np.ndarray]:
    """Amplitude and gradient of the orbit next to an exact one, NaN without."""
    amplitude, slopes, status, _ = solve(x, state, (share, share))
    return (amplitude, slopes) if status == "rocking" else (np.nan, np.full_like(slopes, np.nan))


def _seconds(solve: Callable, x: Any, y0: Any, share: float) -> float:
    spent = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        solve(x, y0, (share, share))
        spent.append(time.perf_counter() - begin)
    return float(np.median(spent))


def slope(way: str, quantity: str, error: Any) -> float:
    """d log(error) / d log(width) where it is neither coarse nor that of the integration."""
    shares, error = np.array(SHARES), np.array(error, float)
    low, high = FITTED[way]
    with np.errstate(invalid="ignore"):
        use = (shares > 0.9 * low) & (shares < 1.1 * high) & (error > FLOORS[quantity])
    return float(np.polyfit(np.log(shares[use]), np.log(error[use]), 1)[0]) if use.sum() >= 3 else np.nan


def starts() -> dict[str, Any]:
    """Of every solver and scene, from its own start: how it ends by width, see `_started`."""
    out: dict[str, Any] = {}
    for name, method in SOLVERS.items():
        solve, follow = solver(method), follower(method)
        out[name] = {c.name: [_started(solve, follow, c, (w, w)) for w in FAR] for c in TRIED}
    return out


def _started(solve: Callable, follow: Callable, case: Case, shares: tuple[float, float]) -> dict[str, Any]:
    """Status, whether it and the motion are the exact one's, errors, periods, and solver steps."""
    truth = exact(case.x, case.y0)
    amplitude, slopes, status, periods = solve(case.x, case.y0, shares)
    steps, worst = follow(case.x, case.y0, shares)
    off = abs(amplitude - truth.amplitude) / (truth.amplitude or 1.0)
    tilted = np.abs(slopes - truth.slopes[0]).max() / (np.abs(truth.slopes[0]).max() or 1.0)
    return {
        "status": status,
        "same": bool(status == truth.status and (status == "overturned" or off <= SAME)),
        "amplitude": float(off),
        "gradient": float(tilted),
        "periods": periods,
        "steps": steps,
        "worst": worst,
    }


def rules(solve: Callable) -> list[dict[str, Any]]:
    """What other rules for the two widths do: errors and steps in the known scenes, and in how many random
    ones the motion from rest is the exact one."""
    follow = follower(diffrax.Tsit5())
    random = [Case("", tuple(float(v) for v in x), 0.0, ()) for x in scenes()[:DRAWN]]
    random = [c for c in random if exact(c.x).status in (*SETTLED, "overturned")]
    out = []
    for pair in RULES:
        shares = pair[0] * DEFAULT, pair[1] * DEFAULT
        known = [_started(solve, follow, case, shares) for case in (*MOVING, STILL)]
        met = [_started(solve, follow, case, shares) for case in random]
        moving = [r for r in known[:-1] if r["same"]]
        out.append(
            {
                "tilt": shares[0],
                "rate": shares[1],
                "lost": [c.name for c, r in zip((*MOVING, STILL), known, strict=True) if not r["same"]],
                "drawn": len(random),
                "amplitude": max(r["amplitude"] for r in moving),
                "gradient": max(r["gradient"] for r in moving),
                "steps": int(np.median([r["steps"] for r in moving])),
                "resting": known[-1]["steps"],
                "random": sum(r["same"] for r in met),
                "failed": sum(r["status"] in ("failed", "event_bound") for r in met),
                "random steps": int(np.median([r["steps"] / r["periods"] for r in met])),
                "random worst": max(r["worst"] for r in met),
            }
        )
    return out


def told(results: dict[str, Any]) -> None:
    """Print the tables."""
    print(results["command"], results["date"], results["versions"])
    apart = results["errors"]
    head = ("scene", *(f"{q}, {way}" for q in FLOORS for way in WAYS))
    rows = []
    for scene, ways in apart.items():
        fits = (slope(way, q, ways[way][q]) for q in FLOORS for way in WAYS)
        rows.append((scene, *(f"{s:.2f}" for s in fits)))
    print("\nSlope of log(error) over log(width):")
    table(head, rows)
    print("\nLargest relative error over the scenes, by width:")
    rows = []
    for i, share in enumerate(SHARES):
        worst = (np.max([float(w[way][q][i]) for w in apart.values()]) for q in FLOORS for way in WAYS)
        rows.append((f"{share:.1e}", *("" if np.isnan(v) else f"{v:.1e}" for v in worst)))
    table(("width", *head[1:]), rows)
    print("\nFrom the scene's own start: status, solver steps until settled, most in a period (bound 4096)")
    for name in SOLVERS:
        of = results["starts"][name]
        print(f"\n{name}")
        table(("width", *of), [(f"{w:.0e}", *(_cell(of[c][i]) for c in of)) for i, w in enumerate(FAR)])
    print("\nOther rules:")
    told_rules(results["rules"])
    told_impacts(results["impacts"])


def told_impacts(held: dict[str, Any]) -> None:
    """Print the errors of scenes with impacts, and whether extrapolation pays."""
    print(f"\nImpacts, {held['date']}: largest error of {len(HUNG)} scenes, and of the extrapolated ones")
    kinds = [f"{q}{b}" for q in FLOORS for b in ("", ", both")]
    head = (
        "impacts",
        "width",
        *kinds,
        "scenes without it",
        "time",
        "time, both",
        *(f"{q}, gain" for q in FLOORS),
    )
    rows = []
    for e, of in held["errors"].items():
        scenes = [{name: np.array(v, float) for name, v in s.items()} for s in of.values()]
        for i, share in enumerate(held["widths"]):
            column = {kind: np.array([s[kind][i] for s in scenes]) for kind in scenes[0]}
            if np.isnan(column["amplitude, both"]).all():
                continue
            worst = (f"{np.nanmax(column[kind]):.1e}" for kind in kinds)
            lost = int(np.isnan(column["amplitude, both"]).sum())
            spent = (f"{1e3 * np.median(column[name]):.0f} ms" for name in ("seconds", "seconds, both"))
            gains = (f"{np.nanmedian([_gain(s, q, i) for s in scenes]):.1g}" for q in FLOORS)
            rows.append((e, f"{share:.0e}", *worst, lost, *spent, *gains))
    table(head, rows)
    print("Gain: least error of one width in at most the time of both over that of both (median).")


def _gain(scene: dict[str, np.ndarray], quantity: str, i: int) -> float:
    """The least error of one width, in at most the time of the i-th width and its half, over the error
    extrapolated from these."""
    least = np.nanmin(scene[quantity][scene["seconds"] <= scene["seconds, both"][i]])
    return float(least / scene[f"{quantity}, both"][i])


def told_rules(rows: list[dict[str, Any]]) -> None:
    """Print what other rules do."""
    head = (
        "widths of tilt, rate",
        f"wrong motion, of {len(MOVING) + 1}",
        "error of amplitude",
        "of gradient",
        "steps, rocking (median)",
        "steps, resting",
        f"right motion, of {rows[0]['drawn']} random",
        "failed",
        "steps a period (median)",
        "most in a period",
    )
    cells = []
    for r in rows:
        numbers = (r[k] for k in ("steps", "resting", "random", "failed", "random steps", "random worst"))
        errors = f"{r['amplitude']:.1e}", f"{r['gradient']:.1e}"
        cells.append((f"{r['tilt']:.1e}, {r['rate']:.1e}", ", ".join(r["lost"]) or "none", *errors, *numbers))
    table(head, cells)


def _cell(row: dict[str, Any]) -> str:
    ends = row["status"] if row["same"] else f"{row['status']} (not the exact one's)"
    return f"{ends}, {row['steps']}, {row['worst']}"


def draw(results: dict[str, Any], path: Path) -> None:
    """Errors over the width: a line a scene, thick their median."""
    axes = canvas.new_axes(2, (7.0, 7.4))
    styles = {
        "together": (canvas.INK, "-", 2.2),
        "tilt alone": (canvas.BLUE, (0, (5, 2)), 2.2),
        "rate alone": (canvas.ORANGE, (0, (1, 1)), 2.6),
    }
    for ax, quantity in zip(axes, FLOORS, strict=True):
        for way, (color, style, width) in styles.items():
            lines = np.array([w[way][quantity] for w in results["errors"].values()], float)
            for line in lines:
                ax.plot(SHARES, line, color=color, lw=0.5, alpha=0.4)
            known = ~np.isnan(lines).all(axis=0)
            median = np.nanmedian(lines[:, known], axis=0)
            ax.plot(np.array(SHARES)[known], median, color=color, ls=style, lw=width, label=way)
        ax.axvline(DEFAULT, color=canvas.GREY, lw=1.0, zorder=0)
        where = {"transform": ax.get_xaxis_transform(), "color": "#555555", "fontsize": 8}
        ax.text(1.15 * DEFAULT, 0.03, "default", **where)
        ax.set(xscale="log", yscale="log", ylabel=f"relative error of the {quantity} (-)")
        for words, way, below in (("slope 1", "together", 40.0), ("slope 2", "tilt alone", 0.03)):
            height = np.median([float(w[way][quantity][_LABELLED]) for w in results["errors"].values()])
            ax.text(SHARES[_LABELLED], below * height, words, color=canvas.INK, fontsize=8, ha="center")
        ax.grid(color="#e5e5e5", lw=0.6)
    axes[0].legend(title="signs smoothed (thick: median of scenes)", fontsize=8, title_fontsize=8)
    axes[-1].set_xlabel(r"smoothing width $\varepsilon$, a share of the expected tilt and of its rate (-)")
    place(path, canvas.png(axes[0].figure))


def draw_impacts(held: dict[str, Any], path: Path) -> None:
    """Errors over the width by e: a line a scene, thick their median, dashed that of what is extrapolated."""
    axes = canvas.new_axes(2, (7.0, 7.4))
    widths = np.array(held["widths"])
    styles = zip(held["errors"].items(), (canvas.INK, canvas.BLUE, canvas.ORANGE), "osD", strict=True)
    for (e, of), color, marker in styles:
        for ax, quantity in zip(axes, FLOORS, strict=True):
            lines = np.array([s[quantity] for s in of.values()], float)
            both = np.array([s[f"{quantity}, both"] for s in of.values()], float)
            for line in lines:
                ax.plot(widths, line, color=color, lw=0.5, alpha=0.4)
            look = {"color": color, "marker": marker, "ms": 3.5}
            ax.plot(widths, np.nanmedian(lines, axis=0), lw=2.0, label=e, **look)
            ax.plot(widths, np.nanmedian(both, axis=0), lw=1.0, ls=(0, (4, 2)), mfc="white", **look)
    for ax, quantity in zip(axes, FLOORS, strict=True):
        ax.axvline(DEFAULT, color=canvas.GREY, lw=1.0, zorder=0)
        where = {"transform": ax.get_xaxis_transform(), "color": "#555555", "fontsize": 8}
        ax.text(1.15 * DEFAULT, 0.03, "default", **where)
        ax.set(xscale="log", yscale="log", ylabel=f"relative error of the {quantity} (-)")
        ax.grid(color="#e5e5e5", lw=0.6)
    title = "velocity ratio of impacts (median of scenes;\ndashed: extrapolated from the width and its half)"
    axes[0].legend(title=title, fontsize=8, title_fontsize=8, loc="upper left")
    axes[-1].set_xlabel(r"smoothing width $\varepsilon$, a share of the expected tilt and of its rate (-)")
    place(path, canvas.png(axes[0].figure))


def main() -> None:
    """Measure, print and draw."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--draw", action="store_true", help="what is stored, without measuring")
    options.add_argument("--impacts", action="store_true", help="measure scenes with impacts only")
    asked = options.parse_args()
    if not asked.draw:
        solve = solver(diffrax.Tsit5())
        about = {"date": str(datetime.date.today()), "versions": versions(), "widths": STRUCK_SHARES}
        struck = {"impacts": about | {"errors": impacts(solve)}}
    if asked.impacts:
        place(RESULTS, compact(json.loads(as_json(json.loads(RESULTS.read_text()) | struck))))
    elif not asked.draw:
        results = {
            "command": COMMAND,
            "date": str(datetime.date.today()),
            "versions": versions(),
            "default": DEFAULT,
            "widths": SHARES,
            "errors": errors(solve, MOVING),
            "rules": rules(solve),
            "far": FAR,
            "starts": starts(),
            **struck,
        }
        place(RESULTS, compact(json.loads(as_json(results))))
    results = json.loads(RESULTS.read_text())
    told(results)
    draw(results, PICTURE)
    draw_impacts(results["impacts"], PICTURE_OF_IMPACTS)


if __name__ == "__main__":
    main()
