"""Animation of the block on its moving base, without the pendulum and with it."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

from tpd.design.as_built import TimeHistory
from tpd.plots.drawing import BODY, corners, rod
from tpd.plots.style import BLUE, INK, Picture, own_style
from tpd.scene.scene import Harmonic, Pendulum, Scene

_RATE, _SECONDS, _LONG = 20, 6.0, 10.0
"""Frames a second; longest duration under harmonic shaking, and that under a pulse or a record, s."""
_PER_PERIOD = 8
"""Fewest frames in a forcing period; where real time has fewer, the motion is slowed."""
_VISIBLE, _MAGNIFIED = 0.05, (1, 2, 5, 10, 20, 50, 100)
"""Tilt (rad) below which tilts are magnified, and factors for that."""
_TALL, _WIDE, _NARROW = 3.6, 4.2, 2.0
"""Largest height, largest and least width of one motion, inches."""
_ABOVE, _BELOW, _LEAST, _DPI = 0.35, 0.5, 3.6, 80
"""Clearance for words above and below, and the least width of the figure, inches; dots an inch."""
_COLOURS = 64
"""Shades of a film: a few inks, mixed where lines are smooth."""


@dataclass(frozen=True)
class Reel:
    """Frames of one motion from rest, shapes (frames,); angles in rad."""

    pendulum: Pendulum | None
    tilt: np.ndarray
    """A right angle from the frame on in which it is reached: the equations end there."""
    angle: np.ndarray
    lost: np.ndarray
    """Whether the block has overturned by then."""


@own_style()
def animate(
    scene: Scene, pendulum: Pendulum | None, histories: Sequence[TimeHistory], start: float = 0.0
) -> bytes:
    """A GIF of some seconds from rest: left the block without, right with the pendulum.

    Real time, unless the shaking is too fast for that; true geometry, unless tilts are too small to be
    seen: then they are magnified. The picture says so. Under a pulse or a record the picture moves along with
    the base, whose displacement a record of acceleration does not hold.

    Args:
        scene: block and base motion.
        pendulum: None for the bare block alone.
        histories: exact time histories, of the bare block and with the pendulum.
        start: time of the first frame, s.
    """
    slowed, seconds = 1, _LONG
    if isinstance(scene.motion, Harmonic):
        # With fewer frames than this in a period the motion would alias: it would seem to go backwards.
        slowed = max(1, math.ceil(_PER_PERIOD * scene.motion.frequency / _RATE))
        seconds = min(_SECONDS, 24.0 / scene.motion.frequency * slowed)
    frames = int(_RATE * seconds)
    times = start + np.arange(frames) / (_RATE * slowed)
    reels = [reel(h, pendulum if h.with_pendulum else None, times) for h in histories]
    figure, draw = _stage(scene, reels, times, slowed)
    film = list(_pictures(figure, draw, frames))
    out = io.BytesIO()
    film[0].save(out, "GIF", save_all=True, append_images=film[1:], duration=1000 // _RATE, loop=0)
    return out.getvalue()


def _pictures(figure: Figure, draw: Callable[[int], list[Artist]], frames: int) -> Iterator[Image.Image]:
    """Frames of a film. What stands still is drawn once, and the palette is chosen once: both take long."""
    canvas, palette = FigureCanvasAgg(figure), None
    moving = draw(0)
    for artist in moving:
        artist.set_animated(True)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for i in range(frames):
        draw(i)
        canvas.restore_region(still)
        for artist in moving:
            artist.draw(canvas.get_renderer())
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
        if palette is None:
            palette = picture.quantize(_COLOURS)
            colours = np.array(palette.getpalette()).reshape(-1, 3)
            # Among them pure white: nearly white ones would show on a white page.
            colours[(colours > 246).all(axis=1)] = 255
            palette.putpalette(colours.ravel().tolist())
        yield picture.quantize(palette=palette, dither=Image.Dither.NONE)


def reel(history: TimeHistory, pendulum: Pendulum | None, times: np.ndarray) -> Reel:
    """Frames at `times` (s) of a time history."""
    known = np.isfinite(history.tilt) & np.isfinite(history.bob)
    sound = known & (np.abs(history.tilt) < 0.5 * math.pi)
    end = len(sound) if sound.all() else int(np.argmin(sound))
    # An overturned block is drawn lying on the side to which it fell, and one without an answer as it was.
    side = math.copysign(0.5 * math.pi, history.tilt[max(end - 1, 0)])
    falls = history.overturned and end < len(sound)
    lost = times >= history.time[end] if falls else np.zeros(len(times), bool)
    part = slice(0, max(end, 1))
    tilt, bob = (np.interp(times, history.time[part], x[part]) for x in (history.tilt, history.bob))
    return Reel(pendulum, np.where(lost, side, tilt), np.where(lost, 0.0, bob), lost)


def _stage(
    scene: Scene, reels: list[Reel], times: np.ndarray, slowed: int
) -> tuple[Figure, Callable[[int], list[Artist]]]:
    """Make the figure, and a function that sets a frame of it and returns what moves."""
    largest = max(float(np.abs(r.tilt).max()) for r in reels)
    # Tilts of a hundredth of a radian cannot be seen; angles of the bob are large enough as they are.
    larger = next((m for m in _MAGNIFIED if m * largest >= _VISIBLE), 1) if largest > 1e-9 else 1
    base, still = np.zeros_like(times), not isinstance(scene.motion, Harmonic)
    if not still:
        base = scene.motion.amplitude * np.sin(scene.motion.rate * times)
    # All shapes are computed before the figure is made: the axes must hold every frame.
    films = [[_shapes(scene, r, i, larger, float(x)) for i, x in enumerate(base)] for r in reels]
    points = np.concatenate([x for film in films for shapes in film for x in shapes])
    pad = 0.08 * scene.block.height
    reach = scene.motion.amplitude if isinstance(scene.motion, Harmonic) else 0.0
    side = max(float(np.abs(points[:, 0]).max()), 0.7 * scene.block.width + reach) + pad
    low, high = min(float(points[:, 1].min()), 0.0) - pad, float(points[:, 1].max()) + pad
    shape = 2.0 * side / (high - low)
    tall = min(_TALL, _WIDE / shape)
    whole, width = tall + _ABOVE + _BELOW, max(max(tall * shape, _NARROW) * len(reels), _LEAST)
    figure = Picture(figsize=(width, whole), dpi=_DPI)
    draws = []
    for i, (r, film) in enumerate(zip(reels, films, strict=True)):
        ax = figure.add_axes((i / len(reels), _BELOW / whole, 1.0 / len(reels), tall / whole))
        ax.set(xlim=(-side, side), ylim=(low, high), aspect="equal")
        ax.set_axis_off()
        # Axes would place a title of their own anew in every frame, and slowly.
        title = "without pendulum" if r.pendulum is None else "with pendulum"
        figure.text((i + 0.5) / len(reels), 1.0 - 0.2 / whole, title, ha="center", fontsize=12)
        draws.append(_actor(ax, scene, r, film, base))
    clock = figure.text(0.5, 0.33 / whole, "", ha="center", fontsize=11)
    tilt = f"only tilts drawn {larger} times larger" if larger > 1 else "drawn to scale"
    speed = f"{slowed} times slower" if slowed > 1 else "real time"
    speed += "; seen from the base" if still else ""
    figure.text(0.5, 0.12 / whole, f"{tilt}; {speed}", ha="center", fontsize=10)

    def draw(i: int) -> list[Artist]:
        clock.set_text(f"t = {times[i]:.2f} s")
        return [*(artist for each in draws for artist in each(i)), clock]

    return figure, draw


def _shapes(scene: Scene, r: Reel, i: int, larger: int, base: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the block, (4, 2), and hinge and bob, (2, 2) or none, of one frame, m."""
    block = corners(scene, float(r.tilt[i]) * (1 if r.lost[i] else larger), base)
    if r.pendulum is None or r.lost[i]:
        return block, np.zeros((0, 2))
    return block, rod(block, r.pendulum.length, float(r.angle[i]))


def _actor(
    ax: Axes, scene: Scene, r: Reel, film: list[tuple[np.ndarray, np.ndarray]], base: np.ndarray
) -> Callable[[int], list[Artist]]:
    """Add one motion to `ax`; returns a function that sets a frame of it and returns what moves."""
    reach, thick = 0.7 * scene.block.width, 0.03 * scene.block.height
    slab = np.array([[-reach, 0.0], [reach, 0.0], [reach, -thick], [-reach, -thick]])
    block, ground = Polygon(film[0][0], fc=BODY, ec=INK, lw=1.4), Polygon(slab, fc=INK, ec=INK)
    ax.add_patch(block)
    ax.add_patch(ground)
    # A fixed mark shows the motion of the base.
    ax.plot([0.0], [-1.8 * thick], marker="^", ms=5, color=INK)
    (line,) = ax.plot([], [], color=BLUE, lw=2.0)
    (bob,) = ax.plot([], [], "o", ms=8, color=INK)
    fallen = ax.text(0.5, 0.93, "", transform=ax.transAxes, ha="center", fontsize=11, weight="bold")

    def draw(i: int) -> list[Artist]:
        corner, with_it = film[i]
        block.set_xy(corner)
        ground.set_xy(slab + np.array([base[i], 0.0]))
        fallen.set_text("overturned" if r.lost[i] else "")
        line.set_data(*with_it.T)
        bob.set_data(*with_it[1:].T)
        return [block, ground, line, bob, fallen]

    return draw
