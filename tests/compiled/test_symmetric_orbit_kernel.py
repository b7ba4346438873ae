"""Symmetric orbits: their statuses, largest swings, derivatives and refusals."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.compiled.orbit_cases import BATCH, solve
from tests.reference import differences, parameters
from tpd import Parameters, simulate, status_name, steady_state
from tpd.compiled import orbits as engine
from tpd.compiled.columns import WIDTH
from tpd.compiled.rows import row_of
from tpd.compiled.symmetric_orbit_kernel import _status
from tpd.scene.status import Status, names_of


@pytest.mark.parametrize(
    ("half", "dent", "status"),
    [
        (0.5, 1.0, "rocking"),
        (1.5, 1.0, "unstable"),
        (1.0 - 1e-7, 1.0, "near_fold"),
        (1.0 - 1e-5, 1.0, "rocking"),
        (0.5, 1e-8, "grazing"),
        (0.5, 1e-6, "rocking"),
    ],
)
def test_an_orbit_near_its_end_has_the_status_of_the_bifurcation(half, dent, status):
    named = _status.py_func(SimpleNamespace(k=0.05, e=1.0, mu=0.1, zeta=0.1), half, abs(1.0 - half), dent)
    assert names_of(named) == status


@pytest.mark.parametrize("status", ["rocking", "unstable", "neutral", "near_fold", "grazing", "no_orbit"])
def test_only_an_orbit_that_is_neither_near_a_fold_nor_grazes_has_derivatives(status):
    x = row_of(Parameters(nu=0.25, mu=0.1, lam=0.6, zeta=0.1, k=0.05, f=0.4, xi=3.0))[None]
    orbits = engine.solve_orbits(x)
    assert names_of(int(orbits[0, 0]["status"])) == "rocking"
    orbits["status"] = Status.__names__.index(status)
    slopes = engine.orbit_slopes(x, orbits, np.eye(WIDTH)[None], (0, 3))[0, 0, :, 0]
    assert np.all(np.isfinite(slopes) == (status in ("rocking", "unstable", "neutral")))


SWINGS = {
    # The impact turns the bob back: its largest angle is a corner.
    "corner": (0.16935, 0.17743, 1.04946, 0.41102, 0.03664, 0.3403, 0.98591, 0.62592),
    # Two peaks on the same side.
    "two peaks": (0.22249, 0.09079, 1.19946, 0.03875, 0.03063, 0.4051, 0.94689, 1.0),
    # A short pendulum under slow shaking swings many times between two events.
    "many peaks": (0.26701, 0.43098, 0.01157, 0.01365, 0.02863, 0.39796, 0.4922, 0.97828),
    "many peaks, no loss": (0.26872, 0.39663, 0.01389, 0.00989, 0.04543, 0.58657, 0.36855, 1.0),
    # A quick decay hides two extremes between two samples.
    "quick decay": (0.387, 0.0094, 0.0955, 3.0448, 0.0, 0.1914, 0.3004, 1.0),
    "heavy bob": (0.0971, 0.9778, 0.5614, 0.4968, 0.0258, 0.518, 0.5396, 0.8802),
}


def test_the_swing_of_a_fast_bob_is_its_largest_angle():
    """Those above, and designs under slow shaking whose bob follows an impact quickly or is not damped."""
    rng, count = np.random.default_rng(1), 2 * BATCH - len(SWINGS)
    nu = rng.uniform(0.05, 0.45, count)
    xs = np.stack(
        [
            nu,
            10.0 ** rng.uniform(-3.0, 0.0, count),
            10.0 ** rng.uniform(-2.0, 0.0, count),
            np.where(rng.random(count) < 0.3, 0.0, 10.0 ** rng.uniform(-0.3, 0.7, count)),
            np.where(rng.random(count) < 0.6, 0.0, 0.1 * nu),
            nu * 10.0 ** rng.uniform(-0.3, 0.5, count),
            10.0 ** rng.uniform(-0.5, 0.1, count),
            rng.choice([0.8, 0.95, 1.0], count),
        ],
        axis=1,
    )
    xs = np.vstack([list(SWINGS.values()), xs])
    o = solve(xs)
    found = np.argwhere(o.exists)
    assert len(found) > 20
    assert np.all(o.exists[: len(SWINGS), 0])
    for i, j in found:
        # Half a period: the other half mirrors it, and unstable orbits have less time to be left.
        times = np.linspace(0.0, np.pi / xs[i, 6], 2001)
        bob = np.abs(np.asarray(simulate(parameters(xs[i]), o.state[i, j], times).ys)[:, 1])
        assert bob.max() * (1.0 - 1e-6) <= o.swing[i, j] <= bob.max() * (1.0 + 1e-2), xs[i].tolist()


def test_an_orbit_with_too_long_a_path_is_marked_as_overflow():
    without = (0.2, 0.0, 0.4, 0.1, 0.05, 0.1, 1.5)
    o = solve([(*without[:2], length, *without[3:]) for length in (0.4, 3e-7, 3e-10)])
    assert o.exists[:, 0].tolist() == [True, True, False]
    assert o.overflow.tolist() == [False, False, True]
    times = np.linspace(0.0, np.pi / 1.5, 100_001)
    ys = simulate(parameters((*without[:2], 3e-7, *without[3:])), o.state[1, 0], times).ys
    assert o.swing[1, 0] == pytest.approx(np.abs(ys[:, 1]).max(), rel=2e-4)


TURNING_BACK = (
    (0.2954, 0.0, 0.4, 0.2, 0.0, 0.2954 * 1.1318, 3.681, 0.7),
    (0.1343, 0.0, 1.4612, 0.4698, 0.0, 0.1642, 1.8812, 0.4278),
    (0.159, 0.0561, 0.2885, 0.2314, 0.0, 0.198, 4.2466, 0.7774),
)
"""Scenes without friction, two of a bare block, whose second orbit turns three times between two impacts."""


def turns_back(x):
    """The places of the orbits of a scene that turn back between their largest tilts, and the orbits."""
    o = solve([x])
    return np.flatnonzero(o.exists[0] & np.isfinite(o.grazing[0])), o


@pytest.mark.parametrize("x", TURNING_BACK)
def test_without_friction_an_orbit_can_turn_back_between_two_impacts(x):
    (places, o), p = turns_back(x), parameters(x)
    (j,) = places
    # Half a period: an orbit that repels is left within a few.
    half = np.asarray(simulate(p, o.state[0, j], np.linspace(0.0, np.pi / x[6], 4001)).ys)
    np.testing.assert_allclose(half[-1, [0, 2]], -half[0, [0, 2]], rtol=0, atol=1e-10)
    assert np.sum(np.diff(np.sign(half[:, 2])) != 0) == 3
    assert np.sum(np.diff(np.sign(half[:, 0])) != 0) == 1
    turns = np.abs(half[1:-1][np.diff(np.sign(half[1:, 2])) != 0, 0])
    assert o.amplitude[0, j] == pytest.approx(turns.max(), rel=1e-5)
    # The least tilt at a turn, over the largest.
    assert o.grazing[0, j] == pytest.approx(turns.min() / turns.max(), rel=1e-3)
    steady = steady_state(p, y0=o.state[0, j])
    assert status_name(steady.status) == o.status[0, j] == "unstable"
    assert steady.amplitude == pytest.approx(o.amplitude[0, j], rel=1e-11)
    assert steady.multiplier == pytest.approx(np.abs(o.multipliers[0, j]).max(), rel=1e-10)

    def amplitude(y):
        orbits = solve([y])
        return orbits.amplitude[0, np.nanargmin(np.abs(orbits.amplitude[0] - o.amplitude[0, j]))]

    for i in (0, 5, 6, 7):
        expected = differences(amplitude, x, i, share=1e-3)
        assert o.slopes[0, j, 0, i] == pytest.approx(expected, rel=1e-6)


def test_an_orbit_with_two_equal_turning_points_counts_once():
    # Nothing takes energy here, so a motion may be its own mirror image in time.
    for xi in np.linspace(1.5375, 2.5, 27):
        o = solve([(0.15, 0.1, 0.1, 0.0, 0.0, 0.1, xi, 1.0)])
        found = o.amplitude[0, o.exists[0]]
        assert len(found) == 2, xi
        assert found[1] < 0.5 * found[0]


def test_with_friction_no_orbit_turns_back_between_two_impacts():
    for x in TURNING_BACK:
        o = solve([(*x[:4], 0.01 * x[0], *x[5:])])
        for j in np.flatnonzero(o.exists[0]):
            p = parameters((*x[:4], 0.01 * x[0], *x[5:]))
            half = np.asarray(simulate(p, o.state[0, j], np.linspace(0.0, np.pi / x[6], 4001)).ys)
            assert np.sum(np.diff(np.sign(half[1:-1, 2])) != 0) <= 1
