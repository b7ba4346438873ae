"""Maps of designs, cell by cell against the solvers that they are made of."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

import tpd
from tests.reference import orbits_of
from tpd import Parameters, Pendulum, design_map, paper_scene, status_name, steady_state
from tpd.answers.design_map import DesignMap
from tpd.scene.status import names_of
from tpd.theory.no_uplift import uplift

SCENE, PENDULUM = paper_scene(), Pendulum(mass=0.8, length=0.1, damping_ratio=0.1)
WITHOUT = Parameters(nu=0.2, mu=0.0, lam=0.4, zeta=0.2, k=0.05, f=0.1, xi=2.0)
LINE = ("f", [0.1, 0.2])


@functools.cache
def over_motion() -> DesignMap:
    """In SI units, with every status there is without a start but the two of measure zero."""
    axes = ("frequency", np.linspace(1.0, 5.0, 6)), ("amplitude", np.array([0.002, 0.02, 0.045]))
    return design_map(SCENE, *axes, pendulum=PENDULUM)


def shaken(**changes: float) -> Parameters:
    return replace(SCENE, excitation=replace(SCENE.excitation, **changes)).parameters(PENDULUM)


def expected(p: Parameters) -> tuple[str, float, float]:
    """The largest attracting motion of one design, said again."""
    orbits, still = orbits_of(p), uplift(p)
    names = list(names_of(orbits.status))
    if "rocking" not in names and still.margin > 0:
        return "rest", 0.0, float(still.swing)
    for name in ("rocking", "unstable"):
        if name in names:
            i = names.index(name)
            return name, float(orbits.amplitude[i]), float(orbits.swing[i])
    return "not_known", math.nan, math.nan


def test_each_cell_equals_the_symmetric_orbit_of_its_design():
    x, y = ("mu", np.linspace(0.02, 0.2, 5)), ("lam", np.linspace(0.12, 1.0, 4))
    m, p = design_map(SCENE, x, y, pendulum=PENDULUM), SCENE.parameters(PENDULUM)
    assert m.amplitude.shape == m.swing.shape == m.status.shape == m.margin.shape == (4, 5)
    for i, j in np.ndindex(4, 5):
        at = replace(p, mu=float(m.x[j]), lam=float(m.y[i]))
        status, amplitude, swing = expected(at)
        assert m.status[i, j] == status
        np.testing.assert_allclose(m.amplitude[i, j], amplitude, rtol=1e-12)
        np.testing.assert_allclose(m.swing[i, j], swing, rtol=1e-9)
        np.testing.assert_allclose(m.margin[i, j], float(uplift(at).margin), rtol=1e-10)
    assert m.exact.all()
    assert len(m.counts) >= 2
    assert sum(m.counts.values()) == 20


@pytest.mark.filterwarnings("ignore:.* whose acceleration is usually at most 2 g")
def test_a_map_in_si_units_equals_the_orbits_of_its_scenes():
    m = over_motion()
    assert str(m).startswith("Design map\n  frequency       6 values, 1 to 5 Hz\n")
    assert set(m.counts) == {"rocking", "rest", "unstable"}
    assert list(m.counts.values()) == sorted(m.counts.values(), reverse=True)
    for i, j in np.ndindex(3, 6):
        status, amplitude, swing = expected(shaken(frequency=float(m.x[j]), amplitude=float(m.y[i])))
        assert m.status[i, j] == status
        np.testing.assert_allclose([m.amplitude[i, j], m.swing[i, j]], [amplitude, swing], rtol=1e-9)


def test_a_map_with_an_initial_state_equals_the_steady_states():
    axes = ("frequency", np.array([2.0, 2.2, 2.4, 3.3, 4.0])), ("pendulum_length", [0.03, 0.05, 0.2])
    m = design_map(SCENE, *axes, pendulum=PENDULUM, start=np.zeros(4))
    assert {"rocking", "rest", "overturned"} <= set(m.counts)
    assert m.start == (0.0, 0.0, 0.0, 0.0)
    assert str(m).startswith("Design map from the initial state (0.0, 0.0, 0.0, 0.0)\n")
    for i, j in np.ndindex(m.status.shape):
        motion = replace(SCENE.excitation, frequency=float(m.x[j]))
        s = steady_state(
            replace(SCENE, excitation=motion).parameters(replace(PENDULUM, length=float(m.y[i])))
        )
        assert m.status[i, j] == status_name(s.status)
        # On an orbit known to rounding; or followed until it repeats within 1e-6 of nu or nu + f, which
        # leaves that over one less the multiplier: the bob's is close to one.
        by_tilt, by_bob = (1e-12, 1e-12) if m.exact[i, j] else (1e-6, 1e-4)
        np.testing.assert_allclose(m.amplitude[i, j], float(s.amplitude), rtol=1e-12, atol=by_tilt)
        np.testing.assert_allclose(m.swing[i, j], float(s.swing), rtol=1e-10, atol=by_bob)
    assert m.exact[(m.status == "rest") | (m.status == "overturned")].all()
    assert m.exact[m.status == "rocking"].any()
    assert not m.exact.all()


@pytest.mark.parametrize(
    ("subject", "x", "y", "match"),
    [
        (WITHOUT, ("omega", [1.0, 2.0]), LINE, "`x` must be one of nu, mu.* but is 'omega'"),
        (WITHOUT, LINE, LINE, "`x` and `y` must differ, but both are 'f'"),
        (WITHOUT, ("xi", [2.0, 1.0]), LINE, "`values of x` must be a vector of 2 or more increasing"),
        (SCENE, ("frequency", [1.0, 2.0]), LINE, "must not both move f, but 'frequency' does so as well"),
        # A corner out of range, though both axes are within theirs.
        (SCENE, ("width", [0.3, 0.41]), ("height", [0.8, 1.0]), r"`nu` must be between .* but is 0\.5125"),
    ],
)
def test_invalid_axes_are_rejected(subject, x, y, match):
    with pytest.raises(ValueError, match=match):
        design_map(subject, x, y)


def test_an_axis_can_have_values_that_only_the_other_axis_allows():
    # No width here goes with the scene's own height of 0.4 m.
    m = design_map(SCENE, ("width", [0.3, 0.4]), ("height", [0.8, 1.0]))
    scene = replace(SCENE, block=replace(SCENE.block, width=0.4, height=0.8))
    assert m.margin[0, 1] == pytest.approx(float(uplift(scene.parameters()).margin), rel=1e-12)


def test_a_map_plot_colours_rocking_cells_and_hatches_other_cells():
    m = over_motion()
    ax = tpd.plot(m)
    assert ax.get_xlabel() == "frequency of the excitation (Hz)"
    assert ax.get_ylabel() == "amplitude of the excitation (m)"
    for axes, drawn in ((ax, m.status == "rocking"), (tpd.plot(m, "swing"), m.status != "unstable")):
        (mesh,) = [c for c in axes.collections if isinstance(c, QuadMesh)]
        shown = ~np.ma.getmaskarray(np.ma.masked_invalid(mesh.get_array())).reshape(m.status.shape)
        np.testing.assert_array_equal(shown, drawn)
    with pytest.raises(ValueError, match="`quantity` must be one of amplitude, swing, margin"):
        tpd.plot(m, "status")
    labels = {text.get_text() for text in ax.get_legend().get_texts()}
    assert labels == {"rest; no attracting orbit", "unstable orbits only"}
    assert [t.get_text() for t in ax.texts] == ["uplift margin 0"]
    assert ax.figure.axes[1].get_ylabel() == r"largest tilt $|\varphi|$ (rad)"


@pytest.mark.parametrize(
    "x",
    [
        (0.1925, 0.375, 0.3912, 0.2995, 0.0, 0.2534, 2.6557, 0.5332),
        (0.155, 0.3546, 0.608, 0.0891, 0.0442, 0.122, 1.5464, 0.8054),
    ],
)
def test_a_map_without_an_orbit_does_not_claim_that_none_exists(x):
    p = Parameters(**dict(zip(("nu", "mu", "lam", "zeta", "k", "f", "xi", "e"), x, strict=True)))
    axes = ("zeta", [p.zeta, 1.001 * p.zeta]), ("f", [p.f, 1.0001 * p.f])
    m = design_map(p, *axes)
    assert set(m.counts) == {"not_known"}
    assert np.all(np.isnan(m.amplitude))
    assert m.margin.max() < 0.0
    # From a start a motion settles, or the block overturns: the map without one knows neither.
    assert "not_known" not in design_map(p, *axes, start=np.zeros(4)).counts
    legend = tpd.plot(m).get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["no orbit found"]
