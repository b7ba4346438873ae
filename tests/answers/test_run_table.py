"""Runs of a block under many motions: against single motions, and for any number of workers."""

import dataclasses
import math

import numpy as np
import pytest

import tpd
from tests.unanswered import unanswered
from tpd.answers.run_table import ANGLES, follow_scaled
from tpd.answers.statistics import Share
from tpd.compiled.columns import MU
from tpd.scene.status import names_of

STATUE = tpd.Block(width=0.45, height=1.8, mass=900.0, friction=0.0, restitution="housner")
PENDULUM = tpd.Pendulum(mass=90.0, length=0.9, damping_ratio=0.4)
MOTIONS = [tpd.Pulse.ricker(acceleration=3.0, frequency=1.0), tpd.Record(4.0 * np.sin(np.arange(90.0)), 0.03)]
FACTORS = np.array([[0.2, 1.0, 5.0], [0.5, 1.5, 4.0]])


@pytest.fixture(scope="module")
def runs():
    return follow_scaled(STATUE, (None, PENDULUM), MOTIONS, FACTORS, free=5.0)


def test_the_run_table_combines_every_record_with_every_pendulum(runs):
    assert runs.tilt.shape == (2, 2, 3)
    for i, j, k in np.ndindex(2, 2, 3):
        scene = tpd.Scene(STATUE, MOTIONS[j].scaled(FACTORS[j, k]))
        one = tpd.transient(scene, (None, PENDULUM)[i], free=5.0)
        status = tpd.status_name(one.status)
        assert names_of(runs.outcome)[i, j, k] == status
        assert runs.is_lifted[i, j, k] == (status != "stood")
        # Angles at the moment of overturning mean nothing; without a pendulum there is a bob without mass.
        names = {"impacts": one.impacts, "tilt": one.tilt}
        if i == 1:
            names |= {"swing": one.swing, "rod_angle": one.rod_angle}
        for name, known in names.items():
            known = math.inf if status == "overturned" and name != "impacts" else float(known)
            assert getattr(runs, name)[i, j, k] == pytest.approx(known, rel=1e-9), name
    assert 0 < runs.is_overturned.sum() < 12
    assert not runs.is_lifted.all()
    assert not runs.is_unanswered.any()
    assert runs.condition[0].tolist() == [[0, 0, 0], [1, 1, 1]]


def test_results_do_not_depend_on_workers_or_the_order_of_records(runs):
    seen, given = [], {"free": 5.0, "progress": lambda *n: seen.append(n)}
    one = follow_scaled(STATUE, (None, PENDULUM), MOTIONS, FACTORS, workers=1, **given)
    turned = follow_scaled(STATUE, (PENDULUM, None), MOTIONS[::-1], FACTORS[::-1], free=5.0, workers=3)
    for name in (*ANGLES, "impacts", "outcome", "mu"):
        a, b, c = (getattr(table, name) for table in (runs, one, turned))
        np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(a, c[::-1, ::-1])
    assert seen[-1] == (12, 12)


def test_a_run_without_a_result_is_nan_and_not_overturned(monkeypatch):
    unanswered(monkeypatch, lambda rows: rows[:, MU] > 0.0)
    found = follow_scaled(STATUE, (None, PENDULUM), MOTIONS, FACTORS, free=5.0)
    assert found.is_unanswered.tolist() == [[[False] * 3] * 2, [[True] * 3] * 2]
    assert not found.is_overturned[1].any()
    for name in (*ANGLES, "impacts", "severity"):
        assert np.array_equal(np.isnan(getattr(found, name)), found.is_unanswered), name
    assert found.stands[1].tolist() == [[False] * 3] * 2
    assert set(found.columns()["outcome"][6:]) == {"event_bound"}


@pytest.mark.parametrize(
    ("factors", "free", "said"),
    [
        (FACTORS[:1], 1.0, "`factors` must have a row for each of 2 motions, but has"),
        (-FACTORS, 1.0, "`factors` must be zero or positive"),
        (FACTORS, -1.0, "`free` must be between 0 and"),
    ],
)
def test_invalid_factors_are_rejected_in_one_sentence(factors, free, said):
    with pytest.raises(ValueError, match=said):
        follow_scaled(STATUE, (None,), MOTIONS, factors, free=free)


def test_the_interval_of_a_share_counts_earthquakes():
    table = follow_scaled(STATUE, (None,), MOTIONS, FACTORS, free=5.0).reshape(6)
    share = table.share_overturned
    assert 0.0 < share.value < 1.0
    grouped = dataclasses.replace(table, cluster=np.repeat([4, 7], 3))
    assert grouped.share_overturned == Share.of(table.is_overturned, grouped.cluster)
    assert grouped.share_overturned.value == share.value
    assert grouped.share_overturned.low < share.low
    assert grouped.share_overturned.high > share.high
    some = grouped.of(np.array([True, False, True, False, False, True]))
    assert some.cluster.tolist() == [4, 4, 7]
    assert some.tilt.tolist() == table.tilt[[0, 2, 5]].tolist()
    assert grouped.columns()["cluster"].tolist() == [4] * 3 + [7] * 3
    assert "cluster" not in table.columns()
