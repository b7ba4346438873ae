"""Ground motions by the nonlinear equations and by smoothed signs, against the exact linear ones."""

import math

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tpd
from tpd.analysis.ground_batch import follow_scaled
from tpd.analysis.transient import _followed
from tpd.core.equations import Equations, Terms

GRAVITY = 9.80665
RUBBING = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.03)
LOSING = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
HUNG = tpd.Pendulum(mass=783.0, length=2.042, damping_ratio=0.129)
SINE = tpd.Pulse.one_sine(acceleration=2.0 * GRAVITY / 6.0, frequency=1.2375)
COSINE = tpd.Pulse.one_cosine(acceleration=2.0 * GRAVITY / 6.0, frequency=1.2375)


def smoothed(sharpness, **options):
    return tpd.Smoothed(sharpness=sharpness, rtol=1e-9, **options)


def named(found):
    return tpd.status_name(found.status)


@pytest.mark.parametrize("hung", [None, HUNG])
@pytest.mark.parametrize(("pulse", "power"), [(SINE, 2 / 3), (COSINE, 1 / 2)])
def test_smoothed_signs_tend_to_true_ones_on_a_pulse(pulse, power, hung):
    # A forcing that begins with a jump leaves the smoothed block in the layer for longer.
    scene = tpd.Scene(RUBBING, pulse)
    exact, errors = tpd.transient(scene, hung, free=2.0), []
    for sharpness in (2e-4, 2e-5, 2e-6):
        found = tpd.transient(scene, hung, model=smoothed(sharpness), free=2.0)
        assert named(found) == "rocked"
        errors.append(float(found.tilt / exact.tilt) - 1.0)
    assert np.log10(np.array(errors[:-1]) / errors[1:]) == pytest.approx(power, abs=0.08)
    assert errors[-1] < {2 / 3: 1e-3, 1 / 2: 1e-2}[power]
    assert float(found.tilt_time) == pytest.approx(float(exact.tilt_time), abs=0.02)
    if hung is None:
        assert float(found.swing) == float(found.relative) == float(found.state[1]) == 0.0
    else:
        assert float(found.swing) == pytest.approx(float(exact.swing), rel=6e-3)
        assert float(found.relative) == pytest.approx(float(exact.relative), rel=6e-3)
        assert float(found.swing_time) == pytest.approx(float(exact.swing_time), abs=0.01)


@pytest.mark.parametrize("hung", [None, HUNG])
def test_smoothed_signs_tend_to_true_ones_on_a_record(hung):
    scene = tpd.Scene(RUBBING, tpd.records.el_centro().scaled(1.5))
    exact = tpd.transient(scene, hung, free=2.0)
    errors = []
    for sharpness in (2e-3, 2e-4, 2e-5):
        found = tpd.transient(scene, hung, model=smoothed(sharpness), free=2.0)
        errors.append(abs(float(found.tilt / exact.tilt) - 1.0))
    # On the way to the largest tilt of the bare block lie many impacts, each with an error of its own.
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.01
    assert float(found.tilt_time) == pytest.approx(float(exact.tilt_time), abs=0.02)


def test_a_motion_without_a_zero_is_the_exact_one():
    # Beyond the width of a sign nothing is smoothed: what is left is the error of the solver.
    y0 = jnp.array([0.05, 0.1, 0.1, -0.2])
    pulse = tpd.Pulse.ricker(acceleration=1.0, frequency=4.0)

    def end(y0, free, model):
        found = tpd.transient(tpd.Scene(RUBBING, pulse), HUNG, y0=y0, free=free, model=model)
        return jnp.concatenate([found.state, found.swing[None]])

    model = tpd.Smoothed(sharpness=2e-5, rtol=1e-11)
    ours, exact = end(y0, 0.2, model), end(y0, 0.2, None)
    assert np.asarray(ours) == pytest.approx(np.asarray(exact), rel=1e-3)
    slopes, known = (jax.jacfwd(end, argnums=(0, 1))(y0, 0.2, m) for m in (model, None))
    for a, b in zip(slopes, known, strict=True):
        assert np.asarray(a) == pytest.approx(np.asarray(b), rel=2e-3, abs=2e-3)


def quantities(model):
    """Largest angles as a function of SI quantities, and where it is taken."""

    def angles(x):
        block = tpd.Block(width=x[0], height=x[1], mass=x[2], friction=x[3])
        pulse = tpd.Pulse.one_sine(acceleration=x[4], frequency=x[5])
        pendulum = tpd.Pendulum(mass=x[6], length=x[7], damping_ratio=x[8])
        found = tpd.transient(tpd.Scene(block, pulse, x[9]), pendulum, model=model, free=2.0)
        return jnp.stack([found.tilt, found.swing, found.relative])

    motion = SINE.acceleration, SINE.frequency
    return angles, np.array(
        [1.0, 6.0, 9000.0, 0.03, *motion, HUNG.mass, HUNG.length, HUNG.damping_ratio, GRAVITY]
    )


def test_smoothed_derivatives_are_those_of_differences():
    function, x = quantities(tpd.Smoothed(sharpness=2e-4, rtol=1e-10))
    value, forward = jax.jit(function), np.asarray(jax.jit(jax.jacfwd(function))(jnp.asarray(x)))
    backward = np.asarray(jax.jit(jax.jacrev(function))(jnp.asarray(x)))
    assert forward == pytest.approx(backward, rel=1e-12)
    for j in range(len(x)):
        best = np.full(3, np.inf)
        for step in (1e-3, 1e-4, 1e-5):
            d = step * x[j] * (np.arange(len(x)) == j)
            at = [np.asarray(value(jnp.asarray(x + k * d))) for k in (-2, -1, 1, 2)]
            slope = (8.0 * (at[2] - at[1]) - (at[3] - at[0])) / (12.0 * step * x[j])
            best = np.minimum(best, np.abs(slope / forward[:, j] - 1.0))
        assert np.all(best < 5e-6), (j, best)


def test_smoothed_derivatives_tend_to_the_exact_ones():
    function, x = quantities(tpd.Smoothed(sharpness=2e-6, rtol=1e-10))
    ours = np.asarray(jax.jacfwd(function)(jnp.asarray(x)))
    known = np.asarray(jax.jacfwd(quantities(None)[0])(jnp.asarray(x)))
    scales = np.abs(known * x).max(axis=1, keepdims=True)
    assert ours * x / scales == pytest.approx(known * x / scales, abs=0.01)


def test_the_size_of_a_record_has_a_smoothed_derivative():
    record = tpd.records.el_centro()

    def tilt(size):
        model = tpd.Smoothed(sharpness=2e-4, rtol=1e-10)
        return tpd.transient(tpd.Scene(RUBBING, record.scaled(size)), HUNG, model=model, free=0.0).tilt

    slope = float(jax.grad(tilt)(1.5))
    difference = (tilt(1.5 + 1e-5) - tilt(1.5 - 1e-5)) / 2e-5
    assert slope == pytest.approx(float(difference), rel=1e-5)


def test_smoothed_nonlinear_equations_tend_to_those_with_true_signs():
    scene = tpd.Scene(RUBBING, SINE)
    known = tpd.transient(scene, HUNG, model=tpd.Segmented(), free=2.0)
    found = tpd.transient(scene, HUNG, model=smoothed(2e-6, terms=tpd.Terms.nonlinear), free=2.0)
    assert float(found.tilt) == pytest.approx(float(known.tilt), rel=2e-3)
    assert float(found.swing) == pytest.approx(float(known.swing), rel=2e-3)
    assert abs(float(known.tilt / tpd.transient(scene, HUNG, free=2.0).tilt) - 1.0) > 0.01


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
@pytest.mark.parametrize("model", [tpd.Segmented(), tpd.Smoothed()])
def test_times_have_no_derivatives_rather_than_zero(model):
    names = ("tilt_time", "swing_time", "relative_time", "uplift_time", "overturning_time")

    def times(x, y0):
        hung = tpd.Pendulum(mass=783.0, length=x, damping_ratio=0.129)
        found = tpd.transient(tpd.Scene(RUBBING, SINE), hung, model=model, y0=y0, free=1.0)
        return jnp.stack([getattr(found, name) for name in names])

    by_length, by_start = jax.jacfwd(times, argnums=(0, 1))(2.0, jnp.zeros(4))
    assert np.all(np.isnan(by_length))
    assert np.all(np.isnan(by_start))
    assert np.all(np.isnan(jax.jacrev(times)(2.0, jnp.zeros(4))))


@pytest.mark.mends("a second derivative of smoothed motions left out that turns move")
def test_smoothed_motions_have_no_second_derivatives():
    def tilt(x):
        hung = tpd.Pendulum(mass=783.0, length=x, damping_ratio=0.129)
        return tpd.transient(tpd.Scene(RUBBING, SINE), hung, model=tpd.Smoothed(), free=1.0).tilt

    assert math.isnan(jax.grad(jax.grad(tilt))(2.0))


@pytest.mark.parametrize("model", [tpd.Segmented(), tpd.Smoothed()])
def test_batches_and_compiled_functions_are_single_motions(model):
    def tilt(length):
        hung = tpd.Pendulum(mass=783.0, length=length, damping_ratio=0.129)
        return tpd.transient(tpd.Scene(RUBBING, SINE), hung, model=model, free=2.0).tilt

    lengths = jnp.array([0.5, 0.9, 1.4])
    single = [float(tilt(float(x))) for x in lengths]
    assert np.asarray(jax.jit(jax.vmap(tilt))(lengths)) == pytest.approx(single, rel=1e-6)
    if isinstance(model, tpd.Smoothed):
        slopes = jax.jit(jax.vmap(jax.grad(tilt)))(lengths)
        assert float(slopes[1]) == pytest.approx(float(jax.jit(jax.grad(tilt))(0.9)), rel=1e-5)


def test_a_smoothed_motion_has_a_status():
    stood = tpd.transient(tpd.Scene(RUBBING, SINE.scaled(0.4)), HUNG, model=tpd.Smoothed())
    assert (named(stood), float(stood.tilt), math.isinf(stood.uplift_time)) == ("stood", 0.0, True)
    assert float(stood.swing) > 0.03
    large = tpd.Scene(RUBBING, tpd.Pulse.one_sine(acceleration=GRAVITY, frequency=0.7))
    for free in (0.1, 5.0):
        # Soon after the pulse the tilt is far from any bound, and its last arc leads there.
        fallen = tpd.transient(large, HUNG, model=tpd.Smoothed(), free=free)
        assert (named(fallen), math.isinf(fallen.tilt)) == ("overturned", True)
        assert 1.4 < float(fallen.overturning_time) < 5.0
    cut = tpd.transient(tpd.Scene(RUBBING, SINE), model=tpd.Smoothed(), max_events=3)
    assert named(cut) == "event_bound"

    def slope(e):
        block = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.03, restitution=e)
        found = tpd.transient(tpd.Scene(block, SINE), model=tpd.Smoothed())
        return found.tilt, found.status

    # Traced, a restitution is not refused in words.
    by, status = jax.grad(slope, has_aux=True)(0.9)
    assert math.isnan(by)
    assert tpd.status_name(status) == "failed"


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
    for model, words in (
        (tpd.Segmented(terms=tpd.Terms.linear), "must be `tpd.Terms.nonlinear`, but is 'linear'"),
        (tpd.Smoothed(solver=diffrax.Euler()), "must be an explicit Runge-Kutta method .* but is `Euler`"),
    ):
        with pytest.raises(ValueError, match=words):
            tpd.transient(scene, model=model)
    # A checker of types refuses the first two before this, where there is one.
    for model, words in (
        (tpd.Auto(), "Segmented or Smoothed, but is Auto"),
        (tpd.Smoothed, "the class itself"),
    ):
        with pytest.raises(ValueError, match=words):
            _followed(model, scene.ground_parameters(), None)
    with pytest.raises(ValueError, match="in the smoothed model under a pulse or a record"):
        tpd.transient(tpd.Scene(LOSING, SINE), model=tpd.Smoothed())
