"""Compiled code under JAX: called by XLA, by the host where XLA cannot, and first asked under a trace."""

import subprocess
import sys
from types import SimpleNamespace

import jax
import numpy as np
import pytest

import tpd
from tests.reference import box, parameters
from tpd import Piecewise, steady_state
from tpd.compiled.calling import RUNS

BLOCK = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9)
SCENE = tpd.Scene(BLOCK, tpd.Pulse.one_sine(acceleration=3.0, frequency=1.2))


def tilt(length):
    return tpd.transient(SCENE, tpd.Pendulum(mass=450.0, length=length, damping_ratio=0.1), free=2.0).tilt


def test_compiled_code_runs_on_the_cpu_if_jax_has_another_device(monkeypatch):
    x, y = box(1, seed=9)
    model = Piecewise(max_periods=3)
    ours = jax.jit(lambda x, y: model.settle(parameters(x), y).state)(x[0], y[0])
    others = [SimpleNamespace(platform=name) for name in ("cpu", "cuda")]
    monkeypatch.setattr(jax, "devices", lambda: others)
    theirs = jax.jit(lambda x, y: model.settle(parameters(x), y).state)(x[0], y[0])
    np.testing.assert_array_equal(ours, theirs)


def test_the_host_computes_if_the_custom_call_is_unavailable(monkeypatch):
    x, y = box(6, seed=10)

    def answers():
        # Programs that were compiled before hold the custom call.
        jax.clear_caches()
        one = jax.value_and_grad(lambda x, y: steady_state(parameters(x), y0=y).amplitude)
        return jax.jit(lambda x, y: (*jax.vmap(one)(x, y), *jax.value_and_grad(tilt)(0.9)))(x, y)

    direct = answers()
    monkeypatch.setattr(RUNS, "is_direct", lambda: False)
    try:
        for ours, theirs in zip(answers(), direct, strict=True):
            np.testing.assert_array_equal(ours, theirs)
    finally:
        jax.clear_caches()


def test_the_host_computes_with_a_warning_if_xla_rejects_the_custom_call(monkeypatch):
    def refuse(*_, **__):
        raise RuntimeError("version 9.3 is incompatible")

    monkeypatch.setattr(RUNS, "_is_direct", None)
    monkeypatch.setattr(jax.ffi, "register_ffi_target", refuse)
    with pytest.warns(UserWarning, match="call tpd_runs directly .RuntimeError: version 9.3 is incompatible"):
        assert not RUNS.is_direct()


def test_the_first_call_can_be_inside_a_jitted_function():
    code = (
        "import warnings; warnings.simplefilter('error', UserWarning); import jax; "
        "jax.config.update('jax_enable_x64', True); import tpd; "
        "b = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9); "
        "s = tpd.Scene(b, tpd.Pulse.one_sine(acceleration=3.0, frequency=1.2)); "
        "print(float(jax.jit(lambda s: tpd.transient(s, free=2.0).tilt)(s)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) == pytest.approx(float(tpd.transient(SCENE, free=2.0).tilt), rel=1e-12)
