"""All symmetric period-one orbits at once: known answers, derivatives, where orbits end, and limits.

`tests/compiled` has the search, the multipliers and the swings."""

import dataclasses
import functools
import re

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tpd
from tests.answers.test_bifurcations import HIGH, LOW, Kind, lost
from tests.answers.test_bifurcations import WITHOUT as FOLDING
from tests.compiled.orbit_cases import Answers, among, chosen, full, solve
from tests.properties.bounded import bounded
from tests.reference import CONSERVING, MOVING, NAMES, UNSTABLE, differences, exact, named
from tpd import status_name
from tpd.core import batch

NUMBERS = ("amplitude", "swing", "state", "phase", "crossing", "multipliers", "remaining", "slopes")
F, XI = NAMES.index("f"), NAMES.index("xi")


@functools.cache
def known():
    return solve([*(case.x for case in MOVING), UNSTABLE[0]])


def of_case(case):
    i = MOVING.index(case)
    return Answers(*(a[i] if a.ndim == 1 else a[i, 0] for a in known()))


def power(distances, values):
    return float(np.polyfit(np.log(distances), np.log(values), 1)[0])


@pytest.mark.parametrize("case", MOVING, ids=named)
def test_amplitude_and_gradient_equal_stored_references(case):
    o, expected = of_case(case), np.array(case.gradient)
    assert o.status == "rocking"
    assert o.amplitude == pytest.approx(case.amplitude, rel=case.amplitude_rtol, abs=case.amplitude_atol)
    there = np.isfinite(expected)
    found = o.slopes[0, :7][there]
    np.testing.assert_allclose(found, expected[there], rtol=case.gradient_rtol, atol=case.gradient_atol)


def test_an_orbit_with_a_multiplier_above_one_is_unstable():
    _, amplitude, half = UNSTABLE
    o = known()
    assert list(o.status[-1]) == ["unstable", "no_orbit", "no_orbit"]
    assert o.amplitude[-1, 0] == pytest.approx(amplitude, abs=5e-7)
    assert np.sqrt(np.abs(o.multipliers[-1, 0]).max()) == pytest.approx(half, abs=5e-4)


def test_a_stable_orbit_is_the_steady_state_from_its_state():
    for x, o in [(full(case.x), of_case(case)) for case in MOVING] + chosen(6, "rocking"):
        s = exact(x, o.state).steady
        assert status_name(s.status) == "rocking"
        assert s.periods == 1
        assert o.amplitude == pytest.approx(float(s.amplitude), rel=1e-11)
        assert o.swing == pytest.approx(float(s.swing), rel=1e-11)
        np.testing.assert_allclose(o.state, s.state, rtol=0, atol=1e-11 * np.abs(o.state).max())


def by_differences(x, amplitude, share):
    """d(amplitude, swing, state, phase, crossing, two margins, remaining)/d(parameters) of the orbit nearest
    in amplitude, shape (11, 8), by Richardson differences with steps of `share` of each parameter."""
    asked = []
    for i in range(8):
        differences(lambda y: asked.append(y) or 0.0, x, i, share=share)
    o = solve(asked)
    row, nearest = np.arange(len(asked)), np.nanargmin(np.abs(o.amplitude - amplitude), axis=1)
    numbers = (o.amplitude, o.swing, *np.moveaxis(o.state, -1, 0), o.phase, o.crossing, o.fold, o.symmetry)
    values = iter(np.stack((*numbers, o.remaining), axis=-1)[row, nearest])
    return np.stack([differences(lambda y: next(values), x, i, share=share) for i in range(8)], axis=-1)


@pytest.mark.parametrize("kind", ["rocking", "unstable"])
def test_derivatives_of_orbits_equal_finite_differences(kind):
    # Far from where orbits are lost, and with room for steps of 0.4 %.
    safe = [
        (x, o)
        for x, o in chosen(20, kind)
        if abs(o.fold) > 0.3 and o.sticking > 0.05 and o.grazing > 0.02 and x[3] > 0.02 and x[1] > 0.02
    ][:4]
    assert len(safe) >= 3
    errors, finer = [], []
    for x, o in safe:
        for share, found in ((0.004, errors), (0.002, finer)):
            expected = by_differences(x, o.amplitude, share)
            found.append(np.abs(o.slopes - expected).max(axis=1) / np.abs(expected).max(axis=1))
    sizes, swings, states = np.array(errors)[:, 0], np.array(errors)[:, 1], np.array(errors)[:, 2:-1]
    assert np.max(sizes) < 1e-6
    assert np.max(states) < 1e-5
    # The factor contains sixteenth powers of the half map, so that it needs smaller steps.
    assert np.max(np.array(errors)[:, -1]) < 1e-4
    assert np.max(np.array(finer)[:, -1]) < 5e-6
    # One may have another peak of the bob taking over within the steps.
    assert np.sort(swings)[-2] < 1e-5


def test_the_gradient_of_a_neutral_orbit_equals_differences():
    o = among(CONSERVING[0], "f", CONSERVING[0][F] + np.array([0.0, -1e-5, 1e-5]))
    assert o.status[0, 0] == "neutral"
    _, down, up = o.amplitude[:, 0]
    assert o.slopes[0, 0, 0, F] == pytest.approx((up - down) / 2e-5, rel=1e-6)


def test_an_orbit_has_no_gradient_at_a_fold_and_does_not_exist_beyond_it():
    o = among(FOLDING, "f", lost(Kind.fold).value * (1.0 + np.array([5e-14, -1e-6])))
    assert set(o.status[0]) <= {"near_fold", "no_orbit"}
    assert np.all(np.isnan(o.slopes[0]))
    assert set(o.status[1]) == {"no_orbit"}
    assert all(np.all(np.isnan(getattr(o, name)[1])) for name in NUMBERS)


def test_an_orbit_loses_stability_and_keeps_its_gradient_at_symmetry_breaking():
    b, distances = lost(Kind.symmetry_breaking), 10.0 ** np.linspace(-7.0, -3.0, 9)
    assert b.value == pytest.approx(1.0443, abs=5e-4)
    below, above = (among(UNSTABLE[0], "xi", b.value * (1.0 + s * distances)) for s in (-1.0, 1.0))
    for o, sign, status in ((below, -1.0, "unstable"), (above, 1.0, "rocking")):
        assert set(o.status[:, 0]) == {status}
        assert power(distances, sign * o.symmetry[:, 0]) == pytest.approx(1.0, abs=0.01)
        assert np.all(np.abs(np.abs(o.multipliers[:, 0]).max(axis=1) - 1.0) < 50.0 * distances)
    np.testing.assert_allclose(below.slopes[0, 0, :6], above.slopes[0, 0, :6], rtol=1e-4, atol=1e-5)


@bounded(60)
@given(x=st.tuples(*(st.floats(a, b) for a, b in zip(LOW, HIGH, strict=True))))
def test_every_nan_of_an_orbit_has_a_status(x):
    o = solve([x])
    there = np.isin(o.status, ("rocking", "unstable"))
    assert np.all(there | np.isin(o.status, ("near_fold", "grazing", "no_orbit", "neutral")))
    for name in (*NUMBERS, "fold", "symmetry", "sticking"):
        assert np.all(np.isfinite(getattr(o, name)[there])), name
    for name in ("amplitude", "swing", "sticking", "grazing"):
        assert np.all(getattr(o, name)[there] > 0), name
    assert np.all(np.diff(o.amplitude[o.exists]) < 0)
    largest = np.abs(o.multipliers).max(axis=-1)
    assert np.all((largest < 1.0)[o.status == "rocking"])
    assert np.all((largest >= 1.0)[o.status == "unstable"])


def test_an_undamped_hinge_is_the_limit_of_small_damping():
    damping = np.array([0.0, 1e-9, 1e-6])
    o = among(MOVING[3].x, "zeta", damping)
    assert np.all(np.isfinite(o.slopes[:, 0]))
    expected = o.slopes[0, 0, 0, 3] * damping
    np.testing.assert_allclose(o.amplitude[:, 0] - o.amplitude[0, 0], expected, rtol=1e-4, atol=1e-15)


def test_orbits_in_chunks_equal_vmap_and_use_compiled_code(monkeypatch):
    p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=np.linspace(1.5, 5.0, 7))
    mapped = jax.vmap(lambda xi: tpd.symmetric_orbits(dataclasses.replace(p, xi=xi)))(p.xi)
    done = []
    monkeypatch.setattr(batch, "_compiled", None)
    orbits = tpd.in_chunks(tpd.symmetric_orbits, p, chunk=2, workers=2, progress=lambda *x: done.append(x))
    assert jax.tree.structure(orbits) == jax.tree.structure(mapped)
    for x, y in zip(jax.tree.leaves(orbits), jax.tree.leaves(mapped), strict=True):
        assert isinstance(x, np.ndarray)
        assert (x.shape, x.dtype) == (y.shape, y.dtype)
        np.testing.assert_array_equal(x, y)
    assert done[-1] == (7, 7)
    one = dataclasses.replace(p, xi=2.0)
    with pytest.raises(ValueError, match="must be arrays of one length above zero"):
        tpd.in_chunks(tpd.symmetric_orbits, one)


def test_the_call_in_the_message_about_a_batch_runs():
    p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.5, zeta=0.1, k=0.05, f=0.3, xi=np.array([2.0, 4.0]))
    with pytest.raises(ValueError, match="must be single numbers") as refused:
        tpd.symmetric_orbits(p)
    (call,) = re.findall(r"`(tpd.in_chunks.*?)`", str(refused.value))
    assert eval(call, {"tpd": tpd, "p": p}).amplitude.shape == (2, 3)
