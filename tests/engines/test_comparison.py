"""Paired runs of an engine beside the equations (4), and what is said where they disagree."""

from dataclasses import replace

import numpy as np
import pytest

import tpd
from tpd.cli import main
from tpd.engines.comparison import EngineVerdict
from tpd.engines.comparison import mujoco as compared
from tpd.engines.rollouts import EngineRuns

pytest.importorskip("mujoco")
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution="housner")
PENDULUM = tpd.Pendulum(mass=900.0, length=2.1, damping_ratio=0.2)


def one_sine(scale):
    return tpd.Scene(COLUMN, tpd.Pulse.one_sine(acceleration=scale * 9.80665 / 6.0, frequency=1.2375))


def test_mujoco_and_the_equations_agree_about_overturning_of_a_column():
    # Least scales of a one-sine pulse by several engines: 2.45 bare, 7.0 with the pendulum.
    for scale, pendulum, fell in ((2.3, None, 0), (2.6, None, 1), (6.5, PENDULUM, 0), (7.6, PENDULUM, 1)):
        found = compared(one_sine(scale), pendulum, runs=1)
        assert int(found.with_engine[0].overturned[0]) == fell
        assert int(found.with_equations[0].overturned[0]) == fell


def test_similar_tilts_in_both_models_give_no_warning():
    found = compared(one_sine(2.2), PENDULUM, runs=6)
    for ours, theirs in zip(found.with_equations, found.finer, strict=True):
        stands = np.isfinite(ours.tilt) & np.isfinite(theirs.tilt)
        assert stands.sum() >= 3
        np.testing.assert_allclose(theirs.tilt[stands], ours.tilt[stands], rtol=0.03)
    assert (found.disagrees, found.warning) == (False, "")
    assert "0.959 for the block" in found.losses
    assert "a fifth of its step" in str(found)


def test_mujoco_simulates_a_harmonic_from_the_initial_states_of_the_ensemble():
    paper = tpd.paper_scene()
    block = replace(paper.block, restitution="housner", friction=0.0)
    # Without the pendulum, and at a larger amplitude, the motion is chaotic.
    scene = replace(paper, block=block, excitation=replace(paper.excitation, amplitude=0.0115))
    with_it = tpd.Pendulum(mass=0.4 * float(scene.block.mass), length=0.08, damping_ratio=0.3)
    found = compared(scene, with_it, runs=4, periods=12)
    np.testing.assert_allclose(found.finer[0].tilt, found.with_equations[0].tilt, rtol=0.05)


def runs(tilt):
    tilt, none = np.asarray(tilt, dtype=float), np.zeros(len(tilt))
    return EngineRuns(np.isinf(tilt), tilt, tilt, none, none, none > 0.0)


def verdict_of(engine, finer, equations):
    names = ("with_engine", "finer", "with_equations")
    pairs = {n: tuple(map(runs, pair)) for n, pair in zip(names, (engine, finer, equations), strict=True)}
    asked = {"scene": one_sine(2.0), "pendulum": PENDULUM, "ensemble": tpd.Ensemble(size=2), "step": 1e-3}
    return EngineVerdict(engine="MuJoCo 0", sliding=0.6, restitution=0.9, **asked, **pairs)


def test_a_disagreement_of_the_models_is_printed_first():
    helps, harms = ([0.02, 0.02], [0.1, np.inf]), ([0.1, np.inf], [0.02, 0.02])
    wrong = verdict_of(harms, harms, helps)
    assert wrong.disagrees
    assert str(wrong).startswith("DANGER: the models disagree. The pendulum changes the mean tilt by +")
    assert "the losses differ" in wrong.losses
    unsure = verdict_of(helps, harms, helps)
    assert unsure.step_matters
    assert "time step" in unsure.warning
    sound = verdict_of(helps, helps, helps)
    assert sound.warning == ""


def test_check_can_simulate_a_pendulum_in_mujoco(capsys):
    asked = "check --width 0.1 --height 0.4 --mass 8 --restitution housner --frequency 2.5 --amplitude 0.015"
    with_it = "--pendulum-mass 3.2 --pendulum-length 0.08 --engine mujoco --runs 1"
    assert main([*asked.split(), *with_it.split()]) == 3
    printed = capsys.readouterr().out
    assert "the pendulum does not reduce the rocking" in printed
    assert "equations (4)" in printed
    assert "overturned with the pendulum" in printed
