"""From a file to its channels: compressed files, encodings, arguments, archives, and files of seismology."""

from __future__ import annotations

import gzip
import sys
import types

import numpy as np
import pytest

from tests.formats.reader import DATA, read
from tpd import Record
from tpd.formats.read import read_waveforms
from tpd.formats.text import UnreadableRecord


def test_a_file_compressed_by_gzip_is_the_file(tmp_path):
    path = tmp_path / "coalinga"
    path.write_bytes(gzip.compress((DATA / "coalinga_1983_cut.V2").read_bytes()))
    assert Record.read_all(path) == Record.read_all(DATA / "coalinga_1983_cut.V2")
    path.write_bytes(path.read_bytes()[:-3000])
    with pytest.raises(UnreadableRecord, match="compressed file is damaged or cut"):
        Record.read(path)


def test_several_channels_are_listed_and_what_the_header_says_is_not_overruled():
    path = DATA / "coalinga_1983_cut.V2"
    assert Record.read(path, channel=0, unit="gal", dt=0.02) == Record.read(path, channel=0)
    for how, said in (
        ({}, r"channels 0: 90 DEG \(2.68 m/s\^2\), 1: UP .*choose one by `channel`"),
        ({"channel": 3}, r"channels 0: .*`channel` is 3"),
        ({"channel": 0, "unit": "g"}, "states the unit cm/s2, but `unit` is 'g'"),
        ({"unit": "furlong"}, r"`unit` must be one of g, .* but is 'furlong'"),
        ({"baseline": "cubic"}, "`baseline` must be one of none, mean, linear"),
        ({"dt": -1.0}, "`dt` must be positive"),
        ({"channel": True}, "`channel` must be a whole number"),
    ):
        with pytest.raises(ValueError, match=said):
            Record.read(path, **how)


def test_no_file_a_directory_and_a_file_without_content(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file"):
        Record.read(tmp_path / "none.AT2")
    with pytest.raises(UnreadableRecord, match="a directory is no file"):
        Record.read(tmp_path)
    for text in ("", " \n\n"):
        with pytest.raises(UnreadableRecord, match=r"^a.txt: the file is empty"):
            read(tmp_path, text)


@pytest.mark.mends("text of UTF-16 was called a binary file")
def test_utf_16(tmp_path):
    text = "time (s),acc (g)\n0.00,0.1\n0.01,0.2\n0.02,0.3\n"
    little, big = text.encode("utf-16-le"), text.encode("utf-16-be")
    for sound in (text.encode("utf-16"), b"\xff\xfe" + little, b"\xfe\xff" + big):
        assert read(tmp_path, sound).acceleration.shape == (3,)
    for wrong, said in ((little, "UTF-16"), (b"\xff\xfe" + little[:-1], "UTF-16, but damaged or cut")):
        with pytest.raises(UnreadableRecord, match=said):
            read(tmp_path, wrong)


@pytest.mark.mends("archives were called binary files of no known format")
def test_archives_are_refused_by_name(tmp_path):
    for start, kind in ((b"PK\x03\x04", "zip"), (b"7z\xbc\xaf\x27\x1c", "7z"), (b"BZh9", "bzip2")):
        with pytest.raises(UnreadableRecord, match=rf"archive or compressed \({kind}\): unpack it"):
            read(tmp_path, start + b"\x00 rest", "a.dat")
    with pytest.raises(UnreadableRecord, match=r"archive \(tar\): unpack it"):
        read(tmp_path, bytes(257) + b"ustar" + bytes(100))


class Trace:
    """A trace of ObsPy, as far as it is used."""

    def __init__(self, data: np.ndarray, identity: str = "XX.MADE..HNE") -> None:
        self.data, self.id = data, identity
        self.stats = types.SimpleNamespace(delta=0.01, channel=identity[-3:], starttime="1999-01-02T03:04:05")


def obspy(monkeypatch, reads) -> None:
    """An ObsPy of this function alone."""
    module = types.ModuleType("obspy")
    monkeypatch.setattr(module, "read", reads, raising=False)
    monkeypatch.setitem(sys.modules, "obspy", module)


def read_as(monkeypatch, *traces: Trace, unit: str | None = "m/s2"):
    obspy(monkeypatch, lambda stream: list(traces))
    return read_waveforms(b"\x00", unit)


def test_a_waveform_in_a_unit(monkeypatch):
    channel = read_as(monkeypatch, Trace(np.array([0.0, 50.0])), unit="gal")[0]
    np.testing.assert_allclose(channel.acceleration, [0.0, 0.5])
    assert (channel.dt, channel.component, channel.name) == (0.01, "HNE", "XX.MADE..HNE")


def test_waveforms_that_are_refused(monkeypatch):
    sound = Trace(np.array([0.0, 0.5]))
    for traces, said in (
        ([Trace(np.array([0, 5]))], "counts of the instrument"),
        ([Trace(np.ma.masked_array([0.0, 0.5], [True, False]))], r"samples of .* are missing"),
        ([sound, sound], "several pieces"),
        ([], "no trace"),
        ([Trace(np.array([0.0, np.nan]))], "not finite"),
    ):
        with pytest.raises(UnreadableRecord, match=said):
            read_as(monkeypatch, *traces)
    with pytest.raises(UnreadableRecord, match="states no unit"):
        read_as(monkeypatch, sound, unit=None)


def test_without_obspy_one_sentence_names_the_extra_and_rubbish_is_refused(monkeypatch, tmp_path):
    def unknown(stream: object) -> None:
        raise TypeError("Unknown format")

    monkeypatch.setitem(sys.modules, "obspy", None)
    with pytest.raises(UnreadableRecord, match=r"^a.mseed: .* need the extra tpd\[obspy\]"):
        read(tmp_path, b"000001D \x00\x01\x02", "a.mseed")
    obspy(monkeypatch, unknown)
    with pytest.raises(UnreadableRecord, match=r"^a.bin: .* ObsPy cannot read it"):
        read(tmp_path, np.random.default_rng(0).bytes(1000), "a.bin")
