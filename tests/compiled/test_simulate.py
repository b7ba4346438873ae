"""Runs of both equations by one door: under JAX, in batches, with their statuses and limits."""

import dataclasses
import functools
import math
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests.compiled.shaken import Case, operands
from tests.reference import box, parameters, settled
from tpd import Piecewise
from tpd.compiled.rows import ground_row_of
from tpd.compiled.simulate import GroundForcing, follow
from tpd.scene.status import code_of, names_of

BLOCK = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9)
PENDULUM = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
SCENE = tpd.Scene(BLOCK, tpd.Pulse.one_sine(acceleration=3.0, frequency=1.2))
NAMES = ("tilt", "swing", "rod_angle", "times", "state", "status", "impacts", "uplift_time")


def test_a_single_motion_equals_its_row_of_a_batch():
    p, pieces = SCENE.ground_parameters(PENDULUM), jnp.asarray(SCENE.excitation.pieces())
    row, forcing = ground_row_of(p), GroundForcing([pieces], 3.0)
    alone = jax.jit(lambda y0: follow(tpd.Terms.linear, row, forcing, y0=y0, events=1000))(jnp.zeros(4))
    rows, each, _ = operands([Case(BLOCK, PENDULUM, SCENE.excitation)])
    np.testing.assert_allclose(ground_row_of(p), rows[0], rtol=1e-14)
    some = [np.zeros((2, 4)), each[0], each[0][:5]]
    three = GroundForcing(some, np.full(3, 3.0), np.array([1, 2, 1]))
    batch = follow(tpd.Terms.linear, np.repeat(rows, 3, axis=0), three)
    for name in NAMES:
        found = np.asarray(code_of(getattr(batch, name)))
        np.testing.assert_array_equal(found[0], found[2])
        np.testing.assert_allclose(found[0], code_of(getattr(alone, name)), rtol=1e-12, atol=1e-14)
    assert batch.tilt[1] != batch.tilt[0]


def test_linear_results_do_not_depend_on_threads_or_batch():
    x, y = box(40, seed=11)
    calls, model = [], Piecewise(max_periods=60)
    alone = settled(
        tpd.Terms.linear, parameters(x.T), y, periods=60, workers=1, progress=lambda *done: calls.append(done)
    )
    assert calls[-1] == (40, 40)
    other = settled(tpd.Terms.linear, parameters(x.T), y, periods=60, workers=2)
    for one, two in zip(jax.tree.leaves(alone), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(one, two)
    many = jax.jit(jax.vmap(lambda x, y: model.settle(parameters(x), y).state))(x, y)
    np.testing.assert_array_equal(many, alone.state)
    for i in (0, 7):
        each = model.settle(parameters(x[i]), jnp.asarray(y[i]))
        np.testing.assert_array_equal(each.state, alone.state[i])


TALL = tpd.Parameters(nu=0.25, mu=0.2, lam=0.8, zeta=0.1, k=0.05, f=0.5, xi=3.5)
SIZES = ("settled_tilt", "settled_swing", "tilt", "swing")


nonlinear = functools.partial(settled, tpd.Terms.nonlinear)


def status(*args, **options):
    return names_of(nonlinear(*args, **options).status)[0]


def test_no_motion_is_called_rest_while_the_excitation_grows():
    p = dataclasses.replace(TALL, mu=0.0, f=0.2)
    at_once, slow = nonlinear(p, np.zeros((1, 4))), nonlinear(p, np.zeros((1, 4)), ramp=10.0)
    assert names_of(at_once.status)[0] == names_of(slow.status)[0] == "rest"
    assert (int(at_once.elapsed[0]), slow.elapsed[0] > 10) == (1, True)
    # From this phase on the shaking lifts the block in the next period only.
    p = dataclasses.replace(TALL, mu=0.0, f=0.6)
    assert status(p, np.zeros((1, 4)), begin=0.8 * 2.0 * np.pi / 3.5) == "rocking"


@pytest.mark.parametrize(
    ("changes", "y0", "name"),
    [
        ({}, [0.0, 0.0, 0.0, 0.0], "rocking"),
        ({"f": 0.1}, [0.0, 0.0, 0.0, 0.0], "rest"),
        ({"f": 0.02, "k": 0.3, "mu": 0.0}, [0.1, 0.0, 0.0, 0.0], "held"),
        ({"f": 1.5}, [0.2, 0.0, 1.0, 0.0], "overturned"),
        ({}, [1.6, 0.0, 0.0, 0.0], "overturned"),
        ({}, [math.nan, 0.0, 0.0, 0.0], "failed"),
        ({}, [0.0, 0.0, 0.0, math.inf], "failed"),
    ],
)
def test_each_outcome_of_a_motion_has_its_status(changes, y0, name):
    found = nonlinear(dataclasses.replace(TALL, **changes), [y0], periods=200)
    assert names_of(found.status)[0] == name
    if name == "overturned":
        assert np.isinf(found.tilt[0])
    elif name != "failed":
        assert all(np.isfinite(getattr(found, size)[0]) for size in SIZES)


def test_a_motion_with_too_many_events_has_the_status_event_bound():
    assert status(TALL, np.zeros((1, 4)), periods=3) == "not_settled"
    assert status(TALL, np.zeros((1, 4)), events=1) == "event_bound"


def test_nonlinear_results_do_not_depend_on_threads_or_batch():
    y0, calls = np.random.default_rng(4).normal(size=(40, 4)) * [0.1, 0.2, 0.1, 0.2], []
    alone = nonlinear(TALL, y0, periods=20, workers=1, progress=lambda *done: calls.append(done))
    assert calls[-1] == (40, 40)
    jax.tree.map(np.testing.assert_array_equal, alone, nonlinear(TALL, y0, periods=20, workers=2))
    row = nonlinear(TALL, y0[7:8], periods=20)
    np.testing.assert_array_equal(row.state[0], alone.state[7])
    one = nonlinear(TALL)
    np.testing.assert_array_equal(one.state, nonlinear(TALL, np.zeros((1, 4))).state[0])
    assert tpd.status_name(nonlinear(TALL, [math.nan, 0.0, 0.0, 0.0]).status) == "failed"


def test_a_nonlinear_ground_motion_under_jit_equals_the_batch():
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
    scene = tpd.Scene(block, tpd.Pulse.one_sine(acceleration=3.27, frequency=1.2375))
    p = scene.ground_parameters(tpd.Pendulum(mass=783.0, length=2.042, damping_ratio=0.129))
    pieces, y0 = np.asarray(scene.excitation.pieces()), jnp.zeros(4)

    def tilt(free):
        return follow(tpd.Terms.nonlinear, ground_row_of(p), GroundForcing([pieces], free), y0=y0).tilt

    batch = follow(tpd.Terms.nonlinear, ground_row_of(p)[None], GroundForcing([pieces], 3.0))
    assert float(tilt(3.0)) == batch.tilt[0] > 0.01
    # The largest tilt occurs during the pulse.
    assert jax.grad(tilt)(3.0) == 0.0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"y0": np.zeros((0, 4))}, "`y0` \\(n, 4\\)"),
        ({"ramp": np.zeros(3)}, r"`begin` and `ramp` must have shape \(2,\)"),
        ({"ramp": -1.0}, "`ramp` must be zero or positive, and finite"),
        ({"begin": 20.0}, "`begin` must lie within the first forcing period, but is"),
        ({"workers": 0}, "`workers` must be a whole number, 1 or more, but is 0"),
        ({"rtol": 0.0}, "`rtol` must be positive and finite, but is 0"),
    ],
)
def test_arguments_of_wrong_shape_or_range_are_rejected(wrong, message):
    with pytest.raises(ValueError, match=message):
        nonlinear(TALL, **({"y0": np.zeros((2, 4))} | wrong))


def test_importing_tpd_does_not_import_numba():
    code = "import sys, tpd, tpd.answers.ensemble; assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_resting_block_with_a_bob_of_period_two_has_the_status_rest():
    # Nothing damps the bob; so small a swing has twice the period of the forcing to 1e-7.
    nu, lam = 0.2, 0.4
    xi = 2.0 / math.sqrt(lam * 0.75 / (1.0 + nu**2))
    p = tpd.Parameters(nu=nu, mu=0.1, lam=lam, zeta=0.0, k=0.03, f=1e-9, xi=xi)
    found = nonlinear(p, (0.0, 1e-3, 0.0, 0.0))
    assert names_of(found.status) == "rest"
    assert found.settled_tilt == 0.0
    assert float(found.settled_swing) == pytest.approx(1e-3, rel=1e-6)
