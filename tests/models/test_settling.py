"""The record of the last periods of a motion: what repeats, rests or is lost, and what it is then called."""

import jax.numpy as jnp
import numpy as np
import pytest

from tests.reference import WITH, parameters
from tpd import status_name
from tpd.models.settling import LONGEST, Period, blank, scale_of, settle
from tpd.scene.parameters import as_arrays

P = as_arrays(parameters(WITH[0].x))
NO, YES = jnp.zeros((), bool), jnp.ones((), bool)


def period(y, *, rests=NO, lost=NO, exhausted=NO, held=NO, size=0.1):
    size = jnp.asarray(size)
    return Period(jnp.asarray(y), None, size, 2.0 * size, rests, lost, exhausted, held, size, 2.0 * size)


def after(*periods, y0=(0.5, 0.5, 0.5, 0.5)):
    record = blank(jnp.array(y0), None)
    for each in periods:
        record = record.add(each, jnp.ones(4), 1e-8)
    return record


A, B, C = (jnp.full(4, v) for v in (0.1, 0.2, 0.3))


@pytest.mark.parametrize(
    ("periods", "name", "own"),
    [
        ([period(A), period(A)], "rocking", 1),
        ([period(A), period(B), period(A)], "rocking", 2),
        ([period(A), period(B), period(C), period(A, held=YES)], "sticking", 3),
        ([period(A), period(B), period(C)], "not_settled", 1),
        ([period(A), period(A, exhausted=YES)], "event_bound", 1),
        ([period(A), period(jnp.zeros(4), rests=YES)], "rest", 1),
        ([period(A), period(A, rests=YES)], "held", 1),
        ([period(A), period(A, lost=YES)], "overturned", 1),
        ([period(A), period(jnp.full(4, jnp.nan))], "failed", 1),
        # The bob of a block that never moved may repeat itself before its decay is proved to be harmless.
        ([period(A, size=0.0), period(A, size=0.0)], "rest", 1),
    ],
)
def test_a_settled_motion_has_its_status_and_period(periods, name, own):
    settled = after(*periods).settled()
    assert status_name(settled.status) == name
    assert int(settled.periods) == own
    assert int(settled.elapsed) == len(periods)


def test_settled_sizes_cover_the_last_periods_and_peaks_all_periods():
    record = after(period(B, size=0.4), period(A, size=0.2), period(C, size=0.1), period(A, size=0.3))
    settled = record.settled()
    assert float(settled.settled_tilt) == pytest.approx(0.3)
    assert float(settled.settled_swing) == pytest.approx(0.6)
    assert float(settled.tilt) == pytest.approx(0.5)
    lost = after(period(A, lost=YES)).settled()
    assert np.isinf(lost.tilt)


def test_a_repetition_after_more_than_the_stored_periods_is_not_detected():
    states = [jnp.full(4, 0.01 * n) for n in range(LONGEST + 1)]
    assert int(after(*map(period, [*states[:LONGEST], states[0]])).repeats) == LONGEST
    assert int(after(*map(period, [*states, states[0]])).repeats) == 0


@pytest.mark.parametrize(("decay", "repeats"), [(0.3, 1), (0.99, 0)])
def test_a_motion_settles_only_if_the_sum_of_its_further_changes_is_small(decay, repeats):
    record = after(*(period(4 * [0.5 + 9e-9 / (1.0 - decay) * decay**n]) for n in range(1, 4)))
    assert int(record.repeats) == repeats


def test_a_bob_without_mass_is_left_out_of_the_scales_by_default():
    without = as_arrays(parameters((0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 4.0)))
    np.testing.assert_allclose(scale_of(without), [0.2, np.inf, 0.8, np.inf])
    np.testing.assert_allclose(scale_of(without, bob=jnp.asarray(True)), [0.2, 0.3, 0.8, 1.2])


def test_a_motion_is_simulated_until_it_repeats_or_reaches_the_bound():
    def halved(y, _):
        return period(0.5 * y, size=jnp.max(jnp.abs(y)))

    def settled(bound):
        return settle(halved, P, jnp.full(4, 0.1), None, tolerance=1e-6, max_periods=bound)

    assert status_name(settled(5).status) == "not_settled"
    found = settled(50)
    assert status_name(found.status) == "rocking"
    assert 10 < int(found.elapsed) < 30
