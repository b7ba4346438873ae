"""AT2 files of PEER."""

import re

import numpy as np
import pytest

from tests.formats.reader import check, read
from tests.formats.synthetic import G
from tpd.formats.text import UnreadableRecord


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "peer")


def test_every_known_peer_header_is_read(tmp_path):
    for title, kind, count in (
        ("X 1/2/99 0304, Y, 90", "HISTORY IN UNITS OF G", " 3 .01000 NPTS, DT"),
        ("X, 1/2/99, Y, 90", "SERIES IN UNITS OF G", "NPTS=    3, DT=   .0100 SEC,     "),
        ("X, Y", "HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz", "NPTS= 3, DT= .01000 SEC"),
    ):
        head = f"PEER\n{title}\nACCELERATION TIME {kind}\n{count}\n"
        text = f"{head}  .1000000E+00 -.2000000E-01\n  .0000000E+00\n"
        record = read(tmp_path, text)
        assert record.dt == 0.01
        np.testing.assert_allclose(record.acceleration, [0.1 * G, -0.02 * G, 0.0], rtol=1e-15)
        assert record.event.startswith("X")
        assert record.name


AT2 = "PEER NGA\nQuake, 1/1/2000, PLACE, 090\n{} TIME SERIES IN UNITS OF G\nNPTS= 3, DT= .01 SEC{}\n"
SAMPLES = " .1000000E+00 -.2000000E-01\n .3000000E-01"


def test_common_variants_of_peer_files_are_read(tmp_path):
    for words, end in (("", ""), (",", ""), (", DURATION= .02 SEC", ""), ("  (filtered)", "\n")):
        text = AT2.format("ACCELERATION", words) + SAMPLES
        assert read(tmp_path, text + end).acceleration.shape == (3,)
        with pytest.raises(UnreadableRecord):
            read(tmp_path, text[:-2])
        with pytest.raises(UnreadableRecord, match="line 3 must state an ACCELERATION"):
            read(tmp_path, text.replace("ACCELERATION", "VELOCITY") + "\n")
    assert read(tmp_path, f"{AT2.format('ACCELERATION', '')}.1-.2\n-.25\n").acceleration[1] == -0.2 * G


def test_vertical_peer_components_are_recognised(tmp_path):
    upward = ("UP", "DWN", "V", "UD", "VERT")
    for direction in (*upward, "090", "360", "N-S", "S16E", "EW"):
        text = AT2.format("ACCELERATION", "").replace("090", direction) + SAMPLES + "\n"
        notes = [note for note in read(tmp_path, text).notes if "component" in note]
        assert notes == ["vertical component"] * (direction in upward)


def test_the_unit_of_the_time_step_is_read(tmp_path):
    text = AT2.format("ACCELERATION", "") + SAMPLES + "\n"
    for step, dt in (("0.5 MSEC", 5e-4), ("10ms", 0.01), ("10 milliseconds,", 0.01), ("1D-2 S", 0.01)):
        assert read(tmp_path, text.replace(".01 SEC", step)).dt == pytest.approx(dt, rel=1e-12)
    assert read(tmp_path, text.replace(".01 SEC", "10 MSEC, DURATION= 20 MSEC")).dt == 0.01
    for step in ("0.01 MIN", "100 HZ", "10 MSEC, DURATION= 20 SEC", ".01 SEC, DURATION= 1 MIN"):
        with pytest.raises(UnreadableRecord, match=r"line 4 must state NPTS and DT|the length in s twice"):
            read(tmp_path, text.replace(".01 SEC", step))


WORDS = {
    "UNITS OF G": ("UNITS OF G (x 10)", "UNITS OF G * 10", "UNITS OF 0.1 G", "UNITS OF VOLTS"),
    "ACCELERATION TIME": ("SCALED ACCELERATION TIME", "PSEUDO ACCELERATION TIME", "STRAIN TIME"),
    "PLACE": ("PLACE (x 10)", "scaled by 2", "PLACE, scale factor 2.0", "volts", "velocity", "normed"),
    ".01 SEC": (".01 SEC (raw)", ".01 SEC, GAIN= 2"),
}


def test_an_unknown_word_in_a_peer_header_is_rejected(tmp_path):
    text = AT2.format("ACCELERATION", "") + SAMPLES + "\n"
    for place, words in ((place, words) for place, others in WORDS.items() for words in others):
        with pytest.raises(UnreadableRecord, match=r"not understood|must state") as caught:
            read(tmp_path, text.replace(place, words), unit=None if "VOLT" in words else "g")
        # The message quotes the word.
        quoted = re.search("'(.*)'", str(caught.value))[1]
        assert quoted in words or words in quoted
    sound = "UNITS OF G. FILTER POINTS: HP=0.1 Hz LP=30.0 Hz"
    assert read(tmp_path, text.replace("UNITS OF G", sound).replace("PLACE", "Millikan Library")).dt == 0.01


def test_fortran_exponents_of_three_digits_are_read(tmp_path):
    text = AT2.format("ACCELERATION", "")
    assert read(tmp_path, text + " .1234500-100-.2000000E-01\n .3000000E-01\n").acceleration[0] < 1e-90
    with pytest.raises(UnreadableRecord, match=r"line 5 has '.1234500-10', which may be one number without"):
        read(tmp_path, text + " .1234500-10 -.2000000E-01\n .3000000E-01\n")
