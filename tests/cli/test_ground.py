"""`tpd shake`, `tpd spectrum` and `tpd fragility`: files, numbers and refusals."""

import csv
import json

import numpy as np
import pytest

import tpd
from tests.unanswered import unanswered
from tpd.answers import transient as transient_module
from tpd.cli import main
from tpd.design.job import job_of
from tpd.records.reading import read_motions

COLUMN = ["--width", "1", "--height", "6", "--mass", "9000", "--friction", "0", "--restitution", "0.9595"]
HUNG = ["--pendulum-mass", "450", "--pendulum-length", "0.9"]
PULSE = ["--pulse", "one-sine", "--pulse-frequency", "1.2375"]


def run(tmp_path, *words: str) -> tuple[int, dict]:
    out = tmp_path / "out"
    status = main([*words, "--out", str(out)])
    found = {p.name: p for p in out.iterdir()} if out.exists() else {}
    return status, found


def rows(path) -> list[dict]:
    with path.open() as file:
        return list(csv.DictReader(file))


def test_shake_says_what_the_library_says(tmp_path, capsys):
    status, files = run(tmp_path, "shake", *COLUMN, *HUNG, *PULSE, "--pga", "0.4", "--free", "5")
    assert status == 0
    assert files.keys() == {"histories.csv", "histories.png", "impacts.csv", "animation.gif", "shake.json"}
    results = json.loads(files["shake.json"].read_text())["results"]
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
    pulse = tpd.Pulse.one_sine(acceleration=0.4 * 9.80665, frequency=1.2375)
    hung = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
    known = tpd.transient(tpd.Scene(block, pulse), hung, free=5.0)
    # The nonlinear equations count, and the linear ones stand beside them.
    counts = tpd.transient(tpd.Scene(block, pulse), hung, free=5.0, model=tpd.Segmented())
    for name in ("tilt", "swing", "relative"):
        ours = results["with the pendulum"]
        assert ours[name] == pytest.approx(float(getattr(counts, name)), rel=1e-12)
        assert ours["linear"][name] == pytest.approx(float(getattr(known, name)), rel=1e-12)
    assert results["bare block"]["status"] == "rocked"
    tilts = [
        abs(float(r["tilt_rad"])) for r in rows(files["histories.csv"]) if r["case"] == "with the pendulum"
    ]
    assert max(tilts) == pytest.approx(float(known.tilt), rel=1e-4)
    assert "keeps the base from sliding" in capsys.readouterr().out


def test_a_fall_is_the_exit_status(tmp_path, capsys):
    status, files = run(tmp_path, "shake", *COLUMN, *PULSE, "--pga", "0.5")
    assert status == 3
    assert "overturned" in capsys.readouterr().out
    assert json.loads(files["shake.json"].read_text())["results"]["bare block"]["tilt"] == "infinite"


@pytest.mark.mends("`tpd shake` gave the swing of the linear equations and did not say so")
def test_what_sizes_a_room_is_of_the_nonlinear_equations_and_impacts_have_a_stated_size(tmp_path, capsys):
    """Marble column in El Centro: the bob swings 0.443 rad, and 0.377 by the linear equations."""
    column = ["--width", "0.62", "--height", "5.2", "--mass", "4239", "--friction", "0"]
    bob = ["--mass-ratio", "0.05", "--pendulum-length", "1.3"]
    status, files = run(tmp_path, "shake", *column, "--restitution", "housner", *bob, "--record", "el-centro")
    assert status == 0
    said = capsys.readouterr().out
    assert "nonlinear equations    linear equations" in said
    swings = [line.split()[-2:] for line in said.splitlines() if "swing" in line]
    assert swings == [["0.4428", "0.3769"]]
    results = json.loads(files["shake.json"].read_text())["results"]["with the pendulum"]
    assert results["swing"] == pytest.approx(0.4428, abs=1e-4)
    assert results["linear"]["swing"] == pytest.approx(0.3769, abs=1e-4)
    # 696 impacts with all hops of each rattle.
    strong, hits = results["linear"]["impacts_faster_than_rad_s"], rows(files["impacts.csv"])
    hung = [abs(float(r["rate_after_rad_s"])) for r in hits if r["case"] == "with the pendulum"]
    assert results["linear"]["impacts"] == sum(rate > strong for rate in hung) < 0.5 * len(hung)
    assert f"impacts faster than {strong:.4g} rad/s" in said


@pytest.mark.mends("`tpd shake` ended with 0 where a motion had no answer")
def test_a_motion_without_an_answer_is_named(tmp_path, capsys, monkeypatch):
    follow, few = transient_module.transient, {"max_events": 1}
    monkeypatch.setattr(transient_module, "transient", lambda *a, **k: follow(*a, **{**k, **few}))
    status, _ = run(tmp_path, "shake", *COLUMN, *PULSE, "--pga", "0.4")
    said = capsys.readouterr().out
    assert status == 3
    assert "event_bound" in said
    assert "no answer" in said


def test_a_file_shakes_as_well(tmp_path):
    t = np.arange(300) * 0.01
    record = tmp_path / "record.csv"
    lines = [f"{x:.2f},{0.3 * np.sin(8.0 * x):.6f}" for x in t]
    record.write_text("time (s),acceleration (g)\n" + "\n".join(lines) + "\n")
    status, files = run(tmp_path, "shake", *COLUMN, "--record", str(record), "--scale", "1.2", "--free", "1")
    assert status == 0
    written = json.loads(files["shake.json"].read_text())
    known = tpd.transient(
        tpd.Scene(
            tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595),
            tpd.Record.read(record).scaled(1.2),
        ),
        free=1.0,
    )
    linear = written["results"]["bare block"]["linear"]
    assert linear["tilt"] == pytest.approx(float(known.tilt), rel=1e-12)


def test_the_spectrum_of_a_pulse_and_of_a_record(tmp_path, capsys):
    status, files = run(tmp_path, "spectrum", *COLUMN, *HUNG, "--pulse", "ricker", "--points", "8")
    assert status == 0
    assert files.keys() == {"spectrum.csv", "spectrum.json", "spectrum.png"}
    assert len(rows(files["spectrum.csv"])) == 64
    assert "share of the pulses that the block survives" in capsys.readouterr().out
    status, files = run(
        tmp_path, "spectrum", *COLUMN, *HUNG, "--record", "el-centro", "--points", "5", "--overwrite"
    )
    assert status == 0
    assert [float(r["period_s"]) for r in rows(files["spectrum.csv"])] == np.linspace(0.5, 12.0, 5).tolist()


def test_fragility_over_records(tmp_path, capsys):
    status, files = run(
        tmp_path,
        "fragility",
        *COLUMN,
        *HUNG,
        "--records",
        "el-centro",
        "loma-prieta",
        "--scales",
        "1",
        "4",
        "8",
    )
    assert status == 0
    table = rows(files["fragility.csv"])
    # Two cases, three states, three stripes.
    assert len(table) == 18
    assert {r["total"] for r in table} == {"2"}
    assert {
        "fragility.json",
        "fragility_overturned.png",
        "fragility_half.png",
        "fragility_rocking.png",
    } < files.keys()
    written = json.loads(files["fragility.json"].read_text())
    assert written["motions"][0].startswith("El Centro")
    assert set(written["fits"]) == set(written["p_values"]) == {"rocking", "half", "overturned"}
    assert "overturned: bare median" in capsys.readouterr().out


@pytest.mark.mends("runs without an answer counted silently")
def test_runs_without_an_answer_are_named(tmp_path, capsys, monkeypatch):
    # All motions above 3 g tan alpha.
    unanswered(monkeypatch, lambda rows: rows[:, 5] > 0.5)
    words = ("spectrum", *COLUMN, *HUNG, "--pulse", "one-sine", "--points", "4", "--sizes-to", "5")
    status, files = run(tmp_path, *words)
    assert status == 0
    said = capsys.readouterr().out
    assert "pulses without an answer: 8 of 16 for the bare block, 8 of 16 with the pendulum" in said
    # Six of the eight with an answer stand; those without may stand or not.
    assert "survives: 37.5% to 87.5%, 37.5% to 87.5%" in said
    assert json.loads(files["spectrum.json"].read_text())["undecided"] == [8, 8]
    assert [r["bare"] for r in rows(files["spectrum.csv"])].count("-1") == 8
    record = ("--record", "el-centro", "--scale", "2", "--points", "3", "--overwrite")
    status, files = run(tmp_path, "spectrum", *COLUMN, *record)
    assert status == 0
    assert "blocks without an answer: 3 of 3 for the bare block" in capsys.readouterr().out
    assert {r["bare"] for r in rows(files["spectrum.csv"])} == {""}
    records = ("--records", "el-centro", "loma-prieta", "--scales", "1", "4", "8", "--overwrite")
    status, files = run(tmp_path, "fragility", *COLUMN, *HUNG, *records)
    assert status == 0
    said = capsys.readouterr().out
    assert "not counted: 4 of 6 runs bare, 4 of 6 runs with the pendulum" in said
    written = json.loads(files["fragility.json"].read_text())
    assert written["fits"]["overturned"]["hung"]["undecided"] == 4
    table = rows(files["fragility.csv"])
    undecided = [r["undecided"] for r in table if (r["state"], r["case"]) == ("overturned", "bare")]
    assert undecided == ["0", "2", "2"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["shake", *COLUMN], "a block of your own must be whole, with a motion of its own"),
        (["shake"], "give either --record FILE or --pulse KIND, or a job of one"),
        (
            ["shake", *COLUMN, "--pulse", "one-sine"],
            "a pulse needs `motion.pulse` (--pulse KIND)",
        ),
        (["shake", *COLUMN, "--record", "nothing.csv"], "nothing.csv"),
        (["shake", *COLUMN, *PULSE, "--scale", "-1"], "`acceleration` must be"),
        (["shake", *COLUMN, *PULSE, "--pga", "0"], "[motion] `pga` must be positive"),
        (["shake", "--width", "1", *PULSE], "a block of your own must be whole"),
        (["spectrum", *COLUMN, "--pulse", "ricker", "--points", "1"], "`--points` must be"),
        (["fragility", *COLUMN, "--records", "el-centro", "--scales", "2", "1"], "increasing numbers"),
        (["fragility", *COLUMN, "--records", "el-centro", "--intensity", "x"], "`intensity` must be"),
    ],
)
def test_bad_input_is_one_sentence(tmp_path, capsys, words, sentence):
    status, files = run(tmp_path, *words)
    assert status == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert sentence in error[-1]
    assert error[-1].startswith("tpd: ")
    assert not files


def at2(path, direction: str, event: str = "Quake", factor: float = 1.0) -> None:
    values = factor * 0.3 * np.sin(0.05 * np.arange(200) * len(direction))
    path.write_text(
        f"PEER\n{event}, PLACE, {direction}\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= 200, DT= .01 SEC\n"
        + "".join(f" {a:.6E}\n" for a in values)
    )


def seen(tmp_path, *words: str) -> int:
    status, files = run(tmp_path, "fragility", *COLUMN, "--scales", "1", "2", *words)
    assert status == 0
    return len(json.loads(files["fragility.json"].read_text())["motions"])


@pytest.mark.mends("verticals counted as motions, and VT2 and DT2 beside AT2 stopped the command")
def test_verticals_and_velocities_of_a_folder_are_left_out(tmp_path, capsys):
    folder = tmp_path / "peer"
    folder.mkdir()
    for name in ("UP", "090", "360"):
        at2(folder / f"RSN1_AA{name}.AT2", name)
        (folder / f"RSN1_AA{name}.VT2").write_text("VELOCITY TIME SERIES IN UNITS OF CM/S\n")
    (folder / "_SearchResults.csv").write_text("a,b\n1,2\n")
    assert seen(tmp_path, "--records", str(folder)) == 2
    said = capsys.readouterr().out
    assert "RSN1_AAUP.AT2 (vertical component)" in said
    assert "RSN1_AA090.VT2 (velocity)" in said
    assert "_SearchResults.csv" in said


@pytest.mark.mends("`fragility` had no --unit and no --dt, and named arguments of Python")
def test_unit_and_step_of_files_that_state_none(tmp_path, capsys):
    path = tmp_path / "a.txt"
    path.write_text("".join(f"{a:.5f}\n" for a in 0.3 * np.sin(0.1 * np.arange(200))))
    words = ("fragility", *COLUMN, "--scales", "1", "2", "--records", str(path))
    assert run(tmp_path, *words)[0] == 2
    assert "give `motion.unit` (--unit), such as unit = 'g'" in capsys.readouterr().err
    assert run(tmp_path, *words, "--unit", "g")[0] == 2
    assert "give `motion.dt` (--dt) in s, such as dt = 0.01" in capsys.readouterr().err
    assert seen(tmp_path, "--records", str(path), "--unit", "g", "--dt", "0.01") == 1


@pytest.mark.mends("the channels of one file counted as earthquakes of their own")
def test_channels_of_a_file_are_of_one_earthquake(tmp_path):
    path = tmp_path / "station.csv"
    rows_ = (f"{0.01 * i:.2f},{np.sin(0.1 * i):.4f},{np.cos(0.2 * i):.4f}\n" for i in range(50))
    path.write_text("time (s),NS (g),EW (g)\n" + "".join(rows_))
    first, second = read_motions([str(path)])[0]
    assert first.event == second.event != ""


@pytest.mark.mends("of two folders of one name the first was lost")
def test_held_out_folders_of_one_name_are_two_groups(tmp_path):
    folders = [tmp_path / "one" / "q", tmp_path / "other" / "q"]
    for folder in folders:
        folder.mkdir(parents=True)
        at2(folder / "RSN1_AA090.AT2", "090")
    words = [str(folder) for folder in folders]
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
    for name in ("ns", "ew"):
        rows_ = (f"{0.01 * i:.2f},{np.sin(0.1 * i * len(name) + len(name)):.4f}\n" for i in range(50))
        (folder / f"{name}.csv").write_text("time (s),acc (g)\n" + "".join(rows_))
    files = [str(path) for path in sorted(folder.iterdir())]
    found, said = read_motions([str(folder)])
    assert [m.event for m in found] == ["quake", "quake"]
    assert "2 records of the folder" in " ".join(said)
    assert [m.event for m in read_motions(files, events=["A", "B"])[0]] == ["A", "B"]
    assert [m.event for m in read_motions(files, events=["A"])[0]] == ["A", "A"]
    found, said = read_motions(files)
    assert [m.event for m in found] == ["", ""]
    assert "2 name no earthquake" in " ".join(said)
    with pytest.raises(ValueError, match="`event` must have one name"):
        read_motions(files, events=["A", "B", "C"])
