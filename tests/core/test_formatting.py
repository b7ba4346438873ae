"""Numbers and words as text, and what results show of themselves."""

import math
import sys

import numpy as np
import pytest

from tpd.core import formatting
from tpd.core.formatting import Printed, Tabular, counted, meant, number, pair_of, percent, span


def test_a_number_is_printed_with_its_significant_digits():
    texts = {0.0: "0", math.inf: "infinite", 1234.56: "1235", 0.00012346: "0.0001235", -2.5: "-2.5"}
    texts |= {math.nan: "–", 99999.0: "100000", 1e7: "1e+07", 9.9e-5: "9.9e-05", 1.0: "1"}
    assert {x: number(x) for x in texts} == texts


def test_a_value_and_its_limit_are_printed_with_enough_digits_to_differ():
    for value, limit, digits, form, texts in (
        (0.517, 0.4, 2, number, ("0.52", "0.4")),
        (0.3304, 0.33, 2, number, ("0.3304", "0.33")),
        (0.33000001, 0.33, 2, number, ("0.33000001", "0.33")),
        (0.1999, 0.2, 1, percent, ("19.99 %", "20.00 %")),
        (0.2, 0.2, 1, percent, ("20.0 %", "20.0 %")),
        (math.nan, 0.2, 1, percent, ("nan %", "20.0 %")),
        (math.inf, 1.0, 3, number, ("infinite", "1")),
    ):
        assert pair_of(value, limit, digits, form) == texts


def test_counts_ranges_and_hints_are_readable_words():
    assert counted(np.array(["no_orbit", "rocking", "rocking"])) == "2 rocking, 1 no orbit"
    assert [formatting.counted_periods(n) for n in (1, 3)] == ["1 period", "3 periods"]
    assert span(np.array([0.01, np.nan, 0.2]), "rad") == "0.01 to 0.2 rad"
    assert span(np.array([np.nan])) == "–"
    assert meant("amplitud", ["amplitude", "mass"]) == "; did you mean `amplitude`?"
    assert meant("x", ["amplitude", "mass"]) == "; allowed are amplitude, mass"
    assert meant("x", ["mass"], listing=False) == meant(3, ["mass"], listing=False) == ""


def test_old_names_and_other_spellings_have_a_hint():
    for word, allowed, hint in (
        ("PGA", ["pgv", "pga"], "; did you mean `pga`?"),
        ("--validation_share", ["--validation-share"], "; did you mean `--validation-share`?"),
        ("worth", ["block", "requirements"], "; it is now called `requirements`"),
        ("--held-out", ["--validation-share"], "; it is now called `--validation-share`"),
        ("stroke", ["mass"], "; it is now the key `stroke` of [limits]"),
        ("Study", ["details", "Details"], "; it is now called `Details`"),
        # A key of the job file is no option.
        ("--from-rest", ["--seed"], "; allowed are --seed"),
    ):
        assert meant(word, allowed) == hint


def test_a_decimal_comma_and_a_percentage_have_a_hint():
    assert formatting.number_hint("x = 0,5") == "; write 0.5 with a decimal point, not 0,5"
    assert formatting.number_hint("'20%'") == "; write 0.2 for 20%"
    assert formatting.number_hint("2.5 %") == "; write 0.025 for 2.5 %"
    assert formatting.number_hint("1,2,3") == formatting.number_hint("100") == ""


def test_columns_of_a_table_are_aligned():
    rows = [("", "with it", "x"), ("tilt", "1", ""), ("swing of it", "20", "3")]
    lines = ["             with it  x", "tilt               1", "swing of it       20  3"]
    assert formatting.aligned(rows) == lines


def test_a_result_in_a_notebook_is_text_and_table(monkeypatch):
    class Result(Printed, Tabular):
        def __str__(self):
            return "tilt < 0.2 rad"

        def columns(self):
            return {"x": np.array([1.0, 2.0])}

    assert repr(Result()) == "tilt < 0.2 rad"
    assert Result()._repr_html_() == "<pre>tilt &lt; 0.2 rad</pre>"
    frame = pytest.importorskip("pandas").DataFrame({"x": [1.0, 2.0]})
    assert Result().to_dataframe().equals(frame)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"needs pandas, .*: pip install '.\[pandas\]'"):
        Result().to_dataframe()
