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


def motion(n: int = 400) -> np.ndarray:
    """Samples of a made-up motion, at most 0.4."""
    t = 0.01 * np.arange(n)
    return np.round(0.4 * np.sin(7.0 * t) * np.exp(-((t - 2.0) ** 2)), 5)


def table(
    step: str = "{:.2f}", head: str = "time (s),acc (g)", row: str = "{t},{a:.5f}", end: str = "\n"
) -> str:
    rows = [row.format(t=step.format(0.01 * i), i=i + 1, a=a, b=-a) for i, a in enumerate(motion())]
    return end.join([head, *rows, ""])


def in_columns(n: int) -> str:
    lines = motion().reshape(-1, n)
    return "\n".join("".join(f"{a:10.5f}" for a in line) for line in lines) + "\n"


READ = {
    "trailing comma": (table(head="time (s),acc (g),", row="{t},{a:.5f},"), {}),
    "trailing semicolon": (table(head="time (s);acc (g);", row="{t};{a:.5f};"), {}),
    "blank line among the rows": (table(end="\r\n").replace("\r\n0.05", "\r\n\r\n0.05", 1), {}),
    "decimal comma": (table(head="Zeit (s);a (g)").replace(",", ";").replace(".", ","), {}),
    "decimal comma, blanks": (table(head="t (s)\ta (g)", row="{t}\t{a:.5f}").replace(".", ","), {}),
    "numbers and times": (table(head="no,time (s),acc (g)", row="{i},{t},{a:.5f}"), {}),
    "five columns": ("Matched\n 400 0.01 656\n" + in_columns(5), {"unit": "g"}),
    "eight columns": ("400 points at equal spacing of 0.01 sec\nunits: g\n\n" + in_columns(8), {}),
    "count above a column": ("# (g)\n400 0.01\n" + in_columns(1), {}),
    "count and step in lines": ("# (g)\n400\n0.01\n" + in_columns(1), {}),
    "count": ("# (g)\n400\n" + in_columns(1), {"dt": 0.01}),
    "count above times": (table(head="time (s),acc (g)\n400,0.01"), {}),
    "per cent of g": (table(head="time (s),acc (%g)", row="{t},{a:.5f}e2"), {}),
}


@pytest.mark.mends("tables that people have were refused, or their counts read as samples")
@pytest.mark.parametrize("name", READ)
def test_tables_that_people_have(name, tmp_path):
    text, given_ = READ[name]
    path = tmp_path / "a.txt"
    path.write_text(text, newline="")
    try:
        record = Record.read(path, **given_)
    except UnreadableRecord as error:
        pytest.fail(str(error))
    assert record.dt == pytest.approx(0.01, rel=1e-12)
    assert record.acceleration.shape == (400,)
    np.testing.assert_allclose(record.acceleration, motion() * G, rtol=1e-12, atol=1e-15)


@pytest.mark.mends("text of UTF-16 was called a binary file")
@pytest.mark.parametrize("code", ["utf-16", "utf-16-le", "utf-16-be"])
def test_utf_16(code, tmp_path):
    path = tmp_path / "a.txt"
    mark = b"" if code == "utf-16" else {"utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}[code]
    path.write_bytes(mark + table().encode(code))
    try:
        assert Record.read(path).acceleration.shape == (400,)
    except UnreadableRecord as error:
        pytest.fail(str(error))
    path.write_bytes(table().encode("utf-16-le"))
    with pytest.raises(UnreadableRecord, match="UTF-16"):
        Record.read(path)


@pytest.mark.mends("times of few digits had unequal steps")
@pytest.mark.parametrize(("rate", "form"), [(128, "{:g}"), (128, "{:.4f}"), (300, "{:g}"), (75, "{:.3f}")])
def test_times_of_few_digits(rate, form, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("t,a (g)\n" + "".join(f"{form.format(i / rate)},{i % 7}\n" for i in range(390)))
    try:
        record = Record.read(path)
    except UnreadableRecord as error:
        pytest.fail(str(error))
    assert record.dt == pytest.approx(1.0 / rate, rel=1e-12)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:200] + lines[201:]))
    with pytest.raises(UnreadableRecord, match="equal steps"):
        Record.read(path)


@pytest.mark.mends("a first column 1, 2, 3 was read as times")
@pytest.mark.parametrize(
    "head", ["no,acc (g)", "#,acc (g)", "i;a (g)", "Sample,a [g]", "nr a(g)", "# a in\n# (g)"]
)
def test_numbers_of_samples_are_no_times(head, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(table(head=head, row="{i},{a:.5f}"))
    with pytest.raises(UnreadableRecord, match=r"numbers the samples .* give `dt`"):
        Record.read(path)
    record = Record.read(path, dt=0.01)
    assert (record.dt, record.acceleration.shape) == (0.01, (400,))


INCHES = ["in/s2", "in/sec^2", "inch/s/s", "IN/SEC/SEC"]


@pytest.mark.mends("a stated unit that was not known was overruled by `unit=`")
@pytest.mark.parametrize("unit", [*INCHES, "ft/s2", "furlong/s2", "yd/s/s", "counts"])
@pytest.mark.parametrize("head", ["time (s),acc ({})", "# units: {}\n# t a", "t [s] a [{}]"])
def test_a_stated_unit_is_never_overruled(unit, head, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(table(head=head.format(unit)))
    with pytest.raises(UnreadableRecord, match=r"but `unit` is 'g'|unit of acceleration must be one of"):
        Record.read(path, unit="g")
    if unit in INCHES:
        np.testing.assert_allclose(Record.read(path).acceleration, 0.0254 * motion(), rtol=1e-12)


@pytest.mark.mends("archives were called binary files of no known format")
@pytest.mark.parametrize(
    ("start", "kind"), [(b"PK\x03\x04", "zip"), (b"7z\xbc\xaf\x27\x1c", "7z"), (b"BZh9", "bzip2")]
)
def test_archives_are_refused_by_name(start, kind, tmp_path):
    path = tmp_path / "a.dat"
    path.write_bytes(start + b"\x00 rest")
    with pytest.raises(UnreadableRecord, match=rf"archive or compressed \({kind}\): unpack it"):
        Record.read(path)


AT2 = "PEER NGA\nQuake, 1/1/2000, PLACE, {}\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 3, DT= .01 SEC{}\n"
SAMPLES = " .1000000E+00 -.2000000E-01\n .3000000E-01"


@pytest.mark.mends("AT2 files without a last line end, or with words after DT, were refused")
@pytest.mark.parametrize("words", ["", ",", ", DURATION= .02 SEC", "  (filtered)"])
@pytest.mark.parametrize("end", ["", "\n"])
def test_at2_files_that_people_have(words, end, tmp_path):
    if words in ("", ",") and end:
        pytest.skip("was read before")
    path = tmp_path / "a.AT2"
    path.write_text(AT2.format("090", words) + SAMPLES + end)
    try:
        assert Record.read(path).acceleration.shape == (3,)
    except UnreadableRecord as error:
        pytest.fail(str(error))
    path.write_text(AT2.format("090", words) + SAMPLES[:-2])
    with pytest.raises(UnreadableRecord):
        Record.read(path)


VERTICALS = [
    ("UP", "a.AT2"),
    ("DWN", "a.AT2"),
    ("V", "a.AT2"),
    ("UD", "a.AT2"),
    ("VERT", "a.AT2"),
    ("", "R_X-UP.AT2"),
    ("", "M04UD.AT2"),
]


@pytest.mark.mends("PEER's verticals had no note")
@pytest.mark.parametrize(("direction", "name"), VERTICALS)
def test_verticals_of_peer(direction, name, tmp_path):
    path = tmp_path / name
    path.write_text(AT2.format(direction, "") + SAMPLES + "\n")
    assert "vertical component" in Record.read(path).notes


@pytest.mark.parametrize("direction", ["090", "360", "N-S", "S16E", "EW"])
def test_horizontals_of_peer(direction, tmp_path):
    path = tmp_path / "a.AT2"
    path.write_text(AT2.format(direction, "") + SAMPLES + "\n")
    assert not [note for note in Record.read(path).notes if "component" in note]


@pytest.mark.mends("K-NET's CSV was refused")
def test_csv_of_k_net(tmp_path):
    path = tmp_path / "a.csv"
    head = (
        "#K-NET CSV\n#OriginTime,Latitude,Longitude,Depth(km),Magnitude\n#2000/01/01 00:00:00,0,0,10,6.0\n"
        "#Code,Latitude\n#XXX001,0\n#SamplingFrequency(Hz)\n#100\n#DurationTime(s)\n#4\n"
        "#Time,RelativeTime(s),N-S(gal),E-W(gal),U-D(gal)"
    )
    path.write_text(table(head=head, row="2000/01/01 00:00:10,{t},{a},{b},{a}"))
    try:
        records = Record.read_all(path)
    except UnreadableRecord as error:
        pytest.fail(str(error))
    assert [r.name for r in records] == ["XXX001/N-S", "XXX001/E-W", "XXX001/U-D"]
    assert ["vertical component" in r.notes for r in records] == [False, False, True]
    np.testing.assert_allclose(records[1].acceleration, -0.01 * motion(), rtol=1e-12)


@pytest.mark.mends("spellings of K-NET's manual were refused")
def test_spellings_of_the_manual_of_k_net(tmp_path):
    (form,) = [form for form in FORMATS if form.name == "knet"]
    text = form.write(form.size * shaking(100), 0.01)
    path = tmp_path / "a.NS"
    path.write_text(text)
    usual = Record.read(path)
    path.write_text(text.replace("Long. ", "Lon.  ").replace("Max. Acc.", "Max Acc."))
    try:
        assert Record.read(path) == usual
    except UnreadableRecord as error:
        pytest.fail(str(error))


STATED = [
    "# UNIT OF ACCELERATION : GAL",
    "# Acceleration in gal",
    "NS gal",
    "# (inches per second squared)",
    "# cm per second squared",
    "# a_gal",
    "# acc_in_s2",
    "# (cm s⁻²)",
    "# (cm/(s*s))",
    "# km/h/s",
    "# (µg)",
    "# (0.001 g)",
    "# (raw counts)",
]


@pytest.mark.mends("a unit in words that are not read was overruled by `unit`")
@pytest.mark.parametrize("header", STATED)
def test_a_unit_in_whatever_words_is_not_overruled(tmp_path, header):
    path = tmp_path / "record.txt"
    path.write_text("# made up\n" + header + "\n" + "\n".join(f"{x:.4f}" for x in shaking(100)) + "\n")
    with pytest.raises(UnreadableRecord, match="seems to state the unit"):
        Record.read(path, unit="g", dt=0.01)


@pytest.mark.parametrize(
    "header", ["# station 3 feet above the floor", "# recorded in Galway", "# test 4 mg"]
)
def test_words_that_are_no_units_are_left_alone(tmp_path, header):
    path = tmp_path / "record.txt"
    path.write_text(header + "\n" + "\n".join(f"{x:.4f}" for x in shaking(100)) + "\n")
    assert Record.read(path, unit="g", dt=0.01).acceleration.shape == (100,)


@pytest.mark.mends("a step that the header states without = was overruled by `dt`")
@pytest.mark.parametrize(
    "header", ["Sampling rate: 200 Hz", "fs = 200 Hz", "sampling interval 0.005 s", "dt 0.005"]
)
def test_a_stated_step_is_read_and_not_overruled(tmp_path, header):
    path = tmp_path / "record.txt"
    path.write_text(f"# acc (g)\n# {header}\n" + "\n".join(f"{x:.4f}" for x in shaking(100)) + "\n")
    assert Record.read(path).dt == 0.005
    with pytest.raises(UnreadableRecord, match=r"step of 0\.005 s, but `dt` is 0\.02 s"):
        Record.read(path, dt=0.02)


@pytest.mark.mends("times of single precision were refused")
def test_times_of_single_precision_have_equal_steps(tmp_path):
    path = tmp_path / "record.txt"
    times = np.arange(4000, dtype=np.float32) * np.float32(0.01)
    rows = "\n".join(f"{t:.9f} {x:.4f}" for t, x in zip(times, shaking(4000), strict=True))
    path.write_text("time (s) acc (g)\n" + rows + "\n")
    assert Record.read(path).dt == 0.01


@pytest.mark.mends("columns of velocities stopped a table with accelerations")
def test_velocities_beside_accelerations_are_left_out(tmp_path):
    path = tmp_path / "record.csv"
    rows = "\n".join(f"{0.01 * i:.2f},{9.0 + x:.4f},{x:.4f}" for i, x in enumerate(shaking(100)))
    path.write_text("time (s),vel (m/s),acc (m/s2)\n" + rows + "\n")
    (record,) = Record.read_all(path)
    assert record.pga < 5.0


@pytest.mark.mends("the first sample was taken for the step where the number of samples is wrong by one")
@pytest.mark.parametrize("first", ["0.2524", "0"])
def test_a_number_of_samples_that_is_wrong_is_refused(tmp_path, first):
    path = tmp_path / "record.txt"
    path.write_text("\n".join(["99", first, *(f"{x:.4f}" for x in shaking(99))]) + "\n")
    with pytest.raises(UnreadableRecord, match="line 1 states 99 samples, but 100 follow"):
        Record.read(path, unit="g")


@pytest.mark.mends("the number of a column was taken for an azimuth")
def test_numbers_of_columns_are_no_directions(tmp_path):
    path = tmp_path / "record.txt"
    path.write_text(
        "\n".join(f"{0.01 * i:.2f} {x:.4f} {x * x:.4f}" for i, x in enumerate(shaking(100))) + "\n"
    )
    for record in Record.read_all(path, unit="g"):
        assert any("orientation not stated" in note for note in record.notes)
