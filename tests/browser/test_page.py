"""The page in a real browser: controls, values and their sources, keyboard, labels, and the animation."""

import itertools
import re
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tpd
from tests import designs
from tests.browser.browser import Browser, browser, find
from tests.browser.test_orbits import CHIMNEY, exact
from tests.explore import made
from tpd.answers.statistics import Share
from tpd.design.ground_motion import motion_factors
from tpd.design.job import job_of
from tpd.design.optimise import problem_of
from tpd.limits import stroke_limit
from tpd.theory.no_uplift import uplift

pytestmark = pytest.mark.skipif(
    find() is None, reason="needs a browser (Debian: apt-get install chromium): the page was not tested"
)
NAMES = ["pendulum_mass", "pendulum_length", "pendulum_damping", "frequency", "amplitude"]
CONTROLS = "mass", "length", "damping", "frequency", "amplitude"


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


def status(window: Browser) -> str:
    """The status line, which is written a little later than the tables."""
    pause(window, 500)
    return text_of(window, "summary")


def text_of(window: Browser, name: str) -> str:
    """The text of an element."""
    return window.run(f"document.getElementById('{name}').textContent")


def pause(window: Browser, milliseconds: int) -> None:
    """Wait in the page."""
    window.run(f"new Promise((done) => setTimeout(done, {milliseconds}))")


def fall_of(scene: tpd.Scene, pendulum: tpd.Pendulum | None = None) -> float:
    """Time in s at which a block overturns from rest by the nonlinear model."""
    p = scene.parameters(pendulum)
    times = np.linspace(0.0, 100.0, 1001) * float(p.period)
    for _ in range(2):
        tilts = np.asarray(tpd.simulate(p, np.zeros(4), times, model=tpd.Nonlinear()).ys)[:, 0]
        fall = int(np.flatnonzero(np.isnan(tilts))[0])
        times = np.append(0.0, np.linspace(times[fall - 1], times[fall], 501))
    return float(times[-1]) / float(p.period) / float(scene.excitation.frequency)


def pendulum_of(window: Browser) -> tpd.Pendulum:
    """The pendulum of the controls."""
    mass, length, damping = (window.run(f"tpdPage.state.{name}") for name in CONTROLS[:3])
    return tpd.Pendulum(mass=mass, length=length, damping_ratio=damping)


def tilt_now(window: Browser) -> float:
    """Exact steady tilt of the chimney at the values of the page, over the slenderness."""
    state = window.run("tpdPage.state")
    return float(exact(CHIMNEY, NAMES, np.array([[state[name] for name in CONTROLS]]))[0, 0])


def test_first_values_are_exact_and_a_moved_slider_gives_interpolated_values(show):
    window = show("chimney")
    before, source = row(window, "tilt")
    assert source == "exact"
    assert float(before) == pytest.approx(tilt_now(window), rel=4e-3)
    assert row(window, "without")[1] == "exact"
    assert row(window, "largest")[1] == "simulated in the browser, 100 periods, 118 s"
    mass, length = (move(window, name, place) for name, place in (("mass", 640), ("length", 320)))
    assert window.run("document.getElementById('mass').value") == f"{mass:.6g}"
    value, source = row(window, "tilt")
    assert source == "interpolated"
    assert value != before
    shown, bound = map(float, value.split(" ± "))
    # Both numbers are rounded for the eye.
    assert abs(shown - tilt_now(window)) <= 1.5 * bound + 6e-4
    assert row(window, "natural")[0] == f"{(9.80665 / length) ** 0.5 / 6.283185307:.3g} Hz"
    place = window.run("tpdPage.state.length")
    window.run("document.getElementById('length-slider').focus()")
    window.press("ArrowRight", 39)
    assert window.run("tpdPage.state.length") > place
    assert not window.errors


def test_the_page_stays_responsive_while_runs_are_simulated(show):
    window = show("chimney")
    type_in(window, "damping", "0.2")
    pause(window, 1500)
    assert text_of(window, "runs-text").endswith("are simulated, with and without your pendulum.")
    assert window.run("tpdPage.frames()") > 5, "frames of the last second"
    end = time.monotonic() + 120.0
    while "overturn with your" not in (said := text_of(window, "runs-text")):
        assert time.monotonic() < end
        time.sleep(0.1)
    problem = problem_of(CHIMNEY)
    options = {"ensemble": replace(problem.ensemble, size=100), "conditions": problem.conditions}
    shown = re.findall(r"(\d+) % \((\d+) to (\d+) %\)", said)
    for pendulum, words in zip((pendulum_of(window), None), shown, strict=True):
        share, low, high = map(int, words)
        runs = tpd.outcomes(CHIMNEY, pendulum, equations="nonlinear", **options)
        # Chaos separates a motion near overturning from that of the package.
        assert abs(share - 100.0 * runs.share_overturned.value) <= 2.0
        expected = Share.of(np.arange(100) < share)
        assert (low, high) == (round(100.0 * expected.low), round(100.0 * expected.high))
    window.run("document.getElementById('reset').click()")
    own = r"Of the runs [\d.]+ % overturn without a pendulum and [\d.]+ % with yours\. The least share is"
    for name, is_valid in (("mass", True), ("frequency", False)):
        move(window, name, 900)
        # The map of shares holds for one frequency and one damping ratio.
        assert bool(re.match(own, text_of(window, "shares-text"))) is is_valid
    assert not window.errors


def test_every_control_changes_a_result_and_can_be_reset(show):
    window = show("chimney")
    first = {name: row(window, name) for name in ("tilt", "swing", "largest")}
    for name in CONTROLS:
        move(window, name, 700)
        assert row(window, "largest") != first["largest"], name
        window.run("document.getElementById('reset').click()")
        assert {n: row(window, n) for n in first} == first, name


def test_a_number_out_of_range_is_set_to_the_bound_with_a_notice(show):
    window = show("chimney")
    low, high = (window.run(f"tpdPage.control('mass').{end}") for end in ("low", "high"))
    for words, value, used in (("1e9", high, "3256"), ("-5", low, "162.8"), ("", low, "162.8")):
        assert type_in(window, "mass", words) == value
        sentence = "Mass of the bob must be from 162.8 to 3256 kg, but is"
        assert text_of(window, "notice") == f"{sentence} {words or 'empty'}: {used} is used."
    assert type_in(window, "push", "1.4") == 0.9
    assert "Initial tilt over the slenderness must be from -0.9 to 0.9" in text_of(window, "notice")
    assert type_in(window, "mass", "600") == 600.0
    assert text_of(window, "notice") == "", "a number that is used needs no notice"


def test_an_exceeded_limit_is_visible_and_announced_to_screen_readers(show):
    window = show("chimney")
    type_in(window, "mass", "1500")
    type_in(window, "length", "0.6")
    value, source = row(window, "thickness", "limits")
    assert value.endswith("%: exceeded")
    assert source == "exact"
    assert re.search("Limits exceeded: .*thickness", status(window))


def test_stored_runs_are_shown_only_near_their_design(show):
    window = show("design")
    value, source = row(window, "overturned")
    assert source.startswith("validation runs: ")
    assert re.search(r"^[\d.]+ % with the pendulum, [\d.]+ % without it \(difference: 95 % interval ", value)
    assert row(window, "mean")[1] == source
    assert row(window, "validation") == ("no reason against this design", "validation runs")
    verdict = text_of(window, "verdict")
    assert verdict.startswith("RECOMMENDED")
    move(window, "mass", 100)
    sentence = f"Verdict of the report, which does not hold for the values below: {verdict}"
    assert text_of(window, "verdict") == sentence
    assert row(window, "overturned")[0] == row(window, "mean")[0] == "not simulated"
    window.run("document.getElementById('reset').click()")
    assert row(window, "overturned") == (value, source)
    assert text_of(window, "verdict") == verdict
    move(window, "frequency", 900)
    assert row(window, "overturned")[0] == "not simulated"


def test_a_click_sets_mass_and_length_only_within_the_axes_of_the_map(show):
    window = show("chimney")
    area = window.run("tpdPage.area()")
    window.run("document.getElementById('map').scrollIntoView()")
    box = window.run("document.getElementById('map').getBoundingClientRect().toJSON()")
    x, y = (area["left"] + area["right"]) / 2, (area["top"] + area["bottom"]) / 2
    controls = [window.run(f"tpdPage.control('{name}')") for name in CONTROLS[:2]]
    for place in ((x, y), (1.0, 1.0)):
        for kind in ("mousePressed", "mouseReleased"):
            at = {"x": box["left"] + place[0], "y": box["top"] + place[1], "button": "left", "clickCount": 1}
            window.ask("Input.dispatchMouseEvent", type=kind, **at)
        values = [window.run(f"tpdPage.state.{name}") for name in CONTROLS[:2]]
        assert values == pytest.approx([(x["low"] * x["high"]) ** 0.5 for x in controls], rel=0.02)


def test_the_animation_rocks_pauses_and_restarts_from_a_tilt(show):
    window = show("chimney")
    time.sleep(0.8)
    assert window.run("tpdPage.frames()") > 5
    clock = window.run("tpdPage.clock()")
    assert clock > 0.2
    window.run("document.getElementById('play').click()")
    stopped = window.run("tpdPage.clock()")
    time.sleep(0.2)
    assert window.run("tpdPage.clock()") == stopped
    assert text_of(window, "play") == "Play"
    assert type_in(window, "push", "0.4") == 0.4
    assert "Tilt 2.98°" in text_of(window, "state-with")
    assert not window.errors


def test_every_control_has_an_accessible_label(show):
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
    # The words follow the colour scheme, and figures stay white.
    for scheme, is_dark in (("light", False), ("dark", True), ("", False)):
        window.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        colour = window.run("getComputedStyle(document.body).color")
        assert (min(map(int, re.findall(r"\d+", colour)[:3])) > 128) == is_dark
        back = window.run("getComputedStyle(document.getElementById('shares')).backgroundColor")
        assert back.endswith("(255, 255, 255)")
    # Neither a narrow screen nor a wide one needs horizontal scrolling.
    for width in (400, 1280):
        assert show("design", width).run("document.documentElement.scrollWidth") <= width


BLOCK = {"width": 1.0, "height": 5.0, "mass": 5000.0, "cavity_width": 0.7}
COLUMN = BLOCK | {"height": 6.0}
RECORDS = {"records": ["el-centro", "loma-prieta"], "validation_share": 0.0, "scales": [3.0]}
COSINE = {"pulse": "one-cosine", "pulse_frequency": 0.8, "pga": 3.0 / 9.80665}


@pytest.mark.parametrize(
    ("block", "motion", "push", "choice"),
    [
        (COLUMN, RECORDS, 0.0, 0),
        (COLUMN, RECORDS, 0.3, 1),
        (BLOCK | {"restitution": 0.9}, COSINE, -0.3, 0),
        (BLOCK | {"restitution": 0.9}, COSINE, 0.0, 4),
    ],
)
def test_the_page_of_a_ground_motion_agrees_with_the_package(window, tmp_path, block, motion, push, choice):
    job = job_of({"block": block, "excitation": motion})
    window.errors.clear()
    window.open(tpd.explore(job).write(tmp_path / "ground.html"))
    assert window.run("[...document.querySelectorAll('.harmonic')].every((part) => part.hidden)")
    type_in(window, "push", str(push))
    window.run(
        f"""{{ const motion = document.getElementById("motion");
        motion.value = {choice};
        motion.dispatchEvent(new Event("change", {{ bubbles: true }})); }}"""
    )
    shaken, which = job.conditions.motions[choice], list(job.conditions.which)
    factor = motion_factors(job.scene, job.conditions)[which.index(choice)]
    scene, nu = tpd.Scene(job.block, shaken.scaled(factor)), 1.0 / block["height"]
    y0, said = np.array([push * nu, 0.0, 0.0, 0.0]), status(window).split(" (one motion")[0]
    for name, pendulum, words in (
        ("largest", pendulum_of(window), "With your pendulum the block {};"),
        ("largest-without", None, "without a pendulum it {}"),
    ):
        expected, shown = tpd.transient(scene, pendulum, y0=y0, model=tpd.Nonlinear()), row(window, name)[0]
        outcome = "does not overturn"
        if tpd.status_name(expected.status) == "overturned":
            outcome = f"overturns after {float(expected.overturning_time):.3g} s"
            assert shown == outcome
        else:
            assert float(shown.split()[0]) == pytest.approx(float(expected.tilt) / nu, rel=5e-3)
        assert words.format(outcome) in said
    assert not window.errors


def test_a_design_for_earthquakes_shows_its_shares_over_the_level_and_keeps_its_verdict(window, tmp_path):
    window.errors.clear()
    window.open(tpd.explore(designs.ground_design()).write(tmp_path / "ground.html"))
    before, verdict = row(window, "overturned"), text_of(window, "verdict")
    assert "% with the pendulum" in before[0]
    assert type_in(window, "level", "2.5") == 2.5
    assert (row(window, "overturned"), text_of(window, "verdict")) == (before, verdict)
    assert not window.run("document.getElementById('levels-figure').hidden")
    # A share of the blue line is drawn: the figure is not empty.
    pixels = "document.getElementById('levels').getContext('2d').getImageData(60, 12, 300, 200).data"
    assert window.run(f"new Set({pixels}.filter((x, n) => n % 4 === 0)).size") > 3
    assert not window.errors


def test_the_limit_on_worsening_is_printed_as_a_change_of_the_tilt(show):
    window = show("chimney")
    points = np.array([[window.run(f"tpdPage.state.{name}") for name in CONTROLS]])
    without = points * [0.0, 1.0, 1.0, 1.0, 1.0]
    tilts = [float(exact(CHIMNEY, NAMES, x)[0, 0]) for x in (points, without)]
    text, _ = row(window, "worsening", "limits")
    size, words = re.fullmatch(r"([\d.]+) % (more|less) tilt, 5.0 % more allowed", text).groups()
    change = float(size) * (1 if words == "more" else -1)
    assert change == pytest.approx(100.0 * (tilts[0] / tilts[1] - 1.0), abs=0.06)


def test_limits_under_a_ground_motion_use_the_motion_on_the_page(window, tmp_path):
    job = job_of({"block": BLOCK, "excitation": COSINE, "limits": {"stroke": 0.05}})
    window.open(tpd.explore(job).write(tmp_path / "pulse.html"))
    scene, pendulum = tpd.Scene(job.block, job.shaking), pendulum_of(window)
    expected = tpd.transient(scene, pendulum, model=tpd.Nonlinear())
    share, source = row(window, "stroke", "limits")
    assert source == "simulated in the browser"
    assert float(share.split()[0]) == pytest.approx(100.0 * float(expected.swing) / 0.05, rel=6e-3)
    half = float(job.scene.block.cavity_width) / 2.0
    bob = tpd.limits.Bob()
    mass, rod = bob.built(float(pendulum.mass), float(pendulum.length), 9.80665)
    reach = float(bob.reach(mass, rod, float(expected.rod_angle)))
    shown = float(row(window, "clearance", "limits")[0].split()[0])
    assert shown == pytest.approx(100.0 * reach / half, rel=6e-3)
    assert "Limits exceeded: " in status(window)
    type_in(window, "level", "0.2")
    assert row(window, "largest-without")[0].startswith("0 ")
    assert text_of(window, "ground") == "peak 0.6 m/s²"


def test_the_status_line_begins_with_the_outcome_of_a_block_that_overturns(window, tmp_path):
    # The block without a pendulum overturns only after 21 periods of the weaker excitation.
    for amplitude, name in ((0.15, "largest"), (0.1, "largest-without")):
        scene = tpd.Scene(CHIMNEY.block, tpd.Harmonic(amplitude=amplitude, frequency=0.9))
        window.open(tpd.explore(scene).write(tmp_path / "chimney.html"))
        expected = fall_of(scene, pendulum_of(window) if name == "largest" else None)
        assert row(window, name) == (
            f"overturns after {expected:.3g} s",
            "simulated in the browser, 100 periods, 111 s",
        )
        if name == "largest":
            words = r"With your pendulum the block overturns after [\d.]+ s; without a pendulum it over"
            assert re.match(words, said := status(window))
            assert "(not reached from this start) with your pendulum" in said
            assert row(window, "tilt")[0].endswith("(not reached from this start)")
            # The loads of a block that falls are no loads of a design.
            assert row(window, "tension")[0].startswith("overturns after")


def test_no_value_of_the_page_is_nan(show):
    window = show("chimney")
    for mass, length, damping in itertools.product((0, 500, 1000), (0, 340, 1000), (0, 600)):
        for name, place in (("mass", mass), ("length", length), ("damping", damping)):
            move(window, name, place)
        for table in ("results", "limits"):
            cells = window.run(f"[...document.querySelectorAll('#{table} td')].map((x) => x.textContent)")
            assert not [text for text in cells if re.search("unknown|NaN|undefined|Infinity", text)]
        value, source = row(window, "tilt")
        assert ("±" in value) == (source == "interpolated")
    move(window, "length", 0)
    assert row(window, "bob") == ("no body swings like it", "exact")
    assert row(window, "thickness", "limits")[0].endswith("exceeded")
    # Along this line some cells of the table have nodes of both kinds.
    for name, place in (("damping", 10), ("mass", 950), ("frequency", 240)):
        move(window, name, place)
    sources = set()
    for place in range(5, 1000, 30):
        move(window, "length", place)
        value, source = row(window, "tilt")
        sources.add(source)
        assert (value == "–") == (source == "not interpolated")
        at_rest = source in ("not interpolated", "exact orbits around this point")
        assert (row(window, "clearance", "limits")[1] == "bob at rest") == at_rest
    assert {"interpolated", "not interpolated"} <= sources
    assert not window.errors


def test_a_block_at_rest_has_the_limits_of_its_settled_bob(window, tmp_path):
    scene = tpd.Scene(tpd.paper_scene().block, tpd.Harmonic(amplitude=0.01, frequency=1.5))
    window.open(tpd.explore(scene).write(tmp_path / "paper.html"))
    pendulum = scene.pendulum(mass_ratio=0.2, length_ratio=0.8, damping_ratio=0.1)
    for name, value in zip(CONTROLS, (pendulum.mass, pendulum.length, pendulum.damping_ratio), strict=False):
        type_in(window, name, f"{float(value):.12g}")
    rest = uplift(scene.parameters(pendulum))
    assert float(rest.margin) > 0.0
    assert row(window, "tilt") == ("0", "exact")
    assert row(window, "swing") == (f"{float(rest.swing):.3g} rad", "exact")
    share, source = row(window, "stroke", "limits")
    limit = stroke_limit(problem_of(scene).limits)
    assert float(share.split()[0]) == pytest.approx(100.0 * float(rest.swing) / limit, rel=6e-3)
    assert source == "steady motion, exact"
    assert "Steady-state tilt 0 with your pendulum" in status(window)


def test_the_page_loads_no_external_file_and_is_below_two_megabytes(pages):
    for page in pages.values():
        text = page.read_text(encoding="utf-8")
        assert len(text) < 2_000_000
        assert not re.search(r"https?://|<link|@import|src=|^(import|export) ", text, flags=re.MULTILINE)
