"""Tables of text, as people have them."""

import re

import numpy as np
import pytest

import tpd
from tests.formats.reader import check, read
from tests.formats.synthetic import G, peer, shaking
from tpd.formats.text import NoAcceleration, UnreadableRecord


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "table", "column")


TABLES = {
    "blanks": "Time (s)   Acceleration (g)\n 0.00 0.0\n 0.02 5.0e-1\n 0.04 -1d-1\n",
    "semicolons": "% t; a; units: g\n0;0\n.02;.5\n.04;-.1\n",
    "units alone": "s g\n0\t0\n0.02\t0.5\n0.04\t-0.1\n",
    "late start": "# t a [g]\n10.00 0\n10.02 0.5\n10.04 -0.1\n",
    "utf-8 mark": "\ufefft,a [g]\n0,0\n0.02,0.5\n0.04,-0.1\n",
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_a_plain_table_is_read(text, tmp_path):
    record = read(tmp_path, text)
    assert record.dt == 0.02
    np.testing.assert_allclose(record.acceleration, [0.0, 0.5 * G, -0.1 * G], rtol=1e-15)


def test_a_single_column_needs_a_time_step_and_a_unit(tmp_path):
    text = "0\n0.5\n-0.1\n"
    with pytest.raises(ValueError, match="states no unit of acceleration: give `unit`"):
        read(tmp_path, text, dt=0.01)
    with pytest.raises(ValueError, match="states no times and no step: give `dt`"):
        read(tmp_path, text, unit="g")
    assert read(tmp_path, text, unit="g", dt=0.01).dt == 0.01
    text = "a (g), dt = 0.02 s\n0\n0.5\n-0.1\n"
    assert read(tmp_path, text).dt == 0.02
    with pytest.raises(ValueError, match=r"step of 0.02 s, but `dt` is 0.01 s"):
        read(tmp_path, text, dt=0.01)


REFUSED = r"""
unequal steps | t,a (g)\n0,0\n0.02,1\n0.07,1\n0.09,0\n | steps, but the step after line 3 is 0.05 s
time backwards | t,a (g)\n0,0\n-0.02,1\n | line 3 has an earlier time than line 2, but the times must grow
coarse times | t,a (g)\n0.000,0\n0.003,1\n0.007,1\n0.010,1\n | too few digits to show equal steps
minutes | t (min),a (g)\n0,0\n20,1\n | line 1 has '.min.', which is not understood
step in minutes | a (g), dt = 5 min\n0\n1\n | line 1 has .*dt.*not understood
two units | t,a (g),(m/s2)\n0,0\n0.02,1\n | several units
three columns | t,a (g),acc (g)\n0,0,1\n0.02,1,1\n | must choose; .* columns={'t': 1, 'acc .g.': 3}
the first row damaged | t,a (g)\nNaN,0\n0.02,1\n0.04,1\n | line 2 has 'NaN', which is not understood
the first sample damaged | # a [g], dt=0.01\nabc\n0.1\n0.2\n | line 2 has 'abc', which is not understood
a row too short | t,a (g)\n0,0\n0.02\n0.04,1\n | line 3 must have 2 numbers, but has '0.02'
nan | t,a (g)\n0,0\n0.02,nan\n | line 3 must contain numbers, but has 'nan'
absurd peak | t,a (g)\n0,0\n0.02,100\n | peak must be at most 100 m/s
cut | t,a (g)\n0,0\n0.02,0.1 | must end with a line break
no numbers | t,a (g)\nabc\n | no row of numbers
"""


@pytest.mark.parametrize("row", REFUSED.strip().splitlines())
def test_a_damaged_table_is_rejected_in_one_sentence(row, tmp_path):
    _, text, message = row.split(" | ")
    with pytest.raises(UnreadableRecord, match=rf"^a.txt: .*({message})") as caught:
        read(tmp_path, text.replace("\\n", "\n").replace("\\t", "\t"))
    assert "\n" not in str(caught.value)


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
    "five columns": (
        "Matched\n 400 0.01 656\n" + in_columns(5),
        {"unit": "g", "dt": 0.01, "skip": 2, "columns": "rows"},
    ),
    "eight columns": ("400 points at equal spacing of 0.01 sec\nunits: g\n\n" + in_columns(8), {}),
    "count above a column": ("# (g)\n400 0.01\n" + in_columns(1), {}),
    "count and step in lines": ("# (g)\n400\n0.01\n" + in_columns(1), {"skip": 3, "unit": "g", "dt": 0.01}),
    "count": ("# (g)\n400\n" + in_columns(1), {"dt": 0.01}),
    "count above times": (table(head="time (s),acc (g)\n400,0.01"), {}),
    "per cent of g": (table(head="time (s),acc (%g)", row="{t},{a:.5f}e2"), {}),
}


@pytest.mark.parametrize("name", READ)
def test_common_variants_of_tables_are_read(name, tmp_path):
    text, given_ = READ[name]
    record = read(tmp_path, text, **given_)
    assert record.dt == pytest.approx(0.01, rel=1e-12)
    assert record.acceleration.shape == (400,)
    np.testing.assert_allclose(record.acceleration, motion() * G, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(("rate", "form"), [(128, "{:g}"), (300, "{:.5f}"), (300, "{:g}"), (75, "{:.3f}")])
def test_rounded_times_have_equal_steps(rate, form, tmp_path):
    lines = ["t,a (g)\n", *(f"{form.format(i / rate)},{i % 7}\n" for i in range(390))]
    assert read(tmp_path, "".join(lines)).dt == pytest.approx(1.0 / rate, rel=1e-12)
    with pytest.raises(UnreadableRecord, match="equal steps"):
        read(tmp_path, "".join(lines[:200] + lines[201:]))


def test_a_column_of_sample_numbers_is_not_read_as_times(tmp_path):
    for head in ("no,acc (g)", "#,acc (g)", "i;a (g)", "Sample,a [g]", "nr a(g)"):
        text = table(head=head, row="{i},{a:.5f}")
        with pytest.raises(UnreadableRecord, match="states no times and no step: give `dt`"):
            read(tmp_path, text)
        record = read(tmp_path, text, dt=0.01)
        assert (record.dt, record.acceleration.shape) == (0.01, (400,))


def in_a_column(*header: str) -> str:
    """A hundred samples below a header."""
    return "\n".join([*header, *(f"{x:.4f}" for x in shaking(100))]) + "\n"


@pytest.mark.parametrize("head", ["time (s),acc ({})", "# units: {}\n# t a", "t [s] a [{}]"])
def test_an_option_cannot_contradict_the_unit_of_the_header(head, tmp_path):
    inches = ("in/s2", "in/sec^2", "inch/s/s", "IN/SEC/SEC")
    for unit in (*inches, "ft/s2", "furlong/s2", "yd/s/s", "counts"):
        text = table(head=head.format(unit))
        with pytest.raises(UnreadableRecord, match=r"but `unit` is 'g'|which is not understood"):
            read(tmp_path, text, unit="g")
        if unit in inches:
            np.testing.assert_allclose(read(tmp_path, text).acceleration, 0.0254 * motion(), rtol=1e-12)


STATED = "UNIT OF ACCELERATION : GAL|Acceleration in gal|NS gal|(inches per second squared)|a_gal|acc_in_s2|"
STATED += "cm per second squared|(cm s⁻²)|(cm/(s*s))|km/h/s|(µg)|(0.001 g)|(raw counts)"


@pytest.mark.parametrize("header", STATED.split("|"))
def test_an_option_cannot_contradict_a_unit_in_other_words(tmp_path, header):
    with pytest.raises(UnreadableRecord, match=r"the header states the unit|which is not understood"):
        read(tmp_path, in_a_column(f"# {header}"), unit="g", dt=0.01)


def test_an_unknown_header_line_is_skipped_only_on_request(tmp_path):
    for line in ("# 3 feet above the floor", "# recorded in Galway", "# test 4 mg"):
        text = in_a_column(line, "unit: gal")
        with pytest.raises(UnreadableRecord, match=r"line 1 has .* not understood; .*: skip=1"):
            read(tmp_path, text, dt=0.01)
        assert read(tmp_path, text, dt=0.01, skip=1).acceleration.shape == (100,)
    with pytest.raises(UnreadableRecord, match="no known format"):
        read(tmp_path, "A letter.\n" * 50)


def test_an_option_cannot_contradict_the_time_step_of_the_header(tmp_path):
    for header in ("Sampling rate: 200 Hz", "fs = 200 Hz", "sampling interval 0.005 s", "dt 0.005"):
        text = in_a_column("# acc (g)", f"# {header}")
        assert read(tmp_path, text).dt == 0.005
        with pytest.raises(UnreadableRecord, match=r"step of 0\.005 s, but `dt` is 0\.02 s"):
            read(tmp_path, text, dt=0.02)


def test_times_in_single_precision_have_equal_steps(tmp_path):
    times = np.arange(4000, dtype=np.float32) * np.float32(0.01)
    rows = (f"{t:.9f} {x:.4f}\n" for t, x in zip(times, shaking(4000), strict=True))
    assert read(tmp_path, "time (s) acc (g)\n" + "".join(rows)).dt == 0.01


def test_a_column_of_velocities_is_left_out(tmp_path):
    rows = (f"{0.01 * i:.2f},{9.0 + x:.4f},{x:.4f}\n" for i, x in enumerate(shaking(100)))
    # One channel is left, so none has to be chosen.
    assert read(tmp_path, "time (s),vel (m/s),acc (m/s2)\n" + "".join(rows)).pga < 5.0


def test_a_wrong_number_of_samples_is_rejected(tmp_path):
    for first in ("0.2524", "0"):
        text = "\n".join(["99", first, *(f"{x:.4f}" for x in shaking(99))]) + "\n"
        with pytest.raises(UnreadableRecord, match=r"line 1 has '99', .* \(100 samples in 100 rows\)"):
            read(tmp_path, text, unit="g")


def test_column_numbers_state_no_direction(tmp_path):
    text = "\n".join(f"{0.01 * i:.2f} {x:.4f} {x * x:.4f}" for i, x in enumerate(shaking(100))) + "\n"
    for i in range(2):
        columns = {"time": 1, "acc1": 2, "acc2": 3}
        notes = read(tmp_path, text, unit="g", channel=i, columns=columns).notes
        assert any("orientation not stated" in note for note in notes)


def in_table(
    *header: str, times: str = "{:.2f}", step: float = 0.01, columns: int = 1, separator: str = ","
) -> str:
    """Two hundred rows below a header; the n-th acceleration is n times the first one."""
    rows = [
        separator.join(
            [*([times.format(step * i)] if times else []), *(f"{n * x:.5f}" for n in range(1, columns + 1))]
        )
        for i, x in enumerate(0.1 * shaking(200))
    ]
    return "\n".join([*header, *rows]) + "\n"


def found(folder, text, **how):
    """Step, unit factor and names of all channels of a table, in the order of the file."""
    path = folder / "b.txt"
    path.write_text(text, encoding="utf-8")
    first = 0.1 * shaking(200)
    records = tpd.Record.read_all(path, **how)
    return [
        (
            record.dt,
            round(float(record.pga / np.max(np.abs(first.round(5)))), 6),
            record.name,
            *(note for note in record.notes if note in (UP, UNKNOWN) or note.startswith("left out")),
        )
        for record in records
    ]


UNKNOWN = "orientation not stated: used as a horizontal component"
UP = "vertical component"
UNDERSTOOD = {
    "components without times": (
        in_table("# station X001, E N Z, dt = 0.01 s, m/s2", times="", columns=3, separator=" "),
        [(0.01, 1.0, "E"), (0.01, 2.0, "N"), (0.01, 3.0, "Z", UP)],
    ),
    "names above a ruled line": (
        in_table(
            "SAMPLING INTERVAL : 0.01", "UNIT : m/s2", "  N-S   E-W   U-D", "-----", times="", columns=3
        ),
        [(0.01, 1.0, "N-S"), (0.01, 2.0, "E-W"), (0.01, 3.0, "U-D", UP)],
    ),
    "acceleration, velocity, displacement": (
        in_table("t a v d", "[s] [m/s2] [m/s] [m]", columns=3, separator=" "),
        [(0.01, 1.0, "", "left out of the table: v (m/s), d (m)", UNKNOWN)],
    ),
    "names above units": (
        in_table("Time,NS,EW,UD", "s,gal,gal,gal", columns=3),
        [(0.01, 0.01, "NS"), (0.01, 0.02, "EW"), (0.01, 0.03, "UD", UP)],
    ),
    "milliseconds": (in_table("t_ms,acc (m/s2)", times="{:.1f}", step=0.5), [(0.0005, 1.0, "", UNKNOWN)]),
    "milliseconds in brackets": (
        in_table("Time [ms],a (g)", times="{:g}", step=5),
        [(0.005, 9.80665, "", UNKNOWN)],
    ),
    "components in brackets": (
        in_table("unit: m/s2", "time (s),acc (NS),acc (EW),acc (UD)", columns=3),
        [(0.01, 1.0, "NS"), (0.01, 2.0, "EW"), (0.01, 3.0, "UD", UP)],
    ),
    "times with a capital letter": (in_table("T (s),acc (g)"), [(0.01, 9.80665, "", UNKNOWN)]),
    "processing": (in_table("time (s),acc V2 (m/s2)"), [(0.01, 1.0, "", UNKNOWN)]),
    "step in words": (
        in_table("Station X", "DT(sec)=0.005", "Acceleration (g)", times=""),
        [(0.005, 9.80665, "", UNKNOWN)],
    ),
    "rate in words": (
        in_table("Station X", "200 samples per second", "Acceleration (g)", times=""),
        [(0.005, 9.80665, "", UNKNOWN)],
    ),
    "a unit a column": (
        in_table("t (s),N (m/s2),E (cm/s2)", columns=2),
        [(0.01, 1.0, "N"), (0.01, 0.02, "E")],
    ),
    "German vertical": (
        in_table("Zeit (s),Nord (g),vertikal (g)", columns=2),
        [(0.01, 9.80665, "Nord"), (0.01, 2 * 9.80665, "vertikal", UP)],
    ),
    "tabulators": (in_table("Time (s)\tAcc (m/s2)", separator="\t"), [(0.01, 1.0, "", UNKNOWN)]),
    "quoted cells": (
        in_table('"Time (s)","Acc (m/s2)"', times='"{:.2f}"'),
        [(0.01, 1.0, "", UNKNOWN)],
    ),
    "a decimal comma in one column": (
        in_table("t (ms);a (m/s2)", times="{:.0f}", step=5, separator=";").replace(".", ","),
        [(0.005, 1.0, "", UNKNOWN)],
    ),
    "times of few digits": (
        in_table("t (s),a (m/s2)", times="{:.3f}", step=0.0025),
        [(0.0025, 1.0, "", UNKNOWN)],
    ),
    "units without brackets below names": (
        in_table("Time,Acc,Vel,Dis", "sec,m/s2,m/s,m", columns=3),
        [(0.01, 1.0, "", "left out of the table: Vel (m/s), Dis (m)", UNKNOWN)],
    ),
    "longitudinal and transversal": (
        in_table("time (s),L (g),T (g),vert. (g)", columns=3),
        [(0.01, 9.80665, "L"), (0.01, 2 * 9.80665, "T"), (0.01, 3 * 9.80665, "vert.", UP)],
    ),
    "times in the second column": (
        "no,t (s),a (m/s2)\n"
        + "".join(f"{i},{0.01 * i:.2f},{x:.5f}\n" for i, x in enumerate(0.1 * shaking(200))),
        [(0.01, 1.0, "", "left out of the table: no", UNKNOWN)],
    ),
}


@pytest.mark.parametrize("name", UNDERSTOOD)
def test_a_header_that_follows_the_grammar_is_read(name, tmp_path):
    text, expected = UNDERSTOOD[name]
    rows = found(tmp_path, text)
    assert [row[: len(want)] for row, want in zip(rows, expected, strict=True)] == expected


NOT_UNDERSTOOD = {
    "a factor": (
        "time (s),acc (cm/s2 x 10)",
        r"'\(cm/s2 x 10\)', .*'time \(s\)': 1,.*factor=10.0, unit='cm/s2'",
    ),
    "a power of ten": ("time (s),acc (10^-3 g)", r"has '\(10\^-3 g\)', .* factor=0.001"),
    "a factor without brackets": ("t acc cm/s2 x 10", "has 'x 10'|has '10'|has 'acc"),
    "a spectrum": ("period (s),Sa (g)", "'period .s.' belongs to a response spectrum"),
    "a spectrum of displacements": ("T (s),SD (m)", "'SD .m.' belongs to a response spectrum"),
    "a filter": ("time (s),acc [m/s2] (HP/LP)", r"has '\(HP/LP\)'"),
    "two units": ("time (s),acc (g) (m/s2)", "has .*not understood"),
    "a velocity in g": ("time (s),vel (g)", "has .*not understood"),
    "an unknown word": ("time (s),strain (g)", "has 'strain'"),
    "an unknown unit": ("time (s),acc (counts)", r"has '\(counts\)'"),
    "relative acceleration": ("time (s),relative acc (g)", "has 'relative'"),
    "two times": ("time (s),time (ms)", "must have one time and accelerations"),
    "no names": ("", "names the columns"),
    "a remark": ("made up\nt (s),a (g)", "line 1 has 'made', .*: skip=1$"),
    "a factor of a power": ("time (s),acc (g x 10^3)", "factor='FACTOR', unit='g'$"),
    "a power in small digits": ("time (s),acc (×10⁻³ g)", "factor='FACTOR', unit='g'$"),
    "a factor of the name": ("time (s),acc x10 (g)", "'acceleration': 2}, factor='FACTOR', unit='g'$"),
    "a factor in words": ("time (s),acc (milli g)", "'acc': 2}, factor='FACTOR', unit='g'$"),
    "per cent in words": ("time (s),acc (% of g)", "factor='FACTOR', unit='g'$"),
    "a small unit": ("time (s),acc (µg)", "factor='FACTOR', unit='UNIT'$"),
    "minus": ("time (s),acc (-g)", "factor='FACTOR', unit='UNIT'$"),
    "a unit with digits is no factor": ("temps (s);accélération (m/s2)", "'acceleration': 2}, unit='m/s2'$"),
    "a gain beside a station": (
        "Station: gain 10\ntime (s),acc (g)",
        "has 'gain', .*: skip=1, factor='FACTOR'$",
    ),
    "a factor beside a record": ("Record: scaled x2\nt (s),a (g)", "has 'scaled', .* factor='FACTOR'$"),
    "a quantity beside a record": ("Record: velocity\nt (s),a (g)", "has 'velocity'"),
    "a vertical beside a station": (
        "Station X Component UD\nt (s),a (g)",
        "has 'UD'.*: skip=2, columns={'t .s.': 1, 'NAME2': 2}, unit='g'$",
    ),
    "a vertical above": ("UD\nt (s),a (g)", "'NAME2': 2}, unit='g'$"),
    "a peak in another unit": (
        "PGA = 120 gal\nt (s),strange acc (g)",
        "columns={'t .s.': 1, 'acceleration': 2}, factor='FACTOR', unit='g'$",
    ),
    "a stated unit": ("UNIT : GAL\nt (s),made up", "'acceleration': 2}, unit='gal'$"),
    "minutes": ("time (min),a (g)", r"has '\(min\)', .*columns={'a .g.': 2}, dt='STEP'$"),
    "an amplitude of Fourier": ("f (Hz),A (g)", "'f .Hz.' belongs to a response spectrum"),
    "a spectrum with its damping": ("T (s),SA(5%) (g)", "'SA.5%. .g.' belongs to a response spectrum"),
    "a title of a spectrum": (
        "Response spectrum\nT (s),a (g)",
        "a motion is needed, but line 1 is 'Response spectrum'",
    ),
    "numbers of columns": ("1,2\nt (s),a (g)", "line 1 has '1', .*: skip=1, factor='FACTOR'$"),
}


def test_a_damaged_record_is_distinguished_from_a_file_without_acceleration(tmp_path):
    with pytest.raises(UnreadableRecord, match="line 3 must contain numbers") as caught:
        read(tmp_path, "t (s),a (g)\n0.00,0.1\n0.01,x\n0.02,0.2\n")
    assert not isinstance(caught.value, NoAcceleration)


@pytest.mark.parametrize("name", NOT_UNDERSTOOD)
def test_an_unknown_header_word_is_quoted_in_the_message(name, tmp_path):
    header, message = NOT_UNDERSTOOD[name]
    with pytest.raises(UnreadableRecord, match=message) as caught:
        found(tmp_path, in_table(*header.splitlines()))
    assert "\n" not in str(caught.value)
    # The options that the message names read the file.
    if options := caught.value.options:
        known = {"UNIT": "g", "STEP": 0.01, "FACTOR": 2.0}
        options = {
            key: known.get(value, value) if isinstance(value, str) else value
            for key, value in options.items()
        }
        columns = options.get("columns", {}).items()
        filled = {re.sub(r"NAME\d", "Z", name.replace("UNIT", "s")): i for name, i in columns}
        options |= {"columns": filled} if columns else {}
        assert found(tmp_path, in_table(*header.splitlines()), **options)


CONTRADICTED = {
    "step": ("DT(sec)=0.005\nAcceleration (g)", {"dt": 0.02}, "a step of 0.005 s, but `dt` is 0.02 s"),
    "rate": (
        "200 samples per second\nAcceleration (g)",
        {"dt": 0.02},
        "a step of 0.005 s, but `dt` is 0.02 s",
    ),
    "times": ("t (s),a (g)", {"dt": 0.02}, "the stated step is 0.02 s, but the step of the times is 0.01 s"),
    "unit": ("t (s),a (gal)", {"unit": "g"}, "states the unit gal, but `unit` is 'g'"),
    "component": (
        "t (s),E (g)",
        {"columns": {"t": 1, "N": 2}},
        "names column 2 'E .g.', but `columns` names it 'N'",
    ),
    "quantity": ("t (s),vel (m/s)", {"columns": {"t": 1, "acc": 2}}, "names column 2 'vel .m/s.'"),
    "unit of time": ("t (ms),a (g)", {"columns": {"time (s)": 1, "a": 2}}, "names column 1 't .ms.'"),
    "count": ("399 points\nt (s),a (g)", {}, "the header states 399 samples, but there are"),
}


@pytest.mark.parametrize("name", CONTRADICTED)
def test_an_option_that_contradicts_the_file_is_rejected(name, tmp_path):
    header, how, message = CONTRADICTED[name]
    times = "{:.2f}" if header.splitlines()[-1].startswith("t ") else ""
    with pytest.raises(UnreadableRecord, match=message):
        found(tmp_path, in_table(*header.splitlines(), times=times), **how)


def test_options_can_describe_a_table_with_an_unknown_header(tmp_path):
    text = in_table("Aufzeichnung 7, Einheit siehe Anhang", "Uhr | A | B | C", columns=3)
    how = {"skip": 2, "columns": {"time": 1, "N (gal)": 2, "Z": 4}, "unit": "gal", "factor": 100.0}
    (north, up) = found(tmp_path, text, **how)
    assert north[:3] == (0.01, 1.0, "N")
    assert up == (0.01, 3.0, "Z", UP)
    assert [row[:2] for row in found(tmp_path, text, **(how | {"columns": {"E": 3}, "dt": 0.02}))] == [
        (0.02, 2.0)
    ]
    with pytest.raises(ValueError, match=r"`columns` must contain names of times.* has 'Uhr'"):
        found(tmp_path, text, skip=2, columns={"Uhr": 1, "N": 2})
    for wrong, message in {
        "skip": (-1, "`skip` must be a number of lines"),
        "factor": (0.0, "`factor` must be a finite number"),
        "columns": ({"N": 0}, "`columns` must map names to column numbers"),
    }.items():
        with pytest.raises(ValueError, match=message[1] if isinstance(message, tuple) else message):
            found(tmp_path, text, **{wrong: message[0]})
    with pytest.raises(UnreadableRecord, match=r"`columns` and `skip` are allowed only for tables.* PEER"):
        read(tmp_path, peer(shaking(100), 0.01), skip=1)


def test_a_time_of_day_is_rejected_by_name(tmp_path):
    text = (
        "\n".join(["UTC,a (g)", *(f"12:00:{0.01 * i:05.2f},{x:.4f}" for i, x in enumerate(shaking(100)))])
        + "\n"
    )
    with pytest.raises(UnreadableRecord, match="line 2 has a time of day"):
        found(tmp_path, text)
    assert found(tmp_path, text, columns={"a": 2}, dt=0.01, unit="g", skip=1)[0][0] == 0.01


COLUMNS_THAT_ARE_LEFT_OUT = {
    "strain": ("t (s),acc (g),strain", {"t (s)": 1, "acc (g)": 2}),
    "temperature": ("t (s),acc (g),temp (C)", {"t (s)": 1, "acc (g)": 2}),
    "a vertical in a language that is not known": (
        "t (s),N (g),E (m/s2),pystysuora (g)",
        {"t (s)": 1, "N (g)": 2, "E (m/s2)": 3},
    ),
    "numbers of rows without a name": (",t (s),acc (g)", {"t (s)": 2, "acc (g)": 3}),
    "two columns of one name": ("t (s),a (g),a (g)\nx,NS,EW", {"NS": 2, "EW": 3}),
}


@pytest.mark.parametrize("name", COLUMNS_THAT_ARE_LEFT_OUT)
def test_the_suggested_options_leave_out_unknown_columns(name, tmp_path):
    header, columns = COLUMNS_THAT_ARE_LEFT_OUT[name]
    n = header.splitlines()[0].count(",")
    text = in_table(*header.splitlines(), columns=n)
    if header.startswith(","):
        rows = in_table(columns=1).splitlines()
        text = "\n".join([header, *(f"{i},{row}" for i, row in enumerate(rows))]) + "\n"
    with pytest.raises(UnreadableRecord, match="not understood") as caught:
        found(tmp_path, text)
    options = caught.value.options
    assert columns.items() <= options["columns"].items()
    assert len(options["columns"]) <= len(columns) + (name == "two columns of one name")
    if name != "two columns of one name":
        assert {row[1] for row in found(tmp_path, text, **options)} <= {1.0, 2.0, 9.80665, 2 * 9.80665}


@pytest.mark.parametrize(
    "text",
    [
        "t (s);a (mg)\n0.00;12\n0.01;1,219\n0.02;-3,456\n",
        "t (s)\ta (mg)\n0.00\t12\n0.01\t1,219\n0.02\t-345\n",
        "t (s);a (mg)\n0,00;12\n0,01;1.219\n0,02;-345\n",
        't (s),a (mg)\n0.00,12\n0.01,"1,219"\n0.02,-345\n',
    ],
)
def test_separators_of_thousands_are_rejected(text, tmp_path):
    with pytest.raises(UnreadableRecord, match=r"1[.,]219.* may have a separator of thousands"):
        read(tmp_path, text)
    # Three decimals that no separator of thousands can have are decimals.
    assert read(tmp_path, "t (s);a (mg)\n0,000;12\n0,005;1,219\n0,010;-345\n").dt == 0.005


def test_the_option_columns_must_name_times_before_values(tmp_path):
    text = in_table(columns=1)
    with pytest.raises(ValueError, match="`columns` must contain names of times"):
        found(tmp_path, text, columns={"a (g)": 1, "T (s)": 2})


def test_a_column_of_one_unknown_letter_is_rejected(tmp_path):
    for header in ("t,a,v,d", "t (s),a (g),x", "Time,Acc,V"):
        text = in_table(header, columns=header.count(","))
        with pytest.raises(UnreadableRecord, match="next to an acceleration may be a velocity"):
            found(tmp_path, text, unit="g")
        columns = {"t": 1, "a": 2}
        assert len(found(tmp_path, text, unit="g", columns=columns)) == 1


def test_missing_lines_and_columns_are_reported(tmp_path):
    text = in_table("t (s),a (g)")
    with pytest.raises(UnreadableRecord, match="must separate numbers after line 500"):
        found(tmp_path, text, skip=500)
    with pytest.raises(UnreadableRecord, match=r"no line has numbers in the columns {'t': 1, 'a': 7}"):
        found(tmp_path, text, columns={"t": 1, "a": 7})


def test_a_title_about_a_spectrum_does_not_make_a_table_a_spectrum(tmp_path):
    for title in ("Corner frequency", "Spectrum compatible", "Response spectrum compatible motion"):
        with pytest.raises(UnreadableRecord, match=r"line 1 has .*: skip=1$"):
            found(tmp_path, in_table(title, "t (s),a (g)"))


def test_equal_times_are_reported_as_equal(tmp_path):
    rows = [f"{0.01 * i:.2f},{x:.5f}\n" for i, x in enumerate(0.1 * shaking(200))]
    twice = "time (s),acc (m/s2)\n" + "".join(row * 2 for row in rows)
    with pytest.raises(UnreadableRecord, match="line 3 has the same time as line 2, but the times must grow"):
        read(tmp_path, twice)
    one = "time (s),acc (m/s2)\n" + "".join([*rows[:50], rows[49], *rows[50:]])
    with pytest.raises(UnreadableRecord, match="line 52 has the same time as line 51"):
        read(tmp_path, one)
    with pytest.raises(UnreadableRecord, match="line 3 has an earlier time than line 2"):
        read(tmp_path, "time (s),acc (m/s2)\n" + "".join(reversed(rows)))


FIRST_LINES = (
    "0.01",
    "200",
    "200\n0.01",
    "0.01\n200",
    "200 0.01",
    "0.01 200",
    "200\n5",
    "200 0.01 1",
    "1e-2",
)


@pytest.mark.parametrize("lines", FIRST_LINES)
@pytest.mark.parametrize("head", ["", "# acc (g)\n", "Some quake\n"])
def test_a_time_step_above_a_column_is_not_read_as_a_sample(tmp_path, lines, head):
    how, text = {"dt": 0.01, "unit": "g"}, head + in_a_column(lines, *(f"{x:.4f}" for x in shaking(100)))
    for _ in range(3):
        try:
            record = read(tmp_path, text, **how)
        except UnreadableRecord as error:
            # The advised options read the file.
            how |= {key: value for key, value in error.options.items() if value not in ("UNIT", "STEP")}
            if not error.options:
                return
        else:
            assert record.acceleration.shape == (200,)
            assert record.dt == 0.01
            return
    raise AssertionError(how)


@pytest.mark.parametrize("head", ["", "# acc (g)\n", "200\n", "0\n", "dt = 0,01 s\n"])
def test_decimal_commas_in_one_column_are_reported(tmp_path, head):
    text = head + "".join(f"{x:.5f}\n" for x in 0.1 * shaking(200)).replace(".", ",")
    for columns in (None, "rows", {"a (g)": 1}):
        with pytest.raises(UnreadableRecord, match=r"has '[-\d,]+', which may be one number with a decimal"):
            read(tmp_path, text, dt=0.01, unit="g", columns=columns)
    assert read(tmp_path, "t (s),a (g)\n0,1\n1,2\n2,0\n3,1\n").dt == 1.0


@pytest.mark.parametrize(
    "names",
    [
        *("acc V1 (g),acc V2 (g)", "acc raw (g),acc filtered (g)", "a (g),acc (cm/s2)", "N (g),N-S (m/s2)"),
        *("acc N raw (g),acc N corrected (g)", "HNN (g),N (g)"),
    ],
)
def test_two_columns_of_one_channel_require_a_choice(tmp_path, names):
    text = in_table(f"time (s),{names}", columns=2)
    with pytest.raises(UnreadableRecord, match="may be one channel: `columns` must choose") as caught:
        found(tmp_path, text)
    assert len(found(tmp_path, text, **caught.value.options)) == 1
    for two in ("N (g),E (g)", "acc1 (g),acc2 (g)", "HNN (g),HNE (g)", "ch1 (g),ch2 (g)", "NS1 (g),NS2 (g)"):
        assert len(found(tmp_path, in_table(f"time (s),{two}", columns=2))) == 2


def test_volts_counts_and_velocities_are_rejected(tmp_path):
    for header in ("t (s),acc (V)", "t (s),a [V]", "t (s),acc (counts)", "Record: raw counts\nt (s),a"):
        with pytest.raises(UnreadableRecord, match=r"not understood.*factor='FACTOR'"):
            found(tmp_path, in_table(*header.splitlines()), unit="g")
    # No option makes an acceleration of a velocity.
    for header in ("t (s),vel (g)", "t (s),velocity x2", "t (s),displacement (g)"):
        with pytest.raises(UnreadableRecord, match=r"not understood|but has time, velocity") as caught:
            found(tmp_path, in_table(header), unit="g")
        assert caught.value.options == {}
