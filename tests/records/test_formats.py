"""Every format: real files against the peaks that they state, made-up files digit by digit."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.records.synthetic import FORMATS, Format, G, shaking
from tpd import Record
from tpd.formats.text import UnreadableRecord

DATA = Path(__file__).parent / "data"
PACKAGED = Path(__file__).parents[2] / "tpd" / "records" / "data"


REAL = {
    # Peaks (m/s^2) as printed in the headers of the files, with the digits that are printed there.
    "coalinga_1983_cut.V2": (0.02, 600, ((2.67957, 5e-6), (0.94805, 5e-6), (2.56231, 5e-6))),
    "ridgecrest_2019_cut.RAW": (0.01, 600, ((0.567 * G, 5e-3), (0.471 * G, 5e-3), (0.361 * G, 5e-3))),
    "anchorage_2018_cut.V2c": (0.005, 600, ((0.06851512, 5e-9),)),
}


@pytest.mark.parametrize("name", REAL)
def test_a_real_file_has_the_peaks_of_its_header(name):
    dt, n, peaks = REAL[name]
    records = Record.read_all(DATA / name)
    assert len(records) == len(peaks)
    for record, (peak, margin) in zip(records, peaks, strict=True):
        assert record.dt == pytest.approx(dt, rel=1e-15)
        assert record.acceleration.shape == (n,)
        assert record.pga == pytest.approx(peak, abs=margin)


def test_words_of_a_real_file():
    north = Record.read(DATA / "coalinga_1983_cut.V2", channel=2)
    assert north.name == "PARKFIELD FAULT ZONE 14/0 DEG"
    assert north.event == "COALINGA EARTHQUAKE MAY 2, 1983 16:42 PDT"
    up = Record.read(DATA / "coalinga_1983_cut.V2", channel=1)
    assert "vertical component" in up.notes
    raw = Record.read(DATA / "ridgecrest_2019_cut.RAW", channel=1)
    assert raw.event == "Fri Jul 5, 2019 20:19:37.0 PDT"
    assert any(note.startswith("uncorrected") for note in raw.notes)
    assert any(note.startswith("offset") for note in raw.notes)


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_a_made_up_file_is_recognised_whatever_its_name(form: Format, tmp_path):
    values = form.size * shaking(100)
    path = tmp_path / "record.bin"
    path.write_text(form.write(values, 0.01), newline="")
    record = Record.read_all(path)[0]
    assert record.dt == 0.01
    np.testing.assert_allclose(record.acceleration, np.array(form.printed(values)) * form.factor, rtol=1e-15)


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_what_is_written_is_read(form: Format, tmp_path, data):
    dt = data.draw(st.sampled_from((0.005, 0.01, 0.02)), label="dt")
    seconds = data.draw(st.integers(1, 2), label="seconds")
    n = round(seconds / dt) if form.name == "knet" else data.draw(st.integers(2, 60), label="n")
    unit = st.floats(-1.0, 1.0, allow_nan=False).map(lambda x: round(x, 7))
    few = data.draw(st.lists(unit, min_size=2, max_size=12), label="values")
    values = form.size * np.resize(few, n)
    printed = form.printed(values)
    path = tmp_path / "record"
    path.write_text(form.write(printed, dt), newline="")
    record = Record.read_all(path)[0]
    assert record.dt == pytest.approx(dt, rel=1e-15)
    np.testing.assert_allclose(record.acceleration, np.array(printed) * form.factor, rtol=1e-15)


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


def test_baselines_are_removed_on_request():
    path = DATA / "ridgecrest_2019_cut.RAW"
    as_read = Record.read(path, channel=1)
    mean = Record.read(path, channel=1, baseline="mean")
    line = Record.read(path, channel=1, baseline="linear")
    assert abs(np.mean(as_read.acceleration)) > 0.04
    np.testing.assert_allclose(
        mean.acceleration, as_read.acceleration - np.mean(as_read.acceleration), atol=1e-15
    )
    t = np.arange(600) * 0.01
    assert np.abs(np.polyfit(t, line.acceleration, 1)).max() < 1e-12
    assert any(note.startswith("baseline") for note in mean.notes)


TABLES = {
    "comma": "time,acc (g)\n0,0\n0.02,0.5\n0.04,-0.1\n",
    "blanks": "Time (s)   Acceleration (g)\n 0.00 0.0\n 0.02 5.0e-1\n 0.04 -1d-1\n",
    "semicolons": "% t; a; units: g\n0;0\n.02;.5\n.04;-.1\n",
    "units alone": "s g\n0\t0\n0.02\t0.5\n0.04\t-0.1\n",
    "late start": "# [g]\n10.00 0\n10.02 0.5\n10.04 -0.1\n",
    "utf-8 mark": "\ufefft,a [g]\n0,0\n0.02,0.5\n0.04,-0.1\n",
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_tables(text, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(text, encoding="utf-8")
    record = Record.read(path)
    assert record.dt == 0.02
    np.testing.assert_allclose(record.acceleration, [0.0, 0.5 * G, -0.1 * G], rtol=1e-15)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("m/s2", 1.0),
        ("M/S^2", 1.0),
        ("m/s²", 1.0),
        ("cm/sec/sec", 0.01),
        ("Gal", 0.01),
        ("mm/s2", 0.001),
        ("g", G),
    ],
)
def test_units(unit, factor, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(f"t [s], a [{unit}]\n0,0\n0.02,0.5\n", encoding="utf-8")
    stated = Record.read(path)
    path.write_text("0,0\n0.02,0.5\n", encoding="utf-8")
    given_ = Record.read(path, unit=unit)
    assert stated.acceleration[1] == given_.acceleration[1] == 0.5 * factor


PEER_HEADERS = (
    ("X 1/2/99 0304, Y, 90", "ACCELERATION TIME HISTORY IN UNITS OF G", " 3 .01000 NPTS, DT"),
    ("X, 1/2/99, Y, 90", "ACCELERATION TIME SERIES IN UNITS OF G", "NPTS=    3, DT=   .0100 SEC,     "),
    ("X, Y", "ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz", "NPTS= 3, DT= .01000 SEC"),
)


@pytest.mark.parametrize("head", PEER_HEADERS)
def test_headers_of_peer(head, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(["PEER", *head, "  .1000000E+00 -.2000000E-01", "  .0000000E+00", ""]))
    record = Record.read(path)
    assert record.dt == 0.01
    np.testing.assert_allclose(record.acceleration, [0.1 * G, -0.02 * G, 0.0], rtol=1e-15)
    assert record.event.startswith("X")
    assert record.name


def test_times_that_are_rounded(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("t,a (g)\n" + "".join(f"{i / 300:.5f},{i % 7}\n" for i in range(301)))
    assert Record.read(path).dt == pytest.approx(1.0 / 300.0, rel=1e-9)


def test_a_column_needs_its_step_and_its_unit(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("0\n0.5\n-0.1\n")
    with pytest.raises(ValueError, match="states no unit of acceleration: give `unit`"):
        Record.read(path, dt=0.01)
    with pytest.raises(ValueError, match="states no step: give `dt`"):
        Record.read(path, unit="g")
    assert Record.read(path, unit="g", dt=0.01).dt == 0.01
    path.write_text("a (g), dt = 0.02 s\n0\n0.5\n-0.1\n")
    assert Record.read(path).dt == 0.02
    with pytest.raises(ValueError, match=r"step of 0.02 s, but `dt` is 0.01 s"):
        Record.read(path, dt=0.01)


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


REFUSED = {
    "unequal steps": (
        "t,a (g)\n0,0\n0.02,1\n0.05,1\n0.07,0\n",
        "equal steps, but the one after line . is 0.0. s",
    ),
    "missing sample": (
        "t,a (g)\n0,0\n0.02,1\n0.06,1\n0.08,0\n0.10,0\n",
        "equal steps, but the one after line",
    ),
    "time backwards": ("t,a (g)\n0,0\n-0.02,1\n", "equal steps"),
    "coarse times": ("t,a (g)\n0.000,0\n0.003,1\n0.007,1\n0.010,1\n", "equal steps"),
    "milliseconds": ("t (ms),a (g)\n0,0\n20,1\n", "times must be in s"),
    "step in ms": ("a (g), dt = 5 ms\n0\n1\n", "must state the step in s"),
    "steps of 20 s": ("t (s),a (g)\n0,0\n20,1\n", "step must be 1e-05 s to 1 s"),
    "two units": ("t,a (g),(m/s2)\n0,0\n0.02,1\n", "several units"),
    "three columns": ("t,a,b (g)\n0,0,1\n0.02,1,1\n", "channels 0: a .*choose one by `channel`"),
    "the first row damaged": (
        "t,a (g)\nNaN,0\n0.02,1\n0.04,1\n",
        "line 2 must be a row of numbers or a header",
    ),
    "the first sample damaged": (
        "# a [g], dt=0.01\nabc\n0.1\n0.2\n",
        "line 2 must be a row of numbers or a header",
    ),
    "a row too short": ("t,a (g)\n0,0\n0.02\n0.04,1\n", "line 3 must have 2 as the first row"),
    "nan": ("t,a (g)\n0,0\n0.02,nan\n", "line 3 must hold numbers, but has 'nan'"),
    "inf": ("t,a (g)\n0,0\n0.02,inf\n", "must hold numbers"),
    "underscore": ("t,a (g)\n0,0\n0.02,1_0\n", "must hold numbers"),
    "absurd peak": ("t,a (g)\n0,0\n0.02,100\n", "peak must be at most 100 m/s"),
    "cut": ("t,a (g)\n0,0\n0.02,0.1", "must end with a line break"),
    "one sample": ("t,a (g)\n0,0\n", "2 samples or more"),
    "no numbers": ("t,a (g)\nabc\n", "ends after line 2, before the first number"),
    "empty": ("", "file is empty"),
    "blank": (" \n\n", "file is empty"),
    "prose": ("A letter.\n" * 50, "no known format"),
    "velocity": (
        "PEER\nX, 1\nVELOCITY TIME SERIES IN UNITS OF CM/SEC\nNPTS= 2, DT= .01 SEC\n 1 2\n",
        "ACCELERATION",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name, tmp_path):
    text, message = REFUSED[name]
    path = tmp_path / "a.txt"
    path.write_text(text)
    with pytest.raises(UnreadableRecord, match=rf"^a.txt: .*({message})") as caught:
        Record.read(path)
    assert "\n" not in str(caught.value)


def test_no_file_and_a_directory(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file"):
        Record.read(tmp_path / "none.AT2")
    with pytest.raises(UnreadableRecord, match="a directory is no file"):
        Record.read(tmp_path)
