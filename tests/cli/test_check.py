"""`tpd check` of a pendulum of one's own and of a design: exit status, and the last line."""

import json

import pytest

from tests import designs
from tpd.cli import main
from tpd.report.json import as_json

TOWER = """
[block]
width = 2.0
height = 9.0
mass = 41500.0
radius_of_gyration = 2.7
friction = 0.02
[motion]
amplitude = 0.1
frequency = 0.8
[limits]
stroke = 0.5
"""
GOOD = ("--mass-ratio", "0.08", "--length-ratio", "0.22", "--pendulum-damping", "0.2")


def report(job, hung) -> str:
    """design.json of a job and a pendulum."""
    return json.dumps(json.loads(as_json(designs.single(), designs.study(), job)) | {"pendulum": hung})


@pytest.fixture
def check(tmp_path, capsys):
    """Run a check of a pendulum in the tower: exit status and what is printed."""
    (tmp_path / "tower.toml").write_text(TOWER)

    def run(*pendulum: str) -> tuple[int, list[str]]:
        status = main(["check", "--scene", str(tmp_path / "tower.toml"), "--quick", *pendulum])
        return status, capsys.readouterr().out.splitlines()

    return run


def test_a_pendulum_that_helps_and_fits_is_confirmed(check):
    status, said = check(*GOOD)
    assert status == 0
    assert said[0] == "Scene: a block of your own."
    assert said[4] == "  bob     3320 kg on a rod of 0.99 m; μ = 0.08, λ = 0.22, ζ = 0.2"
    assert said[-1] == "The nonlinear equations confirm this design from rest; it helps, and it fits."
    assert any("of 8 shakings within 1 % in amplitude or frequency: 0 overturn" in line for line in said)


def test_the_last_line_says_why_not(check):
    status, said = check("--pendulum-mass", "3320", "--pendulum-length", "0.5", "--pendulum-damping", "0.2")
    assert status == 3
    assert said[-1].startswith("does not fit: the bob as a solid ball of steel has a radius of 0.466 m")
    status, said = check("--pendulum-mass", "2000", "--pendulum-length", "4", "--pendulum-damping", "0.01")
    assert status == 3
    assert said[-1].startswith(("does not help: ", "does not fit: ", "DO NOT USE: "))


def test_a_design_s_directory_is_checked_as_the_options_are(check, tmp_path, capsys):
    _, expected = check(*GOOD)
    block = {"width": 2.0, "height": 9.0, "mass": 41500.0, "radius_of_gyration": 2.7, "friction": 0.02}
    job = {"block": block, "motion": {"amplitude": 0.1, "frequency": 0.8}}
    hung = {"mass": 3320.0, "length": 0.99, "damping_ratio": 0.2}
    (tmp_path / "design.json").write_text(report(job, hung))
    assert main(["check", str(tmp_path), "--quick"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[:5] == expected[:5]
    assert said[-3:] == expected[-3:]


def test_a_report_without_a_pendulum_is_confirmed_only_where_none_is_needed(tmp_path, capsys):
    for amplitude, status in ((0.001, 0), (0.015, 3)):
        (tmp_path / "design.json").write_text(report({"motion": {"amplitude": amplitude}}, None))
        assert main(["check", str(tmp_path), "--quick"]) == status
        last = capsys.readouterr().out.splitlines()[-1]
        assert last.startswith("does not help: " if status else "The report offers no pendulum, and the bare")
