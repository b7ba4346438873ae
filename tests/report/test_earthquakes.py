"""Section of the report about records: counts, order, verdicts, and the danger of a harmful pendulum."""

import math

import numpy as np
import pytest

import tpd
from tests import designs
from tpd.design.earthquakes import shaken
from tpd.report import earthquakes
from tpd.report.blocks import Note, Severity, Table
from tpd.report.content import content
from tpd.report.text import text


def test_a_report_without_records_says_nothing():
    assert earthquakes.section(None) == []
    assert earthquakes.notes(None) == []


def test_counts_and_rows():
    note, table = earthquakes.section(designs.earthquakes())
    assert isinstance(note, Note)
    assert "Of 3 records at their own size, 2 overturn the bare block, 1 with the pendulum" in note.text
    assert "the nonlinear equations change 1 of 5 verdicts" in note.text
    assert "1 runs of the linear equations and 1 of the nonlinear ones" in note.text
    assert isinstance(table, Table)
    cells = [[str(c) for c in row] for row in table.rows]
    # The largest tilts first.
    assert [row[0] for row in cells] == ["gentle", "strong", "long"]
    assert cells[0][2:4] == ["overturns", "0.5"]
    assert cells[2][3] == "unknown (too many events)"
    # Which of the two sizes a room, and the other one in brackets.
    assert cells[0][4] == "0.3 (0.25)"
    assert table.head[4] == "rod against block (rad), nonlinear equations (linear)"


def test_a_run_without_an_answer_stands_for_nothing():
    found = designs.earthquakes(bare=np.array([np.nan, np.inf, 0.25]), hung=np.array([np.inf, 0.3, 0.1]))
    assert earthquakes.notes(found) == []
    (note,) = earthquakes.notes(designs.earthquakes())
    assert note.severity is Severity.warning
    assert "not known whether 1 of the records overturn the block with the pendulum: long" in note.text


def test_a_record_that_only_the_pendulum_overturns_is_a_danger():
    (note,) = earthquakes.notes(
        designs.earthquakes(bare=np.array([0.1, np.inf, 0.25]), hung=np.array([np.inf] * 2 + [0.1]))
    )
    assert "1 of the records overturn a block that stands without: gentle" in note.text
    both = (np.array([True] * 3), None), (np.array([False] * 3), None)
    bare_only = designs.earthquakes(
        hung=None, relative=None, linear_relative=None, nonlinear=both[0], unknown=both[1]
    )
    assert earthquakes.notes(bare_only) == []
    assert len(earthquakes.section(bare_only)[1].rows[0]) == 3


def test_the_report_has_the_section_and_the_command_that_repeats_it(tmp_path):
    study = designs.study(earthquakes=designs.earthquakes())
    words = text(content(designs.single(), study, directory=tmp_path))
    assert "In earthquakes" in words
    assert "--records 'a folder' el-centro" in words


@pytest.mark.mends("the angle between rod and block, which sizes a room, was that of the linear equations")
def test_a_design_is_shaken_bare_and_hung():
    design = designs.single()
    records = [tpd.records.el_centro().scaled(0.8), tpd.records.loma_prieta()]
    found = shaken(design, records, ["el-centro"])
    assert found.sources == ("el-centro",)
    assert found.pga == pytest.approx([float(r.pga) for r in records])
    for i, record in enumerate(records):
        scene = tpd.Scene(design.scene.block, record)
        one = tpd.transient(scene)
        known = float(one.tilt) / float(design.scene.block.slenderness)
        assert found.bare[i] == pytest.approx(known) or (math.isinf(known) and math.isinf(found.bare[i]))
    assert found.hung is not None
    assert found.hung.shape == (2,)
    hung = [
        tpd.transient(tpd.Scene(design.scene.block, x), design.pendulum, model=tpd.Segmented())
        for x in records
    ]
    for angle, one in zip(found.relative, hung, strict=True):
        fell = tpd.status_name(one.status) == "overturned"
        assert angle == (np.inf if fell else pytest.approx(float(one.relative), rel=1e-9))
    assert found.undecided == (0, 0)
