"""`tpd check` of a pendulum of one's own and of a design: exit status, and the last line."""

import tomllib

import pytest

from tests.cli.conftest import call, design_json
from tpd.cli.new import template
from tpd.design import job as jobs

CHIMNEY = template("chimney") + "\n[ensemble]\nsize = 1024\n"
OFFERED = "--pendulum-mass 540 --pendulum-length 0.515 --pendulum-damping 0.5981"
"""A little less than what `tpd optimise` offers for this chimney."""
STRIKING = "--pendulum-mass 774.3 --pendulum-length 0.5733 --pendulum-damping 0.5941"
"""What its table has as the best from rest: from other starts it strikes a wall in a quarter of the runs."""


@pytest.fixture(scope="module")
def check(tmp_path_factory):
    """Run a check of a pendulum in the chimney: exit status and what is printed."""
    file = tmp_path_factory.mktemp("chimney") / "chimney.toml"
    file.write_text(CHIMNEY)

    def run(*pendulum: str) -> tuple[int, list[str]]:
        done = call("check", "--scene", str(file), *pendulum)
        return done.status, done.out.splitlines()

    return run


@pytest.fixture(scope="module")
def offered(check):
    """The check of a pendulum that helps and fits."""
    return check(OFFERED)


def test_a_pendulum_that_helps_and_fits_is_confirmed(offered):
    status, said = offered
    assert status == 0
    assert said[0] == "Scene: a block of your own."
    assert said[6].startswith("  point   540 kg on a rod of 0.515 m; μ = 0.03317, λ = 0.103, ζ = 0.5981")
    assert [line.split()[0] for line in said[8:13]] == ["model", "uplift", "one", "exact", "nonlinear"]
    assert said[-1].startswith("RECOMMENDED for the stated conditions")
    assert any("paired runs of the nonlinear equations" in line for line in said)


@pytest.mark.mends("`tpd check` had no seed but that of an engine")
def test_a_seed_chooses_the_runs_of_a_check(check, offered):
    status, said = check(OFFERED, "--seed", "5")
    assert status == 0
    assert said[14:] != offered[1][14:]
    assert check(OFFERED, "--seed", "0")[1][14:] == offered[1][14:]


@pytest.mark.mends("`tpd check` said that a pendulum fits which `tpd optimise` refuses for its strikes")
def test_the_last_line_says_why_not(check):
    status, said = check(STRIKING)
    assert status == 3
    assert said[-1].startswith("NOT RECOMMENDED: the pendulum exceeds the limit on clearance")
    # Without walls there is no room to ask for.
    assert "exceeds the limit on clearance" not in "".join(check(STRIKING, "--no-walls")[1])


def test_a_limit_on_the_mass_below_the_least_bob_of_the_space_is_no_bad_input(tmp_path):
    (tmp_path / "job.toml").write_text(CHIMNEY.replace("# mass = 800.0", "mass = 60.0"))
    done = call("check", "--scene", str(tmp_path / "job.toml"), OFFERED)
    assert done.status == 3
    assert "limit on mass (bob as built): 10.2 times the limit" in " ".join(done.out.split())


def test_a_design_s_directory_is_checked_as_the_options_are(offered, tmp_path):
    job = jobs.job_of(tomllib.loads(CHIMNEY)).tables
    with_it = {"mass": 540.0, "length": 0.515, "damping_ratio": 0.5981}
    (tmp_path / "design.json").write_text(design_json(job, with_it))
    done = call("check", str(tmp_path))
    said, expected = done.out.splitlines(), offered[1]
    assert (done.status, said[:7], said[14:]) == (0, expected[:7], expected[14:])


@pytest.mark.mends("a bare block that rests under the motion itself, and not beside it, needed no pendulum")
def test_a_report_without_a_pendulum_is_confirmed_where_none_is_needed(tmp_path):
    # The block lifts at 0.3 g: the second motion itself has 0.29 g, and its neighbourhood 10 % more.
    needless = "NOT NEEDED: under all conditions"
    for amplitude, status, said in (
        (0.001, 0, needless),
        (0.01153, 3, "NOT RECOMMENDED: the report has no pendulum."),
    ):
        (tmp_path / "design.json").write_text(design_json({"motion": {"amplitude": amplitude}}))
        done = call("check", str(tmp_path))
        assert done.status == status
        assert done.out.splitlines()[-1].startswith(said)


@pytest.mark.mends("a bob of 554 kg as built was offered under a limit of 500 kg, with exit status 0")
@pytest.mark.parametrize("walls", ["", "--no-walls"])
def test_a_bob_that_exceeds_the_limit_on_the_mass_as_built_is_refused(tmp_path, walls):
    """The point of 540 kg is below the limit of 560 kg, and its body of steel is not."""
    (tmp_path / "job.toml").write_text(CHIMNEY.replace("# mass = 800.0", "mass = 560.0"))
    done = call("check", "--scene", str(tmp_path / "job.toml"), *walls.split(), OFFERED)
    said = " ".join(done.out.split())
    assert done.status == 3
    assert said.endswith(
        "NOT RECOMMENDED: the design exceeds the limit on mass (bob as built): 1.1 times the limit."
    )
