"""Runs of the proof: the table, the picture and the file of what each method reached after how many designs.

It imports nothing of the optimiser, so that stored results are drawn without it.
"""

import datetime
import json
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tests.benchmarks.tables import compact
from tpd.core.files import place

COMMAND = "python -m tests.benchmarks.proof"
PICTURE = Path(__file__).parents[2] / "notebooks" / "pictures" / "proof.png"
RESULTS = Path(__file__).with_name("results") / "proof.json"
VERSIONS = ("tpd", "jax", "numpy", "scipy", "cma")
NEAR = 1e-3
"""Distance from the best value anybody found, a share of it, that counts as found."""


class Run(NamedTuple):
    """One method from one seed."""

    evaluations: np.ndarray
    """Designs evaluated by then."""
    best: np.ndarray
    """The best value so far, of the same length."""
    seconds: float


def reached(run: Run, goal: float) -> float:
    """Designs evaluated until the goal; infinite where it was not met."""
    met = np.flatnonzero(run.best <= goal)
    return float(run.evaluations[met[0]]) if len(met) else np.inf


class Row(NamedTuple):
    """What a table says of a method."""

    hits: int
    runs: int
    until: float
    """Median number of designs until it was there; infinite where no more than half were."""
    total: float
    seconds: float
    worst: float
    """The largest distance from the best at the end, a share of the best."""


def table(runs: dict[str, list[Run]], known: float | None = None) -> tuple[float, dict[str, Row]]:
    """Best value of all runs, or the known one if it is better, and a row for each method."""
    best = min(run.best[-1] for of in runs.values() for run in of)
    best = best if known is None else min(best, known)
    goal = best + NEAR * abs(best)
    rows = {}
    for name, of in runs.items():
        until = [reached(run, goal) for run in of]
        rows[name] = Row(
            int(np.isfinite(until).sum()),
            len(of),
            float(np.median(until)),
            float(np.median([run.evaluations[-1] for run in of])),
            float(np.median([run.seconds for run in of])),
            float(max(_gap(run, best)[-1] for run in of)),
        )
    return best, rows


def formatted(name: str, best: float, rows: dict[str, Row]) -> str:
    """Table as text, and whether our method meets its reaches."""
    head = f"{'method':26}{'within 0.1 %':>13}{'until there':>12}{'in all':>8}{'seconds':>9}{'worst gap':>10}"
    lines = [f"\n{name}: best {best:.8g}", head]
    for method, r in rows.items():
        lines.append(
            f"{method:26}{r.hits:6} of {r.runs:<3}{r.until:12.0f}{r.total:8.0f}{r.seconds:9.2f}"
            f"{r.worst:10.0e}"
        )
    peers = {m: r for m, r in rows.items() if m not in ("ours", "grid") and not m.startswith("optax")}
    sound = {m: r for m, r in peers.items() if r.hits >= 0.9 * r.runs}
    own = rows["ours"]
    if not peers:
        return "\n".join(lines)
    close = min((sound or peers).items(), key=lambda item: item[1].until)
    share = own.until / close[1].until
    lines.append(
        f"best peer: {close[0]}{'' if sound else ', though not in nine of ten'}; ours needs {share:.1%} of "
        f"its designs (reach: 5 %, {'met' if share <= 0.05 else 'NOT met'}) and is there in {own.hits} of "
        f"{own.runs} (reach: nine of ten, {'met' if own.hits >= 0.9 * own.runs else 'NOT met'})"
    )
    return "\n".join(lines)


STYLES = {
    "ours": ("#000000", "-", 2.2),
    "optax: Adam": ("#000000", (0, (1, 1)), 1.4),
    "optax: L-BFGS": ("#000000", (0, (5, 2)), 1.4),
    "differential evolution": ("#0072b2", "--", 1.4),
    "the same, polished": ("#56b4e9", (0, (6, 2, 1, 2)), 1.4),
    "Nelder-Mead, restarted": ("#d55e00", "-.", 1.4),
    "CMA-ES, restarted": ("#009e73", (0, (3, 1, 1, 1, 1, 1)), 1.4),
    "random": ("#999999", ":", 1.4),
    "grid": ("#999999", "-", 1.0),
}


def draw(results: dict[str, dict[str, list[Run]]], path: Path) -> None:
    """Median gap to the best value against designs evaluated, a panel a problem."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for ax, (name, runs) in zip(panels, results.items(), strict=False):
        best = min(run.best[-1] for of in runs.values() for run in of)
        for label, of in runs.items():
            color, style, width = STYLES[label]
            at = np.geomspace(1.0, max(run.evaluations[-1] for run in of), 300)
            gaps = [_gap(run, best)[np.searchsorted(run.evaluations, at, side="right") - 1] for run in of]
            ax.plot(at, np.median(gaps, axis=0), color=color, ls=style, lw=width, label=label)
        ax.axhline(NEAR, color="#bbbbbb", lw=0.8, zorder=0)
        ax.set(xscale="log", yscale="log", ylim=(1e-7, 30.0))
        ax.set_title(name, fontsize=9)
        ax.tick_params(labelbottom=True)
    for ax in panels[len(results) :]:
        ax.set_axis_off()
    figure.supxlabel("designs evaluated", fontsize=10)
    figure.supylabel("median gap to the best value found, a share of it (line: 0.1 %)", fontsize=10)
    panels[0].legend(fontsize=8, loc="lower left", frameon=False)
    figure.savefig(path, dpi=110)


def _gap(run: Run, best: float) -> np.ndarray:
    return np.maximum((run.best - best) / abs(best), 1e-7)


def store(results: dict[str, dict[str, list[Run]]], settings: dict[str, Any]) -> None:
    """Write the runs, one a line: the designs after which the best value improved, and the last design."""
    rows = [
        {
            "problem": problem,
            "method": method,
            "evaluations": run.evaluations[_improved(run)].tolist(),
            "best": run.best[_improved(run)].tolist(),
            "seconds": run.seconds,
        }
        for problem, methods in results.items()
        for method, runs in methods.items()
        for run in runs
    ]
    versions = {name: version(name) for name in VERSIONS}
    about = {"date": str(datetime.date.today()), **versions, **settings}
    place(RESULTS, compact({"command": COMMAND, "about": about, "rows": rows}))


def _improved(run: Run) -> np.ndarray:
    better = np.diff(run.best, prepend=np.inf) < 0.0
    better[[0, -1]] = True
    return np.flatnonzero(better)


def stored() -> dict[str, dict[str, list[Run]]]:
    """The runs of each method on each problem, as they were stored."""
    results: dict[str, dict[str, list[Run]]] = {}
    for row in json.loads(RESULTS.read_text())["rows"]:
        run = Run(np.array(row["evaluations"]), np.array(row["best"]), row["seconds"])
        results.setdefault(row["problem"], {}).setdefault(row["method"], []).append(run)
    return results
