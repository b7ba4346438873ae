"""Error and time of the steady amplitude and its gradient, by `tpd` and by methods that a user would write.

Six scenes whose answers are known to 30 digits from an arithmetic with 60 (`truth.json`, written by
`python -m tests.benchmarks.precision.scenes`). A peer whose package is not installed is left out.
"""

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

Row = dict[str, Any]


def run(quick: bool) -> list[Row]:
    """Return a row for every method, setting, scene and quantity."""
    from tests.benchmarks.precision.methods import measured

    methods = [m for name in MODULES for m in import_module(f"{__name__}.{name}").METHODS]
    if quick:
        methods = [m._replace(settings=m.settings[-1:]) for m in methods if not m.name.startswith("smoothed")]
    return measured(methods, SCENES[:2] if quick else SCENES, load(), 1 if quick else 3)


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
    """Return the table of our fastest method and the fastest other one, at an error of 1e-6."""
    head = ("scene", "quantity", "fastest of tpd", "ms (error)", "fastest other", "ms (error)", "other/tpd")
    out = []
    for kind in ("value", "gradient"):
        for scene, mine, other in pairs(rows, kind):
            cells = ((r["method"], f"{r['ms']:.3g} ({r['error']:.0e})") for r in (mine, other))
            out.append((scene, kind, *(c for two in cells for c in two), f"{other['ms'] / mine['ms']:.2g}"))
    return markdown(head, out)


def table(rows: list[Row]) -> str:
    """Return the short table, and the time and error of every method, or the reason without a result."""
    scenes = [s.name for s in SCENES if any(r["scene"] == s.name for r in rows)]
    whole = []
    for method, setting, kind in dict.fromkeys((r["method"], r["setting"], r["kind"]) for r in rows):
        mine = {
            r["scene"]: r for r in rows if (r["method"], r["setting"], r["kind"]) == (method, setting, kind)
        }
        first = max((r.get("first", 0.0) for r in mine.values()), default=0.0)
        cells = (
            mine[s]["note"] or (f"{mine[s]['ms']:.3g} ({mine[s]['error']:.0e})" if s in mine else "")
            for s in scenes
        )
        whole.append((method, f"{setting:g}" if setting else "", kind, *cells, f"{first:.2g}"))
    head = ("method", "setting", "quantity", *(f"{s}, ms (error)" for s in scenes), "first call, s")
    return f"{short(rows)}\n\n{markdown(head, whole)}"


def pictures(rows: list[Row]) -> dict[str, Any]:
    """Draw error against time, a panel for each scene: our methods black, the others grey."""
    return {
        f"precision-{kind}.png": _figure([r for r in rows if r["kind"] == kind], kind)
        for kind in ("value", "gradient")
    }


def _figure(rows: list[Row], kind: str) -> Any:
    from tpd.plots.style import new_axes

    axes = new_axes(2, (12.0, 8.6), columns=3)
    looks, theirs, dashes = cycle("osD^vP"), cycle("x+1234"), cycle(("-", "--", ":", "-."))
    styles = {}
    for method, ours in dict.fromkeys((r["method"], r["ours"]) for r in rows):
        ink = "black" if ours else "0.5"
        marker = next(looks if ours else theirs)
        styles[method] = {"color": ink, "marker": marker, "ls": next(dashes), "lw": 1.0}
        styles[method] |= {"ms": 10 if "default" in method else 6, "zorder": 3 if ours else 2}
    handles = {}
    for ax, scene in zip(axes.flat, SCENES, strict=True):
        there = [r for r in rows if r["scene"] == scene.name]
        for method, style in styles.items():
            curve = [r for r in there if r["method"] == method and r["ms"] is not None]
            if curve:
                x, y = [max(r["error"], FLOOR) for r in curve], [1e-3 * r["ms"] for r in curve]
                handles[method] = ax.plot(x, y, **style, label=method)[0]
        failed = dict.fromkeys(f"{r['method']}: {r['note']}" for r in there if r["note"])
        ax.text(0.98, 0.98, "\n".join(failed), transform=ax.transAxes, va="top", ha="right", fontsize=6.5)
        ax.set(xscale="log", yscale="log", title=scene.name)
        ax.grid(True, which="major", color="0.9")
    for ax in axes[-1]:
        ax.set_xlabel("relative error, against 30 digits (-)")
    for ax in axes[:, 0]:
        ax.set_ylabel("time of a warm call (s)")
    what = "Steady amplitude" if kind == "value" else "Gradient of the steady amplitude in three parameters"
    figure = axes[0, 0].figure
    figure.suptitle(f"{what}: error against time (lower left is better)")
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=4, fontsize=8)
    return figure
