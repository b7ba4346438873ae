"""Output files: the date of a report."""

import pytest

from tpd.core import files


def test_the_date_is_that_of_the_environment_where_it_has_one(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert files.today() == "2023-11-14"
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    assert len(files.today()) == 10
    for bad in ("soon", "1e400", "9" * 30):
        monkeypatch.setenv("SOURCE_DATE_EPOCH", bad)
        with pytest.raises(ValueError, match="`SOURCE_DATE_EPOCH` must be a whole number of seconds"):
            files.today()
