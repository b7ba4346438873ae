"""The answer in at most 25 lines: verdict, dangers, pendulum, what limits it."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from tests.report.conftest import DESIGNS, LITTLE, against, details, flat
from tpd.design.as_built import Details
from tpd.design.reasons import ReasonKind
from tpd.report.answer import MOST, answer
from tpd.report.summary import verdict

MANY = tuple(
    replace(LITTLE, kind=ReasonKind.breaks_limit, limit="-".join([f"limit {i}"] * 12)) for i in range(40)
)


@pytest.mark.parametrize("kind", [*DESIGNS, "many reasons"])
def test_the_terminal_shows_at_most_25_lines_and_only_whole_rows(kind):
    design = against(*MANY) if kind == "many reasons" else DESIGNS[kind]()
    about = Details() if kind == "many reasons" else details(kind)
    said = answer(design, about, Path("a folder")).splitlines()
    assert len(said) <= MOST == 25
    assert max(map(len, said)) <= 100
    assert said[-1] == "  repeat         tpd optimise 'a folder/scene.toml' --out 'a folder-again'"
    assert said[-2] == "  report         a folder/report.html"
    first = verdict(design, about).marked
    assert flat("\n".join(said)).startswith(first)
    # Where rows are left out each of the others is whole.
    whole = flat(answer(design, about, Path("a folder"), most=1000))
    cut = flat("\n".join(said)).split(" (more in the report) ")
    assert all(part in whole for part in cut)
    assert len(cut) == 1 or re.match(
        r"(Compare first|rule|Build|reason|rod|hinge|limits|depends on|part fails|not simulated) ",
        whole[len(cut[0]) + 1 :],
    )
    assert not re.search(r"[+-]0(\.0+)?[ %)]|nan|inf\b", whole.replace("+0.0", ""))
