"""What the README shows, runs: its example, its scene file, and the commands CI takes from it."""

import re
import tomllib
from pathlib import Path

import tpd
from tpd.cli import parser
from tpd.design.job import build

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """The fenced blocks of a language."""
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_python_example_runs(capsys):
    (example,) = blocks("python")
    exec(compile(example, "README.md", "exec"), {})
    amplitude, slope = (float(x) for x in capsys.readouterr().out.split())
    assert 0.05 < amplitude < 0.15
    assert slope != 0.0


def test_the_scene_files_are_valid():
    tower, many = (build(tomllib.loads(block)) for block in blocks("toml"))
    assert tower.scene.block.height == 10.0
    assert tower.space.names == ("mu", "lam", "zeta")
    assert tower.asked is None
    assert len(many.asked.conditions(many.scene, 0)) == 20 * 3 * 64
    assert many.asked.limits.mass == 2.0
    assert many.ensemble.size == 512


def test_there_is_one_command_to_run_and_one_to_test():
    commands = dict(re.findall(r"<!-- (\w+) -->\n```sh\n(.*?)\n```", README))
    assert commands.keys() == {"main", "tests"}
    assert all("\n" not in command for command in commands.values())
    assert "tpd optimise" in commands["main"]
    assert "pytest" in commands["tests"]


def test_the_public_names_are_there():
    for name in tpd.__all__:
        assert getattr(tpd, name).__doc__


def test_the_other_commands_are_understood():
    commands = [
        line.split()[1:] for block in blocks("sh") for line in block.splitlines() if line[:4] == "tpd "
    ]
    assert {command[0] for command in commands} == {"optimise", "response", "map"}
    for command in commands:
        assert parser().parse_args(command).command == command[0]
