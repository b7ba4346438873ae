"""Files of a report: all of them, tables, pictures, and the answers of later commands in them."""

import csv
import io

import numpy as np
import pytest

import tpd
from tests.report.conftest import details, harmonic, rejected, with_job
from tpd.design.as_built import Details, TimeHistory
from tpd.report.blocks import Code, Section
from tpd.report.files import add_to, motion_csv, response_csv, write

DATA = ("report.txt", "design.json", "report.json", "scene.toml", "response.csv", "motion.csv", "trials.csv")


def stub(name: str, *_) -> bytes:
    """Return an empty picture in the format of a file."""
    return b"<svg/>" if name.endswith("svg") else b"\x89PNG" if name.endswith("png") else b"GIF8"


def read(text: str) -> tuple[list[str], list[list[str]]]:
    head, *rows = csv.reader(io.StringIO(text))
    return head, rows


def test_a_report_has_all_its_files_and_the_page_is_written_last(tmp_path, monkeypatch):
    monkeypatch.setattr("tpd.plots.results.draw", stub)
    design = with_job(harmonic(), limits={"stroke": 0.4})
    written = write(tmp_path / "out", design, details(), overwrite=True)
    names = [path.name for path in written]
    drawn = ["benefit.svg", "search.png", "response.svg", "motion.svg", "drawing.svg"]
    assert names == [*DATA, *drawn, "animation.gif", "report.html"]
    head, rows = read((tmp_path / "out" / "trials.csv").read_text())
    assert head[:3] == ["mu", "lam", "zeta"]
    np.testing.assert_array_equal(np.array(rows)[:, :3].astype(float), harmonic().trials.designs)
    assert sorted(names) == sorted(path.name for path in (tmp_path / "out").glob("[!.]*"))
    assert (tmp_path / "out" / "scene.toml").read_text() == design.problem.job.toml
    page = (tmp_path / "out" / "report.html").read_text()
    assert "stroke = 0.4" in page
    assert page.count("<figure>") == 6


def test_a_report_replaces_the_files_of_the_previous_report(tmp_path, monkeypatch):
    monkeypatch.setattr("tpd.plots.results.draw", stub)
    write(tmp_path, with_job(harmonic()), details(), overwrite=True)
    (tmp_path / "explore.html").write_text("a page of the user")
    (tmp_path / "animation.gif").rename(tmp_path / "mine.gif")
    said = []
    names = {
        path.name
        for path in write(tmp_path, with_job(harmonic()), Details(), overwrite=True, warn=said.append)
    }
    assert not {"motion.csv", "animation.gif", "response.svg"} & names
    left = {path.name for path in tmp_path.glob("[!.]*")}
    assert left == names | {"explore.html", "mine.gif"}
    assert said == [f"{tmp_path} also contains files that are not of this run: explore.html, mine.gif"]


def test_only_a_design_that_was_made_from_a_job_has_a_job_file(tmp_path, monkeypatch):
    monkeypatch.setattr("tpd.plots.results.draw", lambda *_: b"<svg/>")
    design, details = with_job(rejected()), Details()
    assert "scene.toml" in {path.name for path in tpd.write_report(design, tmp_path / "a", details=details)}
    with pytest.raises(ValueError, match="already contains files"):
        tpd.write_report(design, tmp_path / "a", details=details)
    written = tpd.write_report(rejected(), tmp_path / "b", details=details)
    assert "scene.toml" not in {path.name for path in written}
    stored = tpd.read_design(tmp_path / "b")
    assert stored.tables is None
    with pytest.raises(ValueError, match="has no job, because its design was made in Python: give a job"):
        _ = stored.job


def test_time_histories_and_responses_are_written_as_csv():
    without, with_it = details().histories
    head, rows = read(motion_csv((without, with_it)))
    assert head == ["time_s", "without_tilt_rad", "with_tilt_rad", "with_bob_rad"]
    np.testing.assert_array_equal(
        np.array(rows, float).T, [without.times, without.tilt, with_it.tilt, with_it.swing]
    )
    # After an overturning the cells are empty.
    time = np.linspace(0.0, 10.0, 11)
    tilt = np.where(time > 5.0, np.nan, 0.1)
    lost = TimeHistory(times=time, tilt=tilt, swing=None, overturned=True)
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


def test_text_and_page_contain_the_last_result_of_each_later_command(tmp_path, monkeypatch):
    monkeypatch.setattr("tpd.plots.results.draw", stub)
    write(tmp_path, with_job(harmonic()), details(), overwrite=True)
    before, first = ((tmp_path / f"report.{kind}").read_text() for kind in ("txt", "html"))
    engine, fragility = "Contact engine", "Fragility"
    table = "        first  second\nrow of   1.0     2.0"

    def add(title, answer, warning=""):
        return add_to(tmp_path / "design.json", Section(title, (Code(answer),), warning))

    # The answer of a command replaces its earlier one, and those of other commands remain.
    add(engine, "an old table", "by MuJoCo <it> harms")
    text, page = ((tmp_path / f"report.{kind}").read_text() for kind in ("txt", "html"))
    assert text.startswith(f"DANGER: by MuJoCo <it> harms\n{before}\n{engine}\n{'-' * 14}\nan old table\n")
    assert page.index("DANGER: by MuJoCo &lt;it&gt; harms") < page.index('<p class="verdict')
    add(fragility, "medians & more")
    paths = add(engine, table)
    assert [path.name for path in paths] == ["report.json", "report.txt", "report.html"]
    text, page = ((tmp_path / f"report.{kind}").read_text() for kind in ("txt", "html"))
    answers = (f"\n{engine}\n{'-' * 14}\n{table}\n", f"\n{fragility}\n{'-' * 9}\nmedians & more\n")
    assert text == before + "".join(answers)
    parts = [f"<summary>{engine}</summary>\n<pre>{table}</pre>\n</details>\n<details>\n"]
    parts.append(
        f"<summary>{fragility}</summary>\n<pre>medians &amp; more</pre>\n</details>\n</body>\n</html>"
    )
    assert page == first.replace("</body>\n</html>", "<details>\n" + "".join(parts))
    # A pendulum of options has no report, and a folder may have none.
    assert add_to(None) == add_to(tmp_path.parent) == []


@pytest.mark.parametrize("name", ["report.json", "drawing.svg"])
def test_a_report_with_a_damaged_file_remains_as_it_is(name, tmp_path, monkeypatch):
    monkeypatch.setattr("tpd.plots.results.draw", stub)
    write(tmp_path, with_job(harmonic()), details(), overwrite=True)
    (tmp_path / name).write_text('{"title": "half')
    files = {path.name: path.read_bytes() for path in tmp_path.glob("[!.]*")}
    with pytest.raises(ValueError, match=r"is not the data of a report: run the job|must hold SVG, PNG or"):
        add_to(tmp_path, Section("Fragility", (Code("medians"),)))
    assert files == {path.name: path.read_bytes() for path in tmp_path.glob("[!.]*")}


def test_a_failed_picture_gets_one_message_after_the_numbers_are_written(tmp_path, monkeypatch):
    def drawn(name, *_):
        if name.startswith("search"):
            raise RuntimeError("latex was not able to process\nthe following string")
        return stub(name)

    monkeypatch.setattr("tpd.plots.results.draw", drawn)
    there, said = [], []
    job = with_job(harmonic()), details()
    then = lambda _: there.extend(p.name for p in tmp_path.glob("[!.]*"))  # noqa: E731
    written = write(tmp_path, *job, overwrite=True, then=then, warn=said.append)
    assert set(there) == set(DATA)
    assert said == ["search.png is not drawn: latex was not able to process"]
    assert {"report.html", "drawing.svg"} < {p.name for p in written}
    assert "search.png" not in {p.name for p in tmp_path.iterdir()}
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.warns(UserWarning, match=r"search\.png is not drawn: latex"):
        written = tpd.write_report(harmonic(), "~/saved", details=Details())
    assert written[0] == tmp_path / "saved" / "report.txt"
