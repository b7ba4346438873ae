"""Tables of text, as people have them."""

import numpy as np
import pytest

from tests.formats.reader import check, read
from tests.formats.synthetic import G, shaking
from tpd.formats.text import UnreadableRecord


def test_what_is_written_is_read_and_a_damaged_file_is_never_half_read(tmp_path):
    check(tmp_path, "table", "column")


TABLES = {
    "blanks": "Time (s)   Acceleration (g)\n 0.00 0.0\n 0.02 5.0e-1\n 0.04 -1d-1\n",
    "semicolons": "% t; a; units: g\n0;0\n.02;.5\n.04;-.1\n",
    "units alone": "s g\n0\t0\n0.02\t0.5\n0.04\t-0.1\n",
    "late start": "# [g]\n10.00 0\n10.02 0.5\n10.04 -0.1\n",
    "utf-8 mark": "\ufefft,a [g]\n0,0\n0.02,0.5\n0.04,-0.1\n",
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_tables(text, tmp_path):
    record = read(tmp_path, text)
    assert record.dt == 0.02
    np.testing.assert_allclose(record.acceleration, [0.0, 0.5 * G, -0.1 * G], rtol=1e-15)


def test_a_column_needs_its_step_and_its_unit(tmp_path):
    text = "0\n0.5\n-0.1\n"
    with pytest.raises(ValueError, match="states no unit of acceleration: give `unit`"):
        read(tmp_path, text, dt=0.01)
    with pytest.raises(ValueError, match="states no step: give `dt`"):
        read(tmp_path, text, unit="g")
    assert read(tmp_path, text, unit="g", dt=0.01).dt == 0.01
    text = "a (g), dt = 0.02 s\n0\n0.5\n-0.1\n"
    assert read(tmp_path, text).dt == 0.02
    with pytest.raises(ValueError, match=r"step of 0.02 s, but `dt` is 0.01 s"):
        read(tmp_path, text, dt=0.01)


REFUSED = r"""
unequal steps | t,a (g)\n0,0\n0.02,1\n0.05,1\n0.07,0\n | steps, but the one after line . is 0.0. s
time backwards | t,a (g)\n0,0\n-0.02,1\n | equal steps
coarse times | t,a (g)\n0.000,0\n0.003,1\n0.007,1\n0.010,1\n | equal steps
milliseconds | t (ms),a (g)\n0,0\n20,1\n | times must be in s
step in ms | a (g), dt = 5 ms\n0\n1\n | must state the step in s
two units | t,a (g),(m/s2)\n0,0\n0.02,1\n | several units
three columns | t,a,b (g)\n0,0,1\n0.02,1,1\n | channels 0: a .*choose one by `channel`
the first row damaged | t,a (g)\nNaN,0\n0.02,1\n0.04,1\n | line 2 must be a row of numbers or
the first sample damaged | # a [g], dt=0.01\nabc\n0.1\n0.2\n | line 2 must be a row of numbers or
a row too short | t,a (g)\n0,0\n0.02\n0.04,1\n | line 3 must have 2 as the first row
nan | t,a (g)\n0,0\n0.02,nan\n | line 3 must hold numbers, but has 'nan'
absurd peak | t,a (g)\n0,0\n0.02,100\n | peak must be at most 100 m/s
cut | t,a (g)\n0,0\n0.02,0.1 | must end with a line break
no numbers | t,a (g)\nabc\n | ends after line 2, before the first number
"""


@pytest.mark.parametrize("row", REFUSED.strip().splitlines())
def test_refused(row, tmp_path):
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
    record = read(tmp_path, text, **given_)
    assert record.dt == pytest.approx(0.01, rel=1e-12)
    assert record.acceleration.shape == (400,)
    np.testing.assert_allclose(record.acceleration, motion() * G, rtol=1e-12, atol=1e-15)


@pytest.mark.mends("times of few digits had unequal steps")
@pytest.mark.parametrize(("rate", "form"), [(128, "{:g}"), (300, "{:.5f}"), (300, "{:g}"), (75, "{:.3f}")])
def test_times_of_few_digits(rate, form, tmp_path):
    lines = ["t,a (g)\n", *(f"{form.format(i / rate)},{i % 7}\n" for i in range(390))]
    assert read(tmp_path, "".join(lines)).dt == pytest.approx(1.0 / rate, rel=1e-12)
    with pytest.raises(UnreadableRecord, match="equal steps"):
        read(tmp_path, "".join(lines[:200] + lines[201:]))


@pytest.mark.mends("a first column 1, 2, 3 was read as times")
def test_numbers_of_samples_are_no_times(tmp_path):
    for head in ("no,acc (g)", "#,acc (g)", "i;a (g)", "Sample,a [g]", "nr a(g)", "# a in\n# (g)"):
        text = table(head=head, row="{i},{a:.5f}")
        with pytest.raises(UnreadableRecord, match=r"numbers the samples .* give `dt`"):
            read(tmp_path, text)
        record = read(tmp_path, text, dt=0.01)
        assert (record.dt, record.acceleration.shape) == (0.01, (400,))


def in_a_column(*header: str) -> str:
    """A hundred samples below a header."""
    return "\n".join([*header, *(f"{x:.4f}" for x in shaking(100))]) + "\n"


@pytest.mark.mends("a stated unit that was not known was overruled by `unit=`")
@pytest.mark.parametrize("head", ["time (s),acc ({})", "# units: {}\n# t a", "t [s] a [{}]"])
def test_a_stated_unit_is_never_overruled(head, tmp_path):
    inches = ("in/s2", "in/sec^2", "inch/s/s", "IN/SEC/SEC")
    for unit in (*inches, "ft/s2", "furlong/s2", "yd/s/s", "counts"):
        text = table(head=head.format(unit))
        with pytest.raises(UnreadableRecord, match=r"but `unit` is 'g'|unit of acceleration must be one of"):
            read(tmp_path, text, unit="g")
        if unit in inches:
            np.testing.assert_allclose(read(tmp_path, text).acceleration, 0.0254 * motion(), rtol=1e-12)


STATED = "UNIT OF ACCELERATION : GAL|Acceleration in gal|NS gal|(inches per second squared)|a_gal|acc_in_s2|"
STATED += "cm per second squared|(cm s⁻²)|(cm/(s*s))|km/h/s|(µg)|(0.001 g)|(raw counts)"


@pytest.mark.mends("a unit in words that are not read was overruled by `unit`")
@pytest.mark.parametrize("header", STATED.split("|"))
def test_a_unit_in_whatever_words_is_not_overruled(tmp_path, header):
    header = header if header == "NS gal" else f"# {header}"
    with pytest.raises(UnreadableRecord, match="seems to state the unit"):
        read(tmp_path, in_a_column("# made up", header), unit="g", dt=0.01)


def test_words_that_are_no_units_are_left_alone(tmp_path):
    for header in ("# station 3 feet above the floor", "# recorded in Galway", "# test 4 mg"):
        assert read(tmp_path, in_a_column(header), unit="g", dt=0.01).acceleration.shape == (100,)
    with pytest.raises(UnreadableRecord, match="no known format"):
        read(tmp_path, "A letter.\n" * 50)


@pytest.mark.mends("a step that the header states without = was overruled by `dt`")
def test_a_stated_step_is_read_and_not_overruled(tmp_path):
    for header in ("Sampling rate: 200 Hz", "fs = 200 Hz", "sampling interval 0.005 s", "dt 0.005"):
        text = in_a_column("# acc (g)", f"# {header}")
        assert read(tmp_path, text).dt == 0.005
        with pytest.raises(UnreadableRecord, match=r"step of 0\.005 s, but `dt` is 0\.02 s"):
            read(tmp_path, text, dt=0.02)


@pytest.mark.mends("times of single precision were refused")
def test_times_of_single_precision_have_equal_steps(tmp_path):
    times = np.arange(4000, dtype=np.float32) * np.float32(0.01)
    rows = (f"{t:.9f} {x:.4f}\n" for t, x in zip(times, shaking(4000), strict=True))
    assert read(tmp_path, "time (s) acc (g)\n" + "".join(rows)).dt == 0.01


@pytest.mark.mends("columns of velocities stopped a table with accelerations")
def test_velocities_beside_accelerations_are_left_out(tmp_path):
    rows = (f"{0.01 * i:.2f},{9.0 + x:.4f},{x:.4f}\n" for i, x in enumerate(shaking(100)))
    # One channel is left, so that none has to be chosen.
    assert read(tmp_path, "time (s),vel (m/s),acc (m/s2)\n" + "".join(rows)).pga < 5.0


@pytest.mark.mends("the first sample was taken for the step where the number of samples is wrong by one")
def test_a_number_of_samples_that_is_wrong_is_refused(tmp_path):
    for first in ("0.2524", "0"):
        text = "\n".join(["99", first, *(f"{x:.4f}" for x in shaking(99))]) + "\n"
        with pytest.raises(UnreadableRecord, match="line 1 states 99 samples, but 100 follow"):
            read(tmp_path, text, unit="g")


@pytest.mark.mends("the number of a column was taken for an azimuth")
def test_numbers_of_columns_are_no_directions(tmp_path):
    text = "\n".join(f"{0.01 * i:.2f} {x:.4f} {x * x:.4f}" for i, x in enumerate(shaking(100))) + "\n"
    for i in range(2):
        notes = read(tmp_path, text, unit="g", channel=i).notes
        assert any("orientation not stated" in note for note in notes)
