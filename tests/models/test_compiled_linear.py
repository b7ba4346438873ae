"""The compiled code of the linear equations against the programs of JAX, the slow and obvious form."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import HUNG, SLOW, parameters
from tpd import Parameters, Piecewise, simulate, steady_state
from tpd.core.parameters import as_arrays
from tpd.core.status import names_of
from tpd.models import compiled_linear
from tpd.models.batches import settle_all

KERNEL, PROGRAM = Piecewise(), Piecewise(kernel=False)
OTHER = SimpleNamespace(platform="cuda")
MOVED = ("rocking", "sticking")
FIELDS = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "rho", "e")


def box(count, seed):
    """Random parameters, corners of their ranges among them, and starts."""
    rng = np.random.default_rng(seed)
    u, corner = rng.random((count, 9)), rng.random((count, 9)) < 0.25
    x = np.array([0.05, 0.0, 0.05, 0.0, 0.0, 0.0, 0.3, 0.4, 0.3])
    reach = np.array([0.45, 0.5, 2.0, 1.0, 0.3, 0.8, 5.7, 0.55, 0.7])
    values = x + reach * u
    # No bob, no damping, no friction and no impact loss are cases of their own.
    for column, edge in ((1, 0.0), (3, 0.0), (4, 0.0), (8, 1.0)):
        values[corner[:, column], column] = edge
    starts = rng.normal(size=(count, 4)) * np.stack([0.3 * values[:, 0], 0.2 + 0 * u[:, 0]] * 2, axis=1)
    starts[::2] = 0.0
    return values, starts


def of(x):
    return Parameters(**dict(zip(FIELDS, jnp.asarray(x), strict=True)))


SHORT = Piecewise(max_periods=2)
"""Of all that is followed by programs here, so that one is compiled."""


def by_code(*args, **times):
    """`settle_all` of SHORT."""
    return settle_all(*args, model=SHORT, **times)


def by_programs(*args, **times):
    """`settle_all` of SHORT without the custom call."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled_linear, "usable", lambda: False)
        return by_code(*args, **times)


def test_two_periods_are_those_of_the_program_over_the_whole_box():
    x, y = box(400, seed=5)
    ours, theirs = by_code(of(x.T), y), by_programs(of(x.T), y)
    # Each of many impacts passes rounding on, larger by what the motion amplifies.
    near = by_programs(of(x.T), y + 1e-13 * (np.abs(y) > 0))
    np.testing.assert_array_equal(names_of(ours.status), names_of(theirs.status))
    here = ~np.isin(names_of(ours.status), ("overturned", "event_bound"))
    assert np.sum(here) > 250
    np.testing.assert_array_equal(ours.memory.kind[here], theirs.memory.kind[here])
    error = np.full(len(x), 1e-12)
    error[here] += 100.0 * np.max(np.abs(near.y - theirs.y)[here], axis=1)
    for name, more in (("y", 0.0), ("peak", 0.0), ("peak_stroke", 1e-7)):
        # The bob's angle at the last of the hops that end in rest depends on their number.
        apart = np.abs(getattr(ours, name)[here] - getattr(theirs, name)[here]).reshape(sum(here), -1)
        assert np.all(apart.max(axis=1) <= error[here] + more), name


@jax.jit
def settled(x, y):
    """Amplitude, gradient in all parameters, status, multiplier and exponent, by either."""

    def size(x, model):
        s = steady_state(of(x), model=model, y0=y)
        return s.amplitude, (s.status, s.multiplier, s.lyapunov)

    return [jax.value_and_grad(lambda z, m=m: size(z, m), has_aux=True)(x) for m in (KERNEL, PROGRAM)]


def test_settled_motions_and_their_gradients_are_those_of_the_program():
    compared = 0
    for x, y in zip(*box(160, seed=6), strict=True):
        ((ours, (status, multiplier, _)), slopes), ((theirs, (name, other, _)), known) = settled(x, y)
        # Other names differ where one has followed a slow or a chaotic motion longer.
        if not (str(names_of(status)) == str(names_of(name)) in MOVED) or other > 0.999:
            continue
        np.testing.assert_allclose(ours, theirs, rtol=1e-11, atol=1e-14)
        np.testing.assert_allclose(multiplier, other, rtol=1e-7, atol=1e-9)
        if x[3] > 0.0:
            np.testing.assert_allclose(slopes, known, rtol=0, atol=1e-9 * (1.0 + np.abs(known).max()))
        compared += 1
    assert compared > 40


def test_a_slow_decay_is_not_settled_by_the_program_rather_than_aperiodic():
    # The compiled code takes it to its orbit.
    slow, rest = np.array([*SLOW, 0.75 / (1.0 + SLOW[0] ** 2), 1.0]), np.zeros(4)
    ((_, (status, multiplier, _)), _), ((_, (name, _, exponent)), slopes) = settled(slow, rest)
    assert names_of(status) == "rocking"
    assert 0.98 < multiplier < 1.0
    assert names_of(name) == "not_settled"
    assert -0.05 < exponent < 0.0
    assert np.all(np.isnan(slopes))


def test_no_settled_motion_loses_its_status_to_the_short_way():
    """A motion that is taken to its orbit early ends where one that is followed to the end does."""
    x, y = box(600, seed=7)
    p = of(x.T)
    short = settle_all(p, y, model=Piecewise(max_periods=400))
    long = settle_all(p, y, model=Piecewise(max_periods=1500, tolerance=1e-11))
    names, others = names_of(short.status), names_of(long.status)
    both = np.isin(names, MOVED) & np.isin(others, MOVED) & (x[:, 1] > 0.0)
    assert np.sum(both) > 60
    np.testing.assert_array_equal(short.periods[both], long.periods[both])
    for size in ("amplitude", "stroke", "peak", "peak_stroke"):
        ours, theirs = (np.asarray(getattr(s, size))[both] for s in (short, long))
        np.testing.assert_allclose(ours, theirs, rtol=5e-4, atol=1e-6)
    gone = np.isin(others, MOVED) & np.isin(names, ("rest", "overturned"))
    assert not np.any(gone)


def test_a_trajectory_and_all_its_derivatives_are_those_of_the_program():
    p, y0 = as_arrays(parameters(HUNG[0].x)), np.array([0.02, 0.01, 0.0, -0.03])
    times = 0.3 + np.linspace(0.0, 3.3, 12) * float(p.period)

    def states(p, y0, times, model):
        return simulate(p, y0, times, model=model).ys

    def all_of(model):
        # One program: step by step each step would be one.
        return jax.jit(jax.jacfwd(lambda *a: states(*a, model), argnums=(0, 1, 2)))(p, y0, times)

    ours, theirs = (jax.tree.leaves(all_of(m)) for m in (KERNEL, PROGRAM))
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * (1.0 + np.abs(b).max()))


def test_a_batch_under_vmap_is_one_call_and_gives_the_same():
    x, y = box(16, seed=8)
    many = jax.jit(jax.vmap(lambda x, y: KERNEL.settle(of(x), y).y))(x, y)
    each = [KERNEL.settle(of(a), jnp.asarray(b)).y for a, b in zip(x, y, strict=True)]
    np.testing.assert_array_equal(many, each)


def test_reverse_and_forward_mode_agree():
    p = as_arrays(parameters(HUNG[1].x))
    forward, backward = (
        d(lambda p: steady_state(p, model=KERNEL).amplitude)(p) for d in (jax.jacfwd, jax.jacrev)
    )
    for a, b in zip(jax.tree.leaves(forward), jax.tree.leaves(backward), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-13)


def test_with_another_device_about_the_processor_still_runs_the_compiled_code(monkeypatch):
    x, y = box(1, seed=9)
    model = Piecewise(max_periods=3)
    ours = jax.jit(lambda x, y: model.settle(of(x), y).y)(x[0], y[0])
    monkeypatch.setattr(compiled_linear.jax, "devices", lambda: [SimpleNamespace(platform="cpu"), OTHER])
    theirs = jax.jit(lambda x, y: model.settle(of(x), y).y)(x[0], y[0])
    np.testing.assert_array_equal(ours, theirs)


def test_without_the_custom_call_programs_of_jax_follow_a_growing_shaking_and_a_late_start():
    x, y = box(24, seed=10)
    # Some grow for longer than they are followed.
    begin, ramp = 0.4 * 2.0 * np.pi / x[:, 6], np.linspace(0.0, 2.7, len(x))
    # At once and at full strength in every other motion.
    begin[::2] = ramp[::2] = 0.0
    ours, theirs = (f(of(x.T), y, begin=begin, ramp=ramp) for f in (by_code, by_programs))
    np.testing.assert_array_equal(names_of(ours.status), names_of(theirs.status))
    here = ~np.isin(names_of(ours.status), ("overturned", "event_bound"))
    np.testing.assert_allclose(np.asarray(ours.y)[here], np.asarray(theirs.y)[here], rtol=0, atol=1e-9)
    np.testing.assert_allclose(ours.peak[here], theirs.peak[here], rtol=0, atol=1e-9)


@pytest.mark.parametrize("workers", [1, 2])
def test_results_do_not_depend_on_the_threads(workers):
    x, y = box(64, seed=11)
    ours = settle_all(of(x.T), y, workers=workers)
    assert np.array_equal(ours.y, settle_all(of(x.T), y).y, equal_nan=True)
