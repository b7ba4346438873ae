"""The bob as a body: its size, its reach inside the block, its own inertia."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd.scene.bob import STEEL, Bob

BALL, SLIM, FLAT = Bob(), Bob(shape="cylinder", aspect=3.0), Bob(shape="cylinder", aspect=0.25)
ALL = pytest.mark.parametrize("bob", [BALL, SLIM, FLAT], ids=["ball", "slim", "flat"])
MASS, LENGTH = 40.0, 0.5


def outline(bob, mass):
    """Points of the surface in the plane of the motion, from the bob's centre: across and along the rod."""
    radius, half = float(bob.radius(mass)), float(bob.half_height(mass))
    if bob.shape == "ball":
        angle = np.linspace(0.0, 2.0 * np.pi, 20001)
        return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.array([(s * radius, t * half) for s in (-1, 1) for t in (-1, 1)])


@ALL
def test_radius_and_height_of_a_bob_give_its_mass(bob):
    r, h = float(bob.radius(MASS)), 2.0 * float(bob.half_height(MASS))
    volume = 4.0 / 3.0 * math.pi * r**3 if bob.shape == "ball" else math.pi * r**2 * h
    assert volume * STEEL == pytest.approx(MASS, rel=1e-12)
    assert h / (2.0 * r) == pytest.approx(1.0 if bob.shape == "ball" else bob.aspect, rel=1e-12)
    lead = dataclasses.replace(bob, density=11340.0)
    assert lead.radius(MASS) / r == pytest.approx((STEEL / 11340.0) ** (1.0 / 3.0), rel=1e-12)
    np.testing.assert_allclose(bob.radius(np.array([1.0, 8.0])), bob.radius(1.0) * np.array([1.0, 2.0]))
    assert bob.radius(0.0) == 0.0


@ALL
@pytest.mark.parametrize("length", [0.15, 0.5, 2.0])
def test_the_reach_of_a_bob_is_its_largest_offset_up_to_an_angle(bob, length):
    points = outline(bob, MASS)
    for most in (0.0, 0.7, 1.57, 2.0, 3.0):
        # The rod hangs down at angle zero: a point at (across, along) turns with it about the hinge.
        angles = np.linspace(0.0, most, 4001 if bob.shape == "cylinder" else 401)
        across, along = points[:, 0], length - points[:, 1]
        far = across[:, None] * np.cos(angles) + along[:, None] * np.sin(angles)
        assert bob.reach(MASS, length, most) == pytest.approx(far.max(), rel=1e-5)
    slopes = jax.jit(jax.jacfwd(lambda x: bob.reach(*x)))(np.array([MASS, length, 0.6]))
    for axis, slope in enumerate(slopes):
        x = np.array([MASS, length, 0.6]) * (1.0 + 1e-6 * np.array([[1.0], [-1.0]]) * np.eye(3)[axis])
        difference = np.subtract(*bob.reach(*x.T)) / np.subtract(*x[:, axis])
        assert slope == pytest.approx(difference, rel=1e-7, abs=1e-8), axis


@ALL
def test_the_moment_of_inertia_of_a_bob_is_that_of_the_solid(bob):
    """About a line across the rod through the centre, summed over thin slices."""
    r, h = float(bob.radius(MASS)), float(bob.half_height(MASS))
    z = np.linspace(-h, h, 200001)
    section = r**2 - z**2 if bob.shape == "ball" else np.full_like(z, r**2)
    # A disc of radius s has s^2/4 about its diameter, and z^2 by its distance.
    own = np.trapezoid(section * (0.25 * section + z**2), z) / np.trapezoid(section, z)
    assert bob.inertia_share(MASS, LENGTH) == pytest.approx(own / LENGTH**2, rel=1e-8)


def test_a_bob_is_described_with_its_material_and_must_be_possible():
    assert str(BALL) == "a solid ball of steel"
    assert str(SLIM) == "a solid cylinder of steel, 3 times as high as wide"
    assert str(Bob(density=11340.0)) == "a solid ball of 11340 kg/m³"
    for wrong, message in (
        ({"shape": "cube"}, "`shape` must be .*ball.*cylinder.* but is 'cube'"),
        ({"density": 1.0}, r"`density` must be between 100 and 25000 kg/m\^3, but is 1"),
        ({"shape": "cylinder", "aspect": 0.01}, r"`aspect` must be between 0\.1 and 20, but is 0\.01"),
    ):
        with pytest.raises(ValueError, match=message):
            Bob(**wrong)


@pytest.mark.parametrize("bob", [BALL, Bob(shape="cylinder", aspect=1.5)], ids=str)
def test_a_bob_as_built_has_the_moments_of_the_equivalent_point_mass(bob):
    """About the hinge S = m l and I = m l^2: it swings as often, and pulls and is damped alike."""
    g, mass, length = 9.81, 571.0, 0.5212
    body, at = bob.built(mass, length, g)
    r, i = bob.rod_share(at, g), bob.inertia_share(body, at)
    assert body * at * (1.0 + 0.5 * r) == pytest.approx(mass * length, rel=1e-10)
    assert body * at**2 * (1.0 + i + r / 3.0) == pytest.approx(mass * length**2, rel=1e-9)
    assert body > mass
    assert at < length
    # The rod carries ten times the weight of the bob.
    assert r == pytest.approx(10.0 * g * STEEL * at / 2e8, rel=1e-12)
    assert np.isnan(bob.built(552.6, 0.1, g)).all(), "no such body swings as so short a pendulum"


@ALL
def test_bobs_of_arrays_equal_single_bobs_and_have_correct_derivatives(bob):
    g, mass, length = 9.81, np.array([[0.5], [50.0], [571.0]]), np.array([0.05, 0.3, 0.5212, 2.0, 12.0])
    body, at = bob.built(mass, length, g)
    pairs = [np.broadcast_to(x, body.shape).ravel() for x in (mass, length)]
    by = jax.jit(jax.vmap(jax.jacfwd(lambda m, x: jnp.stack(bob.built(m, x, g)), (0, 1))))(*pairs)
    slopes = np.reshape(by, (2, *body.shape, 2)).transpose(3, 0, 1, 2)
    single = np.array([[bob.built(float(m), float(x), g) for x in length] for m in mass[:, 0]])
    np.testing.assert_allclose(np.stack([body, at], axis=-1), single, rtol=1e-14)
    known = np.isfinite(body)
    assert known.any()
    assert np.all(known == np.isfinite(at))
    for i, step in enumerate((1e-5 * mass, 1e-5 * length)):
        up, down = (bob.built(mass + (i == 0) * s * step, length + (i == 1) * s * step, g) for s in (1, -1))
        for j, size in enumerate((body, at)):
            exact, scale = slopes[j][i], np.abs(size / (mass, length)[i])
            error = ((up[j] - down[j]) / (2.0 * step) - exact) / scale
            np.testing.assert_allclose(error[known], 0.0, atol=1e-6)
    # A heavier point is a heavier body: a limit on the body is one on the point.
    assert np.all((body[1:] - body[:-1])[known[1:] & known[:-1]] > 0.0)
