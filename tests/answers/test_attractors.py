"""Motions that many starts of one design reach."""

import numpy as np
import pytest

from tests.reference import WITHOUT, parameters
from tests.reference import exact as solve
from tpd import Starts, attractors
from tpd.answers.attractors import _agree
from tpd.models.piecewise import Piecewise

BARE_BLOCK = parameters(WITHOUT[1].x)
"""Rests, rocks or overturns, as it starts."""


@pytest.fixture(scope="module")
def without():
    return attractors(BARE_BLOCK)


def test_a_block_without_pendulum_rocks_rests_or_overturns(without):
    assert {a.status for a in without} == {"rocking", "rest", "overturned"}
    assert sum(a.share for a in without) == pytest.approx(1.0)
    assert sorted(i for a in without for i in a.starts) == list(range(64))
    shares = [a.share for a in without]
    assert shares == sorted(shares, reverse=True)
    assert [(a.status, a.starts) for a in attractors(BARE_BLOCK)] == [(a.status, a.starts) for a in without]


def test_an_attractor_prints_on_one_line(without):
    rocking = next(a for a in without if a.status == "rocking")
    lost = next(a for a in without if a.status == "overturned")
    assert str(lost) == repr(lost) == f"overturned: {100.0 * lost.share:.1f} % of the starts"
    kind = "symmetric, 1 period, amplitude 0.06372 rad, swing"
    assert str(rocking).startswith(f"rocking: {100.0 * rocking.share:.1f} % of the starts, {kind}")


def test_an_attractor_is_the_steady_state_of_its_initial_states(without):
    states = Starts().states(BARE_BLOCK.nu)
    for found in without:
        for i in found.starts[:3]:
            alone = solve(WITHOUT[1].x, states[i])
            assert alone.status == found.status
            assert alone.steady.amplitude == pytest.approx(float(found.steady.amplitude), rel=1e-9)
    rocking = next(a for a in without if a.status == "rocking")
    assert (rocking.symmetric, rocking.periods) == (True, 1)


def test_chaos_is_distinguished_from_slow_decay():
    # With so small a tolerance the decay is followed, and not cut short by Newton's method.
    chaotic, slow = (
        attractors(parameters(x), starts=Starts(size=6), model=model)
        for x, model in (
            ((0.321, 0.205, 0.096, 0.047, 0.087, 0.347, 2.803), Piecewise()),
            ((0.269, 0.445, 1.989, 0.098, 0.004, 0.387, 4.151), Piecewise(tolerance=1e-11)),
        )
    )
    first = next(a for a in chaotic if a.status == "aperiodic")
    assert float(first.steady.lyapunov) > 0.1
    assert "aperiodic" not in {a.status for a in slow}
    assert "not_settled" in {a.status for a in slow}


@pytest.mark.parametrize(
    ("other", "felt", "agrees"),
    [
        ((0.1, 0.5), True, True),
        ((0.1, 0.2), True, False),
        ((0.1, 0.2), False, True),
        ((0.2, 0.5), True, False),
    ],
)
def test_two_motions_are_equal_if_tilt_and_coupled_swing_agree(other, felt, agrees):
    assert _agree(np.array([0.1, 0.5]), np.array(other), 1e-3, felt) is agrees
