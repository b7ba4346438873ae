"""Animation of the block as seen from its base, without and with the pendulum."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.font_manager import FontProperties, findfont
from PIL import Image, ImageDraw, ImageFont

from tpd.design.as_built import TimeHistory
from tpd.plots.drawing import BODY, corners, rod
from tpd.plots.style import BLUE, INK
from tpd.scene.scene import Pendulum, Scene

_RATE, _SECONDS = 10, 6.0
"""Frames per second, and longest duration, s."""
_BEFORE = 0.6
"""Share of a film before the moment that it must show."""
_PER_PERIOD = 8
"""Smallest number of frames in a forcing period. The film is slowed if real time has fewer frames."""
_VISIBLE, _MAGNIFIED = 0.05, (1, 2, 5, 10, 20, 50, 100)
"""Tilt (rad) below which tilts are magnified, and the factors to choose from."""
_FINE, _DPI = 2, 80
"""Pixels that are drawn for one pixel of the film in each direction; pixels of the film per inch."""
_TALL, _WIDE, _NARROW, _ABOVE, _BELOW, _LEAST, _BOB = (
    round(inches * _DPI * _FINE) for inches in (3.6, 4.2, 2.0, 0.35, 0.5, 3.6, 0.055)
)
"""Largest height, largest width and smallest width of the picture of one motion; space for texts above and
below; smallest width of the whole; radius of the bob. All are in drawn pixels."""
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
    moment = max((h.times[np.isfinite(h.tilt)][-1] for h in histories if h.overturned), default=0.0)
    times += max(0.0, moment - _BEFORE * times[-1])
    reels = [reel(h, None if h.swing is None else pendulum, times) for h in histories]
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
    swing = np.zeros_like(history.tilt) if history.swing is None else history.swing
    is_upright = np.isfinite(swing) & (np.abs(history.tilt) < 0.5 * math.pi)
    end = len(is_upright) if is_upright.all() else int(np.argmin(is_upright))
    # An overturned block is drawn lying on its side. If the model has no result from some time on, the block
    # is drawn as at that time.
    side = math.copysign(0.5 * math.pi, history.tilt[max(end - 1, 0)])
    overturns = history.overturned and end < len(is_upright)
    overturned = times >= history.times[end] if overturns else np.zeros(len(times), bool)
    part = slice(0, max(end, 1))
    tilt, bob = (np.interp(times, history.times[part], x[part]) for x in (history.tilt, swing))
    return Reel(pendulum, np.where(overturned, side, tilt), np.where(overturned, 0.0, bob), overturned)


def _pictures(scene: Scene, reels: list[Reel], times: np.ndarray, speed: str) -> list[Image.Image]:
    """Return the pictures of a film. The text `speed` stands below them."""
    largest = max(float(np.abs(r.tilt).max()) for r in reels)
    # Tilts of a hundredth of a radian cannot be seen. Bob angles are always large enough.
    factor = next((m for m in _MAGNIFIED if m * largest >= _VISIBLE), 1) if largest > 1e-9 else 1
    # The pictures must contain all frames, so all shapes are computed before the first one is drawn.
    films = [[_shapes(scene, r, i, factor) for i in range(len(times))] for r in reels]
    across, up = np.concatenate([x for film in films for shapes in film for x in shapes]).T
    # The margin keeps lines at the edge of the view visible.
    pad = 0.08 * scene.block.height
    reach, thick = 0.7 * scene.block.width, 0.03 * scene.block.height
    side = max(float(np.abs(across).max()), reach) + pad
    low, high = min(float(up.min()), 0.0) - pad, float(up.max()) + pad
    # The picture is as large as height and width of one motion allow. Each motion has the same scale.
    scale = min(_TALL / (high - low), _WIDE / (2.0 * side))
    view = max(2.0 * side * scale, _NARROW, _LEAST / len(reels))
    centres = [round((i + 0.5) * view) for i in range(len(reels))]
    width, bottom = round(view * len(reels)), round(_ABOVE + (high - low) * scale)

    fonts = {weight: findfont(FontProperties(weight=weight)) for weight in ("normal", "bold")}

    def pixels(points: np.ndarray, centre: int) -> list[tuple[float, float]]:
        return [(centre + scale * x, bottom + scale * (low - y)) for x, y in points.tolist()]

    def write(pen: Any, x: float, y: float, text: str, size: int, weight: str = "normal") -> None:
        font = ImageFont.truetype(fonts[weight], round(size * _FINE * _DPI / 72.0))
        pen.text((x, y), text, INK, font, anchor="mm")

    still = Image.new("RGB", (width, bottom + _BELOW), "white")
    pen = ImageDraw.Draw(still)
    slab = np.array([[-reach, 0.0], [reach, 0.0], [reach, -thick], [-reach, -thick]])
    for r, centre in zip(reels, centres, strict=True):
        write(
            pen, 1.0 * centre, 0.5 * _ABOVE, "without pendulum" if r.pendulum is None else "with pendulum", 12
        )
        pen.polygon(pixels(slab, centre), INK)
    tilt = f"tilts magnified {factor} times" if factor > 1 else "drawn to scale"
    write(pen, 0.5 * width, bottom + 0.75 * _BELOW, f"{tilt}; {speed}", 10)
    pictures = []
    for i, time in enumerate(times):
        picture = still.copy()
        pen = ImageDraw.Draw(picture)
        write(pen, 0.5 * width, bottom + 0.35 * _BELOW, f"t = {time:.2f} s", 11)
        for r, film, centre in zip(reels, films, centres, strict=True):
            block, pendulum = (pixels(shape, centre) for shape in film[i])
            pen.polygon(block, BODY, INK, 2 * _FINE)
            for x, y in pendulum[1:]:
                pen.line(pendulum, BLUE, 2 * _FINE)
                pen.ellipse((x - _BOB, y - _BOB, x + _BOB, y + _BOB), INK)
            # A block that lies on its side could also be one at the largest magnified tilt.
            if r.is_overturned[i]:
                write(pen, 1.0 * centre, _ABOVE + 0.07 * (bottom - _ABOVE), "overturned", 11, "bold")
        # Pixels of which a part is covered get a mixed colour, so that edges are smooth.
        pictures.append(picture.reduce(_FINE))
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
