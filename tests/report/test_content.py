"""The whole report as data: one family for both kinds of excitation."""

import pytest

from tests.report.conftest import DESIGNS, details, ground, harmonic, with_job
from tpd.design.as_built import Details
from tpd.design.job import Job
from tpd.report.blocks import Code, Figure, Severity
from tpd.report.content import content, figures

REPEAT = "Appendix: how to repeat the search"


def section(report, title):
    (found,) = (s for s in report.sections if s.title == title)
    return found.blocks


def test_the_first_screen_has_verdict_dangers_and_groups():
    report = content(with_job(harmonic(), project={"name": "Tower"}), details(), date="2026-11-23")
    assert report.summary.verdict.severity is Severity.note
    assert {n.severity for n in report.summary.dangers} == {Severity.danger}
    assert [group.title for group in report.summary.groups] == ["Compare first", "Build", ""]
    assert [name for name, _ in report.summary.groups[0].rows] == [
        "no pendulum",
        "wider block",
    ]
    assert [f.name for f in report.figures] == ["benefit.svg", "drawing.svg"]
    assert report.title == "Tower: pendulum for a block of 0.1 m × 0.4 m, 2026-11-23"
    assert content(harmonic(), Details()).title == "Pendulum for a block of 0.1 m × 0.4 m"
    (table,) = section(report, "Conditions, limits and friction")
    assert [name for name, _ in table.rows[:7]] == [
        *("block", "excitation", "uplift", "sliding", "conditions", "required", "benefit")
    ]


def test_hypotheses_state_the_intensity_once_and_define_surviving_runs():
    (table,) = section(content(ground(), Details()), "Hypotheses")
    rows = dict(table.rows)
    assert rows["excitation"].count("PGA over g tan(alpha)") == 1
    assert rows["surviving runs"] == "runs in which the block does not overturn"
    assert {"starts", "duration", "overturned", "direction", "α, toppling angle", "energy loss"} <= set(rows)


@pytest.mark.parametrize("kind", DESIGNS)
def test_sections_have_a_fixed_order_and_empty_sections_are_omitted(kind):
    order = ["Build it", "Conditions, limits and friction", "Notes", "Hypotheses", "Document and scope"]
    order += ["Validation runs", "Depends on", "What limits the design", "Nearby frequencies"]
    order += ["Motion from rest", "Settled motion"]
    order += [
        f"Appendix: {name}" for name in ("search", "rejected designs", "records", "how to repeat the search")
    ]
    report = content(with_job(DESIGNS[kind]()), details(kind))
    titles = [s.title for s in report.sections]
    assert titles == [title for title in order if title in titles]
    assert ("Appendix: records" in titles) is (kind in ("ground", "tuned"))
    assert ("Build it" in titles) is (kind in ("harmonic", "tuned"))
    assert ("Settled motion" in titles) is (kind in ("harmonic", "rejected"))
    drawn = [b.name for s in report.sections for b in s.blocks if isinstance(b, Figure)]
    assert sorted(drawn + [f.name for f in report.figures]) == sorted(figures(DESIGNS[kind](), details(kind)))


def test_the_last_section_has_the_command_that_repeats_the_search(tmp_path):
    design = with_job(harmonic())
    blocks = section(content(design, details(), tmp_path), REPEAT)
    said = [block.text for block in blocks if isinstance(block, Code)]
    again = f"tpd optimise {tmp_path}/scene.toml --out {tmp_path}-again"
    assert said == [again, f"tpd explore {tmp_path}", design.problem.job.toml]
    assert not any(isinstance(b, Code) for b in section(content(harmonic(), details(), tmp_path), REPEAT))


def test_the_appendix_lists_records_and_notes_on_their_files(monkeypatch):
    monkeypatch.setattr(Job, "file_notes", ("a.AT2: offset removed",))
    table, notes = section(content(with_job(ground()), details("ground")), "Appendix: records")
    assert [row[:3] for row in table.rows] == [
        ("search records", "loma-prieta", "Loma Prieta 1989-10-18"),
        ("validation records", "el-centro", "Imperial Valley 1940-05-19"),
    ]
    assert notes.items == ("a.AT2: offset removed",)
