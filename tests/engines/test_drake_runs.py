"""Drake beside the equations and MuJoCo: impacts, uplift and a pendulum."""

import sys

import numpy as np
import pytest

import tpd
from tpd.engines.rigid_body import body_of, parameters_under
from tpd.engines.rollouts import follow as in_mujoco

pytest.importorskip("pydrake")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

BLOCK = tpd.Block(width=0.1, height=0.4, mass=16.0, restitution="housner")
SCENE = tpd.Scene(BLOCK, tpd.Harmonic(frequency=2.5, amplitude=0.015))
HUNG = tpd.Pendulum(mass=6.4, length=0.08, damping_ratio=0.3)


def body(pendulum, steps=1):
    return body_of(SCENE, parameters_under(SCENE, pendulum), 0.6, steps)


def test_impacts_are_those_of_housner():
    from tpd.engines.drake_runs import free_rocking

    one = body(None, steps=5)
    assert free_rocking(one) == pytest.approx(one.housner, abs=2e-3)


@pytest.mark.parametrize("pendulum", [None, HUNG])
def test_motions_are_those_of_mujoco(pendulum):
    """Two seconds of a harmonic of 0.2 to 0.32 g, from rest: below 0.25 g the bare block stands."""
    from tpd.engines.drake_runs import follow

    sizes = np.array([[2.0], [2.8], [3.2]])
    case = [body(pendulum, steps=5)] * 3, np.zeros((3, 4)), lambda t: sizes * np.sin(2.0 * np.pi * 2.5 * t)
    ends = np.full(3, 1.0), np.full(3, 0.8)
    ours, theirs = follow(*case, *ends), in_mujoco(*case, *ends)
    assert np.array_equal(ours.overturned, theirs.overturned)
    assert ours.peak == pytest.approx(theirs.peak, abs=4e-3)
    assert ours.relative == pytest.approx(theirs.relative, abs=4e-3)
    assert np.all(ours.slid < 1e-3)
    if pendulum is None:
        assert ours.peak[0] < 1e-3 < 0.02 < ours.peak[1]


def test_the_answer_names_what_is_left_out():
    rough = tpd.Scene(tpd.Block(width=0.1, height=0.4, mass=16.0, friction=0.02), SCENE.motion)
    found = tpd.engines.drake(rough, HUNG, runs=2, periods=2)
    assert found.engine.startswith("Drake ")
    assert "Drake" in found.losses
    assert "leaves out the block's friction of rocking" in found.losses
    assert len(found.finer[0].peak) == 2


def test_without_drake_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pydrake", None)
    with pytest.raises(ValueError, match=r"pip install 'tpd\[drake\]'"):
        tpd.engines.drake(SCENE, HUNG, runs=1)
