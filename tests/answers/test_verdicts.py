"""What is said of motions at the limits: held leaning, neutral, resting, and without a finite number."""

import jax
import numpy as np
import pytest

from tests.reference import CONSERVING, HUNG, LEANING, REST, exact, orbits_of, parameters
from tpd import Piecewise, Status, simulate, status_name, steady_state
from tpd.scene.status import names_of

UNDER_A_SWING = ((0.1, 0.2, 1.0, 0.3, 0.05, 0.01, 2.0), (0.08, 0.15, 0.0, 0.0))
"""Slips at first, since the bob swings far, and is held under its settled swing."""


@pytest.mark.parametrize(("x", "y0"), [LEANING, UNDER_A_SWING], ids=["bare", "hung"])
def test_a_block_that_friction_holds_leaning_is_held(x, y0):
    answer = exact(x, y0)
    assert answer.status == "held"
    times = np.linspace(60.0, 61.0, 101) * 2.0 * np.pi / x[6]
    ys = np.asarray(simulate(parameters(x), np.array(y0), np.array([0.0, *times])).ys)[1:]
    assert np.ptp(ys[:, 0]) == 0.0
    assert answer.amplitude == pytest.approx(abs(ys[0, 0]), rel=1e-12)
    assert answer.stroke == pytest.approx(np.abs(ys[:, 1]).max(), rel=1e-3)
    np.testing.assert_allclose(answer.steady.state, ys[0], rtol=0, atol=1e-8)
    assert np.all(np.isnan(answer.slopes))
    assert float(answer.steady.multiplier) == 1.0
    assert not bool(answer.steady.symmetric)


def test_a_held_block_that_never_moved_leans_as_it_started():
    assert exact(*LEANING).amplitude == LEANING[1][0]
    mirrored = exact(LEANING[0], tuple(-y for y in LEANING[1]))
    assert mirrored.status == "held"
    assert mirrored.amplitude == LEANING[1][0]


@pytest.mark.usefixtures("raises_within_programs")
def test_throw_says_what_to_do_about_a_held_block():
    with pytest.raises(RuntimeError, match=r"Friction holds the block leaning.*Start from another state"):
        steady_state(parameters(LEANING[0]), y0=np.array(LEANING[1]), throw=True)


@pytest.mark.parametrize("xi", [1.0, 2.0])
def test_a_block_that_shaking_may_still_move_is_not_held(xi):
    # The moment of the shaking at its largest exceeds what friction has left.
    x = (*LEANING[0][:5], 0.045, xi)
    assert exact(x, LEANING[1]).status != "held"


def conserving(n):
    rng = np.random.default_rng(2)
    x = np.array([0.05, 0.0, 0.1, 0.0, 0.0, 0.02, 1.0, 1.0]) + np.array(
        [0.25, 0.4, 1.5, 0.0, 0.0, 0.4, 4.0, 0.0]
    ) * rng.random((n, 8))
    x[::4, 1] = 0.0
    return np.concatenate([np.array(CONSERVING), x])


def test_symmetric_orbits_where_nothing_takes_energy_are_neutral_or_repel():
    orbits = orbits_of(parameters(list(conserving(200).T)))
    names, sizes = names_of(orbits.status), np.abs(np.asarray(orbits.multipliers)).max(axis=-1)
    assert not np.any(np.isin(names, ["rocking", "sticking"]))
    assert np.sum(names == "neutral") > 40
    assert np.all(sizes[names == "neutral"] < 1.0 + 3e-6)
    assert np.all(sizes[names == "unstable"] > 1.0 + 1e-6)


def test_a_motion_on_a_neutral_orbit_is_called_neutral_and_has_no_gradient():
    seen = 0
    for x in CONSERVING:
        orbits = orbits_of(parameters(x))
        for i, name in enumerate(names_of(orbits.status)):
            if name == "neutral":
                seen += 1
                answer = exact(x, np.asarray(orbits.state[i]))
                assert answer.status == "neutral"
                assert answer.amplitude == pytest.approx(float(orbits.amplitude[i]), rel=1e-9)
                assert np.all(np.isnan(answer.slopes))
                # To the last bit such a motion lands as its period ends, where derivatives are easily lost.
                assert float(answer.steady.multiplier) == pytest.approx(1.0, abs=1e-9)
    assert seen >= 3


def test_the_last_bit_of_a_state_does_not_decide_on_a_neutral_orbit():
    """It lands just before its period ends, as it ends, or just after."""
    draws = np.random.default_rng(1)
    for x in CONSERVING:
        orbits = orbits_of(parameters(x))
        for state in np.asarray(orbits.state)[names_of(orbits.status) == "neutral"]:
            for size in (1e-17, 1e-16, 1e-14, 1e-12, 1e-10):
                steady = exact(x, state + size * draws.standard_normal(4)).steady
                assert status_name(steady.status) == "neutral"
                assert float(steady.multiplier) == pytest.approx(1.0, abs=1e-9)


def test_an_orbit_with_losses_is_still_attracting():
    assert exact(HUNG[0].x).status == "rocking"


def test_following_that_breaks_off_leaves_finite_numbers():
    # Followed for its exponent the motion meets more events in a period than are allowed.
    x = (0.2, 0.1, 0.4, 0.0, 0.03, 0.25, 4.0)
    run = jax.jit(lambda n: steady_state(parameters(x), y0=np.array(REST), model=n), static_argnums=0)
    for events in (12, 18, 24, 32):
        steady = run(Piecewise(max_periods=2, max_events=events))
        name = status_name(steady.status)
        assert name in ("event_bound", "not_settled", "aperiodic")
        assert np.all(np.isfinite(steady.state)), (events, name)
        assert np.isfinite(steady.amplitude)


def test_every_status_has_a_message_with_a_remedy():
    for name in ("held", "neutral"):
        message = Status[getattr(Status, name)]
        assert message.count(".") >= 2


HOPS = [
    (
        (0.0766, 0.0, 1.85, 0.12, 0.104, 0.1507, 1.37, 0.324),
        (0.063, -0.19, -0.007, 0.0695),
    ),
    (
        (0.0659, 0.0, 1.66, 0.576, 0.1019, 0.1135, 2.4035, 0.551),
        (-0.0355, -0.1374, -0.008, 0.0636),
    ),
    (
        (0.1155766821662297, 0.0, 1.83, 0.145, 0.185211, 0.2287, 1.4639, 0.5914),
        (0.0883, -0.1868, 0.0496, 0.0862),
    ),
    # Called unstable once, with an amplitude that was not a number.
    (
        (
            0.15219996763318633,
            0.0,
            0.7402184631381078,
            0.02281021584818501,
            0.25502843829543936,
            0.22873452094277605,
            2.1349761701555288,
            0.8951161575180197,
        ),
        (-0.11670960670459414, -0.19958356260047305, 0.06985120107742994, 0.19583789944126045),
    ),
]
"""Friction outweighs the block (k > (1 + mu) nu), and holds it after each hop; the hops shrink."""


@pytest.mark.parametrize(("x", "y0"), HOPS)
def test_a_block_whose_hops_shrink_for_ever_is_at_rest(x, y0):
    answer = exact(x, y0)
    assert answer.status == "rest"
    assert answer.amplitude == 0.0
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    still = exact(x, (0.0, *y0[1:2], 0.0, 0.0))
    assert still.status == "rest"
    assert answer.stroke == pytest.approx(still.stroke, rel=1e-12)
    np.testing.assert_allclose(answer.slopes[1], still.slopes[1], rtol=1e-9, atol=1e-12)
