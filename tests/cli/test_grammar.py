"""Help of the commands: fast, with the texts of the schema, and with an example that runs."""

import os
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import tpd
from tests.cli.conftest import call
from tests.report.conftest import details, harmonic
from tpd.cli import grammar, main, optimise, parser
from tpd.cli.new import template

SMALL = {
    "response": "--points 8 --runs-from-rest 0",
    "map": "--points 3",
    "spectrum": "--points 3",
    "shake": "--free 1",
}
"""Options that make an example quick."""
STATUS = {"check": 3, "optimise": 3}
"""Exit statuses other than 0: `tpd check` rejects its pendulum, and the prepared design has no walls."""
WRITES = {
    "new": "mine.toml",
    "explore": "explore.html",
    "export": "model.xml",
    "optimise": "tower/report.html",
}
"""Files of the commands that do not write to the folder tpd-COMMAND."""


def help_of(capsys, *words: str, flag: str = "--help-all") -> str:
    """Return the help of a command with all options, or that of another flag."""
    with pytest.raises(SystemExit):
        main([*words, flag if words else "--help"])
    return capsys.readouterr().out


def test_help_and_version_do_not_import_jax():
    code = f"""
import sys
from tpd.cli import main
names = {[*grammar.COMMANDS]}
flags = "--help", "--help-all"
for words in (["--version"], ["--help"], *([name, flag] for name in names for flag in flags)):
    try:
        main(words)
    except SystemExit:
        pass
for name in ("jax", "numpy", "optax", "matplotlib"):
    assert name not in sys.modules, name
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"tpd {tpd.__version__}\n")


@pytest.mark.parametrize("command", grammar.COMMANDS)
def test_the_help_of_a_command_has_exit_statuses_single_defaults_and_an_example(command, capsys):
    short, all_options = (help_of(capsys, command, flag=flag) for flag in ("--help", "--help-all"))
    assert short.startswith(f"usage: tpd {command} [options] ")
    assert short.count("\n") <= 20
    assert f"tpd {command} --help-all" in short
    assert "Exit status: 0 " in " ".join(all_options.split())
    *_, before, example = all_options.rstrip().splitlines()
    assert before == "Example:"
    assert example == short.rstrip().splitlines()[-1]
    assert example.strip().startswith(f"tpd {command} ")
    for entry in re.split(r"\n  (?=-)", all_options):
        defaults = re.findall(r"\(default [^)]*\)", " ".join(entry.split("\n\n")[0].split()))
        assert len(defaults) == len({*defaults}), entry


@pytest.mark.parametrize("command", grammar.COMMANDS)
def test_the_example_of_every_help_page_runs(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    # A search takes long: a prepared design replaces it.
    monkeypatch.setattr(optimise, "solve_problem", lambda *_, **__: harmonic())
    monkeypatch.setattr("tpd.plots.results.draw", lambda *_: b"<svg/>")
    monkeypatch.setattr(optimise, "details", lambda *_, **__: replace(details(), histories=()))
    # Bifurcations take long as well, and are in the tests of `tpd response`.
    monkeypatch.setattr("tpd.answers.response.bifurcations", lambda *_, **__: ())
    few = "[ensemble]\nsize = 16\nperiods = 20\n[search]\nscreening = 8\n"
    text = re.sub(r"\[search\]\nseed.*\n|\[search\] .*\nseed.*\n", "", template("tower"))
    (tmp_path / "tower.toml").write_text(text.replace("[search]", "") + few)
    example = help_of(capsys, command).rstrip().splitlines()[-1].strip()
    done = call(*shlex.split(example)[1:], SMALL.get(command, ""))
    assert done.status == STATUS.get(command, 0), done.err
    if command in WRITES:
        assert (tmp_path / WRITES[command]).is_file()
    elif command not in ("assess", "check", "record"):
        assert list((tmp_path / f"tpd-{command}").glob("*.csv"))


def test_a_tilde_in_a_path_is_the_home_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    read = parser().parse_args(
        ["export", "~/design", "--scene", "~/job.toml", "--as", "csv", "--out", "~/a.csv"]
    )
    assert (read.design, read.scene, read.out) == tuple(tmp_path / x for x in ("design", "job.toml", "a.csv"))
    for command in ("new tower", "optimise", "response", "map --x mu 0 1 --y lam 0 1", "shake", "spectrum"):
        assert parser().parse_args([*command.split(), "--out=~/out"]).out == tmp_path / "out"
    assert parser().parse_args(["fragility"]).out == Path("tpd-fragility")


def test_python_m_tpd_runs_and_american_spelling_gets_a_hint():
    done = subprocess.run([sys.executable, "-m", "tpd", "optimize"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "did you mean `optimise`?" in done.stderr


@pytest.mark.parametrize(("line", "word"), [("tpd shake --rec", "--record")])
def test_the_shell_completes_commands_and_options(line, word, tmp_path):
    pytest.importorskip("argcomplete")
    # The scripts of argcomplete set these variables in a shell.
    variables = {
        "_ARGCOMPLETE": "1",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "_ARGCOMPLETE_IFS": " ",
    }
    env = os.environ | variables | {"_ARGCOMPLETE_STDOUT_FILENAME": str(tmp_path / "words")}
    done = subprocess.run([sys.executable, "-m", "tpd"], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert word in (tmp_path / "words").read_text().split()
