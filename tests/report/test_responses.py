"""Motions over time as CSV, and the drawing as SVG."""

import csv
import io
import re
import xml.etree.ElementTree as ElementTree

import numpy as np

from tests import designs
from tpd.design.study import Study
from tpd.report import pictures
from tpd.report.responses import motion_csv


def read(text: str) -> tuple[list[str], list[list[str]]]:
    head, *rows = csv.reader(io.StringIO(text))
    return head, rows


def test_motions_are_those_of_the_exact_solution_in_full():
    histories = designs.study().histories
    head, rows = read(motion_csv(histories))
    assert head == ["time_s", "without_tilt_rad", "with_tilt_rad", "with_bob_rad"]
    bare, hung = histories
    values = np.array(rows, dtype=float)
    np.testing.assert_array_equal(values.T, [bare.time, bare.tilt, hung.tilt, hung.bob])
    head, rows = read(motion_csv((designs.history(False),)))
    assert head == ["time_s", "without_tilt_rad"]


def test_after_an_overturning_the_cells_are_empty():
    _, rows = read(motion_csv((designs.history(False, lost=True), designs.history(True))))
    assert rows[-1][1] == ""
    assert float(rows[-1][0]) > 9.0
    assert float(rows[-1][3]) == designs.history(True).bob[-1]


def test_the_drawing_as_svg_is_a_file_of_lines_that_repeats():
    design = designs.around()
    found = pictures.draw("drawing.svg", design, Study())
    assert ElementTree.fromstring(found).tag.endswith("svg")
    assert found == pictures.draw("drawing.svg", design, Study())
    words = re.sub(r"<[^>]+>", " ", found.decode())
    assert "bob, 1.689 kg: ball" in words
    assert "0.0744 m wide" in words
