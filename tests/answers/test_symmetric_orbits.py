"""All symmetric period-one orbits at once, against simulation, a dense scan and differences."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from tests.reference import (
    BARE,
    CONSERVING,
    MOVING,
    NAMES,
    UNSTABLE,
    Case,
    along,
    differences,
    exact,
    named,
    parameters,
)
from tpd import Parameters, Status, simulate, status_name, symmetric_orbits
from tpd.core.batch import in_chunks
from tpd.exact.orbit_roots_kernel import NODES
from tpd.exact.terms import STATUSES
from tpd.models import compiled_orbits

BATCH = 64
"""Of everything computed here, so that one compilation serves all tests."""

LOW = np.array([0.08, 0.0, 0.05, 0.0, 0.0, 0.02, 0.6, 0.5])
HIGH = np.array([0.35, 0.5, 2.0, 1.2, 0.15, 0.6, 6.0, 1.0])
"""The box that random scenes are drawn from, in NAMES."""


class Answers(NamedTuple):
    """NumPy arrays with leading axes (scenes, orbits)."""

    status: np.ndarray
    """Names."""
    amplitude: np.ndarray
    stroke: np.ndarray
    state: np.ndarray
    phase: np.ndarray
    crossing: np.ndarray
    multipliers: np.ndarray
    fold: np.ndarray
    symmetry: np.ndarray
    sticking: np.ndarray
    grazing: np.ndarray
    slopes: np.ndarray
    """d(amplitude, stroke, state, phase, crossing, fold, symmetry)/d(parameters), shape (scenes, orbits,
    10, 8)."""
    overflow: np.ndarray

    @property
    def exists(self) -> np.ndarray:
        """Where there is an orbit."""
        return self.status != "no_orbit"


def _solve(x: jax.Array) -> tuple:
    def sizes(x: jax.Array) -> tuple:
        o = symmetric_orbits(parameters(x))
        m, many = o.margins, o.multipliers
        numbers = (o.amplitude, o.stroke, *o.state.T, o.phase, o.crossing, m.fold, m.symmetry)
        return (
            jnp.stack(numbers, axis=1),
            jnp.stack([m.sticking, m.grazing, *many.real.T, *many.imag.T], axis=1),
        ), o

    return jax.jacfwd(sizes, has_aux=True)(x)


def full(x: Any) -> np.ndarray:
    """A vector of eight parameters; e = 1 unless given."""
    out = np.ones(8)
    out[: len(x)] = x
    return out


def solve(xs: Any) -> Answers:
    """`symmetric_orbits` of many scenes, with its derivatives."""
    points = np.stack([full(x) for x in xs])
    (slopes, unknown), o = in_chunks(_solve, points, chunk=BATCH)
    assert np.all(np.isnan(unknown))
    status = np.full(o.amplitude.shape, "?", dtype="U16")
    for name in ("rocking", "unstable", "neutral", "near_fold", "grazing", "no_orbit"):
        status[np.asarray(o.status == getattr(Status, name))] = name
    m = o.margins
    sizes = (o.amplitude, o.stroke, o.state, o.phase, o.crossing, o.multipliers)
    return Answers(status, *sizes, m.fold, m.symmetry, m.sticking, m.grazing, slopes, o.overflow)


class Cycle(NamedTuple):
    """One forcing period, event by event."""

    middle: np.ndarray
    end: np.ndarray
    slopes: np.ndarray
    """d end/d start."""


def cycle(x: Any, y0: Any, *, begin: float = 0.0, split: float = 0.5) -> Cycle:
    """The motion from `y0` at `begin` over one forcing period, looked at after a share of it too."""
    times = begin + np.array([0.0, split, 1.0]) * 2.0 * np.pi / x[6]
    ys, slopes, status = along(x, y0, times)
    assert status == "rocking"
    return Cycle(ys[1], ys[2], slopes[2])


@functools.cache
def random_scenes(count: int, seed: int) -> tuple[np.ndarray, Answers]:
    """Scenes from all over the box, and their orbits."""
    xs = np.random.default_rng(seed).uniform(LOW, HIGH, size=(count, 8))
    return xs, solve(xs)


def chosen(count: int, kind: str, seed: int = 5) -> list[tuple[np.ndarray, Answers]]:
    """The first so many random scenes with an orbit of a status, and that orbit."""
    xs, all_of = random_scenes(5 * BATCH, seed)
    found = []
    for i, j in zip(*np.nonzero(all_of.status == kind), strict=True):
        found.append((xs[i], Answers(*(a[i] if a.ndim == 1 else a[i, j] for a in all_of))))
    assert len(found) >= count
    return found[:count]


# An independent search: the closing condition solved as four equations at thousands of crossings


class Found(NamedTuple):
    """A symmetric orbit by the scan."""

    height: float
    crossing: float
    phase: float
    turning: float
    """phi'' just after a turn over phi'' just before it."""
    clearance: float
    """How far it is from losing its signs: of the falling rates between the turns, which must be
    negative, and the accelerations at the turns, the one closest to the wrong sign, over its size."""


class Scan:
    """Symmetric orbits of one scene, from matrix exponentials of all four states."""

    def __init__(self, x: Any) -> None:
        nu, mu, lam, zeta, k, f, self.xi, e = x
        rho, tilt, weight = 0.75 / (1.0 + nu**2), 1.0 + 2.0 * mu, (1.0 + mu) * nu
        hinge = 2.0 * zeta * np.sqrt(lam * rho)
        mass = np.array([[1.0 + mu * rho * (4.0 + nu**2), -2.0 * mu * rho * lam], [-2.0 * rho, lam * rho]])
        damping = hinge * np.array([[mu * lam, -mu * lam], [-1.0, 1.0]])
        stiffness = np.array([[-tilt, 0.0], [0.0, 1.0]])
        inverse = np.linalg.inv(mass)
        self.matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
        values, vectors = np.linalg.eig(self.matrix)
        self.modes = values, vectors, np.linalg.inv(vectors)
        pencil = stiffness - self.xi**2 * mass + 1j * self.xi * damping
        angles = np.linalg.solve(pencil, np.array([-f * tilt, f], dtype=complex))
        self.forced = np.concatenate([angles, 1j * self.xi * angles])
        self.load = np.concatenate([np.zeros(2), inverse[:, 0]])
        unit = np.linalg.solve(self.matrix, self.load)
        self.levels = (weight - k) * unit, -(weight + k) * unit
        self.impact = np.eye(4)
        self.impact[2, 2], self.impact[3, 2] = e, 2.0 * (e - 1.0) / lam
        self.half = np.pi / self.xi

    def flow(self, t: np.ndarray) -> np.ndarray:
        """exp(A t), shape (times, 4, 4)."""
        values, vectors, inverse = self.modes
        return ((vectors * np.exp(t[:, None] * values)[:, None, :]) @ inverse).real

    def harmonic(self, t: np.ndarray) -> np.ndarray:
        """What follows the forcing, as factors of (1, sin gamma, cos gamma): shape (times, 4, 3)."""
        z = np.exp(1j * self.xi * t)[:, None] * self.forced
        return np.stack([np.zeros_like(z.real), z.real, z.imag], axis=-1)

    def closing(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The states at the turn and before the crossing at `t` that close after half a period,
        as factors of (1, sin gamma, cos gamma)."""
        first, second = (np.outer(level, [1.0, 0.0, 0.0]) for level in self.levels)
        early, late = self.flow(t), self.flow(self.half - t) @ self.impact
        here = self.harmonic(np.zeros_like(t))
        onward = self.harmonic(t) + first - early @ (here + first)
        rest = self.flow(self.half - t) @ (second + self.harmonic(t))
        top = np.linalg.solve(np.eye(4) + late @ early, here - second + rest - late @ onward)
        return top, early @ top + onward

    def branches(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """On both branches of gamma the tilt at the crossing and gamma, shape (times, 2); and how
        far inside its range the sine is."""
        top, end = self.closing(t)
        c, s, u = top[:, 2].T
        size = np.hypot(s, u)
        reach = -c / size
        turn = np.arcsin(np.clip(reach, -1.0, 1.0))
        gamma = np.stack([turn, np.pi - turn], axis=-1) - np.arctan2(u, s)[:, None]
        tilt = end[:, 0, :1] + end[:, 0, 1:2] * np.sin(gamma) + end[:, 0, 2:] * np.cos(gamma)
        return tilt, gamma, 1.0 - np.abs(reach)

    def orbits(self, *, samples: int = 2000) -> list[Found]:
        """Every one, the largest first."""
        t = np.linspace(0.0, self.half, samples + 1)
        inside = self.branches(t)[2]
        ends = [
            brentq(lambda s: self.branches(np.array([s]))[2][0], t[i], t[i + 1], xtol=1e-15)
            for i in np.nonzero(inside[:-1] * inside[1:] < 0)[0]
        ]
        # The branches end where they meet: there the angle is the same on both.
        t = np.sort(np.concatenate([t, ends]))
        tilt, _, inside = self.branches(t)
        there = (inside > -1e-9)[:, None]
        change = (tilt[:-1] * tilt[1:] <= 0) & there[:-1] & there[1:]
        found = []
        for i, branch in zip(*np.nonzero(change), strict=True):
            root = brentq(
                lambda s, branch=branch: self.branches(np.array([s]))[0][0, branch],
                t[i],
                t[i + 1],
                xtol=1e-15,
            )
            orbit = self.follow(root, self.branches(np.array([root]))[1][0, branch])
            if orbit.clearance > 0 and orbit.height > 0:
                found.append(orbit)
        found.sort(key=lambda o: -o.height)
        return [o for i, o in enumerate(found) if i == 0 or found[i - 1].height - o.height > 1e-12]

    def follow(self, t: float, gamma: float, *, samples: int = 1000) -> Found:
        """The orbit at a root, along a fine grid of both arcs."""
        factors = np.array([1.0, np.sin(gamma), np.cos(gamma)])
        top, end = (x[0] @ factors for x in self.closing(np.array([t])))
        rates, pulls = [], []
        arcs = ((top, 0.0, t), (self.impact @ end, t, self.half))
        for (begin, since, until), level in zip(arcs, self.levels, strict=True):
            s = np.linspace(since, until, samples + 1)
            forced = self.harmonic(s) @ factors
            ys = (self.flow(s - since) @ (begin - forced[0] - level)) + forced + level
            waves = np.exp(1j * (self.xi * s + gamma))[:, None] * self.forced
            drift = ys - forced - level
            rates.append(ys[:, 2])
            pulls.append((drift @ self.matrix.T)[:, 2] + (1j * self.xi * waves).imag[:, 2])
        fall = -np.concatenate([rates[0][1:], rates[1][:-1]])
        least = fall.min() / fall.max() if fall.min() < 0 else 1.0
        ends = np.array([-pulls[0][0], pulls[1][-1]]) / (self.xi * fall.max())
        phase = np.angle(np.exp(1j * gamma))
        return Found(top[0], t, phase, ends[0] / ends[1], min(least, *ends))


# Known answers


@functools.cache
def known() -> Answers:
    """Of the cases, and last of the unstable one."""
    return solve([*(case.x for case in MOVING), UNSTABLE[0]])


def of_case(case: Case) -> Answers:
    """The largest orbit of a case."""
    i = MOVING.index(case)
    return Answers(*(a[i] if a.ndim == 1 else a[i, 0] for a in known()))


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


# Against the event-driven solution


def some_orbits() -> list[tuple[np.ndarray, Answers]]:
    """Known and random ones, attracting and repelling."""
    cases = [(full(case.x), of_case(case)) for case in MOVING]
    return [*cases, *chosen(20, "rocking"), *chosen(8, "unstable")]


def test_an_attracting_orbit_is_the_steady_state_from_its_own_state():
    for x, o in [(full(case.x), of_case(case)) for case in MOVING] + chosen(20, "rocking"):
        s = exact(x, o.state).steady
        assert status_name(s.status) == "rocking"
        assert s.periods == 1
        assert o.amplitude == pytest.approx(float(s.amplitude), rel=1e-11)
        assert o.stroke == pytest.approx(float(s.stroke), rel=1e-11)
        np.testing.assert_allclose(o.state, s.state, rtol=0, atol=1e-11 * np.abs(o.state).max())


def test_the_state_returns_after_a_period_and_is_mirrored_after_half_of_it():
    for x, o in some_orbits():
        run, scale = cycle(x, o.state), np.abs(o.state).max()
        growth = max(1.0, np.abs(o.multipliers).max())
        np.testing.assert_allclose(run.end, o.state, rtol=0, atol=1e-10 * scale * growth)
        np.testing.assert_allclose(run.middle, -o.state, rtol=0, atol=1e-10 * scale * growth)


def gap(a: np.ndarray, b: np.ndarray) -> float:
    """Largest distance from a number of one set to the nearest of the other, over the largest."""
    apart = np.abs(a[:, None] - b)
    return max(apart.min(axis=0).max(), apart.min(axis=1).max()) / np.abs(b).max()


def felt(x: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """The derivative of the return map, of what is felt: a bob without mass is not."""
    return slopes if x[1] > 0 else slopes * np.outer([1, 0, 1, 0], [1, 0, 1, 0])


def test_multipliers_are_the_eigenvalues_of_the_return_map_wherever_it_is_cut():
    for x, o in some_orbits():
        first, period = cycle(x, o.state), 2.0 * np.pi / x[6]
        assert gap(o.multipliers, np.linalg.eigvals(felt(x, first.slopes))) < 1e-8
        for share in (0.27, 0.81):
            start = cycle(x, o.state, split=share).middle
            slopes = cycle(x, start, begin=share * period).slopes
            assert gap(o.multipliers, np.linalg.eigvals(felt(x, slopes))) < 1e-8


def test_multipliers_multiply_to_the_closed_form_determinant():
    # Volume shrinks by exp(trace) along the arcs, by e^2 in each crossing (rates and their share of
    # time both shrink by e), and by the ratio of the accelerations in each turn, twice per period.
    for x, o in [*chosen(20, "rocking"), *chosen(8, "unstable")]:
        scan = Scan(x)
        top = scan.follow(o.crossing, o.phase)
        arc = np.exp(2.0 * scan.half * np.trace(scan.matrix)) * x[7] ** 4
        assert np.prod(o.multipliers) == pytest.approx(arc * top.turning**2, rel=1e-10, abs=1e-15)
        assert o.sticking == pytest.approx(top.turning, rel=1e-10)


def test_margins_are_the_determinants_of_the_return_map():
    for x, o in some_orbits():
        expected = np.linalg.det(np.eye(4) - felt(x, cycle(x, o.state).slopes))
        assert o.fold * o.symmetry == pytest.approx(expected, rel=1e-9, abs=1e-10)


# Against the dense scan


SCANNED = 5 * BATCH


@functools.cache
def scanned() -> list[list[Found]]:
    """The orbits of random scenes by the scan."""
    return [Scan(x).orbits() for x in random_scenes(SCANNED, 5)[0]]


def close_pair(x: np.ndarray, found: list[Found]) -> bool:
    """Whether two orbits cross zero within one sample of `symmetric_orbits`."""
    times = [o.crossing for o in found]
    return len(times) > 1 and abs(times[0] - times[1]) < np.pi / x[6] / NODES


def test_no_orbit_is_lost_and_none_is_invented():
    xs, o = random_scenes(SCANNED, 5)
    assert not np.any(o.overflow)
    lost = []
    for i, found in enumerate(scanned()):
        count = np.sum(o.exists[i])
        if count != len(found):
            assert count == 0
            assert close_pair(xs[i], found)
            lost.append(i)
    assert np.sum(o.exists) > 200
    # Two orbits that cross zero within a 64th of half a period escape the sampling, or not.
    assert len(lost) <= 2


def test_each_orbit_is_that_of_the_scan():
    _, o = random_scenes(SCANNED, 5)
    for i, found in enumerate(scanned()):
        if np.sum(o.exists[i]) == len(found):
            for j, expected in enumerate(found):
                assert o.amplitude[i, j] == pytest.approx(expected.height, rel=1e-11)
                assert o.crossing[i, j] == pytest.approx(expected.crossing, rel=1e-11)
                assert np.exp(1j * o.phase[i, j]) == pytest.approx(np.exp(1j * expected.phase), abs=1e-10)


CLOSE = (
    (0.306, 0.488, 1.436, 1.173, 0.0418, 0.323, 1.756, 0.542),
    (0.345, 0.431, 0.687, 0.725, 0.09, 0.441, 4.017, 0.614),
    (0.201, 0.205, 1.815, 1.026, 0.0116, 0.114, 1.145, 0.692),
    (0.155, 0.4563, 1.0546, 0.3645, 0.02616, 0.152, 2.632, 0.8115),
)
"""Scenes with an attracting and a repelling orbit, a fifth to a half apart in height, that cross zero
within one sample of `symmetric_orbits` from each other; the last two 2e-5 apart in time."""


@pytest.mark.parametrize("x", CLOSE)
def test_two_orbits_that_cross_zero_close_together_are_there(x):
    found = Scan(x).orbits()
    assert len(found) == 2
    assert found[0].height > 1.1 * found[1].height
    assert close_pair(np.array(x), found)


@pytest.mark.parametrize("x", CLOSE)
def test_two_orbits_that_cross_zero_close_together_are_both_found(x):
    assert np.sum(solve([x]).exists) == 2


BRANCH_END = (
    0.31580698694563647,
    0.4930826874676938,
    0.42290158146689844,
    0.6844343070934694,
    0.06113436302130054,
    0.4414376430179357,
    4.326153559548835,
    0.5372286314940464,
)
"""A scene with one of its two roots close to where its branch of gamma begins, as a square root."""


def test_an_orbit_next_to_the_end_of_a_branch_is_found():
    assert len(Scan(BRANCH_END).orbits()) == 2
    assert np.sum(solve([BRANCH_END]).exists) == 2


# Derivatives


def by_differences(x: np.ndarray, amplitude: float, share: float) -> np.ndarray:
    """d(amplitude, stroke, state, phase, crossing, two margins)/d(parameters) of the orbit nearest in
    amplitude, shape (10, 8)."""
    asked: list[np.ndarray] = []
    for i in range(8):
        differences(lambda y: asked.append(y) or 0.0, x, i, share=share)
    o = solve(asked)
    row, nearest = np.arange(len(asked)), np.nanargmin(np.abs(o.amplitude - amplitude), axis=1)
    numbers = (o.amplitude, o.stroke, *np.moveaxis(o.state, -1, 0), o.phase, o.crossing, o.fold, o.symmetry)
    sizes = np.stack(numbers, axis=-1)
    values = iter(sizes[row, nearest])
    return np.stack([differences(lambda y: next(values), x, i, share=share) for i in range(8)], axis=-1)


def inside(count: int, kind: str) -> list[tuple[np.ndarray, Answers]]:
    """Orbits far from where they are lost, in scenes that leave room for steps."""
    safe = [
        (x, o)
        for x, o in chosen(3 * count, kind)
        if abs(o.fold) > 0.3 and o.sticking > 0.05 and o.grazing > 0.02 and x[3] > 0.02 and x[1] > 0.02
    ]
    assert len(safe) >= count
    return safe[:count]


@pytest.mark.parametrize("kind", ["rocking", "unstable"])
def test_slopes_are_those_of_differences(kind):
    # Steps of 0.4 %: their sixth power, and round-off over them, both leave about 1e-10.
    errors = []
    for x, o in inside(15, kind):
        expected = by_differences(x, o.amplitude, 0.004)
        errors.append(np.abs(o.slopes - expected).max(axis=1) / np.abs(expected).max(axis=1))
    assert np.median(np.array(errors)[:, 0]) < 1e-8
    sizes, strokes, states = np.array(errors)[:, 0], np.array(errors)[:, 1], np.array(errors)[:, 2:]
    assert np.max(sizes) < 1e-6
    assert np.max(states) < 1e-5
    # One may have another peak of the bob taking over within the steps.
    assert np.sort(strokes)[-2] < 1e-5


@pytest.mark.parametrize(
    "x",
    [
        # The impact turns the bob back: its largest angle is a corner.
        (0.16935, 0.17743, 1.04946, 0.41102, 0.03664, 0.3403, 0.98591, 0.62592),
        # Two peaks on the same side.
        (0.22249, 0.09079, 1.19946, 0.03875, 0.03063, 0.4051, 0.94689, 1.0),
        # A short pendulum under slow shaking swings many times between two events.
        (0.26701, 0.43098, 0.01157, 0.01365, 0.02863, 0.39796, 0.4922, 0.97828),
        (0.26872, 0.39663, 0.01389, 0.00989, 0.04543, 0.58657, 0.36855, 1.0),
        # A quick decay hides two extremes between two samples.
        (0.387, 0.0094, 0.0955, 3.0448, 0.0, 0.1914, 0.3004, 1.0),
        (0.0971, 0.9778, 0.5614, 0.4968, 0.0258, 0.518, 0.5396, 0.8802),
    ],
    ids=["corner", "two peaks", "many peaks", "many peaks, no loss", "quick decay", "heavy bob"],
)
def test_the_stroke_is_the_largest_of_all_peaks(x):
    o = solve([x])
    found = np.flatnonzero(o.exists[0])
    assert len(found)
    for j in found:
        times = np.linspace(0.0, 2.0 * np.pi / x[6], 4001)
        bob = np.abs(np.asarray(simulate(parameters(x), o.state[0, j], times).ys)[:, 1])
        assert o.stroke[0, j] == pytest.approx(bob.max(), rel=1e-3)
        assert o.stroke[0, j] >= bob.max() - 1e-9


def test_the_stroke_under_a_given_inertia_is_that_of_the_motion():
    named = dict(zip(NAMES, (0.387, 0.0094, 0.0955, 3.0448, 0.0, 0.1914, 0.3004, 1.0), strict=True))
    p = Parameters(**named, rho=0.75)
    o = symmetric_orbits(p)
    times = np.linspace(0.0, np.pi / p.xi, 4001)
    bob = np.abs(np.asarray(simulate(p, o.state[0], times).ys)[:, 1])
    assert float(o.stroke[0]) == pytest.approx(0.45528, abs=1e-5)
    assert bob.max() * (1.0 - 1e-9) <= float(o.stroke[0]) <= bob.max() * (1.0 + 1e-5)


def quick(count: int) -> np.ndarray:
    """Designs under slow shaking whose bob follows an impact quickly, or swings without damping."""
    rng = np.random.default_rng(1)
    nu = rng.uniform(0.05, 0.45, count)
    columns = (
        nu,
        10.0 ** rng.uniform(-3.0, 0.0, count),
        10.0 ** rng.uniform(-2.0, 0.0, count),
        np.where(rng.random(count) < 0.3, 0.0, 10.0 ** rng.uniform(-0.3, 0.7, count)),
        np.where(rng.random(count) < 0.6, 0.0, 0.1 * nu),
        nu * 10.0 ** rng.uniform(-0.3, 0.5, count),
        10.0 ** rng.uniform(-0.5, 0.1, count),
        rng.choice([0.8, 0.95, 1.0], count),
    )
    return np.stack(columns, axis=1)


@pytest.mark.mends("two extremes between two samples hid the largest swing of a strongly damped bob")
def test_the_stroke_of_a_bob_that_is_quick_is_the_largest_swing():
    xs = quick(10 * BATCH)
    missed, looked = [], 0
    for first in range(0, len(xs), BATCH):
        o = solve(xs[first : first + BATCH])
        for i, j in np.argwhere(o.exists):
            x = xs[first + i]
            # Half a period: the other half mirrors it, and unstable orbits have less time to be left.
            times = np.linspace(0.0, np.pi / x[6], 2001)
            bob = np.abs(np.asarray(simulate(parameters(x), o.state[i, j], times).ys)[:, 1])
            looked += 1
            if o.stroke[i, j] < bob.max() * (1.0 - 1e-6):
                missed.append((x.tolist(), float(o.stroke[i, j]), float(bob.max())))
    assert looked > 100
    assert not missed


def test_a_path_with_too_many_peaks_is_not_followed_and_the_answer_says_so():
    bare = (0.2, 0.0, 0.4, 0.1, 0.05, 0.1, 1.5)
    o = solve([bare, (*bare[:2], 3e-7, *bare[3:])])
    assert o.exists[:, 0].tolist() == [True, False]
    assert o.overflow.tolist() == [False, True]


def test_reverse_mode_gives_the_same_gradient_and_second_derivatives_are_refused():
    case = MOVING[0]
    x = jnp.asarray(full(case.x))

    def size(x: jax.Array) -> jax.Array:
        return symmetric_orbits(parameters(x)).amplitude[0]

    np.testing.assert_allclose(jax.jit(jax.grad(size))(x), of_case(case).slopes[0], rtol=1e-11)
    # Traced only: that forward mode over reverse mode is possible at all.
    assert jax.eval_shape(jax.hessian(size), x).shape == (8, 8)


def test_a_neutral_orbit_has_the_gradient_of_differences():
    xs, forcing = np.tile(CONSERVING[0], (3, 1)), NAMES.index("f")
    xs[:, forcing] += [0.0, -1e-5, 1e-5]
    o = solve(xs)
    _, down, up = o.amplitude[:, 0]
    assert o.slopes[0, 0, 0, forcing] == pytest.approx((up - down) / 2e-5, rel=1e-6)


# Where orbits end

FOLDING = (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0, 1.0)


def among(x: tuple, name: str, values: np.ndarray) -> Answers:
    """The answers while one parameter takes some values."""
    xs = np.tile(full(x), (len(values), 1))
    xs[:, NAMES.index(name)] = values
    return solve(xs)


@functools.cache
def least_forcing() -> float:
    """Where the two orbits of FOLDING merge, to the last digit."""
    low, high = 0.03, 0.1
    for _ in range(9):
        values = np.linspace(low, high, BATCH)
        first = np.argmax(among(FOLDING, "f", values).exists[:, 0])
        low, high = values[first - 1], values[first]
    return high


def test_at_a_fold_the_margin_vanishes_as_a_root_and_the_gradient_grows_as_its_inverse():
    distances = 10.0 ** np.linspace(-3.0, -7.0, 9)
    o = among(FOLDING, "f", least_forcing() * (1.0 + distances))
    assert np.all(o.exists[:, :2])
    size = np.log(distances)
    for j, sign in ((0, 1.0), (1, -1.0)):
        assert np.all(sign * o.fold[:, j] > 0)
        margin = np.polyfit(size, np.log(np.abs(o.fold[:, j])), 1)[0]
        assert margin == pytest.approx(0.5, abs=0.05)
        slopes = sign * o.slopes[:, j, 0, NAMES.index("f")]
        assert np.all(slopes > 0)
        assert np.polyfit(size, np.log(slopes), 1)[0] == pytest.approx(-0.5, abs=0.05)
    apart = np.log(o.amplitude[:, 0] - o.amplitude[:, 1])
    assert np.polyfit(size, apart, 1)[0] == pytest.approx(0.5, abs=0.05)


def test_at_a_fold_there_is_no_gradient_and_beyond_it_no_orbit():
    edge = least_forcing()
    o = among(FOLDING, "f", np.array([edge, edge * (1.0 - 1e-6)]))
    assert set(o.status[0]) <= {"near_fold", "no_orbit"}
    assert np.all(np.isnan(o.slopes[0]))
    assert set(o.status[1]) == {"no_orbit"}
    assert np.all(np.isnan(o.amplitude[1]))
    assert np.all(np.isnan(o.slopes[1]))


def test_symmetry_breaks_where_it_is_known_to():
    low, high = 1.0, 1.2
    for _ in range(4):
        values = np.linspace(low, high, BATCH)
        o = among(UNSTABLE[0], "xi", values)
        first = np.argmax(o.symmetry[:, 0] > 0)
        assert np.all(o.symmetry[:first, 0] < 0)
        assert np.all(o.symmetry[first:, 0] > 0)
        assert set(o.status[:first, 0]) == {"unstable"}
        assert set(o.status[first:, 0]) == {"rocking"}
        low, high = values[first - 1], values[first]
    assert low == pytest.approx(1.0443, abs=5e-4)


def test_where_there_is_no_orbit_everything_about_it_is_nan():
    o = solve([(0.2, 0.1, 0.4, 0.2, 0.03, 0.02, 4.0), (0.2, 0.1, 0.4, 0.2, 0.03, 0.0, 4.0)])
    assert np.all(o.status == "no_orbit")
    for name in ("amplitude", "stroke", "state", "phase", "crossing", "multipliers", "slopes"):
        assert np.all(np.isnan(getattr(o, name))), name


numbers = st.tuples(*(st.floats(a, b) for a, b in zip(LOW, HIGH, strict=True)))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(x=numbers)
def test_there_is_never_a_nan_without_a_status(x):
    o = solve([x])
    there = np.isin(o.status, ("rocking", "unstable"))
    assert np.all(there | np.isin(o.status, ("near_fold", "grazing", "no_orbit", "neutral")))
    for name in ("amplitude", "stroke", "state", "phase", "crossing", "multipliers", "slopes"):
        assert np.all(np.isfinite(getattr(o, name)[there])), name
    for name in ("fold", "symmetry", "sticking"):
        assert np.all(np.isfinite(getattr(o, name)[there])), name
    assert np.all(o.amplitude[there] > 0)
    assert np.all(o.stroke[there] > 0)
    assert np.all(o.sticking[there] > 0)
    assert np.all(o.grazing[there] > 0)
    assert np.all(np.diff(o.amplitude[o.exists]) < 0)
    largest = np.abs(o.multipliers).max(axis=-1)
    assert np.all((largest < 1.0)[o.status == "rocking"])
    assert np.all((largest >= 1.0)[o.status == "unstable"])


# Limits


@pytest.mark.parametrize("case", BARE, ids=named)
def test_a_massless_bob_cannot_be_felt_whatever_its_rod_and_hinge(case):
    rods = [
        (*case.x[:2], lam, zeta, *case.x[4:])
        for lam, zeta in ((0.4, 0.0), (1.5, 0.6), (0.1, 1.0), (0.7, 2.5))
    ]
    o, i = solve(rods), MOVING.index(case)
    for j in (0, 1):
        np.testing.assert_allclose(o.amplitude[:, j], known().amplitude[i, j], rtol=1e-13)
        for found in o.multipliers[:, j]:
            assert gap(found, known().multipliers[i, j]) < 1e-10
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
    scan = Scan(full((*MOVING[3].x[:3], 0.0, *MOVING[3].x[4:]))).orbits()
    assert o.amplitude[0, 0] == pytest.approx(scan[0].height, rel=1e-12)


def test_critical_damping_of_the_bob_is_smoothly_passed():
    x = MOVING[1].x

    def swings(zeta: float) -> bool:
        return bool(np.any(np.imag(np.linalg.eigvals(Scan(full((*x[:3], zeta, *x[4:]))).matrix))))

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
    slope = o.slopes[0, 0, 0, NAMES.index("zeta")]
    np.testing.assert_allclose(moved, slope * steps, rtol=5e-3, atol=1e-14)
    for i, step in enumerate(steps):
        np.testing.assert_allclose(o.slopes[i, 0], o.slopes[0, 0], rtol=0, atol=20 * abs(step) + 1e-9)
        assert gap(o.multipliers[i, 0], o.multipliers[0, 0]) < 100 * abs(step) + 1e-8


@pytest.mark.parametrize("status", STATUSES)
def test_only_an_orbit_that_is_neither_near_a_fold_nor_grazes_has_derivatives(status):
    x = compiled_orbits.row_of(Parameters(nu=0.25, mu=0.1, lam=0.6, zeta=0.1, k=0.05, f=0.4, xi=3.0))[None]
    orbits = compiled_orbits.solve_all(x)
    assert STATUSES[int(orbits[0, 0]["status"])] == "rocking"
    orbits["status"] = STATUSES.index(status)
    slopes = compiled_orbits.slopes_all(x, orbits, np.eye(9)[None], (0, 3))[0, 0, :, 0]
    assert np.all(np.isfinite(slopes) == (status in ("rocking", "unstable", "neutral")))
