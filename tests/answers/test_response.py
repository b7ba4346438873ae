"""Branches over frequency, at constant acceleration and at constant amplitude of the base."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

import tpd
from tpd import Parameters, Pendulum, branches, paper_scene, settled_response
from tpd.answers.bifurcations import Bifurcation, Kind, bifurcations
from tpd.answers.response import Branches, frequencies, window
from tpd.scene.quantities import Setup
from tpd.theory.no_uplift import uplift

SCENE, PENDULUM = paper_scene(), Pendulum(mass=0.8, length=0.1, damping_ratio=0.1)
WITHOUT = Parameters(nu=0.2, mu=0.0, lam=0.4, zeta=0.2, k=0.05, f=0.1, xi=2.0)


@functools.cache
def without_it() -> Branches:
    return branches(WITHOUT, "xi", 0.9, 4.0, samples=125)


@functools.cache
def with_it() -> Branches:
    return branches(SCENE, "frequency", 1.7, 3.0, pendulum=PENDULUM, samples=100)


def fold() -> Bifurcation:
    (found,) = [b for b in with_it().bifurcations if b.kind is Kind.fold]
    return found


def test_branches_end_at_symmetry_breaking_and_sticking():
    breaking, sticking = without_it().bifurcations
    assert (breaking.kind, sticking.kind) == (Kind.symmetry_breaking, Kind.sticking)
    assert breaking.value == pytest.approx(1.0443, abs=5e-5)
    s = without_it().sweep
    rows, columns = s.line(0)
    np.testing.assert_array_equal(s.status[rows, columns] == "rocking", s.value[rows] > breaking.value)
    # The values crowd towards what happens: the branch ends at it, far within one even spacing.
    first = s.value[s.line(1)[0][0]]
    assert 0 < first - sticking.value < 1e-3 * (3.1 / 124)


def test_the_margin_of_a_branch_equals_the_closed_form_of_uplift():
    case = with_it()
    p = Setup.of(SCENE, PENDULUM).at({"frequency": case.sweep.value})
    assert set(np.sign(case.margin)) == {-1.0, 1.0}
    np.testing.assert_allclose(case.margin, np.asarray(uplift(p).margin), rtol=1e-12)
    np.testing.assert_allclose(case.rest_swing, np.asarray(uplift(p).swing), rtol=1e-12)


def test_the_fold_in_hz_equals_the_fold_in_xi():
    b, s = fold(), with_it().sweep
    p = Setup.of(SCENE, PENDULUM).at({"frequency": b.value})
    near = bifurcations(p, "xi", 0.99 * p.xi, 1.01 * p.xi, samples=40)
    (same,) = [a for a in near if a.kind is Kind.fold]
    assert same.value == pytest.approx(p.xi, rel=1e-12)
    assert same.amplitude == pytest.approx(b.amplitude, rel=1e-9)
    # Two branches turn into each other there.
    row = np.nonzero(s.value > b.value)[0][0]
    upper, lower = s.amplitude[row, np.argsort(np.abs(s.amplitude[row] - b.amplitude))[:2]]
    assert 0 < abs(upper - lower) < 3e-3 * b.amplitude


def test_the_settled_response_of_the_paper_has_its_known_amplitude():
    r, p = settled_response(SCENE, "frequency", [2.5, 1.5]), SCENE.parameters()
    assert list(r.status) == ["rocking", "rest"]
    # From the grid of exact solutions in the README.
    assert r.amplitude == pytest.approx([0.083334, 0.0], abs=5e-7)
    assert settled_response(p, "xi", [p.xi]).amplitude[0] == pytest.approx(r.amplitude[0], rel=1e-10)
    assert str(r).splitlines() == [
        "Response from rest over frequency: 2 values, 1.5 to 2.5 Hz",
        "  status      1 rocking, 1 rest",
        "  amplitude   0 to 0.08333 rad",
        f"  swing       {r.swing.min():.4g} to {r.swing.max():.4g} rad",
    ]
    assert r._repr_html_() == f"<pre>{r}</pre>"


def test_invalid_input_of_a_response_is_rejected():
    with pytest.raises(ValueError, match="`frequency` must be positive and finite, but is 0"):
        settled_response(SCENE, "frequency", [1.0, 0.0])
    with pytest.raises(ValueError, match="`name` must be one of"):
        branches(WITHOUT, "frequency", 1.0, 2.0)
    with pytest.raises(ValueError, match="`samples` must be a whole number, 8 or more"):
        branches(WITHOUT, "xi", 1.0, 2.0, samples=3)


def test_frequencies_are_denser_near_the_stated_frequency():
    values = frequencies(2.5, 1.0, 5.0, 41)
    near = values[np.abs(values / 2.5 - 1.0) < 0.05]
    np.testing.assert_allclose(near, 2.5 * (1.0 + 0.004 * np.arange(-12, 13)), rtol=1e-12)
    assert {1.0, 2.5, 5.0} <= set(values)
    assert np.all(np.diff(values) >= 0.004 * 2.5 * (1.0 - 1e-9))
    np.testing.assert_array_equal(frequencies(2.5, 4.0, 5.0, 3), [4.0, 4.5, 5.0])


def test_a_response_plot_distinguishes_stable_and_unstable_branches():
    (ax,) = tpd.plot(without_it())
    assert ax.get_xlabel() == r"frequency ratio $\xi$ = $\omega/\omega_0$ (-)"
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["without pendulum", "stable", "unstable", "symmetry breaks", "begins to stick"]
    tilt, bob = tpd.plot(with_it(), without=replace(with_it()))
    assert tilt.get_ylabel() == r"largest tilt $|\varphi|$ (rad)"
    assert bob.get_ylabel() == r"largest bob angle $|\psi|$ (rad)"
    b, s = fold(), with_it().sweep
    drawn = [line for line in tilt.lines if len(line.get_xdata())]
    marks = [line.get_xydata()[0] for line in drawn if line.get_marker() == "o"]
    np.testing.assert_allclose(marks, [[b.value, b.amplitude]] * 2)
    for style, stable in (("-", True), ("--", False)):
        lines = [line for line in drawn if line.get_linestyle() == style and len(line.get_xdata()) > 3]
        shown = {y for line in lines for y in line.get_ydata()}
        known = s.amplitude[((s.status == "rocking") == stable) & (s.branch >= 0)]
        assert set(known[np.isfinite(known)]) <= shown


def test_the_runs_near_a_frequency_lie_within_five_per_cent():
    assert window(2.0) == pytest.approx((1.9, 2.1))
