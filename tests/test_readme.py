"""README and guide: examples print the output shown, commands and job files are valid, links exist."""

import argparse
import ast
import re
import shlex
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest

import tpd
from tests.api_reference import GROUPS, PAGE, Reference
from tpd.cli import parser
from tpd.scene.status import Status

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
GUIDE = ROOT / "notebooks" / "guide"
PAGES = (README, *sorted(GUIDE.glob("*.md")), ROOT / "tests" / "benchmarks" / "README.md")


class Block(NamedTuple):
    """A fenced block of a page."""

    page: str
    language: str
    text: str
    mark: str
    """Comment on the line above, without its brackets; empty if there is none."""
    output: str
    """The text block that follows directly, if any."""

    def __str__(self) -> str:
        return f"{self.page}: {self.mark or self.text.splitlines()[0]}"


def fenced(path: Path) -> list[Block]:
    """All fenced blocks of a page."""
    found = re.finditer(
        r"(?:^<!-- ([^\n]*?) -->\n)?^```(\w+)\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?",
        path.read_text(encoding="utf-8"),
        flags=re.DOTALL | re.MULTILINE,
    )
    name = str(path.relative_to(ROOT))
    return [Block(name, m[2], m[3], m[1] or "", m[4] or "") for m in found]


BLOCKS = [block for page in PAGES for block in fenced(page)]
(VERBS,) = (a.choices for a in parser()._actions if isinstance(a, argparse._SubParsersAction))
EXAMPLES = [block for block in BLOCKS if block.mark.startswith("run: ")]


def of(language: str) -> list[Block]:
    return [block for block in BLOCKS if block.language == language]


def test_the_readme_is_short():
    text = README.read_text(encoding="utf-8")
    assert len(text.split()) <= 1300
    assert len(text.splitlines()) <= 130


def test_there_is_one_command_to_run_and_one_to_test():
    commands = {block.mark: block.text for block in fenced(README) if block.mark in ("main", "tests")}
    assert commands.keys() == {"main", "tests"}
    assert all(command.count("\n") == 1 for command in commands.values())
    assert "tpd optimise" in commands["main"]
    assert "pytest" in commands["tests"]


@pytest.mark.parametrize("example", EXAMPLES, ids=str)
def test_an_example_prints_what_stands_below_it(example, capsys):
    assert example.output
    exec(compile(example.text, example.page, "exec"), {})
    assert capsys.readouterr().out == example.output


def test_the_readme_has_one_example_the_descent_in_the_open():
    (example,) = EXAMPLES
    assert example.page == "README.md"
    assert len(example.text.splitlines()) <= 30
    assert all(name in example.text for name in ("Smoothed", "optax", "Piecewise"))


@pytest.mark.parametrize("block", of("python"), ids=str)
def test_python_is_python(block):
    ast.parse(block.text)


def commands() -> list[list[str]]:
    lines = [line for block in of("sh") for line in block.text.splitlines()]
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("tpd ")]


def test_every_command_of_the_command_line_is_shown():
    assert {command[0] for command in commands()} == set(VERBS)


def test_the_readme_says_what_every_command_answers():
    rows = re.findall(r"^\| `tpd (\w+)", README.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert list(dict.fromkeys(rows)) == list(VERBS)


@pytest.mark.parametrize("command", commands(), ids=" ".join)
def test_commands_are_understood(command):
    assert parser().parse_args(command).command == command[0]


@pytest.mark.parametrize("block", of("toml"), ids=str)
def test_job_files_are_understood(block):
    from tpd.design.job import job_of

    job = job_of(tomllib.loads(block.text))
    # Without a table of conditions, the neighbourhood of a harmonic.
    assert (job.conditions is not None) == ("[conditions]" in block.text or "records" in block.text)


LINKS = [
    pytest.param(page, link, id=f"{page.relative_to(ROOT)}: {link}")
    for page in PAGES
    for link in dict.fromkeys(re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")))
]


def anchors(path: Path) -> set[str]:
    """Anchors of a page's headings, as forges make them."""
    headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize(("page", "link"), LINKS)
def test_links_lead_somewhere(page, link):
    assert "://" not in link
    target, _, anchor = link.partition("#")
    file = (page.parent / target).resolve() if target else page
    assert file.exists()
    assert not anchor or anchor in anchors(file)


@pytest.mark.parametrize("page", sorted(GUIDE.glob("*.md")), ids=lambda page: page.name)
def test_every_page_is_in_the_index(page):
    assert page.name == "README.md" or f"({page.name})" in (GUIDE / "README.md").read_text(encoding="utf-8")


FILE = r"`?((?:tpd|tests)/[\w/]+\.(?:py|json|md))`?"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_files_that_a_page_names_exist(page):
    for name in re.findall(FILE, page.read_text(encoding="utf-8")):
        assert (ROOT / name).exists(), name


def test_names_of_the_table_of_equations_are_in_its_files():
    rows = [row.split(" | ") for row in (GUIDE / "theory.md").read_text(encoding="utf-8").splitlines()]
    rows = [row for row in rows if len(row) == 4 and "`tpd/" in row[2]]
    assert len(rows) > 12
    for _, _, files, names in rows:
        text = "\n".join((ROOT / name).read_text(encoding="utf-8") for name in re.findall(FILE, files))
        for name in re.findall(r"`(\w+?)_?…?`", names):
            assert re.search(rf"^(def |class |){name}", text, flags=re.MULTILINE), name


def test_files_of_the_docstring_s_table_exist():
    names = re.findall(r"\b((?:core|scene|theory|exact|models|answers)/\w+)\b", str(tpd.__doc__))
    assert len(names) > 10
    for name in names:
        assert (ROOT / "tpd" / f"{name}.py").exists(), name


def test_every_status_is_explained():
    text = (GUIDE / "statuses.md").read_text(encoding="utf-8")
    for name in Status._name_to_item:  # type: ignore[attr-defined]
        assert f"`{name}`" in text


def test_the_reference_is_current_and_has_every_public_name():
    reference = Reference()
    assert sorted(" ".join(GROUPS.values()).split()) == tpd.__all__
    # Written by `python -m tests.api_reference`.
    assert reference.text() == PAGE.read_text(encoding="utf-8")


def test_the_reference_has_signatures_errors_and_fields():
    text = PAGE.read_text(encoding="utf-8")
    assert "paper_scene() -> Scene" in text
    assert "    free: Real = 20.0,\n    max_events: int = 200000,\n) -> Transient" in text
    assert "Raises `ValueError`: fewer than two samples" in text
    assert (
        "- `swing: Number`: Largest |psi|, the rod's angle from the vertical; 0 without a pendulum." in text
    )
