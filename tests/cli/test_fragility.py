"""`tpd fragility`: tables, fitted curves, runs without a solution, and files that state no unit."""

import re
from pathlib import Path

import numpy as np
import pytest

import tpd
from tests.cli.conftest import COLUMN, PENDULUM_OPTIONS
from tests.unanswered import unanswered
from tpd.design.job import job_of
from tpd.records import el_centro
from tpd.scene.hazard import HOW_TO

TWO = "--records el-centro loma-prieta --scales 1 4 8"


def test_fragility_counts_damage_for_each_case_and_intensity(run):
    done = run("fragility", COLUMN, PENDULUM_OPTIONS, TWO)
    assert done.status == 0
    table = done.rows("fragility.csv")
    # There are two cases, three damage states and three intensities.
    assert len(table) == 18
    assert {r["total"] for r in table} == {"2"}
    states = {"rocking", "half", "overturned"}
    assert {"fragility.json", *(f"fragility_{x}.png" for x in states)} < done.files.keys()
    content = done.json("fragility.json")
    assert content["motions"][0].startswith("El Centro")
    assert set(content["fits"]) == set(content["p_values"]) == states
    assert re.search(
        r"overturned  without pendulum +\d of 6\n +overturned +with pendulum +\d of 6\n", done.out
    )
    assert "With fewer than 5 earthquakes these counts do not predict other earthquakes." in done.out


def test_fragility_compares_the_needed_friction_with_the_friction_of_the_base(run):
    block = "--width 0.55 --height 1.8 --mass 700 --base-friction 0.34 --intensity pga"
    done = run("fragility", block, "--records el-centro --scales 0.32 0.45")
    needs = "the base needs a coefficient of friction of 0.3403 without a pendulum, but has 0.34"
    assert f"SLIDES WHILE IT ROCKS: {needs}" in " ".join(done.out.split())


def test_runs_without_a_solution_are_reported(run, monkeypatch):
    # These are all motions above 3 g tan alpha.
    unanswered(monkeypatch, lambda rows: rows[:, 5] > 0.5)
    done = run("fragility", COLUMN, PENDULUM_OPTIONS, TWO)
    assert done.status == 0
    assert re.search("4 of 6 runs without pendulum, 4 of 6 runs with pendulum", done.out)
    assert done.json("fragility.json")["fits"]["overturned"]["with_pendulum"]["undecided"] == 4
    rows = [
        r for r in done.rows("fragility.csv") if (r["state"], r["case"]) == ("overturned", "without_pendulum")
    ]
    assert [r["undecided"] for r in rows] == ["0", "2", "2"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--scales", "2", "1"), "increasing numbers"),
        (("--intensity", "x"), "`intensity` must be"),
        (
            ("--intensity", "pga", "--scales", "10", "30"),
            "of `scales` must be at most 10 g, but is 30 g: is it in g?",
        ),
    ],
)
def test_invalid_intensity_levels_are_rejected(run, words, sentence):
    done = run("fragility", COLUMN, "--records", "el-centro", *words)
    assert (done.status, done.files, len(done.err.splitlines())) == (2, {}, 1)
    assert sentence in done.err


TIMELESS = "".join(f"{a:.5f}\n" for a in 0.3 * np.sin(0.1 * np.arange(200)))


def test_options_supply_the_unit_and_time_step_of_a_plain_record(run, tmp_path):
    folder = tmp_path / "quakes"
    folder.mkdir()
    (folder / "a.txt").write_text(TIMELESS)
    (folder / "a.VT2").write_text("VELOCITY TIME SERIES IN UNITS OF CM/S\n")
    words = ("fragility", COLUMN, "--scales", "1", "2", "--records", str(folder))
    assert "give `excitation.dt` (--dt) in s, such as dt = 0.01" in run(*words).err
    assert "give `excitation.unit` (--unit), such as unit = 'g'" in run(*words, "--dt", "0.01").err
    done = run(*words, "--unit", "g", "--dt", "0.01")
    assert len(done.json("fragility.json")["motions"]) == 1
    assert "a.VT2 (velocity)" in done.out


def test_validation_folders_with_equal_names_are_separate_groups(tmp_path):
    words = [str(tmp_path / name / "q") for name in ("one", "other")]
    for word in words:
        Path(word).mkdir(parents=True)
        Path(word, "a.txt").write_text(TIMELESS)
    job = job_of(
        {"excitation": {"records": ["el-centro"], "validation_share": words, "unit": "g", "dt": 0.01}}
    )
    assert set(job.validation_share) == set(words)


@pytest.mark.parametrize("words", ["pga", "sa --period 0.5"])
def test_fragility_prints_accelerations_in_g_with_the_unit(run, words):
    done = run("fragility", COLUMN, "--records el-centro --scales 0.2 0.6 --intensity", words)
    assert (
        f"fragility over {done.json('fragility.json')['intensity']} (g), 1 motions of one earthquake"
        in done.out
    )
    assert done.json("fragility.json")["unit"] == "g"
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
    how = {"intensity": "pga"} if words == "pga" else {"intensity": "sa", "period": 0.5}
    curves = tpd.fragility(block, [el_centro()], scales=[0.2, 0.6], gravity=9.81, **how)
    shares = [float(r["shares"]) for r in done.rows("fragility.csv")]
    assert shares == pytest.approx(curves.columns()["shares"].tolist())
    assert curves.unit == "g"


SITE = """
[block]
width = 1.0
height = 6.0
mass = 9000.0
restitution = 0.95
[excitation]
records = ["el-centro", "loma-prieta"]
scales = [1, 2, 3]
[hazard]
levels = [0.1, 1.0]
rates = [0.02, 6e-5]
"""


def test_a_hazard_adds_the_annual_rates(run, tmp_path):
    (tmp_path / "site.toml").write_text(SITE)
    done = run("fragility --scene", str(tmp_path / "site.toml"), PENDULUM_OPTIONS)
    rates = done.json("fragility.json")["annual_rates"]
    assert rates["stripes"] == pytest.approx(np.array([1.0, 2.0, 3.0]) / 6.0)
    assert [set(rate) for rate in (*rates["cases"], rates["ratio"])] == [{"mean", "low", "high"}] * 3
    assert "The block overturns " in done.out
    assert HOW_TO not in done.out
    # The intensity of the hazard is checked before the runs.
    other = run("fragility --scene", str(tmp_path / "site.toml"), "--intensity pgv --overwrite")
    sentence = (
        "tpd: hazard and ground motions must have the same `intensity`, but they have PGA in g and PGV: "
        "state `scales` in this measure"
    )
    assert (other.status, other.err.splitlines()[-1]) == (2, sentence)


def test_without_a_hazard_a_line_explains_the_annual_rate(run):
    done = run("fragility", COLUMN, "--records el-centro --scales 1 4")
    assert f"{HOW_TO}." in " ".join(done.out.split())
    assert done.json("fragility.json")["annual_rates"] is None


def test_the_default_intensity_measure_is_explained_once(run):
    text = run("fragility", COLUMN, "--records el-centro --scales 1 4").out
    assert text.count("1 = the acceleration that lifts the block") == 1
