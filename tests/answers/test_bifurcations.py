"""Where symmetric orbits are lost, against simulation, differences and what orbits are left beside it."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np
import pytest

from tests import reference
from tests.reference import UNSTABLE
from tpd import Parameters
from tpd.answers import bifurcations as module
from tpd.answers.bifurcations import Bifurcation, Kind, Sweep, along, bifurcations
from tpd.scene.quantities import Axis

NAMES = (*reference.NAMES[:8], "rho")
LOW = np.array([0.08, 0.0, 0.05, 0.0, 0.0, 0.02, 0.6, 0.5])
HIGH = np.array([0.35, 0.5, 2.0, 1.2, 0.15, 0.6, 6.0, 1.0])
"""The box that random scenes are drawn from, in NAMES without rho."""

WITHOUT = (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0, 1.0)
HELD = (0.217, 0.436, 0.754, 0.718, 0.122, 0.245, 2.344, 0.575)
"""Friction takes hold of its attracting orbit as the forcing falls."""
TOUCHING = (0.155, 0.4563, 1.0546, 0.3645, 0.02616, 0.152, 2.632, 0.8115)
"""Its repelling orbit stops falling for a moment as the forcing grows."""

LOST = (
    (Kind.fold, WITHOUT, "f", 0.05, 0.1),
    (Kind.symmetry_breaking, (*UNSTABLE[0], 1.0), "xi", 0.9, 1.2),
    (Kind.sticking, HELD, "f", 0.3, 0.4),
    (Kind.grazing, TOUCHING, "f", 0.297, 0.33),
)
"""One of each kind, alone in its range."""


def parameters(x: Any) -> Parameters:
    """The parameters in a vector of up to nine, in NAMES; rho is tied to nu without a ninth."""
    return Parameters(**dict(zip(NAMES, map(float, x), strict=False)))


def sweep(p: Parameters, name: str, values: Any) -> Sweep:
    return along(Axis.of(p, name), np.asarray(values))


@functools.cache
def lost(kind: Kind) -> Bifurcation:
    _, x, name, low, high = next(case for case in LOST if case[0] is kind)
    (found,) = bifurcations(parameters(x), name, low, high)
    assert found.kind is kind
    return found


def at(kind: Kind, values: Any) -> Sweep:
    _, x, name, _, _ = next(case for case in LOST if case[0] is kind)
    return sweep(parameters(x), name, values)


@pytest.mark.parametrize("kind", [case[0] for case in LOST])
def test_a_bifurcation_is_located_to_rounding_at_the_end_of_its_branch(kind):
    b = lost(kind)
    assert b.error < 1e-14
    near = at(kind, b.value * (1.0 + 1e-3 * np.array([-1.0, 1.0])))
    counts = np.sum(near.branch >= 0, axis=1)
    known = {
        Kind.fold: (2, "no_orbit", "rocking"),
        Kind.symmetry_breaking: (0, "unstable", "rocking"),
        Kind.sticking: (1, "no_orbit", "rocking"),
        Kind.grazing: (1, "unstable", "no_orbit"),
    }
    assert (abs(counts[1] - counts[0]), b.below, b.above) == known[kind]
    place = np.array([b.amplitude, b.crossing, b.phase])
    places = np.stack([near.amplitude, near.crossing, near.phase], axis=-1)
    assert np.nanmin(np.abs(places - place).max(axis=-1)) < (0.1 if kind is Kind.fold else 0.01)
    for status, row, other in ((b.below, 0, 1), (b.above, 1, 0)):
        gone = counts[row] < counts[other]
        assert status == "no_orbit" if gone else status in near.status[row]


@pytest.mark.parametrize("case", LOST, ids=[case[0].value for case in LOST])
def test_derivatives_of_a_bifurcation_equal_finite_differences(case):
    kind, x, name, _, _ = case
    b = lost(kind)

    def value(n: str, step: float) -> float:
        y = np.array(x)
        y[NAMES.index(n)] += step
        near = bifurcations(parameters(y), name, 0.99 * b.value, 1.01 * b.value, samples=8)
        (found,) = [a.value for a in near if a.kind is kind]
        return found

    varied = [n for n in NAMES[:-1] if n != name and x[NAMES.index(n)] > 0]
    assert set(b.slopes) == {*NAMES[:-1], "kappa"} - {name}
    scale = max(abs(b.slopes[n]) for n in varied)
    # Every second one: two kinds share each.
    for n in varied[LOST.index(case) % 2 :: 2]:
        step = 1e-4 * x[NAMES.index(n)]
        # An impact cannot return more than it took.
        ahead = 0.0 if n == "e" and x[7] == 1.0 else step
        expected = (value(n, ahead) - value(n, -step)) / (ahead + step)
        error = 1e-6 if ahead else 1e-3
        assert b.slopes[n] == pytest.approx(expected, rel=error, abs=1e-6 * scale), n


def random_ranges(count: int, seed: int) -> list[tuple[np.ndarray, str, float, float]]:
    """Scenes from all over the box, and a parameter to vary: mostly forcing or frequency."""
    rng = np.random.default_rng(seed)
    scenes = rng.uniform(LOW, HIGH, size=(count, 8))
    which = rng.choice(8, size=count, p=[0.06, 0.06, 0.06, 0.06, 0.1, 0.3, 0.3, 0.06])
    return [(x, NAMES[i], LOW[i], HIGH[i]) for x, i in zip(scenes, which, strict=True)]


@pytest.mark.parametrize(("x", "name", "low", "high"), random_ranges(2, 3))
def test_the_number_of_orbits_is_constant_between_bifurcations(x, name, low, high):
    """A fine sweep shows one number of orbits, and of those with det(I + G) < 0, from point to point."""
    found = bifurcations(parameters(x), name, low, high)
    assert not [b for b in found if b.reason or b.error > 1e-12 * abs(b.value) + 1e-15]
    s, apart = sweep(parameters(x), name, np.linspace(low, high, 513)), 3e-3 * (high - low)
    counts = np.sum(s.branch >= 0, axis=1)
    leaning = np.sum((s.branch >= 0) & (np.asarray(s.margins.symmetry) < 0), axis=1)
    for a, b in itertools.pairwise([low, *(b.value for b in found), high]):
        between = (s.value > a + apart) & (s.value < b - apart)
        assert len(set(counts[between])) <= 1, (a, b)
        assert len(set(leaning[between])) <= 1, (a, b)


def test_an_end_without_a_cause_is_reported_as_unresolved(monkeypatch):
    b = lost(Kind.sticking)
    monkeypatch.setattr(module, "_located", lambda *_: None)
    (found,) = bifurcations(parameters(HELD), "f", 0.3, 0.4, samples=20)
    assert found.kind is Kind.unresolved
    assert "no fold or sticking or grazing was found" in found.reason
    assert abs(found.value - b.value) <= found.error < 1e-7


def test_a_sweep_joins_orbits_of_a_continuous_branch():
    s = sweep(parameters(WITHOUT), "xi", np.linspace(0.8, 3.0, 221))
    # The largest goes on where it loses its symmetry; the repelling one begins by sticking.
    assert s.branches == 2
    rows, columns = s.line(0)
    np.testing.assert_array_equal(rows, np.arange(221))
    assert np.all(np.diff(s.amplitude[rows, columns]) < 0)
    assert np.abs(np.diff(s.amplitude[rows, columns], 2)).max() < 1e-3
    assert set(s.status[s.line(0)]) == {"unstable", "rocking"}
    assert set(s.status[s.line(1)]) == {"unstable"}
    assert np.all(np.diff(s.line(1)[0]) == 1)


@pytest.mark.parametrize(
    ("name", "high", "samples", "match"),
    [
        ("omega", 2.0, 20, "`name` must be one of nu, mu.* but is 'omega'"),
        ("f", 0.1, 20, r"`\(low, high\)` must be an interval"),
        ("f", 0.2, 7, "`samples` must be between 8 and"),
    ],
)
def test_invalid_ranges_are_rejected(name, high, samples, match):
    with pytest.raises(ValueError, match=match):
        bifurcations(parameters(WITHOUT), name, 0.15, high, samples=samples)


def test_without_friction_an_orbit_ends_at_a_grazing_impact():
    x = (0.1343, 0.0, 1.4612, 0.4698, 0.0, 0.1642, 1.8812, 0.4278)
    (b,) = bifurcations(parameters(x), "f", 0.15, 0.2)
    assert (b.kind, b.below, b.above) == (Kind.grazing, "unstable", "no_orbit")
    # The block turns back from f = 0.15318 on, and is not lost there.
    assert b.value == pytest.approx(0.165005, abs=1e-6)
    assert b.error < 1e-14
    distances = 10.0 ** np.linspace(-6.0, -3.0, 4)
    near = sweep(parameters(x), "f", np.sort(b.value * (1.0 - distances)))
    row = np.argsort(-distances)
    margin = np.asarray(near.margins.grazing)[np.arange(4), near.branch.argmax(axis=1)]
    # The tilt at the turn between the impacts vanishes in proportion.
    assert np.polyfit(np.log(distances[row]), np.log(margin), 1)[0] == pytest.approx(1.0, abs=0.01)

    def value(nu: float) -> float:
        (found,) = bifurcations(parameters((nu, *x[1:])), "f", 0.15, 0.2)
        return found.value

    expected = (value(x[0] + 1e-5) - value(x[0] - 1e-5)) / 2e-5
    assert b.slopes["nu"] == pytest.approx(expected, rel=1e-6)
