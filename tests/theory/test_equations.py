"""The equations of motion (4) and (25), derived again from the Lagrangian."""

import dataclasses
import math
from functools import cache, partial
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import sympy as sp

from tests.reference import EventDriven, matrices, parameters
from tpd import Parameters
from tpd.scene import impacts
from tpd.theory import holding_moment
from tpd.theory.equations import Equations, Linear, Terms, smoothed_rates

NAMES = "nu mu lam rho f xi k c_p kappa tau"
NU, MU, LAM, RHO, F, XI, K, HINGE, KAPPA, TAU = SYMBOLS = sp.symbols(NAMES, positive=True)
Q = sp.symbols("phi psi")
V = sp.symbols("dphi dpsi")
A = sp.symbols("ddphi ddpsi")
SIGNS = (1, -1)
P = Parameters(nu=0.23, mu=0.17, lam=0.6, zeta=0.15, k=0.04, f=0.3, xi=2.3, rho=0.68, kappa=1.3)


@cache
def lagrange(s):
    """The two equations of motion while the tilt has the sign `s`, from kinetic and potential
    energy alone, in units M = g = b = 1 and time tau; the second divided by mu lam."""
    phi, psi = (sp.Function(q.name)(TAU) for q in Q)
    omega0 = sp.sqrt(RHO)
    base = sp.Matrix([F / (XI * omega0) ** 2 * sp.sin(XI * TAU), 0])
    turn = sp.Matrix([[sp.cos(phi), -sp.sin(phi)], [sp.sin(phi), sp.cos(phi)]])
    centre = base + turn @ sp.Matrix([s * NU, 1])
    bob = base + turn @ sp.Matrix([s * NU, KAPPA]) + LAM * sp.Matrix([sp.sin(psi), -sp.cos(psi)])
    block2, bob2 = (RHO * (r.diff(TAU).T @ r.diff(TAU))[0] for r in (centre, bob))
    gyration2 = 1 / RHO - 1 - NU**2
    kinetic = (block2 + gyration2 * RHO * phi.diff(TAU) ** 2 + MU * bob2) / 2
    energy = kinetic - centre[1] - MU * bob[1]
    rows = [energy.diff(q.diff(TAU)).diff(TAU) - energy.diff(q) for q in (phi, psi)]
    names = [(q.diff(TAU, 2), a) for q, a in zip((phi, psi), A, strict=True)]
    names += [(q.diff(TAU), v) for q, v in zip((phi, psi), V, strict=True)]
    names += list(zip((phi, psi), Q, strict=True))
    return rows[0].subs(names), (rows[1] / (MU * LAM)).subs(names)


@cache
def linearised(s):
    """The same to first order in the angles, with hinge and contact friction of sign `sigma`."""
    scale, sigma = sp.symbols("scale sigma")
    shrink = {z: scale * z for z in (*Q, *V, *A)}
    rows = [row.subs(shrink, simultaneous=True) for row in lagrange(s)]
    block, bob = (sp.expand(r.subs(scale, 0) + r.diff(scale).subs(scale, 0)) for r in rows)
    torque = HINGE * (V[0] - V[1])
    return sp.expand(block + K * sigma + MU * LAM * torque), sp.expand(bob - torque)


def parametric(s):
    """The one linear term that (14) and the package drop."""
    return s * F * (1 + MU) * NU * Q[0] * sp.sin(XI * TAU)


def numbers(p=P):
    values = (p.nu, p.mu, p.lam, p.inertia_ratio, p.f, p.xi, p.k, float(p.hinge), p.kappa)
    return dict(zip(SYMBOLS[:-1], values, strict=True))


@pytest.mark.parametrize("s", SIGNS)
def test_the_lagrangian_gives_equations_4(s):
    phi, psi = Q
    sine, c = F * sp.sin(XI * TAU), sp.cos(phi - psi)
    big_s = s * NU * sp.sin(phi - psi) + KAPPA * c
    big_c = s * NU * c - KAPPA * sp.sin(phi - psi)
    block = (1 + MU * RHO * (KAPPA**2 + NU**2)) * A[0] - MU * RHO * LAM * (big_s * A[1] - big_c * V[1] ** 2)
    block += sine * (s * (1 + MU) * NU * sp.sin(phi) + (1 + KAPPA * MU) * sp.cos(phi))
    block += s * (1 + MU) * NU * sp.cos(phi) - (1 + KAPPA * MU) * sp.sin(phi)
    bob = RHO * (LAM * A[1] - big_s * A[0] - big_c * V[0] ** 2) - sine * sp.cos(psi) + sp.sin(psi)
    for derived, printed in zip(lagrange(s), (block, bob), strict=True):
        assert sp.simplify(sp.expand(sp.expand_trig(derived - printed))) == 0


@pytest.mark.parametrize("s", SIGNS)
def test_linear_has_the_matrices_of_the_linearised_equations(s):
    for matrix, symbols in zip(matrices(Linear(P)), (A, V, Q), strict=True):
        rows = [sp.expand(r - q) for r, q in zip(linearised(s), (parametric(s), 0), strict=True)]
        expected = sp.Matrix(rows).jacobian(symbols).subs(numbers())
        np.testing.assert_allclose(matrix, np.array(expected, dtype=float), rtol=1e-14, atol=1e-16)


def test_the_mass_determinant_equals_its_short_formula():
    mass = sp.Matrix(linearised(1)).jacobian(A)
    assert sp.expand(mass.det() - LAM * RHO * (1 + MU * RHO * NU**2)) == 0
    assert Linear(P).determinant == pytest.approx(np.linalg.det(matrices(Linear(P))[0]), rel=1e-14)


@pytest.mark.parametrize("s", SIGNS)
def test_only_the_neglected_parametric_term_is_of_second_order(s):
    size = sp.symbols("size")
    small = {z: size * z for z in (*Q, *V, *A, K, F, NU)}
    block = sp.expand(linearised(s)[0].subs("sigma", 1) - MU * RHO * NU**2 * A[0])
    scaled = ((term, term.subs(small, simultaneous=True)) for term in block.as_ordered_terms())
    degrees = {term: sp.Poly(of, size).monoms()[0][0] for term, of in scaled}
    higher = sp.Add(*(term for term, degree in degrees.items() if degree > 1))
    assert sp.expand(higher - parametric(s)) == 0
    assert set(degrees.values()) == {1, 3}


@pytest.mark.parametrize("s", SIGNS)
def test_the_moment_on_a_resting_block_satisfies_the_first_equation(s):
    block, bob = (r.subs({V[0]: 0, A[0]: 0, "sigma": 0}) for r in linearised(s))
    swing = sp.solve(bob, A[1])[0]
    moment = -(block - parametric(s) - s * (1 + MU) * NU).subs(A[1], swing)
    moment = sp.lambdify((*Q, V[1], TAU), moment.subs(numbers()), "numpy")
    rng = np.random.default_rng(6)
    for (phi, psi, dpsi), tau in zip(rng.normal(size=(4, 3)), rng.uniform(0, 9, 4), strict=True):
        held = float(holding_moment(P, np.array([phi, psi, 0.0, dpsi]), tau))
        assert held == pytest.approx(moment(phi, psi, dpsi, tau), rel=1e-12)


@cache
def full(s, terms):
    """What must vanish, with friction of sign `sigma` and the hinge, as functions of the numbers."""
    sigma, torque = sp.symbols("sigma"), HINGE * (V[0] - V[1])
    block, bob = linearised(s)
    if terms is Terms.nonlinear:
        block, bob = lagrange(s)
        block, bob = block + K * sigma + MU * LAM * torque, bob - torque
    return sp.lambdify((*Q, *V, *A, TAU, sigma), [r.subs(numbers()) for r in (block, bob)], "numpy")


@pytest.mark.parametrize("terms", [Terms.parametric, Terms.nonlinear])
@pytest.mark.parametrize("s", SIGNS)
@pytest.mark.parametrize("sigma", SIGNS)
def test_rates_of_the_nonlinear_models_satisfy_the_lagrangian(s, sigma, terms):
    equations, rng = Equations(P, terms), np.random.default_rng(8)
    for y, tau in zip(rng.normal(scale=0.5, size=(5, 4)), rng.uniform(0, 9, 5), strict=True):
        rates = equations.rates(jnp.asarray(y), float(s), float(sigma), np.sin(P.xi * tau))
        np.testing.assert_allclose(rates[:2], y[2:], rtol=0)
        np.testing.assert_allclose(full(s, terms)(*y, *rates[2:], tau, sigma), 0.0, atol=1e-13)


@pytest.mark.parametrize("terms", list(Terms))
@pytest.mark.parametrize("s", SIGNS)
def test_the_moment_that_holds_a_block_balances_its_acceleration(s, terms):
    x, t = (0.23, 0.17, 0.6, 0.15, 0.04, 0.3, 2.3), 0.4
    kind = {"nonlinear": terms is Terms.nonlinear, "parametric": terms is Terms.parametric}
    loop, equations = EventDriven(x, **kind), Equations(parameters(x), terms)
    for y in np.random.default_rng(9).normal(scale=0.3, size=(5, 4)) * [1.0, 1.0, 0.0, 1.0]:
        # Friction of just this size leaves the block as it is.
        friction = loop.excess(t, y, float(s)) / loop.k
        rates = equations.rates(jnp.asarray(y), float(s), friction, math.sin(loop.xi * t))
        np.testing.assert_allclose(rates, loop.held(t, y), atol=1e-13)


def test_a_damping_ratio_of_one_is_critical_on_a_fixed_support():
    linear = Linear(Parameters(nu=0.2, mu=0.1, lam=0.7, zeta=1, k=0, f=0, xi=1))
    assert linear.c2**2 == pytest.approx(4 * linear.m22, rel=1e-14)


def energy(linear, bob, y):
    """Energy over M g b of the linear model without forcing, with `bob` mu lam: row 2 times it makes mass and
    stiffness symmetric."""
    phi, psi, dphi, dpsi = y
    kinetic = linear.m11 * dphi**2 + 2.0 * linear.m12 * dphi * dpsi + bob * linear.m22 * dpsi**2
    return 0.5 * (kinetic - linear.tilt * phi**2 + bob * psi**2) + linear.weight * jnp.abs(phi)


@pytest.mark.parametrize("s", SIGNS)
def test_energy_is_lost_only_in_the_hinge_and_the_contact(s):
    for lossy in ({"zeta": 0.0, "k": 0.0}, {"zeta": 0.2, "k": 0.0}, {"zeta": 0.0, "k": 0.05}):
        p = Parameters(nu=0.23, mu=0.17, lam=0.6, f=0, xi=2.3, **lossy)
        linear = Linear(p)
        for y in np.random.default_rng(7).normal(size=(5, 4)):
            y = jnp.asarray(y).at[0].set(s * abs(y[0]))
            slope = np.asarray(jax.grad(partial(energy, linear, p.mu * p.lam))(y))
            rates = np.asarray(linear.rates(y, float(s), float(jnp.sign(y[2])), 0.0))
            lost = p.k * abs(y[2]) + p.mu * p.lam * float(p.hinge) * (y[2] - y[3]) ** 2
            scale = np.abs(slope) @ np.abs(rates)
            assert float(slope @ rates + lost) == pytest.approx(0.0, abs=1e-13 * scale)


@pytest.mark.parametrize("e", [1.0, 0.8])
def test_a_smoothed_impact_loses_the_energy_of_an_impact(e):
    p, width = Parameters(nu=0.23, mu=0.17, lam=0.6, zeta=0.1, k=0.0, f=0.0, xi=2.3, e=e, kappa=1.3), 0.01
    ratio, across = (
        impacts.linear_ratio(*(law := (p.velocity_ratio, p.nu, p.mu, p.lam, p.inertia_ratio, p.kappa))),
        0.3,
    )
    tilts = np.linspace(-20.0 * width, 20.0 * width, 4001)
    with_loss, without = (smoothed_rates(dataclasses.replace(p, e=x), width, width) for x in (e, 1.0))
    y = jnp.stack([tilts, 0.0 * tilts, 0.0 * tilts + across, 0.0 * tilts], axis=-1)
    rates = jax.vmap(lambda y: (with_loss(0.0, y, None) - without(0.0, y, None))[2:])(y)
    # The integral over the tilt of phi''/phi'^2, which is ln(r) whatever the rate.
    change = np.trapezoid(rates, tilts, axis=0) / across**2
    kick = impacts.linear_bob_change(ratio, *law)
    assert change[0] == pytest.approx(math.log(ratio), rel=1e-9, abs=1e-15)
    assert change[1] == pytest.approx(math.log(ratio) / (ratio - 1.0) * kick if e < 1.0 else 0.0, rel=1e-9)


def test_smoothed_rates_tend_to_unsmoothed_rates_as_the_widths_vanish():
    y, tau = jnp.array([0.05, -0.2, -0.07, 0.3]), 0.7
    signs = Linear(P).rates(y, 1.0, -1.0, np.sin(P.xi * tau))
    rates = (smoothed_rates(P, width, width)(tau, y, None) for width in (0.05, 0.02, 0.01, 0.001))
    errors = [float(jnp.max(jnp.abs(x - signs))) for x in rates]
    assert errors[0] > 0.01
    assert all(after < 0.1 * before for before, after in pairwise(errors))
    assert errors[-1] < 1e-15
