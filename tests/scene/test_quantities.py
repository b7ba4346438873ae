"""What can be varied, in SI units and without, and the derivatives along it."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tpd import Block, Harmonic, Parameters, Pendulum, Scene
from tpd.scene.parameters import NAMES
from tpd.scene.quantities import QUANTITIES, Axis, Setup, with_design
from tpd.scene.scene import paper_scene

# Its cavity would keep the width from being made less.
SCENE = dataclasses.replace(paper_scene(), block=dataclasses.replace(paper_scene().block, cavity_width=None))
PENDULUM = Pendulum(mass=0.8, length=0.1, damping_ratio=0.1, hinge_height=0.3)
OTHER = Scene(
    Block(
        **{"width": 1.1, "height": 4.0, "centroid_height": 1.7, "radius_of_gyration": 1.3, "mass": 3e3},
        friction=0.04,
        restitution=0.8,
    ),
    Harmonic(amplitude=0.2, frequency=0.8),
)
TIED = Scene(Block(width=1.1, height=4.0, mass=3e3, friction=0.04, restitution="housner"), OTHER.excitation)
"""Its restitution by Housner's formula."""
WITHOUT = Parameters(nu=0.2, mu=0.0, lam=0.4, zeta=0.2, k=0.05, f=0.1, xi=2.0)


def moved(scene: Scene, pendulum: Pendulum, name: str, value: float) -> Parameters:
    """The parameters with one quantity replaced where it is kept."""
    if name.startswith("pendulum_"):
        field = {"damping": "damping_ratio"}.get(name[9:], name[9:])
        return scene.parameters(dataclasses.replace(pendulum, **{field: value}))
    home = "excitation" if name in ("amplitude", "frequency") else "block"
    part = dataclasses.replace(getattr(scene, home), **{name: value})
    return dataclasses.replace(scene, **{home: part}).parameters(pendulum)


def vector(p: Parameters) -> np.ndarray:
    values = {**vars(p), "rho": p.inertia_ratio, "e": p.velocity_ratio}
    return np.array([values[name] for name in NAMES], dtype=float)


EACH = [
    pytest.param(scene, name, id=f"{label}, {name}")
    for label, scene in {"rectangle": SCENE, "own inertia": OTHER, "tied": TIED}.items()
    for name in QUANTITIES
    if (scene, name) != (TIED, "restitution") and (scene is OTHER or name != "centroid_height")
]


@pytest.mark.parametrize(("scene", "name"), EACH)
def test_varying_a_quantity_equals_a_scene_with_the_new_value(scene, name):
    axis, setup = Axis.of(scene, name, PENDULUM), Setup.of(scene, PENDULUM)
    base = vector(scene.parameters(PENDULUM))
    values = setup.values[name] * np.array([0.9, 0.95, 1.0])
    for value, point in zip(values, axis.at(values), strict=True):
        expected = moved(scene, PENDULUM, name, float(value))
        np.testing.assert_allclose(point, vector(expected), rtol=1e-15)
        at = setup.at({name: float(value)})
        np.testing.assert_allclose(vector(at), point, rtol=1e-15)
        assert (at.rho is None) == (expected.rho is None)
        assert (at.e is None) == (expected.e is None) == (scene is TIED)
    changed = {n for n, a, b in zip(NAMES, base, axis.at(values)[0], strict=True) if a != b}
    assert changed == set(setup.moved(name))
    if name.endswith("height"):
        every = {"nu", "rho", "xi", "lam", "kappa"}
        own = {"pendulum_hinge_height": {"kappa"}, "height": set() if scene is OTHER else every}
        assert changed - {"e"} == own.get(name, every)
    of_housner = scene is TIED and name in ("width", "height", "mass", "pendulum_mass")
    assert ("e" in changed) == (name == "restitution" or of_housner)


@pytest.mark.parametrize(("scene", "name"), EACH)
def test_derivatives_along_a_quantity_equal_finite_differences(scene, name):
    axis = Axis.of(scene, name, PENDULUM)
    assert set(axis.others) == set(axis.setup.values) - {name}
    value = axis.setup.values[name]
    slopes = axis.jacobian(value)
    for i, n in enumerate((name, *axis.others)):
        line, center = Axis(axis.setup, n), axis.setup.values[n]
        h = 1e-5 * center
        difference = np.diff(line.at(center + np.array([-h, h])), axis=0)[0] / (2.0 * h)
        np.testing.assert_allclose(slopes[:, i], difference, rtol=1e-8, atol=1e-9 / center)
    # Where hinge and centroid are stated, nothing depends on the height.
    assert np.any(slopes[:, 0]) == (scene is not OTHER or name != "height")


@pytest.mark.parametrize("name", ["nu", "mu"])
def test_housners_restitution_and_the_default_inertia_follow_a_varied_parameter(name):
    p, x = TIED.parameters(PENDULUM), getattr(TIED.parameters(PENDULUM), name)
    axis = Axis.of(TIED, name, PENDULUM)
    assert {"e", "rho"}.isdisjoint(axis.others)
    expected = vector(dataclasses.replace(p, **{name: 1.1 * x}))
    np.testing.assert_allclose(axis.at(np.array([1.1 * x]))[0], expected, rtol=1e-15)
    difference = np.diff(axis.at(x * np.array([1.0 - 1e-5, 1.0 + 1e-5])), axis=0)[0] / (2e-5 * x)
    np.testing.assert_allclose(axis.jacobian(x)[:, 0], difference, rtol=1e-7, atol=1e-9)
    assert difference[NAMES.index("e")] < 0.0
    assert (difference[NAMES.index("rho")] < -0.1) == (name == "nu")
    at = Setup.of(TIED, PENDULUM).at({name: 1.1 * x, "xi": 3.0})
    np.testing.assert_allclose(vector(at)[np.array(NAMES) != "xi"], expected[np.array(NAMES) != "xi"])
    assert at.xi == 3.0


def test_a_varied_restitution_replaces_housners():
    at = Setup.of(TIED).at({"restitution": 0.7, "width": 1.0})
    assert (at.e, at.nu) == (0.7, 0.25)
    assert Setup.of(TIED).moved("restitution") == ("e",)
    with pytest.raises(ValueError, match=r"`e` must be between 0 and 1, but is 1\.2"):
        Axis(Setup.of(TIED), "restitution").check(1.2)
    with pytest.raises(ValueError, match="`restitution` must be positive and finite, but is 0"):
        Axis(Setup.of(TIED), "restitution").check(0.0)


def test_pendulum_quantities_cannot_be_varied_without_a_pendulum():
    assert not any(n.startswith("pendulum_") for n in Axis.of(SCENE, "frequency").others)
    for name in ("mu", "zeta", "pendulum_mass", "pendulum_length"):
        with pytest.raises(ValueError, match=f"`{name}` cannot be varied without a pendulum"):
            Axis.of(SCENE, name)


def test_values_and_ranges_out_of_range_or_in_a_wrong_unit_are_rejected_by_name():
    Axis.of(SCENE, "frequency", PENDULUM).check(0.5, 50.0)  # the upper end may exceed what any ground does
    for name, values, match in (
        ("frequency", (0.0,), "`frequency` must be positive and finite, but is 0"),
        ("amplitude", (-0.1,), "`amplitude` must be zero or positive, and finite, but is -0.1"),
        ("pendulum_mass", (-1.0,), "`pendulum_mass` must be zero or positive"),
        ("pendulum_length", (0.0,), "`pendulum_length` must be positive"),
        (
            "centroid_height",
            (0.18,),
            "`radius_of_gyration` must be stated with a `centroid_height` of 0.18",
        ),
        ("centroid_height", (0.37,), "`centroid_height` must be between 0.04 and 0.36 m above the base"),
        ("width", (0.3,), "`nu` must be between 0 and 0.5"),
        ("omega", (1.0,), "`name` must be one of width, height.*nu, mu.*but is 'omega'"),
        ("amplitude", (0.0, 50.0), "give 50 m at 2.5 Hz, whose acceleration must be at most 10 g"),
        ("frequency", (750.0, 950.0), "0.015 m at 750 Hz, whose acceleration must be"),
        ("mass", (0.016, 0.02), "kg/m.3 .for a block as deep as it is wide"),
        ("pendulum_damping", (5.0, 40.0), "`pendulum_damping` must be at most 2, twice critical damping"),
    ):
        with pytest.raises(ValueError, match=match):
            Axis.of(SCENE, name, PENDULUM).check(*values)
    with pytest.raises(
        ValueError, match=r"`zeta` must be at most 2, twice critical damping .a ratio: 5 % is"
    ):
        Setup.of(SCENE, PENDULUM).check_plausible("zeta", np.array([0.05, 40.0]))
    with pytest.raises(ValueError, match="`pendulum` is allowed only"):
        Setup.of(WITHOUT, PENDULUM)
    with pytest.raises(ValueError, match=r"`name` must be one of nu, mu.*but is 'frequency'"):
        Axis.of(WITHOUT, "frequency")


def test_another_design_changes_only_the_parameters_of_the_pendulum():
    p = SCENE.parameters(PENDULUM)
    q = jax.jit(with_design)(p, jnp.array([0.2, 0.3, 0.4]))
    np.testing.assert_array_equal([q.mu, q.lam, q.zeta], [0.2, 0.3, 0.4])
    for name in set(NAMES) - {"rho"} - {"mu", "lam", "zeta"}:
        assert float(getattr(q, name)) == float(getattr(p, name))
    assert q.rho is None
    # Unchecked, so that a search may look beyond what is allowed.
    assert float(with_design(p, jnp.array([-0.1, 0.3, 0.4])).mu) == -0.1
