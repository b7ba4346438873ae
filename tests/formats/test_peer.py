"""AT2 files of PEER."""

import re

import numpy as np
import pytest

from tests.formats.reader import check, read
from tests.formats.synthetic import G
from tpd.formats.text import UnreadableRecord


def test_what_is_written_is_read_and_a_damaged_file_is_never_half_read(tmp_path):
    check(tmp_path, "peer")


HEADERS = (
    ("X 1/2/99 0304, Y, 90", "ACCELERATION TIME HISTORY IN UNITS OF G", " 3 .01000 NPTS, DT"),
    ("X, 1/2/99, Y, 90", "ACCELERATION TIME SERIES IN UNITS OF G", "NPTS=    3, DT=   .0100 SEC,     "),
    ("X, Y", "ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz", "NPTS= 3, DT= .01000 SEC"),
)


def test_headers(tmp_path):
    for head in HEADERS:
        text = "\n".join(["PEER", *head, "  .1000000E+00 -.2000000E-01", "  .0000000E+00", ""])
        record = read(tmp_path, text)
        assert record.dt == 0.01
        np.testing.assert_allclose(record.acceleration, [0.1 * G, -0.02 * G, 0.0], rtol=1e-15)
        assert record.event.startswith("X")
        assert record.name


AT2 = "PEER NGA\nQuake, 1/1/2000, PLACE, 090\n{} TIME SERIES IN UNITS OF G\nNPTS= 3, DT= .01 SEC{}\n"
SAMPLES = " .1000000E+00 -.2000000E-01\n .3000000E-01"


@pytest.mark.mends("AT2 files without a last line end, or with words after DT, were refused")
def test_files_that_people_have(tmp_path):
    for words, end in (("", ""), (",", ""), (", DURATION= .02 SEC", ""), ("  (filtered)", "\n")):
        text = AT2.format("ACCELERATION", words) + SAMPLES
        assert read(tmp_path, text + end).acceleration.shape == (3,)
        with pytest.raises(UnreadableRecord):
            read(tmp_path, text[:-2])


def test_velocities_are_refused(tmp_path):
    with pytest.raises(UnreadableRecord, match="line 3 must state an ACCELERATION"):
        read(tmp_path, AT2.format("VELOCITY", "") + SAMPLES + "\n")


@pytest.mark.mends("PEER's verticals had no note")
def test_directions(tmp_path):
    upward = [(word, "a.AT2") for word in ("UP", "DWN", "V", "UD", "VERT")]
    upward += [("", "R_X-UP.AT2"), ("", "M04UD.AT2")]
    for direction, name in (*upward, *((word, "a.AT2") for word in ("090", "360", "N-S", "S16E", "EW"))):
        text = AT2.format("ACCELERATION", "").replace("090", direction) + SAMPLES + "\n"
        notes = [note for note in read(tmp_path, text, name).notes if "component" in note]
        assert notes == ["vertical component"] * ((direction, name) in upward)


@pytest.mark.mends("negative numbers that touch the one before them were unread")
def test_negative_numbers_may_touch_the_one_before(tmp_path):
    values = [0.1, -0.2, 0.3, -0.4, -0.25, 0.15]
    for form in ("{: .7E}", "{: .6f}", "{: .5f}"):
        digits = "".join(form.format(x) for x in values)
        assert re.search(r"\d-", digits.replace("E-", ""))
        text = f"PEER\nX, A, 000\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 6, DT= .01 SEC\n{digits}\n"
        np.testing.assert_allclose(read(tmp_path, text).acceleration, G * np.array(values), rtol=1e-4)
