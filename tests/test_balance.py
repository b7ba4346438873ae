"""The closed forms: one-harmonic balance (27), corrected, and the uplift criterion."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import BARE, CASES, HUNG, MOVING, NAMES, STILL, differences, exact, named, parameters
from tpd import one_harmonic, uplift

ONE = jax.jit(lambda x: one_harmonic(parameters(x)))
UPLIFT = jax.jit(lambda x: uplift(parameters(x)))
FORMS = {
    "amplitude": lambda x: ONE(x).amplitude,
    "stroke": lambda x: ONE(x).stroke,
    "margin": lambda x: UPLIFT(x).margin,
    "stroke at rest": lambda x: UPLIFT(x).stroke,
}
DAMPED, UNDAMPED = np.array(HUNG[3].x), np.array([*HUNG[3].x[:3], 0.0, *HUNG[3].x[4:]])


@pytest.mark.parametrize("case", MOVING, ids=named)
def test_one_harmonic_is_a_little_above_the_exact_amplitude(case):
    estimate = ONE(np.array(case.x))
    assert estimate.exists
    assert 1.0 < float(estimate.amplitude) / exact(case.x, case.y0).amplitude < 1.06


@pytest.mark.parametrize("case", HUNG, ids=named)
def test_one_harmonic_knows_the_stroke_too(case):
    assert float(ONE(np.array(case.x)).stroke) == pytest.approx(exact(case.x).stroke, rel=0.1)


@pytest.mark.parametrize("case", MOVING, ids=named)
def test_one_harmonic_satisfies_the_complex_balance(case):
    """Row by row in complex amplitudes, the signs replaced by 4/pi of their first harmonic."""
    p, (phi, stroke, _) = parameters(case.x), ONE(np.array(case.x))
    rho, c = p.inertia_ratio, float(p.hinge)
    i_xi = 1j * p.xi
    jumps = 4 / np.pi * ((1 + p.mu) * p.nu + 1j * p.k)

    def rows(forcing):
        psi = (forcing + (2 * rho * i_xi**2 + c * i_xi) * phi) / (p.lam * rho * i_xi**2 + c * i_xi + 1)
        block = (1 + p.mu * rho * (4 + p.nu**2)) * i_xi**2 * phi - 2 * p.mu * rho * p.lam * i_xi**2 * psi
        block += -(1 + 2 * p.mu) * phi + p.mu * p.lam * c * i_xi * (phi - psi)
        return block + jumps + (1 + 2 * p.mu) * forcing, psi

    free, by_forcing = rows(0.0)[0], rows(1.0)[0] - rows(0.0)[0]
    forcing = -free / by_forcing
    assert abs(forcing) == pytest.approx(p.f, rel=1e-12)
    assert abs(rows(forcing)[1]) == pytest.approx(float(stroke), rel=1e-12)


def test_one_harmonic_is_the_larger_root():
    """The smaller one, the saddle, has the amplitude falling with the forcing."""
    for case in MOVING:
        assert jax.grad(FORMS["amplitude"])(np.array(case.x))[5] > 0


def test_without_enough_forcing_no_orbit_exists():
    weak = np.array(HUNG[0].x)
    weak[5] = 0.01
    estimate = ONE(weak)
    assert not estimate.exists
    assert estimate.amplitude == estimate.stroke == 0.0
    assert np.all(np.isfinite(jax.grad(FORMS["amplitude"])(weak)))


@pytest.mark.parametrize(
    "x", [UNDAMPED, np.array([0.25, 0.3, 0.5, 0.0, 0.05, 0.4, 2.0])], ids=["long", "short"]
)
def test_the_margin_of_an_undamped_hinge_is_its_short_formula(x):
    nu, mu, lam, _, k, f, xi = x
    rho = 0.75 / (1 + nu**2)
    demand = f * abs(1 + 2 * mu / (1 - lam * rho * xi**2))
    found = UPLIFT(x)
    assert float(found.margin) == pytest.approx(1 - demand / ((1 + mu) * nu + k), rel=1e-12)
    assert float(found.stroke) == pytest.approx(f / abs(1 - lam * rho * xi**2), rel=1e-12)


def test_the_margin_is_that_of_the_largest_moment_over_a_period():
    """Of a held block whose bob has settled: R = (1 + 2 mu) phi - ..., integrated by nobody."""
    nu, mu, lam, zeta, k, f, xi = DAMPED
    rho = 0.75 / (1 + nu**2)
    c = 2 * zeta * np.sqrt(lam * rho)
    swing = f / (1 - lam * rho * xi**2 + 1j * c * xi)
    phase = np.exp(1j * np.linspace(0, 2 * np.pi, 100_001))
    moment = np.imag(
        (-(1 + 2 * mu) * f - 2 * mu * rho * lam * xi**2 * swing + 1j * mu * lam * c * xi * swing) * phase
    )
    largest = np.abs(moment).max()
    assert float(UPLIFT(DAMPED).margin) == pytest.approx(1 - largest / ((1 + mu) * nu + k), rel=1e-8)


@pytest.mark.parametrize("case", CASES, ids=named)
def test_a_block_within_its_margin_settles_at_rest_with_the_stroke_that_is_predicted(case):
    found = UPLIFT(np.array(case.x))
    if case is STILL:
        assert found.margin > 0
        assert exact(case.x).status == "rest"
        assert float(found.stroke) == pytest.approx(exact(case.x).stroke, rel=1e-12)
    elif case not in BARE:
        assert found.margin < 0


def test_a_bare_block_lifts_when_the_base_pushes_harder_than_its_slenderness():
    x = np.array([0.2, 0.0, 0.4, 0.1, 0.05, 0.25, 2.0])
    assert float(UPLIFT(x).margin) == pytest.approx(0.0, abs=1e-15)
    x[5] = 0.125
    assert float(UPLIFT(x).margin) == pytest.approx(0.5, rel=1e-14)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("case", [HUNG[0], HUNG[3]], ids=named)
def test_gradients_are_those_of_differences(form, case):
    slopes = jax.jit(jax.grad(FORMS[form]))(jnp.array(case.x))
    for i, name in enumerate(NAMES[:7]):
        expected = differences(lambda x: float(FORMS[form](x)), case.x, i, share=3e-3)
        assert slopes[i] == pytest.approx(expected, rel=1e-8, abs=1e-12), name
