"""The custom call of ground motions: asked under a trace first, and where XLA cannot call it."""

import subprocess
import sys

import jax
import numpy as np
import pytest

import tpd
from tpd.models import compiled_shaken

BLOCK = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9)
SCENE = tpd.Scene(BLOCK, tpd.Pulse.one_sine(acceleration=3.0, frequency=1.2))
HUNG = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)


def slope(length):
    return tpd.transient(SCENE, tpd.Pendulum(mass=450.0, length=length, damping_ratio=0.1), free=2.0).tilt


def test_the_first_question_may_come_under_a_trace():
    code = (
        "import warnings; warnings.simplefilter('error', UserWarning); import jax; "
        "jax.config.update('jax_enable_x64', True); import tpd; "
        "b = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9); "
        "s = tpd.Scene(b, tpd.Pulse.one_sine(acceleration=3.0, frequency=1.2)); "
        "print(float(jax.jit(lambda s: tpd.transient(s, free=2.0).tilt)(s)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) == pytest.approx(float(tpd.transient(SCENE, free=2.0).tilt), rel=1e-12)


def test_without_the_custom_call_the_host_answers(monkeypatch):
    known = float(slope(0.9)), float(jax.grad(slope)(0.9))
    batch = np.asarray(jax.vmap(slope)(np.array([0.5, 0.9])))
    monkeypatch.setattr(compiled_shaken.EXACT, "direct", lambda: False)
    # Programs that were compiled before hold the custom call.
    jax.clear_caches()
    try:
        assert float(slope(0.9)) == known[0]
        assert float(jax.grad(slope)(0.9)) == known[1]
        assert np.asarray(jax.vmap(slope)(np.array([0.5, 0.9]))).tolist() == batch.tolist()
    finally:
        jax.clear_caches()


def test_a_wrong_answer_to_the_trial_is_said(monkeypatch):
    compiled = compiled_shaken.EXACT
    monkeypatch.setattr(compiled, "_works", None)
    monkeypatch.setattr(compiled, "on_host", lambda *_: (np.zeros(3), np.zeros(3)))
    with pytest.warns(UserWarning, match="of the linear equations directly .its answer to a trial is wrong"):
        assert not compiled.direct()


def test_pieces_longer_than_an_arc_may_be_have_the_derivatives_of_differences():
    # Under a block that stays at rest the bob swings through pieces that take many arcs each.
    x = np.array([0.3, 0.1, 0.4, 0.05, 0.1, 0.1, 25.0, 0.7, 0.9])
    pieces = [np.array([[0.0, 0.5, 0.0, 0.0], [0.5, -1.0, 0.0, 0.0]])]

    def swing(x):
        found, slopes = compiled_shaken.follow_all(
            x[None], pieces, np.zeros(1, int), np.zeros(1), slopes=True
        )
        return found.state[0, 1], slopes[0, 4, 6]

    step = 1e-4
    at = [swing(x + n * step * (np.arange(9) == 6))[0] for n in (-2, -1, 1, 2)]
    expected = (8.0 * (at[2] - at[1]) - (at[3] - at[0])) / (12.0 * step)
    assert abs(expected) > 1e-5
    assert swing(x)[1] == pytest.approx(expected, rel=1e-6)
