"""Files of ESM."""

import pytest

from tests.formats.reader import check, read
from tests.formats.synthetic import esm, shaking
from tpd.formats.text import UnreadableRecord


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "esm")


def test_a_scale_factor_in_an_esm_header_is_rejected(tmp_path):
    text = esm(400.0 * shaking(100), 0.01)
    assert read(tmp_path, text.replace("USER5: ", "FULL_SCALE_G: 2.0\nSCALE_FACTOR: ")).dt == 0.01
    with pytest.raises(UnreadableRecord, match=r"has 'SCALE_FACTOR: 10', which is not understood"):
        read(tmp_path, text.replace("USER5: ", "SCALE_FACTOR: 10"))
