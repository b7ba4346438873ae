"""One channel: units, directions, baselines, and statements that must agree."""

import re

import numpy as np
import pytest

from tests.formats.synthetic import FORMATS, G, cosmos, csmip_v1, esm, geonet, knet, shaking, smc
from tpd import Record
from tpd.formats import channel
from tpd.formats.channel import FACTORS, Channel, orientation, unit_spelling
from tpd.formats.text import Decimal, UnreadableRecord


def test_units_of_acceleration_have_their_factors_and_others_are_rejected():
    units = ["m/s2", "M/S^2", "m/s²", "m s-2", "cm/sec/sec", "Gal", "mm/s2", "g", "%g", "milli-g", "inch/s/s"]
    factors = [1.0] * 4 + [0.01] * 2 + [0.001, G, 0.01 * G, 0.001 * G, 0.0254]
    for unit, factor in zip(units, factors, strict=True):
        spelling = channel.unit_of(unit, 1)
        assert spelling == unit_spelling(unit)
        assert channel.factor_of(None, unit) == channel.factor_of(spelling, unit) == FACTORS[spelling]
        assert FACTORS[spelling] == pytest.approx(factor, rel=1e-15)
    for ask, said in (
        (lambda: channel.unit_of("furlong", 7), "line 7 must state a unit of acceleration"),
        (lambda: channel.check_unit("furlong"), "`unit` must be one of g, .* but is 'furlong'"),
        (lambda: channel.factor_of(None, None), "states no unit of acceleration: give `unit`"),
        (lambda: channel.factor_of("cm/s2", "g"), "states the unit cm/s2, but `unit` is 'g'"),
    ):
        with pytest.raises(ValueError, match=said):
            ask()


def test_directions_are_recognised_by_words():
    for vertical, words in (
        (True, "UP|U-D|Vert|HNZ|AccZ|Down (corrected)|up-down|z"),
        (False, "90 DEG|N-S|S16E|HNE|360|AccX|az 90|tran"),
        (None, "column 3|accelerations|channel 12|"),
    ):
        assert [word for word in words.split("|") if orientation(word) is not vertical] == []


EVENTS = {
    "Nowhere Valley-06, 10/15/1979": "Nowhere Valley-06 1979-10-15",
    "NOWHERE VALLEY 10/15/79 2316": "NOWHERE VALLEY 1979-10-15",
    "NOWHERE EARTHQUAKE OCTOBER 15, 1979 16:16 PDT": "NOWHERE EARTHQUAKE 1979-10-15",
    "1979 October 15         23:16:54 UT": "1979-10-15",
    "1979  10  15    2316 Nowhere": "1979-10-15",
    "Nowhere 99/99/1979": "Nowhere 99/99/1979",
    "A 1/2/33": "A 1933-01-02",
    "A 1/2/32": "A 2032-01-02",
}
"""Earthquakes as agencies state them, and their names with dates."""


def test_the_earthquake_of_a_header_is_its_name_and_date():
    assert {text: channel.event_of(text) for text in EVENTS} == EVENTS


def test_an_implausible_record_is_rejected_and_a_drift_is_noted():
    wave = np.sin(np.arange(100.0))
    for wrong, said in (
        (Channel(np.zeros(1), 0.01), "at least 2 samples, but has 1"),
        (Channel(wave, 20.0, "N"), "step must be 1e-05 s to 1 s, but is 20 s"),
        (Channel(200.0 * wave, 0.01), "peak must be at most 100 m/s^2, but is 199.998"),
        (Channel(wave * np.nan, 0.01), "peak must be at most 100 m/s^2, but is nan"),
    ):
        with pytest.raises(UnreadableRecord, match=re.escape(said)):
            channel.check_channel(wrong)
    assert channel.check_channel(Channel(np.zeros(3), 0.01)).notes == ("all samples are zero",)
    offset, drift = channel.check_channel(Channel(wave + 0.1, 0.01)).notes
    assert offset.startswith("offset: the mean, 0.1")
    assert drift.startswith("drift: the velocity at the end is 0.1")
    for share, is_noted in ((0.004, False), (0.006, True)):
        notes = channel.check_channel(Channel(np.tile([1.0, -1.0, -1.0, 1.0], 50) + share, 0.01)).notes
        assert any(note.startswith("offset: the mean") for note in notes) is is_noted


def test_two_statements_must_agree_within_their_digits():
    values = np.array([0.0, 1.234, -2.346])
    channel.agree_on_count(3, 3, "the header")
    channel.agree_on_peak(values, Decimal.of("-2.35"), "the header", digit=0.001)
    channel.agree_on_peak_time(values, 0.01, Decimal.of("0.03"), "the header")
    channel.agree(1.0, 1.05, "it", 0.1)
    for ask, said in (
        (lambda: channel.agree_on_count(4, 3, "line 2"), "line 2 states 4 samples, but there are 3"),
        (lambda: channel.agree_on_peak(values, Decimal.of("2.35"), "x", digit=0.001), "a peak of 2.35"),
        (lambda: channel.agree_on_peak(values, Decimal.of("1.234"), "x", digit=0.001), "a peak of 1.234"),
        (lambda: channel.agree_on_peak_time(values, 0.01, Decimal.of("0.04"), "x"), "the peak at 0.04 s"),
        (lambda: channel.agree(1.0, 1.2, "the step", 0.1), "the step twice and differently, 1 and 1.2"),
    ):
        with pytest.raises(UnreadableRecord, match=said):
            ask()


def raw_files():
    """Files of records that are not corrected, with an offset of a tenth of the peak, by name."""
    wave = shaking(100) + 0.1
    raw_cosmos, raw_esm = (write(300.0 * wave, 0.01) for write in (cosmos, esm))
    yield "knet", knet(4e5 * wave, 0.01)
    yield "csmip", csmip_v1(0.3 * wave, 0.01)
    yield "geonet", geonet(3000.0 * wave, 0.01, corrected=False)
    for word in ("Uncorrected", "Raw"):
        yield f"cosmos {word}", raw_cosmos.replace("Corrected", word)
    yield "smc", smc(300.0 * wave, 0.01).replace("2 CORRECTED", "1 UNCORRECTED")
    yield "esm", raw_esm.replace("BASELINE REMOVED", "BASELINE NOT REMOVED")
    yield "esm without a word", raw_esm.replace(" BASELINE REMOVED", "")


@pytest.mark.parametrize(("name", "text"), list(raw_files()), ids=lambda x: x if len(x) < 20 else "")
def test_the_mean_of_an_uncorrected_record_is_removed(tmp_path, name, text):
    path = tmp_path / "record.txt"
    path.write_text(text, newline="")
    for default, kept in zip(Record.read_all(path), Record.read_all(path, baseline="none"), strict=True):
        mean, peak = np.mean(kept.acceleration), np.max(np.abs(kept.acceleration))
        assert abs(mean) > 0.07 * peak
        np.testing.assert_array_equal(default.acceleration, kept.acceleration - mean)
        said = f"baseline removed: the mean, {mean:.3g} m/s^2, {abs(mean) / peak:.1%} of the peak"
        assert said in default.notes
        assert {*channel.RAW} & {*default.notes} == {*channel.RAW} & {*kept.notes} != set()
        assert not any(note.startswith("offset") for note in default.notes)
        assert any(note.startswith("offset") for note in kept.notes)
    line = Record.read_all(path, baseline="linear")[0]
    assert np.abs(np.polyfit(np.arange(len(line.acceleration)), line.acceleration, 1)).max() < 1e-12


def test_a_corrected_record_and_a_table_are_read_unchanged(tmp_path):
    wave = shaking(100) + 0.1
    path = tmp_path / "record.txt"
    for form in FORMATS[:1] + FORMATS[2:6] + FORMATS[7:8] + FORMATS[9:10]:
        path.write_text(form.write(0.7 * form.size * wave, 0.01), newline="")
        first = Record.read_all(path)[0]
        assert first == Record.read_all(path, baseline="none")[0]
        assert any(note.startswith("offset: the mean, ") for note in first.notes)
