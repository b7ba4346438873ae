"""From a file to its channels: compressed files, encodings, arguments, archives, and files of seismology."""

from __future__ import annotations

import gzip
import io
import re
import sys
import types
import zipfile

import numpy as np
import pytest
import scipy.io

from tests.formats.reader import DATA, read
from tpd import Record
from tpd.formats.channel import check_channel
from tpd.formats.read import read_waveforms
from tpd.formats.text import NoAcceleration, UnreadableRecord


def test_a_gzip_file_is_read_like_its_content(tmp_path):
    path = tmp_path / "coalinga"
    path.write_bytes(gzip.compress((DATA / "coalinga_1983_cut.V2").read_bytes()))
    assert Record.read_all(path) == Record.read_all(DATA / "coalinga_1983_cut.V2")
    path.write_bytes(path.read_bytes()[:-3000])
    with pytest.raises(UnreadableRecord, match="compressed file is damaged or cut"):
        Record.read(path)


def test_a_file_of_several_channels_needs_the_argument_channel():
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


def test_missing_and_empty_files_and_directories_are_rejected(tmp_path):
    (tmp_path / "a.txt").write_text(" \n\n")
    for path, error, words in (
        (tmp_path / "none.AT2", FileNotFoundError, "the file does not exist"),
        (tmp_path, UnreadableRecord, "the path is a directory"),
        (".", UnreadableRecord, r"^\.: the path is a directory and not a file"),
        ("", ValueError, r"^`path` must name a file, but is ''$"),
        (tmp_path / "a.txt", UnreadableRecord, "^a.txt: the file is empty"),
    ):
        with pytest.raises(error, match=words):
            Record.read(path)


def test_a_file_in_utf_16_is_read(tmp_path):
    text = "time (s),acc (g)\n0.00,0.1\n0.01,0.2\n0.02,0.3\n"
    little, big = text.encode("utf-16-le"), text.encode("utf-16-be")
    for sound in (text.encode("utf-16"), b"\xff\xfe" + little, b"\xfe\xff" + big):
        assert read(tmp_path, sound).acceleration.shape == (3,)
    for wrong, said in ((little, "UTF-16"), (b"\xff\xfe" + little[:-1], "UTF-16, but damaged or cut")):
        with pytest.raises(UnreadableRecord, match=said):
            read(tmp_path, wrong)


class Trace:
    """A trace of ObsPy, as far as it is used."""

    def __init__(self, data: np.ndarray, identity: str = "XX.MADE..HNE") -> None:
        self.data, self.id = data, identity
        self.stats = types.SimpleNamespace(delta=0.01, channel=identity[-3:], starttime="1999-01-02T03:04:05")


def read_as(monkeypatch, *traces: Trace, unit: str | None = "m/s2"):
    """Channels by an ObsPy that has these traces."""
    monkeypatch.setitem(sys.modules, "obspy", types.SimpleNamespace(read=lambda stream: list(traces)))
    return read_waveforms(b"\x00", unit)


def test_a_waveform_is_read_in_the_stated_unit(monkeypatch):
    channel = read_as(monkeypatch, Trace(np.array([0.0, 50.0])), unit="gal")[0]
    np.testing.assert_allclose(channel.acceleration, [0.0, 0.5])
    assert (channel.dt, channel.component, channel.name) == (0.01, "HNE", "XX.MADE..HNE")
    # Nothing says whether a waveform is corrected.
    assert check_channel(channel, None).acceleration.tolist() == [-0.25, 0.25]
    assert check_channel(channel, "none").acceleration.tolist() == [0.0, 0.5]


def test_waveforms_in_counts_or_with_gaps_are_rejected(monkeypatch):
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


def test_a_missing_obspy_is_reported_with_its_extra(monkeypatch, tmp_path):
    def unknown(stream: object) -> None:
        raise TypeError("Unknown format")

    for module, words in (
        (None, r"need the extra `obspy`: pip install '.\[obspy\]'"),
        (types.SimpleNamespace(read=unknown), "ObsPy cannot read it"),
    ):
        monkeypatch.setitem(sys.modules, "obspy", module)
        with pytest.raises(UnreadableRecord, match=f"^a.mseed: .* {words}"):
            read(tmp_path, b"000001D \x00\x01\x02", "a.mseed")


def zipped(*names: str) -> bytes:
    """An archive of empty files."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in names:
            archive.writestr(name, "")
    return stream.getvalue()


def saved(save, *words, **named) -> bytes:
    """What a function writes into a file."""
    stream = io.BytesIO()
    save(stream, *words, **named)
    return stream.getvalue()


WAVE = np.linspace(0.0, 1.0, 20)
SHEET, OTHER, TABLE = (
    "save the sheet as CSV",
    "data of another program",
    "save time in s and acceleration as a",
)
NO_TEXT = {
    "a.xlsx": (zipped("[Content_Types].xml", "xl/workbook.xml"), "a workbook", SHEET),
    "a.ods": (b"PK\x03\x04" + b"mimetypeapplication/vnd.oasis.opendocument.spreadsheet", "a workbook", SHEET),
    "a.xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99), "a workbook", SHEET),
    "a.docx": (zipped("[Content_Types].xml", "word/document.xml"), "a document", TABLE),
    "a.npz": (saved(np.savez, x=WAVE), OTHER, TABLE),
    "v5.mat": (saved(scipy.io.savemat, {"acc": WAVE}), OTHER, TABLE),
    "v7.3.mat": (b"MATLAB 7.3 MAT-file, made up".ljust(512) + b"\x89HDF\r\n\x1a\n", OTHER, TABLE),
    "a.parquet": (b"PAR1" + bytes(99) + b"PAR1", OTHER, TABLE),
    "a.rds": (gzip.compress(b"X\n\x00\x00\x00\x03" + bytes(99)), OTHER, TABLE),
    "a.pdf": (b"%PDF-1.7\n" + bytes(99), "a document", TABLE),
    "a.png": (b"\x89PNG\r\n\x1a\n" + bytes(99), "a picture", TABLE),
    "a.html": (b"\xef\xbb\xbf<!DOCTYPE html><html>0.0 0.1</html>", "a page of HTML or XML", TABLE),
    "a.zip": (zipped("a.AT2", "b.AT2"), "an archive or compressed", "unpack it first"),
    "a.bz2": (b"BZh9\x00 rest", "an archive or compressed", "unpack it first"),
    "a.tar": (bytes(257) + b"ustar" + bytes(100), "an archive or compressed", "unpack it first"),
}


def test_a_binary_file_is_rejected_with_its_kind_and_a_remedy(tmp_path):
    for name, (data, kind, remedy) in NO_TEXT.items():
        words = rf"^{name}: the file is {re.escape(kind)}.*: {remedy}"
        with pytest.raises(NoAcceleration, match=words) as raised:
            read(tmp_path, data, name)
        assert raised.value.content.startswith(kind)
        assert len(str(raised.value)) < 150
    # A text that begins alike is a text.
    text = "PAR1 station\n" + "".join(f"{0.01 * i:.2f},{a:.4f}\n" for i, a in enumerate(WAVE))
    columns = {"time": 1, "acceleration": 2}
    assert read(tmp_path, text, unit="g", skip=1, columns=columns).acceleration.shape == (20,)


def test_source_and_error_message_state_file_and_channel(tmp_path):
    path = DATA / "coalinga_1983_cut.V2"
    named = [f"{path.name}, channel {i} ({name})" for i, name in enumerate(("90 DEG", "UP", "0 DEG"))]
    assert [r.source for r in Record.read_all(path)] == named
    text = "time (s),N (g),E (g)\n" + "".join(f"{0.01 * i:.2f},0.1,{9.0 * i}\n" for i in range(50))
    with pytest.raises(UnreadableRecord, match=r"^quake.csv, channel 1 \(E\): the peak must be at most 100"):
        read(tmp_path, text, "quake.csv")


HEADERS = {
    "SAC velocity": ({"sac": {"idep": 7}}, "velocity"),
    "SAC spectrum": ({"sac": {"idep": 8, "iftype": 3}}, "spectrum"),
    "SEG-Y": ({"segy": {"trace_header": types.SimpleNamespace(trace_value_measurement_unit=6)}}, "velocity"),
    "SU": ({"su": {"trace_header": types.SimpleNamespace(trace_value_measurement_unit=5)}}, "displacement"),
    "CyberShake": ({"_format": "CYBERSHAKE", "channel": "MXE"}, "velocity"),
    "a factor": ({"calib": 1e9}, "the factor 1e\\+09, which may be missing in the samples"),
    "rotation": ({"channel": "HJE"}, "rotation"),
    "geophone": ({"channel": "EPZ"}, "velocity"),
    "another instrument": ({"channel": "HXN"}, "the instrument X of HXN"),
    "acceleration": ({"channel": "HNE", "sac": {"idep": 8, "iftype": 1}, "calib": 1.0}, None),
    "unknown": ({"channel": "", "sac": {"idep": 5}}, None),
    "K-NET": ({"channel": "EW1"}, None),
    "vertical angle": ({"channel": "ACC", "sac": {"idep": 8, "cmpinc": 0.0}, "name": "ACC up"}, None),
    "seismometer": ({"channel": "HHE"}, "samples count as accelerations"),
}


def test_only_a_waveform_of_an_acceleration_is_read(monkeypatch):
    for header, content in HEADERS.values():
        trace = Trace(np.array([0.0, 0.5]))
        vars(trace.stats).update(header)
        if content is None or content.startswith("samples"):
            (channel,) = read_as(monkeypatch, trace)
            assert channel.peak == 0.5
            assert channel.component == header.get("name", trace.stats.channel)
            assert any("count as accelerations" in note for note in channel.notes) == bool(content)
            with pytest.raises(UnreadableRecord, match="states no unit"):
                read_as(monkeypatch, trace, unit=None)
        else:
            with pytest.raises(UnreadableRecord, match=content):
                read_as(monkeypatch, trace)
