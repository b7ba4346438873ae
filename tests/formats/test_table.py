"""Tables of text: which are read, which are refused, and with which options the refused ones are read."""

import re

import numpy as np
import pytest

import tpd
from tests.formats.reader import check, read
from tests.formats.synthetic import G, shaking
from tpd.formats.table import columns_in_words
from tpd.formats.text import NoAcceleration, UnreadableRecord

FIRST = np.round(0.1 * shaking(200), 5)
"""The first column of a made-up table. The n-th column is n times the first one."""


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "table", "column")


def made(head: str, columns: int = 1, times: str = "{:.2f}", step: float = 0.01, mark: str = ",") -> str:
    """Two hundred rows below a header whose lines are separated by |."""
    rows = [
        mark.join([times.format(step * i)] * bool(times) + [f"{n * a:.5f}" for n in range(1, columns + 1)])
        for i, a in enumerate(FIRST)
    ]
    return "\n".join([*head.split("|"), *rows, ""]).lstrip("\n")


def found(folder, text: str, **how) -> list[tuple]:
    """Name, factor and step of the channels, and whether they are vertical."""
    (folder / "b.txt").write_text(text, encoding="utf-8")
    records = tpd.Record.read_all(folder / "b.txt", **how)
    peak = np.max(np.abs(FIRST))
    return [(r.name, round(float(r.pga / peak), 4), r.dt, "vertical component" in r.notes) for r in records]


NORTH, EAST, LONE = ("N", 1.0, 0.01, False), ("E", 2.0, 0.01, False), ("", 1.0, 0.01, False)
READ = {
    "names with units": (made("time (s),N (m/s2),E (m/s2),UD (m/s2)", 3), "N E UD^"),
    "a line with the unit": (made("unit: m/s2|dt = 0.01 s|n,e,z", 3, ""), "n e z^"),
    "the unit after the names": (made("t; a; unit: m/s2", mark=";"), ""),
    "the step in a bracket": (made("DT(sec)=0.01|Acceleration (m/s2)", times=""), ""),
    "a ruled line": (made("unit = m/s2|step: 10 ms|  N-S  E-W  U-D|---", 3, "", mark=" "), "N-S E-W U-D^"),
    "axes": (made("Time (s)\tax (m/s^2)\tay (m/s^2)\taz (m/s^2)", 3, mark="\t"), "x y vertical^"),
    "an acceleration before": (made("t,acc-N (m/s2),acc_E (m/s2)", 2), "acc-N acc_E"),
    "milliseconds": (made("Time [ms],a [m/s2]", times="{:.0f}", step=10), ""),
    "quotation marks": (made('"Time (s)","Acc (m/s2)"', times='"{:.2f}"'), ""),
    "decimal commas": (made("t (s);a (m/s2)", mark=";").replace(".", ","), ""),
    "blanks before brackets": (made("Time (s)   Acceleration (m/s2)", mark=" "), ""),
}


@pytest.mark.parametrize("name", READ)
def test_a_table_whose_columns_are_named_is_read(name, tmp_path):
    text, names = READ[name]
    expected = [(x.strip("^"), n, 0.01, "^" in x) for n, x in enumerate(names.split() or [""], 1)]
    assert found(tmp_path, text) == expected


def test_the_unit_of_a_column_is_read_and_no_option_contradicts_it(tmp_path):
    for unit, factor in (("g", G), ("cm/s2", 0.01), ("in/sec^2", 0.0254), ("%g", 0.01 * G)):
        text = made(f"t,N ({unit})")
        np.testing.assert_allclose(read(tmp_path, text).acceleration, factor * FIRST, rtol=1e-12)
        with pytest.raises(UnreadableRecord, match=r"the header states the unit .*, but `unit` is 'ft/s2'"):
            read(tmp_path, text, unit="ft/s2")


SKIP, TWO, THREE = {"skip": 1}, "N (m/s2)=2", "N (m/s2)=2 E (m/s2)=3"
REFUSED = {
    # The header, the number of columns, the part in the message, and one option that reads the table.
    "a line of maxima": ("#Max U: 70 N: 14 E: 18|#Data: 4F10.3", 3, "'Data: 4F10.3'", "N (m/s2)=3"),
    "another sensor": ("Time (s),S1 (g),S2 (g)", 2, "'S1 .g.'", THREE),
    "one direction twice": ("t (s),N (m/s2),S (m/s2)", 2, "columns time, north, north are not", TWO),
    "two kinds of axes": ("t (s),N (m/s2),E (m/s2),x (m/s2)", 3, "are not a time and the", THREE),
    "a word before the unit": ("t (s),relative acc (m/s2)", 1, "'relative acc .m/s2.'", TWO),
    "a factor": ("t (s),a (cm/s2 x 10)", 1, "'a .cm/s2 x 10.'", TWO),
    "a normalised motion": ("Record: Nowhere normalised|unit: m/s2|t (s),acc", 1, "normalised", SKIP),
    "a line like a component": ("N 090|t (s),acc (m/s2)", 1, "line 1 has 'N 090'", SKIP),
    "units below the names": ("Time,Acc|s,gal", 1, "line 2 has 's gal'", TWO),
    "two units": ("unit: m/s2|unit: gal|t (s),acc", 1, "line 2 has 'unit: gal'", TWO),
    "no names": ("", 2, "line 1 has 3 numbers, but no line above names the columns", THREE),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_table_with_other_words_is_rejected_with_its_columns_and_an_option_that_reads_it(name, tmp_path):
    head, columns, part, option = REFUSED[name]
    text = made(head, columns)
    with pytest.raises(UnreadableRecord, match=part) as caught:
        found(tmp_path, text, unit="m/s2")
    # The first lines and all columns are shown, and no column has a name that its line does not state.
    shown = str(caught.value).splitlines()
    assert all(f"  line {i:<4d} {line}" in shown for i, line in enumerate(head.split("|"), 1) if line)
    rows = [line.split() for line in shown if re.match(r"  \d", line)]
    assert [row[0] for row in rows] == [str(k + 1) for k in range(columns + 1)]
    assert rows[0][4:6] == ["0.01", "times,"]
    assert caught.value.options.keys() <= {"skip", "columns", "unit", "dt"}
    how = {"columns": _columns(option)} if isinstance(option, str) else option
    assert [row[2] for row in found(tmp_path, text, **how)] == [0.01] * len(
        [x for x in how.get("columns", "N") if x[:4] != "time"]
    )
    # The example has no names that contradict each other.
    advised = caught.value.options.get("columns", {})
    if "are" in part:
        assert all(name.startswith(("t", "NAME")) for name in advised)
    assert ("skip" in caught.value.options) != bool(advised)
    if how == SKIP:
        assert caught.value.options == SKIP


def _columns(option: str) -> dict[str, int]:
    pairs = re.findall(r"([^=]+)=(\d) ?", option)
    time = {} if option.startswith("time") else {"time (s)": 1}
    return time | {name: int(at) for name, at in pairs}


def test_columns_are_described_by_what_they_can_be():
    x, n = np.sin(np.arange(100.0)), np.arange(100.0)
    kinds = {"times, numbers": n, "unequal steps": n**2, "a constant": 0 * x, "without a sign": x * x}
    kinds |= {"with an offset": x + 0.5, "a motion": x}
    lines = columns_in_words(dict(zip("abcdef", kinds.values(), strict=True)))[1:]
    assert all(kind in line for line, kind in zip(lines, kinds, strict=True))


def test_a_table_without_names_needs_options_that_state_all(tmp_path):
    for head, how, missing in (
        ("", {"dt": 0.01}, "states no unit of acceleration: give `unit`"),
        ("", {"unit": "g"}, "states no times and no step: give `dt`"),
        ("acc (g)", {}, "states no times and no step: give `dt`"),
        ("# made up", {"unit": "g", "dt": 0.01}, "line 1 has 'made up', .*options: skip=1\n"),
        ("dt = 5 min|acc (g)", {}, "line 1 has 'dt = 5 min', .*options: skip=1, dt='STEP'\n"),
    ):
        with pytest.raises(UnreadableRecord, match=missing):
            found(tmp_path, made(head, times=""), **how)
    assert found(tmp_path, made("", times=""), unit="m/s2", dt=0.01) == [LONE]
    assert found(tmp_path, made("# 3 feet up", times=""), unit="m/s2", dt=0.01, skip=1) == [LONE]
    with pytest.raises(NoAcceleration, match="no known format"):
        read(tmp_path, "A letter.\n" * 50)


def test_samples_row_by_row_are_read_only_on_request(tmp_path):
    rows = "\n".join("".join(f"{a:10.5f}" for a in row) for row in FIRST.reshape(-1, 8)) + "\n"
    text = f"NO. OF POINTS: 200\nunit: m/s2\n{rows}"
    with pytest.raises(UnreadableRecord, match=r"line 1 has 'NO. OF POINTS: 200'"):
        read(tmp_path, text, dt=0.01)
    assert found(tmp_path, text, dt=0.01, columns="rows") == [LONE]
    assert read(tmp_path, text, dt=0.01, columns="rows").acceleration.shape == (200,)
    with pytest.raises(UnreadableRecord, match=r"line 1 must have 8 numbers, but has '200 0.01'.*skip=1"):
        read(tmp_path, f"200 0.01\n{rows}", dt=0.01, unit="g", columns="rows")


@pytest.mark.parametrize("columns", ["rows", {"a (g)": 1}])
def test_decimal_commas_in_one_column_are_reported(tmp_path, columns):
    text = made("", times="").replace(".", ",")
    with pytest.raises(UnreadableRecord, match=r"has '[-\d,]+', which may be one number with a decimal"):
        read(tmp_path, text, dt=0.01, unit="g", columns=columns)


@pytest.mark.parametrize("lines", ["0.01", "200", "200\n0.01", "200 0.01", "200 0.01 1"])
@pytest.mark.parametrize("head", ["", "Some quake\n"])
def test_a_count_or_a_step_above_a_column_is_not_read_as_a_sample(tmp_path, lines, head):
    how, text = {"dt": 0.01, "unit": "g"}, f"{head}{lines}\n{made('', times='')}"
    for _ in range(4):
        try:
            record = read(tmp_path, text, **how)
            break
        except UnreadableRecord as error:
            # The advised options read the file.
            how |= {key: value for key, value in error.options.items() if value not in ("UNIT", "STEP")}
    assert record.acceleration.shape == (200,)
    samples = "".join(f"{round(1e4 * a)}\n" for a in FIRST)
    with pytest.raises(UnreadableRecord, match="line 1 has '200', which can be the step or the number"):
        read(tmp_path, f"200\n{samples}", dt=0.005, unit="mg")


DAMAGED = r"""
unequal steps | t,a (g)\n0,0\n0.02,1\n0.07,1\n0.09,0\n | steps, but the step after line 3 is 0.05 s
time backwards | t,a (g)\n0,0\n-0.02,1\n | line 3 has an earlier time than line 2, but the times must grow
coarse times | t,a (g)\n0.000,0\n0.003,1\n0.007,1\n0.010,1\n | too few digits to show equal steps
long steps | t,a (g)\n0,0\n5,1\n10,1\n | times with steps of 5 need a unit
a row too short | t,a (g)\n0,0\n0.02\n0.04,1\n0.06,1\n | line 3 must have 2 numbers, but has '0.02'
a word | t (s),a (g)\n0.00,0.1\n0.01,x\n0.02,0.2\n | line 3 must contain numbers, but has 'x'
absurd peak | t,a (g)\n0,0\n0.02,100\n | peak must be at most 100 m/s
cut | t,a (g)\n0,0\n0.02,0.1 | must end with a line break
thousands | t (s);a (mg)\n0.00;12\n0.01;1,219\n0.02;-3,456\n | 1,219.* may have a separator of thousands
thousands with a point | t (s);a (mg)\n0,00;12\n0,01;1.219\n0,02;-345\n | 1.219.* may have a separator
two units | unit: gal\nt,a (g)\n0,0\n0.02,1\n | several units of acceleration: g, gal
another step | dt = 0.01\nt,a (g)\n0,0\n0.02,1\n | stated step is 0.01 s, but the step of the times is 0.02 s
"""


@pytest.mark.parametrize("row", DAMAGED.strip().splitlines())
def test_a_damaged_table_is_rejected_in_one_sentence(row, tmp_path):
    _, text, message = row.split(" | ")
    with pytest.raises(UnreadableRecord, match=rf"^a.txt: .*(?:{message})") as caught:
        read(tmp_path, text.replace("\\n", "\n").replace("\\t", "\t"))
    assert "\n" not in str(caught.value)
    assert not isinstance(caught.value, NoAcceleration)
    # Here three decimals are no thousands.
    assert read(tmp_path, "t (s);a (mg)\n0,000;12\n0,005;1,219\n0,010;-345\n").dt == 0.005


@pytest.mark.parametrize(("rate", "form"), [(128, "{:g}"), (300, "{:.5f}"), (75, "{:.3f}")])
def test_rounded_times_have_equal_steps(rate, form, tmp_path):
    lines = ["t,a (g)\n", *(f"{form.format(i / rate)},{i % 7}\n" for i in range(390))]
    assert read(tmp_path, "".join(lines)).dt == pytest.approx(1.0 / rate, rel=1e-12)
    with pytest.raises(UnreadableRecord, match="equal steps"):
        read(tmp_path, "".join(lines[:200] + lines[201:]))
    # Times in single precision.
    times = np.arange(4000, dtype=np.float32) * np.float32(0.01)
    rows = (f"{t:.9f} {x:.4f}\n" for t, x in zip(times, shaking(4000), strict=True))
    assert read(tmp_path, "time (s) acc (g)\n" + "".join(rows)).dt == 0.01


CONTRADICTED = (
    ("dt = 0.01 s|acc (g)", {"dt": 0.02}, "a step of 0.01 s, but `dt` is 0.02 s"),
    ("t (s),a (g)", {"dt": 0.02}, "stated step is 0.02 s, but the step of the times is 0.01"),
    ("t (s),E (g)", {"columns": {"t": 1, "N": 2}}, "column 2 'E .g.', but .* it 'N'"),
    ("t (s),E (g)", {"columns": {"N": 1, "E": 2}}, "column 1 't .s.', but `columns`"),
    ("t,vel (m/s)", {"columns": {"t": 1, "a (g)": 2}}, "names column 2 'vel .m/s.'"),
    ("t (ms),a (g)", {"columns": {"time (s)": 1, "a": 2}}, "column 1 't .ms.'"),
    ("t (s),a (g)", {"columns": {"t": 1, "a (gal)": 2}}, "names column 2 'a .g.'"),
    ("t (s),a (g)", {"columns": {"t": 1, "a": 7}}, "no row of numbers in the columns"),
    ("t (s),a (g)", {"skip": 500}, "no row of numbers after line 500"),
)


def test_an_option_that_contradicts_the_file_is_rejected(tmp_path):
    for head, how, message in CONTRADICTED:
        with pytest.raises(UnreadableRecord, match=message):
            found(tmp_path, made(head, times="{:.2f}" if head.startswith("t") else ""), **how)


def test_options_describe_a_table_with_an_unknown_header(tmp_path):
    text = made("Aufzeichnung 7, Einheit siehe Anhang|Uhr | A | B | C".replace(" | ", " / "), 3)
    how = {"columns": {"time": 1, "N (gal)": 2, "Z": 4}, "unit": "gal", "factor": 100.0}
    assert found(tmp_path, text, **how) == [NORTH, ("Z", 3.0, 0.01, True)]
    assert found(tmp_path, text, **(how | {"columns": {"E": 3}, "dt": 0.02})) == [("E", 2.0, 0.02, False)]
    assert found(tmp_path, text, columns={"t": 1, "090 (m/s2)": 2}) == [("090", 1.0, 0.01, False)]
    assert [row[0] for row in found(tmp_path, text, unit="g", columns={"t": 1, "acc1": 2, "acc2": 3})] == [
        "column 2",
        "column 3",
    ]
    for wrong, message in (
        ({"columns": {"Uhr": 1, "N": 2}}, r"`columns` must contain names of times.* has 'Uhr'"),
        ({"columns": {"N": 0}}, "`columns` must map names to column numbers"),
        ({"columns": {"t": 1}}, "`columns` must have at most one time, and accelerations"),
        ({"skip": -1}, "`skip` must be a number of lines"),
        ({"factor": 0.0}, "`factor` must be a finite number"),
    ):
        with pytest.raises(ValueError, match=message):
            found(tmp_path, text, **({"unit": "g"} | wrong))


def test_a_file_without_rows_of_numbers_is_shown(tmp_path):
    rows = (f"12:00:{0.01 * i:05.2f},{x:.5f}" for i, x in enumerate(FIRST))
    text = "\n".join(["UTC,a (g)", *rows]) + "\n"
    with pytest.raises(NoAcceleration, match="no row of numbers after line 0: commas") as caught:
        found(tmp_path, text)
    assert str(caught.value).splitlines()[1:3] == ["  line 1    UTC,a (g)", "  line 2    12:00:00.00,0.00000"]
    assert found(tmp_path, text, columns={"a": 2}, dt=0.01, unit="g")[0][2] == 0.01


def test_a_table_without_a_motion_is_distinguished_from_a_damaged_record(tmp_path):
    for text in (made("period (s),Sa (g)"), made("T (s),SA(5%) (g)"), made("case,tilt"), made("", times="")):
        with pytest.raises(NoAcceleration):
            found(tmp_path, text, unit="g")
    with pytest.raises(NoAcceleration, match="a motion is needed, but line 1 is 'Response spectrum'"):
        found(tmp_path, made("Response spectrum|T (s),a (g)"))
