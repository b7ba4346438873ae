"""Motions under pulses and records: to 50 digits, with derivatives, by both equations, and refusals."""

import itertools
import math
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests.reference import NAMES, EventDriven, differences
from tests.truth import GRAVITY, load
from tpd.answers.critical_scale import _scanned, follow_motion
from tpd.answers.run_table import follow_scaled
from tpd.answers.transient import accuracy_of
from tpd.compiled.rows import ground_row_of

TABLE = load("ground")
CASES = {case["name"]: case for case in TABLE["cases"]}
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)


def bob(mass=450.0, length=0.9) -> tpd.Pendulum:
    return tpd.Pendulum(mass=mass, length=length, damping_ratio=0.1)


PENDULUM = bob()


def column(pulse: tpd.Pulse | tpd.Record) -> tpd.Scene:
    return tpd.Scene(COLUMN, pulse)


def sine(size: float, frequency: float = 1.2375) -> tpd.Pulse:
    return tpd.Pulse.one_sine(acceleration=size * GRAVITY / 6.0, frequency=frequency)


def named(found) -> str:
    return tpd.status_name(found.status)


def motion_of(case) -> tpd.Pulse | tpd.Record:
    m, scale = case["motion"], float(case["scene"]["scale"])
    peak, frequency = float(m.get("peak", 1.0)), float(m.get("frequency", 1.0))
    match m["kind"]:
        case "samples" if m.get("record") == "el_centro":
            return tpd.records.el_centro().scaled(scale)
        case "samples":
            return tpd.Record(np.array(m["acceleration"], dtype=float), float(m["dt"])).scaled(scale)
        case "mavroeidis":
            shape = {
                "velocity": float(m["velocity"]),
                "cycles": float(m["gamma"]),
                "phase": float(m["phase"]),
            }
            return tpd.Pulse.mavroeidis_papageorgiou(frequency=frequency, **shape).scaled(scale)
        case kind:
            return getattr(tpd.Pulse, kind)(acceleration=peak, frequency=frequency).scaled(scale)


def scene_of(s, motion) -> tuple[tpd.Scene, tpd.Pendulum | None]:
    block = tpd.Block(**{k: float(s[k]) for k in ("width", "height", "mass", "friction", "restitution")})
    scene = tpd.Scene(block, motion, float(s.get("gravity", 9.80665)))
    if "bob" not in s:
        return scene, None
    bob = {"mass": float(s["bob"]), "length": float(s["length"]), "damping_ratio": float(s["damping"])}
    return scene, tpd.Pendulum(**bob)


def given(case) -> tuple[tpd.Scene, tpd.Pendulum | None, dict]:
    scene, with_it = scene_of(case["scene"], motion_of(case))
    y0 = np.array(case["y0"], dtype=float) * clock(scene)
    return scene, with_it, {"y0": y0, "free": float(case["free"])}


def clock(scene) -> np.ndarray:
    """What makes rates in tau rates in time."""
    return np.array([1.0, 1.0, scene.rate, scene.rate], dtype=float)


@pytest.mark.parametrize("name", CASES)
def test_a_transient_agrees_with_a_solution_of_fifty_digits(name):
    known = CASES[name]["results"]
    scene, with_it, how = given(CASES[name])
    found = tpd.transient(scene, with_it, **how)
    assert (named(found) == "overturned") == known["overturned"]
    assert float(found.uplift_time) == pytest.approx(float(known["uplift_time"]), rel=1e-7, abs=1e-12)
    if known["overturned"]:
        return
    assert float(found.tilt) == pytest.approx(float(known["tilt"]), rel=1e-10)
    assert float(found.tilt_time) == pytest.approx(float(known["tilt_time"]), rel=1e-6)
    if known["swing"] is not None:
        assert float(found.swing) == pytest.approx(float(known["swing"]), rel=1e-10)
        assert float(found.rod_angle) == pytest.approx(float(known["relative_swing"]), rel=1e-10)
    # The end lies tens of impacts later.
    for value, digits in zip(np.asarray(found.state) / clock(scene), known["end"], strict=True):
        if digits is not None:
            assert value == pytest.approx(float(digits), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("name", [n for n, c in CASES.items() if "derivatives" in c["results"]])
def test_derivatives_of_a_transient_agree_with_fifty_digits(name):
    scene, with_it, how = given(CASES[name])
    block, own = scene.block, float(CASES[name]["scene"]["scale"])

    def tilt(x):
        changed = replace(block, friction=x["friction"], restitution=x["restitution"])
        pendulum = tpd.Pendulum(mass=x["bob"], length=x["length"], damping_ratio=x["damping"])
        return tpd.transient(
            tpd.Scene(changed, scene.excitation.scaled(x["scale"] / own)), pendulum, **how
        ).tilt

    at = {"bob": with_it.mass, "length": with_it.length, "damping": with_it.damping_ratio, "scale": own}
    at |= {"friction": block.friction, "restitution": block.restitution}
    found = jax.grad(tilt)({key: float(value) for key, value in at.items()})
    for key, known in CASES[name]["results"]["derivatives"].items():
        if key in at:
            assert float(found[key]) == pytest.approx(float(known), rel=1e-8, abs=1e-10), key


@pytest.mark.parametrize("row", TABLE["critical"], ids=lambda row: row["name"])
def test_critical_scales_agree_with_fifty_digits(row):
    s, m = row["scene"], row["motion"]
    size = GRAVITY * float(s["width"]) / float(s["height"])
    pulse = getattr(tpd.Pulse, m["kind"])(acceleration=size, frequency=float(m["frequency"]))
    scene, with_it = scene_of(s, pulse)
    found = tpd.critical_scale(scene, with_it)
    assert float(found.scale) == pytest.approx(float(row["scale"]), rel=1e-10)
    # The first tongue begins there, and another one is above it.
    assert float(found.tongues[0, 0]) == float(found.scale)


@pytest.mark.parametrize("row", TABLE["boundaries"], ids=lambda row: row["name"])
def test_boundaries_of_the_one_sine_spectrum_agree_with_fifty_digits(row):
    pieces = sine(1.0).pieces()
    xi = row["frequency_ratio"] * len(pieces)
    p = tpd.Parameters(
        nu=0.25, mu=0.0, lam=1.0, zeta=0.3, k=0.0, f=0.25, xi=xi, rho=1.0, e=row["restitution"]
    )
    run = partial(follow_motion, tpd.Piecewise(), pieces, 20.0)
    tongues = _scanned(run, ground_row_of(p), np.array([0.9, 20.0]), 0.005)[1]
    borders = tongues[np.isfinite(tongues)]
    # Between those of the table are a few narrow ones.
    for known in row["scales"]:
        assert np.min(np.abs(borders / float(known) - 1.0)) < 1e-9, borders


def test_a_sine_train_equals_the_harmonic_from_rest():
    with_it = tpd.Pendulum(mass=900.0, length=1.5, damping_ratio=0.3)
    harmonic = tpd.Harmonic(amplitude=0.05, frequency=1.2)
    train = tpd.Pulse.sine_train(acceleration=0.05 * harmonic.rate**2, frequency=1.2, cycles=6)
    found = tpd.transient(column(train), with_it, free=0.0)
    p = tpd.Scene(COLUMN, harmonic).parameters(with_it)
    moved = tpd.simulate(p, np.zeros(4), np.array([0.0, 6.0 * float(p.period)])).ys[-1]
    # The base of the harmonic moves to the other side first.
    np.testing.assert_allclose(-found.state, moved * clock(column(train)), rtol=1e-9, atol=1e-11)


def test_a_transient_has_the_status_stood_rocked_or_overturned():
    stood, lifted = (tpd.transient(column(sine(size))) for size in (0.999, 1.001))
    assert (named(stood), float(stood.tilt), float(stood.uplift_time)) == ("stood", 0.0, math.inf)
    assert named(lifted) == "rocked"
    assert 0.0 < float(lifted.tilt) < 1e-4
    # The tilt is far from any bound at the end of half a second of free motion.
    late = tpd.transient(column(sine(2.5)), free=0.5)
    assert (named(late), float(late.tilt)) == ("overturned", math.inf)
    assert float(late.overturning_time) > 1.0
    few = tpd.transient(column(sine(2.0)), PENDULUM, max_events=3)
    assert named(few) == "event_bound"
    for size, bound in ((3.5, 1000), (2.0, 3)):
        slope = jax.grad(lambda m, s=size, n=bound: tpd.transient(column(sine(s)), bob(m), max_events=n).tilt)
        assert math.isnan(slope(450.0))


def test_the_final_state_has_derivatives_in_initial_state_and_free_time():
    scene = column(tpd.Pulse.one_sine(acceleration=0.5, frequency=1.0))

    @jax.jit
    def end(x):
        return tpd.transient(scene, PENDULUM, y0=x[:4], free=x[4]).state

    x = jnp.array([0.02, 0.01, 0.1, -0.05, 0.2])
    slopes = np.asarray(jax.jacfwd(end)(x))
    for j, d in enumerate(1e-6 * np.eye(5)):
        slope = np.asarray(end(x + d) - end(x - d)) / 2e-6
        assert slopes[:, j] == pytest.approx(slope, rel=1e-6, abs=1e-8)


TIMES = ("tilt_time", "swing_time", "rod_angle_time", "uplift_time", "overturning_time")


def times_of(x, *, with_it=True, y0=None):
    """Times (s) of the motion under a sine of x[0] uplift accelerations and of x[1] Hz, of a column of height
    x[2] with a bob of mass x[3] on a length x[4], or without one."""
    block = tpd.Block(width=1.0, height=x[2], mass=9000.0, friction=0.01, restitution=0.95)
    pulse = tpd.Pulse.one_sine(acceleration=x[0] * GRAVITY / 6.0, frequency=x[1])
    pendulum = tpd.Pendulum(mass=x[3], length=x[4], damping_ratio=0.1) if with_it else None
    found = tpd.transient(tpd.Scene(block, pulse), pendulum, y0=y0, free=8.0)
    return jnp.stack([getattr(found, name) for name in TIMES])


SLOPES_OF_TIMES = jax.jit(jax.jacrev(lambda x, y: times_of(x, y0=y), argnums=(0, 1)))


# Of a block that overturns the uplift alone, of a bare one the block's own times.
@pytest.mark.parametrize(
    ("size", "with_it", "known"), [(2.1, True, [0, 1, 2, 3]), (2.1, False, [0, 3]), (8.0, True, [3])]
)
def test_derivatives_of_event_times_equal_finite_differences(size, with_it, known):
    x, felt = np.array([size, 1.2375, 6.0, 450.0, 0.9]), 5 if with_it else 3
    value = jax.jit(lambda x: times_of(x, with_it=with_it))
    forward, backward = (np.asarray(d(value)(jnp.asarray(x))) for d in (jax.jacfwd, jax.jacrev))
    assert np.all(np.isnan(np.delete(forward, known, 0)))
    assert np.all(np.isnan(np.delete(backward, known, 0)[:, :felt]))
    assert forward[known] == pytest.approx(backward[known], rel=1e-12)
    for j in range(felt):
        shares = (1e-3, 1e-4, 1e-5)
        slopes = [differences(lambda x: np.asarray(value(x))[known], x, j, share=s) for s in shares]
        errors = np.abs(np.array(slopes) - forward[known, j]) / np.abs(forward[known, j])
        assert np.all(errors.min(axis=0) < 1e-6), (j, errors)


@pytest.mark.parametrize(
    ("size", "y0", "unknown"),
    [
        # Nothing lifts; the block overturns.
        (0.5, (0.0, 0.0, 0.0, 0.0), (0, 3, 4)),
        (8.0, (0.0, 0.0, 0.0, 0.0), (0, 1, 2, 4)),
    ],
)
def test_an_event_time_without_a_derivative_has_nan(size, y0, unknown):
    x = jnp.array([size, 1.2375, 6.0, 450.0, 0.9])
    for slopes in SLOPES_OF_TIMES(x, jnp.array(y0)):
        # NaN, and nothing else spoilt by it.
        assert np.all(np.isnan(slopes[jnp.array(unknown)]))
        assert np.all(np.isfinite(np.delete(np.asarray(slopes), unknown, 0)))


NUMBERS = ("tilt", "swing", "rod_angle", *TIMES[:4])


def numbers_of(found) -> jax.Array:
    return jnp.concatenate([jnp.stack([getattr(found, name) for name in NUMBERS]), found.state])


WAVES = 2.5 * np.sin(np.linspace(0.0, 18.0, 90))
"""Samples of a record."""


def near_fault(shape) -> tpd.Pulse:
    """A pulse of the given cycles and phase."""
    return tpd.Pulse.mavroeidis_papageorgiou(velocity=0.6, frequency=1.0, cycles=shape[0], phase=shape[1])


SHAPES = {"record": (lambda x: tpd.Record(x, 0.02), WAVES), "pulse": (near_fault, np.array([2.0, 0.3]))}


@pytest.mark.parametrize(("kind", "derivative"), [("record", jax.jacrev), ("pulse", jax.jacfwd)])
def test_derivatives_in_the_shape_of_a_ground_motion_are_nan_and_change_no_others(kind, derivative):
    motion, shape = SHAPES[kind]

    def numbers(shape, width):
        scene = tpd.Scene(replace(COLUMN, width=width), motion(shape))
        return numbers_of(tpd.transient(scene, PENDULUM, free=1.0))

    in_shape, in_width = jax.jit(derivative(numbers, argnums=(0, 1)))(shape, 1.0)
    assert np.all(np.isnan(in_shape))
    known = jax.jit(derivative(partial(numbers, shape)))(1.0)
    np.testing.assert_allclose(in_width, known, rtol=1e-11)
    assert np.all(np.isfinite(in_width))


def test_an_angle_that_still_grows_has_a_derivative_in_the_free_time():
    block = tpd.Block(width=2.0, height=20.0, mass=80_000.0, restitution=1.0)
    scene = tpd.Scene(block, tpd.Pulse.ricker(acceleration=0.1, frequency=8.0))
    with_it = tpd.Pendulum(mass=2000.0, length=8.0, damping_ratio=0.1)

    def angles(free):
        r = tpd.transient(scene, with_it, y0=np.array([0.02, 0.0, 0.05, 0.1]), free=free)
        return jnp.stack([r.tilt, r.swing, r.rod_angle])

    found = jax.jacfwd(angles)(0.1)
    np.testing.assert_allclose(found, (angles(0.1 + 1e-6) - angles(0.1 - 1e-6)) / 2e-6, rtol=1e-6, atol=1e-9)
    assert np.any(np.abs(found) > 1e-3)


@pytest.mark.parametrize(
    ("motion", "with_it"), [(sine(2.0), None), (tpd.records.el_centro().scaled(1.155), PENDULUM)]
)
def test_a_nonlinear_transient_equals_its_row_of_a_batch(motion, with_it):
    found = tpd.transient(column(motion), with_it, model=tpd.Nonlinear(rtol=1e-8))
    batch = follow_scaled(
        COLUMN, (with_it,), [motion], np.ones((1, 1)), free=20.0, equations=tpd.Terms.nonlinear
    )
    assert named(found) == "rocked"
    for name in ("tilt", "impacts", "swing", "rod_angle"):
        # The table follows a bob without mass where there is no pendulum.
        if with_it is not None or name in ("tilt", "impacts"):
            assert float(getattr(found, name)) == getattr(batch, name)[0, 0, 0], name
    assert (float(found.swing) > 0.01) == (with_it is not None)


def test_nonlinear_transients_of_slender_blocks_tend_to_the_linear_ones():
    names, errors = ("tilt", "tilt_time", "swing", "rod_angle", "swing_time", "rod_angle_time"), []
    for nu in (0.02, 0.01):
        block = tpd.Block(width=6.0 * nu, height=6.0, mass=9000.0, friction=0.0, restitution=0.95)
        with_it = tpd.Pendulum(mass=720.0, length=2.0, damping_ratio=0.1)
        scene = tpd.Scene(block, tpd.Pulse.one_sine(acceleration=2.0 * GRAVITY * nu, frequency=1.2375))
        models = tpd.Nonlinear(rtol=1e-11), None
        ours, exact = (tpd.transient(scene, with_it, model=model, free=2.0) for model in models)
        errors.append([float(getattr(ours, n) / getattr(exact, n)) - 1.0 for n in names])
        assert float(ours.uplift_time) == pytest.approx(float(exact.uplift_time), rel=nu**2)
    # What (25) leaves out is of second order in the angles.
    assert np.log2(np.array(errors[0]) / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_a_nonlinear_transient_has_the_status_stood_rocked_or_overturned():
    def end(motion, with_it=PENDULUM, **how):
        found = tpd.transient(column(motion), with_it, model=tpd.Nonlinear(), **how)
        return found, (named(found), float(found.tilt))

    stood, said = end(sine(0.8))
    assert (*said, math.isinf(stood.uplift_time)) == ("stood", 0.0, True)
    fallen, said = end(tpd.Pulse.one_sine(acceleration=GRAVITY, frequency=0.7))
    assert said == ("overturned", math.inf)
    assert 1.4 < float(fallen.overturning_time) < 5.0
    # The outcome does not depend on the time after which the run would end.
    for size, with_it in itertools.product(np.linspace(2.0, 10.0, 4), (PENDULUM, None)):
        motion = tpd.Pulse.one_sine(acceleration=size, frequency=0.7)
        until = [end(motion, with_it, free=free)[0] for free in (0.0, 1.0, 20.0)]
        assert {named(x) for x in until} == {"rocked" if size < 2.5 else "overturned"}
        if size > 2.5:
            assert float(until[0].overturning_time) == pytest.approx(float(until[2].overturning_time))
    assert end(sine(2.0), None, max_events=4)[1][0] == "event_bound"


@pytest.mark.parametrize("nonlinear", [True, False])
@pytest.mark.parametrize("with_it", [None, PENDULUM])
def test_the_time_of_overturning_equals_the_event_loop(nonlinear, with_it):
    for way in (-1.0, 1.0):
        samples = way * (3.0 + 2.0 * np.random.default_rng(0).normal(size=12))
        record = tpd.Record(np.array([0.0, *samples, 0.0]), 0.1)
        scene = column(record)
        model = tpd.Nonlinear(rtol=1e-10) if nonlinear else None
        found = tpd.transient(scene, with_it, model=model, free=10.0)
        assert named(found) == "overturned"
        p, rate = scene.ground_parameters(with_it), float(scene.rate)
        x = [float(getattr(p, name)) for name in NAMES]
        _, mu, *_ = x
        eta = -np.asarray(record.acceleration) / float(record.pga) * x[NAMES.index("f")]
        loop = EventDriven(x, nonlinear=nonlinear, samples=(eta, 0.1 * rate))
        # The linear model has its own tilt from which no block returns.
        up = 1.0 + 2.0 * mu
        loop.GONE = 0.5 * math.pi if nonlinear else 10.0 * ((1.0 + mu) * x[0] + x[4] + x[5] * up) / up
        loop.run(np.zeros(4), np.array([0.0, 11.3 * rate]))
        assert float(found.overturning_time) == pytest.approx(loop.fell / rate, rel=1e-10)
        assert abs(float(found.state[0])) == pytest.approx(loop.GONE, rel=1e-10)
        # No event is sooner by a coarser tolerance: a step's length is not part of the answer.
        if nonlinear:
            coarse = tpd.transient(scene, with_it, model=tpd.Nonlinear(rtol=1e-6), free=10.0)
            assert float(coarse.overturning_time) == pytest.approx(loop.fell / rate, rel=1e-5)


def test_a_block_that_begins_beyond_the_toppling_angle_overturns_at_once():
    found = tpd.transient(column(sine(2.0)), model=tpd.Nonlinear(), y0=np.array([1.6, 0.0, 0.0, 0.0]))
    # The bisection ends at a number of rounding.
    assert (named(found), float(found.overturning_time)) == ("overturned", pytest.approx(0.0, abs=1e-15))


def test_a_model_without_transients_is_rejected_in_one_sentence():
    # A checker of types refuses these before this, where there is one.
    for model, words in (
        (tpd.Auto(), "Piecewise or Nonlinear, but is Auto"),
        (tpd.Smoothed(), "Piecewise or Nonlinear, but is Smoothed"),
        (tpd.Nonlinear, "the class itself"),
    ):
        with pytest.raises(ValueError, match=words):
            accuracy_of(model)


def test_an_excitation_of_the_wrong_kind_is_rejected_in_one_sentence():
    harmonic = tpd.Scene(COLUMN, tpd.Harmonic(amplitude=0.01, frequency=2.0))
    with pytest.raises(ValueError, match="harmonics are for"):
        tpd.transient(harmonic)
    with pytest.raises(ValueError, match="for other motions"):
        column(sine(1.0)).parameters()
    with pytest.raises(ValueError, match="`scan` must"):
        tpd.critical_scale(column(sine(1.0)), scan=0.0)
