"""`tpd.plot`: every result with a picture, its arguments, and one sentence for a mistake."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import tpd
from tests.report.conftest import details, harmonic
from tpd.answers.response import settled_response
from tpd.answers.spectra import RockingSpectrum
from tpd.plots.results import draw
from tpd.plots.style import new_axes

SCENE = tpd.paper_scene()
RESPONSE = settled_response(SCENE, "frequency", np.linspace(2.0, 3.0, 3))
OTHER = settled_response(SCENE, "amplitude", np.array([0.01, 0.012]))
SPECTRUM = RockingSpectrum(np.array([1.0, 2.0]), np.array([[0.1, 0.2]]))


@pytest.fixture(scope="module")
def design_map():
    axes = ("frequency", [2.0, 2.5]), ("amplitude", [0.01, 0.015])
    return tpd.design_map(tpd.paper_scene(), *axes)


def test_plot_of_every_result_accepts_what_and_ax(design_map, single):
    for how in ({"what": "swing"}, {"quantity": "swing"}):
        bar = tpd.plot(design_map, **how).figure.axes[1]
        assert bar.get_ylabel().startswith("largest bob angle")
    for name in ("ax", "axes"):
        own = new_axes()
        assert tpd.plot(RESPONSE, own=2.0, **{name: own})[0] is own
    assert tpd.plot(single, "benefit").get_xlabel().startswith("share of the runs")
    assert tpd.plot(SPECTRUM, ax=own) is own


def test_an_invalid_argument_of_plot_is_rejected_in_one_sentence(design_map, single):
    for result, how, message in (
        (3, {}, r"`result` must have a picture \(Design, .*, RockingSpectrum, Record\), but is 3"),
        (tpd.Design, {}, "`result` must have a picture"),
        (single, {"what": "groups"}, "`what` must be one of landscape, drawing, benefit"),
        (single, {"state": "half"}, "`state` does not apply to a Design: allowed are what, ax"),
        (single, {"axes": new_axes()}, "`axes` does not apply to a Design"),
        (design_map, {"what": "status"}, "`quantity` must be one of amplitude, swing, margin"),
        (design_map, {"what": "swing", "quantity": "margin"}, "`quantity` has two values"),
        (design_map, {"own": 2.0}, "`own` does not apply to a DesignMap: allowed are quantity, ax"),
        (design_map, {"ax": 3}, "`ax` must be a Axes, but is 3"),
        (SPECTRUM, {"what": "amplitude"}, "`what` does not apply to a RockingSpectrum: allowed are ax"),
        (RESPONSE, {"without": OTHER}, "must be over `frequency`"),
        (RESPONSE, {"axes": [new_axes(), 3]}, "`axes` must be a Axes, but is 3"),
    ):
        with pytest.raises(ValueError, match=message):
            tpd.plot(result, **how)


def test_picture_files_have_the_format_of_their_name():
    for name in ("benefit", "response", "motion"):
        found = draw(f"{name}.svg", harmonic(), details())
        assert ElementTree.fromstring(found).tag.endswith("svg")
    assert draw("search.png", harmonic(), details()).startswith(b"\x89PNG")
    found = draw("drawing.svg", harmonic(), details())
    assert found == draw("drawing.svg", harmonic(), details())
    words = re.sub(r"<[^>]+>", " ", found.decode())
    assert f"{details().build.bob_width:.3g} m wide" in words
    with pytest.raises(ValueError, match=r"`name` must be one of search\.png"):
        draw("other.svg", harmonic(), details())
