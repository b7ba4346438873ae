"""`tpd explore`: the page of a report or a job, where it is written, and what is rejected."""

import pytest

import tpd
from tests.cli.conftest import call
from tests.explore import made
from tpd.report import files
from tpd.report.blocks import Report, Summary, note


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Pages of small tables."""
    made.small_tables(monkeypatch)


@pytest.fixture
def report(tmp_path):
    """A directory with the files of a report that count here."""
    folder = tmp_path / "tower"
    made.stored(folder)
    summary = Summary(note("RECOMMENDED"), (), None, ())
    (folder / "report.html").write_text("<h1>A tower</h1>")
    (folder / "report.json").write_text(files.data(Report("A tower", summary, (), ())))
    return folder


def test_explore_writes_its_page_into_the_report_and_links_it(report):
    done = call("explore", str(report))
    assert (done.status, done.out.splitlines()) == (
        0,
        [f"written: {report / 'explore.html'}", f"linked from: {report / 'report.html'}"],
    )
    page = (report / "explore.html").read_text(encoding="utf-8")
    expected = tpd.explore(tpd.read_design(report)).html
    assert page == expected
    assert 'href="explore.html"' in (report / "report.html").read_text()
    for _ in range(2):
        call("explore", str(report), "--out", str(report / "tower&roof.html"), "--overwrite")
        text = (report / "report.html").read_text()
        assert text.count('<a href="tower%26roof.html">Explore this design</a>') == text.count("Explore") == 1
        assert text.index("RECOMMENDED</p>") < text.index("Explore") < text.index('<div class="first">')
    again = call("explore", str(report))
    assert again.status == 2
    assert "explore.html exists already: choose another name with --out, or pass --overwrite" in again.err
    assert call("explore", str(report / "design.json"), "--overwrite").status == 0


def test_explore_accepts_a_job_file_without_a_design(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    job, out = tmp_path / "job.toml", tmp_path / "mine.html"
    job.write_text('[project]\nname = "My tower"\n')
    done = call("explore", str(job), "--out", str(out))
    assert (done.status, done.out) == (0, f"written: {out}\n")
    assert '"recommended":null' in out.read_text()
    assert call("explore", str(job)).out == "written: explore.html\n"


def test_option_open_shows_the_page_in_the_browser(report, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda url: opened.append(url) or len(opened) == 1)
    assert "browser" not in call("explore", str(report), "--open").out
    assert opened == [(report / "explore.html").resolve().as_uri()]
    assert "no browser was found" in call("explore", str(report), "--open", "--overwrite").out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("absent", "cannot read absent"),
        ("absent.toml", "cannot read absent.toml"),
        ("{report} --out {report}", "--out must name a file, but"),
        ("{report}/report.html", "is not a design in JSON"),
    ],
)
def test_explore_rejects_invalid_input_in_one_sentence(words, message, report):
    done = call("explore", words.format(report=report))
    assert done.status == 2
    assert message in done.err
    assert done.err.count("\n") == 1
