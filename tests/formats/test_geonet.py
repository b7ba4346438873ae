"""Files of GeoNet, corrected and not."""

import pytest

from tests.formats.reader import check, read
from tests.formats.synthetic import geonet, shaking
from tpd.formats.text import UnreadableRecord


def test_written_samples_are_read_and_damaged_files_are_refused(tmp_path):
    check(tmp_path, "geonet", "geonet_raw")


def test_the_peak_must_be_that_of_an_acceleration(tmp_path):
    text = geonet(3000.0 * shaking(100), 0.01)
    with pytest.raises(UnreadableRecord, match="line 14 must state the peak and its time"):
        read(tmp_path, text.replace("Acceleration:  peak", "Velocity:  peak"), channel=0)
    # The second channel begins after the first one.
    before, second, after = text.rpartition("mm/s/s at  ")
    line = before.count("\n") + 1
    with pytest.raises(UnreadableRecord, match=f"line {line} must state a unit of acceleration"):
        read(tmp_path, f"{before}{second.replace('mm/s/s', 'mm/min')}{after}", channel=0)
    assert read(tmp_path, text, channel=0).dt == 0.01
