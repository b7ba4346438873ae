"""Curves of folds against bisected orbits, differences, and the orbits on both sides."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from tests.reference import orbits_of
from tests.theory.test_harmonic_balance import FOLDS
from tpd import Harmonic, Parameters, Scene, fold_curve, theory
from tpd.answers.bifurcations import Kind, bifurcations
from tpd.answers.fold_curve import End, FoldCurve
from tpd.compiled.columns import CROSSED, MERGED, TURNING
from tpd.compiled.orbits import vanishing
from tpd.compiled.rows import row_of
from tpd.scene.parameters import NAMES
from tpd.scene.scene import Block

CUSP = Parameters(nu=0.2626, mu=0.2096, lam=0.6445, zeta=0.0848, k=0.0577, f=0.2339, xi=2.3789, e=0.7943)
"""Its folds over k and f end in a cusp."""
ISLAND = Parameters(
    nu=0.0844, mu=0.06, lam=0.4727, zeta=0.137, k=0.0278, f=0.0602, xi=2.504, rho=0.3257, e=0.8094
)
"""Its folds over mu and zeta are a closed curve."""
CHIMNEY = Scene(Block(width=1.0, height=4.0, mass=2000.0), Harmonic(amplitude=0.03, frequency=1.5))


def scene(i: int) -> Parameters:
    """One of the scenes with known folds, at its fold."""
    numbers, _, exact, _ = FOLDS[i]
    return Parameters(**numbers, f=exact)


def at(p: Parameters, curve: FoldCurve, place: Any) -> Parameters:
    return dataclasses.replace(p, **{curve.x_name: float(place[0]), curve.y_name: float(place[1])})


def has_orbit(p: Parameters) -> bool:
    return bool(np.isfinite(orbits_of(p).amplitude).any())


CURVES = (
    (0, "k", "f", {"x_range": (0.0, 0.2), "y_range": (0.01, 0.3)}),
    (1, "mu", "lam", {"x_range": (0.01, 0.3), "y_range": (0.1, 2.0)}),
    (2, "e", "zeta", {}),
)


@pytest.fixture(scope="module", params=CURVES, ids=lambda c: f"{c[0]}-{c[1]}-{c[2]}")
def followed(request):
    i, x, y, ranges = request.param
    return scene(i), fold_curve(scene(i), x, y, **ranges)


def test_every_point_of_a_fold_curve_satisfies_the_fold_equations(followed):
    p, curve = followed
    assert len(curve.points) > 20
    for place, crossing, phase in zip(curve.points, curve.crossing, curve.phase, strict=True):
        row = np.array(row_of(at(p, curve, np.clip(place, 0.0, None))), dtype=float)
        values = vanishing(np.array([crossing, phase, 1.0]), row).values[[TURNING, CROSSED, MERGED]]
        assert np.abs(values).max() < 1e-9
    assert np.all(curve.amplitude > 0.0)
    assert np.all((curve.phase > -np.pi) & (curve.phase <= np.pi))


def test_orbits_exist_on_one_side_of_the_fold_curve_only(followed):
    p, curve = followed
    size = np.ptp(curve.points, axis=0)
    for i in range(2, len(curve.points) - 2, max(len(curve.points) // 8, 1)):
        normal = curve.gradients[i] * size
        step = 1e-4 * normal / np.linalg.norm(normal) * size
        assert has_orbit(at(p, curve, curve.points[i] - step))
        assert not has_orbit(at(p, curve, curve.points[i] + step))


def test_tangents_and_gradients_are_derivatives_of_the_fold_curve(followed):
    _, curve = followed
    steps = curve.points[2:] - curve.points[:-2]
    scale = np.abs(curve.tangents).max(axis=0)
    along, tangents = steps / scale, curve.tangents[1:-1] / scale
    cosines = (
        np.sum(along * tangents, axis=1) / np.linalg.norm(along, axis=1) / np.linalg.norm(tangents, axis=1)
    )
    assert cosines.min() > 0.95
    across = np.sum(curve.tangents * curve.gradients, axis=1)
    sizes = np.linalg.norm(curve.tangents, axis=1) * np.linalg.norm(curve.gradients, axis=1)
    assert np.abs(across / sizes).max() < 1e-9


@pytest.mark.parametrize("i", range(3))
def test_the_fold_curve_passes_through_the_fold_from_bisection(i):
    p, exact = scene(i), FOLDS[i][2]
    curve = fold_curve(p, "xi", "f", x_range=(1.5, 5.0))
    order = np.argsort(curve.points[:, 0])
    x, y = curve.points[order].T
    # Between two points the curve is a cubic with their tangents.
    j = np.searchsorted(x, p.xi) - 1
    slopes = (curve.tangents[:, 1] / curve.tangents[:, 0])[order]
    h = x[j + 1] - x[j]
    s = (p.xi - x[j]) / h
    value = (1 + 2 * s) * (1 - s) ** 2 * y[j] + s**2 * (3 - 2 * s) * y[j + 1]
    value += h * s * (1 - s) * ((1 - s) * slopes[j] - s * slopes[j + 1])
    assert value == pytest.approx(exact, abs=1e-6)
    # The law in closed form is a little above, except at low frequencies.
    laws = np.array([float(theory.fold(dataclasses.replace(p, xi=xi)).f) for xi in x]) / y
    assert np.all((laws > 0.98) & (laws < 1.08))
    assert np.all(laws[x > 2.0] > 1.0)


def test_slopes_equal_the_derivatives_of_the_forcing_at_the_fold():
    p = dataclasses.replace(scene(1), rho=0.72)
    curve = fold_curve(p, "xi", "f", x_range=(1.5, 5.0))
    middle = len(curve.points) // 2
    here, slopes = at(p, curve, curve.points[middle]), dict(zip(NAMES, curve.slopes[middle], strict=True))
    (known,) = [
        b for b in bifurcations(here, "f", 0.9 * here.f, 1.1 * here.f, samples=20) if b.kind is Kind.fold
    ]
    assert known.value == pytest.approx(here.f, rel=1e-12)
    assert slopes.pop("f") == pytest.approx(-1.0, rel=1e-12)
    assert known.slopes == pytest.approx(slopes, rel=1e-7, abs=1e-9)
    assert curve.gradients[middle] == pytest.approx([slopes["xi"], -1.0], rel=1e-12)


def test_a_fold_curve_ends_at_a_cusp():
    curve = fold_curve(CUSP, "k", "f")
    assert curve.statuses == (End.bound, End.cusp)
    k, f = curve.points[-1]
    counts = []
    for shift in (-0.003, 0.003):
        found = bifurcations(dataclasses.replace(CUSP, k=k + shift), "f", 0.97 * f, 1.03 * f)
        counts.append(sum(b.kind is Kind.fold for b in found))
    assert counts == [1, 0]


def test_a_fold_curve_ends_if_its_orbit_is_no_valid_motion():
    curve = fold_curve(scene(0), "k", "f")
    assert curve.statuses == (End.bound, End.no_orbit)
    k, f = curve.points[-1]
    # With more friction the block sticks at the turn before both orbits merge.
    found = bifurcations(dataclasses.replace(scene(0), k=1.02 * k), "f", 0.95 * f, 1.1 * f)
    assert Kind.fold not in {b.kind for b in found}
    assert Kind.sticking in {b.kind for b in found}


def test_the_folds_over_mass_and_damping_of_the_bob_can_form_a_closed_curve():
    curve = fold_curve(ISLAND, "mu", "zeta", x_range=(0.01, 0.4), y_range=(0.01, 1.0))
    assert curve.statuses == (End.closed, End.closed)
    np.testing.assert_array_equal(curve.points[0], curve.points[-1])
    # The direction turns once around, and the gradients point inwards, where both orbits are lost.
    turns = np.unwrap(np.arctan2(*(curve.tangents / (0.39, 0.99)).T))
    assert abs(turns[-1] - turns[0]) == pytest.approx(2 * np.pi)
    assert not has_orbit(ISLAND)
    middle = curve.points.mean(axis=0)
    assert np.all(np.sum((middle - curve.points) * curve.gradients, axis=1) > 0.0)
    for place in curve.points[::8]:
        assert not has_orbit(at(ISLAND, curve, place + 0.02 * (middle - place)))
        assert has_orbit(at(ISLAND, curve, place - 0.02 * (middle - place)))


def test_a_fold_curve_stops_at_the_largest_number_of_points():
    curve = fold_curve(scene(1), "xi", "f", most=15)
    assert End.most_points in curve.statuses
    assert len(curve.points) <= 29


def test_a_range_without_a_fold_has_an_empty_curve():
    curve = fold_curve(scene(0), "k", "f", x_range=(0.01, 0.02), y_range=(0.5, 0.9))
    assert curve.points.shape == curve.tangents.shape == curve.gradients.shape == (0, 2)
    assert curve.statuses == (End.no_fold, End.no_fold)
    assert str(curve) == "Curve of folds in k and f: no fold"


def test_invalid_arguments_are_rejected_in_one_sentence():
    for arguments, options, message in (
        (("mu", "mu"), {}, "`x` and `y` must differ, but both are 'mu'"),
        (("mu", "kind"), {}, "`y` must be one of nu, mu, lam"),
        (("mu", "lam"), {"x_range": (0.2, 0.1)}, "`x_range` must be an interval low < high"),
        (("mu", "e"), {"y_range": (0.5, 1.5)}, "`e` must be"),
    ):
        with pytest.raises(ValueError, match=message):
            fold_curve(scene(0), *arguments, **options)
    with pytest.raises(
        ValueError, match="`y_range` must be given for 'frequency', which has no default range"
    ):
        fold_curve(CHIMNEY, "f", "frequency")
    with pytest.raises(ValueError, match="must not both move f"):
        fold_curve(CHIMNEY, "f", "frequency", y_range=(1.0, 2.0))
