"""Limits: sizes, derivatives against differences, order, limits of a user, and requirements."""

import dataclasses

import numpy as np
import pytest

import tpd
from tests.design.conftest import WIDE
from tpd.design.geometry import Geometry, Ratios
from tpd.design.harmonic import HarmonicProblem
from tpd.design.search import search
from tpd.design.sizes import Evaluation, evaluate_sizes
from tpd.limits import DEFAULT_LIMITS, LIMIT_KINDS, Limit, Requirements, check_limits, limit_of, stroke_limit
from tpd.report import words
from tpd.scene.bob import Bob

SCENE = tpd.paper_scene()
FACTORS = {"mass": [0.9, 1.1], "length": [1.0, 1.02], "slenderness": [1.0, 0.97]}
SCATTERED = tpd.Conditions({k: np.array(v) for k, v in FACTORS.items()})
DESIGN = np.array([0.15, 0.26, 0.35])
LONG = np.array([0.15, 0.8, 0.35])
"""One that a body acts as; as the former no ball does."""
CYLINDERS = tuple(Bob(shape="cylinder", density=11340.0, aspect=aspect) for aspect in (0.5, 4.0))
ONE_OF_EACH = (
    tpd.limits.Stroke(0.4),
    tpd.limits.RelativeStroke(0.6),
    tpd.limits.Tilt(0.5),
    tpd.limits.Mass(2.0),
    tpd.limits.Offset(0.03),
    tpd.limits.Clearance(),
    tpd.limits.Worsening(0.1),
    tpd.limits.Multiplier(0.9),
    tpd.limits.Reserve(0.1),
)


@dataclasses.dataclass(frozen=True)
class Lighter(Limit):
    """A limit of a user's own: the mass in kg, which slopes with the mass ratio alone."""

    kg: float = 1.0
    name = "lighter"
    of_motion = False

    def size(self, motion, design, geometry):
        return geometry.mass(design) / self.kg


@dataclasses.dataclass(frozen=True)
class Swing(tpd.limits.Objective):
    """Objective of a user: the settled bob angle over a right angle."""

    name = "swing"

    def size(self, motion, design, geometry):
        return motion.swing / (0.5 * np.pi)


class Nameless(Lighter):
    """No dataclass of its own, so its numbers would not tell it apart."""


def evaluation(design: np.ndarray) -> Evaluation:
    """Two conditions whose sizes are smooth functions of the design, with their derivatives."""
    mu, lam, zeta = design
    tilt = np.array([0.3 + mu * lam, 0.2 + lam**2 * zeta])
    tilt_slope = np.array([[lam, mu, 0.0], [0.0, 2 * lam * zeta, lam**2]])
    swing = np.array([0.2 + mu * zeta, 0.1 + mu**2 + zeta])
    swing_slope = np.array([[zeta, 0.0, mu], [2 * mu, 0.0, 1.0]])
    reserve, reserve_slope = 0.1 + 0.2 * swing, 0.2 * swing_slope
    one = np.ones((1, 2))
    parts = (x[None] for x in (tilt, tilt_slope, tilt, tilt_slope, swing, swing_slope))
    none = np.zeros((1, 2), int), np.full((1, 2, 2), np.nan)
    left = 0.5 + 0.3 * tilt[None], 0.3 * tilt_slope[None]
    last = -one, 0.5 * one, reserve[None], reserve_slope[None], *left, *none, design[None]
    return Evaluation(*parts, *last)


@pytest.fixture(scope="module")
def geometry() -> Geometry:
    """Geometry, with a bare block that rocks at a tilt of 0.4 and 0.1 in shares of nu."""
    return dataclasses.replace(Geometry.of(SCENE, SCATTERED), tilt_without_pendulum=np.array([0.4, 0.1]))


def sizes(limit, design, geometry):
    return {size.name: size for size in evaluate_sizes([limit], evaluation(design), geometry, slopes=True)}


@pytest.mark.parametrize("design", [DESIGN, LONG], ids=["no body", "body"])
@pytest.mark.parametrize(
    "limit", [*ONE_OF_EACH, *(tpd.limits.Clearance(bob) for bob in CYLINDERS)], ids=lambda limit: limit.name
)
def test_derivatives_of_a_limit_equal_finite_differences(limit, design, geometry):
    here = sizes(limit, design, geometry)
    for name, size in here.items():
        for axis in range(3):
            step = 1e-6 * np.eye(3)[axis]
            up, down = (sizes(limit, design + s * step, geometry)[name].value for s in (1, -1))
            expected = (up - down) / 2e-6
            np.testing.assert_allclose(size.slope[..., axis], expected, rtol=1e-7, atol=1e-8, err_msg=name)
    assert here


def test_a_limit_on_an_angle_is_the_angle_divided_by_its_bound(geometry):
    e, nu = evaluation(DESIGN), SCENE.block.slenderness * np.array(FACTORS["slenderness"])
    np.testing.assert_allclose(geometry.slenderness, nu)
    swing, relative, tilt, _, _, _, _, multiplier, reserve = (
        evaluate_sizes([limit], e, geometry)[0] for limit in ONE_OF_EACH
    )
    np.testing.assert_allclose(swing.value, e.swing / 0.4)
    np.testing.assert_allclose(relative.value, (e.swing + e.tilt * nu) / 0.6)
    np.testing.assert_allclose(tilt.value, e.tilt / 0.5)
    np.testing.assert_allclose(multiplier.value, e.multiplier / 0.9)
    # The reserve is a lower limit: a size of one where it is just met, below one where there is more.
    np.testing.assert_allclose(reserve.value <= 1.0, e.reserve >= 0.1)
    np.testing.assert_allclose(1.0 - reserve.value, e.reserve / 0.1 - 1.0)


@pytest.mark.parametrize("bob", [Bob(), *CYLINDERS], ids=str)
def test_limits_on_clearance_use_the_bob_on_its_rod(geometry, bob):
    with_it = SCENE.pendulum(mass_ratio=LONG[0], length_ratio=LONG[1], damping_ratio=LONG[2])
    e = evaluation(LONG)
    offset = sizes(tpd.limits.Offset(0.03), LONG, geometry)["offset"].value
    clearance = sizes(tpd.limits.Clearance(bob), LONG, geometry)
    assert set(clearance) == {"clearance", "thickness", "depth"}
    body, long = bob.built(with_it.mass, with_it.length, float(SCENE.gravity))
    ball = Bob().built(with_it.mass, with_it.length, float(SCENE.gravity))[1]
    for i in range(2):
        mass, length, slenderness = (np.array(FACTORS[name])[i] for name in FACTORS)
        rod, heavy = long * length, body * mass
        angle = e.swing[0, i] + e.tilt[0, i] * SCENE.block.slenderness * slenderness
        wall = 0.5 * SCENE.block.cavity_width * slenderness
        assert offset[0, i] == pytest.approx(ball * length * np.sin(angle) / 0.03)
        assert clearance["clearance"].value[0, i] == pytest.approx(bob.reach(heavy, rod, angle) / wall)
        assert clearance["thickness"].value[0, i] == pytest.approx(bob.half_height(heavy) / (0.6 * rod))


def test_a_worsening_is_relative_to_the_block_without_pendulum(geometry):
    e, worsening = evaluation(DESIGN), tpd.limits.Worsening(0.25)
    (size,) = evaluate_sizes([worsening], e, geometry, slopes=True)
    np.testing.assert_allclose(size.value, e.tilt / (1.25 * np.array([0.4, 0.1])))
    calm = dataclasses.replace(geometry, tilt_without_pendulum=np.array([0.0, np.nan]))
    (size,) = evaluate_sizes([worsening], e, calm, slopes=True)
    assert size.value[0, 0] == pytest.approx(e.tilt[0, 0] / (1.25 * 0.02))
    assert size.value[0, 1] == 0.0
    (size,) = evaluate_sizes([worsening], e, Geometry.of(SCENE, SCATTERED), slopes=True)
    np.testing.assert_array_equal(size.value, 0.0)
    np.testing.assert_array_equal(size.slope, 0.0)
    lost = e._replace(tilt=np.full((1, 2), np.inf))
    np.testing.assert_array_equal(evaluate_sizes([worsening], lost, calm)[0].value, [[np.inf, 0.0]])


def test_the_offset_of_the_bob_beyond_a_right_angle_is_its_rod_length(geometry):
    e = evaluation(DESIGN)._replace(swing=np.array([[1.6, 3.0]]))
    (size,) = evaluate_sizes([tpd.limits.Offset(0.03)], e, geometry, slopes=True)
    np.testing.assert_allclose(size.value, geometry.rod(Ratios(*DESIGN))[None] / 0.03)
    np.testing.assert_allclose(size.slope[..., [0, 2]], 0.0)


def test_a_bob_without_mass_has_finite_clearance_and_derivatives(geometry):
    e = evaluation(DESIGN)._replace(design=np.array([[0.0, 0.26, 0.35]]))
    for limit in (tpd.limits.Clearance(), tpd.limits.Clearance(CYLINDERS[1]), tpd.limits.Offset(0.03)):
        for size in evaluate_sizes([limit], e, geometry, slopes=True):
            assert np.isfinite(size.value).all()
            assert np.isfinite(size.slope).all()
            if size.name == "thickness":
                np.testing.assert_array_equal(size.value, 0.0)


def test_limits_have_the_order_of_a_report():
    assert check_limits(reversed(ONE_OF_EACH)) == ONE_OF_EACH
    assert [type(x) for x in ONE_OF_EACH] == list(LIMIT_KINDS)
    assert limit_of(ONE_OF_EACH, tpd.limits.Tilt) == tpd.limits.Tilt(0.5)
    assert limit_of(DEFAULT_LIMITS, tpd.limits.Tilt) is None
    assert stroke_limit(DEFAULT_LIMITS) == 0.5
    assert stroke_limit(()) == np.inf
    assert {x.name for x in ONE_OF_EACH if not x.of_motion} == {"worsening", "multiplier", "reserve"}


def test_a_search_keeps_a_user_limit_and_minimises_a_user_objective():
    own = Lighter(1.0)
    limits = check_limits((own, tpd.limits.Stroke(1.5)))
    assert limits == (tpd.limits.Stroke(1.5), own)
    assert words.limit(own) == "kg = 1.0"
    method = tpd.Descent(searches=2, screening=16, steps=8, model=tpd.Piecewise())
    ends = {}
    for objective in (tpd.limits.SteadyTilt(), Swing()):
        inputs = {"conditions": tpd.Conditions.exactly(), "limits": limits, "method": method}
        orbits = HarmonicProblem.of(SCENE, WIDE, objective=objective, **inputs).orbits
        history = search(orbits, method, 0)
        ends[objective.name] = orbits.evaluate(history.ends[np.isfinite(history.end_values)])
        assert np.all(ends[objective.name].design[:, 0] * SCENE.block.mass <= 1.0)
    assert ends["tilt"].design[:, 0].max() * SCENE.block.mass > 0.9
    assert ends["swing"].swing.min() < ends["tilt"].swing.min()


def test_the_default_required_reduction_is_ten_per_cent():
    requirements = Requirements()
    assert (requirements.at_least, requirements.worse, requirements.wall_contacts) == (0.1, 0.05, None)
    assert (requirements.reduce, Requirements(reduce="tilt").reduce) == (None, "tilt")
    with pytest.raises(ValueError, match="`reduce` must be one of overturning, tilt, rate, but is 'tild'"):
        Requirements(reduce="tild")
    for name in ("at_least", "worse", "wall_contacts"):
        for value in (0.0, 1.0):
            assert getattr(Requirements(**{name: value}), name) == value
        for value in (-0.1, 1.1, float("nan")):
            with pytest.raises(ValueError, match=f"`{name}` must be"):
                Requirements(**{name: value})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tpd.limits.Tilt(-1.0), "`tilt` must be positive"),
        (lambda: check_limits((Nameless(),)), "`limits` must be dataclasses with a `name`, but"),
        (lambda: tpd.limits.Offset(float("nan")), "`offset` must be positive"),
        (lambda: check_limits((tpd.limits.Tilt(0.1), tpd.limits.Tilt(0.2))), "but has two of Tilt"),
    ],
)
def test_a_limit_out_of_range_is_rejected(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_limit_on_the_mass_applies_to_the_bob_as_built(geometry):
    design, mass = np.array([0.15, 0.6, 0.35]), 0.15 * SCENE.block.mass
    body, _ = Bob().built(mass, 0.6 * SCENE.block.centroid, float(SCENE.gravity))
    (size,) = evaluate_sizes([tpd.limits.Mass(2.0)], evaluation(design), geometry, slopes=True)
    assert size.value.shape == (1, 2)
    np.testing.assert_allclose(size.value, body / 2.0, rtol=1e-12)
    assert body > 1.02 * mass
    light = Bob(density=1000.0)
    other = Geometry.of(SCENE, SCATTERED, light)
    (lighter,) = evaluate_sizes([tpd.limits.Mass(2.0)], evaluation(design), other)
    assert lighter.value[0, 0] != size.value[0, 0]
    # Where no body swings as the point does, the mass of the point counts.
    short = np.array([0.15, 0.01, 0.35])
    (size,) = evaluate_sizes([tpd.limits.Mass(2.0)], evaluation(short), geometry, slopes=True)
    np.testing.assert_allclose(size.value, 0.15 * SCENE.block.mass / 2.0)


def test_a_bob_without_equivalent_body_or_below_the_base_exceeds_a_limit(geometry):
    """A disc that turns with its rod has so large a moment of inertia that no thin one acts as the point."""
    disc, design = Bob(shape="cylinder", aspect=0.1), np.array([0.19, 0.3, 0.35])
    mass, length = design[:2] * (float(SCENE.block.mass), float(SCENE.block.centroid))
    assert np.isnan(disc.built(mass, length, float(SCENE.gravity))[0])
    assert disc.half_height(mass) < 0.25 * length
    assert np.all(sizes(tpd.limits.Clearance(disc), design, geometry)["thickness"].value > 1.0)
    for lam, fits in ((1.7, True), (1.9, False)):
        found = sizes(tpd.limits.Clearance(), np.array([0.2, lam, 0.35]), geometry)
        body, rod = Bob().built(0.2 * SCENE.block.mass, lam * SCENE.block.centroid, float(SCENE.gravity))
        depth = rod * np.array(FACTORS["length"]) + Bob().half_height(body * np.array(FACTORS["mass"]))
        np.testing.assert_allclose(found["depth"].value[0], depth / SCENE.block.height)
        assert np.all(found["depth"].value <= 1.0) == fits


@pytest.mark.parametrize(("hinge", "fits"), [(0.5, True), (0.48, False)])
def test_a_bob_in_a_frame_stays_between_its_posts_and_above_the_block(hinge, fits):
    framed = dataclasses.replace(SCENE.block, cavity_width=None, frame_width=0.3)
    scene = dataclasses.replace(SCENE, block=framed)
    exact, design = tpd.Conditions.exactly(), np.array([0.05, 0.3, 0.35])
    geometry = Geometry.of(scene, exact, hinge_ratio=hinge / scene.block.centroid)
    found = sizes(tpd.limits.Clearance(), design, geometry)
    body, rod = Bob().built(0.05 * 16.224, 0.3 * 0.2, float(SCENE.gravity))
    np.testing.assert_allclose(found["top"].value, (rod + Bob().half_height(body)) / (hinge - 0.4))
    assert np.all(found["top"].value <= 1.0) == fits
    reach = Bob().reach(body, rod, 0.1 + 0.3 * 0.25)
    assert found["clearance"].value[0, 0] * 0.15 == pytest.approx(reach, rel=0.2)
    assert "depth" not in found
