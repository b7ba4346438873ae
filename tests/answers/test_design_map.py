"""Maps of designs, cell by cell against the solvers that they are made of."""

from __future__ import annotations

import dataclasses
import functools
import math

import jax
import numpy as np
import pytest
from matplotlib.collections import QuadMesh

from tests.reference import orbits_of
from tpd import Parameters, Pendulum, design_map, paper_scene, status_name, steady_state
from tpd.answers.design_map import DesignMap
from tpd.theory.no_uplift import uplift

SCENE, HUNG = paper_scene(), Pendulum(mass=0.8, length=0.1, damping_ratio=0.1)
BARE = Parameters(nu=0.2, mu=0.0, lam=0.4, zeta=0.2, k=0.05, f=0.1, xi=2.0)
X, Y = ("mu", np.linspace(0.02, 0.2, 7)), ("lam", np.linspace(0.12, 1.0, 5))


@functools.cache
def over_mass_and_length() -> DesignMap:
    return design_map(SCENE, X, Y, pendulum=HUNG)


@functools.cache
def over_motion() -> DesignMap:
    """In SI units, with every status there is without a start but the two of measure zero."""
    axes = ("frequency", np.linspace(1.0, 5.0, 6)), ("amplitude", np.array([0.002, 0.02, 0.045]))
    return design_map(SCENE, *axes, pendulum=HUNG)


def expected(p: Parameters) -> tuple[str, float, float]:
    """The largest attracting motion of one design, said again."""
    orbits, still = orbits_of(p), uplift(p)
    names = [status_name(jax.tree.map(lambda x, i=i: x[i], orbits.status)) for i in range(3)]
    if "rocking" in names:
        i = names.index("rocking")
    elif still.margin > 0:
        return "rest", 0.0, float(still.stroke)
    elif "unstable" in names:
        i = names.index("unstable")
    else:
        return "no_orbit", math.nan, math.nan
    return names[i], float(orbits.amplitude[i]), float(orbits.stroke[i])


def test_known_amplitudes_stand_in_their_cells():
    # Collini's equations solved three independent ways, seven digits known.
    m = design_map(BARE, ("xi", [1.0, 1.5, 2.0, 4.0]), ("k", [0.05, 0.06]))
    np.testing.assert_allclose(m.amplitude[0], [0.0, 0.0973880, 0.0637170, 0.0188571], atol=5e-8)
    # At xi = 1 the orbit has lost its symmetry, but rest holds.
    assert list(m.status[0]) == ["rest", "rocking", "rocking", "rocking"]
    assert np.all(m.amplitude[1, 1:] < m.amplitude[0, 1:])
    assert np.all(m.margin > 0)


def test_cells_are_the_orbits_of_their_designs():
    m, p = over_mass_and_length(), SCENE.parameters(HUNG)
    assert m.amplitude.shape == m.stroke.shape == m.status.shape == m.margin.shape == (5, 7)
    for i, j in np.ndindex(5, 7):
        at = dataclasses.replace(p, mu=float(m.x[j]), lam=float(m.y[i]))
        status, amplitude, stroke = expected(at)
        assert m.status[i, j] == status
        np.testing.assert_allclose(m.amplitude[i, j], amplitude, rtol=1e-12)
        np.testing.assert_allclose(m.stroke[i, j], stroke, rtol=1e-9)
        np.testing.assert_allclose(m.margin[i, j], float(uplift(at).margin), rtol=1e-10)
    assert m.exact.all()
    assert len(m.counts) >= 2
    assert sum(m.counts.values()) == 35


def test_in_si_units_cells_are_scenes():
    m = over_motion()
    assert set(m.counts) == {"rocking", "rest", "unstable"}
    for i, j in np.ndindex(3, 6):
        motion = dataclasses.replace(SCENE.motion, frequency=float(m.x[j]), amplitude=float(m.y[i]))
        status, amplitude, stroke = expected(dataclasses.replace(SCENE, motion=motion).parameters(HUNG))
        assert m.status[i, j] == status
        np.testing.assert_allclose([m.amplitude[i, j], m.stroke[i, j]], [amplitude, stroke], rtol=1e-9)


def test_a_map_prints_its_axes_statuses_and_ranges():
    m = over_motion()
    lines = str(m).splitlines()
    assert lines[:3] == [
        "Design map",
        "  frequency       6 values, 1 to 5 Hz",
        "  amplitude       3 values, 0.002 to 0.045 m",
    ]
    assert lines[3] == "  status          " + ", ".join(f"{n} {name}" for name, n in m.counts.items())
    finite = m.amplitude[np.isfinite(m.amplitude)]
    assert lines[4] == f"  amplitude       0 to {finite.max():.4g} rad"
    assert len(lines) == 7
    assert m._repr_html_().startswith("<pre>Design map\n")


def test_the_order_of_the_axes_changes_nothing():
    m, turned = over_mass_and_length(), design_map(SCENE, Y, X, pendulum=HUNG)
    np.testing.assert_array_equal(turned.status.T, m.status)
    for name in ("amplitude", "stroke", "margin"):
        np.testing.assert_allclose(getattr(turned, name).T, getattr(m, name), rtol=1e-13)
    assert (turned.x_name, turned.y_name) == ("lam", "mu")


def test_a_parameter_and_a_quantity_that_leaves_it_alone_go_together():
    m = design_map(SCENE, ("mu", [0.05, 0.1]), ("frequency", [2.5, 3.0]), pendulum=HUNG)
    mass = np.array([0.05, 0.1]) * SCENE.block.mass
    same = design_map(SCENE, ("pendulum_mass", mass), ("frequency", [2.5, 3.0]), pendulum=HUNG)
    np.testing.assert_allclose(m.amplitude, same.amplitude, rtol=1e-12)


@functools.cache
def from_rest() -> DesignMap:
    axes = (
        ("frequency", np.array([2.0, 2.2, 2.4, 3.3, 4.0])),
        ("pendulum_length", np.array([0.03, 0.05, 0.2])),
    )
    return design_map(SCENE, *axes, pendulum=HUNG, start=np.zeros(4))


def test_from_a_start_cells_are_what_is_settled_into():
    m = from_rest()
    assert {"rocking", "rest", "overturned"} <= set(m.counts)
    assert m.start == (0.0, 0.0, 0.0, 0.0)
    for i, j in np.ndindex(m.status.shape):
        motion = dataclasses.replace(SCENE.motion, frequency=float(m.x[j]))
        pendulum = dataclasses.replace(HUNG, length=float(m.y[i]))
        s = steady_state(dataclasses.replace(SCENE, motion=motion).parameters(pendulum))
        assert m.status[i, j] == status_name(s.status)
        # On an orbit known to rounding; or followed until it repeats within 1e-6 of nu or nu + f, which
        # leaves that over one less the multiplier: the bob's is close to one.
        by_tilt, by_bob = (1e-12, 1e-12) if m.exact[i, j] else (1e-6, 1e-4)
        np.testing.assert_allclose(m.amplitude[i, j], float(s.amplitude), rtol=1e-12, atol=by_tilt)
        np.testing.assert_allclose(m.stroke[i, j], float(s.stroke), rtol=1e-10, atol=by_bob)
    assert 0 < m.exact.sum() < m.exact.size
    assert np.isinf(m.amplitude[m.status == "overturned"]).all()
    assert m.exact[(m.status == "rest") | (m.status == "overturned")].all()
    assert m.exact[m.status == "rocking"].any()


def test_progress_is_told_and_ends_with_all():
    seen: list[tuple[int, int]] = []
    design_map(BARE, ("xi", [1.5, 2.0]), ("f", [0.1, 0.2]), progress=lambda *n: seen.append(n))
    assert seen == [(4, 4)]


LINE = ("f", [0.1, 0.2])


@pytest.mark.parametrize(
    ("x", "y", "match"),
    [
        (("omega", [1.0, 2.0]), LINE, "`x` must be one of nu, mu.* but is 'omega'"),
        (LINE, ("frequency", [1.0, 2.0]), "`y` must be one of nu, mu.* but is 'frequency'"),
        (LINE, LINE, "`x` and `y` must differ, but both are 'f'"),
        (("xi", [1.0]), LINE, "the values of `x` must be two or more finite numbers that increase"),
        (("xi", [2.0, 1.0]), LINE, "the values of `x` must be two or more"),
        (LINE, ("xi", [1.0, np.nan]), "`values of y` must be two or more numbers that increase, all finite"),
        (("nu", [0.1, 0.6]), LINE, "`nu` must be between 0 and 0.5"),
    ],
)
def test_bad_axes_are_refused(x, y, match):
    with pytest.raises(ValueError, match=match):
        design_map(BARE, x, y)


@pytest.mark.parametrize(
    ("x", "y", "match"),
    [
        ("mu", "pendulum_mass", "`x` and `y` must not both move mu, but 'pendulum_mass' does so as well"),
        ("frequency", "f", "`x` and `y` must not both move f, but 'frequency' does so as well"),
    ],
)
def test_two_axes_that_move_the_same_are_refused(x, y, match):
    with pytest.raises(ValueError, match=match):
        design_map(SCENE, (x, [0.1, 0.2]), (y, [0.1, 0.2]), pendulum=HUNG)


def test_a_corner_out_of_range_is_refused_though_both_axes_are_within_theirs():
    with pytest.raises(ValueError, match=r"`nu` must be between 0 and 0\.5.* but is 0\.75"):
        design_map(SCENE, ("width", [0.05, 0.15]), ("height", [0.2, 0.5]))


def test_a_grid_may_use_up_what_the_other_axis_allows():
    # No width here goes with the scene's own height of 0.4 m.
    m = design_map(SCENE, ("width", [0.3, 0.4]), ("height", [0.8, 1.0]))
    assert m.status.shape == (2, 2)
    scene = dataclasses.replace(SCENE, block=dataclasses.replace(SCENE.block, width=0.4, height=0.8))
    assert m.margin[0, 1] == pytest.approx(float(uplift(scene.parameters()).margin), rel=1e-12)
    with pytest.raises(ValueError, match=r"`nu` must be between 0 and 0\.5.* but is 0\.5125"):
        design_map(SCENE, ("width", [0.3, 0.41]), ("height", [0.8, 1.0]))


def test_bad_starts_are_refused():
    with pytest.raises(ValueError, match="`start` must be four numbers"):
        design_map(BARE, ("xi", [1.5, 2.0]), LINE, start=[0.0, 0.0])


def test_a_picture_colours_what_moves_hatches_the_rest_and_names_its_axes():
    m = over_motion()
    ax = m.plot()
    assert ax.get_xlabel() == "frequency of the base motion (Hz)"
    assert ax.get_ylabel() == "amplitude of the base motion (m)"
    (mesh,) = [c for c in ax.collections if isinstance(c, QuadMesh)]
    shown = ~np.ma.getmaskarray(np.ma.masked_invalid(mesh.get_array())).reshape(m.status.shape)
    np.testing.assert_array_equal(shown, m.status == "rocking")
    with pytest.raises(ValueError, match="`quantity` must be one of amplitude, stroke, margin"):
        m.plot("status")
    labels = {text.get_text() for text in ax.get_legend().get_texts()}
    assert labels == {"rest, no rocking attracts", "orbits, but none attracts"}
    assert [t.get_text() for t in ax.texts] == ["uplift margin 0"]
    assert ax.figure.axes[1].get_ylabel() == r"largest tilt $|\varphi|$ (rad)"


def test_the_stroke_is_shown_of_a_resting_block_as_well():
    m = over_motion()
    ax = m.plot("stroke")
    (mesh,) = [c for c in ax.collections if isinstance(c, QuadMesh)]
    shown = ~np.ma.getmaskarray(np.ma.masked_invalid(mesh.get_array())).reshape(m.status.shape)
    np.testing.assert_array_equal(shown, m.status != "unstable")
