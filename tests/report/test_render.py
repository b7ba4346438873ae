"""A report as a page, also from its stored data."""

from html.parser import HTMLParser

import msgspec
import pytest

from tests.report.conftest import DESIGNS, details, harmonic, with_job
from tpd.report.blocks import Code, Figure, Group, Note, Report, Section, Summary, Table, Text, danger, note
from tpd.report.content import content, figures
from tpd.report.files import data
from tpd.report.render import html

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


PNG = b"\x89PNG"


def of(*blocks) -> Report:
    return report(note("verdict"), Section("first", blocks))


def report(verdict: Note, *sections: Section) -> Report:
    return Report("title", Summary(verdict, (), None, (Group("Build", (("bob", "5 kg"),)),)), (), sections)


def test_the_page_embeds_its_pictures_and_loads_no_external_file():
    pictures = dict.fromkeys(figures(harmonic(), details()), PNG)
    page = html(content(with_job(harmonic()), details()), pictures)
    reader = read(page)
    assert "http:" not in page
    assert "https:" not in page
    assert not {"script", "link", "iframe"} & {tag for tag, _ in reader.tags}
    images = [attributes for tag, attributes in reader.tags if tag == "img"]
    assert len(images) == len(pictures) == 6
    for image in images:
        assert image["src"].startswith("data:image/png;base64,")
        assert len(image["alt"]) > 20
    assert sum(tag == "figcaption" for tag, _ in reader.tags) == 6


@pytest.mark.parametrize("kind", DESIGNS)
def test_the_page_has_all_sections_in_order_and_the_stored_data_give_the_same_page(kind):
    found = content(with_job(DESIGNS[kind]()), details(kind))
    page = html(found, {})
    said = " ".join(read(page).text.split())
    parts = [*(s.title for s in found.sections), f"Seed {DESIGNS[kind]().seed}."]
    last = said.index(found.summary.verdict.text)
    for part in parts:
        last = said.index(part, last + 1)
    assert all(cell in said for group in found.summary.groups for row in group.rows for cell in row)
    assert found.summary.table is None or all(row[1] in said for row in found.summary.table.rows)
    stored = msgspec.json.decode(data(found), type=Report)
    assert (stored, html(stored, {})) == (found, page)


def test_only_the_first_section_is_open_and_dangers_have_a_css_class():
    sections = Section("a", (danger("D"), note("N"))), Section("b", (Text("y"),))
    page = html(report(note("verdict"), *sections), {})
    tags = read(page).tags
    assert [at["class"] for tag, at in tags if tag == "p" and at] == ["verdict note", "danger", "note"]
    assert [at for tag, at in tags if tag == "details"] == [{"open": None}, {}]
    assert page.index("5\u00a0kg") < page.index("<details")
    assert ("p", {"class": "verdict danger"}) in read(html(report(danger("no")), {})).tags


def test_cells_are_escaped_and_numbers_are_right_aligned():
    table = Table(("name", "size"), (("<i>", 1.0), ("none", None), ("?", float("nan"))), "a & b")
    reader = read(html(of(table, Code("<b>"), note("</p>")), {}))
    cells = [attributes for tag, attributes in reader.tags if tag == "td"]
    # The first row is that of the answer.
    assert cells[2:] == [{}, {"class": "n"}] * 3
    for part in ("<i>", "<b>", "</p>", "a & b"):
        assert part in reader.text
    assert reader.text.count("–") == 2


def test_figures_without_a_file_are_left_out_of_the_page():
    figure = Figure("a.png", alt="a dot", caption="dot")
    assert "<figure>" not in html(of(figure), {})
    assert "<figure>" in html(of(figure), {"a.png": PNG})
    with pytest.raises(ValueError, match="must hold SVG, PNG or GIF files only"):
        html(of(figure), {"a.png": b"BM"})
