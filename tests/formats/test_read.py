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


def test_several_channels_are_listed():
    with pytest.raises(
        ValueError, match=r"channels 0: 90 DEG \(2.68 m/s\^2\), 1: UP .*choose one by `channel`"
    ):
        Record.read(DATA / "coalinga_1983_cut.V2")
    with pytest.raises(ValueError, match=r"channels 0: .*`channel` is 3"):
        Record.read(DATA / "coalinga_1983_cut.V2", channel=3)


def test_what_the_header_says_is_not_overruled():
    path = DATA / "coalinga_1983_cut.V2"
    with pytest.raises(ValueError, match="states the unit cm/s2, but `unit` is 'g'"):
        Record.read(path, channel=0, unit="g")
    assert Record.read(path, channel=0, unit="gal", dt=0.02) == Record.read(path, channel=0)
    with pytest.raises(ValueError, match=r"`unit` must be one of g, .* but is 'furlong'"):
        Record.read(path, unit="furlong")
    with pytest.raises(ValueError, match="`baseline` must be one of mean, linear"):
        Record.read(path, baseline="cubic")
    with pytest.raises(ValueError, match="`dt` must be positive"):
        Record.read(path, dt=-1.0)
    with pytest.raises(ValueError, match="`channel` must be a whole number"):
        Record.read(path, channel=True)


def test_no_file_and_a_directory(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file"):
        Record.read(tmp_path / "none.AT2")
    with pytest.raises(UnreadableRecord, match="a directory is no file"):
        Record.read(tmp_path)


@pytest.mark.parametrize(("text", "said"), [("", "file is empty"), (" \n\n", "file is empty")])
def test_files_without_content(text, said, tmp_path):
    with pytest.raises(UnreadableRecord, match=f"^a.txt: the {said}"):
        read(tmp_path, text)


ROWS = "time (s),acc (g)\n0.00,0.1\n0.01,0.2\n0.02,0.3\n"


@pytest.mark.mends("text of UTF-16 was called a binary file")
@pytest.mark.parametrize(
    ("code", "mark"), [("utf-16", b""), ("utf-16-le", b"\xff\xfe"), ("utf-16-be", b"\xfe\xff")]
)
def test_utf_16(code, mark, tmp_path):
    assert read(tmp_path, mark + ROWS.encode(code)).acceleration.shape == (3,)
    with pytest.raises(UnreadableRecord, match="UTF-16"):
        read(tmp_path, ROWS.encode("utf-16-le"))
    with pytest.raises(UnreadableRecord, match="UTF-16, but damaged or cut"):
        read(tmp_path, b"\xff\xfe" + ROWS.encode("utf-16-le")[:-1])


@pytest.mark.mends("archives were called binary files of no known format")
@pytest.mark.parametrize(
    ("start", "kind"), [(b"PK\x03\x04", "zip"), (b"7z\xbc\xaf\x27\x1c", "7z"), (b"BZh9", "bzip2")]
)
def test_archives_are_refused_by_name(start, kind, tmp_path):
    with pytest.raises(UnreadableRecord, match=rf"archive or compressed \({kind}\): unpack it"):
        read(tmp_path, start + b"\x00 rest", "a.dat")
    with pytest.raises(UnreadableRecord, match=r"archive \(tar\): unpack it"):
        read(tmp_path, bytes(257) + b"ustar" + bytes(100))


class Trace:
    """A trace of ObsPy, as far as it is used."""

    def __init__(self, data: np.ndarray, identity: str = "XX.MADE..HNE") -> None:
        self.data, self.id = data, identity
        self.stats = types.SimpleNamespace(delta=0.01, channel=identity[-3:], starttime="1999-01-02T03:04:05")


def read_as(monkeypatch, *traces: Trace, unit: str | None = "m/s2"):
    obspy = types.ModuleType("obspy")
    monkeypatch.setattr(obspy, "read", lambda stream: list(traces), raising=False)
    monkeypatch.setitem(sys.modules, "obspy", obspy)
    return read_waveforms(b"\x00", unit)


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
    with pytest.raises(UnreadableRecord, match=r"^a.mseed: .* need the extra tpd\[obspy\]"):
        read(tmp_path, b"000001D \x00\x01\x02", "a.mseed")


def test_rubbish_is_refused(monkeypatch, tmp_path):
    obspy = types.ModuleType("obspy")

    def unknown(stream: object) -> None:
        raise TypeError("Unknown format")

    monkeypatch.setattr(obspy, "read", unknown, raising=False)
    monkeypatch.setitem(sys.modules, "obspy", obspy)
    with pytest.raises(UnreadableRecord, match=r"^a.bin: .* ObsPy cannot read it"):
        read(tmp_path, np.random.default_rng(0).bytes(1000), "a.bin")
