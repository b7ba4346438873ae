"""Animation of the block on its moving base, without the pendulum and with it."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from tpd.core.scene import Pendulum, Scene
from tpd.design.study import TimeHistory
from tpd.plot.drawing import BODY, corners, rod
from tpd.plot.style import BLUE, INK

_RATE = 20
"""Frames a second."""
_SECONDS = 6.0
"""Longest duration, s."""
_PER_PERIOD = 8
"""Fewest frames in a forcing period; where real time has fewer, the motion is slowed."""
_VISIBLE = 0.05
"""rad; smaller tilts are magnified."""
_MAGNIFIED = (1, 2, 5, 10, 20, 50, 100)
_TALL, _WIDE, _NARROW = 3.6, 4.2, 2.0
"""Largest height, largest and least width of one motion, inches."""
_ABOVE, _BELOW, _LEAST = 0.35, 0.5, 3.6
"""Room for words above and below, and the least width of the figure, inches."""
_DPI = 80


@dataclass(frozen=True)
class Reel:
    """Frames of one motion from rest, shapes (frames,); angles in rad."""

    pendulum: Pendulum | None
    tilt: np.ndarray
    """A right angle from the frame on in which it is reached: the equations end there."""
    angle: np.ndarray
    lost: np.ndarray
    """Whether the block has overturned by then."""

    @property
    def name(self) -> str:
        """Title of the picture."""
        return "without pendulum" if self.pendulum is None else "with the pendulum"


def animate(scene: Scene, pendulum: Pendulum | None, histories: Sequence[TimeHistory]) -> bytes:
    """A GIF of the first seconds from rest: left the block without, right with the pendulum.

    Real time, unless the shaking is too fast for that; true geometry, unless tilts are too small to be
    seen: then they are magnified. The picture says so.

    Args:
        scene: block and base motion.
        pendulum: None for the bare block alone.
        histories: exact time histories, of the bare block and with the pendulum.
    """
    slowed = max(1, math.ceil(_PER_PERIOD * scene.motion.frequency / _RATE))
    frames = int(_RATE * min(_SECONDS, 24.0 / scene.motion.frequency * slowed))
    times = np.arange(frames) / (_RATE * slowed)
    exact = [h for h in histories if h.model == "exact"]
    reels = [reel(h, pendulum if h.with_pendulum else None, times) for h in exact]
    figure, draw = _stage(scene, reels, times, _factor(reels), slowed)
    with tempfile.TemporaryDirectory() as folder:
        path, writer = Path(folder) / "motion.gif", PillowWriter(fps=_RATE)
        with writer.saving(figure, str(path), dpi=_DPI):
            for i in range(frames):
                draw(i)
                writer.grab_frame()
        return path.read_bytes()


def reel(history: TimeHistory, pendulum: Pendulum | None, times: np.ndarray) -> Reel:
    """Frames at `times` (s) of a time history."""
    known = np.isfinite(history.tilt) & np.isfinite(history.bob)
    sound = known & (np.abs(history.tilt) < 0.5 * math.pi)
    end = len(sound) if sound.all() else int(np.argmin(sound))
    side = math.copysign(0.5 * math.pi, history.tilt[max(end - 1, 0)])
    lost = times >= history.time[end] if end < len(sound) else np.zeros(len(times), bool)
    part = slice(0, max(end, 1))
    tilt, bob = (np.interp(times, history.time[part], x[part]) for x in (history.tilt, history.bob))
    return Reel(pendulum, np.where(lost, side, tilt), np.where(lost, 0.0, bob), lost)


def _factor(reels: list[Reel]) -> int:
    """Magnification of the tilts, one for all motions."""
    largest = max(float(np.abs(r.tilt).max()) for r in reels)
    return next((m for m in _MAGNIFIED if m * largest >= _VISIBLE), 1) if largest > 1e-9 else 1


def _stage(
    scene: Scene, reels: list[Reel], times: np.ndarray, larger: int, slowed: int
) -> tuple[Figure, Callable[[int], None]]:
    """Make the figure, and a function that draws a frame of it."""
    low, high = _bounds(scene, reels, larger)
    shape = (high[0] - low[0]) / (high[1] - low[1])
    tall = min(_TALL, _WIDE / shape)
    box, whole = max(tall * shape, _NARROW), tall + _ABOVE + _BELOW
    width = max(box * len(reels), _LEAST)
    figure = Figure(figsize=(width, whole), dpi=_DPI)
    FigureCanvasAgg(figure)
    draws = []
    for i, reel in enumerate(reels):
        ax = figure.add_axes((i / len(reels), _BELOW / whole, 1.0 / len(reels), tall / whole))
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ax.set_aspect("equal")
        ax.set_axis_off()
        # Not the axes' title, which is placed anew in every frame, and slowly.
        figure.text((i + 0.5) / len(reels), 1.0 - 0.2 / whole, reel.name, ha="center", fontsize=12)
        draws.append(_actor(ax, scene, reel, times, larger))
    clock = figure.text(0.5, 0.33 / whole, "", ha="center", fontsize=11)
    figure.text(0.5, 0.12 / whole, _remarks(larger, slowed), ha="center", fontsize=10)

    def draw(i: int) -> None:
        for each in draws:
            each(i)
        clock.set_text(f"t = {times[i]:.2f} s")

    return figure, draw


def _remarks(larger: int, slowed: int) -> str:
    """Words on scale and speed."""
    tilt = f"only tilts drawn {larger} times larger" if larger > 1 else "drawn to scale"
    return f"{tilt}; {f'{slowed} times slower' if slowed > 1 else 'real time'}"


def _bounds(scene: Scene, reels: list[Reel], larger: int) -> tuple[np.ndarray, np.ndarray]:
    """Lower left and upper right corner of everything drawn, m, the base in the middle."""
    points = []
    for reel in reels:
        for tilt, angle, lost in zip(reel.tilt, reel.angle, reel.lost, strict=True):
            block = corners(scene, float(tilt) * (1 if lost else larger))
            points.append(block)
            if reel.pendulum is not None and not lost:
                points.append(rod(block, reel.pendulum.length, float(angle)))
    every = np.concatenate(points)
    pad = 0.08 * scene.block.height
    side = max(float(np.abs(every[:, 0]).max()), 0.7 * scene.block.width) + scene.motion.amplitude + pad
    return np.array([-side, min(float(every[:, 1].min()), 0.0) - pad]), np.array(
        [side, every[:, 1].max() + pad]
    )


def _base(scene: Scene, t: np.ndarray) -> np.ndarray:
    return scene.motion.amplitude * np.sin(scene.motion.rate * t)


def _actor(ax: Axes, scene: Scene, reel: Reel, times: np.ndarray, larger: int) -> Callable[[int], None]:
    """Add one motion to `ax`; returns a function that draws a frame of it."""
    half = 0.5 * scene.block.width
    base = _base(scene, times)
    block = Polygon(corners(scene, 0.0), closed=True, fc=BODY, ec=INK, lw=1.4)
    ax.add_patch(block)
    thick = 0.03 * scene.block.height
    slab = np.array([[-1.4 * half, 0.0], [1.4 * half, 0.0], [1.4 * half, -thick], [-1.4 * half, -thick]])
    ground = Polygon(slab, closed=True, fc=INK, ec=INK)
    ax.add_patch(ground)
    # A fixed mark, for the base to be seen moving against.
    ax.plot([0.0], [-1.8 * thick], marker="^", ms=5, color=INK)
    (line,) = ax.plot([], [], color=BLUE, lw=2.0)
    (bob,) = ax.plot([], [], "o", ms=8, color=INK)
    fallen = ax.text(0.5, 0.93, "", transform=ax.transAxes, ha="center", fontsize=11, weight="bold")

    def draw(i: int) -> None:
        lost = bool(reel.lost[i])
        shape = corners(scene, float(reel.tilt[i]) * (1 if lost else larger), float(base[i]))
        block.set_xy(shape)
        ground.set_xy(slab + np.array([base[i], 0.0]))
        fallen.set_text("overturned" if lost else "")
        if reel.pendulum is not None:
            hung = rod(shape, reel.pendulum.length, float(reel.angle[i]))
            line.set_data(*(hung.T if not lost else np.zeros((2, 0))))
            bob.set_data(*(hung[1:].T if not lost else np.zeros((2, 0))))

    return draw
