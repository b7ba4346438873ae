"""Error and time of the steady amplitude and its gradient, by `tpd` and by methods that a user would write.

Six scenes whose answers are known to 30 digits from an arithmetic with 60 (`truth.json`, written by
`python -m tests.benchmarks.precision.scenes`). A peer whose package is not installed is left out.
"""

import math
import statistics
from importlib import import_module
from itertools import cycle
from typing import Any

from tests.benchmarks.precision.scenes import SCENES, load
from tests.benchmarks.stored import markdown

QUESTION = "How accurate and how fast are the amplitude and gradient of one scene, against other software?"
MEASURES = "compiled", "models", "answers/steady_state", "answers/symmetric_orbits", "answers/auto"
SEED = None
MODULES = ("ours", "numba_loop", "peers")
ASKED, FLOOR = 1e-6, 1e-15
"""Error at which methods are compared, and smallest error in a picture."""

DEFAULT = "steady_state of floats (default)"
PANELS = {
    "value": "Steady amplitude, median of six scenes",
    "gradient": "Its gradient in three parameters, median of six scenes",
    "ensemble": "Amplitudes of 1000 designs at once, all cores",
}

Row = dict[str, Any]


def run(quick: bool) -> list[Row]:
    """Return a row for every method, setting, scene and quantity."""
    from tests.benchmarks.precision.methods import measured

    methods = [m for name in MODULES for m in import_module(f"{__name__}.{name}").METHODS]
    if quick:
        methods = [m._replace(settings=m.settings[-1:]) for m in methods if not m.name.startswith("smoothed")]
    from tests.benchmarks.precision.ensembles import rows_of

    rounds = 1 if quick else 3
    rows = measured(methods, SCENES[:2] if quick else SCENES, load(), rounds)
    return rows + rows_of(100 if quick else 1000, rounds)


def quickest(rows: list[Row], scene: str, kind: str, ours: bool) -> Row | None:
    """Return our fastest method, or the fastest other, with an error of at most `ASKED`."""
    there = (r for r in rows if (r["scene"], r["kind"], r["ours"]) == (scene, kind, ours))
    good = [r for r in there if r["ms"] is not None and r["error"] <= ASKED]
    return min(good, key=lambda r: r["ms"], default=None)


def pairs(rows: list[Row], kind: str) -> list[tuple[str, Row, Row]]:
    """Return for each scene our fastest method and the fastest other one, if both have an answer."""
    found = ((s.name, *(quickest(rows, s.name, kind, own) for own in (True, False))) for s in SCENES)
    return [(scene, mine, other) for scene, mine, other in found if mine and other]


def brief(rows: list[Row]) -> str:
    """Return the table of our fastest times for an error of 1e-6, and the ratio to the fastest other."""
    found = {
        kind: {s: (m, o["ms"] / m["ms"]) for s, m, o in pairs(rows, kind)} for kind in ("value", "gradient")
    }
    out = []
    for scene in found["value"].keys() & found["gradient"].keys():
        cells = [(f"{m['ms']:.3g}", f"{ratio:.2g}") for m, ratio in (of[scene] for of in found.values())]
        out.append((scene, *cells[0], *cells[1]))
    return markdown(("scene", "value, ms", "other/tpd", "gradient, ms", "other/tpd"), sorted(out))


def short(rows: list[Row]) -> str:
    """Return our fastest method, the default and the fastest other one, for each scene at an error of 1e-6.

    The orbit equation assumes a symmetric motion of one forcing period. The default and the loops start from
    the initial state of the scene and find out which motion it leads to.
    """
    default = {r["scene"]: r["ms"] for r in rows if r["method"] == DEFAULT}
    head = ("scene", "quantity", "fastest of tpd", "ms (error)", "fastest other", "ms (error)", "other/tpd")
    out = []
    for kind in ("value", "gradient"):
        for scene, mine, other in pairs(rows, kind):
            cells = ((r["method"], f"{r['ms']:.3g} ({r['error']:.0e})") for r in (mine, other))
            equal = f"{other['ms'] / default[scene]:.2g}" if kind == "value" else ""
            ratio = f"{other['ms'] / mine['ms']:.2g}"
            out.append((scene, kind, *(c for two in cells for c in two), ratio, equal))
    return markdown((*head, "other/default, from the same initial state"), out)


def _ensembles(rows: list[Row]) -> str:
    head = ("many designs at once", "setting", "µs per design", "median error", "another motion")
    cells = [
        (
            r["method"],
            f"{r['setting']:g}" if r["setting"] else "",
            f"{1000.0 * r['ms']:.3g}",
            f"{r['error']:.0e}",
            f"{100.0 * r['wrong']:.3g} %",
        )
        for r in rows
        if r["kind"] == "ensemble"
    ]
    return markdown(head, cells)


def table(rows: list[Row]) -> str:
    """Return the short table, and the time and error of every method, or the reason without a result."""
    scenes = [s.name for s in SCENES if any(r["scene"] == s.name for r in rows)]
    whole = []
    single = [r for r in rows if r["kind"] != "ensemble"]
    for method, setting, kind in dict.fromkeys((r["method"], r["setting"], r["kind"]) for r in single):
        mine = {
            r["scene"]: r for r in single if (r["method"], r["setting"], r["kind"]) == (method, setting, kind)
        }
        first = max((r.get("first", 0.0) for r in mine.values()), default=0.0)
        cells = (
            mine[s]["note"] or (f"{mine[s]['ms']:.3g} ({mine[s]['error']:.0e})" if s in mine else "")
            for s in scenes
        )
        whole.append((method, f"{setting:g}" if setting else "", kind, *cells, f"{first:.2g}"))
    head = ("method", "setting", "quantity", *(f"{s}, ms (error)" for s in scenes), "first call, s")
    return f"{short(rows)}\n\n{_ensembles(rows)}\n\n{markdown(head, whole)}"


def pictures(rows: list[Row]) -> dict[str, Any]:
    """Draw time against error for values, gradients and ensembles: our methods black, the others grey."""
    from tpd.plots.style import new_axes

    axes = new_axes(1, (12.0, 5.6), columns=3)
    looks, theirs, dashes = cycle("osD^vPX"), cycle("x+1234"), cycle(("-", "--", ":", "-."))
    handles: dict[str, Any] = {}
    for ax, (kind, what) in zip(axes, PANELS.items(), strict=True):
        there = [r for r in rows if r["kind"] == kind]
        for method, ours in dict.fromkeys((r["method"], r["ours"]) for r in there):
            curve = _medians([r for r in there if r["method"] == method])
            if method not in handles:
                ink, marker = ("black", next(looks)) if ours else ("0.5", next(theirs))
                style = {"color": ink, "marker": marker, "ls": next(dashes), "lw": 1.0}
                handles[method] = style | {"ms": 9 if "default" in method else 6, "zorder": 3 if ours else 2}
            ax.plot(*zip(*curve, strict=True), **handles[method], label=method)
        ax.set_title(what, fontsize=10)
        ax.set(xscale="log", yscale="log", xlabel="relative error (-)")
        ax.grid(True, which="major", color="0.9")
    axes[0].set_ylabel("time of a value, a gradient, a design (ms)")
    figure = axes[0].figure
    figure.suptitle("Time against error (lower left is better)")
    every = {label: h for ax in axes for h, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(list(every.values()), list(every), loc="outside lower center", ncols=4, fontsize=8)
    return {"speed-accuracy.png": figure}


def _medians(rows: list[Row]) -> list[tuple[float, float]]:
    """Return for each setting the medians of error and time over the scenes with a result."""
    good = [r for r in rows if r["ms"] is not None and not math.isnan(r["ms"])]
    groups = (
        [r for r in good if r["setting"] == setting] for setting in dict.fromkeys(r["setting"] for r in good)
    )
    return [
        (max(statistics.median(r["error"] for r in g), FLOOR), statistics.median(r["ms"] for r in g))
        for g in groups
    ]
