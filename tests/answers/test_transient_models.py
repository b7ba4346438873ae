"""Ground motions by the nonlinear equations, against the exact linear ones."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tpd
from tpd.answers.ground_batch import follow_scaled
from tpd.answers.transient import _followed
from tpd.theory.equations import Equations, Terms

GRAVITY = 9.80665
RUBBING = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.03)
LOSING = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
HUNG = tpd.Pendulum(mass=783.0, length=2.042, damping_ratio=0.129)
SINE = tpd.Pulse.one_sine(acceleration=2.0 * GRAVITY / 6.0, frequency=1.2375)
COSINE = tpd.Pulse.one_cosine(acceleration=2.0 * GRAVITY / 6.0, frequency=1.2375)


def named(found):
    return tpd.status_name(found.status)


@pytest.mark.parametrize("hung", [None, HUNG])
@pytest.mark.parametrize("motion", [SINE, tpd.records.el_centro().scaled(1.155)])
def test_nonlinear_motions_are_those_of_the_batch(motion, hung):
    found = tpd.transient(tpd.Scene(LOSING, motion), hung, model=tpd.Segmented(rtol=1e-8))
    batch = follow_scaled(LOSING, hung, [motion], np.ones((1, 1)), free=20.0, nonlinear=True)
    assert named(found) == "rocked"
    for name in ("tilt", "swing", "relative", "impacts"):
        assert float(getattr(found, name)) == getattr(batch, name)[0, 0], name
    assert (float(found.swing) > 0.1) == (hung is not None)


@pytest.mark.parametrize("hung", [False, True])
def test_nonlinear_motions_tend_to_the_linear_ones_of_slender_blocks(hung):
    names = ("tilt", "tilt_time", *(("swing", "relative", "swing_time", "relative_time") if hung else ()))
    errors = []
    for nu in (0.04, 0.02, 0.01):
        block = tpd.Block(width=6.0 * nu, height=6.0, mass=9000.0, friction=0.0, restitution=0.95)
        pendulum = tpd.Pendulum(mass=720.0, length=2.0, damping_ratio=0.1) if hung else None
        scene = tpd.Scene(block, tpd.Pulse.one_sine(acceleration=2.0 * GRAVITY * nu, frequency=1.2375))
        model = tpd.Segmented(rtol=1e-11)
        ours, exact = (tpd.transient(scene, pendulum, model=m, free=2.0) for m in (model, None))
        errors.append([float(getattr(ours, n) / getattr(exact, n)) - 1.0 for n in names])
        assert float(ours.uplift_time) == pytest.approx(float(exact.uplift_time), rel=nu**2)
    # What (25) leaves out is of second order in the angles.
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.1)
    assert np.all(np.abs(errors[-1]) < 1e-3)


def test_a_nonlinear_motion_is_that_of_an_integrator():
    pulse = tpd.Pulse.ricker(acceleration=1.0, frequency=4.0)
    scene = tpd.Scene(LOSING, pulse)
    p, rate, y0 = scene.ground_parameters(HUNG), float(scene.rate), np.array([0.05, 0.1, 0.2, -0.1])
    equations = Equations(p, Terms.nonlinear)
    moving = jax.jit(lambda y, base: equations.rates(y, 1.0, jnp.sign(y[2]), -base))
    h = float(2.0 * np.pi / p.xi)

    def field(t, y):
        base = float(pulse.acceleration_at(np.array([t / rate]))[0] / pulse.pga) if t < n * h else 0.0
        return np.asarray(moving(jnp.asarray(y), base))

    n, end, y = len(pulse.pieces()), float(1.1 * rate), y0 / np.array([1.0, 1.0, rate, rate])
    for a, b in ((0.0, n * h), (n * h, end)):
        y = solve_ivp(field, (a, b), y, rtol=1e-9, atol=1e-12, method="DOP853").y[:, -1]
    model = tpd.Segmented(rtol=1e-10)
    found = tpd.transient(scene, HUNG, y0=y0, model=model, free=1.1 - float(pulse.duration))
    assert float(found.state[0]) > 0.0
    known = y * np.array([1.0, 1.0, rate, rate])
    assert np.asarray(found.state) == pytest.approx(known, rel=1e-6)
    assert int(found.impacts) == 0
    assert float(found.uplift_time) == 0.0


def test_nonlinear_motions_have_no_derivatives_rather_than_none():
    def tilt(length, y0=None):
        hung = tpd.Pendulum(mass=783.0, length=length, damping_ratio=0.129)
        return tpd.transient(tpd.Scene(LOSING, SINE), hung, model=tpd.Segmented(), y0=y0)

    assert math.isnan(jax.grad(lambda x: tilt(x).tilt)(2.0))
    assert np.all(np.isnan(jax.jacfwd(lambda x: tilt(x).state)(2.0)))
    assert np.all(np.isnan(jax.grad(lambda y: tilt(2.0, y).swing)(jnp.array([0.05, 0.0, 0.0, 0.0]))))


@pytest.mark.mends("derivatives of times were zero")
def test_times_have_no_derivatives_rather_than_zero():
    names = ("tilt_time", "swing_time", "relative_time", "uplift_time", "overturning_time")

    def times(x, y0):
        hung = tpd.Pendulum(mass=783.0, length=x, damping_ratio=0.129)
        found = tpd.transient(tpd.Scene(RUBBING, SINE), hung, model=tpd.Segmented(), y0=y0, free=1.0)
        return jnp.stack([getattr(found, name) for name in names])

    by_length, by_start = jax.jacfwd(times, argnums=(0, 1))(2.0, jnp.zeros(4))
    assert np.all(np.isnan(by_length))
    assert np.all(np.isnan(by_start))
    assert np.all(np.isnan(jax.jacrev(times)(2.0, jnp.zeros(4))))


def test_batches_and_compiled_functions_are_single_motions():
    def tilt(length):
        hung = tpd.Pendulum(mass=783.0, length=length, damping_ratio=0.129)
        return tpd.transient(tpd.Scene(RUBBING, SINE), hung, model=tpd.Segmented(), free=2.0).tilt

    lengths = jnp.array([0.5, 0.9, 1.4])
    single = [float(tilt(float(x))) for x in lengths]
    assert np.asarray(jax.jit(jax.vmap(tilt))(lengths)) == pytest.approx(single, rel=1e-6)


def test_a_nonlinear_motion_has_a_status():
    stood = tpd.transient(tpd.Scene(LOSING, SINE.scaled(0.4)), HUNG, model=tpd.Segmented())
    assert (named(stood), float(stood.tilt), math.isinf(stood.uplift_time)) == ("stood", 0.0, True)
    large = tpd.Scene(LOSING, tpd.Pulse.one_sine(acceleration=GRAVITY, frequency=0.7))
    fallen = tpd.transient(large, HUNG, model=tpd.Segmented())
    assert (named(fallen), math.isinf(fallen.tilt)) == ("overturned", True)
    assert 1.4 < float(fallen.overturning_time) < 5.0
    assert named(tpd.transient(tpd.Scene(LOSING, SINE), model=tpd.Segmented(), max_events=4)) == "event_bound"


def test_a_model_that_does_not_fit_is_one_sentence():
    scene = tpd.Scene(RUBBING, SINE)
    with pytest.raises(ValueError, match=r"must be `tpd\.Terms\.nonlinear`, but is 'linear'"):
        tpd.transient(scene, model=tpd.Segmented(terms=tpd.Terms.linear))
    # A checker of types refuses these before this, where there is one.
    for model, words in (
        (tpd.Auto(), "Piecewise or Segmented, but is Auto"),
        (tpd.Smoothed(), "Piecewise or Segmented, but is Smoothed"),
        (tpd.Segmented, "the class itself"),
    ):
        with pytest.raises(ValueError, match=words):
            _followed(model, scene.ground_parameters(), None, known=False)
