"""`tpd response`: branches and motions from rest agree with the library."""

import dataclasses
import math
import re

import numpy as np
import pytest

import tpd
from tpd.answers.motion_history import motion_history
from tpd.answers.response import branches, frequencies
from tpd.scene.conditions import train_of

RANGE = "--from 1.7 --to 3 --points 24 --runs-from-rest 2 --pendulum-mass 0.8 --length-ratio 0.5"


def test_response_writes_the_branches_of_the_library(run):
    done = run("response", RANGE)
    assert done.status == 0
    assert all(line.startswith("tpd: ") for line in done.err.splitlines())
    names = {"branches.csv", "branches.png", "response.json", "response.csv", "response.png"}
    assert done.files.keys() == names | {"response_near.png"}
    pattern = "runs from rest between {} Hz that overturn: [0-9]+ % without the pendulum, [0-9]+ % with the"
    for between in ("2.38 and 2.62", "1.75 and 3"):
        assert re.search(pattern.format(between), done.out)
    scene = tpd.paper_scene()
    trains = [train_of(scene.excitation, frequency=f / 2.5) for f in (1.7, 3.0)]
    needed = max(motion_history(dataclasses.replace(scene, excitation=x)).needed_friction for x in trains)
    assert f"a coefficient of friction of {needed:.4g} without a pendulum and" in " ".join(done.out.split())
    settled = done.rows("response.csv")
    assert [float(r["frequency_Hz"]) for r in settled] == frequencies(2.5, 1.7, 3.0, 2).tolist()
    for r in settled:
        assert math.isinf(float(r["with_amplitude_rad"])) == (r["with_status"] == "overturned")
    pendulum = tpd.Pendulum(mass=0.8, length=0.1, damping_ratio=0.1)
    expected = branches(tpd.paper_scene(), "frequency", 1.7, 3.0, pendulum=pendulum, samples=24)
    content = done.json("response.json")
    bifurcations = content["bifurcations"]["with the pendulum"]
    assert [b["value"] for b in bifurcations] == [b.value for b in expected.bifurcations] != []
    assert content["pendulum"]["length"] == pytest.approx(0.1)
    assert content["over"] == "frequency"
    rows = done.rows("branches.csv")
    first = [r for r in rows if r["case"] == "with the pendulum" and r["branch"] == "0"]
    at, s = expected.sweep.line(0), expected.sweep
    np.testing.assert_array_equal([float(r["amplitude_rad"]) for r in first], s.amplitude[at])
    np.testing.assert_array_equal([float(r["frequency"]) for r in first], s.value[at[0]])
    assert {r["case"] for r in rows} == {"without a pendulum", "with the pendulum"}
    assert "already contains files" in run("response", RANGE).err


def test_a_dimensionless_sweep_keeps_the_acceleration(run):
    done = run("response", "--from 2.6 --to 3 --points 8 --dimensionless --runs-from-rest 0")
    assert done.status == 0
    assert "without a pendulum: 1 branches from 2.6 to 3\n" in done.out
    assert "Run the command with --runs-from-rest N to find out" in done.out
    expected = branches(tpd.paper_scene().parameters(), "xi", 2.6, 3.0, samples=8).sweep
    amplitudes = [float(r["amplitude_rad"]) for r in done.rows("branches.csv")]
    np.testing.assert_array_equal(amplitudes, expected.amplitude[:, 0])
