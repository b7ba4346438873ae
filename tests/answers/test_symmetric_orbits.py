"""All symmetric period-one orbits at once: known answers, derivatives, where orbits end, and limits.

`tests/exact` has the search, the multipliers and the swings."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.answers.test_bifurcations import BARE as FOLDING
from tests.answers.test_bifurcations import Kind, lost
from tests.exact.orbits import Answers, among, chosen, full, solve
from tests.reference import BARE, CONSERVING, MOVING, NAMES, UNSTABLE, differences, exact, named, parameters
from tpd import status_name, symmetric_orbits
from tpd.theory.equations import Linear

LOW = np.array([0.08, 0.0, 0.05, 0.0, 0.0, 0.02, 0.6, 0.5])
HIGH = np.array([0.35, 0.5, 2.0, 1.2, 0.15, 0.6, 6.0, 1.0])
"""The box that random scenes are drawn from, in NAMES."""
NUMBERS = ("amplitude", "stroke", "state", "phase", "crossing", "multipliers", "slopes")
F, XI = NAMES.index("f"), NAMES.index("xi")


@functools.cache
def known():
    """Of the cases, and last of the unstable one."""
    return solve([*(case.x for case in MOVING), UNSTABLE[0]])


def of_case(case):
    """The largest orbit of a case."""
    i = MOVING.index(case)
    return Answers(*(a[i] if a.ndim == 1 else a[i, 0] for a in known()))


def power(distances, values):
    """The exponent of a power law."""
    return float(np.polyfit(np.log(distances), np.log(values), 1)[0])


@pytest.mark.parametrize("case", MOVING, ids=named)
def test_amplitude_and_gradient_are_the_known_ones(case):
    o, expected = of_case(case), np.array(case.gradient)
    assert o.status == "rocking"
    assert o.amplitude == pytest.approx(case.amplitude, rel=case.amplitude_rtol, abs=case.amplitude_atol)
    there = np.isfinite(expected)
    found = o.slopes[0, :7][there]
    np.testing.assert_allclose(found, expected[there], rtol=case.gradient_rtol, atol=case.gradient_atol)


def test_a_repelling_orbit_is_found_and_called_unstable():
    _, amplitude, half = UNSTABLE
    o = known()
    assert list(o.status[-1]) == ["unstable", "no_orbit", "no_orbit"]
    assert o.amplitude[-1, 0] == pytest.approx(amplitude, abs=5e-7)
    assert np.sqrt(np.abs(o.multipliers[-1, 0]).max()) == pytest.approx(half, abs=5e-4)


def test_an_attracting_orbit_is_the_steady_state_from_its_own_state():
    for x, o in [(full(case.x), of_case(case)) for case in MOVING] + chosen(20, "rocking"):
        s = exact(x, o.state).steady
        assert status_name(s.status) == "rocking"
        assert s.periods == 1
        assert o.amplitude == pytest.approx(float(s.amplitude), rel=1e-11)
        assert o.stroke == pytest.approx(float(s.stroke), rel=1e-11)
        np.testing.assert_allclose(o.state, s.state, rtol=0, atol=1e-11 * np.abs(o.state).max())


def test_multipliers_multiply_to_the_closed_form_determinant():
    # Volume shrinks by exp(trace) along the arcs, by e^2 in each crossing (rates and their share of
    # time both shrink by e), and by the ratio of the accelerations in each turn, twice per period.
    for x, o in [*chosen(12, "rocking"), *chosen(6, "unstable")]:
        linear = Linear(parameters(x))
        trace = -np.trace(np.linalg.solve(linear.mass, linear.damping))
        expected = np.exp(2.0 * np.pi / x[6] * trace) * x[7] ** 4 * o.sticking**2
        assert np.prod(o.multipliers) == pytest.approx(expected, rel=1e-9, abs=1e-15)


# Derivatives


def by_differences(x, amplitude, share):
    """d(amplitude, stroke, state, phase, crossing, two margins)/d(parameters) of the orbit nearest in
    amplitude, shape (10, 8)."""
    asked = []
    for i in range(8):
        differences(lambda y: asked.append(y) or 0.0, x, i, share=share)
    o = solve(asked)
    row, nearest = np.arange(len(asked)), np.nanargmin(np.abs(o.amplitude - amplitude), axis=1)
    numbers = (o.amplitude, o.stroke, *np.moveaxis(o.state, -1, 0), o.phase, o.crossing, o.fold, o.symmetry)
    values = iter(np.stack(numbers, axis=-1)[row, nearest])
    return np.stack([differences(lambda y: next(values), x, i, share=share) for i in range(8)], axis=-1)


@pytest.mark.parametrize("kind", ["rocking", "unstable"])
def test_slopes_are_those_of_differences(kind):
    # Far from where orbits are lost, and with room for steps of 0.4 %: their sixth power, and round-off over
    # them, both leave about 1e-10.
    safe = [
        (x, o)
        for x, o in chosen(20 if kind == "unstable" else 40, kind)
        if abs(o.fold) > 0.3 and o.sticking > 0.05 and o.grazing > 0.02 and x[3] > 0.02 and x[1] > 0.02
    ][:8]
    assert len(safe) >= 5
    errors = []
    for x, o in safe:
        expected = by_differences(x, o.amplitude, 0.004)
        errors.append(np.abs(o.slopes - expected).max(axis=1) / np.abs(expected).max(axis=1))
    sizes, strokes, states = np.array(errors)[:, 0], np.array(errors)[:, 1], np.array(errors)[:, 2:]
    assert np.median(sizes) < 1e-8
    assert np.max(sizes) < 1e-6
    assert np.max(states) < 1e-5
    # One may have another peak of the bob taking over within the steps.
    assert np.sort(strokes)[-2] < 1e-5


def test_reverse_mode_gives_the_same_gradient_and_second_derivatives_are_refused():
    x = jnp.asarray(full(MOVING[0].x))

    def size(x):
        return symmetric_orbits(parameters(x)).amplitude[0]

    np.testing.assert_allclose(jax.jit(jax.grad(size))(x), of_case(MOVING[0]).slopes[0], rtol=1e-11)
    # Traced only: that forward mode over reverse mode is possible at all.
    assert jax.eval_shape(jax.hessian(size), x).shape == (8, 8)


def test_a_neutral_orbit_has_the_gradient_of_differences():
    o = among(CONSERVING[0], "f", CONSERVING[0][F] + np.array([0.0, -1e-5, 1e-5]))
    assert o.status[0, 0] == "neutral"
    _, down, up = o.amplitude[:, 0]
    assert o.slopes[0, 0, 0, F] == pytest.approx((up - down) / 2e-5, rel=1e-6)


# Where orbits end


def test_at_a_fold_the_margin_vanishes_as_a_root_and_the_gradient_grows_as_its_inverse():
    b, distances = lost(Kind.fold), 10.0 ** np.linspace(-9.0, -3.0, 13)
    o = among(FOLDING, "f", b.value * (1.0 + distances))
    for j, sign in ((0, 1.0), (1, -1.0)):
        assert power(distances, sign * o.fold[:, j]) == pytest.approx(0.5, abs=0.05)
        slopes = sign * o.slopes[:, j, 0, F]
        assert power(distances, slopes) == pytest.approx(-0.5, abs=0.005)
        # It is that of the root: twice the distance times the slope is how far the amplitude has come.
        come = sign * (o.amplitude[:, j] - b.amplitude)
        np.testing.assert_allclose(2.0 * distances * b.value * slopes, come, rtol=2e-2)


def test_at_a_fold_there_is_no_gradient_and_beyond_it_no_orbit():
    o = among(FOLDING, "f", lost(Kind.fold).value * (1.0 + np.array([5e-14, -1e-6])))
    assert set(o.status[0]) <= {"near_fold", "no_orbit"}
    assert np.all(np.isnan(o.slopes[0]))
    assert set(o.status[1]) == {"no_orbit"}
    assert np.all(np.isnan(o.amplitude[1]))


def test_where_symmetry_breaks_the_orbit_loses_its_stability_and_keeps_its_gradient():
    b, distances = lost(Kind.symmetry_breaking), 10.0 ** np.linspace(-7.0, -3.0, 9)
    assert b.value == pytest.approx(1.0443, abs=5e-4)
    below, above = (among(UNSTABLE[0], "xi", b.value * (1.0 + s * distances)) for s in (-1.0, 1.0))
    for o, sign, status in ((below, -1.0, "unstable"), (above, 1.0, "rocking")):
        assert set(o.status[:, 0]) == {status}
        assert power(distances, sign * o.symmetry[:, 0]) == pytest.approx(1.0, abs=0.01)
        assert np.all(np.abs(np.abs(o.multipliers[:, 0]).max(axis=1) - 1.0) < 50.0 * distances)
    np.testing.assert_allclose(below.slopes[0, 0, :6], above.slopes[0, 0, :6], rtol=1e-4, atol=1e-5)


def test_where_there_is_no_orbit_everything_about_it_is_nan():
    o = solve([(0.2, 0.1, 0.4, 0.2, 0.03, 0.02, 4.0), (0.2, 0.1, 0.4, 0.2, 0.03, 0.0, 4.0)])
    assert np.all(o.status == "no_orbit")
    assert all(np.all(np.isnan(getattr(o, name))) for name in NUMBERS)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(x=st.tuples(*(st.floats(a, b) for a, b in zip(LOW, HIGH, strict=True))))
def test_there_is_never_a_nan_without_a_status(x):
    o = solve([x])
    there = np.isin(o.status, ("rocking", "unstable"))
    assert np.all(there | np.isin(o.status, ("near_fold", "grazing", "no_orbit", "neutral")))
    for name in (*NUMBERS, "fold", "symmetry", "sticking"):
        assert np.all(np.isfinite(getattr(o, name)[there])), name
    for name in ("amplitude", "stroke", "sticking", "grazing"):
        assert np.all(getattr(o, name)[there] > 0), name
    assert np.all(np.diff(o.amplitude[o.exists]) < 0)
    largest = np.abs(o.multipliers).max(axis=-1)
    assert np.all((largest < 1.0)[o.status == "rocking"])
    assert np.all((largest >= 1.0)[o.status == "unstable"])


# Limits


def gap(a, b):
    """Largest distance from a number of one set to the nearest of the other, over the largest."""
    apart = np.abs(a[:, None] - b)
    return max(apart.min(axis=0).max(), apart.min(axis=1).max()) / np.abs(b).max()


@pytest.mark.parametrize("case", BARE[:2], ids=named)
def test_a_massless_bob_cannot_be_felt_whatever_its_rod_and_hinge(case):
    rods = ((0.4, 0.0), (1.5, 0.6), (0.1, 1.0), (0.7, 2.5))
    o, i = solve([(*case.x[:2], *rod, *case.x[4:]) for rod in rods]), MOVING.index(case)
    for j in (0, 1):
        np.testing.assert_allclose(o.amplitude[:, j], known().amplitude[i, j], rtol=1e-13)
        assert all(gap(found, known().multipliers[i, j]) < 1e-10 for found in o.multipliers[:, j])
        np.testing.assert_allclose(o.slopes[:, j, 0, 2:4], 0.0, atol=1e-11)


def test_a_light_bob_is_nearly_no_bob():
    x, masses = BARE[0].x, np.array([1e-12, 1e-9, 1e-6])
    bare, o = of_case(BARE[0]), among(x, "mu", masses)
    expected = bare.slopes[0, 1] * masses
    np.testing.assert_allclose(o.amplitude[:, 0] - bare.amplitude, expected, rtol=1e-4, atol=1e-15)
    for slopes in o.slopes[:, 0, 0, 4:]:
        np.testing.assert_allclose(slopes, bare.slopes[0, 4:], rtol=1e-4)


def test_an_undamped_hinge_is_no_exception():
    damping = np.array([0.0, 1e-9, 1e-6])
    o = among(MOVING[3].x, "zeta", damping)
    assert np.all(np.isfinite(o.slopes[:, 0]))
    expected = o.slopes[0, 0, 0, 3] * damping
    np.testing.assert_allclose(o.amplitude[:, 0] - o.amplitude[0, 0], expected, rtol=1e-4, atol=1e-15)


def test_critical_damping_of_the_bob_is_smoothly_passed():
    x = MOVING[1].x

    def swings(zeta):
        linear = Linear(parameters((*x[:3], zeta, *x[4:])))
        inverse = np.linalg.inv(linear.mass)
        lower = np.hstack([-inverse @ linear.stiffness, -inverse @ linear.damping])
        return bool(np.any(np.imag(np.linalg.eigvals(np.vstack([np.eye(4)[2:], lower])))))

    low, high = 0.2, 2.0
    assert swings(low)
    assert not swings(high)
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if swings(middle) else (low, middle)
    steps = np.array([0.0, 1e-3, -1e-3, 1e-6, -1e-6, 1e-9, -1e-9, 1e-12, -1e-12])
    o = among(x, "zeta", low + steps)
    assert np.all(o.status[:, 0] == "rocking")
    moved = o.amplitude[:, 0] - o.amplitude[0, 0]
    np.testing.assert_allclose(moved, o.slopes[0, 0, 0, 3] * steps, rtol=5e-3, atol=1e-14)
    for i, step in enumerate(steps):
        np.testing.assert_allclose(o.slopes[i, 0], o.slopes[0, 0], rtol=0, atol=20 * abs(step) + 1e-9)
        assert gap(o.multipliers[i, 0], o.multipliers[0, 0]) < 100 * abs(step) + 1e-8
