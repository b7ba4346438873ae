"""The drawing to scale and the animation."""

import dataclasses
import io

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

import tpd
from tests import designs
from tpd.core.bob import Bob
from tpd.plot.animation import animate, reel
from tpd.plot.drawing import corners, plot_scene, rod

CHIMNEY = tpd.Scene(tpd.Block(width=1.0, height=10.0, mass=20e3), tpd.Harmonic(amplitude=0.15, frequency=0.8))


@pytest.mark.parametrize(
    ("scene", "pendulum"),
    [
        (designs.SCENE, designs.HUNG),
        (CHIMNEY, tpd.Pendulum(mass=2e3, length=10.0, damping_ratio=0.1)),
        (CHIMNEY, tpd.Pendulum(mass=2e3, length=0.5, damping_ratio=0.1)),
        (CHIMNEY, None),
    ],
)
def test_the_drawing_is_to_scale_and_nothing_is_cut_off_or_covered(scene, pendulum):
    ax = plot_scene(scene, pendulum, stroke=0.0 if pendulum is None else 0.5)
    figure = ax.figure
    figure.canvas.draw()
    assert ax.get_aspect() == 1.0
    block = ax.patches[0].get_window_extent()
    assert block.height / block.width == pytest.approx(scene.block.height / scene.block.width, rel=0.02)
    # An annotation's own extent would count the line that leads to it.
    words = [Text.get_window_extent(t) for t in ax.texts if t.get_text()]
    for i, box in enumerate(words):
        assert figure.bbox.x0 <= box.x0
        assert box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0
        assert box.y1 <= figure.bbox.y1
        assert not any(box.overlaps(other) for other in words[i + 1 :])


CAVE = dataclasses.replace(designs.SCENE, block=dataclasses.replace(designs.SCENE.block, cavity_width=0.085))


@pytest.mark.parametrize("bob", [Bob(), Bob(shape="cylinder", aspect=2.0), Bob(density=700.0)])
def test_cavity_and_bob_are_drawn_to_scale_and_no_word_is_cut_off(bob):
    ax = plot_scene(CAVE, designs.HUNG, stroke=0.3, bob=bob)
    ax.figure.canvas.draw()
    inch = ax.patches[0].get_window_extent().width / 0.1
    shapes = [patch.get_window_extent() for patch in ax.patches]
    # Block, cavity, the body at both ends of its swing, and at rest.
    assert len(shapes) == 5
    assert shapes[1].width / inch == pytest.approx(0.085, rel=0.02)
    assert shapes[-1].width / inch == pytest.approx(2.0 * bob.radius(1.6224), rel=0.03)
    assert shapes[-1].height / inch == pytest.approx(2.0 * bob.half_height(1.6224), rel=0.03)
    right = max(shape.x1 for shape in shapes[2:4]) - 0.5 * (shapes[0].x0 + shapes[0].x1)
    assert right / inch == pytest.approx(bob.reach(1.6224, 0.12, 0.3), rel=0.03)
    words = [Text.get_window_extent(t) for t in ax.texts if t.get_text()]
    assert max(box.x1 for box in words) <= ax.figure.bbox.x1
    assert not any(box.overlaps(other) for i, box in enumerate(words) for other in words[i + 1 :])
    said = " ".join(t.get_text() for t in ax.texts)
    assert "cavity, 0.085 m wide" in said
    assert f"bob, 1.622 kg: {bob.shape}" in said


@pytest.mark.parametrize("tilt", [0.0, 0.3, -0.3, 0.5 * np.pi])
def test_a_tilted_block_stands_on_its_corner(tilt):
    block = corners(designs.SCENE, tilt, base=0.02)
    assert block[:, 1].min() == pytest.approx(0.0, abs=1e-12)
    pivot = block[0] if tilt > 0 else block[1]
    assert pivot == pytest.approx((0.02 + (-0.05 if tilt > 0 else 0.05), 0.0), abs=1e-12)
    sides = np.linalg.norm(np.diff(block, axis=0), axis=1)
    assert sides == pytest.approx([0.1, 0.4, 0.1])
    # Counterclockwise: the top moves to the left.
    assert np.sign(np.round(block[2:, 0].mean() - 0.02, 12)) == -np.sign(tilt)
    hinge, bob = rod(block, 0.2, 0.3)
    assert hinge == pytest.approx(0.5 * (block[2] + block[3]))
    assert bob - hinge == pytest.approx((0.2 * np.sin(0.3), -0.2 * np.cos(0.3)))


def test_the_animation_is_small_and_moves():
    histories = (designs.history(False), designs.history(True, size=0.04))
    film = animate(designs.SCENE, designs.HUNG, histories)
    assert len(film) < 3e6
    image = Image.open(io.BytesIO(film))
    assert image.format == "GIF"
    assert image.n_frames > 60
    assert image.info["duration"] == 50
    frames = []
    for i in (0, 33):
        image.seek(i)
        frames.append(np.asarray(image.convert("L")))
    # Upper half of the block without a pendulum.
    height, width = frames[0].shape
    assert (frames[0] != frames[1])[: height // 2, : width // 2].mean() > 0.02


def test_an_overturned_block_lies_and_is_called_so():
    times = np.arange(100) / 20.0
    found = reel(designs.history(False, lost=True), None, times)
    assert found.lost[-1]
    assert not found.lost[0]
    assert np.abs(found.tilt).max() == pytest.approx(0.5 * np.pi)
    assert np.isfinite(found.tilt).all()
    # The history reaches a right angle at t = ln(50 pi)/2 = 2.53 s.
    assert times[np.argmax(found.lost)] == pytest.approx(2.55)


def test_frames_are_the_time_history_between_its_samples():
    history, times = designs.history(True), np.array([0.0, 1.003, 2.0])
    found = reel(history, designs.HUNG, times)
    assert found.tilt == pytest.approx(np.interp(times, history.time, history.tilt))
    assert found.angle == pytest.approx(np.interp(times, history.time, history.bob))
    assert not found.lost.any()
