"""Building blocks of a report: cells, marks, and what is refused."""

import math

import pytest

from tpd.report.blocks import Severity, Table, danger, note, wrapped


def test_a_cell_has_four_significant_digits_or_a_dash():
    values = (0.0, 20e3, 123456.0, 0.0913456, -0.25, 9.99996, 1e-7, math.inf, math.nan, None, 3)
    said = "0 20000 123500 0.09135 -0.25 10 1e-07 infinite – – 3"
    assert [Table(("a",), ((x,),)).cells[0][0] for x in values] == said.split()


def test_a_column_of_numbers_is_marked_as_numeric():
    table = Table(("a", "b", "c"), (("x", "5.0 %", None), ("2", 1.0, None)))
    assert table.numeric == [False, True, False]


def test_a_row_with_missing_cells_is_rejected():
    with pytest.raises(ValueError, match="must have 2 cells as the head has, but has 1"):
        Table(("name", "size"), (("one",),))


def test_a_danger_has_a_prefix_and_lines_wrap_at_100_characters():
    assert [severity.name for severity in Severity] == ["danger", "note"]
    assert (danger("no").marked, note("yes").marked) == ("DANGER: no", "yes")
    first, second = wrapped("word " * 21, "- ")
    assert (len(first), second[:7]) == (96, "  word ")
    # A number and its unit stand in one line.
    assert wrapped("x" * 96 + " 99 % of the runs")[1] == "  99 % of the runs"
