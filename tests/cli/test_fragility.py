"""`tpd fragility`: tables, fits, runs without an answer, and which files of a folder are motions."""

import numpy as np
import pytest

from tests.cli.conftest import COLUMN, HUNG
from tests.unanswered import unanswered
from tpd.design.job import job_of
from tpd.records.reading import read_motions

TWO = "--records el-centro loma-prieta --scales 1 4 8"


def test_fragility_over_records(run):
    done = run("fragility", COLUMN, HUNG, TWO)
    assert done.status == 0
    table = done.rows("fragility.csv")
    # Two cases, three states, three stripes.
    assert len(table) == 18
    assert {r["total"] for r in table} == {"2"}
    states = {"rocking", "half", "overturned"}
    assert {"fragility.json", *(f"fragility_{x}.png" for x in states)} < done.files.keys()
    written = done.json("fragility.json")
    assert written["motions"][0].startswith("El Centro")
    assert set(written["fits"]) == set(written["p_values"]) == states
    assert "overturned: bare median" in done.out


@pytest.mark.mends("runs without an answer counted silently")
def test_runs_without_an_answer_are_named(run, monkeypatch):
    # All motions above 3 g tan alpha.
    unanswered(monkeypatch, lambda rows: rows[:, 5] > 0.5)
    done = run("fragility", COLUMN, HUNG, TWO)
    assert done.status == 0
    assert "not counted: 4 of 6 runs bare, 4 of 6 runs with the pendulum" in done.out
    assert done.json("fragility.json")["fits"]["overturned"]["hung"]["undecided"] == 4
    rows = [r for r in done.rows("fragility.csv") if (r["state"], r["case"]) == ("overturned", "bare")]
    assert [r["undecided"] for r in rows] == ["0", "2", "2"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [(("--scales", "2", "1"), "increasing numbers"), (("--intensity", "x"), "`intensity` must be")],
)
def test_bad_stripes_are_refused(run, words, sentence):
    done = run("fragility", COLUMN, "--records", "el-centro", *words)
    assert (done.status, done.files, len(done.err.splitlines())) == (2, {}, 1)
    assert sentence in done.err


def at2(path, direction: str) -> None:
    values = 0.3 * np.sin(0.05 * np.arange(200) * len(direction))
    head = f"PEER\nQuake, A, {direction}\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 200, DT= .01 SEC\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(head + "".join(f" {a:.6E}\n" for a in values))


@pytest.mark.mends("verticals counted as motions, and VT2 and DT2 beside AT2 stopped the command")
def test_verticals_and_velocities_of_a_folder_are_left_out(run, tmp_path):
    folder = tmp_path / "peer"
    for name in ("UP", "090", "360"):
        at2(folder / f"RSN1_AA{name}.AT2", name)
        (folder / f"RSN1_AA{name}.VT2").write_text("VELOCITY TIME SERIES IN UNITS OF CM/S\n")
    (folder / "_SearchResults.csv").write_text("a,b\n1,2\n")
    done = run("fragility", COLUMN, "--scales", "1", "2", "--records", str(folder))
    assert len(done.json("fragility.json")["motions"]) == 2
    for said in ("RSN1_AAUP.AT2 (vertical component)", "RSN1_AA090.VT2 (velocity)", "_SearchResults.csv"):
        assert said in done.out


@pytest.mark.mends("`fragility` had no --unit and no --dt, and named arguments of Python")
def test_unit_and_step_of_files_that_state_none(run, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("".join(f"{a:.5f}\n" for a in 0.3 * np.sin(0.1 * np.arange(200))))
    words = ("fragility", COLUMN, "--scales", "1", "2", "--records", str(path))
    assert "give `motion.unit` (--unit), such as unit = 'g'" in run(*words).err
    assert "give `motion.dt` (--dt) in s, such as dt = 0.01" in run(*words, "--unit", "g").err
    done = run(*words, "--unit", "g", "--dt", "0.01")
    assert len(done.json("fragility.json")["motions"]) == 1


@pytest.mark.mends("the channels of one file counted as earthquakes of their own")
def test_channels_of_a_file_are_of_one_earthquake(tmp_path):
    path = tmp_path / "station.csv"
    rows = (f"{0.01 * i:.2f},{np.sin(0.1 * i):.4f},{np.cos(0.2 * i):.4f}\n" for i in range(50))
    path.write_text("time (s),NS (g),EW (g)\n" + "".join(rows))
    first, second = read_motions([str(path)])[0]
    assert first.event == second.event != ""


@pytest.mark.mends("of two folders of one name the first was lost")
def test_held_out_folders_of_one_name_are_two_groups(tmp_path):
    words = [str(tmp_path / name / "q") for name in ("one", "other")]
    for name in ("one", "other"):
        at2(tmp_path / name / "q" / "RSN1_AA090.AT2", "090")
    job = job_of({"motion": {"records": ["el-centro"], "held_out": words}})
    assert set(job.held_out) == set(words)


@pytest.mark.mends("folders within a folder were passed over without a word")
def test_a_folder_in_a_folder_is_named(tmp_path):
    (tmp_path / "quakes" / "inner").mkdir(parents=True)
    at2(tmp_path / "quakes" / "RSN1_AA090.AT2", "090")
    found, said = read_motions([str(tmp_path / "quakes")])
    assert len(found) == 1
    assert said[0] == "left out: inner (a folder in a folder)"


def test_records_of_a_folder_are_of_one_earthquake(tmp_path):
    folder = tmp_path / "quake"
    folder.mkdir()
    for name in ("ns", "sew"):
        rows = (f"{0.01 * i:.2f},{np.sin(0.1 * i * len(name) + len(name)):.4f}\n" for i in range(50))
        (folder / f"{name}.csv").write_text("time (s),acc (g)\n" + "".join(rows))
    files = [str(path) for path in sorted(folder.iterdir())]
    found, said = read_motions([str(folder)])
    assert [m.event for m in found] == ["quake", "quake"]
    assert "2 records of the folder" in " ".join(said)
    for given, events in ((["A", "B"], ["A", "B"]), (["A"], ["A", "A"])):
        assert [m.event for m in read_motions(files, events=given)[0]] == events
    found, said = read_motions(files)
    assert [m.event for m in found] == ["", ""]
    assert "2 name no earthquake" in " ".join(said)
    with pytest.raises(ValueError, match="`event` must have one name"):
        read_motions(files, events=["A", "B", "C"])
