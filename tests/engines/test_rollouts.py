"""Runs of MuJoCo against Housner's impact and a pendulum on its own."""

import math
import sys

import numpy as np
import pytest

import tpd
from tpd.engines.rigid_body import body_of, parameters_under
from tpd.engines.rollouts import available, follow, free_rocking

pytest.importorskip("mujoco")
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution="housner")
PULSE = tpd.Pulse.one_sine(acceleration=9.80665 / 6.0, frequency=1.2375)


def body(block, pendulum=None, steps=1):
    scene = tpd.Scene(block, PULSE)
    return body_of(scene, parameters_under(scene, pendulum), 0.6, steps)


@pytest.mark.parametrize("size", [(0.1, 0.4, 8.0), (1.0, 6.0, 9000.0), (2.0, 14.0, 70_000.0)])
def test_impacts_in_mujoco_have_housners_restitution(size):
    width, height, mass = size
    one = body(tpd.Block(width=width, height=height, mass=mass, restitution="housner"), steps=5)
    assert free_rocking(one) == pytest.approx(one.housner, abs=2e-3)


def test_the_bob_in_mujoco_swings_with_the_pendulum_frequency():
    # A bob without weight beside the block, let go at a small angle.
    light = tpd.Pendulum(mass=1e-3, length=2.0, damping_ratio=0.1)
    rate = math.sqrt(9.80665 / 2.0)
    start, period = np.array([[0.0, 0.05, 0.0, 0.0]]), 2.0 * math.pi / rate / math.sqrt(1.0 - 0.1**2)
    late = np.array([0.75 * period])
    found = follow([body(COLUMN, light)], start, lambda t: np.zeros((1, len(t))), late + 0.3 * period, late)
    assert found.rod_angle[0] == pytest.approx(0.05, rel=1e-3)
    assert found.tilt[0] < 1e-4


def test_a_missing_engine_is_reported_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ValueError, match=r"pip install '.\[engines\]'"):
        available()
