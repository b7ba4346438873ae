"""`tpd shake`: results of both sets of equations, files and exit status."""

import io
import math

import pytest

import tpd
from tests.cli.conftest import COLUMN, PENDULUM_OPTIONS
from tpd.cli import shake
from tpd.core import files

PULSE = "--pulse one-sine --pulse-frequency 1.2375 --pga"
BLOCK = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)


def test_shake_writes_the_results_of_the_library(run):
    done = run("shake", COLUMN, PENDULUM_OPTIONS, PULSE, "0.4", "--free", "5")
    assert done.status == 0
    names = {"histories.csv", "histories.png", "impacts.csv", "shake.json"}
    assert done.files.keys() == names
    results = done.json("shake.json")["results"]
    scene = tpd.Scene(BLOCK, tpd.Pulse.one_sine(acceleration=0.4 * 9.80665, frequency=1.2375))
    pendulum = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
    linear = tpd.transient(scene, pendulum, free=5.0)
    # The nonlinear model decides. The linear results are listed for comparison.
    nonlinear = tpd.transient(scene, pendulum, free=5.0, model=tpd.Nonlinear())
    printed = results["with the pendulum"]
    for name in ("tilt", "swing", "rod_angle"):
        assert printed[name] == pytest.approx(float(getattr(nonlinear, name)), rel=1e-12)
        assert printed["linear"][name] == pytest.approx(float(getattr(linear, name)), rel=1e-12)
    assert results["without a pendulum"]["status"] == "rocked"
    rows = [r for r in done.rows("histories.csv") if r["case"] == "with the pendulum"]
    assert max(abs(float(r["tilt_rad"])) for r in rows) == pytest.approx(float(linear.tilt), rel=1e-4)
    assert "friction coefficient to prevent sliding" in done.out


def test_shake_prints_the_swing_of_both_models_and_counts_strong_impacts(run):
    """A marble column under El Centro: the bob swings 0.443 rad, but 0.377 rad by the linear model."""
    column = "--width 0.62 --height 5.2 --mass 4239 --friction 0 --restitution housner"
    bob = "--mass-ratio 0.05 --pendulum-length 1.3 --record el-centro"
    done = run("shake", column, bob)
    assert done.status == 0
    assert "nonlinear model        linear model" in done.out
    swings = [line.split()[-2:] for line in done.out.splitlines() if "largest swing" in line]
    assert swings == [["0.4428", "0.3769"]]
    results = done.json("shake.json")["results"]["with the pendulum"]
    assert results["swing"] == pytest.approx(0.4428, abs=1e-4)
    # A block that comes to rest makes hundreds of weak impacts, which the table of impacts contains.
    strong, hits = results["linear"]["impacts_faster_than_rad_s"], done.rows("impacts.csv")
    pendulum = [abs(float(r["rate_after_rad_s"])) for r in hits if r["case"] == "with the pendulum"]
    assert results["linear"]["impacts"] == sum(rate > strong for rate in pendulum) < 0.5 * len(pendulum)
    assert f"impacts faster than {strong:.4g} rad/s" in done.out


def test_a_motion_without_a_solution_is_reported(run, monkeypatch):
    follow, few = shake.transient, {"max_events": 1}
    monkeypatch.setattr(shake, "transient", lambda *a, **k: follow(*a, **{**k, **few}))
    done = run("shake", COLUMN, PULSE, "0.4", "--free", "1")
    assert done.status == 3
    assert "event_bound" in done.out
    assert "model has no result" in done.out


def test_a_full_disk_is_reported_with_the_file_and_leaves_no_part_of_it(run, monkeypatch, tmp_path):
    place = files.place

    def full(path, content, of="", **how):
        if path.name == "impacts.csv":
            monkeypatch.setattr(files, "open", lambda *_: io.FileIO("/dev/full", "w"), raising=False)
        return place(path, content, of, **how)

    monkeypatch.setattr(files, "place", full)
    done = run("shake", COLUMN, PULSE, "0.4", "--free", "1")
    assert done.status == 2
    assert done.err.splitlines()[-1].endswith("out/impacts.csv: No space left on device")
    written = [f"written: {tmp_path}/out/{name}" for name in ("shake.json", "histories.csv")]
    assert done.out.splitlines()[-2:] == written
    # The files that were complete are removed as well.
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("tilts", "sentence"),
    [
        ((0.1, 0.12), "With the pendulum the largest tilt is 20 % larger (nonlinear model)."),
        ((math.inf, math.inf), "The block overturns in both cases."),
        ((0.1, math.inf), "The block overturns only with the pendulum."),
        ((0.0, 0.0), "The block does not lift in either case."),
        ((0.0, 0.1), "The block lifts only with the pendulum."),
        ((0.1, 0.0), "With the pendulum the largest tilt is 100 % smaller (nonlinear model)."),
        ((math.nan, 0.1), ""),
    ],
)
def test_the_last_sentence_compares_the_tilts_with_and_without_pendulum(tilts, sentence):
    assert shake.difference(*tilts) == sentence
