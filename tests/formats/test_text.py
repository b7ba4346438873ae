"""Lines and numbers of a text file."""

import re

import numpy as np
import pytest

from tests.formats.synthetic import FORMATS, Format, shaking
from tpd.formats import text
from tpd.formats.read import _FORMATS
from tpd.formats.table import Options, read_table
from tpd.formats.text import Cursor, Decimal, UnreadableRecord


def test_printed_numbers_are_read_with_their_last_digit():
    found = {x: Decimal.of(x) for x in ("12.50", "-1.5D-02", "7", "3e2")}
    assert [d.value for d in found.values()] == [12.5, -0.015, 7.0, 300.0]
    assert [d.unit for d in found.values()] == pytest.approx([0.01, 0.001, 1.0, 100.0])
    assert text.number(" 1.5d1 ", 1) == 15.0
    for wrong in ("nan", "inf", "1_000", "0x1F", "", "1.2.3", "1e999"):
        with pytest.raises(UnreadableRecord, match=r"line 3 must contain numbers, but has "):
            text.number(wrong, 3)


def test_fortran_formats_are_parsed():
    assert text.fortran("Format: (8f9.6)", 1) == (8, 9, 1e-6)
    assert text.fortran("(F10)", 1) == (1, 10, 1.0)
    for wrong in ("", "(8f0.6)", "(0f9.6)", "8f9.6"):
        with pytest.raises(UnreadableRecord, match="line 2 must state the format of its numbers"):
            text.fortran(wrong, 2)


def test_fixed_width_columns_must_be_full():
    lines = ["   1.0   2.0", "   3.0"]
    np.testing.assert_array_equal(Cursor(lines, True).fixed(3, 2, 6, "samples"), [1.0, 2.0, 3.0])
    for wrong in (["   1.0  2.0", "   3.0"], ["   1.0   2.0", "   3.0   4.0"], lines[:1]):
        with pytest.raises(UnreadableRecord, match=r"line . must contain .|ends after line 1"):
            Cursor(wrong, True).fixed(3, 2, 6, "samples")


def test_a_file_must_end_after_its_last_line_and_have_the_stated_lines():
    Cursor(["", " "], True).require_end()
    Cursor([""], False).require_end(whole=True)
    header = Cursor(["a", "DT 5"], True).header(2)
    assert header.match(2, r"dt (\d)", "a step")[1] == "5"
    for call, said in (
        (Cursor(["1"], True).require_end, "line 1 must be the end of the file, but is '1'"),
        (Cursor(["", ""], False).require_end, "the last line, 2, must end with a line break"),
        (lambda: Cursor(["no"], True).comments(1), "line 1 must be a comment"),
        (lambda: Cursor(["no"], True).match("dt", "a step"), "line 1 must state a step, but is 'no'"),
        (lambda: header.match(1, r"dt (\d)", "a step"), "line 1 must state a step"),
    ):
        with pytest.raises(UnreadableRecord, match=re.escape(said)):
            call()


class Counted(list):
    """Lines that count how many of them are looked at."""

    seen = 0

    def __getitem__(self, place):
        found = super().__getitem__(place)
        self.seen += len(found) if isinstance(place, slice) else 1
        return found

    def __iter__(self):
        for line in super().__iter__():
            self.seen += 1
            yield line


def test_the_reading_time_is_linear_in_the_number_of_rows():
    def free(cursor, unit):
        return cursor.free("the samples")

    def fixed(cursor, unit):
        while not cursor.only_blank_lines_follow():
            cursor.fixed(1, 1, 9, "samples")

    column = Format(lambda values, dt: "".join(f"{v:9.4f}\n" for v in values), ".4f", 1.0, 1.0)
    # The CSV of K-NET, and a table by its own reader.
    rows = [(f, next(reader for known, reader in _FORMATS if known(lines_of(f, 100)))) for f in FORMATS[:9]]
    rows += [
        (FORMATS[9], lambda cursor, _: read_table(cursor, Options())),
        (column, free),
        (column, fixed),
    ]
    for form, reader in rows:
        seen = []
        for n in (2000, 4000):
            lines = Counted(lines_of(form, n))
            reader(Cursor(lines, True), None)
            seen.append(lines.seen / len(lines))
        assert max(seen) < 25, form
        assert seen[1] < 1.1 * seen[0], form


def lines_of(form, n):
    return re.split(r"\r\n|\n|\r", form.write(form.size * shaking(n), 0.01).rstrip("\x1a\r\n"))
