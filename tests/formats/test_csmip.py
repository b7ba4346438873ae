"""Volumes 1 and 2 of the CSMIP."""

import pytest

from tests.formats.reader import DATA, check
from tests.formats.synthetic import G, csmip_v1, csmip_v2, shaking
from tpd import Record
from tpd.formats.csmip import is_csmip
from tpd.formats.text import UnreadableRecord


def test_samples_are_read_back_and_damaged_files_are_rejected(tmp_path):
    check(tmp_path, "csmip_v1", "csmip_v2", "coalinga_1983_cut.V2", "ridgecrest_2019_cut.RAW")


def test_real_csmip_files_have_the_values_of_their_headers():
    for name, dt, digit, peaks in (
        # Peaks (m/s^2) as printed in the headers of the files, with the digits that are printed there.
        ("coalinga_1983_cut.V2", 0.02, 5e-6, (2.67957, 0.94805, 2.56231)),
        ("ridgecrest_2019_cut.RAW", 0.01, 5e-3, (0.567 * G, 0.471 * G, 0.361 * G)),
    ):
        records = Record.read_all(DATA / name, baseline="none")
        assert [record.pga for record in records] == pytest.approx(peaks, abs=digit)
        assert [record.dt for record in records] == pytest.approx([dt] * 3, rel=1e-15)
        assert {record.acceleration.shape for record in records} == {(600,)}
    raw = Record.read(DATA / name, channel=1)
    assert raw.event == "2019-07-05"
    mean = "baseline removed: the mean, 0.0443 m/s^2, 1.0% of the peak"
    assert [any(note.startswith(word) for note in raw.notes) for word in ("uncorrected", mean)] == [True] * 2
    _, up, north = Record.read_all(DATA / "coalinga_1983_cut.V2")
    assert (north.name, north.event) == ("PARKFIELD FAULT ZONE 14/0 DEG", "COALINGA EARTHQUAKE 1983-05-02")
    assert "vertical component" in up.notes


def test_length_and_unit_of_the_second_channel_must_agree_with_its_samples(tmp_path):
    text = csmip_v1(0.3 * shaking(100), 0.01)
    path = tmp_path / "a.V1"
    for old, new, message in (
        ("Record Length =  1.000 sec", "Record Length =  1.030 sec", "the length in s twice and differently"),
        ("sec and g .", "sec and min .", "line {} must state a unit of acceleration"),
    ):
        before, _, after = text.rpartition(old)
        path.write_text(f"{before}{new}{after}")
        line = before.count("\n") + 1
        with pytest.raises(UnreadableRecord, match=message.format(line)):
            Record.read_all(path)


def test_an_unknown_word_in_the_line_of_the_unit_is_rejected(tmp_path):
    path = tmp_path / "a.V2"
    for text, old, new in (
        (csmip_v2(300.0 * shaking(100), 0.01), "(UNITS: CM/SEC/SEC)", "(UNITS: CM/SEC/SEC) X 10"),
        (csmip_v2(300.0 * shaking(100), 0.01), "(UNITS: CM/SEC/SEC)", ", IN CM/SEC2 (X 10)"),
        (csmip_v1(0.3 * shaking(100), 0.01), "Format: (8f9.6)", "Format: (8f9.6) x 10"),
    ):
        path.write_text(text)
        assert len(Record.read_all(path)) == 2
        path.write_text(text.replace(old, new))
        with pytest.raises(UnreadableRecord, match=r"line .* must state"):
            Record.read_all(path)


def test_a_file_is_recognised_by_its_agency():
    first, *others = csmip_v2(300.0 * shaking(100), 0.01).splitlines()
    assert is_csmip([first])
    assert is_csmip(["Accelerogram of the CSMIP", *others])
    assert not is_csmip(["Accelerogram", "Somewhere"])
