"""Numbers and words as text, and what results show of themselves."""

import builtins
import math

import numpy as np
import pytest

from tpd.core import formatting
from tpd.core.formatting import Printed, Tabular, counted, meant, number, span


@pytest.mark.parametrize(
    ("x", "text"),
    [
        *((0.0, "0"), (math.nan, "–"), (math.inf, "infinite"), (1234.56, "1235"), (0.00012346, "0.0001235")),
        *((-2.5, "-2.5"), (99999.0, "100000"), (1e7, "1e+07"), (9.9e-5, "9.9e-05"), (1.0, "1")),
    ],
)
def test_numbers(x, text):
    assert number(x) == text


def test_words():
    assert counted(np.array(["no_orbit", "rocking", "rocking"])) == "2 rocking, 1 no orbit"
    assert [formatting.counted_periods(n) for n in (1, 3)] == ["1 period", "3 periods"]
    assert span(np.array([0.01, np.nan, 0.2]), "rad") == "0.01 to 0.2 rad"
    assert span(np.array([np.nan])) == "–"
    assert meant("amplitud", ["amplitude", "mass"]) == "; did you mean `amplitude`?"
    assert meant("x", ["amplitude", "mass"]) == "; allowed are amplitude, mass"
    assert meant("x", ["mass"], listing=False) == meant(3, ["mass"], listing=False) == ""


def test_columns_of_a_table_are_aligned():
    rows = [("", "with it", "x"), ("tilt", "1", ""), ("swing of it", "20", "3")]
    assert formatting.aligned(rows) == [
        "             with it  x",
        "tilt               1",
        "swing of it       20  3",
    ]


def test_a_result_shows_its_lines_and_its_table(monkeypatch):
    class Result(Printed, Tabular):
        def __str__(self):
            return "tilt < 0.2 rad"

        def columns(self):
            return {"x": np.array([1.0, 2.0])}

    assert repr(Result()) == "tilt < 0.2 rad"
    assert Result()._repr_html_() == "<pre>tilt &lt; 0.2 rad</pre>"
    frame = pytest.importorskip("pandas").DataFrame({"x": [1.0, 2.0]})
    assert Result().to_dataframe().equals(frame)
    real = builtins.__import__

    def without(name, *rest):
        if name == "pandas":
            raise ModuleNotFoundError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"needs pandas, .*: pip install '.\[pandas\]'"):
        Result().to_dataframe()
