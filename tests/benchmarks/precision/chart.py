"""Pictures and tables of what `measure` found."""

from collections.abc import Iterable
from itertools import cycle
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from tests.benchmarks.precision.measure import Row

FLOOR = 1e-15
"""Errors are drawn at this value or above."""
EQUAL = 1e-12
"""Errors below are equal: they are of rounding."""
ASKED = 1e-6
"""Error at which methods are compared."""
CHOSEN = (
    "orbit equation (default)",
    "events, then Newton (default)",
    "nonlinear model's segments, linear terms",
    "smoothed, Tsit5",
    "SciPy DOP853, events",
    "SUNDIALS CVODE, roots",
    "heyoka, Newton",
    "Numba event loop",
)
"""Methods of the picture that is read first: the front, one smoothed and the named peers."""
_OURS, _THEIRS = "osD^v<>ph*", "x+^v<>sDo*p"
_LINE = 0.031
"""Height of a line of failures, in shares of a panel's."""
_SHORT = {
    "another motion or a wrong number": "wrong",
    "not the same model": "other model",
    "no number": "none",
}


def save(rows: list[Row], scenes: list[str], directory: Path) -> list[Path]:
    """Write a picture of the chosen methods, and one of all, for amplitudes and gradients."""
    paths = []
    few = [r for r in rows if r.method in CHOSEN]
    for kind in ("value", "gradient"):
        for some, name in ((few, f"precision-{kind}.png"), (rows, f"precision-{kind}-all.png")):
            drawn = figure(some, kind, scenes)
            drawn.savefig(directory / name, dpi=110)
            plt.close(drawn)
            paths.append(directory / name)
    return paths


def figure(rows: list[Row], kind: str, scenes: list[str]) -> Figure:
    """Error against warm seconds, a panel a scene: black and filled ours, grey and open the others. What
    has no answer is named above: "wrong" is another motion or an error above 30 %."""
    fig, axes = plt.subplots(2, 3, figsize=(13.0, 10.6), sharex=True, sharey="row", layout="constrained")
    rows = [r for r in rows if r.kind == kind]
    styles = dict(_styles(rows))
    handles, lines = {}, []
    for ax, scene in zip(axes.flat, scenes, strict=True):
        there = [r for r in rows if r.scene == scene]
        for name, style in styles.items():
            curve = [r for r in there if r.method == name and not r.note and np.isfinite(r.warm)]
            if curve:
                x, y = [max(r.error, FLOOR) for r in curve], [r.warm for r in curve]
                handles[name] = ax.plot(x, y, **style, label=name)[0]
        ax.set(xscale="log", yscale="log", title=scene)
        ax.grid(True, which="major", color="0.9")
        said = _failures(there)
        lines.append(len(said))
        ax.text(0.02, 0.985, "\n".join(said), transform=ax.transAxes, va="top", fontsize=6.2, color="0.25")
    # Room for the failures above the curves, of which the panels of a row share the scale.
    for row, most in zip(axes, np.reshape(lines, (2, 3)).max(axis=1), strict=True):
        low, high = np.log10(row[0].get_ylim())
        row[0].set_ylim(top=10.0 ** (low + (high - low) / (1.0 - _LINE * (most + 1))))
    for ax in axes[-1]:
        ax.set_xlabel("relative error, against 30 digits")
    for ax in axes[:, 0]:
        ax.set_ylabel("seconds, warm")
    what = "Steady amplitude" if kind == "value" else "Gradient of the steady amplitude, three parameters"
    fig.suptitle(f"{what}: error against time (lower left is better)")
    fig.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=4, fontsize=8)
    return fig


def _styles(rows: list[Row]) -> Iterable[tuple[str, dict]]:
    """A style for each method; ours are black with filled markers, the defaults large."""
    names = list(dict.fromkeys((r.method, r.ours) for r in rows))
    ours, theirs, dashes = cycle(_OURS), cycle(_THEIRS), cycle(("-", "--", ":", "-."))
    for name, own in names:
        default = "default" in name
        yield (
            name,
            {
                "color": "black" if own else "0.5",
                "marker": next(ours if own else theirs),
                "markersize": 10 if default else 6,
                "markerfacecolor": "black" if own else "none",
                "linestyle": next(dashes),
                "linewidth": 1.0,
                "zorder": 3 if own else 2,
            },
        )


def _failures(rows: list[Row]) -> list[str]:
    """The methods that had no answer, and why; of some settings only, how many."""
    lines = []
    for name in dict.fromkeys(r.method for r in rows):
        of = [r for r in rows if r.method == name]
        failed = [r for r in of if r.note]
        if failed:
            share = "" if len(failed) == len(of) else f", {len(failed)} of {len(of)}"
            lines.append(
                f"{name.removesuffix(' (default)')}{share}: {_SHORT.get(failed[0].note, failed[0].note)}"
            )
    return lines


def on_front(rows: list[Row], scene: str, kind: str) -> list[str]:
    """The methods of which no other setting or method is both quicker and as accurate."""
    there = [r for r in rows if r.scene == scene and r.kind == kind and not r.note and np.isfinite(r.warm)]
    out = []
    for r in there:
        beaten = any(
            max(o.error, EQUAL) <= max(r.error, EQUAL) and o.warm < r.warm for o in there if o is not r
        )
        if not beaten and r.method not in out:
            out.append(r.method)
    return out


def quickest(rows: list[Row], scene: str, kind: str, ours: bool) -> Row | None:
    """Of ours or the others the quickest with an error of at most `ASKED`."""
    good = [
        r
        for r in rows
        if (r.scene, r.kind, r.ours) == (scene, kind, ours) and not r.note and r.error <= ASKED
    ]
    return min(good, key=lambda r: r.warm, default=None)


def tables(rows: list[Row], scenes: list[str]) -> str:
    """Markdown: the front, and ours against the best of the others at equal error."""
    head = (
        "scene",
        "asked",
        "quickest of ours to 1e-6",
        "quickest peer to 1e-6",
        "ratio",
        "a default in front",
    )
    lines = [f"| {' | '.join(head)} |", "|---" * 6 + "|"]
    for kind in ("value", "gradient"):
        for scene in scenes:
            mine, other = (quickest(rows, scene, kind, own) for own in (True, False))
            front = on_front(rows, scene, kind)
            default = "yes" if any("default" in name for name in front) else f"no: {', '.join(front)}"
            ratio = f"{other.warm / mine.warm:.1f}" if mine and other else ""
            lines.append(f"| {scene} | {kind} | {_cell(mine)} | {_cell(other)} | {ratio} | {default} |")
    return "\n".join(lines)


def _cell(row: Row | None) -> str:
    if row is None:
        return "none"
    knob = "" if row.knob == "none" else f", {row.knob} {row.setting:g}"
    return f"{row.method}{knob}: {1e3 * row.warm:.3g} ms ({row.error:.0e})"


def compiling(rows: list[Row]) -> str:
    """Markdown: seconds of the first call of every method."""
    lines = ["| method | first call, amplitude | first call, gradient |", "|---|---|---|"]
    for name in dict.fromkeys(r.method for r in rows):
        cells = []
        for kind in ("value", "gradient"):
            cold = [r.cold for r in rows if r.method == name and r.kind == kind and np.isfinite(r.cold)]
            cells.append(f"{max(cold):.2g} s" if cold else "")
        lines.append(f"| {name} | {cells[0]} | {cells[1]} |")
    return "\n".join(lines)
