"""Tasks of the entrance to the linear equations: the same motion by each of them."""

import numpy as np
import pytest

from tests.reference import HUNG, REST, along, exact, parameters
from tpd.exact.motion import LEG
from tpd.models import exact_entry as entry
from tpd.models.compiled_linear import packed
from tpd.models.rows import settle_all
from tpd.scene.parameters import as_arrays

CASE = HUNG[0]
PERIOD = 2.0 * np.pi / CASE.x[6]


def row():
    return np.asarray(packed(as_arrays(parameters(CASE.x))))[None].copy()


def run(task, *buffers, **settings):
    limits = {"periods": 6, "events": 500, "rest_rate": 2e-7, "tolerance": 1e-8}
    entry.run(0, 1, np.array([entry.settings(task=getattr(entry, task), **{**limits, **settings})]), *buffers)


def test_legs_join_and_end_where_the_trajectory_does():
    legs, ends = np.zeros((1, 200), LEG), np.zeros((1, 2))
    run("LEGS_OF", row(), np.zeros((1, 4)), legs, ends, pieces=200)
    count = int(ends[0, 0])
    legs = legs[0, :count]
    whole = np.cumsum(legs["begun"] < np.roll(legs["begun"] + legs["lasted"], 1) - 1e-9) - 1
    assert whole[-1] == 5
    states, statuses, by = np.zeros((1, 2, 8)), np.zeros((1, 1)), np.zeros((1, 1, 4, 14))
    run("TRAJECTORY", row(), np.zeros((1, 4)), np.array([[0.0, 6 * PERIOD]]), states, statuses, by, periods=2)
    known = along(CASE.x, REST, np.array([0.0, 6.0]) * PERIOD)[0][-1]
    np.testing.assert_allclose(states[0, 1, :4], known, rtol=0, atol=1e-12)
    begins = [legs["y"][n] for n in range(1, count) if legs["which"][n - 1] == legs["which"][-1]]
    for n, y in enumerate(begins, 1):
        expected = along(CASE.x, REST, np.array([0.0, n]) * PERIOD)[0][-1]
        np.testing.assert_allclose(y, expected, rtol=0, atol=1e-11)


def test_the_steady_state_is_where_the_motion_settles():
    steady = np.zeros(1, entry.STEADY)
    run("STEADY_STATE", row(), np.zeros((1, 4)), steady, periods=500, lyapunov=100)
    known, settled = exact(CASE.x), settle_all(parameters(CASE.x), np.zeros((1, 4)))
    assert float(steady["amplitude"][0]) == known.amplitude
    assert int(steady["elapsed"][0]) == int(settled.elapsed[0]) == int(known.steady.elapsed)
    assert float(settled.amplitude[0]) == pytest.approx(known.amplitude, rel=1e-7)
