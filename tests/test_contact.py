"""The decision between slip, stick and rest in JAX, by hand."""

import jax.numpy as jnp
import numpy as np
import pytest

from tests.contact import REST, SLIP, STICK, Mode, decide, released, transversality_of
from tests.exact.test_contact_kernel import DECISIONS


def mode(*x):
    return Mode(*(jnp.asarray(a) for a in x))


def signs(mode):
    return int(mode.kind), float(mode.tilt_sign), float(mode.rate_sign)


@pytest.mark.parametrize(("up", "down", "tilt", "rate", "expected"), DECISIONS)
def test_a_block_is_held_while_friction_balances_the_excess(up, down, tilt, rate, expected):
    assert signs(decide(*map(jnp.asarray, (up, down, 0.05, tilt, rate)))) == expected


def test_a_released_block_goes_to_the_side_of_the_limit():
    assert signs(released(mode(REST, 1.0, 0.0), -1.0)) == (SLIP, -1.0, -1.0)
    assert signs(released(mode(STICK, 1.0, 0.0), -1.0)) == (SLIP, 1.0, -1.0)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ((REST, 1.0, 1.0), (REST, -1.0, 0.0), True),
        ((STICK, 1.0, 1.0), (STICK, 1.0, 0.0), True),
        ((STICK, 1.0, 1.0), (STICK, -1.0, 1.0), False),
        ((SLIP, 1.0, 1.0), (SLIP, 1.0, -1.0), False),
        ((SLIP, 1.0, 1.0), (STICK, 1.0, 1.0), False),
    ],
)
def test_signs_without_meaning_do_not_tell_modes_apart(one, other, same):
    assert bool(mode(*one).equals(mode(*other))) is same


@pytest.mark.parametrize(
    ("kinds", "turn", "crossing", "free", "expected"),
    [
        ((SLIP, SLIP), 0.02, np.inf, True, 0.1),
        ((SLIP, SLIP), np.inf, -0.01, True, 0.02),
        # A hop of a rattle says nothing about grazing, nor does what holds or frees the block.
        ((SLIP, SLIP), np.inf, -0.01, False, np.inf),
        ((SLIP, STICK), 0.02, np.inf, True, np.inf),
        ((REST, SLIP), 0.02, np.inf, True, np.inf),
    ],
)
def test_an_event_is_met_at_a_share_of_the_usual_rate(kinds, turn, crossing, free, expected):
    before, after = (mode(kind, 1.0, 1.0) for kind in kinds)
    numbers = jnp.asarray(turn), jnp.asarray(crossing), jnp.asarray(free)
    assert float(transversality_of(before, after, *numbers, (0.2, 0.5))) == pytest.approx(expected)
