"""Speed of the page of `tpd explore`: writing it, moving its sliders, and its animation."""

import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import tpd
from tests.benchmarks.stored import columns
from tests.browser.browser import browser, find

QUESTION = "How fast is the page of `tpd explore`?"
SEED = None
AIMS = {"page": "3 s", "slider": "30 ms", "frames": "50 a second"}
"""Largest time to write the page and to answer a slider, and least number of frames."""
CHIMNEY = tpd.Scene(
    tpd.Block(width=1.3, height=10.0, mass=16280.0, radius_of_gyration=2.92, cavity_width=0.9),
    tpd.Harmonic(amplitude=0.081, frequency=0.85),
)
SLIDERS = "mass", "length", "damping", "frequency", "amplitude"


def run(quick: bool) -> list[dict[str, Any]]:
    """Write the page of the chimney, and use it in a headless browser."""
    program = find()
    if program is None:
        raise RuntimeError("this benchmark needs a browser (Debian: apt-get install chromium)")
    moves, seconds = (4, 1.0) if quick else (40, 5.0)
    # The first page loads compiled code.
    page = tpd.explore(CHIMNEY)
    spent = []
    for _ in range(2 if quick else 5):
        begun = time.perf_counter()
        tpd.explore(CHIMNEY)
        spent.append(time.perf_counter() - begun)
    rows = [{"what": "write the page, s", **_spread(spent), "aim": AIMS["page"]}]
    with tempfile.TemporaryDirectory() as folder, browser(program) as window:
        window.open(page.write(Path(folder) / "explore.html"))
        for slider in SLIDERS:
            # The first moves are not counted: the browser compiles what runs often.
            times = [_move(window, slider, (37 * i) % 1000) for i in range(10 + moves)][10:]
            rows.append(
                {"what": f"move the slider of the {slider}, ms", **_spread(times), "aim": AIMS["slider"]}
            )
        frames = []
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            time.sleep(1.0)
            frames.append(float(window.run("tpdPage.frames()")))
        rows.append({"what": "frames in a second", **_spread(frames), "aim": AIMS["frames"]})
    return rows


def _move(window: Any, slider: str, place: int) -> float:
    """Move a slider; return the time until all values and figures are drawn, ms."""
    script = f"""(() => {{ const slider = document.getElementById("{slider}-slider");
    slider.value = {place};
    slider.dispatchEvent(new Event("input", {{ bubbles: true }}));
    return tpdPage.duration(); }})()"""
    return float(window.run(script))


def _spread(values: list[float]) -> dict[str, float]:
    return {"median": statistics.median(values), "least": min(values), "largest": max(values)}


def table(rows: list[dict[str, Any]]) -> str:
    """Median, least and largest of each measurement."""
    numbers = {name: f"{{{name}:.3g}}" for name in ("median", "least", "largest")}
    return columns(rows, **{"": "{what}"}, **numbers, aim="{aim}")
