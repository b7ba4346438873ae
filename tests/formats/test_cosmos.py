"""Files of COSMOS."""

import re

import pytest

from tests.formats.reader import DATA, FORM, check
from tests.formats.synthetic import shaking
from tpd import Record
from tpd.formats.cosmos import is_cosmos
from tpd.formats.text import UnreadableRecord


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "cosmos", "anchorage_2018_cut.V2c")


def test_the_peak_of_a_real_cosmos_file_equals_its_header():
    (record,) = Record.read_all(DATA / "anchorage_2018_cut.V2c")
    assert record.dt == pytest.approx(0.005, rel=1e-15)
    assert record.acceleration.shape == (600,)
    assert record.pga == pytest.approx(0.06851512, abs=5e-9)


def test_every_unit_of_acceleration_has_its_code(tmp_path):
    text, path = FORM["cosmos"].write(5.0 * shaking(100), 0.01), tmp_path / "a.V2c"
    units = {"g": (2, 9.80665), "cm/sec2": (4, 0.01), "in/sec2": (7, 0.0254), "mg": (11, 0.00980665)}
    for unit, (code, factor) in units.items():
        words = text.replace("cm/sec2(04)", f"{unit}({code:02d})").replace("cm/sec2 at", f"{unit} at")
        path.write_text(words)
        assert Record.read_all(path)[0].pga == pytest.approx(5.0 * factor, rel=1e-5)


def test_header_and_text_must_state_equal_peak_and_time(tmp_path):
    text, path = FORM["cosmos"].write(400.0 * shaking(100), 0.01), tmp_path / "a.V2c"
    peak, time = re.search(r"Max = +(\S+) cm/sec2 at +(\S+) sec", text).groups()
    for stated, last, message in ((peak, 1e-5, "the peak"), (time, 1e-3, "the time of the peak")):
        header, changed = (f"{float(stated) + x:15.6f}" for x in (0.0, 1.5 * last))
        assert header in text
        path.write_text(text.replace(header, changed, 1))
        with pytest.raises(UnreadableRecord, match=f"states {message} twice and differently"):
            Record.read_all(path)
    path.write_text(text.replace(f"{peak} cm/sec2", f"{float(peak) + 1.0:.5f} cm/sec2"))
    with pytest.raises(UnreadableRecord, match="line 11 states a peak of"):
        Record.read_all(path)


def test_an_unknown_word_in_the_line_of_the_unit_is_rejected(tmp_path):
    text, path = FORM["cosmos"].write(400.0 * shaking(100), 0.01), tmp_path / "a.V2c"
    # A block of velocities is left out.
    path.write_text(text + text.replace("acceleration pts", "velocity pts"))
    assert len(Record.read_all(path)) == 1
    for old, new in (
        ("acceleration pts", "velocity pts"),
        ("cm/sec2(04)", "cm/sec2(02)"),
        ("cm/sec2(04)", "cm/sec2(05)"),
        ("Format=(8F10.5)", "Format=(8F10.5) x 10"),
        ("Corrected acceleration ", "Corrected acceleration x 10 "),
        ("Corrected acceleration ", "Corrected velocity "),
    ):
        path.write_text(text.replace(old, new))
        with pytest.raises(UnreadableRecord):
            Record.read_all(path)


def test_a_damaged_file_is_recognised_as_cosmos_and_a_table_is_not():
    lines = FORM["cosmos"].write(400.0 * shaking(100), 0.01).splitlines()
    damaged = ["", *lines[1:]]
    for other in (lines, damaged, [line.replace("Integer", "") for line in damaged]):
        assert is_cosmos(other)
    assert not is_cosmos(["time (s),acc (g)", "0,0"])
