"""Drawing of a scene to scale: block, pendulum and base motion with their dimensions in SI units."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from scipy.optimize import root_scalar

from tpd.core.formatting import number
from tpd.design.criteria import Clearance, limit_of
from tpd.design.design import Design
from tpd.plots.style import BLUE, GREY, INK, Picture, own_style
from tpd.scene.bob import Bob
from tpd.scene.scene import Harmonic, Pendulum, Scene

BODY = "#e8e8e8"
"""Fill of the block."""
_METAL = "#b4bcc6"
"""Fill of bob and beam."""
Label = tuple[str, tuple[float, float]]
"""Words, and the place (m) that they belong to."""
_TALL, _WIDE, _PAGE = 4.0, 1.5, 7.3
"""Largest height of each view, width of the first and of both with their words, inches: a sheet of A4 has
this width between its margins, so that words are printed in their own size."""
_LEFT, _BETWEEN, _WORDS, _ABOVE, _BELOW = 0.75, 1.0, 2.6, 0.5, 0.9
"""Clearance for dimensions and words around both views, inches."""
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


def plot_design(design: Design, ax: Axes | None = None) -> Axes:
    """Draw a design, see `plot_scene`, its bob as the body that the limits ask room for.

    Raises:
        ValueError: axes are given: the drawing has a figure of its own, which sets its scale.
    """
    if ax is not None:
        raise ValueError("`ax` must be None for a drawing, which has a figure of its own, but is given")
    # Without the limit the search took a point; a body in the drawing would claim that it fits.
    clearance = limit_of(design.problem.limits, Clearance)
    bob = clearance.bob if isinstance(clearance, Clearance) else None
    return plot_scene(design.scene, design.pendulum, swing=design.swing, bob=bob)


class _Hung(NamedTuple):
    """The pendulum as it is built, m and rad."""

    pendulum: Pendulum
    body: Bob
    mass: float
    """Mass of the body, kg: for its turning it is more than that of the point."""
    solid: bool
    """Whether the body was asked for; else it only shows how large a point of this mass would be."""
    rod: float
    """Hinge to the body's centre, so that it swings as often as the point of the equations; the length of
    these where no such rod exists."""
    exists: bool
    angle: float
    """Angle drawn to both sides."""
    depth: float
    """Lowest point of the body below its hinge at any angle up to this."""
    reach: float
    """Largest distance of the body from the middle."""
    wall: float
    """Half the width between the walls."""

    @staticmethod
    def of(scene: Scene, pendulum: Pendulum, swing: float, bob: Bob | None) -> _Hung:
        body, mass, length = bob or Bob(), float(pendulum.mass), float(pendulum.length)
        heavy, built = body.built(mass, length, float(scene.gravity))
        rod, angle = built if math.isfinite(built) else length, min(swing, 0.5 * math.pi)
        mass = heavy if math.isfinite(heavy) else mass
        turned = [_body(body, mass, rod, x) for x in np.linspace(0.0, angle, 31)]
        depth = -float(min(shape[:, 1].min() for shape in turned))
        reach = float(body.reach(mass, rod, angle))
        wall, exists = 0.5 * scene.block.clear_width, math.isfinite(built)
        return _Hung(pendulum, body, mass, bob is not None, rod, exists, angle, depth, reach, wall)

    @property
    def clear(self) -> str:
        """Words for the room between the body and the walls."""

        def short(angle: float) -> float:
            return float(self.body.reach(self.mass, self.rod, angle)) - self.wall

        clearance = -short(self.angle)
        said = (
            f"{number(clearance, 3)} m clear to the wall" if clearance > 0.0 else "the bob touches the wall"
        )
        if short(0.0) < 0.0 < short(0.5 * math.pi):
            touches = float(root_scalar(short, bracket=(0.0, 0.5 * math.pi)).root)
            said += f",\nwhich it meets at ±{touches:.3g} rad (±{math.degrees(touches):.3g}°)"
        return said


@own_style()
def plot_scene(
    scene: Scene, pendulum: Pendulum | None = None, *, swing: float = 0.0, bob: Bob | None = None
) -> Axes:
    """Draw the block at rest to scale into a new figure and, to a larger scale beside it, its pendulum as it
    is to be built: beam and hinge, rod, body at rest and at both ends of its swing, depth and walls.

    Args:
        scene: block and base motion.
        pendulum: None for the bare block.
        stroke: largest bob angle of the settled motion, rad, drawn to both sides.
        bob: the bob as a body; without it a ball of steel is dotted around the point.

    Returns:
        The axes of the whole; those of the pendulum are the figure's second.
    """
    with_it = None if pendulum is None else _Hung.of(scene, pendulum, swing, bob)
    height, half = scene.block.height, 0.5 * scene.block.width
    wide = max(half, 0.0 if with_it is None else with_it.reach)
    scale = min(_TALL / height, _WIDE / (2.0 * wide))
    left = _LEFT + 2.0 * wide * scale + (0.3 if with_it is None else _BETWEEN)
    side = 0.0 if with_it is None else max(1.1 * with_it.reach, min(1.15 * with_it.wall, 2.5 * with_it.reach))
    larger = (
        scale
        if with_it is None
        else min(0.92 * _TALL / with_it.depth, (_PAGE - left - _WORDS) / (2.0 * side))
    )
    size = left + (0.0 if with_it is None else 2.0 * side * larger + _WORDS), _TALL + _ABOVE + _BELOW
    figure = Picture(figsize=(max(size[0], 2.6), size[1]), dpi=130)
    FigureCanvasAgg(figure)
    ax = _view(figure, 0.0, left, (-wide - _LEFT / scale, -_BELOW / scale), scale)
    ax.add_patch(Polygon(corners(scene, 0.0), closed=True, fc=BODY, ec=INK, lw=1.4))
    if scene.block.cavity_width is not None:
        # Open at the top; a floor is drawn, so that the walls are seen to be those of a hollow block.
        c, floor = 0.5 * scene.block.cavity_width, 0.05 * height
        ax.add_patch(Polygon([(-c, floor), (c, floor), (c, height), (-c, height)], fc="white", ec="none"))
        for wall in (-c, c):
            ax.plot([wall, wall], [floor, height], color=INK, lw=0.9)
    inch = 1.0 / scale
    _dimension(ax, (-half, height), (half, height), 0.2 * inch, f"{number(scene.block.width)} m", scale)
    away = half - wide - 0.35 * inch
    _dimension(ax, (-half, 0.0), (-half, height), away, f"{number(height)} m", scale)
    _base(ax, scene, wide, scale)
    if with_it is not None:
        _draw(ax, with_it, height, detail=False)
        low = (-side - _BETWEEN * 0.8 / larger, -(_TALL + _BELOW) / larger)
        _detail(_view(figure, left - 0.8 * _BETWEEN, size[0], low, larger), scene, with_it, side, larger)
    return ax


def _view(figure: Figure, left: float, right: float, low: tuple[float, float], scale: float) -> Axes:
    """Axes over the figure's whole height between two distances (inches) from its left, `scale` inches a
    metre, with their lower left corner at `low` (m)."""
    width, height = figure.get_size_inches()
    ax = figure.add_axes((left / width, 0.0, (right - left) / width, 1.0))
    ax.set(xlim=(low[0], low[0] + (right - left) / scale), ylim=(low[1], low[1] + height / scale))
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def _draw(ax: Axes, h: _Hung, top: float, *, detail: bool) -> None:
    """Draw rod and body, their hinge at the height `top`: at rest and in detail at the ends of a swing."""
    hinge, mass = np.array([0.0, top]), h.mass
    if detail and h.angle > 0.0:
        for angle in (-h.angle, h.angle):
            end = h.rod * np.array([math.sin(angle), -math.cos(angle)])
            ax.plot(*np.stack([hinge, hinge + end]).T, color=BLUE, lw=0.6, ls=(0, (1, 2)))
            # The body at the ends of its swing shows what room it needs.
            shape = _body(h.body, mass, h.rod, angle) + hinge
            ax.add_patch(Polygon(shape, fill=False, ec=BLUE, lw=0.8, ls=(0, (4, 2))))
    ax.plot([0.0, 0.0], [top, top - h.rod], color=BLUE, lw=2.0 if detail else 1.2)
    style = {"fc": _METAL, "lw": 1.0} if h.solid else {"fill": False, "lw": 0.8, "ls": (0, (1, 1.5))}
    ax.add_patch(Polygon(_body(h.body, mass, h.rod, 0.0) + hinge, ec=INK, zorder=3, **style))
    ax.plot(0.0, top - h.rod, ".", ms=4 if detail else 2, color=INK, zorder=4)


def _detail(ax: Axes, scene: Scene, h: _Hung, side: float, scale: float) -> None:
    """Draw the pendulum with its hinge at the origin, dimensions to its left and words to its right."""
    inch, p, low = 1.0 / scale, h.pendulum, -min(1.06 * h.depth, _TALL / scale)
    half, hollow = 0.5 * scene.block.width, scene.block.cavity_width is not None
    # Walls between the cavity and the outer faces, as far as the view goes; a solid block is all wall.
    for sign in (-1.0, 1.0):
        inner, outer = sign * min(h.wall if hollow else 0.0, side), sign * min(half, side)
        ax.add_patch(Rectangle((inner, low), outer - inner, -low, fc=BODY, ec="none"))
        if hollow and h.wall < side:
            ax.plot([inner, inner], [low, 0.0], color=INK, lw=0.9)
    ax.add_patch(Rectangle((-min(half, side), 0.0), 2.0 * min(half, side), 0.09 * inch, fc=_METAL, ec=INK))
    _draw(ax, h, 0.0, detail=True)
    ax.plot(0.0, 0.0, "o", ms=5, mfc="white", mec=INK, zorder=4)
    outward = -side - 0.15 * inch
    _dimension(ax, (0.0, -h.rod), (0.0, 0.0), outward, f"{number(h.rod)} m", scale)
    _dimension(ax, (0.0, -h.depth), (0.0, 0.0), outward - 0.35 * inch, f"{number(h.depth, 3)} m", scale)
    if hollow and h.wall < side:
        between = f"{number(2.0 * h.wall)} m"
        _dimension(ax, (-h.wall, 0.09 * inch), (h.wall, 0.09 * inch), 0.12 * inch, between, scale)
    mass, end = h.mass, h.rod * np.array([math.sin(h.angle), -math.cos(h.angle)])
    damper = f"{number(p.hinge_damping(scene.gravity), 3)} N m s/rad ({p.damping_ratio:.3g} of critical)"
    wide, high = (2.0 * float(x) for x in (h.body.radius(mass), h.body.half_height(mass)))
    size = f"{number(wide, 3)} m wide" + ("" if h.body.shape == "ball" else f", {number(high, 3)} m high")
    of = f": {h.body.shape}" if h.solid else " (dotted: steel ball)"
    built = f"{number(h.rod)} m as built" if h.exists else "no body does it"
    words: list[Label] = [
        (f"beam that carries the hinge; its damper:\n{damper}", (0.0, 0.0)),
        (f"rod, hinge to centre: {built}\n({number(p.length)} m in the equations)", (0.0, -0.4 * h.rod)),
        (f"bob, {number(mass)} kg{of}\n{size}", (0.0, -h.rod)),
        (f"depth below the hinge: {number(h.depth, 3)} m", (0.0, -h.depth)),
    ]
    if h.angle > 0.0:
        name, degrees = _STROKE[isinstance(scene.motion, Harmonic)], math.degrees(h.angle)
        said = f"{name} ±{h.angle:.3g} rad (±{degrees:.3g}°)"
        words.insert(2, (f"{said}\n{h.clear}" if hollow else said, (float(end[0]), float(end[1]))))
    # Labels stand in a column, none over another, each with a line to its place.
    heights = [(0.29 + 0.15 * said.count("\n")) / scale for said, _ in words]
    top, left = 0.25 / scale, sum(heights) - (_TALL + 0.4) / scale
    for (said, place), tall in zip(words, heights, strict=True):
        # Labels further below need their room as well.
        at = side + 0.3 * inch, max(min(place[1], top - 0.5 * tall), left - 0.5 * tall)
        top, left = at[1] - 0.5 * tall, left - tall
        line = {"arrowstyle": "-", "lw": 0.6, "color": INK, "shrinkB": 3, "relpos": (0.0, 0.5)}
        ax.annotate(said, xy=place, xytext=at, fontsize=8, va="center", color=INK, arrowprops=line)


def _body(bob: Bob, mass: float, rod: float, angle: float) -> np.ndarray:
    """Outline of the body about its hinge at an angle (rad) of the rod from the vertical, m, shape (n, 2)."""
    r, h = float(bob.radius(mass)), float(bob.half_height(mass))
    shape = np.array([[-r, -h], [r, -h], [r, h], [-r, h]])
    if bob.shape == "ball":
        around = np.linspace(0.0, 2.0 * np.pi, 73)
        shape = r * np.stack([np.cos(around), np.sin(around)], axis=1)
    # Row vectors stand to the left of a matrix, so that this is the transpose of the usual one.
    c, s = math.cos(angle), math.sin(angle)
    return (shape - np.array([0.0, rod])) @ np.array([[c, s], [-s, c]])


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
    arrow = {"arrowstyle": "<|-|>", "lw": 0.8, "color": INK}
    ax.annotate("", xy=tuple(ends[1]), xytext=tuple(ends[0]), arrowprops=arrow)
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
    arrow = {"arrowstyle": "<|-|>", "lw": 1.6, "color": INK}
    ax.annotate("", xy=(length, y), xytext=(-length, y), arrowprops=arrow)
    words = "base: ground motions"
    if swings:
        words = f"base: ±{number(motion.amplitude, 3)} m\nat {number(motion.frequency)} Hz"
    words = f"block: {number(scene.block.mass)} kg\n{words}"
    ax.text(0.0, y - 0.1 * inch, words, fontsize=8, ha="center", va="top", color=INK)
