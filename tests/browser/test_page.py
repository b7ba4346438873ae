"""The page in a real browser: controls, values and their sources, keyboard, labels, and the animation."""

import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import tpd
from tests.browser.browser import Browser, browser, find
from tests.browser.test_orbits import CHIMNEY, exact
from tests.explore import made

pytestmark = pytest.mark.skipif(
    find() is None, reason="needs a browser (Debian: apt-get install chromium): the page was not tested"
)
NAMES = ["pendulum_mass", "pendulum_length", "pendulum_damping", "frequency", "amplitude"]
CONTROLS = "mass", "length", "damping", "frequency", "amplitude"
JOB = """
[block]
width = 1.0
height = 6.0
mass = 5770.0
cavity_width = 0.7

[motion]
pulse = "ricker"
pulse_frequency = 1.0
pga = 0.5
"""


@pytest.fixture(scope="module")
def window():
    """A window of a browser."""
    program = find()
    assert program is not None
    with browser(program) as opened:
        yield opened


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, Path]:
    """Pages as files: the chimney, and a design with validation runs."""
    folder = tmp_path_factory.mktemp("pages")
    subjects = {"chimney": CHIMNEY, "design": made.design()}
    return {name: tpd.explore(of).write(folder / f"{name}.html") for name, of in subjects.items()}


@pytest.fixture
def show(window, pages) -> Callable[..., Browser]:
    """Shows a page, at first values, and returns the window."""

    def open_page(name: str, width: int = 1280) -> Browser:
        window.errors.clear()
        window.open(pages[name], width)
        return window

    return open_page


def row(window: Browser, name: str, table: str = "results") -> tuple[str, str]:
    """Value and source in a row of a table."""
    cells = (
        f"[...document.querySelectorAll('#{table} tr[data-name=\"{name}\"] td')].map((x) => x.textContent)"
    )
    value, source = window.run(cells)
    return value, source


def move(window: Browser, name: str, place: int) -> float:
    """Move a slider to a place from 0 to 1000, as a hand does; return the value of the field beside it."""
    window.run(
        f"""{{ const slider = document.getElementById("{name}-slider");
        slider.value = {place};
        slider.dispatchEvent(new Event("input", {{ bubbles: true }})); }}"""
    )
    return window.run(f"tpdPage.state.{name}")


def type_in(window: Browser, name: str, text: str) -> float:
    """Write a number into a field; return the value that holds then."""
    window.run(
        f"""{{ const field = document.getElementById("{name}");
        field.value = "{text}";
        field.dispatchEvent(new Event("change", {{ bubbles: true }})); }}"""
    )
    return window.run(f"tpdPage.state.{name}")


def tilt_now(window: Browser) -> float:
    """Exact steady tilt of the chimney at the values of the page, over the slenderness."""
    state = window.run("tpdPage.state")
    return float(exact(CHIMNEY, NAMES, np.array([[state[name] for name in CONTROLS]]))[0, 0])


def test_first_values_are_exact(show):
    window = show("chimney")
    value, source = row(window, "tilt")
    assert source == "exact"
    assert float(value) == pytest.approx(tilt_now(window), rel=4e-3)
    assert row(window, "without")[1] == "exact"
    assert row(window, "largest")[1] == "simulated in the browser, first 12 periods"
    assert not window.errors


def test_a_slider_moves_the_values_and_their_source(show):
    window = show("chimney")
    before = row(window, "tilt")
    mass, length = (move(window, name, place) for name, place in (("mass", 640), ("length", 320)))
    assert window.run("document.getElementById('mass').value") == f"{mass:.6g}"
    value, source = row(window, "tilt")
    assert source == "interpolated"
    assert value != before[0]
    shown, bound = map(float, value.split(" ± "))
    # Both numbers are rounded for the eye.
    assert abs(shown - tilt_now(window)) <= 1.5 * bound + 6e-4
    assert row(window, "natural")[0] == f"{(9.80665 / length) ** 0.5 / 6.283185307:.3g} Hz"
    assert not window.errors


def test_every_control_changes_the_answer_and_can_be_reset(show):
    window = show("chimney")
    first = {name: row(window, name) for name in ("tilt", "swing", "largest")}
    for name in CONTROLS:
        move(window, name, 700)
        assert row(window, "largest") != first["largest"], name
        window.run("document.getElementById('reset').click()")
        assert {n: row(window, n) for n in first} == first, name


def test_a_number_out_of_range_is_moved_into_it(show):
    window = show("chimney")
    low, high = (window.run(f"tpdPage.control('mass').{end}") for end in ("low", "high"))
    assert type_in(window, "mass", "1e9") == high
    assert type_in(window, "mass", "-3") == low
    assert type_in(window, "mass", "") == low, "no number changes nothing"
    assert float(window.run("document.getElementById('mass').value")) == pytest.approx(low, rel=1e-5)


def test_arrow_keys_move_a_slider(show):
    window = show("chimney")
    before = window.run("tpdPage.state.length")
    window.run("document.getElementById('length-slider').focus()")
    for _ in range(5):
        window.press("ArrowRight", 39)
    assert window.run("tpdPage.state.length") > before
    assert row(window, "tilt")[1] == "interpolated"


def test_a_limit_that_is_exceeded_is_named_for_eyes_and_ears(show):
    window = show("chimney")
    type_in(window, "mass", "1500")
    type_in(window, "length", "0.6")
    value, source = row(window, "thickness", "limits")
    assert value.endswith("%: exceeded")
    assert source == "exact"
    # The summary is read aloud a little later.
    time.sleep(0.7)
    summary = window.run("document.querySelector('[role=status]').textContent")
    assert "Limits exceeded: " in summary
    assert "thickness" in summary


def test_where_nodes_differ_in_kind_no_number_is_shown(show):
    window = show("chimney")
    for name, place in (("damping", 10), ("mass", 950), ("frequency", 240)):
        move(window, name, place)
    found = set()
    for place in range(5, 1000, 30):
        move(window, "length", place)
        value, source = row(window, "tilt")
        found.add(source)
        assert (value == "–") == (source == "not interpolated")
        at_rest = source in ("not interpolated", "exact orbits around this point")
        assert (row(window, "clearance", "limits")[1] == "bob at rest") == at_rest
        assert ("±" in value) == (source == "interpolated")
    assert "not interpolated" in found


def test_stored_runs_hold_near_their_design_only(show):
    window = show("design")
    value, source = row(window, "overturned")
    assert source.startswith("validation runs: ")
    assert re.search(r"% \(.* % to .* %\); without a pendulum", value)
    assert row(window, "mean")[1] == source
    assert row(window, "validation") == ("no reason against this design", "validation runs")
    move(window, "mass", 100)
    assert row(window, "overturned")[0] == row(window, "mean")[0] == "not simulated"
    window.run("document.getElementById('reset').click()")
    assert row(window, "overturned") == (value, source)
    move(window, "frequency", 900)
    assert row(window, "overturned")[0] == "not simulated"


def test_a_click_into_the_map_sets_mass_and_length(show):
    window = show("chimney")
    area = window.run("tpdPage.area()")
    window.run("document.getElementById('map').scrollIntoView()")
    box = window.run("document.getElementById('map').getBoundingClientRect().toJSON()")
    x, y = (area["left"] + area["right"]) / 2, (area["top"] + area["bottom"]) / 2
    for kind in ("mousePressed", "mouseReleased"):
        at = {"x": box["left"] + x, "y": box["top"] + y, "button": "left", "clickCount": 1}
        window.ask("Input.dispatchMouseEvent", type=kind, **at)
    for name in ("mass", "length"):
        low, high = (window.run(f"tpdPage.control('{name}').{end}") for end in ("low", "high"))
        assert window.run(f"tpdPage.state.{name}") == pytest.approx((low * high) ** 0.5, rel=0.02)


def test_the_block_rocks_pauses_and_starts_with_a_tilt(show):
    window = show("chimney")
    time.sleep(0.8)
    assert window.run("tpdPage.frames()") > 5
    clock = window.run("tpdPage.clock()")
    assert clock > 0.2
    window.run("document.getElementById('play').click()")
    stopped = window.run("tpdPage.clock()")
    time.sleep(0.2)
    assert window.run("tpdPage.clock()") == stopped
    assert window.run("document.getElementById('play').textContent") == "Play"
    assert type_in(window, "push", "0.4") != 0
    assert window.run("tpdPage.state.push") == 0.4
    assert "Tilt 2.98°" in window.run("document.getElementById('state-with').textContent")
    assert not window.errors


def test_everything_has_a_label(show):
    window = show("design")
    roles = {"slider", "spinbutton", "button", "combobox", "image", "table", "img"}
    nodes = window.ask("Accessibility.getFullAXTree")["nodes"]
    found = [
        (node["role"]["value"], node.get("name", {}).get("value", ""))
        for node in nodes
        if not node.get("ignored") and node.get("role", {}).get("value") in roles
    ]
    assert {role for role, _ in found} >= {"slider", "spinbutton", "button", "combobox", "table"}
    assert all(name for _, name in found), found
    assert len([role for role, _ in found if role == "slider"]) == 5


def test_a_narrow_screen_needs_no_scrolling_to_the_side(show):
    for width in (400, 1280):
        window = show("design", width)
        assert window.run("document.documentElement.scrollWidth") <= width


def test_the_page_of_a_pulse_simulates_it(window, tmp_path):
    file = tmp_path / "job.toml"
    file.write_text(JOB)
    job = tpd.Job.read(file)
    page = tpd.explore(job).write(tmp_path / "pulse.html")
    window.errors.clear()
    window.open(page)
    assert window.run("document.getElementById('response-figure').hidden")
    before = float(row(window, "largest-without")[0].split()[0])
    expected = tpd.transient(tpd.Scene(job.block, job.shaking), model=tpd.Nonlinear(), free=5.0)
    assert before == pytest.approx(float(expected.tilt) * 6.0, rel=2e-3)
    type_in(window, "scale", "0.2")
    assert float(row(window, "largest-without")[0].split()[0]) == 0.0
    assert not window.errors


def test_the_page_needs_no_network_and_is_small(pages):
    for page in pages.values():
        text = page.read_text(encoding="utf-8")
        assert len(text) < 2_000_000
        assert not re.search(r"https?://|<link|@import|src=", text)
        assert not re.search(r"^(import|export) ", text, flags=re.MULTILINE)
