"""Files of ESM."""

from __future__ import annotations

import pytest

from tests.formats.reader import FORM, check_damaged, check_what_is_written, written

FORMS = (FORM["esm"],)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_what_is_written_is_read(form, tmp_path):
    check_what_is_written(form, tmp_path)


@pytest.mark.parametrize("file", [*map(written, FORMS)], ids=str)
def test_a_damaged_file_is_never_half_read(file, tmp_path):
    check_damaged(file, tmp_path)
