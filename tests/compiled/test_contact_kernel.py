"""Contact and impacts in compiled code, by hand."""

import numba
import numpy as np
import pytest
from tpd.compiled.events import FIRST, SECOND

from tests.compiled.plants import entry, plants_of
from tests.reference import WITH, parameters
from tpd.compiled import contact_kernel
from tpd.compiled.columns import REST, SLIP, STICK
from tpd.compiled.motion import MOTION
from tpd.theory.equations import Linear

DECISIONS = [
    (-0.1, 0.3, 0.0, 0.0, (REST, 0.0, 0.0)),
    (0.06, 0.46, 0.0, 0.0, (SLIP, 1.0, 1.0)),
    (-0.46, -0.06, 0.0, 0.0, (SLIP, -1.0, -1.0)),
    (-0.1, 0.3, 0.0, -1.0, (SLIP, -1.0, -1.0)),
    (0.05, 0.05, -1.0, 0.0, (STICK, -1.0, 0.0)),
    (0.06, 0.06, -1.0, 0.0, (SLIP, -1.0, 1.0)),
    (0.04, 0.04, 1.0, -1.0, (SLIP, 1.0, -1.0)),
]
"""Excess upward and downward under friction 0.05, signs of tilt and rate, and the mode."""


mode_of = entry(contact_kernel.mode_of)
rates_after = numba.njit(lambda plants, *args: contact_kernel.rates_after_impact(plants[0], *args))


@numba.njit
def handle_event(plants, event, capture, eta, y, modes):
    return contact_kernel.handle_event(plants[0], event, capture, eta, y, modes[0])


@pytest.mark.parametrize(("up", "down", "tilt", "rate", "expected"), DECISIONS)
def test_a_block_is_held_while_friction_balances_the_excess(up, down, tilt, rate, expected):
    assert mode_of(up, down, 0.05, tilt, rate) == expected


@pytest.mark.parametrize(
    ("mode", "event", "y", "rests", "after", "state"),
    [
        # A turn too low to matter ends on the base, a higher one goes on; a slow impact is the last.
        ((SLIP, 1.0, 1.0), FIRST, [1e-13, 0.0, 0.0, 0.0], True, REST, [0.0, 0.0, 0.0, 0.0]),
        ((SLIP, 1.0, 1.0), FIRST, [0.02, 0.0, 0.0, 0.0], False, SLIP, [0.02, 0.0, 0.0, 0.0]),
        ((SLIP, 1.0, -1.0), SECOND, [0.0, 0.0, -1e-7, 0.0], True, REST, [0.0, 0.0, 0.0, 1e-6]),
        ((SLIP, 1.0, -1.0), SECOND, [0.0, 0.0, -0.1, 0.0], False, SLIP, [0.0, 0.0, -0.07, 0.3]),
        ((REST, 0.0, 0.0), SECOND, [0.0, 0.1, 0.0, 0.2], False, SLIP, [0.0, 0.1, 0.0, 0.2]),
    ],
)
def test_each_event_sets_state_and_mode(mode, event, y, rests, after, state):
    plants, modes, y = (
        plants_of([(0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67, 0.7)]),
        np.zeros(1, MOTION),
        np.array(y),
    )
    modes["kind"], modes["tilt"], modes["direction"] = mode
    assert handle_event(plants, event, 1e-6, 0.0, y, modes) == rests
    assert modes["kind"][0] == after
    np.testing.assert_allclose(y, state, rtol=1e-12)
    if mode[0] == REST:
        assert modes["direction"][0] == modes["tilt"][0] == -1.0


def test_an_impact_conserves_the_momentum_of_the_bob_and_a_rattle_sums_its_impacts():
    x = (*WITH[0].x, 0.7)
    p, linear, plants = parameters(x), Linear(parameters(x)), plants_of([x])
    rates = np.array([[0.7, -0.2]])
    for _ in range(200):
        rates = np.vstack([rates, rates_after(plants, False, *rates[-1])])
        # The impulse acts on the first row alone.
        jump = rates[-1] - rates[-2]
        assert float(linear.m21 * jump[0] + linear.m22 * jump[1]) == pytest.approx(0.0, abs=1e-16)
    np.testing.assert_allclose(rates[:, 0], 0.7 ** np.arange(1, 202), rtol=1e-13)
    captured = rates_after(plants, True, *rates[0])
    np.testing.assert_allclose(captured, [0.0, -0.2 - 2.0 / float(p.lam) * 0.7], rtol=1e-15)
    np.testing.assert_allclose(captured, rates[-1], rtol=1e-13, atol=1e-30)
