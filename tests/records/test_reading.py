"""Ground motions by name: files, folders, built-in records, and what is said of them."""

import re

import pytest

from tests.formats.synthetic import esm, shaking
from tpd.records import el_centro, reading
from tpd.records.reading import read_motions

NS = esm(400.0 * shaking(100), 0.01)


def put(folder, **texts):
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / f"{name}.asc").write_text(text)
    return str(folder)


def nameless(seed, name="NS"):
    """A table of text, which names no earthquake."""
    rows = (f"{0.01 * i:.2f},{0.4 * a:.5f}\n" for i, a in enumerate(shaking(100, seed)))
    return f"time (s),{name} (g)\n" + "".join(rows)


def test_built_in_records_and_sets_go_by_name(monkeypatch):
    found, said = read_motions(["el-centro", "loma-prieta"])
    assert (found[0], said) == (el_centro(), [])
    assert found[1].event == "Loma Prieta 1989"
    monkeypatch.setattr(reading, "fema_p695", lambda name: [el_centro().scaled(2.0)])
    assert read_motions(["fema-p695"])[0] == [el_centro().scaled(2.0)]

    def missing(name):
        raise ImportError("the records of FEMA P695 need the extra")

    monkeypatch.setattr(reading, "fema_p695", missing)
    with pytest.raises(ValueError, match="need the extra"):
        read_motions(["fema-p695"])


@pytest.mark.mends("verticals counted as motions, VT2 and DT2 beside AT2 stopped the command")
@pytest.mark.mends("folders within a folder were passed over without a word")
def test_of_a_folder_all_that_is_horizontal_is_read(tmp_path):
    folder = put(tmp_path / "quakes", ns=NS, up=NS.replace("HNE", "HNZ"))
    (tmp_path / "quakes" / "inner").mkdir()
    for other in ("RSN1.VT2", "readme.pdf", "_SearchResults.csv"):
        (tmp_path / "quakes" / other).write_text("x")
    found, said = read_motions([folder])
    assert len(found) == 1
    left = said[0].removeprefix("left out: ").split("; ")
    assert "inner (a folder in a folder)" in left
    assert "up.asc (vertical component)" in left
    assert "RSN1.VT2 (velocity)" in left
    assert any(word.startswith("_SearchResults.csv") for word in left)
    # A channel that is chosen is taken, vertical or not.
    both, said = read_motions([folder], channel=0)
    assert len(both) == 2
    assert any("up.asc is a vertical component, but shakes the block sideways" in word for word in said)


@pytest.mark.mends("the channels of one file counted as earthquakes of their own")
def test_channels_of_a_file_that_names_no_earthquake_are_of_one(tmp_path):
    path = tmp_path / "station.csv"
    rows = (f"{0.01 * i:.2f},{a:.5f},{-a:.5f}\n" for i, a in enumerate(0.4 * shaking(100)))
    path.write_text("time (s),NS (g),EW (g)\n" + "".join(rows))
    first, second = read_motions([str(path)])[0]
    assert first.event == second.event != ""


def test_records_of_a_folder_that_name_no_earthquake_are_of_one(tmp_path):
    texts = {name: nameless(seed) for seed, name in enumerate("ab")}
    folder = put(tmp_path / "quake", **texts)
    found, said = read_motions([folder])
    assert {m.event for m in found} == {"quake"}
    assert any("2 records of the folder" in word for word in said)
    files = [f"{folder}/{name}.asc" for name in "ab"]
    assert [m.event for m in read_motions(files, events=["A", "B"])[0]] == ["A", "B"]
    assert [m.event for m in read_motions(files, events=["A"])[0]] == ["A", "A"]
    assert "2 name no earthquake" in " ".join(read_motions(files)[1])
    with pytest.raises(ValueError, match=re.escape("`event` must have one name, or one for each of the 2")):
        read_motions(files, events=["A", "B", "C"])


def test_records_without_a_direction_are_said_and_none_is_an_error(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(nameless(0, "acc"))
    assert "1 state no orientation" in " ".join(read_motions([str(path)])[1])
    folder = put(tmp_path / "up", up=NS.replace("HNE", "HNZ"))
    with pytest.raises(ValueError, match=r"no horizontal record in .*; `channel` takes one that is"):
        read_motions([folder])
