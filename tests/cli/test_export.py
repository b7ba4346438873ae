"""`tpd export`: the files agree with the library, and no file is replaced without --overwrite."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import tpd
from tests.cli.conftest import PENDULUM, call, design_json


@pytest.fixture
def report(tmp_path, monkeypatch):
    """Return the folder of a report."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "report").mkdir()
    text = design_json({"block": {"friction": 0.05}}, vars(PENDULUM))
    (tmp_path / "report" / "design.json").write_text(text)
    return "report"


def columns(path) -> dict[str, np.ndarray]:
    """Return the columns of a table by name, NaN for empty cells."""
    rows = list(csv.DictReader(path.read_text().splitlines()))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def test_exported_models_equal_the_models_of_the_library(report, tmp_path):
    scene = tpd.paper_scene()
    for kind, name in (("mjcf", "model.xml"), ("opensees", "model.tcl")):
        done = call("export", report, "--as", kind)
        assert (done.status, done.out.splitlines()[-1]) == (0, f"written: {name}")
        assert (tmp_path / name).read_text() == getattr(tpd.engines, kind)(scene, PENDULUM)
    ratios = "--mass-ratio 0.1 --length-ratio 0.6 --out own/model.tcl --base-friction"
    assert call("export", "--as", "opensees", ratios, "0.7").status == 0
    pendulum = scene.pendulum(mass_ratio=0.1, length_ratio=0.6, damping_ratio=0.1)
    assert (tmp_path / "own" / "model.tcl").read_text() == tpd.engines.opensees(scene, pendulum, sliding=0.7)
    assert (
        "[block] `base_friction` must be positive"
        in call("export", "--as", "mjcf", ratios, "0", "--overwrite").err
    )


def test_exported_histories_contain_both_cases(report, tmp_path):
    assert call("export", report, "--as", "csv").status == 0
    table = columns(tmp_path / "histories.csv")
    assert list(table) == [
        "time_s",
        "base_m",
        "base_m_s2",
        "without_tilt_rad",
        "with_tilt_rad",
        "with_swing_rad",
    ]
    wave = 0.015 * np.sin(2.0 * np.pi * 2.5 * table["time_s"])
    np.testing.assert_allclose(table["base_m"], wave, atol=1e-12)
    assert np.abs(table["with_swing_rad"]).max() > 0.1
    pulse = "--pulse one-sine --pulse-frequency 2 --pga 0.5 --overwrite"
    assert call("export", report, "--as", "csv", pulse).status == 0
    table = columns(tmp_path / "histories.csv")
    assert list(table) == ["time_s", "base_m_s2", "without_tilt_rad", "with_tilt_rad", "with_swing_rad"]
    assert table["base_m_s2"].max() == pytest.approx(0.5 * 9.80665, rel=1e-4)
    done = call("export", report, "--as csv", pulse.replace("2 --pga 0.5", "1 --pga 2"))
    assert "without_tilt_rad: the block overturns; the cells after that time are empty" in done.out


def test_a_model_can_be_exported_without_an_excitation(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = call("export --width 1 --height 6 --mass 9000 --as mjcf")
    assert done.status == 0
    assert "excitation  none" in done.out
    assert 'mass="9000.0"' in (tmp_path / "model.xml").read_text()


@pytest.mark.parametrize(
    "words", ["export --as opensees --width 1 --height 6 --mass 9000 --record el-centro", "record el-centro"]
)
def test_export_of_a_model_does_not_import_jax(words, tmp_path):
    code = f"import sys; from tpd.cli import main; print(main({words.split()}), 'jax' in sys.modules)"
    env = os.environ | {"PYTHONPATH": str(Path(tpd.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, env=env)
    assert done.stdout.splitlines()[-1] == "0 False", done.stderr
