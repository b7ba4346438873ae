"""The film: frames are those of the time history, and an overturned block lies."""

import dataclasses
import io

import numpy as np
import pytest
from PIL import Image

from tests.plots import examples
from tpd.plots.animation import animate, reel


def test_the_animation_is_a_moving_gif_below_1_megabyte():
    histories = (examples.history(False), examples.history(True, size=0.04))
    film = animate(examples.SCENE, examples.PENDULUM, histories)
    assert len(film) < 1e6
    image = Image.open(io.BytesIO(film))
    assert image.format == "GIF"
    assert image.n_frames == 60
    assert image.info["duration"] == 100
    frames = []
    for i in (0, 33):
        image.seek(i)
        frames.append(np.asarray(image.convert("L")))
    # Upper half of the block without a pendulum.
    height, width = frames[0].shape
    assert (frames[0] != frames[1])[: height // 2, : width // 2].mean() > 0.02


def test_an_overturned_block_lies_in_the_film_and_is_labelled():
    times = np.arange(100) / 20.0
    found = reel(examples.history(False, overturns=True), None, times)
    assert found.is_overturned[-1]
    assert not found.is_overturned[0]
    assert np.abs(found.tilt).max() == pytest.approx(0.5 * np.pi)
    assert np.isfinite(found.tilt).all()
    # The history reaches a right angle at t = ln(50 pi)/2 = 2.53 s.
    assert times[np.argmax(found.is_overturned)] == pytest.approx(2.55)


def test_a_block_without_a_result_is_not_labelled_overturned():
    history, times = examples.history(False, overturns=True), np.arange(100) / 20.0
    found = reel(dataclasses.replace(history, overturned=False), None, times)
    assert not found.is_overturned.any()
    assert np.isfinite(found.tilt).all()
    assert np.abs(found.tilt).max() < 0.5 * np.pi
