"""The law of impacts: momentum and energy of the block and its bob."""

import itertools

import numpy as np
import pytest

from tpd.scene import impacts
from tpd.scene.impacts import housner


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
