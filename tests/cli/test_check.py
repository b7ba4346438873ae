"""`tpd check` of a pendulum of one's own and of a design: exit status, and the last line."""

import json
import tomllib

import pytest

from tests import designs
from tpd.cli import main
from tpd.cli.new import template
from tpd.design import job as jobs
from tpd.report.json import as_json

CHIMNEY = template("chimney").replace("at_least = 0.1 ", "runs = 64\nat_least = 0.1 ")
OFFERED = ("--pendulum-mass", "540", "--pendulum-length", "0.515", "--pendulum-damping", "0.5981")
"""A little less than what `tpd optimise` offers for this chimney."""
STRIKING = ("--pendulum-mass", "774.3", "--pendulum-length", "0.5733", "--pendulum-damping", "0.5941")
"""What its table has as the best from rest: from other starts it strikes a wall in a quarter of the runs."""


def report(job, hung) -> str:
    """design.json of a job and a pendulum."""
    return json.dumps(json.loads(as_json(designs.single(), designs.study(), job)) | {"pendulum": hung})


@pytest.fixture
def check(tmp_path, capsys):
    """Run a check of a pendulum in the chimney: exit status and what is printed."""
    (tmp_path / "chimney.toml").write_text(CHIMNEY)

    def run(*pendulum: str) -> tuple[int, list[str]]:
        status = main(["check", "--scene", str(tmp_path / "chimney.toml"), "--quick", *pendulum])
        return status, capsys.readouterr().out.splitlines()

    return run


def test_a_pendulum_that_helps_and_fits_is_confirmed(check):
    status, said = check(*OFFERED)
    assert status == 0
    assert said[0] == "Scene: a block of your own."
    assert said[4].startswith("  bob     540 kg on a rod of 0.515 m; μ = 0.03317, λ = 0.103, ζ = 0.5981")
    assert said[-1].startswith(
        "Worth hanging under the stated conditions, as `tpd optimise` asks it: it helps"
    )
    assert said[-3].startswith("Over 64 fresh paired runs of the nonlinear equations (seed 2): ")
    assert any("of 10 conditions: " in line for line in said)


@pytest.mark.mends("`tpd check` said that a pendulum fits which `tpd optimise` refuses for its strikes")
def test_the_last_line_says_why_not(check):
    status, said = check(*STRIKING)
    assert status == 3
    assert said[-1].startswith(
        "does not fit: by the paired runs of the nonlinear equations the bob strikes a"
    )
    assert " strikes a wall in 17 of the 63 that stand " in " ".join(said)


def test_a_limit_on_the_mass_below_the_least_bob_of_the_space_is_no_bad_input(tmp_path, capsys):
    (tmp_path / "job.toml").write_text(CHIMNEY.replace("# mass = 800.0", "mass = 60.0"))
    status = main(["check", "--scene", str(tmp_path / "job.toml"), "--quick", *OFFERED])
    said = capsys.readouterr().out
    assert status == 3
    assert "exceeds the limit on mass" in " ".join(said.split())


def test_without_walls_there_is_no_room_to_ask_for(check):
    status, said = check(*STRIKING, "--no-walls")
    assert status == 0
    assert said[-3].endswith("No room for the bob is asked for.")


def test_a_design_s_directory_is_checked_as_the_options_are(check, tmp_path, capsys):
    _, expected = check(*OFFERED)
    job = jobs.job_of(tomllib.loads(CHIMNEY)).tables
    hung = {"mass": 540.0, "length": 0.515, "damping_ratio": 0.5981}
    (tmp_path / "design.json").write_text(report(job, hung))
    assert main(["check", str(tmp_path), "--quick"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[:5] == expected[:5]
    assert said[-5:] == expected[-5:]


def test_a_report_without_a_pendulum_is_confirmed_only_where_none_is_needed(tmp_path, capsys):
    for amplitude, status in ((0.001, 0), (0.015, 3)):
        (tmp_path / "design.json").write_text(report({"motion": {"amplitude": amplitude}}, None))
        assert main(["check", str(tmp_path), "--quick"]) == status
        last = capsys.readouterr().out.splitlines()[-1]
        assert last.startswith(
            "does not help: "
            if status
            else "The report offers no pendulum, and under all conditions the bare"
        )


@pytest.mark.mends("a bare block that rests under the motion itself, and not beside it, needed no pendulum")
def test_none_is_needed_only_where_the_bare_block_rests_under_all_conditions(tmp_path, capsys):
    # The block lifts at 0.3 g: the motion itself has 0.29 g, and its neighbourhood 10 % more.
    (tmp_path / "design.json").write_text(report({"motion": {"amplitude": 0.01153}}, None))
    assert main(["check", str(tmp_path), "--quick"]) == 3
    assert "does not help: " in capsys.readouterr().out.splitlines()[-1]
