"""Files of a report: all of them, tables, pictures, and the answer of an engine in them."""

import csv
import io
from types import SimpleNamespace

import numpy as np
import pytest

import tpd
from tests.report.conftest import details, harmonic, rejected, tuned
from tpd.design.as_built import Details, TimeHistory
from tpd.design.job import job_of
from tpd.design.problem import Problem
from tpd.report.files import ENGINE, FRAGILITY, add_section, motion_csv, response_csv, write


def stub(name: str, *_) -> bytes:
    """Return an empty picture in the format of a file."""
    return b"<svg/>" if name.endswith("svg") else b"\x89PNG" if name.endswith("png") else b"GIF8"


def read(text: str) -> tuple[list[str], list[list[str]]]:
    head, *rows = csv.reader(io.StringIO(text))
    return head, rows


def test_a_report_has_all_its_files_and_the_page_is_written_last(tmp_path, monkeypatch):
    monkeypatch.setattr("tpd.plots.results.draw", stub)
    toml = "[block]\nwidth = 0.1\n"
    written = write(tmp_path / "out", harmonic(), details(), {"block": {"width": 0.1}}, toml, overwrite=True)
    names = [path.name for path in written]
    data = ["report.txt", "design.json", "scene.toml", "response.csv", "motion.csv", "trials.csv"]
    drawn = ["benefit.svg", "search.png", "response.svg", "motion.svg", "drawing.svg"]
    assert names == [*data, *drawn, "animation.gif", "report.html"]
    head, rows = read((tmp_path / "out" / "trials.csv").read_text())
    assert head[:3] == ["mu", "lam", "zeta"]
    np.testing.assert_array_equal(np.array(rows)[:, :3].astype(float), harmonic().trials.designs)
    assert sorted(names) == sorted(path.name for path in (tmp_path / "out").glob("[!.]*"))
    assert (tmp_path / "out" / "scene.toml").read_text() == toml
    page = (tmp_path / "out" / "report.html").read_text()
    assert "width = 0.1" in page
    assert page.count("<figure>") == 6


def test_a_report_replaces_the_files_of_the_previous_report(tmp_path, monkeypatch):
    monkeypatch.setattr("tpd.plots.results.draw", stub)
    write(tmp_path, harmonic(), details(), {}, "[block]", overwrite=True)
    (tmp_path / "explore.html").write_text("a page of the user")
    (tmp_path / "animation.gif").rename(tmp_path / "mine.gif")
    said = []
    names = {
        path.name
        for path in write(tmp_path, harmonic(), Details(), {}, "[block]", overwrite=True, warn=said.append)
    }
    assert not {"motion.csv", "animation.gif", "response.svg"} & names
    left = {path.name for path in tmp_path.glob("[!.]*")}
    assert left == names | {"explore.html", "mine.gif"}
    assert said == [f"{tmp_path} also contains files that are not of this run: explore.html, mine.gif"]


def test_a_report_contains_its_job_if_the_job_can_be_written(tmp_path, monkeypatch):
    def unsaid(_):
        raise ValueError("a limit of one's own")

    monkeypatch.setattr("tpd.plots.results.draw", lambda *_: b"<svg/>")
    monkeypatch.setattr(Problem, "job", property(lambda _: job_of({})))
    design, details = rejected(), Details()
    assert "scene.toml" in {path.name for path in tpd.write_report(design, tmp_path / "a", details=details)}
    with pytest.raises(ValueError, match="already contains files"):
        tpd.write_report(design, tmp_path / "a", details=details)
    monkeypatch.setattr(Problem, "job", property(unsaid))
    with pytest.warns(UserWarning, match=r"the report is written without scene\.toml: a limit of one's own"):
        written = tpd.write_report(design, tmp_path / "b", details=details)
    assert "scene.toml" not in {path.name for path in written}


def test_time_histories_and_responses_are_written_as_csv():
    without, with_it = details().histories
    head, rows = read(motion_csv((without, with_it)))
    assert head == ["time_s", "without_tilt_rad", "with_tilt_rad", "with_bob_rad"]
    np.testing.assert_array_equal(
        np.array(rows, float).T, [without.time, without.tilt, with_it.tilt, with_it.bob]
    )
    # After an overturning the cells are empty.
    time = np.linspace(0.0, 10.0, 11)
    tilt = np.where(time > 5.0, np.nan, 0.1)
    lost = TimeHistory(with_pendulum=False, time=time, tilt=tilt, bob=tilt, overturned=True)
    head, rows = read(motion_csv((lost,)))
    assert (head, rows[-1][1]) == (["time_s", "without_tilt_rad"], "")
    assert float(rows[-1][0]) > 9.0
    without, with_it = details().responses
    head, rows = read(response_csv((without, with_it)))
    names = ("status", "amplitude_rad", "swing_rad", "share_overturned", "share_low", "share_high")
    sizes = [f"{case}_{name}" for case in ("without", "with") for name in names]
    sizes.remove("without_swing_rad")
    assert head == ["frequency_Hz", *sizes]
    numbers = np.array([[row[i] for i in (0, 2, 3, 7, 8)] for row in rows], float).T
    known = without.frequency, without.amplitude, without.overturning[0], with_it.amplitude, with_it.swing
    np.testing.assert_array_equal(numbers, known)
    assert [row[6] for row in rows] == list(with_it.status)
    assert read(response_csv((without,)))[0] == ["frequency_Hz", *sizes[:5]]


class Verdict(SimpleNamespace):
    """Answer of an engine."""

    def __str__(self) -> str:
        table = "        first  second  third\nrow of   1.0     2.0    3.0"
        return f"table of {self.engine} & more\n\n{table}\n\nEnd."


def test_a_second_engine_run_replaces_the_section_of_the_first(tmp_path):
    (tmp_path / "report.txt").write_text("verdict\n\nbody\n")
    (tmp_path / "report.html").write_text('<body>\n<p class="verdict note">verdict</p>\n</body>\n')
    for warning in ("DANGER: by MuJoCo it harms", ""):
        found = Verdict(engine="MuJoCo", warning=warning)
        assert [p.name for p in add_section(tmp_path, ENGINE, str(found), warning)] == [
            "report.txt",
            "report.html",
        ]
        text, page = (tmp_path / "report.txt").read_text(), (tmp_path / "report.html").read_text()
        assert text.startswith(warning or "verdict")
        assert text.count("table of MuJoCo & more") == page.count("table of MuJoCo &amp; more") == 1
        assert text.count("Independent contact engine\n") == 1
        # A table of the text is a table of the page.
        assert "<th></th><th>first</th><th>second</th><th>third</th></tr>\n<tr><td>row of</td>" in page
        assert "<p><br>End.</p>" in page
        assert page.count('<p class="danger">') == bool(warning)
        assert page.index("verdict</p>") < page.index("table of") < page.index("</body>")


def test_a_section_is_added_to_the_report_of_a_design_file(tmp_path):
    (tmp_path / "report.txt").write_text("verdict\n")
    assert add_section(tmp_path / "design.json", FRAGILITY, "medians") == [tmp_path / "report.txt"]
    assert (tmp_path / "report.txt").read_text().count("medians") == 1
    assert add_section(None, FRAGILITY, "medians") == []


def test_sections_of_several_commands_keep_their_order(tmp_path):
    (tmp_path / "report.txt").write_text("verdict\n\nbody\n")
    for title, content in ((ENGINE, "table 1"), (FRAGILITY, "medians"), (ENGINE, "table 2")):
        add_section(tmp_path, title, content)
    text = (tmp_path / "report.txt").read_text()
    engine, fragility = (f"{title}\n{'-' * len(title)}\n" for title in (ENGINE, FRAGILITY))
    assert text == f"verdict\n\nbody\n\n{engine}table 2\n\n{fragility}medians\n"


def test_a_failed_picture_gets_one_message_after_the_numbers_are_written(tmp_path, monkeypatch):
    def drawn(name, *_):
        if name.startswith("search"):
            raise RuntimeError("latex was not able to process\nthe following string")
        return stub(name)

    monkeypatch.setattr("tpd.plots.results.draw", drawn)
    there, said = [], []
    job = harmonic(), details(), {}, "[block]"
    then = lambda _: there.extend(p.name for p in tmp_path.glob("[!.]*"))  # noqa: E731
    written = write(tmp_path, *job, overwrite=True, then=then, warn=said.append)
    assert set(there) == {
        "report.txt",
        "design.json",
        "scene.toml",
        "response.csv",
        "motion.csv",
        "trials.csv",
    }
    assert said == ["search.png is not drawn: latex was not able to process"]
    assert {"report.html", "drawing.svg"} < {p.name for p in written}
    assert "search.png" not in {p.name for p in tmp_path.iterdir()}
    monkeypatch.setattr(Problem, "job", property(lambda _: job_of({})))
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.warns(UserWarning, match=r"search\.png is not drawn: latex"):
        written = tpd.write_report(harmonic(), "~/saved", details=Details())
    assert written[0] == tmp_path / "saved" / "report.txt"


def test_a_report_under_records_is_complete_and_can_be_read_back(tmp_path, monkeypatch):
    monkeypatch.setattr(
        "tpd.plots.results.draw", lambda name, *_: b"<svg/>" if name[-3:] == "svg" else b"\x89PNG"
    )
    names = {path.name for path in tpd.write_report(tuned(), tmp_path)}
    assert {"report.txt", "design.json", "scene.toml", "trials.csv", "report.html", "drawing.svg"} <= names
    # The design of a report is read again with its job.
    stored = tpd.read_design(tmp_path)
    assert (stored.status, stored.pendulum) == (tuned().status, tuned().pendulum)
    assert stored.job.tables["excitation"]["records"] == ["loma-prieta"]
