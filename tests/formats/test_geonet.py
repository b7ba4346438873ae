"""Files of GeoNet, corrected and not."""

import pytest

from tests.formats.reader import check, read
from tests.formats.synthetic import geonet, shaking
from tpd.formats.text import UnreadableRecord


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "geonet", "geonet_raw")


def test_a_geonet_file_must_state_the_peak_of_an_acceleration(tmp_path):
    text = geonet(3000.0 * shaking(100), 0.01)
    with pytest.raises(UnreadableRecord, match="line 14 must state the peak and its time"):
        read(tmp_path, text.replace("Acceleration:  peak", "Velocity:  peak"), channel=0)
    # The second channel begins after the first one.
    before, second, after = text.rpartition("mm/s/s at  ")
    line = before.count("\n") + 1
    with pytest.raises(UnreadableRecord, match=f"line {line} must state a unit of acceleration"):
        read(tmp_path, f"{before}{second.replace('mm/s/s', 'mm/min')}{after}", channel=0)
    record = read(tmp_path, text, channel=0)
    assert (record.dt, record.name) == (0.01, "MADE/N10E")


def test_an_uncorrected_geonet_file_must_state_its_unit(tmp_path):
    text = geonet(3000.0 * shaking(100), 0.01, corrected=False)
    before, _, after = text.rpartition("1.00 mm/s/s")
    line = before.count("\n") + 1
    with pytest.raises(UnreadableRecord, match=f"line {line} must state a unit of acceleration"):
        read(tmp_path, f"{before}1.00 mm/min{after}", channel=0)
    with pytest.raises(UnreadableRecord, match=r"states the unit in m/s\^2 twice and differently"):
        read(tmp_path, f"{before}1.00 cm/s/s{after}", channel=0)
