"""The decision between slip, stick and rest, and the impact, by hand."""

import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import HUNG, parameters
from tpd import Terms
from tpd.core.equations import Equations
from tpd.exact.arc import classify, held_on_base
from tpd.exact.contact import REST, SLIP, STICK, Mode, captured_restitution, decide, impact_jump, released
from tpd.exact.modes import Plant
from tpd.models.segmented import _classify


def signs(mode):
    return int(mode.kind), float(mode.tilt_sign), float(mode.rate_sign)


@pytest.mark.parametrize(
    ("up", "down", "tilt", "rate", "expected"),
    [
        (-0.1, 0.3, 0.0, 0.0, (REST, 0.0, 0.0)),
        (0.06, 0.46, 0.0, 0.0, (SLIP, 1.0, 1.0)),
        (-0.46, -0.06, 0.0, 0.0, (SLIP, -1.0, -1.0)),
        (-0.1, 0.3, 0.0, -1.0, (SLIP, -1.0, -1.0)),
        (0.04, 0.04, -1.0, 0.0, (STICK, -1.0, 0.0)),
        (0.06, 0.06, -1.0, 0.0, (SLIP, -1.0, 1.0)),
        (0.04, 0.04, 1.0, -1.0, (SLIP, 1.0, -1.0)),
    ],
)
def test_a_block_is_held_while_friction_balances_the_excess(up, down, tilt, rate, expected):
    numbers = (jnp.asarray(x) for x in (up, down, 0.05, tilt, rate))
    assert signs(decide(*numbers)) == expected


def test_a_released_block_goes_to_the_side_of_the_limit():
    def held(kind):
        return Mode(jnp.asarray(kind), jnp.asarray(1.0), jnp.asarray(0.0))

    assert signs(released(held(REST), -1.0)) == (SLIP, -1.0, -1.0)
    assert signs(released(held(STICK), -1.0)) == (SLIP, 1.0, -1.0)


def test_signs_without_meaning_do_not_tell_modes_apart():
    def mode(*x):
        return Mode(*(jnp.asarray(a) for a in x))

    assert bool(mode(REST, 1.0, 1.0).equals(mode(REST, -1.0, 0.0)))
    assert bool(mode(STICK, 1.0, 1.0).equals(mode(STICK, 1.0, 0.0)))
    assert not bool(mode(STICK, 1.0, 1.0).equals(mode(STICK, -1.0, 1.0)))
    assert not bool(mode(SLIP, 1.0, 1.0).equals(mode(SLIP, 1.0, -1.0)))
    assert not bool(mode(SLIP, 1.0, 1.0).equals(mode(STICK, 1.0, 1.0)))


def test_closed_form_and_segments_decide_alike():
    p = parameters(HUNG[0].x)
    plant, equations = Plant(p), Equations(p, Terms.linear)
    rng = np.random.default_rng(5)
    states = rng.normal(size=(40, 4)) * [0.2, 0.5, 0.1, 0.5]
    states[::2, 0], states[::3, 2] = 0.0, 0.0
    for tau, y in zip(rng.random(40) * p.period, jnp.asarray(states), strict=True):
        sine = jnp.sin(p.xi * tau)
        one = classify(plant, y, sine)
        assert bool(one.equals(_classify(equations, y, jnp.asarray(tau))))
        still = classify(plant, y.at[0].set(0.0).at[2].set(0.0), sine)
        assert bool(held_on_base(plant, tuple(y), sine)) == (int(still.kind) == REST)


def test_an_impact_conserves_the_second_row_of_the_momentum():
    p = parameters(HUNG[0].x)
    linear = Plant(p).linear
    jump = impact_jump(-0.3 * 0.7, p.lam)
    # The impulse acts on the first row alone.
    assert float(linear.m21 * jump[0] + linear.m22 * jump[1]) == pytest.approx(0.0, abs=1e-16)


def test_a_captured_rattle_is_the_sum_of_its_hops():
    e, lam, rate = 0.6, 0.4, 1e-3
    hops = [impact_jump((e - 1.0) * rate * e**n, lam) for n in range(200)]
    once = impact_jump((captured_restitution(e, jnp.asarray(True)) - 1.0) * rate, lam)
    np.testing.assert_allclose(once, np.sum(np.array(hops), axis=0), rtol=1e-12)
    assert float(captured_restitution(e, jnp.asarray(False))) == e
