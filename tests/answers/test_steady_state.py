"""What `steady_state` and `simulate` promise, for both models: transformations, shapes, refusals."""

import collections
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import (
    CONSERVING,
    HUNG,
    LEANING,
    REST,
    STILL,
    exact,
    orbits_of,
    parameters,
    smoothed,
)
from tpd import (
    Parameters,
    Piecewise,
    Smoothed,
    Status,
    simulate,
    status_name,
    steady_state,
    symmetric_orbits,
)
from tpd.answers.symmetric_orbits import all_symmetric_orbits
from tpd.scene.status import names_of
from tpd.theory import uplift

MODELS = [pytest.param(Piecewise(), exact, id="piecewise"), pytest.param(Smoothed(), smoothed, id="smoothed")]
X = np.array(HUNG[3].x)
OVERTURNING = parameters((0.25, 0.1, 0.2, 0.1, 0.05, 0.6, 2.67))


def test_reverse_mode_needs_no_jit():
    # `exact` is compiled, and takes its Jacobian in reverse mode.
    amplitude, slopes = jax.value_and_grad(lambda x: steady_state(parameters(x)).amplitude)(X)
    assert amplitude == pytest.approx(exact(X).amplitude, rel=1e-12)
    np.testing.assert_allclose(slopes, exact(X).slopes[0], rtol=1e-8)


@pytest.mark.parametrize(
    ("model", "solve"),
    [MODELS[0], pytest.param(Smoothed(), smoothed, marks=pytest.mark.slow, id="smoothed")],
)
def test_forward_mode_of_a_batch_agrees_with_reverse_mode_of_one(model, solve):
    def sizes(x):
        steady = steady_state(parameters(x), model=model)
        return jnp.stack([steady.amplitude, steady.stroke]), steady.status

    designs = np.array([X, STILL.x])
    slopes, statuses = jax.vmap(jax.jacfwd(sizes, has_aux=True))(designs)
    for i, x in enumerate(designs):
        assert status_name(jax.tree.map(lambda a, i=i: a[i], statuses)) == solve(x).status
        np.testing.assert_allclose(slopes[i], solve(x).slopes[:2], rtol=1e-8, atol=1e-14)


@pytest.mark.slow
def test_an_inertia_ratio_left_out_is_tied_to_the_slenderness():
    fixed = jax.jit(
        jax.value_and_grad(
            lambda nu, rho: (
                steady_state(
                    Parameters(
                        **dict(zip(("mu", "lam", "zeta", "k", "f", "xi"), X[1:], strict=True)), nu=nu, rho=rho
                    )
                ).amplitude
            ),
            argnums=(0, 1),
        )
    )
    nu = X[0]
    rho = 0.75 / (1 + nu**2)
    amplitude, (by_nu, by_rho) = fixed(nu, rho)
    tied = exact(X)
    assert amplitude == pytest.approx(tied.amplitude, rel=1e-12)
    assert by_nu != pytest.approx(tied.slopes[0, 0], rel=1e-3)
    assert by_nu + by_rho * (-1.5 * nu / (1 + nu**2) ** 2) == pytest.approx(tied.slopes[0, 0], rel=1e-10)


def test_whole_numbers_are_parameters_too():
    p = Parameters(nu=0.25, mu=0, lam=1, zeta=0, k=0, f=1, xi=3)
    assert all(isinstance(x, float) for x in jax.tree.leaves(p))
    state = simulate(p, np.array(REST), np.array([0, 1])).ys
    floats = Parameters(nu=0.25, mu=0.0, lam=1.0, zeta=0.0, k=0.0, f=1.0, xi=3.0)
    np.testing.assert_array_equal(state, simulate(floats, np.zeros(4), np.array([0.0, 1.0])).ys)


@pytest.mark.usefixtures("raises_within_programs")
def test_a_design_of_plain_numbers_settles_without_any_jax_in_sight():
    steady = steady_state(parameters(STILL.x), y0=np.array(REST), throw=True)
    assert status_name(steady.status) == "rest"
    assert steady.amplitude == 0.0
    assert steady.stroke == pytest.approx(exact(STILL.x).stroke, rel=1e-12)


@pytest.mark.usefixtures("raises_within_programs")
def test_throw_raises_what_the_status_says():
    assert status_name(steady_state(OVERTURNING).status) == "overturned"
    with pytest.raises(RuntimeError, match="the block overturns"):
        steady_state(OVERTURNING, throw=True)


@pytest.mark.parametrize(("model", "_"), MODELS)
def test_a_trajectory_has_one_state_a_time_and_begins_at_its_start(model, _):
    y0, times = np.array([0.05, -0.1, 0.02, 0.3]), np.array([0.3, 0.7])
    motion = simulate(parameters(X), y0, times, model=model)
    assert motion.ys.shape == (2, 4)
    np.testing.assert_array_equal(motion.ys[0], y0)
    np.testing.assert_array_equal(motion.times, times)
    assert motion.status == Status.rocking
    assert np.all(motion.ys[1] != y0)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0.0, 2.0, 1.0], "`times` must increase and be finite, but do not"),
        ([0.0, 1.0, 1.0], "`times` must increase and be finite, but do not"),
        ([0.0, np.nan], "`times` must be a vector of two or more increasing numbers, all finite, but is"),
        ([0.0, np.inf], "`times` must be a vector of two or more increasing numbers, all finite, but is"),
        ([0.0], r"`times` must be a vector of two or more, but has shape \(1,\)"),
        ([[0.0, 1.0]], "`times` must be a vector of two or more increasing numbers, all finite, but is"),
    ],
)
def test_times_that_make_no_sense_are_refused(times, message):
    with pytest.raises(ValueError, match=message):
        simulate(parameters(X), np.zeros(4), np.array(times))


@pytest.mark.parametrize("call", [steady_state, lambda p, y0: simulate(p, y0, np.array([0.0, 1.0]))])
def test_a_start_of_another_shape_is_refused(call):
    with pytest.raises(ValueError, match=r"`y0` must be \(phi, psi, phi', psi'\), all finite, but is \[0"):
        call(parameters(X), y0=np.zeros(2))


def test_32_bit_jax_is_refused():
    with jax.enable_x64(False):
        for call in (steady_state, lambda p: simulate(p, np.zeros(4), np.array([0.0, 1.0]))):
            with pytest.raises(RuntimeError, match="tpd needs 64-bit floats, but JAX is in 32-bit mode"):
                call(parameters(X))


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("nu", 0.0, "`nu` must be positive and finite, but is 0"),
        ("nu", 0.6, r"`nu` must be between 0 and 0\.5.*but is 0\.6"),
        ("mu", -0.1, r"`mu` must be zero or positive, and finite, but is -0\.1"),
        ("lam", 0.0, "`lam` must be positive and finite, but is 0"),
        ("zeta", -0.2, r"`zeta` must be zero or positive, and finite, but is -0\.2"),
        ("k", np.nan, "`k` must be zero or positive, and finite, but is nan"),
        ("f", np.inf, "`f` must be zero or positive, and finite, but is inf"),
        ("xi", -1, "`xi` must be positive and finite, but is -1"),
        ("rho", 1.5, r"`rho` must be between 1e-06 and 1, but is 1\.5"),
        ("e", 1.2, r"`e` must be between 0 and 1, but is 1\.2"),
        ("xi", np.array([1.0, -2.0]), r"`xi` must be positive and finite, but is \[ 1\. -2\.\]"),
        ("mu", True, "`mu` must be a number, but is True"),
    ],
)
def test_parameters_out_of_range_are_refused(name, value, message):
    good = {"nu": 0.25, "mu": 0.1, "lam": 0.5, "zeta": 0.1, "k": 0.05, "f": 0.3, "xi": 2.5}
    with pytest.raises(ValueError, match=message):
        Parameters(**{**good, name: value})


def test_every_status_has_a_name():
    for name in ("rocking", "rest", "overturned", "not_settled", "unstable", "event_bound", "failed"):
        assert status_name(getattr(Status, name)) == name


@pytest.mark.mends("a block at rest was said to rock, held for a part of every period")
@pytest.mark.parametrize("mu", [0.2, 0.197])
def test_a_block_that_stays_down_rests_however_slowly_the_bob_does(mu):
    p = parameters((0.25, mu, 1.2, 0.1, 0.05, 0.377, 2.67))
    assert float(uplift(p).margin) > 0.0
    settled = steady_state(p)
    assert status_name(settled.status) == "rest"
    assert settled.amplitude == 0.0
    assert settled.stroke == pytest.approx(0.0744690, rel=1e-6)


class Plain(Piecewise):
    """The exact motions by the rules that every model goes by, in place of their twins in compiled code."""


def test_compiled_rules_are_those_of_every_model():
    rng = np.random.default_rng(5)
    found = collections.Counter()
    for _ in range(40):
        nu, mu, lam, zeta, k, f, xi, rho, e = rng.uniform(
            [0.05, 0.0, 0.05, 0.0, 0.0, 0.02, 0.4, 0.5, 0.5], [0.4, 0.6, 1.5, 1.0, 0.3, 0.4, 3.0, 1.0, 1.0]
        )
        # Some conserve energy, some have a bob without mass, some a bob that swings for ever.
        kind = rng.integers(5)
        k, e = (0.0, 1.0) if kind < 2 else (k * rng.integers(2), e)
        mu, zeta = (0.0 if kind == 0 else mu), (0.0 if kind in (1, 2) else zeta)
        p = Parameters(nu=nu, mu=mu, lam=lam, zeta=zeta, k=k, f=f, xi=xi, rho=rho, e=e)
        y0 = rng.integers(2) * rng.normal(size=4) * [0.05, 0.1, 0.02, 0.1]

        def sizes(p: Parameters, model: Piecewise, y0: np.ndarray = y0) -> tuple:
            s = steady_state(p, model=model, y0=y0)
            numbers = jnp.stack([s.amplitude, s.stroke, s.multiplier, s.lyapunov])
            return jnp.concatenate([numbers, s.state]), s

        ours, theirs = (
            jax.jacfwd(partial(sizes, model=model), has_aux=True)(p) for model in (Piecewise(), Plain())
        )
        status = status_name(ours[1].status)
        found[status] += 1
        if status in ("aperiodic", "not_settled"):
            # Chaos is recognised in compiled code alone.
            assert status_name(theirs[1].status) == "not_settled"
            continue
        assert status == status_name(theirs[1].status)
        jax.tree.map(partial(np.testing.assert_allclose, rtol=1e-11, atol=1e-12), ours, theirs)
    assert set(found) == {"rocking", "sticking", "rest", "held", "overturned", "aperiodic"}


@pytest.mark.mends("derivatives in a start were always zero")
def test_numbers_of_any_type_and_starts_have_derivatives():
    def settled(mu, k=0.0, y0=(0.0, 0.0, 0.0, 0.0), zeta=0.1):
        p = Parameters(nu=0.25, mu=mu, lam=0.5, zeta=zeta, k=k, f=0.3, xi=2.5)
        return steady_state(p, y0=jnp.asarray(y0))

    slope = jax.grad(lambda mu: settled(mu).amplitude)
    assert slope(jnp.float32(0.2)) == pytest.approx(float(slope(0.2)), rel=1e-5)
    assert jax.jit(jax.grad(lambda mu, k: settled(mu, k).amplitude))(0.2, 0) == slope(0.2) != 0.0
    in_start = jax.grad(lambda y0, k, zeta: settled(0.2, k, y0, zeta).stroke)
    np.testing.assert_array_equal(in_start(jnp.zeros(4), 0.0, 0.1), 0.0)
    # Nothing damps the bob of a block at rest: its reach is that of the start.
    assert np.isnan(in_start(jnp.array([0.0, 0.05, 0.0, 0.0]), 1.0, 0.0)).all()


def test_a_batch_without_vmap_is_refused_in_a_sentence():
    p = Parameters(nu=0.25, mu=np.array([0.1, 0.2]), lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=2.5)
    for solve in (steady_state, symmetric_orbits):
        with pytest.raises(ValueError, match="`p` must be single numbers"):
            solve(p)
    with pytest.raises(ValueError, match=r"must have shape \(n,\), but the batch has shape \(\)"):
        all_symmetric_orbits(Parameters(nu=0.25, mu=0.1, lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=2.5))


# Motions at the limits: held leaning, neutral, resting, and without a finite number


UNDER_A_SWING = ((0.1, 0.2, 1.0, 0.3, 0.05, 0.01, 2.0), (0.08, 0.15, 0.0, 0.0))


@pytest.mark.parametrize(("x", "y0"), [LEANING, UNDER_A_SWING], ids=["bare", "hung"])
def test_a_block_that_friction_holds_leaning_is_held(x, y0):
    answer = exact(x, y0)
    assert answer.status == "held"
    times = np.linspace(60.0, 61.0, 101) * 2.0 * np.pi / x[6]
    ys = np.asarray(simulate(parameters(x), np.array(y0), np.array([0.0, *times])).ys)[1:]
    assert np.ptp(ys[:, 0]) == 0.0
    assert answer.amplitude == pytest.approx(abs(ys[0, 0]), rel=1e-12)
    assert answer.stroke == pytest.approx(np.abs(ys[:, 1]).max(), rel=1e-3)
    np.testing.assert_allclose(answer.steady.state, ys[0], rtol=0, atol=1e-8)
    assert np.all(np.isnan(answer.slopes))
    assert float(answer.steady.multiplier) == 1.0
    assert not bool(answer.steady.symmetric)


def test_a_held_block_that_never_moved_leans_as_it_started():
    assert exact(*LEANING).amplitude == LEANING[1][0]
    mirrored = exact(LEANING[0], tuple(-y for y in LEANING[1]))
    assert mirrored.status == "held"
    assert mirrored.amplitude == LEANING[1][0]


@pytest.mark.usefixtures("raises_within_programs")
def test_throw_says_what_to_do_about_a_held_block():
    with pytest.raises(RuntimeError, match=r"Friction holds the block leaning.*Start from another state"):
        steady_state(parameters(LEANING[0]), y0=np.array(LEANING[1]), throw=True)


@pytest.mark.parametrize("xi", [1.0, 2.0])
def test_a_block_that_shaking_may_still_move_is_not_held(xi):
    # The moment of the shaking at its largest exceeds what friction has left.
    x = (*LEANING[0][:5], 0.045, xi)
    assert exact(x, LEANING[1]).status != "held"


def conserving(n):
    rng = np.random.default_rng(2)
    x = np.array([0.05, 0.0, 0.1, 0.0, 0.0, 0.02, 1.0, 1.0]) + np.array(
        [0.25, 0.4, 1.5, 0.0, 0.0, 0.4, 4.0, 0.0]
    ) * rng.random((n, 8))
    x[::4, 1] = 0.0
    return np.concatenate([np.array(CONSERVING), x])


def test_symmetric_orbits_where_nothing_takes_energy_are_neutral_or_repel():
    orbits = orbits_of(parameters(list(conserving(200).T)))
    names, sizes = names_of(orbits.status), np.abs(np.asarray(orbits.multipliers)).max(axis=-1)
    assert not np.any(np.isin(names, ["rocking", "sticking"]))
    assert np.sum(names == "neutral") > 40
    assert np.all(sizes[names == "neutral"] < 1.0 + 3e-6)
    assert np.all(sizes[names == "unstable"] > 1.0 + 1e-6)


def test_a_motion_on_a_neutral_orbit_is_called_neutral_and_has_no_gradient():
    seen = 0
    for x in CONSERVING:
        orbits = orbits_of(parameters(x))
        for i, name in enumerate(names_of(orbits.status)):
            if name == "neutral":
                seen += 1
                answer = exact(x, np.asarray(orbits.state[i]))
                assert answer.status == "neutral"
                assert answer.amplitude == pytest.approx(float(orbits.amplitude[i]), rel=1e-9)
                assert np.all(np.isnan(answer.slopes))
                # To the last bit such a motion lands as its period ends, where derivatives are easily lost.
                assert float(answer.steady.multiplier) == pytest.approx(1.0, abs=1e-9)
    assert seen >= 3


def test_the_last_bit_of_a_state_does_not_decide_on_a_neutral_orbit():
    """It lands just before its period ends, as it ends, or just after."""
    draws = np.random.default_rng(1)
    for x in CONSERVING:
        orbits = orbits_of(parameters(x))
        for state in np.asarray(orbits.state)[names_of(orbits.status) == "neutral"]:
            for size in (1e-17, 1e-16, 1e-14, 1e-12, 1e-10):
                steady = exact(x, state + size * draws.standard_normal(4)).steady
                assert status_name(steady.status) == "neutral"
                assert float(steady.multiplier) == pytest.approx(1.0, abs=1e-9)


def test_following_that_breaks_off_leaves_finite_numbers():
    # Followed for its exponent the motion meets more events in a period than are allowed.
    x = (0.2, 0.1, 0.4, 0.0, 0.03, 0.25, 4.0)
    run = jax.jit(lambda n: steady_state(parameters(x), y0=np.array(REST), model=n), static_argnums=0)
    for events in (12, 18, 24, 32):
        steady = run(Piecewise(max_periods=2, max_events=events))
        name = status_name(steady.status)
        assert name in ("event_bound", "not_settled", "aperiodic")
        assert np.all(np.isfinite(steady.state)), (events, name)
        assert np.isfinite(steady.amplitude)


HOPS = [
    (
        (0.0766, 0.0, 1.85, 0.12, 0.104, 0.1507, 1.37, 0.324),
        (0.063, -0.19, -0.007, 0.0695),
    ),
    (
        (0.0659, 0.0, 1.66, 0.576, 0.1019, 0.1135, 2.4035, 0.551),
        (-0.0355, -0.1374, -0.008, 0.0636),
    ),
    (
        (0.1155766821662297, 0.0, 1.83, 0.145, 0.185211, 0.2287, 1.4639, 0.5914),
        (0.0883, -0.1868, 0.0496, 0.0862),
    ),
    # Called unstable once, with an amplitude that was not a number.
    (
        (
            0.15219996763318633,
            0.0,
            0.7402184631381078,
            0.02281021584818501,
            0.25502843829543936,
            0.22873452094277605,
            2.1349761701555288,
            0.8951161575180197,
        ),
        (-0.11670960670459414, -0.19958356260047305, 0.06985120107742994, 0.19583789944126045),
    ),
]


@pytest.mark.parametrize(("x", "y0"), HOPS)
def test_a_block_whose_hops_shrink_for_ever_is_at_rest(x, y0):
    answer = exact(x, y0)
    assert answer.status == "rest"
    assert answer.amplitude == 0.0
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    still = exact(x, (0.0, *y0[1:2], 0.0, 0.0))
    assert still.status == "rest"
    assert answer.stroke == pytest.approx(still.stroke, rel=1e-12)
    np.testing.assert_allclose(answer.slopes[1], still.slopes[1], rtol=1e-9, atol=1e-12)
