"""`tpd export`: the files are those of the library, and no file is replaced unasked."""

import csv

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.cli import main
from tpd.report.json import as_json

JOB = {"block": {"friction": 0.05}}


@pytest.fixture
def report(tmp_path, monkeypatch):
    """Directory of a report."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "design.json").write_text(as_json(designs.single(), designs.study(), JOB))
    return "report"


def columns(path) -> dict[str, np.ndarray]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def test_models_are_those_of_the_library(report, tmp_path, capsys):
    scene = tpd.paper_scene()
    for kind, name in (("mjcf", "model.xml"), ("opensees", "model.tcl")):
        assert main(["export", report, "--as", kind]) == 0
        assert capsys.readouterr().out.endswith(f"written: {name}\n")
        assert (tmp_path / name).read_text() == getattr(tpd.engines, kind)(scene, designs.HUNG)
    ratios = ("--mass-ratio", "0.1", "--length-ratio", "0.6", "--file", "own/model.tcl", "--sliding", "0.7")
    assert main(["export", "--as", "opensees", *ratios]) == 0
    hung = scene.pendulum(mass_ratio=0.1, length_ratio=0.6, damping_ratio=0.1)
    assert (tmp_path / "own" / "model.tcl").read_text() == tpd.engines.opensees(scene, hung, sliding=0.7)


def test_histories_are_bare_and_hung(report, tmp_path):
    assert main(["export", report, "--as", "csv"]) == 0
    found = columns(tmp_path / "histories.csv")
    assert list(found) == ["time_s", "base_m", "base_m_s2", "bare_phi_rad", "hung_phi_rad", "hung_psi_rad"]
    wave = 0.015 * np.sin(2.0 * np.pi * 2.5 * found["time_s"])
    np.testing.assert_allclose(found["base_m"], wave, atol=1e-12)
    assert np.abs(found["hung_psi_rad"]).max() > 0.1
    pulse = ("--pulse", "one-sine", "--pulse-frequency", "2", "--pga", "0.5", "--overwrite")
    assert main(["export", report, "--as", "csv", *pulse]) == 0
    found = columns(tmp_path / "histories.csv")
    assert list(found) == ["time_s", "base_m_s2", "bare_phi_rad", "hung_phi_rad", "hung_psi_rad"]
    assert found["base_m_s2"].max() == pytest.approx(0.5 * 9.80665, rel=1e-4)


def test_history_that_ends_says_so(report, tmp_path, capsys):
    strong = ("--pulse", "one-sine", "--pulse-frequency", "1", "--pga", "3", "--overwrite")
    assert main(["export", report, "--as", "csv", *strong]) == 0
    assert "bare_phi_rad: the block overturns, and the cells after that are empty" in capsys.readouterr().out


def test_bad_input_is_one_sentence(report, tmp_path, capsys):
    (tmp_path / "model.xml").write_text("keep me")
    for words, sentence in (
        ((report, "--as", "mjcf"), "model.xml exists already: choose another name with --file"),
        ((report, "--as", "csv", "--mass-ratio", "0.1"), "report has a scene and a pendulum: give it alone"),
        (
            (report, "--as", "csv", "--pulse", "ricker"),
            "a pulse needs `motion.pulse` (--pulse KIND) and `motion.pulse_frequency`",
        ),
        ((report, "--as", "opensees", "--sliding", "0"), "`sliding` must be positive"),
        ((report, "--as", "csv", "--scale", "5"), "`motion.scales` goes with a pulse or records"),
        ((report, "--as", "csv", "--dt", "0.01"), "records need `motion.records` (--records FILE)"),
        ((report, "--as", "csv", "--sliding", "0.5"), "--sliding is of a model of MuJoCo or OpenSees"),
        (
            ("--as", "csv", "--pulse", "ricker", "--amplitude", "1"),
            "[motion] has keys of a pulse (`pulse`) and of a harmonic motion (`amplitude`)",
        ),
        ((report, "--as", "csv", "--file", "."), "--file must name a file, but . is a directory"),
        (("absent", "--as", "csv"), "cannot read absent: No such file or directory"),
    ):
        assert main(["export", *words]) == 2
        assert sentence in capsys.readouterr().err
    assert (tmp_path / "model.xml").read_text() == "keep me"


def test_model_without_motion_needs_none(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    block = ("--width", "1", "--height", "6", "--mass", "9000")
    assert main(["export", *block, "--as", "mjcf"]) == 0
    assert "motion  none" in capsys.readouterr().out
    assert 'mass="9000.0"' in (tmp_path / "model.xml").read_text()
