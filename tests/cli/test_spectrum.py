"""`tpd spectrum` of a pulse and of a record: files, shares, and runs without a solution."""

import numpy as np

from tests.cli.conftest import COLUMN, PENDULUM_OPTIONS
from tests.unanswered import unanswered


def test_spectrum_accepts_a_pulse_or_a_record(run):
    done = run("spectrum", COLUMN, PENDULUM_OPTIONS, "--pulse", "ricker", "--points", "5")
    assert done.status == 0
    assert done.files.keys() == {"spectrum.csv", "spectrum.json", "spectrum.png"}
    assert len(done.rows("spectrum.csv")) == 25
    assert "pulses under which the block does not overturn: " in done.out
    record = "--record el-centro --points 3 --overwrite"
    done = run("spectrum", COLUMN, PENDULUM_OPTIONS, record)
    assert done.status == 0
    assert [float(r["period_s"]) for r in done.rows("spectrum.csv")] == np.linspace(0.5, 12.0, 3).tolist()


def test_runs_without_a_solution_are_reported(run, monkeypatch):
    # These are all motions above 3 g tan alpha.
    unanswered(monkeypatch, lambda rows: rows[:, 5] > 0.5)
    done = run("spectrum", COLUMN, PENDULUM_OPTIONS, "--pulse one-sine --points 4 --sizes-to 5")
    assert done.status == 0
    assert "pulses without a solution: 8 of 16 without a pendulum, 8 of 16 with the pendulum" in done.out
    # The block stands under six of the eight pulses with a solution, and perhaps under the other eight.
    both = "37.5 to 87.5 % without a pendulum, 37.5 to 87.5 % with the pendulum"
    assert f"does not overturn: {both}" in done.out
    assert done.json("spectrum.json")["undecided"] == [8, 8]
    assert [r["without_pendulum"] for r in done.rows("spectrum.csv")].count("-1") == 8
    done = run("spectrum", COLUMN, "--record el-centro --scale 2 --points 3 --overwrite")
    assert done.status == 0
    assert "blocks without a solution: 3 of 3 without a pendulum" in done.out
    assert {r["without_pendulum"] for r in done.rows("spectrum.csv")} == {""}
