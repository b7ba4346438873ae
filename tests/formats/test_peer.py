"""AT2 files of PEER."""

from __future__ import annotations

import numpy as np
import pytest

from tests.formats.reader import FORM, check_damaged, check_what_is_written, read, written
from tests.formats.synthetic import G
from tpd.formats.text import UnreadableRecord

FORMS = (FORM["peer"],)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_what_is_written_is_read(form, tmp_path):
    check_what_is_written(form, tmp_path)


@pytest.mark.parametrize("file", [*map(written, FORMS)], ids=str)
def test_a_damaged_file_is_never_half_read(file, tmp_path):
    check_damaged(file, tmp_path)


HEADERS = (
    ("X 1/2/99 0304, Y, 90", "ACCELERATION TIME HISTORY IN UNITS OF G", " 3 .01000 NPTS, DT"),
    ("X, 1/2/99, Y, 90", "ACCELERATION TIME SERIES IN UNITS OF G", "NPTS=    3, DT=   .0100 SEC,     "),
    ("X, Y", "ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz", "NPTS= 3, DT= .01000 SEC"),
)


@pytest.mark.parametrize("head", HEADERS)
def test_headers(head, tmp_path):
    record = read(tmp_path, "\n".join(["PEER", *head, "  .1000000E+00 -.2000000E-01", "  .0000000E+00", ""]))
    assert record.dt == 0.01
    np.testing.assert_allclose(record.acceleration, [0.1 * G, -0.02 * G, 0.0], rtol=1e-15)
    assert record.event.startswith("X")
    assert record.name


AT2 = "PEER NGA\nQuake, 1/1/2000, PLACE, 090\n{} TIME SERIES IN UNITS OF G\nNPTS= 3, DT= .01 SEC{}\n"
SAMPLES = " .1000000E+00 -.2000000E-01\n .3000000E-01"


@pytest.mark.mends("AT2 files without a last line end, or with words after DT, were refused")
@pytest.mark.parametrize(
    ("words", "end"), [("", ""), (",", ""), (", DURATION= .02 SEC", ""), ("  (filtered)", "\n")]
)
def test_files_that_people_have(words, end, tmp_path):
    text = AT2.format("ACCELERATION", words) + SAMPLES
    assert read(tmp_path, text + end).acceleration.shape == (3,)
    with pytest.raises(UnreadableRecord):
        read(tmp_path, text[:-2])


def test_velocities_are_refused(tmp_path):
    with pytest.raises(UnreadableRecord, match="line 3 must state an ACCELERATION"):
        read(tmp_path, AT2.format("VELOCITY", "") + SAMPLES + "\n")


@pytest.mark.mends("PEER's verticals had no note")
@pytest.mark.parametrize(
    ("direction", "name", "vertical"),
    [
        *((word, "a.AT2", True) for word in ("UP", "DWN", "V", "UD", "VERT")),
        ("", "R_X-UP.AT2", True),
        ("", "M04UD.AT2", True),
        *((word, "a.AT2", False) for word in ("090", "360", "N-S", "S16E", "EW")),
    ],
)
def test_directions(direction, name, vertical, tmp_path):
    text = AT2.format("ACCELERATION", "").replace("090", direction) + SAMPLES + "\n"
    notes = [note for note in read(tmp_path, text, name).notes if "component" in note]
    assert notes == ["vertical component"] * vertical
