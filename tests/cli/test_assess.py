"""`tpd assess`: header, verdict and exit status."""

import pytest

from tests.cli.conftest import call
from tests.cli.test_fragility import SITE
from tpd.cli.new import template
from tpd.scene.hazard import HOW_TO


@pytest.mark.parametrize(
    ("motion", "first"),
    [
        ("--amplitude 0.004", "NOT NEEDED: under all conditions the block without a pendulum stays at rest"),
        ("--base-friction 0.1", "NOT APPLICABLE: the block slides on its base before it lifts"),
        ("", "Stated block from rest: OVERTURNS in 60.0 % of 10 runs."),
    ],
)
def test_assess_prints_uplift_and_sliding_before_the_outcome(motion, first, tmp_path):
    (tmp_path / "job.toml").write_text(template("statue") + "\n[ensemble]\nsize = 64\nperiods = 30\n")
    done = call("assess", str(tmp_path / "job.toml"), *motion.split())
    header, answer = done.out.split("\n\n")
    assert done.status == 0
    names = [line.split()[0] for line in header.splitlines() if not line.startswith(" " * 10)]
    assert names == ["block", "excitation", "losses", "uplift", "sliding"]
    assert answer.startswith(first)
    measures = "Each of these measures prevents uplift without a pendulum: at "
    assert (measures in answer) is first.startswith("Stated")
    assert max(map(len, answer.splitlines())) <= 100


SMALL = "--width 0.55 --height 1.8 --mass 700 --intensity pga"


def answer_of(words: str) -> str:
    """Return the sentences of `tpd assess` about the small block as one line."""
    return " ".join(call("assess", SMALL, words).out.split("\n\n")[1].split())


def test_sliding_during_rocking_is_reported_first():
    needs = "the base needs a coefficient of friction of 0.3403 without a pendulum"
    words = "--records el-centro --scales 0.45 --base-friction"
    assert answer_of(f"{words} 0.32").startswith(f"SLIDES WHILE IT ROCKS: {needs}, but has 0.32.")
    # Digits that decide.
    assert "of 0.34033 without a pendulum, but has 0.3403." in answer_of(f"{words} 0.3403")
    enough = answer_of(f"{words} 0.35")
    assert enough.startswith("Stated block")
    assert f"While the block rocks from rest, {needs}, and has 0.35 (linear model)." in enough
    assert f"{needs} (linear model)." in answer_of("--records el-centro --scales 0.45")


def test_the_annual_rate_is_printed_if_the_job_has_a_hazard(tmp_path):
    path = tmp_path / "site.toml"
    path.write_text(SITE)
    answer = " ".join(call("assess", str(path)).out.split())
    assert "The block overturns " in answer
    path.write_text(SITE.partition("[hazard]")[0])
    assert f"{HOW_TO}." in " ".join(call("assess", str(path)).out.split())
