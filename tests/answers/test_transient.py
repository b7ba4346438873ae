"""Motions under pulses and records: to 50 digits, with derivatives, by both equations, and refusals."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests.reference import differences
from tests.truth import GRAVITY, load
from tpd.answers.critical_scale import _scanned
from tpd.answers.ground_batch import follow_scaled
from tpd.answers.shaking_history import shaking_history
from tpd.answers.transient import Transient, _followed
from tpd.scene.ground_motion import PULSES

TABLE = load("ground")
CASES = {case["name"]: case for case in TABLE["cases"]}
SI = ("bob", "length", "damping", "friction", "restitution", "scale")
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)


def bob(mass=450.0, length=0.9) -> tpd.Pendulum:
    return tpd.Pendulum(mass=mass, length=length, damping_ratio=0.1)


HUNG = bob()


def column(pulse: tpd.Pulse | tpd.Record) -> tpd.Scene:
    return tpd.Scene(COLUMN, pulse)


def sine(size: float, frequency: float = 1.2375) -> tpd.Pulse:
    return tpd.Pulse.one_sine(acceleration=size * GRAVITY / 6.0, frequency=frequency)


def named(found) -> str:
    return tpd.status_name(found.status)


# To 50 digits


def motion_of(case) -> tpd.Pulse | tpd.Record:
    """Ground motion of a case, its size included."""
    m, scale = case["motion"], float(case["scene"]["scale"])
    peak, frequency = float(m.get("peak", 1.0)), float(m.get("frequency", 1.0))
    match m["kind"]:
        case "samples" if m.get("record") == "el_centro":
            return tpd.records.el_centro().scaled(scale)
        case "samples":
            return tpd.Record(np.array(m["acceleration"], dtype=float), float(m["dt"])).scaled(scale)
        case "mavroeidis":
            shape = {"cycles": float(m["gamma"]), "phase": float(m["phase"])}
            pulse = tpd.Pulse.mavroeidis_papageorgiou(
                velocity=float(m["velocity"]), frequency=frequency, **shape
            )
            return pulse.scaled(scale)
        case kind:
            return getattr(tpd.Pulse, kind)(acceleration=peak, frequency=frequency).scaled(scale)


def scene_of(s, motion) -> tuple[tpd.Scene, tpd.Pendulum | None]:
    block = tpd.Block(**{k: float(s[k]) for k in ("width", "height", "mass", "friction", "restitution")})
    hung = None
    if "bob" in s:
        hung = tpd.Pendulum(
            mass=float(s["bob"]), length=float(s["length"]), damping_ratio=float(s["damping"])
        )
    return tpd.Scene(block, motion, float(s.get("gravity", 9.80665))), hung


def followed(case) -> tuple[tpd.Scene, Transient]:
    scene, hung = scene_of(case["scene"], motion_of(case))
    rate = float(scene.rate)
    y0 = np.array(case["y0"], dtype=float) * [1.0, 1.0, rate, rate]
    return scene, tpd.transient(scene, hung, y0=y0, free=float(case["free"]))


@pytest.mark.parametrize("name", CASES)
def test_a_motion_is_that_of_fifty_digits(name):
    case = CASES[name]
    known = case["results"]
    scene, found = followed(case)
    assert (tpd.status_name(found.status) == "overturned") == known["overturned"]
    assert float(found.uplift_time) == pytest.approx(float(known["uplift_time"]), rel=1e-7, abs=1e-12)
    if known["overturned"]:
        return
    tolerance = 1e-10
    assert float(found.tilt) == pytest.approx(float(known["tilt"]), rel=tolerance)
    assert float(found.tilt_time) == pytest.approx(float(known["tilt_time"]), rel=1e-6)
    if known["swing"] is not None:
        assert float(found.swing) == pytest.approx(float(known["swing"]), rel=tolerance)
        assert float(found.relative) == pytest.approx(float(known["relative_swing"]), rel=tolerance)
    # The end lies tens of impacts later.
    rate = float(scene.rate)
    end = np.asarray(found.state) / [1.0, 1.0, rate, rate]
    for value, digits in zip(end, known["end"], strict=True):
        if digits is not None:
            assert value == pytest.approx(float(digits), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if "derivatives" in c["results"]])
def test_its_derivatives_are_those_of_fifty_digits(name):
    case = CASES[name]
    scene, hung = scene_of(case["scene"], motion_of(case))
    assert hung is not None
    block, motion = scene.block, scene.motion
    rate = float(scene.rate)
    y0 = np.array(case["y0"], dtype=float) * [1.0, 1.0, rate, rate]

    def tilt(x):
        changed = tpd.Block(
            width=block.width,
            height=block.height,
            mass=block.mass,
            friction=x["friction"],
            restitution=x["restitution"],
        )
        pendulum = tpd.Pendulum(mass=x["bob"], length=x["length"], damping_ratio=x["damping"])
        return tpd.transient(
            tpd.Scene(changed, motion.scaled(x["scale"])), pendulum, y0=y0, free=float(case["free"])
        ).tilt

    at = {"bob": hung.mass, "length": hung.length, "damping": hung.damping_ratio, "scale": 1.0}
    at |= {"friction": block.friction, "restitution": block.restitution}
    found = jax.grad(tilt)({k: float(v) for k, v in at.items()})
    own = float(case["scene"]["scale"])
    for key in SI:
        value = float(found[key]) / (own if key == "scale" else 1.0)
        assert value == pytest.approx(float(case["results"]["derivatives"][key]), rel=1e-8, abs=1e-10), key


@pytest.mark.parametrize("row", TABLE["critical"], ids=lambda row: row["name"])
def test_critical_scales_are_those_of_fifty_digits(row):
    s, m = row["scene"], row["motion"]
    size = GRAVITY * float(s["width"]) / float(s["height"])
    pulse = getattr(tpd.Pulse, m["kind"])(acceleration=size, frequency=float(m["frequency"]))
    scene, hung = scene_of(s, pulse)
    found = tpd.critical_scale(scene, hung)
    assert float(found.scale) == pytest.approx(float(row["scale"]), rel=1e-10)
    # The first tongue begins there, and another one is above it.
    assert float(found.tongues[0, 0]) == float(found.scale)


@pytest.mark.parametrize("row", TABLE["boundaries"], ids=lambda row: row["name"])
def test_boundaries_of_the_one_sine_spectrum_are_those_of_fifty_digits(row):
    pieces = sine(1.0).pieces()
    # The parameters of the compiled code, with xi in the place of the duration of a piece; rho = 1.
    x = np.array(
        [0.25, 0.0, 1.0, 0.3, 0.0, 0.25, row["frequency_ratio"] * len(pieces), 1.0, row["restitution"]]
    )
    tongues = _scanned(x, pieces, 20.0, np.array([0.9, 20.0]), 0.005)[1]
    borders = tongues[np.isfinite(tongues)]
    # Between those of the table are a few narrow ones.
    for known in row["scales"]:
        assert np.min(np.abs(borders / float(known) - 1.0)) < 1e-9, borders


def test_a_sampled_sine_tends_to_the_pulse_with_the_square_of_the_step():
    exact, errors = float(tpd.transient(column(sine(2.0)), HUNG).tilt), []
    for n in (50, 100, 200, 400):
        samples = np.sin(2.0 * np.pi * np.linspace(0.0, 1.0, n + 1)) * 2.0 * GRAVITY / 6.0
        errors.append(
            abs(float(tpd.transient(column(tpd.Record(samples, 1.0 / 1.2375 / n)), HUNG).tilt) - exact)
        )
    assert np.all(np.abs(np.log2(np.array(errors[:-1]) / errors[1:]) - 2.0) < 0.1)


def test_a_train_of_sines_is_the_harmonic_from_rest():
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0, restitution=0.9)
    hung = tpd.Pendulum(mass=900.0, length=1.5, damping_ratio=0.3)
    harmonic = tpd.Harmonic(amplitude=0.05, frequency=1.2)
    train = tpd.Pulse.sine_train(acceleration=0.05 * harmonic.rate**2, frequency=1.2, cycles=6)
    found = tpd.transient(tpd.Scene(block, train), hung, free=0.0)
    p = tpd.Scene(block, harmonic).parameters(hung)
    moved = tpd.simulate(p, np.zeros(4), np.array([0.0, 6.0 * float(p.period)]))
    scale = np.array([1.0, 1.0, *[float(tpd.Scene(block, harmonic).rate)] * 2])
    # The base of the harmonic moves to the other side first.
    np.testing.assert_allclose(-found.state, np.asarray(moved.ys)[-1] * scale, rtol=1e-9, atol=1e-11)
    with pytest.raises(ValueError, match="whole number"):
        tpd.Pulse(kind="sine-train", acceleration=1.0, frequency=1.0, cycles=2.5)


# Pulses


def test_pulses_are_their_formulas():
    t = np.linspace(0.0, 3.0, 1001)
    sine_ = tpd.Pulse.one_sine(acceleration=2.0, frequency=0.5)
    assert sine_.acceleration_at(t) == pytest.approx(
        np.where(t <= 2.0, 2.0 * np.sin(np.pi * t), 0.0), abs=1e-9
    )
    cosine = tpd.Pulse.one_cosine(acceleration=2.0, frequency=0.5)
    assert cosine.acceleration_at(t) == pytest.approx(
        np.where(t <= 2.0, 2.0 * np.cos(np.pi * t), 0.0), abs=1e-9
    )
    ricker = tpd.Pulse.ricker(acceleration=2.0, frequency=2.0)
    x = np.pi * 2.0 * (t - 1.0)
    assert ricker.acceleration_at(t) == pytest.approx(
        np.where(t <= 2.0, 2.0 * (1.0 - 2.0 * x**2) * np.exp(-(x**2)), 0.0), abs=3e-9
    )
    near = tpd.Pulse.mavroeidis_papageorgiou(velocity=0.8, frequency=1.0, cycles=2.5, phase=0.7)
    assert float(near.duration) == pytest.approx(2.5)
    velocity = np.cumsum(near.acceleration_at(np.arange(0.0, 2.5, 1e-4))) * 1e-4
    s = 2.0 * np.pi * (np.arange(0.0, 2.5, 1e-4) - 1.25)
    known = 0.4 * (1.0 + np.cos(s / 2.5)) * np.cos(s + 0.7)
    assert velocity == pytest.approx(known - known[0], abs=2e-3)
    assert np.max(np.abs(near.acceleration_at(np.arange(0.0, 2.5, 1e-4)))) == pytest.approx(
        float(near.pga), rel=1e-6
    )


@pytest.mark.parametrize("kind", ["one-sine", "one-cosine", "ricker", "mavroeidis-papageorgiou"])
def test_twice_as_many_cubics_make_no_other_motion(kind, monkeypatch):
    pulse = tpd.Pulse(kind=kind, acceleration=4.0, frequency=1.5, cycles=2.0, phase=0.4)
    tilts = [float(tpd.transient(column(pulse), HUNG).tilt)]
    monkeypatch.setitem(PULSES, kind, PULSES[kind]._replace(cubics=2 * PULSES[kind].cubics))
    tilts.append(float(tpd.transient(column(pulse), HUNG).tilt))
    assert tilts[0] == pytest.approx(tilts[1], rel=2e-10)
    assert 0.01 < tilts[0] < 0.2


def test_a_derivative_in_the_phase_alone():
    def pga(phase):
        pulse = tpd.Pulse.mavroeidis_papageorgiou(velocity=1.0, frequency=1.0, cycles=2.0, phase=phase)
        return pulse.pga

    slope = (pga(0.3 + 1e-4) - pga(0.3 - 1e-4)) / 2e-4
    assert float(jax.grad(pga)(0.3)) == pytest.approx(float(slope), rel=1e-7)


def test_pulses_are_scaled():
    pulse = sine(2.0)
    assert float(pulse.scaled(1.5).pga) == pytest.approx(GRAVITY / 2.0)
    assert float(pulse.scaled_to(pga_g=0.3).pga) == pytest.approx(0.3 * GRAVITY)
    assert float(pulse.scaled_to(pga=0.3).pga) == pytest.approx(0.3)
    with pytest.raises(ValueError, match="exactly one of `pga` and `pga_g`"):
        pulse.scaled_to(pga=1.0, pga_g=0.1)
    with pytest.raises(ValueError, match="`pga` must be positive"):
        pulse.scaled_to(pga=-1.0)


# Statuses


def test_every_motion_has_a_status():
    stood, lifted = (tpd.transient(column(sine(size))) for size in (0.999, 1.001))
    assert (named(stood), float(stood.tilt), float(stood.uplift_time)) == ("stood", 0.0, math.inf)
    assert named(lifted) == "rocked"
    assert 0.0 < float(lifted.tilt) < 1e-4
    # The tilt is far from any bound at the end of half a second of free motion.
    late = tpd.transient(column(sine(2.5)), free=0.5)
    assert (named(late), float(late.tilt)) == ("overturned", math.inf)
    assert float(late.overturning_time) > 1.0
    few = tpd.transient(column(sine(2.0)), HUNG, max_events=3)
    assert named(few) == "event_bound"
    for size, bound in ((3.5, 1000), (2.0, 3)):
        slope = jax.grad(lambda m, s=size, n=bound: tpd.transient(column(sine(s)), bob(m), max_events=n).tilt)
        assert math.isnan(slope(450.0))


def test_a_motion_that_never_overturns_has_no_critical_scale():
    found = tpd.critical_scale(column(sine(1.0)), highest=2.0)
    assert np.isinf(float(found.scale))
    assert np.all(np.isnan(found.tongues))
    assert "does not overturn up to 2 times" in str(found)
    slope = jax.grad(lambda m: tpd.critical_scale(column(sine(1.0)), bob(m), highest=2.0).scale)(450.0)
    assert math.isnan(slope)


# Derivatives


def test_the_critical_scale_has_its_exact_slope():
    def scale(x):
        return tpd.critical_scale(column(sine(1.0)), bob(x[1], x[0])).scale

    x = np.array([0.9, 450.0])
    found = jax.grad(scale)(jnp.asarray(x))
    for i in range(2):
        assert float(found[i]) == pytest.approx(float(differences(scale, x, i, share=1e-4)), rel=1e-6)


def numbers(x):
    """Angles and the end of a motion from its SI quantities."""
    block = tpd.Block(width=x[0], height=x[1], mass=x[2], friction=x[3], restitution=x[4])
    pulse = tpd.Pulse.one_sine(acceleration=x[5], frequency=x[6])
    pendulum = tpd.Pendulum(mass=x[7], length=x[8], damping_ratio=x[9])
    found = tpd.transient(tpd.Scene(block, pulse, x[10]), pendulum, free=8.0)
    return jnp.stack([found.tilt, found.swing, found.relative, *found.state[1:4:2]])


def test_derivatives_are_those_of_differences():
    x = np.array([1.0, 6.0, 9000.0, 0.01, 0.9595, 2.1 * GRAVITY / 6.0, 1.2375, 450.0, 0.9, 0.1, GRAVITY])
    value = jax.jit(numbers)
    forward, backward = (np.asarray(d(numbers)(jnp.asarray(x))) for d in (jax.jacfwd, jax.jacrev))
    assert forward == pytest.approx(backward, rel=1e-12, abs=1e-14)
    for j in range(len(x)):
        best = np.full(3, np.inf)
        # The state after hundreds of hops differs less smoothly than the largest angles do.
        scale = (np.abs(forward[:, j]) + 1e-6 * np.abs(forward[:, j]).max())[:3]
        for step in (1e-3, 1e-4, 1e-5):
            share = step * x[j] / max(x[j], 0.1)
            slope = differences(lambda x: np.asarray(value(jnp.asarray(x))), x, j, share=share)
            best = np.minimum(best, np.abs(slope - forward[:, j])[:3] / scale)
        assert np.all(best < 1e-6), (j, best)


def test_the_start_and_the_free_time_have_derivatives():
    scene = column(tpd.Pulse.one_sine(acceleration=0.5, frequency=1.0))
    y0 = jnp.array([0.02, 0.01, 0.1, -0.05])

    def end(y0, free):
        return tpd.transient(scene, HUNG, y0=y0, free=free).state

    by_start, by_time = jax.jacfwd(end, argnums=(0, 1))(y0, 0.2)
    for j in range(4):
        d = 1e-6 * np.eye(4)[j]
        slope = (end(y0 + d, 0.2) - end(y0 - d, 0.2)) / 2e-6
        assert np.asarray(by_start[:, j]) == pytest.approx(np.asarray(slope), rel=1e-6, abs=1e-8)
    slope = (end(y0, 0.2 + 1e-6) - end(y0, 0.2 - 1e-6)) / 2e-6
    assert np.asarray(by_time) == pytest.approx(np.asarray(slope), rel=1e-6, abs=1e-8)


TIMES = ("tilt_time", "swing_time", "relative_time", "uplift_time", "overturning_time")


def times_of(x, *, hung=True, y0=None):
    """Times (s) of the motion under a sine of x[0] uplift accelerations and of x[1] Hz, of a column of height
    x[2] with a bob of mass x[3] on a length x[4], or without one."""
    block = tpd.Block(width=1.0, height=x[2], mass=9000.0, friction=0.01, restitution=0.95)
    pulse = tpd.Pulse.one_sine(acceleration=x[0] * GRAVITY / 6.0, frequency=x[1])
    pendulum = tpd.Pendulum(mass=x[3], length=x[4], damping_ratio=0.1) if hung else None
    found = tpd.transient(tpd.Scene(block, pulse), pendulum, y0=y0, free=8.0)
    return jnp.stack([getattr(found, name) for name in TIMES])


@pytest.mark.mends("derivatives of times were zero")
@pytest.mark.parametrize("hung", [True, False])
@pytest.mark.parametrize("size", [2.1, 8.0])
def test_times_have_the_derivatives_of_differences(size, hung):
    x = np.array([size, 1.2375, 6.0, 450.0, 0.9])
    value = jax.jit(lambda x: times_of(x, hung=hung))
    forward, backward = (np.asarray(d(value)(jnp.asarray(x))) for d in (jax.jacfwd, jax.jacrev))
    # Of a block that overturns the uplift alone, of a bare one the block's own times.
    known = [0, 3] if not hung else [0, 1, 2, 3]
    known = [3] if size == 8.0 else known
    felt = 5 if hung else 3
    assert np.all(np.isnan(np.delete(forward, known, 0)))
    assert np.all(np.isnan(np.delete(backward, known, 0)[:, :felt]))
    assert forward[known] == pytest.approx(backward[known], rel=1e-12)
    for j in range(felt):
        best = np.full(len(known), np.inf)
        for step in (1e-3, 1e-4, 1e-5):
            slope = differences(lambda x: np.asarray(value(jnp.asarray(x)))[known], x, j, share=step)
            best = np.minimum(best, np.abs(slope - forward[known, j]) / np.abs(forward[known, j]))
        assert np.all(best < 1e-6), (j, best)


@pytest.mark.mends("derivatives of times were zero")
@pytest.mark.parametrize("size", [1.2, 3.0])
def test_a_bare_block_lifts_when_the_sine_exceeds_the_limit(size):
    # g (width/height) = a sin(omega t).
    omega, limit = 2.0 * np.pi * 1.2375, GRAVITY / 6.0

    def uplift(a):
        return tpd.transient(column(tpd.Pulse.one_sine(acceleration=a, frequency=1.2375))).uplift_time

    a = size * limit
    assert float(uplift(a)) == pytest.approx(math.asin(1.0 / size) / omega, rel=1e-8)
    known = -1.0 / (a * omega * math.sqrt(size**2 - 1.0))
    # The pulse consists of cubics.
    assert float(jax.grad(uplift)(a)) == pytest.approx(known, rel=1e-6)


@pytest.mark.mends("derivatives of times were zero")
@pytest.mark.parametrize(
    ("size", "y0", "unknown"),
    [
        # Nothing lifts; the largest tilt is that of the start; the block overturns.
        (0.5, None, (0, 3, 4)),
        (0.3, (0.1, 0.0, 0.0, 0.0), (0, 3, 4)),
        (8.0, None, (0, 1, 2, 4)),
    ],
)
def test_a_time_without_a_derivative_has_none_rather_than_zero(size, y0, unknown):
    x = jnp.array([size, 1.2375, 6.0, 450.0, 0.9])
    start = jnp.zeros(4) if y0 is None else jnp.array(y0)

    def both(x, y):
        return times_of(x, y0=y)

    for derivative in (jax.jacfwd, jax.jacrev):
        for slopes in derivative(both, argnums=(0, 1))(x, start):
            # NaN, and nothing else spoilt by it.
            assert np.all(np.isnan(slopes[jnp.array(unknown)]))
            assert np.all(np.isfinite(np.delete(np.asarray(slopes), unknown, 0)))


@pytest.mark.mends("derivatives of times were zero")
def test_samples_have_no_derivative_rather_than_none():
    scene = column(tpd.Record(np.sin(np.linspace(0.0, 18.0, 90)) * 2.5, 0.02))
    for name in ("tilt", *TIMES[:4]):
        slopes = jax.grad(lambda s, name=name: getattr(tpd.transient(s, HUNG), name))(scene)
        assert np.all(np.isnan(slopes.motion.acceleration))

    def scaled(x):
        return tpd.transient(column(scene.motion.scaled(x[0])), HUNG).tilt

    slope = float(differences(scaled, np.ones(1), 0, share=1e-5))
    assert float(jax.grad(scaled)(jnp.ones(1))[0]) == pytest.approx(slope, rel=1e-6)


@pytest.mark.mends("second derivatives raised an error of the compiled code's interface")
def test_second_derivatives_are_refused():
    def tilt(x):
        return tpd.transient(column(sine(x[0])), bob(length=x[1])).tilt

    x = jnp.array([2.0, 0.9])
    for derivative in (jax.jacfwd, jax.jacrev):
        assert np.all(np.isnan(jax.jit(derivative(jax.grad(tilt)))(x)))


def test_an_angle_that_is_largest_at_the_very_end_grows_with_the_free_time():
    block = tpd.Block(width=2.0, height=20.0, mass=80_000.0, friction=0.0)
    scene = tpd.Scene(block, tpd.Pulse.ricker(acceleration=0.1, frequency=8.0))
    hung = tpd.Pendulum(mass=2000.0, length=8.0, damping_ratio=0.1)
    start = np.array([0.02, 0.0, 0.05, 0.1])

    def angles(free):
        r = tpd.transient(scene, hung, y0=start, free=free)
        return jnp.stack([r.tilt, r.swing, r.relative])

    found = jax.jacfwd(angles)(0.1)
    moved = (angles(0.1 + 1e-6) - angles(0.1 - 1e-6)) / 2e-6
    np.testing.assert_allclose(found, moved, rtol=1e-6, atol=1e-9)
    assert np.any(np.abs(found) > 1e-3)


@pytest.mark.parametrize("model", [None, tpd.Segmented()], ids=["linear", "nonlinear"])
def test_batches_are_single_motions(model):
    def tilt(length):
        return tpd.transient(column(sine(2.0)), bob(length=length), model=model, free=2.0).tilt

    lengths = jnp.array([0.5, 0.9, 1.4])
    single = [float(tilt(float(x))) for x in lengths]
    assert np.asarray(jax.jit(jax.vmap(tilt))(lengths)) == pytest.approx(single, rel=1e-6 if model else 1e-13)


def test_forces_balance_momentum():
    # The horizontal force is the rate of the momentum of block and bob.
    scene = column(sine(2.0))
    t = np.linspace(0.15, 0.25, 2001)
    found = shaking_history(scene, HUNG, times=t)
    momentum = 9000.0 * -3.0 * found.tilt + 450.0 * (-6.0 * found.tilt + 0.9 * found.swing)
    second = np.gradient(np.gradient(momentum, t), t)[5:-5]
    force = (found.horizontal - 9450.0 * found.base)[5:-5]
    assert force == pytest.approx(second, abs=2e-4 * np.abs(force).max())
    assert found.rocking.all()
    assert 0.1 < found.needed_friction < 1.0


# By the nonlinear equations


@pytest.mark.parametrize("hung", [None, HUNG])
@pytest.mark.parametrize("motion", [sine(2.0), tpd.records.el_centro().scaled(1.155)], ids=["sine", "record"])
def test_nonlinear_motions_are_those_of_the_batch(motion, hung):
    found = tpd.transient(tpd.Scene(COLUMN, motion), hung, model=tpd.Segmented(rtol=1e-8))
    batch = follow_scaled(COLUMN, hung, [motion], np.ones((1, 1)), free=20.0, nonlinear=True)
    assert named(found) == "rocked"
    for name in ("tilt", "swing", "relative", "impacts"):
        assert float(getattr(found, name)) == getattr(batch, name)[0, 0], name
    assert (float(found.swing) > 0.01) == (hung is not None)


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


@pytest.mark.mends("derivatives of times were zero")
def test_nonlinear_motions_have_no_derivatives_rather_than_zero():
    names = ("tilt", "swing", *TIMES)

    def numbers(length, y0):
        found = tpd.transient(column(sine(2.0)), bob(length=length), model=tpd.Segmented(), y0=y0, free=1.0)
        return jnp.concatenate([jnp.stack([getattr(found, name) for name in names]), found.state])

    for slopes in jax.jacfwd(numbers, argnums=(0, 1))(2.0, jnp.zeros(4)):
        assert np.all(np.isnan(slopes))
    assert np.all(np.isnan(jax.jacrev(numbers)(2.0, jnp.zeros(4))))


def test_a_nonlinear_motion_has_a_status():
    stood = tpd.transient(tpd.Scene(COLUMN, sine(2.0).scaled(0.4)), HUNG, model=tpd.Segmented())
    assert (named(stood), float(stood.tilt), math.isinf(stood.uplift_time)) == ("stood", 0.0, True)
    large = tpd.Scene(COLUMN, tpd.Pulse.one_sine(acceleration=GRAVITY, frequency=0.7))
    fallen = tpd.transient(large, HUNG, model=tpd.Segmented())
    assert (named(fallen), math.isinf(fallen.tilt)) == ("overturned", True)
    assert 1.4 < float(fallen.overturning_time) < 5.0
    assert (
        named(tpd.transient(tpd.Scene(COLUMN, sine(2.0)), model=tpd.Segmented(), max_events=4))
        == "event_bound"
    )


def test_a_model_that_does_not_fit_is_one_sentence():
    scene = tpd.Scene(COLUMN, sine(2.0))
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


def test_bad_input_is_one_sentence():
    harmonic = tpd.Scene(COLUMN, tpd.Harmonic(amplitude=0.01, frequency=2.0))
    with pytest.raises(ValueError, match="harmonics are for"):
        tpd.transient(harmonic)
    with pytest.raises(ValueError, match="other motions are for"):
        column(sine(1.0)).parameters()
    with pytest.raises(ValueError, match="`free` must be between 0 and 100000 s"):
        tpd.transient(column(sine(1.0)), free=-1.0)
    with pytest.raises(ValueError, match="`frequency` must be positive"):
        tpd.Pulse.one_sine(acceleration=1.0, frequency=0.0)
    with pytest.raises(ValueError, match="`cycles` must lie within 1 and 8"):
        tpd.Pulse.mavroeidis_papageorgiou(velocity=1.0, frequency=1.0, cycles=0.5)
    with pytest.raises(ValueError, match="`scan` must"):
        tpd.critical_scale(column(sine(1.0)), scan=0.0)
