"""From SI units to the dimensionless parameters, and what a scene refuses."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Block, Harmonic, Pendulum, Scene, paper_scene
from tpd.scene.parameters import NAMES
from tpd.theory import uplift

BLOCK = {"width": 0.1, "height": 0.4, "mass": 16.224}
MOTION = {"amplitude": 0.015, "frequency": 2.5}
PENDULUM = {"mass": 1.6, "length": 0.1, "damping_ratio": 0.1}


def test_the_scene_of_the_paper_has_its_dimensionless_numbers():
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
    assert (p.e, p.mu, p.rho) == (1.0, 0.0, None)
    assert paper_scene().block.mass == pytest.approx(2028 * 0.1 * 0.2 * 0.4, rel=1e-12)
    assert (paper_scene().uplift, paper_scene().peak) == pytest.approx((0.3, float(p.f)), rel=1e-14)


def test_a_pendulum_in_si_units_has_the_ratios_of_its_definition():
    scene = paper_scene()
    # lam = l/b, while the paper's Table 1 lists l/(2b).
    pendulum = scene.pendulum(mass_ratio=0.1, length_ratio=0.8, damping_ratio=0.07)
    assert pendulum.mass == pytest.approx(1.6224, rel=1e-14)
    assert pendulum.length == pytest.approx(0.16, rel=1e-14)
    p = scene.parameters(pendulum)
    assert (p.mu, p.lam, p.zeta) == pytest.approx((0.1, 0.8, 0.07), rel=1e-14)


def sized(width, height, mass, **others):
    return Block, {"width": width, "height": height, "mass": mass, **others}


SIZES = BLOCK.values()
EARTH = Scene, {"block": Block(**BLOCK), "excitation": Harmonic(**MOTION)}
WRONG = {
    "lengths in mm": (*sized(100.0, 400.0, 16.224), "give 4.06e-06 kg/m"),
    "mass in t": (*sized(1.3, 10.0, 16.28), "are the lengths in m and the mass"),
    "mass in g": (*sized(1.3, 10.0, 16280e3), "between 10 and 500000 kg/m"),
    "height in mm": (*sized(0.5, 2500.0, 1e6), "at least 0.01 of `height`"),
    "a batch": (*sized(np.array([0.1, 100.0]), np.array([0.4, 400.0]), 16.0), "16 kg in 100 m x 400 m"),
    "a wide block": (*sized(0.3, 0.4, 48.0), "`width` must be at most 0.5 of `height`"),
    "exchanged": (*sized(0.5, 0.4, 80.0), "are width and height exchanged?"),
    "wide cavity": (
        *sized(*SIZES, cavity_width=0.1),
        "less than the width of the block, 0.1 m",
    ),
    "thin walls": (*sized(*SIZES, cavity_width=0.099), "the walls around 0.099 m have 2.04e+05 kg"),
    "gyration": (
        *sized(*SIZES, radius_of_gyration=0.207),
        "that of a mass in the corners",
    ),
    "low centroid": (*sized(*SIZES, centroid_height=0.03), "between 0.04 and 0.36 m above the base"),
    "no gyration": (*sized(*SIZES, centroid_height=0.21), "`radius_of_gyration` must be stated"),
    "frame": (*sized(*SIZES, cavity_width=0.08, frame_width=0.2), "must not be stated with `frame_width`"),
    "hinge in frame": (
        Scene(Block(**BLOCK, frame_width=0.2), Harmonic(**MOTION)).parameters,
        {"pendulum": Pendulum(**PENDULUM, hinge_height=0.4)},
        "above the top of the block, 0.4 m, in its frame, but is 0.4 m",
    ),
    "base friction": (*sized(*SIZES, base_friction=2.5), "between 0 and 2, but is 2.5"),
    "effective width": (*sized(*SIZES, effective_width=1.01), "`effective_width` must be"),
    "narrow base": (*sized(*SIZES, effective_width=0.19), "`effective_width` must be"),
    "amplitude in mm": (
        Harmonic,
        {"amplitude": 50.0, "frequency": 1.0},
        "at most 10 g, but is 201 g",
    ),
    "frequency in mHz": (Harmonic, {"amplitude": 0.081, "frequency": 850.0}, "are they in m and Hz?"),
    "damping in %": (Pendulum, {**PENDULUM, "damping_ratio": 5.0}, "a ratio: 5 % is 0.05"),
    "axis of vmap": (Pendulum, {**PENDULUM, "length": None}, "`in_axes` of `jax.vmap` must be 0, with an"),
    "gravity in cm/s2": (EARTH[0], EARTH[1] | {"gravity": 981.0}, "(on Earth it is 9.80665), but is"),
    "gravity in g": (EARTH[0], EARTH[1] | {"gravity": 1.0}, "between 1.5 and 30 m/s^2"),
    "no hinge": (Pendulum, {**PENDULUM, "hinge_height": 0.0}, "but is 0"),
    "high hinge": (
        paper_scene().parameters,
        {"pendulum": Pendulum(**PENDULUM, hinge_height=0.81)},
        "at most 0.8, twice the height of the block, but is 0.81",
    ),
    "low hinge": (Pendulum, {**PENDULUM, "hinge_height": 0.09}, "at most 0.09, the height of the hinge"),
}
"""Quantities in another unit or out of range, each with part of the sentence."""


@pytest.mark.parametrize(("make", "quantities", "said"), WRONG.values(), ids=WRONG)
def test_quantities_in_a_wrong_unit_or_out_of_range_are_rejected(make, quantities, said):
    with pytest.raises(ValueError, match=r"^`[\w.]+` ") as refused:
        make(**quantities)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_light_and_heavy_blocks_and_lunar_gravity_are_accepted():
    # Foam; a model of steel; a wall, twenty times as deep as wide; a slender chimney.
    for size in ((0.5, 1.5, 8.0), (0.02, 0.1, 0.6), (0.5, 8.0, 90e3), (2.0, 90.0, 500e3)):
        block = Block(**dict(zip(BLOCK, size, strict=True)), friction=0.01)
        scene = Scene(block, Harmonic(amplitude=0.00012, frequency=60.0), gravity=1.62)
        assert float(scene.parameters().f) > 10.0


def test_the_clear_width_of_a_block_is_its_stated_cavity():
    assert Block(**BLOCK).clear_width == np.inf
    # 16.224 kg / ((0.1^2 - w^2) 0.4 m^3)
    assert Block(**BLOCK, cavity_width=0.0958).clear_width == 0.0958
    assert Block(**BLOCK, radius_of_gyration=0.2061).radius_of_gyration == 0.2061
    assert Block(**BLOCK, base_friction=np.array([0.3, 0.6])).base_friction.tolist() == [0.3, 0.6]


def test_the_hinge_damping_follows_from_the_damping_ratio_on_a_fixed_support():
    # 2 zeta m l^2 sqrt(g/l)
    assert WITH.hinge_damping(9.7) == pytest.approx(2 * 0.2 * 1.2 * 0.05**2 * np.sqrt(9.7 / 0.05), rel=1e-14)


def test_the_effective_width_narrows_the_base_and_keeps_the_mass():
    """The base is narrower, but mass and radius of gyration are those of the whole block."""
    whole = Block(**BLOCK)
    gyration = math.sqrt((whole.width**2 + whole.height**2) / 12.0)
    narrow = replace(whole, effective_width=0.9)
    other = Block(**BLOCK | {"width": 0.9 * BLOCK["width"]}, radius_of_gyration=gyration)
    assert narrow.base_width == other.width
    p, q = (Scene(block, Harmonic(**MOTION)).parameters() for block in (narrow, other))
    for name in NAMES:
        if name != "e":
            assert getattr(p, name) == pytest.approx(getattr(q, name), rel=1e-15), name
    assert (p.rho, p.e) == (narrow.inertia_ratio, None)
    assert narrow.velocity_ratio == pytest.approx(other.velocity_ratio, rel=1e-15)
    assert narrow.velocity_ratio > whole.velocity_ratio
    stated = replace(whole, radius_of_gyration=0.13)
    narrow = replace(stated, effective_width=0.9)
    a, b = 0.45 * whole.width, 0.5 * whole.height
    assert narrow.inertia_ratio == pytest.approx(b**2 / (a**2 + b**2 + 0.13**2), rel=1e-15)
    assert Block(**BLOCK, effective_width=1.0) == Block(**BLOCK, effective_width=1) == Block(**BLOCK)


@pytest.mark.parametrize(
    ("width", "height", "centroid", "lifts"),
    [(1.3, 10.0, 3.5, 0.1857), (0.43, 1.8, 0.635, 0.339), (1.3, 10.0, 4.03, 0.161)],
)
def test_a_block_moves_like_a_uniform_one_of_twice_the_height_of_its_centroid(width, height, centroid, lifts):
    """Only the conversion from SI units changes. The last block is a solid frustum, 0.7 m wide at its top."""
    gyration = 0.55 * centroid + 0.1 * width
    own = {"width": width, "mass": 500.0 * width**2 * height, "radius_of_gyration": gyration}
    block = Block(height=height, centroid_height=centroid, **own)
    other = Block(height=2.0 * centroid, **own)
    bob = Pendulum(mass=0.1 * block.mass, length=0.3, damping_ratio=0.1)
    p = Scene(block, Harmonic(**MOTION)).parameters(bob)
    q = Scene(other, Harmonic(**MOTION)).parameters(replace(bob, hinge_height=height))
    np.testing.assert_allclose(
        [getattr(p, n) for n in NAMES if n != "e"], [getattr(q, n) for n in NAMES if n != "e"]
    )
    assert (p.nu, p.rho) == pytest.approx(
        (lifts, 1.0 / (1.0 + lifts**2 + (gyration / centroid) ** 2)), rel=3e-3
    )
    assert p.velocity_ratio == pytest.approx(q.velocity_ratio, rel=1e-15)
    wider = block.widened(1.2)
    assert (wider.centroid, wider.slenderness) == (centroid, pytest.approx(1.2 * block.slenderness))


def test_a_block_that_carries_its_bob_has_the_moments_of_both_about_its_edge():
    block = Block(**BLOCK, effective_width=0.9, centroid_height=0.23, radius_of_gyration=0.12)
    bob = Pendulum(mass=3.0, length=0.15, damping_ratio=0.1, hinge_height=0.5)
    stuck, a, high = block.carrying(bob), 0.045, 0.35

    def moment(of: Block) -> float:
        return of.mass * (of.gyration**2 + a**2 + of.centroid**2)

    assert block.gyration == pytest.approx(0.12, rel=1e-14)
    assert stuck.mass * stuck.centroid == pytest.approx(block.mass * 0.23 + 3.0 * high, rel=1e-14)
    assert moment(stuck) == pytest.approx(moment(block) + 3.0 * (a**2 + high**2), rel=1e-14)


@pytest.mark.parametrize(
    ("own", "bob"),
    [
        ({"friction": 0.249}, {"length": 0.05}),
        ({"centroid_height": 0.36, "radius_of_gyration": 0.08}, {"length": 0.02}),
        ({"centroid_height": 0.3, "radius_of_gyration": 0.08, "frame_width": 0.2}, {"hinge_height": 0.79}),
    ],
)
def test_a_block_at_the_end_of_its_range_can_carry_a_bob(own, bob):
    block = Block(**BLOCK | own)
    pendulum = Pendulum(**{"mass": 8.0, "length": 0.1, "damping_ratio": 0.1} | bob)
    stuck = block.carrying(pendulum)
    # The contact has the same moment of friction with a bob that swings and with one that is held.
    moment = stuck.friction * stuck.mass * stuck.centroid
    assert moment == pytest.approx(block.friction * block.mass * block.centroid, rel=1e-14)
    assert stuck.mass * stuck.centroid > block.mass * block.centroid


def test_housners_restitution_includes_the_mass_of_the_bob():
    block = Block(**BLOCK, restitution="housner")
    with_it = Pendulum(mass=1.6224, length=0.1, damping_ratio=0.1)
    p = Scene(block, Harmonic(**MOTION)).parameters(with_it)
    share = p.inertia_ratio * 0.25**2
    # The textbook has the rectangle alone.
    assert block.velocity_ratio == pytest.approx(1 - 1.5 * np.sin(np.arctan(0.25)) ** 2, rel=1e-14)
    assert p.velocity_ratio == pytest.approx((1 - 2.1 * share) / (1 + 0.1 * share), rel=1e-14)
    assert p.velocity_ratio < block.velocity_ratio - 0.005
    given = Scene(Block(**BLOCK, restitution=0.9), Harmonic(**MOTION)).parameters(with_it)
    assert given.velocity_ratio == given.e == 0.9


def test_the_default_losses_are_housners_impacts_without_friction():
    for losses, expected in (({}, (0.0, None)), ({"friction": 0.02, "restitution": 1.0}, (0.02, 1.0))):
        p = Scene(Block(**BLOCK, **losses), Harmonic(**MOTION)).parameters()
        assert (p.k, p.e) == expected


WITH = Pendulum(mass=1.2, length=0.05, damping_ratio=0.2)
TIED = Scene(Block(**BLOCK, friction=0.02, restitution="housner"), Harmonic(**MOTION))
SCENES = {
    # A cavity moves no parameter, so it has no derivative to compare.
    "friction": Scene(Block(**BLOCK, friction=0.05, restitution=0.9), Harmonic(**MOTION)),
    "housner": TIED,
    "all numbers": Scene(
        Block(**BLOCK, friction=0.02, restitution=0.9, radius_of_gyration=0.13, effective_width=0.9),
        Harmonic(**MOTION),
        9.7,
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_derivatives_of_parameters_in_si_units_equal_differences(name):
    def vector(both):
        p = both[0].parameters(both[1])
        numbers = p.nu, p.mu, p.lam, p.zeta, p.k, p.f, p.xi, p.inertia_ratio, p.velocity_ratio
        return jnp.stack([jnp.asarray(x) for x in numbers])

    slopes = jax.jit(jax.jacrev(vector))((SCENES[name], WITH))
    leaves, structure = jax.tree.flatten((SCENES[name], WITH))

    def at(i, factor):
        return vector(
            jax.tree.unflatten(structure, [x * (factor if i == j else 1) for j, x in enumerate(leaves)])
        )

    for i, (leaf, slope) in enumerate(zip(leaves, jax.tree.leaves(slopes), strict=True)):
        # Central differences of fourth order.
        near, far = (at(i, 1 + h) - at(i, 1 - h) for h in (1e-3, 2e-3))
        np.testing.assert_allclose(slope, (8 * near - far) / (12e-3 * leaf), rtol=1e-9, atol=1e-9)
        assert np.any(slope != 0.0)


@pytest.mark.parametrize("batched", [Pendulum, Block, Harmonic])
def test_a_batch_of_one_part_can_be_combined_with_single_parts(batched):
    parts = {Pendulum: WITH, Block: TIED.block, Harmonic: TIED.excitation}
    stacked = jax.tree.map(lambda x: jnp.array([1.0, 1.02]) * x, parts[batched])

    def margin(part):
        with_part = {**parts, batched: part}
        return uplift(Scene(with_part[Block], with_part[Harmonic]).parameters(with_part[Pendulum])).margin

    expected = [float(margin(jax.tree.map(lambda x, i=i: float(x[i]), stacked))) for i in (0, 1)]
    assert expected[0] != expected[1]
    for margins in (jax.jit(jax.vmap(margin))(stacked), margin(stacked)):
        np.testing.assert_allclose(margins, expected, rtol=1e-14)


def test_parts_are_compared_and_hashed_as_plain_numbers():
    assert Block(**BLOCK) == Block(**BLOCK)
    assert Block(**BLOCK) == Block(**BLOCK, restitution="housner") != Block(**BLOCK, restitution=0.9)
    assert len({paper_scene(), paper_scene(), TIED}) == 2
    whole = Block(width=1, height=4, mass=100, friction=0)
    assert all(isinstance(x, float) for x in jax.tree.leaves(whole))
    assert jax.tree.map(lambda x: x, TIED) == TIED


def test_the_hinge_is_at_the_top_unless_its_height_is_stated():
    scene, sizes = paper_scene(), {"mass_ratio": 0.1, "length_ratio": 0.5, "damping_ratio": 0.1}
    assert scene.parameters(scene.pendulum(**sizes)).kappa == 2.0
    for height, kappa in ((0.4, 2.0), (0.2, 1.0), (0.5, 2.5)):
        at = scene.parameters(scene.pendulum(**sizes, hinge_height=height))
        assert (at.kappa, at.lam, at.mu) == (pytest.approx(kappa, rel=1e-15), 0.5, 0.1)


def test_a_wrong_centroid_is_reported_before_the_friction_that_it_makes_too_large():
    sizes = {"width": 0.1, "height": 0.4, "mass": 16.224, "friction": 0.2, "radius_of_gyration": 0.1}
    assert Block(**sizes).friction == 0.2
    with pytest.raises(ValueError, match=r"^`centroid_height` must be between"):
        Block(**sizes, centroid_height=0.39)
    with pytest.raises(ValueError, match=r"^`friction` must be at most 0\.14"):
        Block(**sizes, centroid_height=0.35)
