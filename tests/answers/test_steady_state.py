"""What `steady_state` and `simulate` promise: transformations, shapes, verdicts, refusals."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import CONSERVING, LEANING, OVERTURNING, REST, STILL, WITH, exact, orbits_of, parameters
from tpd import Parameters, Status, simulate, status_name, steady_state, symmetric_orbits
from tpd.answers.steady_state import sampled
from tpd.answers.symmetric_orbits import all_symmetric_orbits
from tpd.scene.status import names_of
from tpd.theory import uplift

X = np.array(WITH[3].x)
NAMES = ("mu", "lam", "zeta", "k", "f", "xi")


def test_forward_mode_of_a_batch_equals_reverse_mode_of_single_rows():
    # `exact` takes its Jacobian in reverse mode.
    def sizes(x):
        steady = steady_state(parameters(x))
        return jnp.stack([steady.amplitude, steady.swing]), steady.status

    designs = np.array([X, STILL.x])
    slopes, statuses = jax.vmap(jax.jacfwd(sizes, has_aux=True))(designs)
    assert names_of(statuses).tolist() == [exact(x).status for x in designs]
    for found, x in zip(slopes, designs, strict=True):
        np.testing.assert_allclose(found, exact(x).slopes[:2], rtol=1e-8, atol=1e-14)


def test_the_default_inertia_ratio_follows_the_slenderness():
    def amplitude(nu, rho):
        return steady_state(Parameters(**dict(zip(NAMES, X[1:], strict=True)), nu=nu, rho=rho)).amplitude

    nu, tied = X[0], exact(X)
    found, (by_nu, by_rho) = jax.jit(jax.value_and_grad(amplitude, argnums=(0, 1)))(nu, 0.75 / (1 + nu**2))
    assert found == pytest.approx(tied.amplitude, rel=1e-12)
    assert by_nu != pytest.approx(tied.slopes[0, 0], rel=1e-3)
    assert by_nu + by_rho * (-1.5 * nu / (1 + nu**2) ** 2) == pytest.approx(tied.slopes[0, 0], rel=1e-10)


@pytest.mark.usefixtures("raises_within_programs")
def test_throw_raises_the_message_of_the_status():
    steady = steady_state(parameters(STILL.x), y0=np.array(REST), throw=True)
    assert (status_name(steady.status), float(steady.amplitude)) == ("rest", 0.0)
    assert status_name(steady_state(parameters(OVERTURNING)).status) == "overturned"
    with pytest.raises(RuntimeError, match="The block overturns"):
        steady_state(parameters(OVERTURNING), throw=True)
    with pytest.raises(
        RuntimeError, match=r"Friction holds the block at a constant tilt.*Start from another state"
    ):
        steady_state(parameters(LEANING[0]), y0=np.array(LEANING[1]), throw=True)


def test_a_trajectory_has_one_state_per_time_from_its_initial_state():
    y0, times = np.array([0.05, -0.1, 0.02, 0.3]), np.array([0.3, 0.7])
    motion = simulate(parameters(X), y0, times)
    assert motion.ys.shape == (2, 4)
    np.testing.assert_array_equal(motion.ys[0], y0)
    np.testing.assert_array_equal(motion.times, times)
    assert motion.status == Status.rocking
    assert np.all(motion.ys[1] != y0)


@pytest.mark.parametrize("times", [[0.0, 1.0, 1.0], [0.0, np.inf], [0.0], [[0.0, 1.0]]])
def test_invalid_times_and_states_are_rejected(times):
    with pytest.raises(ValueError, match="`times` must be a vector of 2 or more increasing numbers, "):
        simulate(parameters(X), np.zeros(4), np.array(times))
    with pytest.raises(ValueError, match=r"`y0` must be \(phi, psi, phi', psi'\), all finite, but is \[0"):
        simulate(parameters(X), np.zeros(2), np.array([0.0, 1.0]))


@pytest.mark.parametrize("mu", [0.2, 0.197])
def test_a_block_that_does_not_lift_is_at_rest_despite_a_slow_bob(mu):
    p = parameters((0.25, mu, 1.2, 0.1, 0.05, 0.377, 2.67))
    assert float(uplift(p).margin) > 0.0
    settled = steady_state(p)
    assert (status_name(settled.status), float(settled.amplitude)) == ("rest", 0.0)
    assert settled.swing == pytest.approx(0.0744690, rel=1e-6)


def test_parameters_and_initial_states_of_any_type_have_derivatives():
    def settled(mu, k=0.0, y0=(0.0, 0.0, 0.0, 0.0), zeta=0.1):
        p = Parameters(nu=0.25, mu=mu, lam=0.5, zeta=zeta, k=k, f=0.3, xi=2.5)
        return steady_state(p, y0=jnp.asarray(y0))

    slope = jax.grad(lambda mu: settled(mu).amplitude)
    assert slope(jnp.float32(0.2)) == pytest.approx(float(slope(0.2)), rel=1e-5)
    assert jax.jit(jax.grad(lambda mu, k: settled(mu, k).amplitude))(0.2, 0) == slope(0.2) != 0.0
    in_start = jax.grad(lambda y0, k, zeta: settled(0.2, k, y0, zeta).swing)
    np.testing.assert_array_equal(in_start(jnp.zeros(4), 0.0, 0.1), 0.0)
    # Nothing damps the bob of a block at rest: its reach is that of the start.
    assert np.isnan(in_start(jnp.array([0.0, 0.05, 0.0, 0.0]), 1.0, 0.0)).all()


def test_a_batch_without_vmap_is_rejected_in_one_sentence():
    p = Parameters(nu=0.25, mu=np.array([0.1, 0.2]), lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=2.5)
    for solve in (steady_state, symmetric_orbits):
        with pytest.raises(ValueError, match="`p` must be single numbers"):
            solve(p)
    with pytest.raises(ValueError, match=r"must have shape \(n,\), but the batch has shape \(\)"):
        all_symmetric_orbits(Parameters(nu=0.25, mu=0.1, lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=2.5))


IN_32_BITS = r'''
import numpy as np, tpd
from tpd.answers.bifurcations import bifurcations
from tpd.answers.ensemble import outcomes
from tpd.theory import *
scene, pendulum = tpd.paper_scene(), tpd.Pendulum(mass=1.6, length=0.12, damping_ratio=0.1)
p, values = scene.parameters(pendulum), np.linspace(0.3, 0.4, 9)
band, y0, few = np.array([2.0, 3.5]), np.zeros(4), tpd.Ensemble(seed=0)
calls = """
    tpd.steady_state(p); tpd.steady_state(p, model=tpd.Auto()); tpd.simulate(p, y0, np.array([0.0, 1.0]))
    tpd.symmetric_orbits(p); tpd.periodic_orbit(p, y0)
    bifurcations(p, "f", 0.3, 0.4); tpd.fold_curve(p, "mu", "f"); tpd.branches(p, "f", 0.3, 0.4)
    tpd.check(scene, pendulum, swing_limit=0.5)
    tpd.design_map(p, ("mu", values), ("lam", values)); tpd.settled_response(scene, "frequency", band)
    tpd.attractors(p, starts=tpd.Starts(size=4, seed=0)); tpd.optimise(scene, tpd.DesignSpace())
    tpd.optimise(scene, conditions=tpd.Conditions.band(scene, 2.0, 3.5))
    tpd.paired_runs(scene, pendulum, ensemble=few); outcomes(scene, pendulum, ensemble=few)
    uplift(p); one_harmonic(p); one_harmonic_branches(p); neglected_harmonics(p); parametric_branches(p)
    fold(p); lightest_pendulum(p, 0.3); free_motion(p); equivalent_friction(p, 0.05)
""".replace(";", "\n").split("\n")
calls = [call.strip() for call in calls if call.strip()]
for call in calls:
    try:
        eval(call)
    except RuntimeError as error:
        assert str(error).startswith("tpd needs 64-bit floats, but JAX is in 32-bit mode"), (call, error)
    else:
        raise AssertionError(call + " answers in 32 bits")
print("refused", len(calls))
'''


def test_every_call_in_32_bits_is_rejected_by_name():
    done = subprocess.run([sys.executable, "-c", IN_32_BITS], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.startswith("refused 25")


UNDER_A_SWING = ((0.1, 0.2, 1.0, 0.3, 0.05, 0.01, 2.0), (0.08, 0.15, 0.0, 0.0))


@pytest.mark.parametrize(("x", "y0"), [LEANING, UNDER_A_SWING], ids=["bare", "hung"])
def test_a_tilted_block_that_friction_holds_has_the_status_held(x, y0):
    answer = exact(x, y0)
    assert answer.status == "held"
    times = np.linspace(60.0, 61.0, 101) * 2.0 * np.pi / x[6]
    ys = np.asarray(simulate(parameters(x), np.array(y0), np.array([0.0, *times])).ys)[1:]
    assert np.ptp(ys[:, 0]) == 0.0
    assert answer.amplitude == pytest.approx(abs(ys[0, 0]), rel=1e-12)
    assert answer.swing == pytest.approx(np.abs(ys[:, 1]).max(), rel=1e-3)
    np.testing.assert_allclose(answer.steady.state, ys[0], rtol=0, atol=1e-8)
    assert np.all(np.isnan(answer.slopes))
    assert float(answer.steady.multiplier) == 1.0
    assert not bool(answer.steady.symmetric)
    if x[1] == 0.0:
        # The block never moved.
        mirrored = exact(x, tuple(-y for y in y0))
        assert mirrored.status == "held"
        assert answer.amplitude == mirrored.amplitude == y0[0]


@pytest.mark.parametrize("xi", [1.0, 2.0])
def test_a_block_that_the_excitation_can_still_move_is_not_held(xi):
    # The moment of the shaking at its largest exceeds what friction has left.
    x = (*LEANING[0][:5], 0.045, xi)
    assert exact(x, LEANING[1]).status != "held"


def test_a_motion_on_a_neutral_orbit_is_called_neutral_and_has_no_gradient():
    # It lands just before its period ends, as it ends, or just after, where derivatives are easily lost.
    seen, draws = 0, np.random.default_rng(1)
    for x in CONSERVING:
        orbits = orbits_of(parameters(x))
        for i in np.flatnonzero(names_of(orbits.status) == "neutral"):
            seen += 1
            for size in (0.0, 1e-17, 1e-16, 1e-14, 1e-12, 1e-10):
                answer = exact(x, np.asarray(orbits.state[i]) + size * draws.standard_normal(4))
                assert answer.status == "neutral"
                near = 1e-9 if size < 1e-11 else 1e-8
                assert answer.amplitude == pytest.approx(float(orbits.amplitude[i]), rel=near)
                assert np.all(np.isnan(answer.slopes))
                assert float(answer.steady.multiplier) == pytest.approx(1.0, abs=1e-9)
    assert seen >= 3


def test_a_block_with_ever_smaller_impacts_is_at_rest():
    # Called unstable once, with an amplitude that was not a number.
    x = (0.15219996763318633, 0.0, 0.7402184631381078, 0.02281021584818501)
    x += (0.25502843829543936, 0.22873452094277605, 2.1349761701555288, 0.8951161575180197)
    y0 = (-0.11670960670459414, -0.19958356260047305, 0.06985120107742994, 0.19583789944126045)
    answer, still = exact(x, y0), exact(x, (0.0, y0[1], 0.0, 0.0))
    assert answer.status == still.status == "rest"
    assert answer.amplitude == 0.0
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    assert answer.swing == pytest.approx(still.swing, rel=1e-12)
    np.testing.assert_allclose(answer.slopes[1], still.slopes[1], rtol=1e-9, atol=1e-12)


# Calls with plain numbers, which reach the engine without JAX: the answers of traced calls, bit for bit.


FIELDS = "nu", "mu", "lam", "zeta", "k", "f", "xi", "rho", "e"
SCENES = {
    "rocking": ((0.21, 0.2, 0.35, 0.0, 0.3, 0.57, 4.0, 0.7, 0.9), REST),
    "sticking": ((0.39, 0.2, 0.63, 0.1, 0.0, 0.2, 1.5, 0.7, 0.9), REST),
    "rest": ((0.31, 0.2, 0.33, 0.1, 0.02, 0.12, 3.0, 0.7, 1.0), REST),
    "held": ((0.19, 0.1, 0.41, 0.1, 0.3, 0.06, 0.5, 0.7, 1.0), (0.17, -0.2, -0.18, 0.18)),
    "overturned": ((0.31, 0.0, 0.83, 0.1, 0.0, 0.13, 2.1, 0.7, 1.0), (0.13, 0.2, -0.27, -0.38)),
    "aperiodic": ((0.15, 0.2, 0.8, 0.0, 0.3, 0.62, 2.0, 0.7, 1.0), REST),
    "not_settled": ((0.41, 0.2, 0.75, 0.0, 0.02, 0.47, 1.7, 0.7, 0.9), REST),
    "unstable": (
        (0.3, 0.1, 0.32, 0.0, 0.0, 0.35, 3.2, 0.7, 0.9),
        (0.0015017397909662389, 0.01538784493228143, -0.07054417264844041, -1.5191477938172269),
    ),
    "neutral": (
        (0.18, 0.1, 0.41, 0.0, 0.0, 0.16, 2.9, 0.7, 1.0),
        (-2.9868034318797804e-17, 2.4022214941105952e-17, 0.16207357974827397, 0.954462887283928),
    ),
    "near_fold": (
        (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 1.04425729, 0.75 / 1.04, 1.0),
        (0.10236451617297906, -0.0596523112526393, 0.11845127648192642, -0.33857124430039154),
    ),
    "event_bound": ((0.3, 0.2, 0.99, 0.1, 0.0, 0.09, 2.6, 0.7, 1.0), (0.0, 0.01, -0.03, -0.01)),
    "failed": ((0.25, 0.0, 0.5, 0.0, 0.05, 0.3, 2.0, 0.5, 0.9), REST),
}
"""Parameters and start by the status of the motion."""


def settled(x, y0):
    p = Parameters(**dict(zip(FIELDS, x, strict=True)))
    return steady_state(p, y0=y0 if isinstance(y0, jax.Array) else np.asarray(y0))


traced = jax.jit(settled)


@pytest.mark.parametrize("status", SCENES)
def test_plain_and_traced_parameters_give_equal_steady_states(status):
    x, y0 = SCENES[status]
    found, expected = settled(x, y0), traced(np.array(x), np.array(y0))
    assert status_name(found.status) == status
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for ours, theirs in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        assert isinstance(ours, (int, float, np.generic, np.ndarray))
        assert np.asarray(ours).tobytes() == np.asarray(theirs, dtype=np.asarray(ours).dtype).tobytes()


def test_plain_and_traced_parameters_give_equal_orbits():
    p = Parameters(**dict(zip(FIELDS, SCENES["unstable"][0], strict=True)))
    found, expected = (jax.tree.leaves(solve(p)) for solve in (symmetric_orbits, jax.jit(symmetric_orbits)))
    for ours, theirs in zip(found, expected, strict=True):
        assert isinstance(ours, (np.generic, np.ndarray))
        np.testing.assert_array_equal(ours, theirs, strict=True)


def test_scalars_arrays_and_integers_give_the_result_of_floats():
    x, y0 = SCENES["rocking"]
    found = [settled(given, y0) for given in (x, map(np.asarray, x), jnp.asarray(x), np.array(x))]
    whole = [settled((*x[:6], xi, *x[7:]), np.zeros(4, int)) for xi in (4, 4.0, np.float64(4.0))]
    assert len({(float(s.amplitude), float(s.swing), *map(float, s.state)) for s in [*found, *whole]}) == 1


def test_sampled_times_divide_the_first_periods():
    p = Parameters(nu=0.2, mu=0.1, lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=3.0)
    np.testing.assert_allclose(sampled(p, 2, 4), np.linspace(0.0, 2.0, 9) * p.period, rtol=1e-15)


def test_a_derivative_in_one_parameter_equals_its_difference_quotient():
    x, y0 = SCENES["rocking"]

    def amplitude(f):
        return settled((*x[:5], f, *x[6:]), y0).amplitude

    step = 1e-6 * x[5]
    quotient = (amplitude(x[5] + step) - amplitude(x[5] - step)) / (2.0 * step)
    assert jax.grad(amplitude)(x[5]) == pytest.approx(quotient, rel=1e-6)
    # What is known goes into further computations, and is a leaf of a pytree.
    doubled = jax.tree.map(lambda leaf: 2 * jnp.asarray(leaf), settled(x, y0))
    assert doubled.amplitude == 2.0 * amplitude(x[5])
