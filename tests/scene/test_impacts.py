"""The law of impacts stands in one place: another law there is another law everywhere."""

import itertools
import json
import os
import subprocess
import sys

import numpy as np
import pytest

from tpd.scene import impacts
from tpd.scene.impacts import housner

PROGRAM = """
import dataclasses, json, sys
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
from tpd.scene import impacts

def other(e, nu, mu, lam, rho, side, sine, cosine):
    return e * (1.0 - mu * nu)

if sys.argv[1] == "other":
    impacts.velocity_ratio = other
import tpd
from tpd.theory.equations import Terms
from tpd.scene.parameters import as_arrays
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, follow
hung = tpd.Pendulum(mass=1.0, length=0.1, damping_ratio=0.1)
p = dataclasses.replace(tpd.paper_scene().parameters(hung), e=float(sys.argv[2]))
start = [0.2, 0.0, 0.0, 0.0]
orbit = tpd.symmetric_orbits(p)
exact = lambda q: tpd.steady_state(q, y0=start).amplitude
print(json.dumps({name: float(value) for name, value in {
    "exact": exact(p),
    "slope": jax.grad(exact)(as_arrays(p)).xi,
    "orbit": orbit.amplitude[0],
    "multiplier": abs(orbit.multipliers[0][0]),
    "smoothed": tpd.steady_state(p, y0=start, model=tpd.Smoothed()).amplitude,
    "friction": tpd.theory.equivalent_friction(p, 0.1),
    "nonlinear": follow(Terms.nonlinear, row_of(p), HarmonicForcing(), y0=np.array(start)).settled_tilt,
}.items()}))
"""
E = 0.9
SAME = E * (1.0 - 0.25 / 16.224)
"""Ratio with which the usual law is the other one, for mass ratio and slenderness of the paper's block."""


def run(folder, law, e):
    # Compiled code of another law must not be stored for the next process.
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    call = [sys.executable, "-W", "ignore", "-c", PROGRAM, law, repr(e)]
    return subprocess.Popen(call, stdout=subprocess.PIPE, text=True, env=environment)


@pytest.mark.slow
def test_all_models_use_one_impact_law(tmp_path):
    runs = [run(tmp_path / n, n, e) for n, e in (("other", E), ("usual", SAME))]
    other, usual = (json.loads(r.communicate(timeout=900)[0]) for r in runs)
    nonlinear = other.pop("nonlinear"), usual.pop("nonlinear")
    assert other == pytest.approx(usual, rel=1e-9)
    # With the bob at an angle the usual ratio of (4) depends on it.
    assert nonlinear[0] == pytest.approx(nonlinear[1], rel=0.05)
    assert nonlinear[0] != pytest.approx(nonlinear[1], rel=1e-6)


def struck(nu, rho):
    """Velocity ratio of a block of half height 1 and unit mass that turns about its left corner at a rate of
    1 when its right corner strikes: from the angular momentum about that corner, which it keeps."""
    radius2 = 1 / rho - 1 - nu**2
    centre, left, right = np.array([0.0, 1.0]), np.array([-nu, 0.0]), np.array([nu, 0.0])

    def momentum(pivot, about):
        arm, velocity = centre - about, np.array([-(centre - pivot)[1], (centre - pivot)[0]])
        return radius2 + arm[0] * velocity[1] - arm[1] * velocity[0]

    return momentum(left, right) / momentum(right, right)


@pytest.mark.parametrize(("nu", "rho"), [(0.1, 0.74), (0.25, 0.6), (0.5, 0.6), (0.4, 0.8)])
def test_housners_restitution_conserves_angular_momentum_about_the_new_corner(nu, rho):
    assert housner(nu, rho) == pytest.approx(struck(nu, rho), rel=1e-14)


IMPACTS = pytest.mark.parametrize(
    ("side", "psi", "kappa"), [*itertools.product([-1.0, 1.0], [-1.2, 0.3, 2.0], [0.7, 2.0])]
)


@IMPACTS
def test_an_impact_includes_the_momentum_of_the_bob_along_its_rod(side, psi, kappa):
    nu, mu, lam, rho, e, sine, cosine = 0.23, 0.17, 0.6, 0.68, 0.8, np.sin(psi), np.cos(psi)
    after, before, share = kappa * sine - side * nu * cosine, kappa * sine + side * nu * cosine, mu * rho
    kept = e * (1 + share * nu**2) + share * nu**2
    law = e, nu, mu, lam, rho, kappa, side, sine, cosine
    ratio = impacts.velocity_ratio(*law)
    assert ratio == pytest.approx((kept + share * after * before) / (1 + share * after**2), rel=1e-13)
    change = impacts.bob_change(ratio, e, nu, lam, kappa, side, sine, cosine)
    expected = (kappa * cosine * (ratio - 1) + side * nu * sine * (ratio + 1)) / lam
    assert change == pytest.approx(expected, rel=1e-12)


@IMPACTS
def test_an_impact_adds_no_energy_and_keeps_the_transverse_speed_of_the_bob(side, psi, kappa):
    nu, mu, lam, rho, swing = 0.3, 0.4, 0.5, 0.7, 0.8
    sine, cosine = np.sin(psi), np.cos(psi)

    def speeds(rate, swing, foot):
        """Of the bob along the rod and across it: the hinge moves at -kappa sideways and foot nu upwards."""
        x, z = -kappa * rate + lam * cosine * swing, foot * nu * rate + lam * sine * swing
        return x * sine - z * cosine, x * cosine + z * sine

    along, across = speeds(1.0, swing, side)
    before = 1.0 / rho + mu * (along**2 + across**2)
    for e in (0.2, 0.8, 0.97, 0.9999):
        law = e, nu, mu, lam, rho, kappa, side, sine, cosine
        ratio = impacts.velocity_ratio(*law)
        change = impacts.bob_change(ratio, e, nu, lam, kappa, side, sine, cosine)
        along, after = speeds(ratio, swing + change, -side)
        assert after == pytest.approx(across, abs=1e-14)
        assert ratio**2 / rho + mu * (along**2 + after**2) <= before * (1 + 1e-14)
    # Without loss nothing happens at all.
    assert impacts.velocity_ratio(1.0, nu, mu, lam, rho, kappa, side, sine, cosine) == 1.0
    assert impacts.bob_change(1.0, 1.0, nu, lam, kappa, side, sine, cosine) == 0.0
