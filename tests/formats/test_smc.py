"""Files of SMC of the USGS."""

import pytest

from tests.formats.reader import check, read
from tests.formats.synthetic import shaking, smc
from tpd.formats.text import UnreadableRecord


def test_written_samples_are_read_and_damaged_files_are_refused(tmp_path):
    check(tmp_path, "smc", "loma_prieta_1989_0111a.smc.gz")


def test_the_line_of_the_station_names_a_component_without_an_azimuth(tmp_path):
    text = smc(300.0 * shaking(100), 0.01)
    assert read(tmp_path, text).name == "Made-up Station/360 DEG"
    assert read(tmp_path, text.replace(f"{360:10d}", f"{-32768:10d}")).name == "Made-up Station/360"


def test_a_title_has_no_other_words(tmp_path):
    text = smc(300.0 * shaking(100), 0.01)
    for words in ("IN G", "(x 10)", "VELOCITY"):
        with pytest.raises(UnreadableRecord, match=r"line 1 must be an accelerogram, .* but is '2 CORRECTED"):
            read(tmp_path, text.replace("2 CORRECTED ACCELEROGRAM", f"2 CORRECTED ACCELEROGRAM {words}"))
