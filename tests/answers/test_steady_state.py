"""What `steady_state` and `simulate` promise, for both models: transformations, shapes, refusals."""

import collections
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import HUNG, REST, STILL, exact, parameters, smoothed
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
