"""The drawing to scale."""

import dataclasses

import numpy as np
import pytest
from matplotlib.text import Text

import tpd
from tests.plots import examples
from tpd.core.formatting import number
from tpd.plots.drawing import corners, plot_scene, rod
from tpd.scene.bob import Bob

CHIMNEY = tpd.Scene(tpd.Block(width=1.0, height=10.0, mass=20e3), tpd.Harmonic(amplitude=0.15, frequency=0.8))
STATUE = tpd.Block(width=0.43, height=1.8, mass=700.0, frame_width=0.8)
FRAMED = dataclasses.replace(CHIMNEY, block=STATUE)
"""A solid block below a wider frame."""


@pytest.mark.parametrize(
    ("scene", "pendulum"),
    [
        (examples.SCENE, examples.PENDULUM),
        (CHIMNEY, tpd.Pendulum(mass=2e3, length=0.5, damping_ratio=0.1)),
        (CHIMNEY, None),
        (FRAMED, tpd.Pendulum(mass=60.0, length=0.5, damping_ratio=0.3, hinge_height=2.5)),
    ],
)
def test_the_drawing_is_to_scale_and_complete(scene, pendulum):
    ax = plot_scene(scene, pendulum, swing=0.0 if pendulum is None else 0.5)
    figure = ax.figure
    figure.canvas.draw()
    assert ax.get_aspect() == 1.0
    # On a sheet of A4, which has 7.3 inches between its margins, no word is smaller than 8 points.
    assert figure.get_figwidth() <= 7.3 + 1e-9
    assert min(t.get_fontsize() for view in figure.axes for t in view.texts if t.get_text()) >= 8.0
    block = ax.patches[0].get_window_extent()
    assert block.height / block.width == pytest.approx(scene.block.height / scene.block.width, rel=0.02)
    # An annotation's own extent would count the line that leads to it.
    words = [Text.get_window_extent(t) for view in figure.axes for t in view.texts if t.get_text()]
    whole = figure.bbox
    for i, box in enumerate(words):
        assert whole.x0 <= box.x0 <= box.x1 <= whole.x1
        assert whole.y0 <= box.y0 <= box.y1 <= whole.y1
        assert not any(box.overlaps(other) for other in words[i + 1 :])


CAVE = dataclasses.replace(
    examples.SCENE, block=dataclasses.replace(examples.SCENE.block, cavity_width=0.085)
)


@pytest.mark.parametrize("bob", [Bob(), Bob(shape="cylinder", aspect=2.0)])
def test_the_drawing_shows_the_pendulum_as_built(bob):
    whole, detail = plot_scene(CAVE, examples.PENDULUM, swing=0.2, bob=bob).figure.axes
    whole.figure.canvas.draw()
    mass, rod = bob.built(1.6224, 0.12, CAVE.gravity)
    half, radius = float(bob.half_height(mass)), float(bob.radius(mass))
    # Beam last but the body at both ends of its swing and at rest.
    left, right, rest = (patch.get_xy() for patch in detail.patches[-3:])
    assert np.ptp(rest[:, 0]) == pytest.approx(2.0 * radius, rel=2e-3)
    assert rest[:, 1].min() == pytest.approx(-rod - half)
    assert right[:, 0].max() == pytest.approx(bob.reach(mass, rod, 0.2), rel=2e-3)
    assert -left[:, 0].min() == pytest.approx(right[:, 0].max(), rel=2e-3)
    # The same body hangs in the block to its smaller scale.
    assert np.ptp(whole.patches[-1].get_xy()[:, 1]) == pytest.approx(2.0 * half, rel=2e-3)
    text = " ".join(t.get_text() for t in detail.texts)
    assert f"{number(rod)} m as built\n(0.12 m in the equations)" in text
    assert "0.085 m" in text
    assert f"bob, {number(mass)} kg: {bob.shape}" in text
    # The depth is that of the bob at rest, as in the table of the report.
    assert f"depth below the hinge: {number(rod + half)} m" in text


@pytest.mark.parametrize("tilt", [0.0, 0.3, -0.3, 0.5 * np.pi])
def test_a_tilted_block_stands_on_its_corner(tilt):
    block = corners(examples.SCENE, tilt)
    assert block[:, 1].min() == pytest.approx(0.0, abs=1e-12)
    pivot = block[0] if tilt > 0 else block[1]
    assert pivot == pytest.approx((-0.05 if tilt > 0 else 0.05, 0.0), abs=1e-12)
    sides = np.linalg.norm(np.diff(block, axis=0), axis=1)
    assert sides == pytest.approx([0.1, 0.4, 0.1])
    # Counterclockwise: the top moves to the left.
    assert np.sign(np.round(block[2:, 0].mean(), 12)) == -np.sign(tilt)
    hinge, bob = rod(block, 0.2, 0.3)
    assert hinge == pytest.approx(0.5 * (block[2] + block[3]))
    assert bob - hinge == pytest.approx((0.2 * np.sin(0.3), -0.2 * np.cos(0.3)))
