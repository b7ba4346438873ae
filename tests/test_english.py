"""Plain English: rules of the text that a machine can check, in docstrings, names, messages and pages.

To add a rule, add a word to a list below. To allow an exception, name it with its place in `ALLOWED`.
"""

from __future__ import annotations

import ast
import json
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.measures import FILES, ROOT, docstrings, name_of, tree

TOP = ROOT.parent
PAGES = [TOP / "README.md", *sorted((TOP / "notebooks" / "guide").glob("*.md"))]
PAGES += sorted((ROOT / "cli").rglob("*.toml"))
TEXT_FOR_USERS = ("cli", "report", "plots")
"""Folders whose strings are printed, or drawn."""
FIRST_WORDS = re.compile(r"(What|Of|The same|That|Those|There|Put|Said|Told|Asked|Met|It|One)\b")
"""First words of a docstring that does not make sense alone."""
FORBIDDEN = {
    r"worth hanging": "recommended",
    r"\bhung\b": "with the pendulum",
    r"\bbare\b": "without a pendulum",
    r"\bsurvey": "search",
    r"\bjudge": "evaluate, validate",
    r"\bstrikes?\b": "touches the wall",
    r"\bfresh\b": "validation runs",
    r"\bheld out\b|\bheld-out\b": "validation",
    r"\bspare[sd]\b": "clearance, saves",
    r"\bis (told|asked|met|said)\b": "say who does what",
    r"\bnobody\b|\bluck\b|\bhardly\b": "say it plainly",
    r"\blean(s|ing|ed)?\b": "tilt",
}
"""Expressions that the glossary forbids in text for users, and what to write instead."""
COMPETING = {
    r"exact model|exact motions?\b(?! of)": "linear model (small angles, solved exactly)",
    r"linear equations(?! \((4|25)\))": "linear model, nonlinear model",
    r"velocity ratio": "coefficient of restitution",
    r"\bsmooths? signs|smoothed signs": "smoothed model",
    r"\bused up\b|% used\b": "utilisation",
    r"severit(y|ies)": "tilt of a run",
    r"base motion": "excitation",
    r"with(out| no) an answer": "without a result",
    r"standing runs|runs in which the \w+ stands": "surviving runs",
    r"(validation|search) motions": "validation records, search records",
    r"\b(its|your|their) own\b": "leave it out, or name the thing",
    r"in place of": "instead of",
}
"""Terms that compete with one in the glossary, in the guide and in the text of notebooks."""
ALLOWED = frozenset({"tpd.cli.options: parse_known_args", "tpd.scene.status: not_known"})
"""Exceptions: a method that overrides one of argparse, and a public status."""
VAGUE = re.compile(
    r"(_|^)(hung|bare|found|told|tells|says?|said|asks?|asked|mee?ts?|tried|judged|nobody|leans?|hangs?|struck|"
    r"strikes?|spared|fresh|with_it|on_the_way|of_its_own|in_place_of|answers?|answered|honest|knows?|things?|works|"
    r"refuse[sd]?|are_those_of|alike|nothing|anything|everything)(_|$)|^(what|it|those|that)_"
)
"""Words in names of tests that do not state what must hold."""
SO_THAT = 130
"""Largest number of "so that" in the package. It states a purpose; a consequence has "so" or "therefore"."""
VERBS = re.compile(
    r"\b(is|are|was|were|must|has|have|had|cannot|can|needs?|gives?|does|do|did|may|allowed|ends?|fails?|"
    r"failed|holds?|names?|takes?|reads?|lacks?|moves?|stands?|belongs?|contains?|exists?|"
    r"stopped|states?|follows?|leaves?|makes?|differs?|goes|means?)\b"
)
"""Verbs of the sentences in error messages; a message needs one of them."""


PREFIX = re.compile(r"(\[\w+\]|`[^`]*`:|x:) x")
"""A message that only names the place of another one."""


def words_of(name: str) -> set[str]:
    """The words of a name, in lower case."""
    return set(re.findall(r"[a-z]+", re.sub(r"([A-Z])", r"_\1", name).lower()))


PARTICIPLES = words_of(
    "hung bare found tried asked given said known met left told meets lost spared struck judged taken"
)
"""Words that no name consists of: they say what happened to a thing, and not what it is."""


def bound_names(path: Path) -> Iterator[tuple[int, str]]:
    """Names that a module defines: functions, classes, arguments, variables and fields."""
    for node in ast.walk(tree(path)):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield node.lineno, name
            case ast.arg(arg=name) | ast.Name(id=name, ctx=ast.Store()):
                yield node.lineno, name


def strings(path: Path) -> Iterator[tuple[int, str]]:
    """Texts of a module without its docstrings; of a formatted one, its constant parts."""
    documented = {id(s) for s in docstrings(tree(path))}
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
            yield node.lineno, node.value


def lines(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of a module, docstrings and comments included."""
    yield from enumerate(path.read_text(encoding="utf-8").splitlines(), 1)


def messages(path: Path) -> Iterator[tuple[int, str]]:
    """Texts of the errors that a module raises, a formatted value as `x`."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
            text = node.exc.args[0]
            if isinstance(text, ast.JoinedStr):
                yield (
                    node.lineno,
                    "".join(str(v.value) if isinstance(v, ast.Constant) else "x" for v in text.values),
                )
            elif isinstance(text, ast.Constant) and isinstance(text.value, str):
                yield node.lineno, text.value


def test_the_first_line_of_a_docstring_makes_sense_alone():
    found = [
        f"{name_of(path)}:{s.lineno}: {str(s.value).splitlines()[0]}"
        for path in FILES
        for s in docstrings(tree(path))
        if FIRST_WORDS.match(str(s.value).strip())
    ]
    assert not found, "\n".join(found)


def test_no_name_is_a_participle():
    found = [
        f"{name_of(path)}:{line}: {name}"
        for path in FILES
        for line, name in bound_names(path)
        if words_of(name) & PARTICIPLES and f"{name_of(path)}: {name}" not in ALLOWED
    ]
    assert not found, "\n".join(found)


def test_the_name_of_a_test_states_what_must_hold():
    found = [
        f"{path.name}: {node.name}"
        for path in sorted((TOP / "tests").rglob("test_*.py"))
        for node in tree(path).body
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("test_")
        and VAGUE.search(node.name.removeprefix("test_"))
    ]
    assert not found, "\n".join(found)


def test_so_that_does_not_become_more_frequent():
    texts = "".join(path.read_text(encoding="utf-8") for path in FILES)
    assert len(re.findall(r"\bso\s+(?:# )?that\b", texts)) <= SO_THAT, "write so, therefore or because"


@pytest.mark.parametrize("word", FORBIDDEN)
def test_text_for_users_keeps_to_the_glossary(word):
    texts = [
        (f"{name_of(path)}:{line}", text)
        for path in FILES
        if path.relative_to(ROOT).parts[0] in TEXT_FOR_USERS
        for line, text in strings(path)
    ]
    texts += [(f"{name_of(path)}:{line}", text) for path in FILES for line, text in messages(path)]
    texts += [
        (f"{page.name}:{i}", line)
        for page in PAGES
        if page.name != "changes.md"
        for i, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1)
    ]
    found = [f"{at}: {text.strip()}" for at, text in texts if re.search(word, text, re.IGNORECASE)]
    assert not found, f"write {FORBIDDEN[word]}:\n" + "\n".join(found)


@pytest.mark.parametrize("word", COMPETING | FORBIDDEN)
def test_the_guide_has_one_term_for_each_concept(word):
    # Other tests check the sources of generated pages, and old names are in the page of changes.
    left_out = {"README.md", "api.md", "job_file.md", "changes.md"}
    pages = [page for page in PAGES if page.suffix == ".md" and page.name not in left_out]
    texts = [(page.name, page.read_text("utf-8")) for page in pages]
    for notebook in sorted((TOP / "notebooks").glob("*.ipynb")):
        cells = json.loads(notebook.read_text("utf-8"))["cells"]
        texts += [(notebook.name, "".join(c["source"])) for c in cells if c["cell_type"] == "markdown"]
    found = [
        f"{place}: {text[m.start() - 30 : m.end() + 30]}"
        for place, text in texts
        for m in re.finditer(word, text)
    ]
    assert not found, f"write {(COMPETING | FORBIDDEN)[word]}:\n" + "\n".join(found)


@pytest.mark.parametrize(
    ("word", "folders", "texts"),
    # The rows of the report still have "settled" for the runs.
    [
        ("velocity ratio", TEXT_FOR_USERS, strings),
        (r"linear equations(?! \((4|25)\))", ("",), strings),
        (r"steady[- ]state (tilt|swing)", ("cli",), strings),
        (r"without an answer|ha(s|ve) no answer", ("",), lines),
        (r"[bB]ase motion", ("",), lines),
        ("worst tenth", ("",), lines),
    ],
)
def test_the_source_has_one_term_for_each_concept(word, folders, texts):
    found = [
        f"{name_of(path)}:{line}: {text.strip()}"
        for path in FILES
        if name_of(path).startswith(tuple(f"tpd.{folder}" for folder in folders))
        for line, text in texts(path)
        if re.search(word, text)
    ]
    assert not found, "\n".join(found)


def test_an_error_message_is_a_sentence_with_a_verb():
    found = [
        f"{name_of(path)}:{line}: {text}"
        for path in FILES
        for line, text in messages(path)
        if not VERBS.search(text) and not PREFIX.fullmatch(text)
    ]
    assert not found, "\n".join(found)


def exists(name: str) -> bool:
    """Return whether a name with dots can be imported, or is a field of a class that can."""
    try:
        return bool(pkgutil.resolve_name(name))
    except (ImportError, AttributeError):
        owner, _, field = name.rpartition(".")
        return owner != "tpd" and field in getattr(pkgutil.resolve_name(owner), "__annotations__", {})


def test_every_name_of_the_package_in_text_exists():
    texts = [(name_of(path), str(s.value)) for path in FILES for s in docstrings(tree(path))] + [
        (page.name, page.read_text(encoding="utf-8")) for page in PAGES if page.name != "changes.md"
    ]
    for notebook in sorted((TOP / "notebooks").glob("*.ipynb")):
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        texts += [(notebook.name, "".join(cell["source"])) for cell in cells]
    found = sorted(
        f"{place}: {name}"
        for place, text in texts
        for name in re.findall(r"(?<![\w/.-])tpd(?:\.[A-Za-z_]\w*)+", text)
        if not exists(name)
    )
    assert not found, "\n".join(found)


def test_each_rule_detects_an_example():
    assert exists("tpd.Block.width")
    assert exists("tpd.theory.uplift")
    assert not exists("tpd.Margins")
    assert FIRST_WORDS.match("What a motion settles to.")
    assert words_of("_boundFound") & PARTICIPLES == {"found"}
    assert re.search(r"\bhung\b", "a pendulum hung in it")
    assert not VERBS.search("too many events")
