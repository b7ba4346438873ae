"""The page as a text: data that cannot end its script, a frame for notebooks, and a file."""

import html
import json
import re

import pytest

import tpd
from tests.designs import SCENE
from tests.explore import made
from tpd.design.job import job_of
from tpd.explore.page import Page, explore


def data(page: Page) -> dict:
    """Data that a page holds."""
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page.html, re.DOTALL)
    return json.loads(text)


@pytest.fixture(scope="module")
def page() -> Page:
    return explore(SCENE)


def test_the_page_is_one_file_below_two_megabytes(page):
    assert page.html.startswith("<!DOCTYPE html>")
    assert len(page.html) < 2_000_000
    assert not re.search(r"@[A-Z]+@", page.html), "all places of the template are filled"
    assert not re.search(r"https?://|<link|@import|src=", page.html)
    assert data(page)["version"] == tpd.__version__


def test_the_joined_script_has_no_import_and_no_duplicate_name(page):
    script = page.html.rpartition('<script type="module">')[2]
    assert not re.search(r"^(import|export)\b", script, re.MULTILINE)
    names = re.findall(r"^(?:function|class|const|let) (\w+)", script, re.MULTILINE)
    assert len(names) == len(set(names))
    assert len(names) > 40


def test_a_project_name_cannot_close_the_script_element(monkeypatch):
    made.small_tables(monkeypatch)
    name = "</script><script>alert(1)</script>"
    page = explore(job_of({"project": {"name": name}}))
    assert "<script>alert" not in page.html
    assert data(page)["title"] == name


def test_a_notebook_shows_the_page_in_a_frame(page):
    frame = page._repr_html_()
    (source,) = re.findall(r'srcdoc="(.*?)"', frame, re.DOTALL)
    assert html.unescape(source) == page.html
    assert 'title="Explore the design"' in frame
    assert re.match(r"Page of \d\.\d MB: ", repr(page))
