"""The one-harmonic balance: (23) and (27), corrected."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import MOVING, NAMES, WITH, differences, exact, named, orbits_of, parameters
from tpd import Parameters, theory
from tpd.answers.bifurcations import Kind, bifurcations
from tpd.scene.status import names_of
from tpd.theory import fold, harmonic_balance, one_harmonic

# Compiled, because each of their operations would be a program.
one_harmonic_branches, parametric_branches, neglected_harmonics = map(
    jax.jit, (theory.one_harmonic_branches, theory.parametric_branches, theory.neglected_harmonics)
)
FOLD_NAMES = (*NAMES[:7], "rho", "e")
ONE = jax.jit(lambda x: one_harmonic(parameters(x)))
SLOPES = jax.jit(jax.grad(lambda x: ONE(x).amplitude))


@pytest.mark.parametrize("case", MOVING, ids=named)
def test_one_harmonic_overestimates_the_stable_amplitude_by_at_most_6_per_cent(case):
    estimate = ONE(np.array(case.x))
    assert estimate.exists
    assert 1.0 < float(estimate.amplitude) / exact(case.x, case.y0).amplitude < 1.06
    # Of the smaller one, the saddle, the amplitude falls with the forcing.
    assert SLOPES(np.array(case.x))[5] > 0


@pytest.mark.parametrize("case", WITH, ids=named)
def test_one_harmonic_gives_the_swing_within_ten_per_cent(case):
    assert float(ONE(np.array(case.x)).swing) == pytest.approx(exact(case.x).swing, rel=0.1)


def test_no_orbit_exists_below_a_smallest_forcing():
    weak = jnp.array((*WITH[0].x[:5], 0.01, *WITH[0].x[6:]))
    for found in (ONE(weak), one_harmonic_branches(parameters(weak)), parametric_branches(parameters(weak))):
        assert not np.any(found.exists)
        assert not np.any(found.amplitude)
        assert not np.any(found.swing)
    assert np.all(np.isinf(neglected_harmonics(parameters(weak)).bound))
    assert np.all(np.isfinite(SLOPES(weak)))
    for slopes in PAIRS_SLOPES.values():
        assert np.all(slopes(weak[:7])[0] == 0.0)


def scenes(number: int, seed: int = 3) -> dict[str, np.ndarray]:
    """Random parameters, arrays of `number`, over what a search meets."""
    low = np.array([0.1, 0.01, 0.1, 0.02, 0.01, 0.1, 1.2])
    high = np.array([0.35, 0.3, 1.5, 0.5, 0.08, 0.6, 5.0])
    x = np.random.default_rng(seed).uniform(low, high, (number, 7))
    return {name: jnp.asarray(column) for name, column in zip(NAMES, x.T, strict=False)}


def projected(p, phi, stroke_phasor, forcing, parametric):
    """First harmonics of row 1 of (25), the signs as they are, by sampling a period: the slow,
    obvious way. Forcing Re F exp(i theta)."""
    theta = (np.arange(40_000) + 0.5) / 40_000 * 2 * np.pi
    turn, rho, c = np.exp(1j * theta), p.inertia_ratio, float(p.hinge)
    tilt, rate = phi * turn.real, (1j * p.xi * phi * turn).real
    bob, bob_rate, push = (stroke_phasor * turn), (1j * p.xi * stroke_phasor * turn), (forcing * turn).real
    row = -(1 + p.mu * rho * (4 + p.nu**2)) * p.xi**2 * tilt - (1 + 2 * p.mu) * tilt
    row += 2 * p.mu * rho * p.lam * p.xi**2 * bob.real + p.mu * p.lam * c * (rate - bob_rate.real)
    row += np.sign(tilt) * (1 + p.mu) * p.nu + p.k * np.sign(rate) + (1 + 2 * p.mu) * push
    row += parametric * np.abs(tilt) * (1 + p.mu) * p.nu * push
    return 2 * np.mean(row * turn.conj())


@pytest.mark.parametrize("parametric", [False, True])
@pytest.mark.parametrize("case", MOVING, ids=named)
def test_both_branches_satisfy_the_numerical_harmonic_balance(case, parametric):
    p = parameters(case.x)
    found = parametric_branches(p) if parametric else one_harmonic_branches(p)
    assert found.exists[0]
    rho, c = p.inertia_ratio, float(p.hinge)
    for i in np.flatnonzero(found.exists):
        phi, forcing = float(found.amplitude[i]), p.f * np.exp(1j * (float(found.phase[i]) - np.pi / 2))
        drive = 2 * rho * p.xi**2 - 1j * p.xi * c
        bob = (forcing - drive * phi) / (1 - p.lam * rho * p.xi**2 + 1j * p.xi * c)
        assert abs(projected(p, phi, bob, forcing, parametric)) < 1e-8
        assert abs(projected(p, 1.01 * phi, bob, forcing, parametric)) > 1e-4
        assert abs(bob) == pytest.approx(float(found.swing[i]), rel=1e-12)


def test_the_upper_branch_equals_the_one_harmonic_solution():
    p = Parameters(**scenes(50))
    both, one = one_harmonic_branches(p), one_harmonic(p)
    assert 40 < int(one.exists.sum()) < 50
    for a, b in ((both.amplitude, one.amplitude), (both.swing, one.swing), (both.exists, one.exists)):
        np.testing.assert_allclose(a[:, 0], b, rtol=1e-14)


def test_the_lower_branch_falls_with_the_forcing_and_ends_at_uplift():
    def amplitude(f):
        return one_harmonic_branches(Parameters(nu=0.2, mu=0.0, lam=1.0, zeta=0.1, k=0.05, f=f, xi=2.0))

    assert jax.jacfwd(lambda f: amplitude(f).amplitude[1])(0.1) < 0 < amplitude(0.1).amplitude[1]
    edge = 4 / np.pi * np.hypot(0.2, 0.05)
    np.testing.assert_array_equal(amplitude(edge * 0.999).exists, [True, True])
    np.testing.assert_array_equal(amplitude(edge * 1.001).exists, [True, False])
    assert float(amplitude(edge * 0.999).amplitude[1]) < 1e-3


def test_the_impact_term_of_the_balance_dissipates_the_energy_of_impacts():
    """A tilt that is a parabola in time; the energies are those of the mass matrix of (25)."""
    e, phi = 0.7, 0.03
    p = Parameters(nu=0.25, mu=0.2, lam=0.8, zeta=0.1, k=0.0, f=0.1, xi=3.0, e=e)
    rho, half = p.inertia_ratio, np.pi / p.xi
    # The mean of the rates before and after the impact is that of the parabola.
    rate = 4 * phi / half
    before = 2 * rate / (1 + e)
    # Multiply the row of the pendulum by mu lam, so that the matrix is symmetric and its form an energy.
    mass = np.array(
        [
            [1 + p.mu * rho * (4 + p.nu**2), -2 * p.mu * rho * p.lam],
            [-2 * p.mu * rho * p.lam, p.mu * rho * p.lam**2],
        ]
    )
    # The base does not change the momentum of the bob about the hinge.
    q = np.array([before, 0.4])
    after = np.array([e * before, 0.4 + 2 / p.lam * (e - 1) * before])
    assert mass[1] @ (after - q) == pytest.approx(0.0, abs=1e-15)
    lost = (q @ mass @ q - after @ mass @ after) / 2
    whole, without = (complex(harmonic_balance._balance(dataclasses.replace(p, e=x)).a) for x in (e, 1.0))
    assert 2 * lost == pytest.approx(np.pi * (whole - without).imag * phi**2, rel=1e-12)
    assert whole.real == without.real


def test_the_upper_branch_with_impact_loss_is_near_the_linear_model():
    for e, median, number in ((0.95, 0.015, 284), (0.8, 0.01, 265), (0.5, 0.085, 215)):
        p = Parameters(**scenes(300, seed=5), e=e)
        balance, orbits = one_harmonic(p), orbits_of(p)
        share = np.asarray(orbits.amplitude)[:, 0] / np.where(balance.exists, balance.amplitude, np.nan)
        assert np.isfinite(share).sum() >= number
        assert np.nanmedian(np.abs(share - 1)) < median


def test_without_friction_the_impact_loss_sets_the_smallest_forcing():
    def amplitude(e, f):
        p = Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.0, f=f, xi=3.0, e=e)
        return one_harmonic_branches(p), np.isfinite(orbits_of(p).amplitude).any()

    # The exact fold is at 0.028568.
    for f, exists in ((0.029, False), (0.0296, True)):
        assert amplitude(0.9, f)[0].exists.tolist() == [exists, exists]
    assert (amplitude(0.9, 0.0285)[1], amplitude(0.9, 0.0287)[1]) == (False, True)
    assert amplitude(1.0, 0.015)[0].exists.all(), "the loss in the hinge is smaller"


# Parameters, fold of the balance, fold of the exact orbits, and amplitude of the balance. Source: two codes
# that share nothing with the package.
FOLDS = (
    ({"nu": 0.2, "mu": 0.0, "lam": 1.0, "zeta": 0.1, "k": 0.05, "xi": 2.0}, 0.063662, 0.060962, 0.05093),
    (
        {"nu": 0.2, "mu": 0.05, "lam": 0.8, "zeta": 0.1, "k": 0.0, "xi": 3.0, "e": 0.9},
        *(0.029343, 0.028568, 0.02694),
    ),
    (
        {"nu": 0.25, "mu": 0.1, "lam": 0.8, "zeta": 0.1, "k": 0.05, "xi": 3.5, "e": 0.9},
        *(0.106814, 0.103255, 0.02616),
    ),
)


@pytest.mark.parametrize(("numbers", "forcing", "exact", "amplitude"), FOLDS)
def test_both_branches_merge_in_a_fold_slightly_above_the_exact_fold(numbers, forcing, exact, amplitude):
    found = fold(Parameters(**numbers, f=0.0))
    assert str(names_of(found.status)) == "near_fold"
    assert (float(found.f), float(found.amplitude)) == pytest.approx((forcing, amplitude), rel=2e-4)
    for share, exists in ((-1e-9, False), (1e-9, True)):
        near = one_harmonic_branches(Parameters(**numbers, f=float(found.f) * (1 + share)))
        assert near.exists.tolist() == [exists, exists]
        if exists:
            np.testing.assert_allclose(near.amplitude, found.amplitude, rtol=1e-3)
            np.testing.assert_allclose(near.phase, found.phase, atol=1e-3)
    # Bisect: an orbit exists above the fold and not below.
    low, high = 0.9 * forcing, forcing
    for _ in range(14):
        middle = 0.5 * (low + high)
        exists = np.isfinite(orbits_of(Parameters(**numbers, f=middle)).amplitude).any()
        low, high = (low, middle) if exists else (middle, high)
    assert high == pytest.approx(exact, abs=1e-6)
    assert 1.003 < forcing / high < 1.045


def test_the_fold_of_the_balance_is_near_the_exact_fold_at_any_hinge_height():
    numbers = FOLDS[2][0]
    forcings = []
    for kappa in (1.0, 1.5, 2.5):
        law = float(fold(Parameters(**numbers, f=0.0, kappa=kappa)).f)
        folds = bifurcations(Parameters(**numbers, f=law, kappa=kappa), "f", 0.8 * law, 1.1 * law, samples=40)
        (exact,) = [b.value for b in folds if b.kind is Kind.fold]
        assert 1.003 < law / exact < 1.045
        forcings.append(exact)
    # A higher hinge needs more forcing to rock.
    assert forcings == sorted(forcings)


def test_gradients_of_the_fold_equal_finite_differences():
    x = (0.2, 0.05, 0.8, 0.1, 0.03, 0.1, 3.0, 0.8, 0.9)
    both = jax.jit(lambda x: jnp.stack(fold(Parameters(**dict(zip(FOLD_NAMES, x, strict=True))))[:3]))
    slopes = jax.jit(jax.jacrev(both))(jnp.array(x))
    for i in range(len(x)):
        expected = differences(lambda x: np.asarray(both(x)), x, i, share=2e-3)
        np.testing.assert_allclose(slopes[:, i], expected, rtol=1e-8, atol=1e-11)
    np.testing.assert_array_equal(slopes[:, 5], 0.0)
    p = scenes(20)
    many = fold(Parameters(**p))
    one = fold(Parameters(**{name: float(column[7]) for name, column in p.items()}))
    np.testing.assert_allclose((many.f[7], many.phase[7]), (one.f, one.phase), rtol=1e-14)


def test_branches_that_merge_at_a_negative_amplitude_have_no_fold():
    """Next to its resonance the bob turns the sign of the inertia of the block."""
    numbers = {"nu": 0.2, "mu": 0.3, "lam": 1.0, "zeta": 0.01, "k": 0.05, "xi": 1.265, "rho": 0.75}
    found = fold(Parameters(**numbers, f=0.1))
    assert str(names_of(found.status)) == "no_orbit"
    assert np.isnan(found.f)
    for f in (0.01, 0.1, 0.3):
        assert not one_harmonic_branches(Parameters(**numbers, f=f)).exists[1]


@pytest.fixture(scope="module")
def compared():
    """Of 300 scenes, (300, 2) each: the error of the balance against the exact orbit of like phase as a
    share (NaN where there is none), the first-order correction, the bound, whether the balance has one."""
    p = Parameters(**scenes(300, seed=5))
    both, left_out, orbits = one_harmonic_branches(p), neglected_harmonics(p), orbits_of(p)
    off = orbits.phase[:, None, :] - both.phase[:, :, None]
    off = np.abs((off + np.pi) % (2 * np.pi) - np.pi)
    size = np.abs(np.log(orbits.amplitude[:, None, :] / np.where(both.exists, both.amplitude, 1)[:, :, None]))
    apart = np.where(np.isfinite(off) & (off < 1.0), size + off, np.inf)
    nearest = np.take_along_axis(np.asarray(orbits.amplitude), apart.argmin(-1), axis=1)
    met = np.isfinite(apart.min(-1)) & np.asarray(both.exists)
    truth = np.where(met, nearest, np.nan) / np.where(both.exists, both.amplitude, 1.0) - 1.0
    return truth, np.asarray(left_out.correction), np.asarray(left_out.bound), np.asarray(both.exists)


def test_the_error_of_the_balance_is_within_its_bound(compared):
    for branch, number in ((0, 250), (1, 50)):
        truth, _, bound, exists = (x[:, branch] for x in compared)
        met = np.isfinite(truth)
        assert met.sum() > number
        assert np.mean(np.abs(truth[met]) <= bound[met]) >= 0.95
        assert np.median(bound[met] / np.abs(truth[met])) < 2.5, "and the bound says something"
        if branch == 0:
            # A small bound says that there is an orbit of the exact equations.
            sure = exists & (bound < 0.2)
            assert sure.sum() > 250
            assert np.all(np.isfinite(truth[sure]))


def test_the_first_order_correction_reduces_the_error_to_a_tenth(compared):
    truth, correction, _, _ = (x[:, 0] for x in compared)
    met = np.isfinite(truth)
    assert 0.01 < np.median(np.abs(truth[met])) < 0.03
    assert np.median(np.abs(truth - correction)[met]) < 0.1 * np.median(np.abs(truth[met]))


def test_the_effect_of_the_parametric_term_falls_with_the_angles():
    def shift(s):
        p = Parameters(nu=0.2 * s, mu=0.1, lam=0.5, zeta=0.1, k=0.03 * s, f=0.3 * s, xi=2.5, rho=0.7)
        return float(parametric_branches(p).amplitude[0] / one_harmonic_branches(p).amplitude[0] - 1)

    shifts = [shift(s) for s in (1.0, 0.1, 0.01)]
    assert abs(shifts[0]) > 1e-3
    # nu phi is of second order, and so is nu^2 in the coefficients.
    assert shifts[1] / shifts[2] == pytest.approx(100, rel=0.05)


PAIRS = {
    "branches": jax.jit(lambda x: jnp.stack(one_harmonic_branches(parameters(x))[:3])),
    "parametric": jax.jit(lambda x: jnp.stack(parametric_branches(parameters(x))[:3])),
    "neglected": jax.jit(lambda x: jnp.nan_to_num(jnp.stack(neglected_harmonics(parameters(x))), posinf=0.0)),
}
PAIRS_SLOPES = {name: jax.jit(jax.jacrev(form)) for name, form in PAIRS.items()}


@pytest.mark.parametrize("form", PAIRS)
@pytest.mark.parametrize("x", [WITH[0].x, WITH[3].x, (0.2, 0.02, 0.4, 0.2, 0.05, 0.1, 2.0)], ids=str)
def test_gradients_of_both_branches_equal_finite_differences(form, x):
    function = PAIRS[form]
    slopes = PAIRS_SLOPES[form](jnp.array(x))
    values = np.asarray(function(jnp.array(x)))
    for i, name in enumerate(NAMES[:7]):
        expected = differences(lambda x: np.asarray(function(x)), x, i, share=2e-3)
        there = values != 0
        assert there[:, 0].all()
        scale = np.abs(expected) + np.abs(values) / max(abs(x[i]), 0.1)
        assert np.all((np.abs(slopes[..., i] - expected) <= 1e-8 * scale)[there]), name


@pytest.mark.parametrize("as_arrays", [False, True])
def test_the_balance_is_nan_at_undamped_resonance(as_arrays):
    kind = jnp.asarray if as_arrays else float
    sizes = {"nu": 0.25, "mu": 0.05, "lam": 1.0, "zeta": 0.0, "k": 0.05, "f": 0.1, "xi": 1.0, "rho": 1.0}
    found = one_harmonic(Parameters(**{name: kind(x) for name, x in sizes.items()}))
    assert not found.exists
    assert np.isnan(found.amplitude)
    assert np.isnan(found.swing)
