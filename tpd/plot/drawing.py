"""Drawing of a scene to scale: block, pendulum and base motion with their dimensions in SI units."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from tpd.core.bob import Bob
from tpd.core.formatting import number
from tpd.core.scene import Harmonic, Pendulum, Scene
from tpd.plot.style import BLUE, GREY, INK

BODY = "#e8e8e8"
"""Fill of the block."""
_METAL = "#b4bcc6"
"""Fill of the bob."""
Label = tuple[str, tuple[float, float]]
"""Words, and the place (m) that they belong to."""
_TALL, _WIDE = 4.2, 3.0
"""Largest height and width of the part to scale, inches."""
_LEFT, _RIGHT, _ABOVE, _BELOW = 1.15, 2.4, 0.5, 0.75
"""Room for dimensions and words around it, inches."""

_STROKE = {True: "settled stroke", False: "largest angle"}
"""Name of the bob's angle that is drawn, by whether the motion is harmonic."""


def corners(scene: Scene, tilt: float, base: float = 0.0) -> np.ndarray:
    """Corners of the block, m, shape (4, 2), from the lower left one on, the base moved by `base` m.

    A positive tilt (rad) turns it about its left corner, counterclockwise; a negative one about the right.
    """
    a, height = 0.5 * scene.block.width, scene.block.height
    upright = np.array([[-a, 0.0], [a, 0.0], [a, height], [-a, height]])
    pivot = np.array([math.copysign(a, -tilt), 0.0])
    c, s = math.cos(tilt), math.sin(tilt)
    return (upright - pivot) @ np.array([[c, s], [-s, c]]) + pivot + np.array([base, 0.0])


def rod(block: np.ndarray, length: float, angle: float) -> np.ndarray:
    """Hinge, in the middle of the top of the block with these corners, and bob: m, shape (2, 2).

    The angle (rad) is that from the vertical; positive, the bob hangs to the right of its hinge.
    """
    hinge = 0.5 * (block[2] + block[3])
    return np.stack([hinge, hinge + length * np.array([math.sin(angle), -math.cos(angle)])])


def plot_scene(
    scene: Scene, pendulum: Pendulum | None, *, stroke: float = 0.0, bob: Bob | None = None
) -> Axes:
    """Draw the block at rest, its cavity and its pendulum, to scale into a new figure.

    Args:
        scene: block and base motion.
        pendulum: None for the bare block.
        stroke: largest bob angle of the settled motion, rad, drawn to both sides.
        bob: the bob as a body; without it the bob is a point, with a ball of steel dotted around it.
    """
    half = _half_width(scene, pendulum, stroke, bob)
    scale = min(_TALL / scene.block.height, _WIDE / (2.0 * half))
    ax = _canvas(scene.block.height, half, scale)
    ax.add_patch(Polygon(corners(scene, 0.0), closed=True, fc=BODY, ec=INK, lw=1.4))
    labels = _cavity(ax, scene)
    if pendulum is not None:
        labels += _pendulum(ax, scene, pendulum, stroke, bob)
    a, height = 0.5 * scene.block.width, scene.block.height
    labels.append((f"block, {number(scene.block.mass)} kg", (0.85 * a, 0.12 * height)))
    labels.sort(key=lambda label: -label[1][1])
    _labels(ax, labels, half + 0.35 / scale, scale, height)
    _dimensions(ax, scene, pendulum, half, scale)
    _base(ax, scene, half, scale)
    return ax


def _half_width(scene: Scene, pendulum: Pendulum | None, stroke: float, bob: Bob | None) -> float:
    """Largest distance of block and bob from the middle, m."""
    swing = 0.0 if pendulum is None else pendulum.length * math.sin(min(stroke, 0.5 * math.pi))
    if pendulum is not None and bob is not None:
        # The sheet must hold the body at the end of its swing, also where that lies beyond the walls.
        swing = float(bob.reach(pendulum.mass, pendulum.length, min(stroke, 0.5 * math.pi)))
    return max(0.5 * scene.block.width, swing)


def _cavity(ax: Axes, scene: Scene) -> list[Label]:
    """Draw the cavity, if its width is given: open at the top, its depth is not known."""
    wide, height = scene.block.cavity_width, scene.block.height
    if wide is None:
        return []
    # A floor is drawn, so that the walls are seen to be those of a hollow block and not two bars.
    c, floor = 0.5 * wide, 0.05 * height
    ax.add_patch(Polygon([(-c, floor), (c, floor), (c, height), (-c, height)], fc="white", ec="none"))
    # The hinge hangs from a beam across the opening.
    ax.plot([-c, c], [height, height], color=INK, lw=0.9)
    for side in (-c, c):
        ax.plot([side, side], [floor, height], color=INK, lw=0.9)
    return [(f"cavity, {number(wide)} m wide\n(its depth is not given)", (c, 0.3 * height))]


def _canvas(height: float, half: float, scale: float) -> Axes:
    """Axes that fill a figure, `scale` inches a metre, with room for words."""
    width_in, height_in = 2.0 * half * scale + _LEFT + _RIGHT, height * scale + _ABOVE + _BELOW
    figure = Figure(figsize=(width_in, height_in), dpi=130)
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set(
        xlim=(-half - _LEFT / scale, half + _RIGHT / scale), ylim=(-_BELOW / scale, height + _ABOVE / scale)
    )
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def _pendulum(ax: Axes, scene: Scene, pendulum: Pendulum, stroke: float, bob: Bob | None) -> list[Label]:
    """Draw the pendulum; returns labels and the places they belong to, m, from the top down."""
    block, length = corners(scene, 0.0), pendulum.length
    line = rod(block, length, 0.0)
    words = [
        (
            f"hinge, {number(pendulum.hinge_damping(scene.gravity), 3)} N m s/rad\n"
            f"({pendulum.damping_ratio:.3g} of critical)",
            (float(line[0, 0]), float(line[0, 1])),
        )
    ]
    if stroke > 0.0:
        arc = np.stack([rod(block, length, x)[1] for x in np.linspace(-stroke, stroke, 61)])
        ax.plot(*arc.T, color=BLUE, lw=1.0, ls=(0, (4, 2)))
        for end in (arc[0], arc[-1]):
            ax.plot(*np.stack([line[0], end]).T, color=BLUE, lw=0.6, ls=(0, (1, 2)))
        angle = (
            f"{_STROKE[isinstance(scene.motion, Harmonic)]} ±{stroke:.3g} rad\n(±{math.degrees(stroke):.3g}°)"
        )
        words.append((angle, (float(arc[-1, 0]), float(arc[-1, 1]))))
    ax.plot(*line.T, color=BLUE, lw=2.0)
    ax.plot(*line[0], "o", ms=5, mfc="white", mec=INK)
    if bob is not None and stroke > 0.0:
        # The body at the ends of its swing shows what room it needs.
        for angle in (-stroke, stroke):
            swung = _outline(bob, pendulum.mass) @ _turned(angle) + rod(block, length, angle)[1]
            ax.add_patch(Polygon(swung, fill=False, ec=BLUE, lw=0.8, ls=(0, (4, 2))))
    words.append((_bob(ax, pendulum, bob, line[1]), (float(line[1, 0]), float(line[1, 1]))))
    return words


def _bob(ax: Axes, pendulum: Pendulum, bob: Bob | None, centre: np.ndarray) -> str:
    """Draw the bob to scale; returns its label."""
    x, y = map(float, centre)
    label = f"bob, {number(pendulum.mass)} kg"
    if bob is None:
        # Somebody has to hang something: a dotted ball shows how large a point of this mass would be.
        radius = float(Bob().radius(pendulum.mass))
        ax.add_patch(Circle((x, y), radius, fill=False, ec=INK, lw=0.7, ls=(0, (1, 1.5))))
        ax.plot(x, y, "o", ms=6, color=INK)
        return f"{label}\n(dotted: a ball of steel)"
    ax.add_patch(Polygon(_outline(bob, pendulum.mass) + centre, fc=_METAL, ec=INK, lw=1.0, zorder=3))
    ax.plot(x, y, ".", ms=3, color=INK, zorder=4)
    wide, high = (2.0 * float(size) for size in (bob.radius(pendulum.mass), bob.half_height(pendulum.mass)))
    size = f"{number(wide, 3)} m wide" + ("" if bob.shape == "ball" else f", {number(high, 3)} m high")
    return f"{label}: {bob.shape}\n{size}"


def _outline(bob: Bob, mass: float) -> np.ndarray:
    """Outline of the bob about its centre with its rod upright, m, shape (n, 2)."""
    r, h = float(bob.radius(mass)), float(bob.half_height(mass))
    if bob.shape == "ball":
        around = np.linspace(0.0, 2.0 * np.pi, 73)
        return r * np.stack([np.cos(around), np.sin(around)], axis=1)
    return np.array([[-r, -h], [r, -h], [r, h], [-r, h]])


def _turned(angle: float) -> np.ndarray:
    """Matrix that turns row vectors as the rod turns at an angle (rad) from the vertical."""
    # Row vectors stand to the left of a matrix, so that this is the transpose of the usual one.
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


def _labels(ax: Axes, labels: list[Label], x: float, scale: float, height: float) -> None:
    """Write labels in a column at `x`, none over another, each with a line to its place."""
    room, top = 0.42 / scale, height + 0.1 / scale
    for i, (words, place) in enumerate(labels):
        y = min(place[1], top)
        # Labels further below need their room as well.
        y = max(y, (len(labels) - 1 - i) * room - 0.1 / scale)
        top = y - room
        ax.annotate(
            words,
            xy=place,
            xytext=(x, y),
            fontsize=8,
            va="center",
            color=INK,
            arrowprops={"arrowstyle": "-", "lw": 0.6, "color": INK, "shrinkB": 3, "relpos": (0.0, 0.5)},
        )


def _dimensions(ax: Axes, scene: Scene, pendulum: Pendulum | None, half: float, scale: float) -> None:
    """Draw dimension lines: width above the block, height and length of the pendulum to its left."""
    a, height, inch = 0.5 * scene.block.width, scene.block.height, 1.0 / scale
    outer = -half - (0.4 if pendulum is None else 0.8) * inch
    _dimension(ax, (-a, height), (a, height), 0.2 * inch, f"{number(scene.block.width)} m", scale)
    _dimension(ax, (-a, 0.0), (-a, height), outer + a, f"{number(height)} m", scale)
    if pendulum is not None:
        low = height - pendulum.length
        _dimension(ax, (0.0, low), (0.0, height), -half - 0.35 * inch, f"{number(pendulum.length)} m", scale)


def _dimension(
    ax: Axes, low: tuple[float, float], high: tuple[float, float], away: float, words: str, scale: float
) -> None:
    """A dimension line from `low` to `high`, drawn `away` m to the side, or above if it is level."""
    level = low[1] == high[1]
    shift = np.array([0.0, away] if level else [away, 0.0])
    ends = np.array([low, high]) + shift
    over = 0.06 / scale * shift / np.abs(away)
    for start, end in zip((low, high), ends, strict=True):
        ax.plot(*np.stack([start, end + over]).T, color=GREY, lw=0.5)
    ax.annotate(
        "",
        xy=tuple(ends[1]),
        xytext=tuple(ends[0]),
        arrowprops={"arrowstyle": "<|-|>", "lw": 0.8, "color": INK},
    )
    middle = ends.mean(axis=0)
    if level:
        ax.text(middle[0], middle[1] + 0.05 / scale, words, fontsize=8, color=INK, ha="center", va="bottom")
        return
    # Words longer than the line stand below its upper end.
    y = min(middle[1], ends[1, 1] - 0.035 * len(words) / scale)
    x = middle[0] - 0.04 / scale
    ax.text(x, y, words, rotation=90, fontsize=8, color=INK, ha="right", va="center")


def _base(ax: Axes, scene: Scene, half: float, scale: float) -> None:
    """Draw the ground and its motion, as an arrow to scale where that is long enough to be seen."""
    reach, inch = max(half, 0.5 * scene.block.width) + 0.2 / scale, 1.0 / scale
    ax.plot([-reach, reach], [0.0, 0.0], color=INK, lw=1.4)
    for x in np.arange(-reach, reach, 0.12 * inch):
        ax.plot([x, x - 0.07 * inch], [0.0, -0.08 * inch], color=INK, lw=0.6)
    motion = scene.motion
    swings = isinstance(motion, Harmonic)
    true = swings and motion.amplitude * scale >= 0.12
    length = motion.amplitude if true else 0.25 * inch
    y = -0.3 * inch
    ax.annotate(
        "", xy=(length, y), xytext=(-length, y), arrowprops={"arrowstyle": "<|-|>", "lw": 1.6, "color": INK}
    )
    words = "base: ground motions"
    if swings:
        words = f"base: ±{number(motion.amplitude, 3)} m at {number(motion.frequency)} Hz"
    words += "" if true else "\n(arrow not to scale)"
    ax.text(0.0, y - 0.1 * inch, words, fontsize=8, ha="center", va="top", color=INK)
