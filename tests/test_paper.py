"""The paper's misprints, each proved: the right form follows from first principles, the printed one does not.

The table is in the guide, on the page `errata.md`. First principles are the Lagrangian of
`tests.theory.test_equations`, integrals done by SymPy, and the exact orbits.
"""

import re

import numpy as np
import pytest
import sympy as sp

import tests.test_paper
import tpd
from tests import printed as paper
from tests.measures import TOP
from tests.reference import orbits_of
from tests.theory.test_equations import SIGNS, SYMBOLS, A, Q, V, lagrange, linearised
from tpd import Parameters
from tpd.theory import free_motion, parametric_branches

NU, MU, LAM, RHO, F, XI, K, HINGE, KAPPA, TAU = SYMBOLS
PHI, PSI = sp.symbols("Phi Psi", real=True)
T, AMPLITUDE, GAMMA, THETA = sp.symbols("t Phi gamma theta", real=True)
EIGHT_THIRDS = sp.Rational(8, 3)
WITHOUT = Parameters(nu=0.2, mu=0.0, lam=1.0, zeta=0.1, k=0.05, f=0.1, xi=2.0)


def same(x, y):
    return sp.simplify(sp.expand(sp.expand_trig(x - y))) == 0


def frictionless(s):
    """(25) as it follows from the Lagrangian, parametric term and all."""
    return [row.subs({K: 0, HINGE: 0, KAPPA: 2}) for row in linearised(s)]


def galerkin(expression, weight):
    """Integral over a period of theta; `expression` takes theta, s = sgn cos and sigma = -sgn sin."""
    half = sp.pi / 2
    quarters = [(0, 1, -1), (1, -1, -1), (2, -1, 1), (3, 1, 1)]
    parts = (
        sp.integrate(sp.expand(expression(THETA, s, sigma) * weight), (THETA, n * half, (n + 1) * half))
        for n, s, sigma in quarters
    )
    return sp.simplify(sum(parts))


def test_every_line_of_the_table_names_a_test_that_exists():
    page = (TOP / "notebooks" / "guide" / "errata.md").read_text(encoding="utf-8")
    named = re.findall(r"`(test_\w+?)_?(?:\.\.\.)?`", page)
    assert len(named) >= 20
    for name in named:
        assert any(test.startswith(name) for test in vars(tests.test_paper)), name


@pytest.mark.parametrize("s", SIGNS)
def test_3_the_bob_rises_with_the_sign_of_the_tilt(s):
    """Kinetic energy of the bob from its position, against (3) with and without a sign."""
    a, b, l, x = sp.symbols("a b l xdot", positive=True)  # noqa: E741
    phi, psi = Q
    theta1, r1 = sp.atan2(2 * b, a), sp.sqrt(a**2 + 4 * b**2)
    place = sp.Matrix([s * a * sp.cos(phi) - 2 * b * sp.sin(phi), s * a * sp.sin(phi) + 2 * b * sp.cos(phi)])
    place += l * sp.Matrix([sp.sin(psi), -sp.cos(psi)])
    speed = place.jacobian(Q) * sp.Matrix(V) + sp.Matrix([x, 0])

    def of_3(sign):
        across = x - r1 * V[0] * sp.sin(s * phi + theta1) + l * V[1] * sp.cos(psi)
        return across**2 + (sign * r1 * V[0] * sp.cos(s * phi + theta1) + l * V[1] * sp.sin(psi)) ** 2

    true = (speed.T * speed)[0]
    assert same(true, of_3(s))
    assert same(true, of_3(1)) == (s == 1), "as printed, right for one sign only"


def test_6_j_is_about_the_centroid_and_c_its_radius():
    """A uniform rectangle that turns about its corner, its kinetic energy summed over its points."""
    a, b, x, y, mass, g = sp.symbols("a b x y M g", positive=True)
    about = sp.integrate(sp.integrate(mass / (4 * a * b) * (x**2 + y**2), (x, 0, 2 * a)), (y, 0, 2 * b))
    centroid = mass * (a**2 + b**2) / 3
    assert same(about, mass * (a**2 + b**2) + centroid), "M r0^2 + J of (4), J about the centroid"
    assert not same(about, mass * (a**2 + b**2) + about), "J about the axis would count it twice"
    rate2 = mass * g * b / about
    assert same(rate2, b * g / (a**2 + b**2 + centroid / mass)), "omega_0 with c^2 = J/M"
    assert not same(rate2, b * g / (a**2 + b**2 + (centroid / mass) ** 2)), "and not c = J/M"


def test_11_the_amplitude_has_a_reciprocal_of_cosh():
    """(10) at the quarter period, against (11) and against the motion with an inverse function."""
    t1 = sp.symbols("t_1", positive=True)
    (amplitude,) = sp.solve(NU + (AMPLITUDE - NU) * sp.cosh(t1), AMPLITUDE)
    assert same(amplitude.rewrite(sp.exp), (NU * (1 - 1 / sp.cosh(t1))).rewrite(sp.exp))
    for rate in (0.8, 1.2):
        p = Parameters(nu=0.2, mu=0.0, lam=1.0, zeta=0.0, k=0.0, f=0.0, xi=rate)
        right = float(amplitude.subs({NU: 0.2, t1: sp.pi / (2 * rate)}))
        assert float(free_motion(p).amplitude) == pytest.approx(right, rel=1e-13)
        assert abs(float(paper.printed_free_amplitude(0.2, rate)) - right) > 0.02
    assert np.isnan(paper.printed_free_amplitude(0.2, 1.6)), "no value beyond pi/2, where the block rocks too"


def parametric_share(s):
    """Of the forcing of a bare block, the part of the tilt."""
    row = sp.expand(frictionless(s)[0].subs(MU, 0))
    return sp.simplify(row.coeff(F).coeff(Q[0]) / row.coeff(F).subs(Q[0], 0))


@pytest.mark.parametrize("s", SIGNS)
def test_13_the_parametric_term_has_the_sign_of_the_tilt(s):
    assert parametric_share(s) == s * NU
    printed = -NU / -1
    assert (parametric_share(s) == printed) == (s == 1), "without a sign it is right for one of the two"


@pytest.mark.parametrize("s", SIGNS)
def test_20_parametric_term_and_forcing_carry_the_same_sign(s):
    printed = s * NU / -1
    assert parametric_share(s) == -printed, "wrong for both signs"


def motion_18(last):
    g = F / (1 + XI**2)
    grows = (AMPLITUDE - NU + K + g * sp.cos(GAMMA)) * sp.cosh(T) + XI * g * sp.sin(GAMMA) * sp.sinh(T)
    return NU - K + grows - F / (1 + last**2) * sp.cos(XI * T - GAMMA)


def test_18_has_xi_where_mu_is_printed():
    right, printed = motion_18(XI), motion_18(MU)
    equation = lambda phi: phi.diff(T, 2) - phi - (-NU + K + F * sp.cos(XI * T - GAMMA))  # noqa: E731
    assert sp.simplify(equation(right)) == 0, "(16)"
    assert sp.simplify(equation(printed)) != 0
    assert sp.simplify(right.subs(T, 0) - AMPLITUDE) == 0, "(15)"
    assert sp.simplify(printed.subs(T, 0) - AMPLITUDE) != 0


def test_19_lacks_a_sign_and_a_factor_in_the_phase():
    """Both arcs turn at their ends and cross at the quarter: what makes their rates agree there."""
    late = sp.pi / (2 * XI)
    sine, cosine = sp.symbols("sine cosine")
    g, c, s = F / (1 + XI**2), sp.cosh(late), sp.sinh(late)
    before = (AMPLITUDE - NU + K + g * cosine) * s + XI * g * sine * c
    after = (AMPLITUDE - NU - K + g * cosine) * s - XI * g * sine * c
    (found,) = sp.solve(before - after, sine)
    printed = K * (1 + XI**2) * s / (F * c)
    assert sp.simplify(found + printed / XI) == 0
    mended, as_printed = (f(WITHOUT) for f in (paper.quarter_crossing, paper.printed_quarter_crossing))
    value = float(printed.subs({K: 0.05, F: 0.1, XI: 2.0}))
    np.testing.assert_allclose(np.sin(mended.gamma), -value / 2, rtol=1e-12)
    assert value > 1, "as printed there would be no such motion"
    assert np.all(np.isnan(as_printed.gamma))
    exact = orbits_of(WITHOUT)
    off = abs(float(mended.amplitude[1] / exact.amplitude[0]) - 1)
    assert 0.05 < off < 0.15, "nor is it exact when mended"


@pytest.mark.parametrize("xi", [1.5, 4.0])
def test_19_has_one_condition_too_many_unless_there_is_no_friction(xi):
    rubbed, smooth = (Parameters(nu=0.2, mu=0.0, lam=1.0, zeta=0.1, k=k, f=0.1, xi=xi) for k in (0.05, 0.0))
    quarter, orbits = 0.5 * np.pi / xi, orbits_of(smooth)
    crossing = float(orbits_of(rubbed).crossing[0])
    assert abs(crossing / quarter - 1) > 0.01, "the block does not cross at the quarter"
    np.testing.assert_allclose(orbits.crossing[:2], quarter, rtol=1e-9)
    printed = np.sort(paper.printed_quarter_crossing(smooth).amplitude)
    np.testing.assert_allclose(printed, np.sort(orbits.amplitude[:2]), rtol=1e-9)


def equation_20(parametric):
    """The left side of (20) over theta = xi tau with the motion (21); `parametric` is the term's sign."""

    def left(theta, s, sigma):
        # cos(theta + gamma), apart: an integral of it takes SymPy ten times as long.
        push = F * (sp.cos(theta) * sp.cos(GAMMA) - sp.sin(theta) * sp.sin(GAMMA))
        phi = PHI * sp.cos(theta)
        return -(XI**2) * phi + K * sigma - phi + parametric * s * NU * phi * push + s * NU - push

    return left


def test_23_belongs_to_the_mended_equation():
    """As printed it is right, but only with the parametric term of the forcing's sign."""
    for parametric, mark in ((-1, 1), (1, -1)):
        left = equation_20(parametric)
        cosine = sp.solve(galerkin(left, sp.cos(THETA)), sp.cos(GAMMA))[0]
        sine = sp.solve(galerkin(left, sp.sin(THETA)), sp.sin(GAMMA))[0]
        third = sp.Rational(4, 3) * NU * PHI
        assert same(cosine, (4 * NU - sp.pi * PHI * (1 + XI**2)) / (F * (sp.pi + mark * 2 * third)))
        assert same(sine, 4 * K / (F * (sp.pi + mark * third)))
    found = parametric_branches(WITHOUT)
    assert np.all(found.exists)
    for amplitude, phase in zip(found.amplitude, found.phase, strict=True):
        cosine, sine = paper.printed_balance_without_pendulum(WITHOUT, float(amplitude))
        assert float(cosine**2 + sine**2) == pytest.approx(1.0, rel=1e-10)
        # -f cos(xi tau + gamma) is f sin(xi tau + phase) with gamma = phase + pi/2.
        np.testing.assert_allclose([cosine, sine], [-np.sin(phase), np.cos(phase)], atol=1e-10)


def test_24_two_of_its_integrals_have_other_values():
    sin, cos = sp.sin(THETA), sp.cos(THETA)
    by_cos = {weight: galerkin(lambda _, s, __: s, weight) for weight in (cos, cos**3, sin**2, cos * sin**2)}
    by_sin = galerkin(lambda _, __, sigma: -sigma, sin)
    assert by_cos[cos] == 4
    assert by_cos[cos**3] == sp.Rational(8, 3)
    assert by_sin == 4, "printed as -4"
    assert by_cos[sin**2] == 0, "printed as 4/3"
    assert by_cos[cos * sin**2] == sp.Rational(4, 3)
    rate = 2.5
    tau = (np.arange(100_000) + 0.5) * 2 * np.pi / rate / 100_000
    over_tau = np.mean(np.abs(np.cos(rate * tau))) * 2 * np.pi / rate
    assert over_tau == pytest.approx(4 / rate, rel=1e-6), "over tau they carry 1/omega"


def printed_25(s):
    phi, psi = Q
    sine = F * sp.sin(XI * TAU)
    block = (1 + MU * RHO * (4 + NU**2)) * A[0] - 2 * MU * RHO * LAM * A[1] - (1 + 2 * MU) * phi
    block += s * (1 + MU) * NU + (s * (1 + MU) * NU * RHO + 1 + 2 * MU) * sine
    return block, -2 * RHO * A[0] + LAM * RHO * A[1] + sine + psi


@pytest.mark.parametrize("s", SIGNS)
def test_25_row_1_has_phi_where_rho_is_printed(s):
    right, printed = frictionless(s)[0], printed_25(s)[0]
    assert not same(right, printed)
    assert same(right, printed + s * (1 + MU) * NU * (Q[0] - RHO) * F * sp.sin(XI * TAU))


@pytest.mark.parametrize("s", SIGNS)
def test_25_row_2_has_the_forcing_with_the_other_sign(s):
    right, printed = frictionless(s)[1], printed_25(s)[1]
    assert not same(right, printed)
    assert same(right, printed - 2 * F * sp.sin(XI * TAU))


def test_25_rho_counts_the_whole_moment_about_the_corner():
    """What makes the bare block's row phi'' - phi + ... in the time omega_0 t."""
    a, b, c, g = sp.symbols("a b c g", positive=True)
    for rho, right in ((b**2 / (a**2 + b**2 + c**2), True), (b**2 / c**2, False)):
        inertia = (a**2 + b**2 + c**2) * (g * rho / b) / (g * b)
        assert same(inertia, sp.Integer(1)) == right
    block = tpd.paper_scene().block
    assert block.inertia_ratio == pytest.approx(0.75 / (1 + block.slenderness**2), rel=1e-12)


def balance_27(phase=0):
    """Both rows of (25), without misprints, over theta with (26); forcing f cos(theta + phase)."""
    place = {Q[0]: PHI * sp.cos(THETA), Q[1]: PSI * sp.cos(THETA)}
    place |= {A[0]: -(XI**2) * PHI * sp.cos(THETA), A[1]: -(XI**2) * PSI * sp.cos(THETA)}
    place |= {sp.sin(XI * TAU): sp.cos(THETA + phase)}
    rows = {s: [row.subs(place) for row in frictionless(s)] for s in SIGNS}
    return [sp.expand(galerkin(lambda _, s, __, i=i: rows[s][i], sp.cos(THETA)) / sp.pi) for i in (0, 1)]


def test_26_motion_and_forcing_must_be_in_phase():
    """With the sine of (25) and the cosines of (26) no forcing would be left in (27)."""
    for row in balance_27(-sp.pi / 2):
        assert row.coeff(F) == 0
    for row in balance_27():
        assert row.coeff(F) != 0


def test_27_has_four_misprints():
    block, bob = balance_27()
    right, right_bob = (sp.expand(x.subs({PHI: -PHI, F: -F}, simultaneous=True)) for x in (block, bob))

    def row_1(inertia=1, push=1 + MU, pull=EIGHT_THIRDS):
        left = (1 + 2 * MU + (1 + MU * RHO * inertia) * XI**2 + pull * NU * F * (1 + MU)) * PHI
        return left + 2 * LAM * RHO * MU * XI**2 * PSI - F * push + 4 / sp.pi * NU * (1 + MU)

    mended = {"inertia": 4 + NU**2, "push": 1 + 2 * MU, "pull": EIGHT_THIRDS / sp.pi}
    assert same(right, row_1(**mended))
    for name in mended:
        assert not same(right, row_1(**{k: x for k, x in mended.items() if k != name})), name
    assert same(right_bob, -2 * RHO * XI**2 * PHI + (1 - LAM * RHO * XI**2) * PSI + F)
    assert not same(block, row_1(**mended)), "and the sign of Phi and f is the other one"
    p = Parameters(nu=0.15, mu=0.1, lam=0.4, zeta=0.0, k=0.0, f=0.1, xi=2.0)
    values = {NU: p.nu, MU: p.mu, LAM: p.lam, RHO: p.inertia_ratio, XI: p.xi}
    for sign, phi, psi in zip((1, -1), *paper.printed_pendulum_balance(p), strict=True):
        left = row_1().subs(values | {F: sign * p.f, PHI: float(phi), PSI: float(psi)})
        assert abs(float(left)) < 1e-14
        bob = -2 * p.inertia_ratio * p.xi**2 * phi + (1 - p.lam * p.inertia_ratio * p.xi**2) * psi
        assert float(bob) == pytest.approx(-sign * p.f, rel=1e-12)


def test_table_1_divides_the_length_by_the_whole_height():
    """A bob under a still block swings at g/l: so it is l/b, not l/2b, that (25) calls lambda."""
    l, b, g = sp.symbols("l b g", positive=True)  # noqa: E741
    row = frictionless(1)[1].subs(F, 0)
    rate2 = row.coeff(Q[1]) / row.coeff(A[1]) * g * RHO / b
    assert same(rate2.subs(LAM, l / b), g / l)
    assert not same(rate2.subs(LAM, l / (2 * b)), g / l)
    bob = lagrange(1)[1].subs({F: 0, V[0]: 0, A[0]: 0})
    assert same(bob, RHO * LAM * A[1] + sp.sin(Q[1]))
