"""Files of K-NET and KiK-net, in ASCII and in CSV."""

import numpy as np
import pytest

from tests.formats.reader import FORM, check, read, written
from tests.formats.synthetic import shaking
from tpd import Record
from tpd.formats import channel
from tpd.formats.text import UnreadableRecord


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "knet")


def test_a_knet_csv_file_is_read(tmp_path):
    head = (
        "#K-NET CSV\n#OriginTime,Latitude,Longitude,Depth(km),Magnitude\n#2000/01/01 00:00:00,0,0,10,6.0\n"
        "#Code,Latitude\n#XXX001,0\n#SamplingFrequency(Hz)\n#100\n#DurationTime(s)\n#1\n"
        "#Time,RelativeTime(s),N-S(gal),E-W(gal),U-D(gal)\n"
    )
    values = np.round(shaking(100), 5)
    rows = [f"2000/01/01 00:00:10,{0.01 * i:.2f},{a:.5f},{-a:.5f},{a:.5f}\n" for i, a in enumerate(values)]
    path = tmp_path / "a.csv"
    path.write_text(head + "".join(rows))
    records = Record.read_all(path, baseline="none")
    assert [r.name for r in records] == ["XXX001/N-S", "XXX001/E-W", "XXX001/U-D"]
    assert ["vertical component" in r.notes for r in records] == [False, False, True]
    np.testing.assert_allclose(records[1].acceleration, -0.01 * values, rtol=1e-12)
    without = Record.read_all(path)
    np.testing.assert_allclose(without[1].acceleration, -0.01 * (values - values.mean()), atol=1e-15)
    # Of KiK-net the columns of the borehole are numbered by 1.
    deep = head.replace("N-S(gal),E-W(gal),U-D(gal)", "NS1(gal),NS2(gal),UD2(gal)") + "".join(rows)
    path.write_text(deep)
    assert [channel.BOREHOLE in r.notes for r in Record.read_all(path)] == [True, False, False]
    path.write_text(head + "".join(rows))
    for wrong, said in (
        (head + "".join(rows[:-1]), "100 samples, but there are 99"),
        (head + "".join([*rows[:50], rows[51], rows[50], *rows[52:]]), "must be 0.01 s after the line"),
        (head + "".join(row * 2 for row in rows), "line 12 has the same time as line 11"),
        (head.replace("#100", "#0") + rows[0], "sampling frequency must be positive"),
        (head + rows[0].replace(",", ";", 1), "must have 5 cells"),
    ):
        with pytest.raises(UnreadableRecord, match=said):
            read(tmp_path, wrong)


def test_header_spellings_of_the_knet_manual_are_read(tmp_path):
    text = written(FORM["knet"]).text
    other = text.replace("Long. ", "Lon.  ").replace("Max. Acc.", "Max Acc.")
    assert read(tmp_path, other, "a.NS") == read(tmp_path, text, "a.NS")


@pytest.mark.parametrize(
    ("old", "new"),
    [("100Hz", "0Hz"), ("(gal)/6182761", "(gal)/0"), ("Duration Time(s)  1", "Duration Time(s)  1e7")],
)
def test_an_implausible_knet_header_is_rejected(tmp_path, old, new):
    text = written(FORM["knet"]).text
    assert old in text
    with pytest.raises(UnreadableRecord, match="sampling frequency, duration and scale factor must be those"):
        read(tmp_path, text.replace(old, new))
