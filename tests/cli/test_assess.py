"""`tpd assess`: header, verdict and exit status."""

import pytest

from tests.cli.conftest import call
from tpd.cli.new import template


@pytest.mark.parametrize(
    ("motion", "first"),
    [
        ("--amplitude 0.004", "NOT NEEDED: under all conditions the block without a pendulum stays at rest"),
        ("--base-friction 0.1", "NOT APPLICABLE: the block slides on its base before it lifts"),
        ("", "OVERTURNS in "),
    ],
)
def test_the_block_alone_comes_first(motion, first, tmp_path):
    (tmp_path / "job.toml").write_text(template("statue") + "\n[ensemble]\nsize = 64\nperiods = 30\n")
    done = call("assess", str(tmp_path / "job.toml"), *motion.split())
    header, answer = done.out.split("\n\n")
    assert done.status == 0
    names = [line.split()[0] for line in header.splitlines() if not line.startswith(" " * 10)]
    assert names == ["block", "motion", "losses", "lifts", "slides"]
    assert answer.startswith(first)
    measures = "Each of these measures prevents uplift without a pendulum: a tie"
    assert (measures in answer) is first.startswith("OVER")
    assert max(map(len, answer.splitlines())) <= 100


def test_records_need_no_cavity():
    words = "--width 0.9 --height 5.4 --mass 8000 --records el-centro --scales 1.5"
    done = call("assess", *words.split())
    assert done.status == 0
    assert "the excitation reaches 0.25 g, 1.5 times as much: the block lifts" in done.out
