"""Files of SMC of the USGS."""

import pytest

from tests.formats.reader import check, read
from tests.formats.synthetic import shaking, smc
from tpd.formats.text import UnreadableRecord


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "smc", "loma_prieta_1989_0111a.smc.gz")


def test_a_component_without_azimuth_has_the_name_of_its_station_line(tmp_path):
    text = smc(300.0 * shaking(100), 0.01)
    assert read(tmp_path, text).name == "Made-up Station/360 DEG"
    assert read(tmp_path, text.replace(f"{360:10d}", f"{-32768:10d}")).name == "Made-up Station/360"


def test_an_unknown_word_in_an_smc_title_is_rejected(tmp_path):
    text = smc(300.0 * shaking(100), 0.01)
    for words in ("IN G", "(x 10)", "VELOCITY"):
        with pytest.raises(UnreadableRecord, match=r"line 1 must be an accelerogram, .* but is '2 CORRECTED"):
            read(tmp_path, text.replace("2 CORRECTED ACCELEROGRAM", f"2 CORRECTED ACCELEROGRAM {words}"))
