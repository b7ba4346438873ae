"""Models as text: MuJoCo's as MuJoCo reads it; that of OpenSees by an interpreter of Tcl with stubs."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tpd
from tpd.engines import mjcf, opensees
from tpd.engines.rigid_body import body_of

tkinter = pytest.importorskip("tkinter")
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution="housner")
PENDULUM = tpd.Pendulum(mass=900.0, length=2.1, damping_ratio=0.2)
PULSE = tpd.Pulse.one_sine(acceleration=2.0 * 9.80665 / 6.0, frequency=1.2375)
SCENE = tpd.Scene(COLUMN, PULSE)
STUBS = (
    *("wipe", "model", "node", "fix", "mass", "geomTransf", "element", "uniaxialMaterial", "frictionModel"),
    *("region", "equalDOF", "timeSeries", "load", "constraints", "numberer", "system", "test", "algorithm"),
    *("integrator", "analysis", "loadConst", "wipeAnalysis", "recorder", "setNodeVel"),
)


def stubbed(text: str) -> tuple[list[tuple[str, ...]], list[str]]:
    """Commands of OpenSees that a text gives, as words, and the words of its time series' values."""
    tcl, said, time = tkinter.Tcl(), [], [0.0]

    def pattern(*words):
        said.append(("pattern", *words[:3]))
        if words[0] == "Plain":
            tcl.eval(words[3])

    def analyze(n, step="0"):
        time[0] += 1.0
        return 0

    for name in STUBS:
        tcl.createcommand(name, lambda *words, name=name: said.append((name, *words)) or "")
    others = {"pattern": pattern, "analyze": analyze, "getTime": lambda: time[0], "nodeDisp": lambda *_: 0.0}
    for name, command in others.items():
        tcl.createcommand(name, command)
    tcl.eval(text)
    values = next((words[words.index("-values") + 1].split() for words in said if "-values" in words), [])
    return said, values


OWN = 9000.0 * (0.5**2 + 3.0**2) / 3.0
"""Moment of inertia of the column about its centre, kg m^2."""


def test_the_contact_width_of_a_body_is_its_effective_width():
    block = replace(COLUMN, effective_width=0.9)
    scenes = tpd.Scene(COLUMN, PULSE), tpd.Scene(block, PULSE)
    whole, narrow = (body_of(scene, scene.ground_parameters(PENDULUM), 0.6) for scene in scenes)
    assert narrow.half_width == pytest.approx(0.9 * whole.half_width, rel=1e-15)
    # Mass and moment of inertia are those of the whole block.
    assert (narrow.mass, narrow.inertia) == pytest.approx((whole.mass, whole.inertia), rel=1e-14)
    assert narrow.housner == pytest.approx(float(block.velocity_ratio), rel=1e-14)


def test_the_mujoco_model_has_the_masses_of_the_scene():
    mujoco = pytest.importorskip("mujoco")

    model = mujoco.MjModel.from_xml_string(mjcf(SCENE, PENDULUM))
    np.testing.assert_allclose(model.body_mass, [0.0, 9000.0, 900.0])
    np.testing.assert_allclose(model.body_inertia[1], OWN, rtol=1e-12)
    assert model.nu == 2
    assert model.dof_damping[3] == pytest.approx(2.0 * 0.2 * 900.0 * 2.1 * math.sqrt(9.80665 * 2.1))
    with pytest.raises(ValueError, match="sliding"):
        mjcf(SCENE, sliding=-1.0)


def test_the_opensees_model_has_the_masses_of_the_scene():
    said, values = stubbed(opensees(SCENE, PENDULUM))

    def numbers(command):
        return {words[1]: [float(x) for x in words[2:]] for words in said if words[0] == command}

    assert numbers("mass") == {"5": [9000.0, 9000.0, pytest.approx(OWN)], "8": [900.0, 900.0, 0.0]}
    weights = {node: of[1] for node, of in numbers("load").items()}
    assert weights == {"5": pytest.approx(-9000.0 * 9.80665), "8": pytest.approx(-900.0 * 9.80665)}
    places = numbers("node")
    assert places["4"][:2] == [0.5, 0.0]
    assert places["7"][:2] == places["6"][:2] == [0.0, 6.0]
    assert places["8"][:2] == pytest.approx([0.0, 3.9])
    dashpot = next(words for words in said if words[:2] == ("uniaxialMaterial", "Viscous"))
    assert float(dashpot[3]) == pytest.approx(PENDULUM.hinge_damping())
    assert len(values) == len(PULSE.pieces()) + 1
    assert max(map(float, values)) == pytest.approx(PULSE.pga, rel=1e-4)


def test_opensees_models_exist_for_every_excitation_and_without_pendulum():
    record = tpd.Record([0.5, -1.0, 2.0], 0.02)
    said, values = stubbed(opensees(tpd.Scene(COLUMN, record)))
    assert list(map(float, values)) == pytest.approx([0.5, -1.0, 2.0])
    assert not any(words[:2] == ("node", "8") for words in said)
    paper = tpd.paper_scene()
    text = opensees(paper, sliding=0.8)
    said, values = stubbed(text)
    (series,) = [words for words in said if words[0] == "timeSeries"]
    assert series[1] == "Trig"
    assert float(series[5]) == pytest.approx(0.4)
    assert float(series[-1]) == pytest.approx(-0.015 * (2.0 * math.pi * 2.5) ** 2)
    (plastic,) = [words for words in said if words[:2] == ("uniaxialMaterial", "ElasticPP")]
    moment = 0.05 * 16.224 * 9.80665 * 0.2
    assert float(plastic[3]) * float(plastic[4]) == pytest.approx(moment)
    assert ("frictionModel", "Coulomb", "1", "0.8") in said
    assert max(map(len, text.splitlines())) <= 110
    with pytest.raises(ValueError, match="sliding"):
        opensees(paper, sliding=0.0)
