"""The compiled event loop of the nonlinear equations, against `Segmented`, energy and the exact solution."""

import dataclasses
import math
import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tpd
from tpd.core import files
from tpd.models.compiled_nonlinear import settle_nonlinear, settle_one
from tpd.models.rows import settle_all
from tpd.scene.status import names_of
from tpd.theory.equations import Equations

HUNG = tpd.Parameters(nu=0.25, mu=0.2, lam=0.8, zeta=0.1, k=0.05, f=0.5, xi=3.5)
PERIODS = 40
_follow = eqx.filter_jit(tpd.Segmented(rtol=1e-10, tolerance=1e-6, max_periods=PERIODS).settle)
SIZES = ("amplitude", "stroke", "peak", "peak_stroke")


def scenes(kind, count=16, seed=4):
    """Random parameters and starts, friction from none to that which holds a leaning block."""
    u = np.random.default_rng(seed).random((count, 12))
    nu, hung, lossy = 0.1 + 0.25 * u[:, 0], kind.startswith("hung"), kind.endswith("impacts")
    p = tpd.Parameters(
        nu=nu,
        mu=(0.02 + 0.3 * u[:, 1]) * hung,
        lam=0.2 + 1.3 * u[:, 2],
        zeta=0.05 + 0.3 * u[:, 3],
        k=nu * u[:, 4] ** 2 * (0.3 if lossy else 1.0),
        f=nu * (0.4 + (1.2 if hung else 2.0) * u[:, 5]),
        xi=1.0 + 6.0 * u[:, 6],
        e=0.6 + 0.35 * u[:, 7] if lossy else np.ones(count),
    )
    reach = np.stack([0.6 * nu, 0.3 + 0.0 * nu, 0.3 * nu, 0.3 + 0.0 * nu], axis=1)
    return p, (2.0 * u[:, 8:12] - 1.0) * reach


def one(p, i):
    return jax.tree.map(lambda x: jnp.asarray(x)[i], p)


def status(*args, **options):
    return names_of(settle_nonlinear(*args, **options).status)[0]


@pytest.mark.parametrize("kind", ["hung", "bare", "impacts", "hung impacts"])
def test_random_motions_are_those_of_the_segmented_model(kind):
    p, y0 = scenes(kind)
    ours = settle_nonlinear(p, y0, periods=PERIODS)
    near = settle_nonlinear(p, y0 + 1e-9, periods=PERIODS)
    names, compared = names_of(ours.status), 0
    for i in range(len(y0)):
        calm = names[i] == names_of(near.status)[i] and (
            names[i] == "overturned" or abs(ours.amplitude[i] - near.amplitude[i]) < 1e-7
        )
        # A motion that a change of 1e-9 sends elsewhere has no answer to compare.
        if not calm:
            continue
        compared += 1
        other = _follow(one(p, i), jnp.asarray(y0[i]))
        assert tpd.status_name(other.status) == names[i]
        if names[i] != "overturned":
            assert ours.amplitude[i] == pytest.approx(float(other.amplitude), abs=1e-6)
            assert ours.peak[i] == pytest.approx(float(other.peak), abs=1e-5)
        if kind.startswith("hung") and names[i] != "overturned":
            assert ours.stroke[i] == pytest.approx(float(other.stroke), abs=1e-5)
            assert ours.peak_stroke[i] == pytest.approx(float(other.peak_stroke), abs=1e-5)
    assert compared >= 12
    assert len(set(names)) >= 3, set(names)


def energy(p, y):
    """Energy over M g b from (4) for states (n, 4)."""
    phi, psi, dphi, dpsi = np.asarray(y).T
    s, rho = np.sign(phi), float(p.inertia_ratio)
    arm = s * p.nu * np.sin(phi - psi) + 2.0 * np.cos(phi - psi)
    kinetic = 0.5 * (1.0 + p.mu * rho * (4.0 + p.nu**2)) * dphi**2 - p.mu * rho * p.lam * arm * dphi * dpsi
    kinetic = kinetic + 0.5 * p.mu * p.lam**2 * rho * dpsi**2
    block = s * (1.0 + p.mu) * p.nu * np.sin(phi) + (1.0 + 2.0 * p.mu) * np.cos(phi)
    return kinetic + block - p.mu * p.lam * np.cos(psi)


def test_energy_stays_without_losses():
    """Through crossings a bare block's; with a bob that of one arc, since a crossing changes it."""
    free = dataclasses.replace(HUNG, k=0.0, zeta=0.0, f=0.0)
    cases = [
        (dataclasses.replace(free, mu=0.0, xi=1.0), [0.2, 0.0, 0.0, 0.0], 10),
        (dataclasses.replace(free, xi=4.0), [0.24, 0.5, 0.0, -0.3], 1),
    ]
    for p, y0, periods in cases:
        found = settle_nonlinear(p, [y0], periods=periods)
        assert found.elapsed[0] == periods
        end = found.y[0] * ([1, 0, 1, 0] if p.mu == 0.0 else 1)
        start = np.array(y0) * ([1, 0, 1, 0] if p.mu == 0.0 else 1)
        assert energy(p, [end])[0] == pytest.approx(energy(p, [start])[0], abs=1e-8)
        assert np.abs(end - start).max() > 0.01


@pytest.mark.parametrize("e", [0.7, 0.95])
def test_an_impact_keeps_the_angular_momentum_but_for_the_loss(e):
    """A landing next to a hanging bob that swings: SciPy on both sides, the law written out between."""
    p = dataclasses.replace(HUNG, k=0.0, f=0.0, xi=3.0, e=e)
    equations = Equations(p, tpd.Terms.nonlinear)
    rates = jax.jit(lambda y, s: equations.rates(y, s, 0.0, 0.0))

    def arc(y, s, end):
        landing = lambda _, y: s * y[0] + 1e-300  # noqa: E731
        landing.terminal, landing.direction = True, -1
        options = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-13}
        return solve_ivp(lambda _, y: rates(y, s), (0.0, end), y, events=landing, **options)

    y0, period = np.array([0.1, 0.6, -0.1, 0.2]), 2.0 * math.pi / 3.0
    first = arc(y0, 1.0, period)
    _, psi, before, rate = first.y[:, -1]
    assert first.status == 1
    q, old, loss = 2 * np.sin(psi) - 0.25 * np.cos(psi), 2 * np.sin(psi) + 0.25 * np.cos(psi), 0.2 * 0.25**2
    rho = float(p.inertia_ratio)
    kept = e * (1.0 + rho * loss) + rho * loss + 0.2 * rho * q * old
    after = before * kept / (1.0 + 0.2 * rho * q**2)
    pulled = 2.0 * np.cos(psi) * (after - before) + 0.25 * np.sin(psi) * (after + before)
    last = arc(np.array([-1e-18, psi, after, rate + pulled / 0.8]), -1.0, period - first.t[-1])
    assert last.status == 0
    found = settle_nonlinear(p, [y0], periods=1, rtol=1e-10)
    np.testing.assert_allclose(found.y[0], last.y[:, -1], atol=1e-8)


@pytest.mark.parametrize("ramp", [0.0, 0.2, 1.25, 2.0])
def test_small_angles_give_the_linear_motion_at_any_phase_and_growth(ramp):
    small = 1e-3
    p = dataclasses.replace(HUNG, nu=0.25 * small, k=0.05 * small, f=0.5 * small)
    begin = np.array([0.0, 0.3, 0.9]) * 2.0 * np.pi / 3.5
    y0 = small * np.array([[0.02, 0.0, 0.0, 0.0], [0.0, 0.1, 0.0, 0.0], [-0.1, 0.0, 0.1, 0.0]])
    how = {"begin": begin, "ramp": ramp}
    exact = settle_all(p, y0, model=tpd.Piecewise(max_periods=5), **how)
    ours = settle_nonlinear(p, y0, periods=5, rtol=1e-10, **how)
    np.testing.assert_allclose(ours.y / small, exact.y / small, atol=2e-5)
    np.testing.assert_allclose(ours.peak / small, exact.peak / small, atol=2e-5)
    np.testing.assert_array_equal(ours.elapsed, exact.elapsed)


def test_nothing_is_called_rest_while_the_shaking_grows():
    p = dataclasses.replace(HUNG, mu=0.0, f=0.2)
    at_once, slow = settle_nonlinear(p, np.zeros((1, 4))), settle_nonlinear(p, np.zeros((1, 4)), ramp=10.0)
    assert names_of(at_once.status)[0] == names_of(slow.status)[0] == "rest"
    assert at_once.elapsed[0] == 1
    assert slow.elapsed[0] > 10


def test_a_start_within_a_period_is_not_rest_before_a_whole_one():
    """From this phase on the shaking lifts the block in the next period only."""
    p = dataclasses.replace(HUNG, mu=0.0, f=0.6)
    assert status(p, np.zeros((1, 4)), begin=0.8 * 2.0 * np.pi / 3.5) != "rest"


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
def test_every_motion_has_a_status(changes, y0, name):
    found = settle_nonlinear(dataclasses.replace(HUNG, **changes), [y0], periods=200)
    assert names_of(found.status)[0] == name
    if name == "overturned":
        assert np.isinf(found.peak[0])
    elif name != "failed":
        assert all(np.isfinite(getattr(found, size)[0]) for size in SIZES)


def test_a_bounded_motion_says_so():
    assert status(HUNG, np.zeros((1, 4)), periods=3) == "not_settled"
    assert status(HUNG, np.zeros((1, 4)), max_events=1) == "event_bound"


def test_results_do_not_depend_on_the_threads_or_on_the_call():
    p, y0 = scenes("hung", 40)
    calls = []
    alone = settle_nonlinear(p, y0, periods=20, workers=1, progress=lambda *done: calls.append(done))
    assert calls[-1] == (40, 40)
    for again in (settle_nonlinear(p, y0, periods=20, workers=n) for n in (1, 2)):
        jax.tree.map(np.testing.assert_array_equal, alone, again)
    row = settle_nonlinear(one(p, 7), y0[7:8], periods=20)
    np.testing.assert_array_equal(row.y[0], alone.y[7])


def test_one_motion_is_that_of_a_batch():
    alone = settle_one(HUNG)
    np.testing.assert_array_equal(alone.y, settle_nonlinear(HUNG, np.zeros((1, 4))).y[0])
    assert tpd.status_name(alone.status) == "rocking"
    assert tpd.status_name(settle_one(HUNG, [math.nan, 0.0, 0.0, 0.0]).status) == "failed"


def test_the_answer_goes_on_like_that_of_the_segmented_model():
    ours, other = settle_nonlinear(HUNG, np.zeros((1, 4))), _follow(HUNG, jnp.zeros(4))
    assert jax.tree.structure(ours) == jax.tree.structure(other)
    assert [x.dtype for x in jax.tree.leaves(ours)] == [x.dtype for x in jax.tree.leaves(other)]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"y0": np.zeros((0, 4))}, "`y0` \\(n, 4\\)"),
        ({"ramp": np.zeros(3)}, "must have shape \\(n,\\)"),
        ({"ramp": -1.0}, "`ramp` must be zero or positive, and finite"),
        ({"begin": 2.0}, "`begin` must lie within the first forcing period, but is"),
        ({"periods": 0}, "`periods` must be a whole number, 1 or more, but is 0"),
        ({"workers": 0}, "`workers` must be a whole number, 1 or more, but is 0"),
        ({"rtol": 0.0}, "`rtol` must be positive and finite, but is 0"),
    ],
)
def test_bad_input_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        settle_nonlinear(HUNG, **({"y0": np.zeros((2, 4))} | wrong))


def test_numba_is_not_loaded_before_it_is_needed():
    code = "import sys, tpd, tpd.answers.ensemble; assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_where_nothing_can_be_stored_it_compiles_all_the_same(monkeypatch):
    from tpd.models import nonlinear_entry

    def cfunc(*_, cache=False, **__):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: (function, "compiled")

    monkeypatch.setattr(nonlinear_entry.numba, "cfunc", cfunc)
    monkeypatch.setattr(files, "_SAID", set())
    with pytest.warns(UserWarning, match="every run compiles anew: cannot cache function"):
        assert nonlinear_entry._entrance(5, 0)[1] == "compiled"


@pytest.mark.mends("a block that never moves was called sticking where its bob repeats itself")
def test_a_block_at_rest_under_a_bob_that_repeats_itself_after_two_periods_is_not_sticking():
    # Nothing damps the bob; so small a swing has twice the period of the forcing to 1e-7.
    nu, lam = 0.2, 0.4
    xi = 2.0 / math.sqrt(lam * 0.75 / (1.0 + nu**2))
    p = tpd.Parameters(nu=nu, mu=0.1, lam=lam, zeta=0.0, k=0.03, f=1e-9, xi=xi)
    found = settle_one(p, (0.0, 1e-3, 0.0, 0.0))
    assert names_of(found.status) == "rest"
    assert found.amplitude == 0.0
    assert float(found.stroke) == pytest.approx(1e-3, rel=1e-6)
