"""The compiled code of the linear equations, against integration and differences, and how it is called."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import HUNG, SLOW, EventDriven, parameters
from tpd import Parameters, Piecewise, simulate, steady_state
from tpd.models import compiled_linear
from tpd.models.rows import settle_all
from tpd.scene.parameters import as_arrays
from tpd.scene.status import names_of

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


def test_two_periods_are_those_of_adaptive_integration_over_the_whole_box():
    x, y = box(40, seed=5)
    compared = 0
    for row, y0 in zip(x, y, strict=True):
        row[7] = 0.75 / (1.0 + row[0] ** 2)
        times = np.linspace(0.0, 2.0, 9) * 2.0 * np.pi / row[6]
        ours = simulate(of(row), y0, times)
        expected = EventDriven([*row[:7], row[8]]).run(y0, times)
        if names_of(ours.status) == "overturned" or len(expected) < len(times):
            continue
        # Each of many impacts passes rounding on, larger by what the motion amplifies.
        near = np.asarray(simulate(of(row), y0 + 1e-11 * (y0 != 0.0), times).ys)
        error = 1e-8 + 100.0 * np.abs(near - ours.ys).max()
        np.testing.assert_allclose(ours.ys, expected, rtol=0, atol=error)
        compared += error < 1e-6
    assert compared > 20


def test_a_motion_too_slow_to_repeat_is_not_settled_rather_than_aperiodic():
    # So tight a tolerance leaves the short way to the orbit out.
    model = Piecewise(tolerance=1e-11, max_periods=200)

    @jax.jit
    def sizes(x):
        s = steady_state(of(x), model=model)
        return s.amplitude, s

    slow = np.array([*SLOW, 0.75 / (1.0 + SLOW[0] ** 2), 1.0])
    slopes, s = jax.jacrev(sizes, has_aux=True)(slow)
    assert names_of(s.status) == "not_settled"
    assert -0.05 < s.lyapunov < 0.0
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


def test_a_trajectory_has_the_derivatives_of_differences():
    p, y0 = parameters(HUNG[0].x), np.array([0.02, 0.01, 0.01, -0.03])
    times = 0.3 + np.linspace(0.0, 3.3, 12) * p.period
    point = np.array([*HUNG[0].x, p.inertia_ratio, 1.0 - 1e-3, *y0, times[0], times[-1]])

    @jax.jit
    def states(z):
        clock = jnp.asarray(times).at[0].set(z[13]).at[-1].set(z[14])
        return simulate(of(z[:9]), z[9:13], clock).ys[1:]

    slopes = jax.jacfwd(states)(point)
    for i, step in enumerate(1e-5 * np.maximum(np.abs(point), 0.1)):
        at = [states(point + n * step * (np.arange(15) == i)) for n in (-2, -1, 1, 2)]
        expected = (8.0 * (at[2] - at[1]) - (at[3] - at[0])) / (12.0 * step)
        np.testing.assert_allclose(
            slopes[..., i], expected, rtol=0, atol=1e-7 * (1.0 + np.abs(expected).max())
        )


def test_a_batch_under_vmap_is_one_call_and_gives_the_same():
    x, y = box(16, seed=8)
    many = jax.jit(jax.vmap(lambda x, y: Piecewise().settle(of(x), y).y))(x, y)
    each = [Piecewise().settle(of(a), jnp.asarray(b)).y for a, b in zip(x, y, strict=True)]
    np.testing.assert_array_equal(many, each)


def test_reverse_and_forward_mode_agree():
    p = as_arrays(parameters(HUNG[1].x))
    forward, backward = (
        d(lambda p: steady_state(p, model=Piecewise()).amplitude)(p) for d in (jax.jacfwd, jax.jacrev)
    )
    for a, b in zip(jax.tree.leaves(forward), jax.tree.leaves(backward), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-13)


def test_with_another_device_about_the_processor_still_runs_the_compiled_code(monkeypatch):
    x, y = box(1, seed=9)
    model = Piecewise(max_periods=3)
    ours = jax.jit(lambda x, y: model.settle(of(x), y).y)(x[0], y[0])
    monkeypatch.setattr(jax, "devices", lambda: [SimpleNamespace(platform="cpu"), OTHER])
    theirs = jax.jit(lambda x, y: model.settle(of(x), y).y)(x[0], y[0])
    np.testing.assert_array_equal(ours, theirs)


def test_a_batch_of_thousands_is_one_call():
    # Not marked as a mended fault: the code before waited for ever.
    def amplitude(f):
        return steady_state(Parameters(nu=0.25, mu=0.1, lam=0.5, zeta=0.1, k=0.05, f=f, xi=2.5)).amplitude

    forcing = jnp.linspace(0.2, 0.3, 4096)
    values, slopes = jax.jit(jax.vmap(jax.value_and_grad(amplitude)))(forcing)
    for i in (0, 1700, 4095):
        value, slope = jax.value_and_grad(amplitude)(float(forcing[i]))
        assert (values[i], slopes[i]) == (value, slope)


def test_without_the_custom_call_the_host_answers(monkeypatch):
    x, y = box(6, seed=10)

    def amplitude(x, y):
        return steady_state(of(x), y0=y).amplitude

    def answers():
        jax.clear_caches()
        return jax.jit(jax.vmap(jax.value_and_grad(amplitude)))(x, y)

    direct = answers()
    monkeypatch.setattr(compiled_linear.EXACT, "direct", lambda: False)
    try:
        for ours, theirs in zip(answers(), direct, strict=True):
            np.testing.assert_array_equal(ours, theirs)
    finally:
        jax.clear_caches()


@pytest.mark.parametrize("workers", [1, 2])
def test_results_do_not_depend_on_the_threads(workers):
    x, y = box(64, seed=11)
    ours = settle_all(of(x.T), y, workers=workers)
    assert np.array_equal(ours.y, settle_all(of(x.T), y).y, equal_nan=True)
