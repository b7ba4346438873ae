"""`tpd shake`: numbers of both sets of equations, files, and exit status."""

import io

import matplotlib
import numpy as np
import pytest

import tpd
from tests.cli.conftest import COLUMN, PENDULUM, call
from tpd.cli import shake
from tpd.core import files
from tpd.plots import response

PULSE = "--pulse one-sine --pulse-frequency 1.2375 --pga"
BLOCK = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)


def test_shake_says_what_the_library_says(run):
    done = run("shake", COLUMN, PENDULUM, PULSE, "0.4", "--free", "5")
    assert done.status == 0
    names = {"histories.csv", "histories.png", "impacts.csv", "animation.gif", "shake.json"}
    assert done.files.keys() == names
    results = done.json("shake.json")["results"]
    scene = tpd.Scene(BLOCK, tpd.Pulse.one_sine(acceleration=0.4 * 9.80665, frequency=1.2375))
    pendulum = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
    known = tpd.transient(scene, pendulum, free=5.0)
    # The nonlinear equations count, and the linear ones stand beside them.
    counts = tpd.transient(scene, pendulum, free=5.0, model=tpd.Nonlinear())
    ours = results["with the pendulum"]
    for name in ("tilt", "swing", "relative"):
        assert ours[name] == pytest.approx(float(getattr(counts, name)), rel=1e-12)
        assert ours["linear"][name] == pytest.approx(float(getattr(known, name)), rel=1e-12)
    assert results["bare block"]["status"] == "rocked"
    rows = [r for r in done.rows("histories.csv") if r["case"] == "with the pendulum"]
    assert max(abs(float(r["tilt_rad"])) for r in rows) == pytest.approx(float(known.tilt), rel=1e-4)
    assert "keeps the base from sliding" in done.out


def test_a_record_is_read_and_scaled(run, tmp_path):
    t = np.arange(300) * 0.01
    lines = [f"{x:.2f},{0.3 * np.sin(8.0 * x):.6f}" for x in t]
    (tmp_path / "record.csv").write_text("time (s),acceleration (g)\n" + "\n".join(lines) + "\n")
    done = run("shake", COLUMN, f"--record {tmp_path / 'record.csv'} --scale 1.2 --free 1")
    known = tpd.transient(tpd.Scene(BLOCK, tpd.Record.read(tmp_path / "record.csv").scaled(1.2)), free=1.0)
    linear = done.json("shake.json")["results"]["bare block"]["linear"]
    assert linear["tilt"] == pytest.approx(float(known.tilt), rel=1e-12)


def test_a_fall_is_the_exit_status(run):
    done = run("shake", COLUMN, PULSE, "0.5", "--free", "5")
    assert done.status == 3
    assert "overturned" in done.out
    assert done.json("shake.json")["results"]["bare block"]["tilt"] == "infinite"


@pytest.mark.mends("`tpd shake` gave the swing of the linear equations and did not say so")
def test_what_sizes_a_room_is_of_the_nonlinear_equations_and_impacts_have_a_stated_size(run):
    """Marble column in El Centro: the bob swings 0.443 rad, and 0.377 by the linear equations."""
    column = "--width 0.62 --height 5.2 --mass 4239 --friction 0 --restitution housner"
    bob = "--mass-ratio 0.05 --pendulum-length 1.3 --record el-centro"
    done = run("shake", column, bob)
    assert done.status == 0
    assert "nonlinear equations    linear equations" in done.out
    swings = [line.split()[-2:] for line in done.out.splitlines() if "swing" in line]
    assert swings == [["0.4428", "0.3769"]]
    results = done.json("shake.json")["results"]["with the pendulum"]
    assert results["swing"] == pytest.approx(0.4428, abs=1e-4)
    # 696 impacts with all hops of each rattle.
    strong, hits = results["linear"]["impacts_faster_than_rad_s"], done.rows("impacts.csv")
    pendulum = [abs(float(r["rate_after_rad_s"])) for r in hits if r["case"] == "with the pendulum"]
    assert results["linear"]["impacts"] == sum(rate > strong for rate in pendulum) < 0.5 * len(pendulum)
    assert f"impacts faster than {strong:.4g} rad/s" in done.out


@pytest.mark.mends("`tpd shake` ended with 0 where a motion had no answer")
def test_a_motion_without_an_answer_is_named(run, monkeypatch):
    follow, few = shake.transient, {"max_events": 1}
    monkeypatch.setattr(shake, "transient", lambda *a, **k: follow(*a, **{**k, **few}))
    done = run("shake", COLUMN, PULSE, "0.4", "--free", "1")
    assert done.status == 3
    assert "event_bound" in done.out
    assert "no answer" in done.out


@pytest.mark.mends("`text.usetex` in the settings of a user ended `tpd shake` with nothing written")
def test_numbers_are_written_before_pictures_which_cost_one_sentence_each(run, monkeypatch):
    def broken(*_, **how):
        raise RuntimeError("no such font\nat all")

    monkeypatch.setattr("tpd.plots.animation.animate", broken)
    with matplotlib.rc_context({"text.usetex": True, "font.family": ["No Such Font"]}):
        done = run("shake", COLUMN, PULSE, "0.4", "--free", "1")
    assert (done.status, done.err.count("tpd: ")) == (0, 1)
    assert "tpd: animation.gif is not drawn: no such font\n" in done.err
    written = [line.rpartition("/")[2] for line in done.out.splitlines() if line.startswith("written: ")]
    assert written == ["shake.json", "histories.csv", "impacts.csv", "histories.png"]


@pytest.mark.mends("a full disk named no file")
@pytest.mark.parametrize("left", [[], ["shake.json", "histories.csv"]])
def test_a_full_disk_names_the_file_and_leaves_no_half(run, monkeypatch, tmp_path, left):
    place, name = files.place, "impacts.csv" if left else "shake.json"

    def full(path, content):
        if path.name == name:
            monkeypatch.setattr(files, "open", lambda *_: io.FileIO("/dev/full", "w"), raising=False)
        return place(path, content)

    monkeypatch.setattr(files, "place", full)
    done = run("shake", COLUMN, PULSE, "0.4", "--free", "1")
    assert done.status == 2
    assert done.err.splitlines()[-1].endswith(f"out/{name}: No space left on device")
    assert done.files.keys() == {*left}
    assert (tmp_path / "out").exists() is bool(left)


@pytest.mark.mends(
    "a block that stands was marked as one that overturns, in every record of a step of 0.01 s"
)
def test_a_block_that_stands_has_no_empty_cell_and_no_mark(tmp_path, monkeypatch):
    drawn, plot = [], response.plot_motions
    monkeypatch.setattr(response, "plot_motions", lambda *a: drawn.append(plot(*a)) or drawn[-1])
    for i, (dt, n) in enumerate([(0.01, 1500), (0.01, 2311), (0.005, 3001), (0.02, 700)]):
        t = dt * np.arange(n)
        lines = [f"{x:.4f},{0.25 * np.sin(8.0 * x):.6f}" for x in t]
        (tmp_path / "record.csv").write_text("time (s),acceleration (g)\n" + "\n".join(lines) + "\n")
        done = call("shake", COLUMN, PENDULUM, f"--record {tmp_path / 'record.csv'}", out=tmp_path / str(i))
        results = done.json("shake.json")["results"]
        assert {x["linear"]["status"] for x in results.values()} == {"rocked"}
        rows = done.rows("histories.csv")
        assert all(np.isfinite(float(row[name])) for row in rows for name in row if name != "case")
        assert not [text for ax in drawn[-1] for text in ax.texts if text.get_text() == "overturns"]
