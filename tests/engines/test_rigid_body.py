"""Models as text: MuJoCo's as MuJoCo reads it; that of OpenSees by an interpreter of Tcl with stubs, and its
motion where openseespy is installed."""

import math
import re
from itertools import pairwise

import numpy as np
import pytest

import tpd
from tpd.engines import mjcf, opensees

tkinter = pytest.importorskip("tkinter")
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution="housner")
HUNG = tpd.Pendulum(mass=900.0, length=2.1, damping_ratio=0.2)
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

    def note(name):
        return lambda *words: said.append((name, *words)) or ""

    def pattern(*words):
        said.append(("pattern", *words[:3]))
        if words[0] == "Plain":
            tcl.eval(words[3])

    def analyze(n, step="0"):
        time[0] += 1.0
        return 0

    for name in STUBS:
        tcl.createcommand(name, note(name))
    tcl.createcommand("pattern", pattern)
    tcl.createcommand("analyze", analyze)
    tcl.createcommand("getTime", lambda: time[0])
    tcl.createcommand("nodeDisp", lambda *_: 0.0)
    tcl.eval(text)
    values = next((words[words.index("-values") + 1].split() for words in said if "-values" in words), [])
    return said, values


def test_the_text_for_mujoco_has_the_masses_of_the_scene():
    mujoco = pytest.importorskip("mujoco")

    model = mujoco.MjModel.from_xml_string(mjcf(SCENE, HUNG))
    np.testing.assert_allclose(model.body_mass, [0.0, 9000.0, 900.0])
    assert model.nu == 2
    own = 9000.0 * (0.5**2 + 3.0**2) / 3.0
    np.testing.assert_allclose(model.body_inertia[1], own, rtol=1e-12)
    hinge = 2.0 * 0.2 * 900.0 * 2.1 * math.sqrt(9.80665 * 2.1)
    assert model.dof_damping[3] == pytest.approx(hinge)
    with pytest.raises(ValueError, match="sliding"):
        mjcf(SCENE, sliding=-1.0)


def test_the_text_for_opensees_has_the_masses_of_the_scene():
    said, values = stubbed(opensees(SCENE, HUNG))
    own = 9000.0 * (0.5**2 + 3.0**2) / 3.0
    masses = {words[1]: [float(x) for x in words[2:]] for words in said if words[0] == "mass"}
    assert masses == {"5": [9000.0, 9000.0, pytest.approx(own)], "8": [900.0, 900.0, 0.0]}
    weights = {words[1]: float(words[3]) for words in said if words[0] == "load"}
    assert weights == {"5": pytest.approx(-9000.0 * 9.80665), "8": pytest.approx(-900.0 * 9.80665)}
    places = {words[1]: (float(words[2]), float(words[3])) for words in said if words[0] == "node"}
    assert places["4"] == (0.5, 0.0)
    assert places["7"] == places["6"] == (0.0, 6.0)
    assert places["8"] == pytest.approx((0.0, 3.9))
    dashpot = next(words for words in said if words[:2] == ("uniaxialMaterial", "Viscous"))
    assert float(dashpot[3]) == pytest.approx(HUNG.hinge_damping())
    assert len(values) == len(PULSE.pieces()) + 1
    assert max(map(float, values)) == pytest.approx(PULSE.pga, rel=1e-4)


def test_every_motion_and_a_bare_block_have_a_text():
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


def by_opensees(text: str, folder) -> dict[str, np.ndarray]:
    """Columns that the model writes when openseespy runs it."""
    try:
        import openseespy.opensees as ops
    except (ImportError, RuntimeError) as error:
        pytest.skip(f"openseespy: {error}")
    tcl = tkinter.Tcl()

    def number(word):
        return int(word) if re.fullmatch(r"-?\d+", word) else float(word)

    def plain(word):
        try:
            return [number(x) for x in word.split()]
        except ValueError:
            return [word]

    def call(name):
        def forward(*words):
            # The Python interface has another word for the first argument of `model`.
            words = ("basic", *words[1:]) if name == "model" else words
            found = getattr(ops, name)(*(x for word in words for x in plain(word)))
            return "" if found is None else found

        return forward

    def pattern(kind, tag, *words):
        if kind == "Plain":
            ops.timeSeries("Linear", 99)
            ops.pattern("Plain", int(tag), 99)
            tcl.eval(words[1])
        else:
            call("pattern")(kind, tag, *words)

    for name in (*STUBS, "analyze", "getTime", "nodeDisp"):
        tcl.createcommand(name, call(name))
    tcl.createcommand("pattern", pattern)
    tcl.eval(re.sub(r"-file (\w+)", rf"-file {folder}/\1", text))
    ops.wipe()
    return {path.stem: np.loadtxt(path) for path in folder.glob("*.out")}


def test_free_rocking_has_the_period_of_the_equations_and_the_impacts_of_housner(tmp_path):
    text = opensees(SCENE).replace("set shaking 1.0", "set shaking 0.0")
    found = by_opensees(text.replace("set push 0.0", "set push 0.25"), tmp_path)
    time, tilt = found["tilt"].T
    ends = np.flatnonzero(np.diff(np.sign(tilt)))
    peaks = np.array([np.abs(tilt[i : j + 1]).max() for i, j in pairwise(ends)])[:4]
    a, b = 0.5, 3.0
    energy = a * np.sin(peaks) + b * (np.cos(peaks) - 1.0)
    e = float(SCENE.ground_parameters().velocity_ratio)
    np.testing.assert_allclose(np.sqrt(energy[1:] / energy[:-1]), e, atol=0.01)
    # The fall from a peak by phi'' = -(3 g/4 R) sin(alpha - phi); in u, phi = peak (1 - u^2), it is smooth.
    alpha, rate, peak = math.atan2(a, b), math.sqrt(0.75 * 9.80665 / math.hypot(a, b)), peaks[1]
    u = (np.arange(2000) + 0.5) / 2000.0
    speed = rate * np.sqrt(2.0 * (math.cos(alpha - peak) - np.cos(alpha - peak * (1.0 - u**2))))
    fall = np.mean(2.0 * peak * u / speed)
    assert time[ends[2]] - time[ends[1]] == pytest.approx(2.0 * fall, rel=0.02)


def test_a_column_with_its_pendulum_moves_as_by_the_equations(tmp_path):
    from tpd.answers.shaking_history import shaking_history

    found = by_opensees(opensees(SCENE, HUNG), tmp_path)
    ours = shaking_history(SCENE, HUNG, times=np.linspace(0.0, 2.0, 201))
    tilt, swing = (np.interp(ours.times, *found[name].T) for name in ("tilt", "rod"))
    for theirs, linear in ((tilt, ours.tilt), (swing, ours.swing)):
        # The contact is elastic, and tpd's history here is linear in the tilt: phases part with time.
        assert np.abs(theirs).max() == pytest.approx(np.abs(linear).max(), rel=0.08)
        assert np.abs(theirs - linear).max() < 0.2 * np.abs(linear).max()
    # At rest in the end, weight alone presses both corners in alike.
    np.testing.assert_allclose(found["corners"][-1, [2, 4]], -0.5e-4 * 3.0 * 1.1, rtol=0.01)
