"""From SI units to the dimensionless parameters, and what a scene refuses."""

import jax
import numpy as np
import pytest

from tpd import Block, Harmonic, Parameters, Pendulum, Scene, paper_scene
from tpd.core.scene import STANDARD_GRAVITY, housner

BLOCK = {"width": 0.1, "height": 0.4, "mass": 16.224}
MOTION = {"amplitude": 0.015, "frequency": 2.5}
PENDULUM = {"mass": 1.6, "length": 0.1, "damping_ratio": 0.1}


def test_the_paper_s_case_study_in_its_own_numbers():
    # Collini et al., section 5: 0.1 m by 0.4 m, 15 mm at 2.5 Hz; worked out by hand from (1) to (6).
    p = paper_scene().parameters()
    rho = 0.75 / (1 + 0.25**2)
    assert p.nu == pytest.approx(0.25, rel=1e-14)
    assert p.inertia_ratio == pytest.approx(rho, rel=1e-14)
    assert p.f == pytest.approx(0.015 * (2 * np.pi * 2.5) ** 2 / 9.80665, rel=1e-14)
    assert p.f == pytest.approx(0.3774, abs=5e-5)
    assert p.xi == pytest.approx(2 * np.pi * 2.5 / np.sqrt(9.80665 * rho / 0.2), rel=1e-14)
    assert p.xi == pytest.approx(2.67, abs=5e-3)
    assert p.k == 0.05
    assert p.e == 1.0


def test_the_paper_s_block_has_the_mass_of_its_density():
    assert paper_scene().block.mass == pytest.approx(2028 * 0.1 * 0.2 * 0.4, rel=1e-12)


def test_a_scene_without_pendulum_is_the_bare_block():
    p = paper_scene().parameters()
    assert p.mu == 0.0
    assert p.rho is None


def test_a_pendulum_in_si_becomes_the_ratios_it_was_made_from():
    scene = paper_scene()
    pendulum = scene.pendulum(mass_ratio=0.1, length_ratio=0.8, damping_ratio=0.07)
    assert pendulum.mass == pytest.approx(1.6224, rel=1e-14)
    assert pendulum.length == pytest.approx(0.16, rel=1e-14)
    p = scene.parameters(pendulum)
    assert (p.mu, p.lam, p.zeta) == pytest.approx((0.1, 0.8, 0.07), rel=1e-14)


def test_the_length_ratio_counts_half_heights():
    # lam = l/b, while the paper's Table 1 lists l/(2b).
    p = paper_scene().parameters(Pendulum(mass=1.0, length=0.4, damping_ratio=0.1))
    assert p.lam == pytest.approx(2.0, rel=1e-14)


def test_another_gravity_and_size_scale_the_forcing_and_not_the_block():
    small = paper_scene().parameters()
    large = Scene(
        Block(width=1.0, height=4.0, mass=3.0),
        Harmonic(amplitude=0.15, frequency=2.5),
        gravity=10 * STANDARD_GRAVITY,
    ).parameters()
    assert jax.tree.leaves(large) == pytest.approx(jax.tree.leaves(small), rel=1e-12)


def test_the_radius_of_gyration_of_a_rectangle_changes_nothing_but_the_tie():
    radius = np.sqrt((0.05**2 + 0.2**2) / 3)
    scene = Scene(Block(**BLOCK, radius_of_gyration=radius), Harmonic(**MOTION))
    p, tied = scene.parameters(), paper_scene().parameters()
    assert p.rho == pytest.approx(tied.inertia_ratio, rel=1e-14)
    assert p.xi == pytest.approx(tied.xi, rel=1e-14)


def test_a_larger_radius_of_gyration_makes_a_slower_block():
    # rho = b^2 / (a^2 + b^2 + c^2), with c about the centroid.
    block = Block(**BLOCK, radius_of_gyration=0.2)
    assert block.inertia_ratio == pytest.approx(0.04 / (0.0025 + 0.04 + 0.04), rel=1e-14)
    assert Scene(block, Harmonic(**MOTION)).rate < paper_scene().rate


@pytest.mark.parametrize(
    ("make", "good", "name", "value", "allowed"),
    [
        (Block, BLOCK, "width", -0.1, "positive and finite"),
        (Block, BLOCK, "width", 0.0, "positive and finite"),
        (Block, BLOCK, "height", 0.0, "positive and finite"),
        (Block, BLOCK, "height", np.inf, "positive and finite"),
        (Block, BLOCK, "mass", np.nan, "positive and finite"),
        (Block, BLOCK, "mass", -1.0, "positive and finite"),
        (Block, BLOCK, "friction", -0.01, "zero or positive, and finite"),
        (Block, BLOCK, "radius_of_gyration", 0.0, "positive and finite"),
        (Block, BLOCK, "restitution", 0.0, "positive and finite"),
        (Block, BLOCK, "restitution", -0.5, "positive and finite"),
        (Block, BLOCK, "restitution", np.nan, "positive and finite"),
        (Block, BLOCK, "restitution", 1.01, "between 0 and 1"),
        (Pendulum, PENDULUM, "mass", -1.0, "zero or positive, and finite"),
        (Pendulum, PENDULUM, "length", 0.0, "positive and finite"),
        (Pendulum, PENDULUM, "length", np.nan, "positive and finite"),
        (Pendulum, PENDULUM, "damping_ratio", -0.1, "zero or positive, and finite"),
        (Harmonic, MOTION, "amplitude", -0.015, "zero or positive, and finite"),
        (Harmonic, MOTION, "amplitude", np.nan, "zero or positive, and finite"),
        (Harmonic, MOTION, "frequency", 0.0, "positive and finite"),
        (Harmonic, MOTION, "frequency", -2.5, "positive and finite"),
    ],
)
def test_sizes_out_of_range_are_refused_by_name(make, good, name, value, allowed):
    with pytest.raises(ValueError, match=f"`{name}` must be {allowed}, but is {value:g}"):
        make(**{**good, name: value})


def test_a_gravity_out_of_range_is_refused():
    with pytest.raises(ValueError, match="`gravity` must be positive and finite, but is 0"):
        Scene(Block(**BLOCK), Harmonic(**MOTION), gravity=0.0)


def test_a_block_too_wide_for_linear_equations_is_refused():
    with pytest.raises(ValueError, match=r"`width` must be at most 0\.5 of `height`.*but is 0\.6 of it"):
        Block(width=0.24, height=0.4, mass=1.0)
    assert Block(width=0.2, height=0.4, mass=1.0).slenderness == 0.5


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
def test_housner_s_ratio_keeps_the_angular_momentum_about_the_new_pivot(nu, rho):
    assert housner(nu, rho) == pytest.approx(struck(nu, rho), rel=1e-14)


def test_housner_s_ratio_of_a_rectangle_is_the_textbook_s():
    block = Block(**BLOCK, restitution="housner")
    alpha = np.arctan(0.1 / 0.4)
    assert block.velocity_ratio == pytest.approx(1 - 1.5 * np.sin(alpha) ** 2, rel=1e-14)
    assert Scene(block, Harmonic(**MOTION)).parameters().e == block.velocity_ratio


def test_housner_s_ratio_knows_the_radius_of_gyration():
    block = Block(**BLOCK, radius_of_gyration=0.2, restitution="housner")
    # I about a corner is M (a^2 + b^2 + c^2).
    assert block.velocity_ratio == pytest.approx(
        1 - 2 * np.sin(np.arctan(0.25)) ** 2 * 0.0425 / 0.0825, rel=1e-14
    )


def test_a_block_with_restitution_has_no_friction_unless_it_is_given():
    losses = {
        (): (0.05, 1.0),
        (("restitution", 0.9),): (0.0, 0.9),
        (("restitution", 1.0),): (0.0, 1.0),
        (("friction", 0.1),): (0.1, 1.0),
        (("friction", 0.02), ("restitution", 0.9)): (0.02, 0.9),
    }
    for given, expected in losses.items():
        p = Scene(Block(**BLOCK, **dict(given)), Harmonic(**MOTION)).parameters()
        assert (p.k, p.e) == expected


def test_a_restitution_of_an_unknown_name_is_refused():
    with pytest.raises(ValueError, match="`restitution` must be a number or 'housner', but is 'bouncy'"):
        Block(**BLOCK, restitution="bouncy")


def test_the_parameters_are_a_pytree_of_numbers():
    p = paper_scene().parameters()
    assert isinstance(p, Parameters)
    assert all(isinstance(x, float) for x in jax.tree.leaves(p))
