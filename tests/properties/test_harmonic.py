"""What holds for every block and pendulum under a harmonic: energy, reversal, scales, thresholds and runs."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.properties.bounded import bounded
from tests.reference import exact as solve
from tests.reference import parameters
from tpd import Ensemble, Parameters, outcomes, simulate, status_name, steady_state, theory
from tpd.scene.status import SETTLED, names_of

RATES = np.array([1.0, 1.0, -1.0, -1.0])
"""Signs of a state when time runs backwards."""
TIMES = np.linspace(0.0, 6.0, 25)

conserving = st.tuples(
    st.floats(0.05, 0.4),  # nu
    st.floats(0.0, 0.5),  # mu
    st.floats(0.1, 2.0),  # lam
    *(st.floats(-0.8, 0.8) for _ in range(4)),  # the start: phi over nu, psi, and both rates likewise
)


def free(case):
    """Motion without forcing, friction, damping or loss, its parameters and its start."""
    nu, mu, lam, tilt, swing, tilt_rate, swing_rate = case
    p = Parameters(nu=nu, mu=mu, lam=lam, zeta=0.0, k=0.0, f=0.0, xi=2.0, e=1.0)
    # So gently that no block comes near its balance, where differences grow without end.
    y0 = 0.4 * nu * np.array([tilt, swing, 0.5 * tilt_rate, 0.5 * swing_rate])
    # Squares of smaller numbers would underflow.
    return p, np.where(np.abs(y0) < 1e-100, 0.0, y0)


def moved(p, y0):
    return np.asarray(simulate(p, y0, TIMES).ys)


def energy(p, ys):
    """Of (25) over M g b, its second equation times mu lam, which makes both matrices symmetric."""
    nu, mu, lam, rho = p.nu, p.mu, p.lam, 0.75 / (1.0 + p.nu**2)
    tilt, swing, tilt_rate, swing_rate = ys.T
    moving = 0.5 * (1.0 + mu * rho * (4.0 + nu**2)) * tilt_rate**2 + 0.5 * mu * lam**2 * rho * swing_rate**2
    moving -= 2.0 * mu * rho * lam * tilt_rate * swing_rate
    raised = (1.0 + mu) * nu * np.abs(tilt) - 0.5 * (1.0 + 2.0 * mu) * tilt**2 + 0.5 * mu * lam * swing**2
    return moving + raised


@bounded(40)
@given(conserving)
def test_a_motion_without_losses_conserves_energy_and_is_reversible(case):
    p, y0 = free(case)
    ys = moved(p, y0)
    assume(np.all(np.isfinite(ys)))
    np.testing.assert_allclose(energy(p, ys), energy(p, y0[None])[0], rtol=1e-9, atol=1e-15)
    back = moved(p, RATES * ys[-1])
    np.testing.assert_allclose(RATES * back[-1], y0, atol=1e-5 * np.max(np.abs(y0)))


designs = st.tuples(
    st.floats(0.1, 0.4),  # nu
    st.floats(0.01, 0.3),  # mu
    st.floats(0.1, 1.5),  # lam
    st.floats(0.05, 1.0),  # zeta
    st.floats(0.02, 0.1),  # k
    st.floats(0.1, 0.5),  # f
    st.floats(1.0, 5.0),  # xi
    st.floats(0.8, 1.0),  # e
)


@bounded(40)
@given(designs, st.floats(0.1, 10.0))
def test_scaling_all_moments_scales_all_angles(x, factor):
    # Of the bare block: phi'' = phi - s nu - sigma k - f sin(xi tau) is homogeneous in (phi, nu, k, f).
    nu, _, _, _, k, f, xi, e = x
    rho = 0.75 / (1.0 + nu**2)
    assume(nu * factor < 0.5)

    def settled(c):
        p = Parameters(nu=c * nu, mu=0.0, lam=1.0, zeta=0.1, k=c * k, f=c * f, xi=xi, rho=rho, e=e)
        return steady_state(p)

    one, two = settled(1.0), settled(factor)
    assert status_name(two.status) == status_name(one.status)
    assume(status_name(one.status) in names_of(SETTLED))
    assert float(two.amplitude) == pytest.approx(factor * float(one.amplitude), rel=1e-8)


@bounded(40)
@given(designs)
def test_a_motion_settles_at_rest_only_if_the_uplift_margin_is_positive(x):
    margin = float(theory.uplift(parameters(x)).margin)
    assume(abs(margin) > 1e-6)
    found = solve(x)
    assume(found.status in names_of(SETTLED))
    assert (found.status == "rest") == (found.amplitude == 0.0)
    if found.status == "rest":
        assert margin > 0.0


@bounded(40)
@given(designs, st.floats(0.05, 1.0), st.floats(0.1, 1.5))
def test_a_bob_without_mass_does_not_change_the_block(x, zeta, lam):
    nu, _, _, _, *others = x
    one = solve((nu, 0.0, 1.0, 0.1, *others))
    two = solve((nu, 0.0, lam, zeta, *others))
    assert one.status == two.status
    assume(one.status in names_of(SETTLED))
    assert two.amplitude == pytest.approx(one.amplitude, rel=1e-9)


@bounded(30)
@given(designs)
def test_a_derivative_of_the_amplitude_equals_its_difference_quotient_or_is_nan(x):
    found = solve(x)
    assume(found.status in names_of(SETTLED) and found.amplitude > 0.0)
    for i, size in enumerate(x):
        step = 1e-5 * size
        assume(i != 7 or size + step <= 1.0)
        sides = [solve([*x[:i], size + h * step, *x[i + 1 :]]) for h in (1.0, -1.0, 0.5, -0.5)]
        assume(all(s.status == found.status for s in sides))
        up, down, half_up, half_down = (s.amplitude for s in sides)
        coarse, fine = (up - down) / (2.0 * step), (half_up - half_down) / step
        scale = abs(fine) + found.amplitude / size
        # Where two steps disagree an event comes or goes, or another motion is reached, between them.
        assume(abs(coarse - fine) < 1e-5 * scale)
        assert found.slopes[0, i] == pytest.approx(fine, abs=1e-5 * scale)


@pytest.mark.parametrize("equations", ["linear", "nonlinear"])
def test_runs_do_not_depend_on_threads_or_batch(equations):
    p = parameters((0.25, 0.1, 0.15, 0.3, 0.05, 0.377, 2.67))
    ensemble = Ensemble(size=48, seed=3, periods=12)
    one = outcomes(p, ensemble=ensemble, equations=equations, workers=1)
    two = outcomes(p, ensemble=ensemble, equations=equations, workers=2)
    for name in ("outcome", "tilt", "settled_tilt", "swing", "settled_swing"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
