"""Each help ends with one example, and the example runs."""

import re
import shlex
import subprocess
import sys

import pytest

from tpd.cli import main
from tpd.cli.new import template

EVERY = ("new", "optimise", "check", "response", "map", "shake", "spectrum", "fragility", "export")
SMALL = {
    "optimise": ("--searches", "1", "--steps", "2"),
    "response": ("--points", "8", "--from-rest", "0"),
    "map": ("--points", "4"),
    "spectrum": ("--points", "4"),
    "shake": ("--free", "1"),
}
"""Options that make an example quick."""
WRITES = {
    "new": "mine.toml",
    "optimise": "tower/report.txt",
    "response": "tpd-response/branches.csv",
    "map": "tpd-map/map.csv",
    "shake": "tpd-shake/histories.csv",
    "spectrum": "tpd-spectrum/spectrum.csv",
    "fragility": "tpd-fragility/fragility.csv",
    "export": "model.xml",
}
STATUS = {"optimise": 3, "check": 3}
"""Exit statuses that are not 0: two steps of a search find no pendulum, and any pendulum is checked."""


@pytest.mark.parametrize("command", EVERY)
def test_an_example_runs(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    few = "[ensemble]\nsize = 16\nperiods = 20\n[search]\nscreening = 8\n"
    text = re.sub(r"\[search\]\nseed.*\n|\[search\] .*\nseed.*\n", "", template("tower"))
    (tmp_path / "tower.toml").write_text(text.replace("[search]", "") + few)
    with pytest.raises(SystemExit):
        main([command, "--help"])
    said = capsys.readouterr().out
    example = said.rstrip().splitlines()[-1].strip()
    assert said.rstrip().splitlines()[-2] == "Example:"
    assert example.startswith(f"tpd {command} ")
    words = [*shlex.split(example)[1:], *SMALL.get(command, ())]
    # A search compiles with more of the stack than a test has left.
    search = [sys.executable, "-m", "tpd.cli", *words]
    status = subprocess.run(search).returncode if command == "optimise" else main(words)
    assert status == STATUS.get(command, 0)
    assert command not in WRITES or (tmp_path / WRITES[command]).is_file()
