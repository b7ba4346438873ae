import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tpd
from tpd.answers.critical_scale import _scanned
from tpd.answers.shaking_history import shaking_history
from tpd.models.compiled_shaken import follow_all
from tpd.scene.ground_motion import PULSES

GRAVITY = 9.80665
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
HUNG = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
LONG = tpd.Pendulum(mass=900.0, length=2.1, damping_ratio=0.1)


def column(pulse: tpd.Pulse) -> tpd.Scene:
    return tpd.Scene(COLUMN, pulse)


def sine(size: float, frequency: float = 1.2375) -> tpd.Pulse:
    return tpd.Pulse.one_sine(acceleration=size * GRAVITY / 6.0, frequency=frequency)


# First critical peak acceleration over g (width/height), scan of 2 %, bisected; from an independent event
# loop that waits some 13 s for the block to fall, hence the tolerance.
CRITICAL = [
    ("one_sine", 0.7425, (1.3850197621, 1.4137807077, 1.5237469028)),
    ("one_sine", 1.2375, (2.4864693038, 2.9952308074, 7.0009413860)),
    ("one_sine", 1.4850, (3.9828414953, 5.4064918106, 9.2069563473)),
    ("one_cosine", 0.7425, (1.8031136707, 1.8880083403, 1.9844558175)),
]


@pytest.mark.parametrize(("kind", "frequency", "known"), CRITICAL)
def test_critical_scales_are_the_known_ones(kind, frequency, known):
    pulse = getattr(tpd.Pulse, kind)(acceleration=GRAVITY / 6.0, frequency=frequency)
    for hung, scale in zip((None, HUNG, LONG), known, strict=True):
        found = tpd.critical_scale(column(pulse), hung, scan=0.02)
        assert float(found.scale) == pytest.approx(scale, rel=1e-9)
        # The first tongue begins there, and another one is above it.
        assert float(found.tongues[0, 0]) == float(found.scale)


# A slender block on rho = 1 under one sine: sizes a_p/(g nu) from which it overturns after an impact, is safe
# again, and overturns without one (two independent computations), over omega_p/p.
BOUNDARIES = {
    0.9: {
        1.0: (1.132047,),
        2.0: (1.225179, 2.314403, 2.349903),
        3.0: (1.403565, 3.484663, 3.631150),
        4.0: (1.795442, 4.850111, 5.238964),
        5.0: (3.018600, 6.318071, 7.168129),
        6.0: (5.164159, 7.669873, 9.416966),
        8.0: (14.871352,),
    },
    1.0 - 1.5 * math.sin(0.25) ** 2: {
        1.0: (1.131682,),
        2.0: (1.224174, 2.317812, 2.349903),
        3.0: (1.400100, 3.499172, 3.631150),
        4.0: (1.778667, 4.890763, 5.238964),
        5.0: (2.920561, 6.416141, 7.168129),
        6.0: (4.909871, 7.924169, 9.416966),
        8.0: (14.871352,),
    },
}


@pytest.mark.parametrize("e", BOUNDARIES)
def test_boundaries_of_the_one_sine_spectrum(e):
    pieces = sine(1.0).pieces()
    for w, known in BOUNDARIES[e].items():
        # The parameters of the compiled code, with xi in the place of the duration of a piece.
        row = np.array([0.25, 0.0, 1.0, 0.3, 0.0, 0.25, w * len(pieces), 1.0, e])
        tongues = _scanned(row, pieces, 20.0, np.array([0.9, 20.0]), 0.005)[1]
        borders = tongues[np.isfinite(tongues)]
        # Between those of the table are a few narrow ones, which SciPy confirms (at omega_p/p = 1).
        assert all(np.min(np.abs(borders - border)) < 1.01e-6 for border in known), borders


def test_a_bare_block_without_impact_overturns_by_the_integral():
    # Zhang and Makris' condition for a slender block: int exp(-(tau - tau0)) s dtau > 1 from uplift on.
    def margin(size: float, w: float) -> float:
        tau0 = math.asin(1.0 / size) / w
        ends = np.array([tau0, 2.0 * math.pi / w])
        # exp(-tau) (-sin w tau - w cos w tau)/(1 + w^2) is an integral of exp(-tau) sin w tau.
        f = np.exp(-(ends - tau0)) * (-np.sin(w * ends) - w * np.cos(w * ends)) / (1.0 + w * w)
        return size * (f[1] - f[0]) - 1.0

    for w in (1.0, 3.0, 5.0):
        known = BOUNDARIES[0.9][w][-1]
        if w > 1.0:
            assert abs(margin(known, w)) < 2e-6


def test_the_critical_scale_has_its_exact_slope():
    def scale(length, mass):
        return tpd.critical_scale(
            column(sine(1.0)), tpd.Pendulum(mass=mass, length=length, damping_ratio=0.1)
        ).scale

    found = jax.grad(scale, argnums=(0, 1))(0.9, 450.0)
    for i, at in enumerate((0.9, 450.0)):
        step = 1e-4 * at
        x = [0.9, 450.0]
        values = []
        for k in (-2, -1, 1, 2):
            x[i] = at + k * step
            values.append(float(scale(*x)))
        slope = (8.0 * (values[2] - values[1]) - (values[3] - values[0])) / (12.0 * step)
        assert float(found[i]) == pytest.approx(slope, rel=1e-6)


def test_a_motion_that_never_overturns_has_no_critical_scale():
    found = tpd.critical_scale(column(sine(1.0)), highest=2.0)
    assert np.isinf(float(found.scale))
    assert np.all(np.isnan(found.tongues))
    assert "does not overturn up to 2 times" in str(found)
    slope = jax.grad(
        lambda m: (
            tpd.critical_scale(
                column(sine(1.0)), tpd.Pendulum(mass=m, length=0.9, damping_ratio=0.1), highest=2.0
            ).scale
        )
    )(450.0)
    assert math.isnan(slope)


def integrated(scene: tpd.Scene, pendulum: tpd.Pendulum | None, end: float) -> np.ndarray:
    """State at `end` (tau) of a block that is tilted to the right and goes on tilting, by SciPy."""
    p = scene.ground_parameters(pendulum)
    h, n = float(2.0 * np.pi / p.xi), len(scene.motion.pieces())
    c = -np.asarray(scene.motion.pieces())
    nu, mu, lam, rho, f = (float(x) for x in (p.nu, p.mu, p.lam, p.inertia_ratio, p.f))
    hinge = float(p.hinge)
    mass = np.array([[1.0 + mu * rho * (4.0 + nu**2), -2.0 * mu * rho * lam], [-2.0 * rho, lam * rho]])
    up, k = 1.0 + 2.0 * mu, float(p.k)

    def rate(t, y):
        i = min(int(t / h), n)
        x = t / h - i
        eta = 0.0 if i == n else f * (c[i] @ x ** np.arange(4))
        tilt, way = np.sign(y[0]), np.sign(y[2])
        slip = y[2] - y[3]
        r1 = up * y[0] - (1.0 + mu) * nu * tilt - k * way - up * eta - mu * lam * hinge * slip
        r2 = eta - y[1] + hinge * slip
        return np.concatenate([y[2:], np.linalg.solve(mass, [r1, r2])])

    y, t = np.array([0.05, 0.0, 0.2, 0.0]), 0.0
    while t < end - 1e-12:
        to = min((int(t / h + 1e-9) + 1) * h, end)
        y = solve_ivp(rate, (t, to), y, rtol=1e-12, atol=1e-14, method="DOP853").y[:, -1]
        t = to
    return y


@pytest.mark.parametrize("hung", [None, HUNG])
def test_an_arc_is_that_of_an_integrator(hung):
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.01, restitution=0.9595)
    scene = tpd.Scene(block, tpd.Pulse.ricker(acceleration=1.0, frequency=4.0))
    rate = float(scene.rate)
    y0 = np.array([0.05, 0.0, 0.2 * rate, 0.0])
    # 0.3 s: it does not turn by then.
    found = shaking_history(scene, hung, times=np.array([0.0, 0.3]), y0=y0)
    known = integrated(scene, hung, 0.3 * rate)
    assert found.tilt[-1] == pytest.approx(known[0], rel=1e-9)
    if hung is not None:
        assert found.swing[-1] == pytest.approx(known[1], rel=1e-8)


def test_sampled_sine_tends_to_the_pulse_with_the_square_of_the_step():
    exact = float(tpd.transient(column(sine(2.0)), HUNG).tilt)
    errors = []
    for n in (50, 100, 200, 400):
        t = np.linspace(0.0, 1.0, n + 1)
        samples = np.sin(2.0 * np.pi * t) * 2.0 * GRAVITY / 6.0
        record = tpd.Record(samples, 1.0 / 1.2375 / n)
        errors.append(abs(float(tpd.transient(column(record), HUNG).tilt) - exact))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 2.0) < 0.1)


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


def test_a_motion_that_lifts_nothing_is_answered_at_once():
    found = tpd.transient(column(sine(0.999)))
    assert tpd.status_name(found.status) == "stood"
    assert float(found.tilt) == 0.0
    assert np.isinf(float(found.uplift_time))
    lifted = tpd.transient(column(sine(1.001)))
    assert tpd.status_name(lifted.status) == "rocked"
    assert 0.0 < float(lifted.tilt) < 1e-4


def test_an_overturning_is_decided_when_the_motion_ends():
    # The tilt is far from any bound at the end of half a second of free motion.
    late = tpd.transient(column(sine(2.5)), free=0.5)
    assert tpd.status_name(late.status) == "overturned"
    assert np.isinf(float(late.tilt))
    assert float(late.overturning_time) > 1.0
    slope = jax.grad(
        lambda m: tpd.transient(column(sine(3.5)), tpd.Pendulum(mass=m, length=0.9, damping_ratio=0.1)).tilt
    )
    assert math.isnan(slope(450.0))


def leaves_of(scene: tpd.Scene, hung: tpd.Pendulum):
    """A function of SI quantities, and where it is taken."""

    def tilt(x):
        block = tpd.Block(width=x[0], height=x[1], mass=x[2], friction=x[3], restitution=x[4])
        pulse = tpd.Pulse.one_sine(acceleration=x[5], frequency=x[6])
        pendulum = tpd.Pendulum(mass=x[7], length=x[8], damping_ratio=x[9])
        found = tpd.transient(tpd.Scene(block, pulse, x[10]), pendulum, free=8.0)
        return jnp.stack([found.tilt, found.swing, found.relative, *found.state[1:4:2]])

    b, m = scene.block, scene.motion
    x = (b.width, b.height, b.mass, 0.01, b.restitution, m.acceleration, m.frequency)
    return tilt, np.array([*x, hung.mass, hung.length, hung.damping_ratio, GRAVITY], dtype=float)


@pytest.mark.parametrize("size", [1.3, 2.1])
def test_derivatives_are_those_of_differences(size):
    function, x = leaves_of(column(sine(size)), HUNG)
    value = jax.jit(function)
    forward = np.asarray(jax.jacfwd(function)(jnp.asarray(x)))
    backward = np.asarray(jax.jacrev(function)(jnp.asarray(x)))
    assert forward == pytest.approx(backward, rel=1e-12, abs=1e-14)
    for j in range(len(x)):
        best = np.full(5, np.inf)
        for step in (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6):
            d = step * x[j]
            at = [
                np.asarray(value(jnp.asarray(x + k * d * (np.arange(len(x)) == j)))) for k in (-2, -1, 1, 2)
            ]
            slope = (8.0 * (at[2] - at[1]) - (at[3] - at[0])) / (12.0 * d)
            scale = np.abs(forward[:, j]) + 1e-6 * np.abs(forward[:, j]).max()
            best = np.minimum(best, np.abs(slope - forward[:, j]) / scale)
        # The state after hundreds of hops differs less smoothly than the largest angles do.
        assert np.all(best[:3] < 1e-6), (j, best)


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
@pytest.mark.parametrize("size", [1.3, 2.1, 8.0])
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
            d = step * x[j] * np.eye(5)[j]
            at = [np.asarray(value(jnp.asarray(x + k * d)))[known] for k in (-2, -1, 1, 2)]
            slope = (8.0 * (at[2] - at[1]) - (at[3] - at[0])) / (12.0 * step * x[j])
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
def test_times_have_no_derivative_in_samples():
    scene = column(tpd.Record(np.sin(np.linspace(0.0, 18.0, 90)) * 2.5, 0.02))
    for name in TIMES[:4]:
        slopes = jax.grad(lambda s, name=name: getattr(tpd.transient(s, HUNG), name))(scene)
        assert np.all(np.isnan(slopes.motion.acceleration))


@pytest.mark.mends("second derivatives raised an error of the compiled code's interface")
def test_second_derivatives_are_refused():
    def tilt(x):
        return tpd.transient(
            column(sine(x[0])), tpd.Pendulum(mass=450.0, length=x[1], damping_ratio=0.1)
        ).tilt

    x = jnp.array([2.0, 0.9])
    assert np.all(np.isnan(jax.hessian(tilt)(x)))
    assert np.all(np.isnan(jax.jacrev(jax.grad(tilt))(x)))
    assert np.all(np.isnan(jax.jit(jax.jacfwd(jax.jacfwd(tilt)))(x)))


def test_samples_have_no_derivative_rather_than_none():
    scene = column(tpd.Record(np.sin(np.linspace(0.0, 18.0, 90)) * 2.5, 0.02))
    slopes = jax.grad(lambda s: tpd.transient(s, HUNG).tilt)(scene)
    assert np.all(np.isnan(slopes.motion.acceleration))
    by_scale = jax.grad(lambda c: tpd.transient(column(scene.motion.scaled(c)), HUNG).tilt)(1.0)
    high, low = (
        float(tpd.transient(column(scene.motion.scaled(c)), HUNG).tilt) for c in (1 + 1e-6, 1 - 1e-6)
    )
    assert float(by_scale) == pytest.approx((high - low) / 2e-6, rel=1e-6)


def test_batches_are_single_motions():
    lengths = jnp.array([0.5, 0.9, 1.4])
    hung = lambda x: tpd.Pendulum(mass=450.0, length=x, damping_ratio=0.1)  # noqa: E731
    together = jax.vmap(lambda x: tpd.transient(column(sine(2.0)), hung(x)).tilt)(lengths)
    single = [float(tpd.transient(column(sine(2.0)), hung(float(x))).tilt) for x in lengths]
    assert np.asarray(together).tolist() == single


def test_whole_pieces_and_searched_ones_are_one_motion():
    # Every piece divided by three has the same cubic, and other proofs.
    pulse = sine(2.3)
    scene = column(pulse)
    p = scene.ground_parameters(HUNG)
    numbers = [
        float(x)
        for x in (p.nu, p.mu, p.lam, p.zeta, p.k, p.f, 2 * np.pi / p.xi, p.inertia_ratio, p.velocity_ratio)
    ]
    c = np.asarray(pulse.pieces())
    thirds = []
    for row in c:
        polynomial = np.polynomial.Polynomial(row)
        for k in range(3):
            thirds.append(polynomial(np.polynomial.Polynomial([k / 3.0, 1.0 / 3.0])).coef)
    fine = numbers.copy()
    fine[6] /= 3.0
    rows, which, free = np.array([numbers, fine]), np.array([0, 1]), np.full(2, 20.0)
    found, by = follow_all(rows, [c, np.array(thirds)], which, free, slopes=True)
    assert found.tilt[0] == pytest.approx(found.tilt[1], rel=1e-11)
    assert found.swing[0] == pytest.approx(found.swing[1], rel=1e-10)
    by[1, :, 6] /= 3.0
    assert by[0, :3, :9] == pytest.approx(by[1, :3, :9], rel=1e-8, abs=1e-9)


def test_less_is_followed_where_less_is_asked():
    rows = []
    for size in np.linspace(0.9, 4.0, 40):
        p = column(sine(size)).ground_parameters(HUNG)
        rows.append(
            [
                float(x)
                for x in (
                    p.nu,
                    p.mu,
                    p.lam,
                    p.zeta,
                    p.k,
                    p.f,
                    2 * np.pi / p.xi,
                    p.inertia_ratio,
                    p.velocity_ratio,
                )
            ]
        )
    c, which = sine(1.0).pieces(), np.zeros(40, dtype=int)
    full, _ = follow_all(np.array(rows), [c], which, np.full(40, 30.0))
    brief, _ = follow_all(np.array(rows), [c], which, np.full(40, 30.0), brief=True)
    assert np.array_equal(full.status, brief.status)
    # Turns of the bob are not looked for: other pieces are taken in one step, and rounding is another.
    np.testing.assert_allclose(brief.tilt, full.tilt, rtol=1e-13)


def test_too_many_events_have_a_name():
    found = tpd.transient(column(sine(2.0)), HUNG, max_events=3)
    assert tpd.status_name(found.status) == "event_bound"
    assert math.isnan(
        jax.grad(
            lambda m: (
                tpd.transient(
                    column(sine(2.0)), tpd.Pendulum(mass=m, length=0.9, damping_ratio=0.1), max_events=3
                ).tilt
            )
        )(450.0)
    )


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


def test_impacts_have_their_times_and_rates():
    found = shaking_history(column(sine(2.0)), free=20.0)
    assert len(found.impacts) == int(tpd.transient(column(sine(2.0)), free=20.0).impacts)
    times, rates = found.impacts.T
    assert np.all(np.diff(times) > 0.0)
    # In free rocking every impact takes the same share of the rate.
    free = rates[times > 1.0 / 1.2375]
    assert np.abs(free[1:] / free[:-1]) == pytest.approx(0.9595, rel=1e-9)
    tilts = np.interp(times, found.times, found.tilt)
    assert np.abs(tilts).max() < 1e-3


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
