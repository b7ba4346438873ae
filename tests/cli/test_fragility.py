"""`tpd fragility`: tables, fitted curves, runs without a solution, and files that state no unit."""

import re

import numpy as np
import pytest

from tests.cli.conftest import COLUMN, PENDULUM_OPTIONS
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


TIMELESS = "".join(f"{a:.5f}\n" for a in 0.3 * np.sin(0.1 * np.arange(200)))


def test_options_supply_the_unit_and_time_step_of_a_plain_record(run, tmp_path):
    folder = tmp_path / "quakes"
    folder.mkdir()
    (folder / "a.txt").write_text(TIMELESS)
    (folder / "a.VT2").write_text("VELOCITY TIME SERIES IN UNITS OF CM/S\n")
    words = ("fragility", COLUMN, "--scales", "1", "2", "--records", str(folder))
    assert "give `excitation.dt` (--dt) in s, such as 0.01" in run(*words).err
    assert "give `excitation.unit` (--unit), such as g" in run(*words, "--dt", "0.01").err
    done = run(*words, "--unit", "g", "--dt", "0.01")
    assert len(done.json("fragility.json")["motions"]) == 1
    assert "a.VT2 (velocity)" in done.out


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
    assert rates["edges"] == pytest.approx(np.geomspace(1.0, 3.0, 17) / 6.0)
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
