"""The table of equations in the docstring of `tpd`: every function in it is there and computes its equation.

Each formula is written out once more, for plain numbers, and compared at one point away from any symmetry.
"""

import inspect
import math
import pkgutil
import re
from dataclasses import replace
from importlib import import_module
from operator import attrgetter

import numpy as np
import pytest

import tpd
from tpd.answers.steady_state import simulate
from tpd.answers.symmetric_orbits import symmetric_orbits
from tpd.scene.impacts import bob_change, housner, velocity_ratio
from tpd.theory import equivalent_friction, free_motion, one_harmonic_branches, parametric_branches, uplift
from tpd.theory.equations import Equations, Linear, Terms

NU, MU, LAM, ZETA, K, F, XI, RHO = 0.23, 0.17, 0.6, 0.15, 0.04, 0.3, 2.3, 0.68
HINGE = 2.0 * ZETA * math.sqrt(LAM * RHO)
P = tpd.Parameters(nu=NU, mu=MU, lam=LAM, zeta=ZETA, k=K, f=F, xi=XI, rho=RHO)
WITHOUT = replace(P, mu=0.0, k=0.0, f=0.1)
# Tilt, angle of the bob and their rates; the block leans to the left and moves to the right.
PHI, PSI, DPHI, DPSI = Y = np.array([-0.11, 0.3, 0.2, -0.5])
S, SIGMA, SINE = -1.0, 1.0, 0.8
ROWS = re.findall(r"^\| ([^|]+) \| [^|]+ \| (\w+/\w+): ([\w., ]+) \|$", tpd.__doc__ or "", re.MULTILINE)


def terms_4(mu, a, b):
    """Left sides of (4), with accelerations a of the tilt and b of the bob's angle."""
    lean = PHI - PSI
    big_s = S * NU * math.sin(lean) + 2 * math.cos(lean)
    big_c = S * NU * math.cos(lean) - 2 * math.sin(lean)
    block = (1 + mu * RHO * (4 + NU**2)) * a - mu * RHO * LAM * (big_s * b - big_c * DPSI**2)
    block += F * SINE * (S * (1 + mu) * NU * math.sin(PHI) + (1 + 2 * mu) * math.cos(PHI))
    block += S * (1 + mu) * NU * math.cos(PHI) - (1 + 2 * mu) * math.sin(PHI)
    block += K * SIGMA + mu * LAM * HINGE * (DPHI - DPSI)
    bob = LAM * RHO * b - RHO * (big_s * a + big_c * DPHI**2)
    return block, bob - F * math.cos(PSI) * SINE + math.sin(PSI) + HINGE * (DPSI - DPHI)


def terms_25(a, b):
    """Left sides of (25) without its parametric term."""
    block = (1 + MU * RHO * (4 + NU**2)) * a - 2 * MU * RHO * LAM * b - (1 + 2 * MU) * PHI
    block += S * (1 + MU) * NU + F * (1 + 2 * MU) * SINE + K * SIGMA + MU * LAM * HINGE * (DPHI - DPSI)
    return block, -2 * RHO * a + LAM * RHO * b + PSI - F * SINE + HINGE * (DPSI - DPHI)


def equations():
    a, b = Equations(P, Terms.nonlinear).rates(Y, S, SIGMA, SINE)[2:]
    np.testing.assert_allclose(terms_4(MU, a, b), 0.0, atol=1e-14)
    without = replace(P, mu=0.0)
    a = Equations(without, Terms.nonlinear).rates(Y, S, SIGMA, SINE)[2]
    # (12) over M g b, with the friction of (14).
    forced = a + F * SINE * (S * NU * math.sin(PHI) + math.cos(PHI)) + S * NU * math.cos(PHI) - math.sin(PHI)
    assert forced + K * SIGMA == pytest.approx(0.0, abs=1e-14)
    # (14): first order in the tilt, and the parametric term.
    a = Equations(without, Terms.parametric).rates(Y, S, SIGMA, SINE)[2]
    assert a == pytest.approx(PHI - S * NU - F * SINE * (1 + S * NU * PHI) - K * SIGMA, rel=1e-14)


def no_uplift():
    found = uplift(P)
    # The moment of the base motion and of the settled bob on a block at rest, over a period.
    d = 1 - LAM * RHO * XI**2 + 1j * XI * HINGE
    moment = 1 + 2 * MU + (2 * MU * RHO * LAM * XI**2 - 1j * XI * MU * LAM * HINGE) / d
    assert found.margin == pytest.approx(1 - abs(moment) * F / ((1 + MU) * NU + K), rel=1e-14)
    assert found.swing == pytest.approx(F / abs(d), rel=1e-14)
    # (5): alpha omega^2 > g a/b lifts the bare block.
    assert uplift(WITHOUT).margin == pytest.approx(1 - 0.1 / NU, rel=1e-14)


BLOCK = tpd.Block(width=0.9, height=3.0, mass=2000.0, radius_of_gyration=0.95)
C2 = 0.45**2 + 1.5**2 + 0.95**2


def rate():
    scene = tpd.Scene(BLOCK, tpd.Harmonic(amplitude=0.1, frequency=1.0), gravity=9.7)
    # (6): omega_0^2 = M g b over the inertia about the corner.
    assert scene.rate == pytest.approx(math.sqrt(9.7 * 1.5 / C2), rel=1e-14)


def inertia():
    assert BLOCK.inertia_ratio == pytest.approx(1.5**2 / C2, rel=1e-14)
    plain = tpd.Block(width=0.9, height=3.0, mass=2000.0)
    assert plain.inertia_ratio == pytest.approx(3 / (4 * (1 + 0.3**2)), rel=1e-14)


def free():
    # (10) at its end: nu + (Phi - nu) cosh(tau) vanishes a quarter of a period after the turn.
    phi = float(free_motion(WITHOUT).amplitude)
    assert NU + (phi - NU) * math.cosh(math.pi / (2 * XI)) == pytest.approx(0.0, abs=1e-14)
    assert phi == pytest.approx(NU * (1 - 1 / math.cosh(math.pi / (2 * XI))), rel=1e-13)


def arc():
    # (18) with the forcing f sin(xi tau), from a turn at tau = 0 and before the first event.
    phi, tau, g = 0.2 * NU, 0.3, 0.1 / (1 + XI**2)
    at = NU + (phi - NU) * math.cosh(tau) + g * (math.sin(XI * tau) - XI * math.sinh(tau))
    found = simulate(WITHOUT, np.array([phi, 0.0, 0.0, 0.0]), np.array([0.0, tau])).ys[1, 0]
    assert 0 < at < phi
    assert float(found) == pytest.approx(at, rel=1e-12)


def orbit():
    # Without friction (19) is exact: sin gamma = 0.
    base, g = NU * (1 - 1 / math.cosh(math.pi / (2 * XI))), 0.1 / (1 + XI**2)
    found = np.asarray(symmetric_orbits(WITHOUT).amplitude)
    assert np.nanmin(np.abs(found - (base + g))) < 1e-12
    assert np.nanmin(np.abs(found - (base - g))) < 1e-12


def bare_balance():
    for phi in map(float, parametric_branches(replace(WITHOUT, k=K)).amplitude):
        # (23).
        cosine = (4 * NU - math.pi * phi * (1 + XI**2)) / (0.1 * (math.pi + 8 / 3 * NU * phi))
        sine = 4 * K / (0.1 * (math.pi + 4 / 3 * NU * phi))
        assert cosine**2 + sine**2 == pytest.approx(1.0, rel=1e-10)


def linear():
    a, b = Linear(P).rates(Y, S, SIGMA, SINE)[2:]
    np.testing.assert_allclose(terms_25(float(a), float(b)), 0.0, atol=1e-14)


def balance():
    # (27) of the undamped pair without friction, for the two signs of the forcing.
    p = replace(P, zeta=0.0, k=0.0, f=0.1)
    matrix = [
        [-(1 + MU * RHO * (4 + NU**2)) * XI**2 - (1 + 2 * MU), 2 * MU * RHO * LAM * XI**2],
        [2 * RHO * XI**2, 1 - LAM * RHO * XI**2],
    ]
    signs = [-4 / math.pi * (1 + MU) * NU, 0.0]
    both = [np.linalg.solve(matrix, np.array([-f * (1 + 2 * MU), f]) + signs) for f in (0.1, -0.1)]
    found = one_harmonic_branches(p)
    expected = sorted((phi, abs(psi)) for phi, psi in both)
    found = sorted(zip(map(float, found.amplitude), map(float, found.swing), strict=True))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def of_housner():
    expected = (1 - RHO * NU**2 * (2 + MU)) / (1 + MU * RHO * NU**2)
    assert housner(NU, RHO, MU) == pytest.approx(expected, rel=1e-14)
    # Any e and any angle of the bob: momentum of both about the new corner, and of the bob across its rod.
    assert velocity_ratio(0.8, NU, MU, LAM, RHO, S, 0.0, 1.0) == pytest.approx(0.8, rel=1e-14)


def impact(e=0.8):
    sine, cosine = math.sin(PSI), math.cos(PSI)
    after, before = 2 * sine - S * NU * cosine, 2 * sine + S * NU * cosine
    share = MU * RHO
    kept = e * (1 + share * NU**2) + share * NU**2
    expected = (kept + share * after * before) / (1 + share * after**2)
    ratio = velocity_ratio(e, NU, MU, LAM, RHO, S, sine, cosine)
    assert ratio == pytest.approx(expected, rel=1e-13)
    change = 2 * cosine * (expected - 1) + S * NU * sine * (expected + 1)
    assert bob_change(ratio, e, NU, MU, LAM, RHO, S, sine, cosine) == pytest.approx(change / LAM, rel=1e-12)


def friction():
    p = replace(WITHOUT, f=F, e=0.9)
    # 4 k Phi = two impacts, each of (1 - e^2) (nu Phi - Phi^2/2).
    lost = 2 * (1 - 0.9**2) * (NU * 0.1 - 0.1**2 / 2)
    assert equivalent_friction(p, 0.1) == pytest.approx(lost / (4 * 0.1), rel=1e-13)


CHECKS = {
    "Equations": equations,
    "uplift": no_uplift,
    "Scene.rate": rate,
    "Block.inertia_ratio": inertia,
    "free_motion": free,
    "simulate": arc,
    "symmetric_orbits": orbit,
    "parametric_branches": bare_balance,
    "Linear": linear,
    "one_harmonic_branches": balance,
    "housner": of_housner,
    "velocity_ratio": impact,
    "bob_change": impact,
    "equivalent_friction": friction,
}


def test_every_equation_has_a_row_and_every_function_a_check():
    numbers = " ".join(equation for equation, _, _ in ROWS)
    named = {int(n) for n in re.findall(r"\((\d+)\)", numbers)}
    for first, last in re.findall(r"\((\d+)\) to \((\d+)\)", numbers):
        named |= set(range(int(first), int(last) + 1))
    # (1) to (3) lead to (4), (8) and (15) are starts of (9) and (16).
    assert named | {15} == set(range(4, 28))
    assert {name for _, _, names in ROWS for name in names.split(", ")} == set(CHECKS)


@pytest.mark.parametrize(("place", "names"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_the_functions_of_a_row_compute_its_equation(place, names):
    module = import_module(f"tpd.{place.replace('/', '.')}")
    for name in names.split(", "):
        found = attrgetter(name)(module)
        assert isinstance(found, property) or found.__module__ == module.__name__
        CHECKS[name]()


def test_every_public_formula_is_a_function_also_after_its_module_was_imported():
    for module in pkgutil.iter_modules(tpd.theory.__path__):
        import_module(f"tpd.theory.{module.name}")
    assert all(inspect.isfunction(getattr(tpd.theory, name)) for name in tpd.theory.__all__)
