"""Animation of the block as seen from its base, without and with the pendulum."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Polygon
from PIL import Image

from tpd.design.as_built import TimeHistory
from tpd.plots.drawing import BODY, corners, rod
from tpd.plots.style import BLUE, INK, Picture, own_style
from tpd.scene.scene import Pendulum, Scene

_RATE, _SECONDS = 10, 6.0
"""Frames per second, and longest duration, s."""
_BEFORE = 0.6
"""Share of a film before the moment that it must show."""
_PER_PERIOD = 8
"""Smallest number of frames in a forcing period. The film is slowed if real time has fewer frames."""
_VISIBLE, _MAGNIFIED = 0.05, (1, 2, 5, 10, 20, 50, 100)
"""Tilt (rad) below which tilts are magnified, and the factors to choose from."""
_TALL, _WIDE, _NARROW = 3.6, 4.2, 2.0
"""Largest height, largest width and smallest width of the picture of one motion, inches."""
_ABOVE, _BELOW, _LEAST, _DPI = 0.35, 0.5, 3.6, 80
"""Space for texts above and below and smallest width of the figure, inches; dots per inch."""
_COLOURS = 64
"""Number of colours in a film: a few colours, and their mixtures at smoothed edges."""


@dataclass(frozen=True)
class Reel:
    """Frames of one motion from rest: arrays of shape (frames,), angles in rad."""

    pendulum: Pendulum | None
    tilt: np.ndarray
    """Tilt of the block. After a right angle it stays there, because the equations end there."""
    swing: np.ndarray
    """Bob angle from the vertical."""
    is_overturned: np.ndarray
    """Whether the block has overturned before or in the frame."""


@own_style()
def animate(scene: Scene, pendulum: Pendulum | None, histories: Sequence[TimeHistory]) -> bytes:
    """Return a GIF of some seconds: on the left without the pendulum, on the right with the pendulum.

    The film shows the last overturning, if the block overturns in one of the cases. Otherwise it shows the
    first seconds.

    The film is slowed if the excitation is too fast for real time, and tilts are magnified if they are too
    small to be seen. The picture states both. The base does not move in the picture.

    Args:
        scene: block with a harmonic excitation.
        pendulum: the pendulum; None for the block alone.
        histories: exact time histories, without and, if there is one, with the pendulum.
    """
    # With fewer frames in a period the motion would alias and seem to run backwards.
    slowed = max(1, math.ceil(_PER_PERIOD * scene.excitation.frequency / _RATE))
    seconds = min(_SECONDS, 24.0 / scene.excitation.frequency * slowed)
    # A frame of the film shows 1/slowed of the time that it lasts.
    times = np.arange(int(_RATE * seconds)) / (_RATE * slowed)
    moment = max((h.time[np.isfinite(h.tilt)][-1] for h in histories if h.overturned), default=0.0)
    times += max(0.0, moment - _BEFORE * times[-1])
    reels = [reel(h, pendulum if h.with_pendulum else None, times) for h in histories]
    speed = f"{slowed} times slower than real time" if slowed > 1 else "real time"
    pictures = _pictures(scene, reels, times, speed)
    # The first frame has all colours of the film, so its palette serves for all frames.
    palette = pictures[0].quantize(_COLOURS)
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    # A background that is only nearly white would be visible on a white page.
    colours[(colours > 246).all(axis=1)] = 255
    palette.putpalette(colours.ravel().tolist())
    film = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    out = io.BytesIO()
    film[0].save(out, "GIF", save_all=True, append_images=film[1:], duration=1000 // _RATE, loop=0)
    return out.getvalue()


def reel(history: TimeHistory, pendulum: Pendulum | None, times: np.ndarray) -> Reel:
    """Return the frames of a time history.

    Args:
        history: the motion.
        pendulum: the pendulum of this motion; None if there is none.
        times: times of the frames, s, shape (frames,).
    """
    is_finite = np.isfinite(history.tilt) & np.isfinite(history.bob)
    is_upright = is_finite & (np.abs(history.tilt) < 0.5 * math.pi)
    end = len(is_upright) if is_upright.all() else int(np.argmin(is_upright))
    # An overturned block is drawn lying on its side. If the model has no result from some time on, the block
    # is drawn as at that time.
    side = math.copysign(0.5 * math.pi, history.tilt[max(end - 1, 0)])
    overturns = history.overturned and end < len(is_upright)
    overturned = times >= history.time[end] if overturns else np.zeros(len(times), bool)
    part = slice(0, max(end, 1))
    tilt, bob = (np.interp(times, history.time[part], x[part]) for x in (history.tilt, history.bob))
    return Reel(pendulum, np.where(overturned, side, tilt), np.where(overturned, 0.0, bob), overturned)


def _pictures(scene: Scene, reels: list[Reel], times: np.ndarray, speed: str) -> list[Image.Image]:
    """Return the pictures of a film. The text `speed` stands below them."""
    largest = max(float(np.abs(r.tilt).max()) for r in reels)
    # Tilts of a hundredth of a radian cannot be seen. Bob angles are always large enough.
    factor = next((m for m in _MAGNIFIED if m * largest >= _VISIBLE), 1) if largest > 1e-9 else 1
    # The limits of the axes must contain all frames, so all shapes are computed before the figure is made.
    films = [[_shapes(scene, r, i, factor) for i in range(len(times))] for r in reels]
    across, up = np.concatenate([x for film in films for shapes in film for x in shapes]).T
    # The margin keeps lines at the edge of the view visible.
    pad = 0.08 * scene.block.height
    side = max(float(np.abs(across).max()), 0.7 * scene.block.width) + pad
    low, high = min(float(up.min()), 0.0) - pad, float(up.max()) + pad
    shape = 2.0 * side / (high - low)
    # The picture is as large as height and width of one motion allow.
    tall = min(_TALL, _WIDE / shape)
    whole, width = tall + _ABOVE + _BELOW, max(max(tall * shape, _NARROW) * len(reels), _LEAST)
    # Each case has its own axes, with the same scale.
    figure, actors = Picture(figsize=(width, whole), dpi=_DPI), []
    reach, thick = 0.7 * scene.block.width, 0.03 * scene.block.height
    slab = np.array([[-reach, 0.0], [reach, 0.0], [reach, -thick], [-reach, -thick]])
    for i, (r, film) in enumerate(zip(reels, films, strict=True)):
        ax = figure.add_axes((i / len(reels), _BELOW / whole, 1.0 / len(reels), tall / whole))
        ax.set(xlim=(-side, side), ylim=(low, high), aspect="equal")
        ax.set_axis_off()
        title = "without pendulum" if r.pendulum is None else "with pendulum"
        figure.text((i + 0.5) / len(reels), 1.0 - 0.2 / whole, title, ha="center", fontsize=12)
        block = ax.add_patch(Polygon(film[0][0], fc=BODY, ec=INK, lw=1.4))
        ax.add_patch(Polygon(slab, fc=INK, ec=INK))
        (line,) = ax.plot([], [], color=BLUE, lw=2.0)
        (bob,) = ax.plot([], [], "o", ms=8, color=INK)
        # A block that lies on its side could also be one at the largest magnified tilt.
        label = ax.text(0.5, 0.93, "", transform=ax.transAxes, ha="center", fontsize=11, weight="bold")
        actors.append((r, film, block, line, bob, label))
    clock = figure.text(0.5, 0.33 / whole, "", ha="center", fontsize=11)
    tilt = f"tilts magnified {factor} times" if factor > 1 else "drawn to scale"
    figure.text(0.5, 0.12 / whole, f"{tilt}; {speed}", ha="center", fontsize=10)
    # All artists are made before. A frame only moves them, and replaces the texts.
    canvas, pictures = FigureCanvasAgg(figure), []
    for i, time in enumerate(times):
        clock.set_text(f"t = {time:.2f} s")
        for r, film, block, line, bob, label in actors:
            corner, pendulum = film[i]
            block.set_xy(corner)
            label.set_text("overturned" if r.is_overturned[i] else "")
            line.set_data(*pendulum.T)
            bob.set_data(*pendulum[1:].T)
        canvas.draw()
        # The canvas reuses its memory, so each frame is copied.
        pictures.append(Image.fromarray(np.array(canvas.buffer_rgba())[..., :3]))
    return pictures


def _shapes(scene: Scene, r: Reel, i: int, factor: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the block in the i-th frame, m, shape (4, 2), with its tilt multiplied by a
    factor, and hinge and bob, m, shape (2, 2), or (0, 2) without a pendulum and after an overturning."""
    block = corners(scene, float(r.tilt[i]) * (1 if r.is_overturned[i] else factor))
    if r.pendulum is None or r.is_overturned[i]:
        return block, np.zeros((0, 2))
    # The tilt is magnified, so the hinge is placed within the drawn block.
    share = r.pendulum.hinge_in(scene.block) / scene.block.height
    return block, rod(block, r.pendulum.length, float(r.swing[i]), share)
