"""Drawing of a scene to scale: block, pendulum and excitation with their dimensions in SI units."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from tpd.core.formatting import number
from tpd.design.design import Design
from tpd.limits import Clearance, limit_of
from tpd.plots.style import BLUE, GREY, INK, SMALL, Picture, own_style
from tpd.scene.bob import Bob
from tpd.scene.scene import Pendulum, Scene

BODY = "#e8e8e8"
"""Fill of the block."""
_METAL = "#b4bcc6"
"""Fill of bob and beam."""
Label = tuple[str, tuple[float, float]]
"""Text of a label, and the position (m) that it points to."""
_TALL, _WIDE, _PAGE = 4.0, 1.5, 7.3
"""Largest height of each view, largest width of the left view, and width of the figure, inches.

This is the width of an A4 page between its margins, so the printed texts keep their size."""
_LEFT, _BETWEEN, _WORDS, _ABOVE, _BELOW = 0.75, 1.0, 2.6, 0.5, 0.9
"""Space for dimensions and texts around both views, inches."""


def corners(scene: Scene, tilt: float) -> np.ndarray:
    """Return the corners of the tilted block, m, shape (4, 2), counterclockwise from the lower left corner.

    Args:
        scene: the block.
        tilt: tilt, rad. A positive tilt is a counterclockwise rotation about the left corner, a negative tilt
            a clockwise rotation about the right corner.
    """
    a, height = 0.5 * scene.block.width, scene.block.height
    upright = np.array([[-a, 0.0], [a, 0.0], [a, height], [-a, height]])
    pivot = np.array([math.copysign(a, -tilt), 0.0])
    # Points are row vectors, so the matrix on the right is the transpose of the usual rotation matrix.
    c, s = math.cos(tilt), math.sin(tilt)
    return (upright - pivot) @ np.array([[c, s], [-s, c]]) + pivot


def rod(block: np.ndarray, length: float, angle: float, share: float = 1.0) -> np.ndarray:
    """Return the positions of hinge and bob, m, shape (2, 2).

    Args:
        block: corners of the block, see `corners`; the hinge is on its axis.
        length: distance from the hinge to the bob, m.
        angle: bob angle from the vertical, rad. At a positive angle the bob is to the right of the hinge.
        share: height of the hinge over that of the block.
    """
    base, top = 0.5 * (block[0] + block[1]), 0.5 * (block[2] + block[3])
    hinge = top if share == 1.0 else base + share * (top - base)
    return np.stack([hinge, hinge + length * np.array([math.sin(angle), -math.cos(angle)])])


def plot_design(design: Design, ax: Axes | None = None) -> Axes:
    """Draw the block and the pendulum of a design to scale, see `plot_scene`.

    Args:
        design: the answer of `optimise`.
        ax: must be None, because a drawing always has a figure of its own, which sets its scale.

    Returns:
        The axes of the left view.

    Raises:
        ValueError: `ax` is not None.
    """
    if ax is not None:
        raise ValueError("`ax` must be None for a drawing, which has its own figure, but is not None")
    # Without a limit on the clearance, the search used a point mass. A solid body in the drawing would
    # suggest that this body fits between the walls.
    clearance = limit_of(design.problem.limits, Clearance)
    bob = clearance.bob if isinstance(clearance, Clearance) else None
    return plot_scene(design.scene, design.pendulum, swing=design.swing, bob=bob)


class _AsBuilt(NamedTuple):
    """Pendulum as built: lengths in m, masses in kg, angles in rad."""

    pendulum: Pendulum
    """Equivalent point pendulum."""
    body: Bob
    mass: float
    """Mass of the body. It is larger than the point mass, because the body also rotates."""
    is_solid: bool
    """Whether the search had a body. If not, a dotted ball only shows the size of the mass."""
    rod: float
    """Distance from the hinge to the body's centre, which gives the natural frequency of the equivalent point
    pendulum; the length of that pendulum if no such distance exists."""
    exists: bool
    """Whether a body with this shape and density is equivalent to the point mass."""
    angle: float
    """Bob angle that is drawn on both sides."""
    depth: float
    """Depth of the body's lowest point below the hinge, over all angles up to `angle`."""
    reach: float
    """Largest distance of the body from the block's axis."""
    wall: float
    """Distance of the walls from the block's axis."""

    @staticmethod
    def of(scene: Scene, pendulum: Pendulum, swing: float, bob: Bob | None) -> _AsBuilt:
        """Return the pendulum as built with the bob angle `swing` (rad), by default with a steel ball."""
        body, mass, length = bob or Bob(), float(pendulum.mass), float(pendulum.length)
        heavy, built = body.built(mass, length, float(scene.gravity))
        # Beyond a right angle the rod would be drawn above its hinge.
        rod, angle = built if math.isfinite(built) else length, min(swing, 0.5 * math.pi)
        mass = heavy if math.isfinite(heavy) else mass
        # The lower edge of a cylinder is lowest at some angle between rest and the end of the swing.
        outlines = [_body(body, mass, rod, x) for x in np.linspace(0.0, angle, 31)]
        depth = -float(min(y for outline in outlines for _, y in outline))
        reach = float(body.reach(mass, rod, angle))
        wall, exists = 0.5 * scene.block.clear_width, math.isfinite(built)
        return _AsBuilt(pendulum, body, mass, bob is not None, rod, exists, angle, depth, reach, wall)

    @property
    def clearance_in_words(self) -> str:
        """Clearance between the body and the walls, and the angle of wall contact, as a text."""
        clearance = self.wall - self.reach
        text = (
            f"clearance at this swing: {number(1e3 * clearance, 3)} mm"
            if clearance > 0.0
            else "the bob touches the wall"
        )
        # There is no angle of contact if the body is wider than the cavity, or too short to reach the wall.
        angles = np.linspace(0.0, 0.5 * math.pi, 2001)
        excess = self.body.reach(self.mass, self.rod, angles) - self.wall
        if excess[0] < 0.0 < excess[-1]:
            beyond = int(np.argmax(excess > 0.0))
            contact = float(np.interp(0.0, excess[beyond - 1 : beyond + 1], angles[beyond - 1 : beyond + 1]))
            text += f"\nwall contact at ±{contact:.3g} rad (±{math.degrees(contact):.3g}°)"
        return text


@own_style()
def plot_scene(
    scene: Scene, pendulum: Pendulum | None = None, *, swing: float = 0.0, bob: Bob | None = None
) -> Axes:
    """Draw the block at rest and its pendulum to scale into a new figure.

    The left view is the block. The right view, on a larger scale, is the pendulum as built: beam and hinge,
    rod, body at rest and at both ends of its swing, depth and walls.

    Args:
        scene: block and excitation.
        pendulum: the equivalent point pendulum; None for the block alone.
        swing: largest bob angle, rad, which is drawn on both sides.
        bob: the bob as a body. Without this argument a steel ball is dotted around the point mass.

    Returns:
        The axes of the left view. The axes of the right view are the second ones of the figure.
    """
    built = None if pendulum is None else _AsBuilt.of(scene, pendulum, swing, bob)
    height, half = scene.block.height, 0.5 * scene.block.width
    hinge = height if pendulum is None else pendulum.hinge_in(scene.block)
    # Half widths (m) and scales (inches per m) of both views. The scales must leave space for the texts on a
    # page of fixed width, and the right view shows the walls if they are not far from the bob.
    wide = max(half, 0.0 if built is None else built.reach, 0.5 * (scene.block.frame_width or 0.0))
    scale = min(_TALL / max(height, hinge), _WIDE / (2.0 * wide))
    first = _LEFT + 2.0 * wide * scale + (0.3 if built is None else _BETWEEN)
    side = 0.0 if built is None else max(1.1 * built.reach, min(1.15 * built.wall, 2.5 * built.reach))
    larger = (
        scale if built is None else min(0.92 * _TALL / built.depth, (_PAGE - first - _WORDS) / (2.0 * side))
    )
    size = first + (0.0 if built is None else 2.0 * side * larger + _WORDS), _TALL + _ABOVE + _BELOW
    figure = Picture(figsize=(max(size[0], 2.6), size[1]), dpi=130)
    FigureCanvasAgg(figure)
    ax = _view(figure, 0.0, first, (-wide - _LEFT / scale, -_BELOW / scale), scale)
    ax.add_patch(Polygon(corners(scene, 0.0), closed=True, fc=BODY, ec=INK, lw=1.4))
    if scene.block.cavity_width is not None:
        # The cavity is open at the top. The floor makes clear that the block is hollow and not two walls.
        c, floor = 0.5 * scene.block.cavity_width, 0.05 * height
        ax.add_patch(Polygon([(-c, floor), (c, floor), (c, height), (-c, height)], fc="white", ec="none"))
        for wall in (-c, c):
            ax.plot([wall, wall], [floor, height], color=INK, lw=0.9)
    ax.plot(0.0, float(scene.block.centroid), "+", ms=7, mew=1.2, color=INK)
    inch = 1.0 / scale
    if scene.block.frame_width is None:
        _dimension(ax, (-half, height), (half, height), 0.2 * inch, f"{number(scene.block.width)} m", scale)
    else:
        c, wider = 0.5 * scene.block.frame_width, f"{number(scene.block.frame_width)} m"
        _dimension(ax, (-c, hinge), (c, hinge), 0.2 * inch, wider, scale)
        low = 0.2 * height
        _dimension(ax, (-half, low), (half, low), 0.05 * inch, f"{number(scene.block.width)} m", scale)
    away = half - wide - 0.35 * inch
    _dimension(ax, (-half, 0.0), (-half, height), away, f"{number(height)} m", scale)
    _base(ax, scene, wide, scale)
    if built is not None:
        if (frame := scene.block.frame_width) is not None:
            c = 0.5 * frame
            ax.plot([-c, -c, c, c], [height, hinge, hinge, height], color=INK, lw=1.4)
            ax.plot([-max(c, half), max(c, half)], [height, height], color=INK, lw=1.4)
            beside = c - wide - 0.35 * inch
            _dimension(ax, (-c, height), (-c, hinge), beside, f"{number(hinge - height)} m", scale)
        else:
            # A hinge above the block is on a mast.
            ax.plot([0.0, 0.0], [min(height, hinge), hinge], color=INK, lw=1.4)
        _draw(ax, built, hinge, detail=False)
        low = (-side - _BETWEEN * 0.8 / larger, -(_TALL + _BELOW) / larger)
        _detail(_view(figure, first - 0.8 * _BETWEEN, size[0], low, larger), scene, built, side, larger)
    return ax


def _view(figure: Figure, begin: float, end: float, low: tuple[float, float], scale: float) -> Axes:
    """Return axes without frame over the whole height of the figure.

    Args:
        figure: the figure.
        begin: distance of the left edge from the left edge of the figure, inches.
        end: distance of the right edge from the left edge of the figure, inches.
        low: coordinates of the lower left corner, m.
        scale: inches per metre.
    """
    width, height = figure.get_size_inches()
    ax = figure.add_axes((begin / width, 0.0, (end - begin) / width, 1.0))
    ax.set(xlim=(low[0], low[0] + (end - begin) / scale), ylim=(low[1], low[1] + height / scale))
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def _draw(ax: Axes, built: _AsBuilt, top: float, *, detail: bool) -> None:
    """Draw rod and body at rest, with the hinge at the height `top` (m), and in detail the swing."""
    hinge, mass = np.array([0.0, top]), built.mass
    if detail and built.angle > 0.0:
        for angle in (-built.angle, built.angle):
            end = built.rod * np.array([math.sin(angle), -math.cos(angle)])
            ax.plot(*np.stack([hinge, hinge + end]).T, color=BLUE, lw=0.6, ls=(0, (1, 2)))
            # The outlines at the ends of the swing show the clearance that the body needs.
            shape = _body(built.body, mass, built.rod, angle) + hinge
            ax.add_patch(Polygon(shape, fill=False, ec=BLUE, lw=0.8, ls=(0, (4, 2))))
    ax.plot([0.0, 0.0], [top, top - built.rod], color=BLUE, lw=2.0 if detail else 1.2)
    style = {"fc": _METAL, "lw": 1.0} if built.is_solid else {"fill": False, "lw": 0.8, "ls": (0, (1, 1.5))}
    ax.add_patch(Polygon(_body(built.body, mass, built.rod, 0.0) + hinge, ec=INK, zorder=3, **style))
    ax.plot(0.0, top - built.rod, ".", ms=4 if detail else 2, color=INK, zorder=4)


def _detail(ax: Axes, scene: Scene, built: _AsBuilt, side: float, scale: float) -> None:
    """Draw the pendulum with its hinge at the origin, dimensions on its left and labels on its right.

    Args:
        ax: axes of the right view.
        scene: block and excitation.
        built: the pendulum as built.
        side: half width of the view without dimensions and labels, m.
        scale: inches per metre.
    """
    inch, p, low = 1.0 / scale, built.pendulum, -min(1.06 * built.depth, _TALL / scale)
    half, is_hollow = 0.5 * scene.block.width, math.isfinite(built.wall)
    # The walls of a frame are thin posts.
    half = half if scene.block.frame_width is None else built.wall + 0.05 * inch
    # Draw the walls between the cavity and the outer faces, cut off at the edge of the view. A block without
    # a stated cavity is drawn as one solid wall.
    for sign in (-1.0, 1.0):
        inner, outer = sign * min(built.wall if is_hollow else 0.0, side), sign * min(half, side)
        ax.add_patch(Rectangle((inner, low), outer - inner, -low, fc=BODY, ec="none"))
        if is_hollow and built.wall < side:
            ax.plot([inner, inner], [low, 0.0], color=INK, lw=0.9)
    ax.add_patch(Rectangle((-min(half, side), 0.0), 2.0 * min(half, side), 0.09 * inch, fc=_METAL, ec=INK))
    _draw(ax, built, 0.0, detail=True)
    ax.plot(0.0, 0.0, "o", ms=5, mfc="white", mec=INK, zorder=4)
    outward = -side - 0.15 * inch
    _dimension(ax, (0.0, -built.rod), (0.0, 0.0), outward, f"{number(built.rod)} m", scale)
    # The dimension is that of the bob at rest, as in the tables. The edge of a cylinder that swings is lower.
    depth = built.rod + float(built.body.half_height(built.mass))
    _dimension(ax, (0.0, -depth), (0.0, 0.0), outward - 0.35 * inch, f"{number(depth)} m", scale)
    if is_hollow and built.wall < side:
        between = f"{number(2.0 * built.wall)} m"
        _dimension(ax, (-built.wall, 0.09 * inch), (built.wall, 0.09 * inch), 0.12 * inch, between, scale)
    # The end of the swing to the right is the position that the label of the swing points to.
    mass, end = built.mass, built.rod * np.array([math.sin(built.angle), -math.cos(built.angle)])
    damper = f"{number(p.hinge_damping(scene.gravity), 3)} N m s/rad\n(damping ratio {p.damping_ratio:.3g})"
    wide, high = (2.0 * float(x) for x in (built.body.radius(mass), built.body.half_height(mass)))
    size = f"{number(wide, 3)} m wide" + ("" if built.body.shape == "ball" else f", {number(high, 3)} m high")
    shape = f": {built.body.shape}" if built.is_solid else " (dotted: steel ball)"
    length = f"{number(built.rod)} m as built" if built.exists else "no such body"
    labels: list[Label] = [
        (f"beam with hinge and damper,\n{damper}", (0.0, 0.0)),
        (f"rod to the centre: {length}\n({number(p.length)} m in the equations)", (0.0, -0.4 * built.rod)),
        (f"bob, {number(mass)} kg{shape}\n{size}", (0.0, -built.rod)),
        (f"depth below the hinge: {number(depth)} m", (0.0, -depth)),
    ]
    if built.angle > 0.0:
        name, degrees = scene.excitation.swing_in_drawing, math.degrees(built.angle)
        text = f"{name} ±{built.angle:.3g} rad (±{degrees:.3g}°)"
        text += f"\n{built.clearance_in_words}" if is_hollow else ""
        labels.insert(2, (text, (float(end[0]), float(end[1]))))
    # The labels stand in a column, from top to bottom, without overlap. Each label is as near as possible to
    # the height of its part: below the previous label, and above the space that the remaining labels need.
    heights = [(0.29 + 0.15 * text.count("\n")) / scale for text, _ in labels]
    top, remaining = 0.25 / scale, sum(heights) - (_TALL + 0.4) / scale
    for (text, place), tall in zip(labels, heights, strict=True):
        at = side + 0.3 * inch, max(min(place[1], top - 0.5 * tall), remaining - 0.5 * tall)
        top, remaining = at[1] - 0.5 * tall, remaining - tall
        line = {"arrowstyle": "-", "lw": 0.6, "color": INK, "shrinkB": 3, "relpos": (0.0, 0.5)}
        ax.annotate(text, xy=place, xytext=at, fontsize=SMALL, va="center", color=INK, arrowprops=line)


def _body(bob: Bob, mass: float, rod: float, angle: float) -> np.ndarray:
    """Return the outline of the body at a bob angle (rad), with the hinge at the origin, m, shape (n, 2)."""
    r, h = float(bob.radius(mass)), float(bob.half_height(mass))
    shape = np.array([[-r, -h], [r, -h], [r, h], [-r, h]])
    if bob.shape == "ball":
        around = np.linspace(0.0, 2.0 * np.pi, 73)
        shape = r * np.stack([np.cos(around), np.sin(around)], axis=1)
    # See `corners` on the transpose of the rotation matrix.
    c, s = math.cos(angle), math.sin(angle)
    return (shape - np.array([0.0, rod])) @ np.array([[c, s], [-s, c]])


def _dimension(
    ax: Axes, low: tuple[float, float], high: tuple[float, float], away: float, text: str, scale: float
) -> None:
    """Draw a dimension line between two points with the same horizontal or vertical coordinate.

    Args:
        ax: the axes.
        low: left or lower point, m.
        high: right or upper point, m.
        away: distance of the line from the points, m: to the right, or up for a horizontal line.
        text: the dimension.
        scale: inches per metre.
    """
    is_level = low[1] == high[1]
    shift = np.array([0.0, away] if is_level else [away, 0.0])
    ends = np.array([low, high]) + shift
    # Extension lines go from the points to a little beyond the dimension line.
    over = 0.06 / scale * shift / np.abs(away)
    for start, end in zip((low, high), ends, strict=True):
        ax.plot(*np.stack([start, end + over]).T, color=GREY, lw=0.5)
    arrow = {"arrowstyle": "<|-|>", "lw": 0.8, "color": INK}
    ax.annotate("", xy=tuple(ends[1]), xytext=tuple(ends[0]), arrowprops=arrow)
    x, y = ends.mean(axis=0)
    if is_level:
        ax.text(x, y + 0.05 / scale, text, fontsize=SMALL, color=INK, ha="center", va="bottom")
        return
    # A text that is longer than the line would reach above the view, so it is moved down.
    _, (_, top) = ends
    y = min(y, top - 0.035 * len(text) / scale)
    ax.text(x - 0.04 / scale, y, text, rotation=90, fontsize=SMALL, color=INK, ha="right", va="center")


def _base(ax: Axes, scene: Scene, half: float, scale: float) -> None:
    """Draw the ground, and an arrow for its motion, which is to scale if it is long enough to be seen."""
    reach, inch = max(half, 0.5 * scene.block.width) + 0.2 / scale, 1.0 / scale
    ax.plot([-reach, reach], [0.0, 0.0], color=INK, lw=1.4)
    # Hatching below the ground line, as in engineering drawings.
    for x in np.arange(-reach, reach, 0.12 * inch):
        ax.plot([x, x - 0.07 * inch], [0.0, -0.08 * inch], color=INK, lw=0.6)
    motion = scene.excitation
    # The displacement of a ground motion is unknown. Its arrow is therefore never to scale.
    amplitude = motion.quantities.get("amplitude", 0.0)
    length = amplitude if amplitude * scale >= 0.12 else 0.25 * inch
    y = -0.3 * inch
    arrow = {"arrowstyle": "<|-|>", "lw": 1.6, "color": INK}
    ax.annotate("", xy=(length, y), xytext=(-length, y), arrowprops=arrow)
    text = f"block: {number(scene.block.mass)} kg\nbase: {motion.in_drawing}"
    ax.text(0.0, y - 0.1 * inch, text, fontsize=SMALL, ha="center", va="top", color=INK)
