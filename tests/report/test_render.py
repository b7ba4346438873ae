"""Text, HTML and files of a report."""

import dataclasses
import io
from html.parser import HTMLParser

import pytest
from PIL import Image

from tests import designs
from tpd.core.formatting import number
from tpd.design.result import DesignStatus
from tpd.design.study import Study, build_of
from tpd.report import pictures
from tpd.report.blocks import Code, Figure, Note, Report, Section, Severity, Table, Text
from tpd.report.content import content
from tpd.report.files import write
from tpd.report.html import html
from tpd.report.text import text

VOID = {"meta", "img", "br", "link"}


class Reader(HTMLParser):
    """Fails on tags that do not close in order; keeps tags with attributes, and the text."""

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.text = [], [], ""

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.text += data


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    assert reader.open == []
    return reader


def png() -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (2, 2)).save(buffer, "PNG")
    return buffer.getvalue()


def drawn(design, study) -> dict[str, bytes]:
    return dict.fromkeys(pictures.names(design, study), png())


def of(*blocks) -> Report:
    return report(Note(Severity.note, "verdict"), Section("first", blocks))


def report(verdict: Note, *sections: Section) -> Report:
    answer = Table(("", ""), (("bob", "5 kg"),))
    return Report("title", verdict, (), answer, None, (), sections)


def test_the_page_is_whole_and_needs_nothing_from_outside():
    design, study = designs.single(), designs.study()
    page = html(content(design, study, "[block]\n"), drawn(design, study))
    reader = read(page)
    assert "http:" not in page
    assert "https:" not in page
    assert not {"script", "link", "iframe"} & {tag for tag, _ in reader.tags}
    images = [attributes for tag, attributes in reader.tags if tag == "img"]
    assert len(images) == 6
    for image in images:
        assert image["src"].startswith("data:image/png;base64,")
        assert len(image["alt"]) > 20
    assert sum(tag == "figcaption" for tag, _ in reader.tags) == 6


@pytest.mark.parametrize("case", [designs.single, designs.band])
def test_page_and_text_say_the_same_in_the_same_order(case):
    design = case()
    study = designs.study(responses=None, build=build_of(design))
    found = content(design, study, "[block]\n")
    page, words = read(html(found, {})).text, text(found)
    assert words.startswith("FOUND, BUT NOT TO BE HUNG AS IT IS")
    order = [
        "FOUND, BUT NOT TO BE HUNG AS IT IS",
        "DANGER: Once settled",
        "Build it",
        "1.622 kg",
        "Assumptions",
        "Seed 3",
    ]
    for said in (page, words):
        places = [said.index(x) for x in order]
        assert places == sorted(places)
        for part in (
            "0.12 m",
            "N m s/rad",
            "ten swings take",
            "jax",
            "1 met no design",
            "50.0% (",
            "40 paired runs of the nonlinear equations, seed 0",
            "growing for 2 s",
        ):
            assert part in said


def test_severities_are_classes_of_the_page():
    blocks = [Note(severity, severity.name.upper()) for severity in Severity]
    tags = read(html(of(*blocks), {})).tags
    classes = [attributes["class"] for tag, attributes in tags if tag == "p"]
    assert classes == ["verdict note", "danger", "note"]
    danger = report(Note(Severity.danger, "no"))
    assert ("p", {"class": "verdict danger"}) in read(html(danger, {})).tags


def test_all_but_the_first_screen_is_folded_and_some_of_it_is_printed():
    note = Note(Severity.note, "verdict")
    page = html(report(note, Section("a", (Text("x"),), printed=True), Section("b", (Text("y"),))), {})
    folds = [attributes for tag, attributes in read(page).tags if tag == "details"]
    assert folds == [{"class": "printed"}, {}]
    assert page.index("5 kg") < page.index("<details")


def test_everything_is_escaped_and_numbers_stand_to_the_right():
    table = Table(("name", "size"), (("<i>", 1.0), ("none", None), ("?", float("nan"))), "a & b")
    reader = read(html(of(table, Code("<b>"), Note(Severity.note, "</p>")), {}))
    cells = [attributes for tag, attributes in reader.tags if tag == "td"]
    # The first row is that of the answer.
    assert cells[2:] == [{}, {"class": "n"}] * 3
    for part in ("<i>", "<b>", "</p>", "a & b"):
        assert part in reader.text
    assert reader.text.count("–") == 2


def test_wide_tables_scroll_and_their_captions_do_not():
    wide = Table(("a", "b", "c", "d"), (("1", "2", "3", "4"),), "caption")
    page = html(of(wide), {})
    assert read(page).text.count("on a small screen it scrolls to the side") == 1
    box = page[page.index('<div class="wide"') : page.index("</div>")]
    assert "caption" not in box
    assert '<p class="caption">caption</p>' in page
    assert "scrolls to the side" not in html(of(Table(("a",), (("1",),))), {})


def test_an_empty_last_cell_has_no_line_of_its_own():
    table = Table(("from", "reasons"), (("search", "because " * 20), ("path", None)))
    assert text(of(table)).splitlines()[-1] == "path"


def test_rows_have_the_cells_of_their_head():
    with pytest.raises(ValueError, match="must have 2 cells as the head has, but has 1"):
        Table(("name", "size"), (("one",),))


def test_pictures_have_a_description_and_a_kind_that_pages_show():
    with pytest.raises(ValueError, match="`alt` must describe the picture"):
        Figure("a.png", alt="", caption="")
    with pytest.raises(ValueError, match="must hold SVG, PNG or GIF files only"):
        html(of(), {"a.bmp": b"BM"})


def test_figures_without_a_file_are_left_out_of_the_page():
    figure = Figure("a.png", alt="a dot", caption="dot")
    assert "<figure>" not in html(of(figure), {})
    assert "<figure>" in html(of(figure), {"a.png": png()})


def test_long_sentences_of_a_table_stand_below_their_row():
    lines = text(
        of(Table(("from", "reasons"), (("search", "because " * 20), ("path", "short"))))
    ).splitlines()
    assert lines[-6:-4] == ["from", "search"]
    assert all(line.startswith("    because") for line in lines[-4:-2])
    assert lines[-2:] == ["path", "    short"]


@pytest.mark.parametrize(
    ("x", "said"),
    [
        (0.0, "0"),
        (20e3, "20000"),
        (123456.0, "123500"),
        (0.0913456, "0.09135"),
        (3.0, "3"),
        (-0.25, "-0.25"),
        (9.99996, "10"),
        (1e-7, "1e-07"),
        (float("inf"), "infinite"),
        (float("nan"), "–"),
    ],
)
def test_numbers_for_people(x, said):
    assert number(x) == said


def test_all_files_are_written_and_the_page_last(tmp_path):
    study = dataclasses.replace(designs.study(), histories=None)
    written = write(
        tmp_path / "out", designs.single(), study, {"block": {"width": 0.1}}, "[block]\nwidth = 0.1\n"
    )
    names = [path.name for path in written]
    assert names == [
        *(
            "report.txt",
            "design.json",
            "scene.toml",
            "response.csv",
            "benefit.svg",
            "search.png",
            "response.svg",
            "drawing.svg",
            "report.html",
        )
    ]
    assert all(path.stat().st_size > 0 for path in written)
    assert sorted(names) == sorted(path.name for path in (tmp_path / "out").iterdir())
    assert (tmp_path / "out" / "scene.toml").read_text() == "[block]\nwidth = 0.1\n"
    assert "width = 0.1" in (tmp_path / "out" / "report.html").read_text()


def test_an_interrupted_search_has_no_page(tmp_path):
    cut = designs.single(status=DesignStatus.interrupted, pendulum=None, verified=())
    names = {path.name for path in write(tmp_path, cut, Study(), {}, "[block]\n")}
    assert names == {"report.txt", "design.json", "scene.toml", "search.png"}
    assert (tmp_path / "report.txt").read_text().startswith("INTERRUPTED")
