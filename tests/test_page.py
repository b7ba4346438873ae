"""The page, its drawing and its animation, and what a design is sensitive to."""

import dataclasses
import io
import logging
from html.parser import HTMLParser
from pathlib import Path

import jax
import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

import tpd
from tpd.analysis.compare_models import Check, Rung
from tpd.analysis.ensemble import Ensemble, Outcomes, Verdict
from tpd.analysis.response import Response
from tpd.analysis.sensitivity import Elasticities, elasticities
from tpd.core.formatting import number
from tpd.design.job import Job
from tpd.design.result import Candidate, Design, DesignStatus, History, Round, StartStatus
from tpd.plot.animation import animate
from tpd.plot.drawing import corners, plot_scene, rod
from tpd.plot.style import png
from tpd.report import html as page
from tpd.report.many import walls
from tpd.report.notes import notes, strikes
from tpd.report.single_page import Told, design_page

DOT = png(plot_scene(tpd.paper_scene(), None).figure)
HUNG = tpd.Pendulum(mass=1.6, length=0.12, damping_ratio=0.1)
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


def read(html: str) -> Reader:
    reader = Reader()
    reader.feed(html)
    reader.close()
    assert reader.open == []
    return reader


CANDIDATE = Candidate(
    mass_ratio=0.1,
    length_ratio=0.6,
    damping_ratio=0.1,
    amplitude=0.04,
    stroke=0.3,
    status="rocking",
    periods=1,
    multiplier=0.8,
    margin=-0.2,
    smoothed_amplitude=0.0401,
    smoothed_stroke=0.3,
    smoothed_status="rocking",
    agree=True,
)


def design(**changes) -> Design:
    path, none = np.zeros((2, 3)), np.zeros((0, 3))
    history = History(
        designs=np.zeros((2, 3, 3)),
        amplitude=path,
        stroke=path,
        margin=path,
        status=path.astype(str),
        screened=none,
        screened_amplitude=none[:, 0],
        screened_stroke=none[:, 0],
        screened_status=none[:, 0].astype(str),
    )
    told = Round(
        limit=0.5,
        mass_ratio=0.1,
        length_ratio=0.6,
        damping_ratio=0.1,
        amplitude=0.041,
        stroke=0.31,
        status="rocking",
        objections=(),
    )
    settings = {
        "scene": tpd.paper_scene(),
        "space": tpd.DesignSpace(),
        "pendulum": HUNG,
        "amplitude": 0.04,
        "amplitude_without": 0.0833,
        "stroke": 0.3,
        "status": DesignStatus.found,
        "winner": CANDIDATE,
        "runner_up": None,
        "bare": dataclasses.replace(CANDIDATE, mass_ratio=0.0, amplitude=0.0833, smoothed_amplitude=0.0833),
        "starts": (StartStatus.converged, StartStatus.lost),
        "history": history,
        "peak": (0.06, 0.4),
        "overturned_nearby": (8, 2, 1),
        "verdict": None,
        "rounds": (told,),
        "tolerance": 0.01,
        "seed": 3,
    }
    return Design(**(settings | changes))


NAMES = ("mu", "lam", "zeta", "nu", "k", "f", "xi")
SENSITIVE = Elasticities(
    of="amplitude",
    value=0.04,
    at=dict.fromkeys(NAMES, 0.1),
    slopes=dict(zip(NAMES, np.linspace(-2.0, 1.0, 7).tolist(), strict=True)),
)


def told(directory="out", **changes) -> Told:
    names = ("drawing.png", "animation.gif", "response.png", "motion.png", "search.png")
    return Told(design(**changes), Job(), (), dict.fromkeys(names, DOT), SENSITIVE, Path(directory), **LADDER)


LADDER = {
    "ladder": Check(
        rungs=(
            Rung(
                name="nonlinear",
                amplitude=0.04,
                stroke=0.3,
                status="rocking",
                seconds=0.01,
                first=1.0,
                neglects="a < b",
            ),
        ),
        limit=0.5,
        bare=0.08,
    )
}


def test_the_page_is_whole_and_needs_nothing_from_outside():
    html = design_page(told())
    reader = read(html)
    assert "http:" not in html
    assert "https:" not in html
    assert not {"script", "link", "iframe"} & {tag for tag, _ in reader.tags}
    pictures = [attributes for tag, attributes in reader.tags if tag == "img"]
    assert len(pictures) == 5
    for picture in pictures:
        assert picture["src"].startswith("data:image/png;base64,")
        assert len(picture["alt"]) > 20
    assert sum(tag == "figcaption" for tag, _ in reader.tags) == 5


def test_warnings_come_before_the_answer_and_everything_is_told():
    text = read(design_page(told())).text
    order = [DesignStatus.found.value, "DANGER: of 8 shakings", "The answer", "1.6 kg", "What was assumed"]
    places = [text.index(x) for x in order]
    assert places == sorted(places)
    for part in ("0.12 m", "N m s/rad", "a < b", "-2", "Seed 3", "jax", "mass_ratio", "1 met no design"):
        assert part in text


def test_a_bob_that_would_strike_the_walls_is_a_danger_with_a_remedy():
    """Half width 0.05 m, length 0.12 m; a ball of 0.5 kg has a radius of 0.0248 m: 0.2118 rad are left."""
    light = dataclasses.replace(HUNG, mass=0.5)
    ball = (0.5 / 7850.0 * 3.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    most = np.arcsin((0.05 - ball) / 0.12)

    def said(**changes):
        return [x for x in notes(design(pendulum=light, **changes)) if "STRIKE" in x]

    # The bob's angle and the block's tilt together: 0.04 rad settled, 0.06 rad on the way.
    assert said(stroke=most - 0.04 - 1e-6, peak=(0.06, most - 0.06 - 1e-6)) == []
    (note,) = said(stroke=0.1, peak=(0.06, most - 0.06 + 1e-6))
    assert note.startswith("DANGER: on the way there the bob may swing 0.0252 m out of the block's axis")
    assert f"up to {np.floor(1e3 * most) / 1e3:g} rad between rod and block, a point up to 0.429 rad" in note
    (note,) = said(stroke=0.46, peak=(0.06, 0.6))
    assert "DANGER: once settled the bob may swing 0.0575 m" in note
    dangers = [x.startswith("DANGER") for x in notes(design(stroke=0.5))]
    assert 1 < sum(dangers) < len(dangers)
    assert dangers == sorted(dangers, reverse=True)


def test_a_ball_wider_than_the_block_fits_at_no_angle():
    (note,) = strikes(tpd.paper_scene().block, dataclasses.replace(HUNG, mass=16.0), {"settled": 0.0})
    assert "stays off them at no angle" in note


def test_over_conditions_the_walls_are_watched_settled_and_in_the_ensemble():
    light = dataclasses.replace(HUNG, mass=0.5)
    harmless = Verdict(hung=outcomes(2), bare=outcomes(2))

    def said(stroke, lost=2):
        verdict = Verdict(hung=outcomes(lost), bare=outcomes(lost))
        return walls(tpd.paper_scene().block, light, np.array([[0.05, stroke, np.nan]]), verdict)

    # Half of the runs reach 0.1 rad of the bob and of the block, 0.2 rad together: 0.0238 m.
    assert said(0.2) == []
    (note,) = said(0.5)
    assert "once settled under the worst condition the bob may swing 0.0575 m" in note
    (note,) = walls(tpd.paper_scene().block, dataclasses.replace(HUNG, mass=0.6), np.zeros(1), harmless)
    assert "in half of the runs the bob may swing 0.0238 m" in note
    assert said(0.2, lost=30) == []


def test_of_frequencies_that_are_worse_a_grave_one_is_told_and_a_danger():
    frequency = np.array([2.4, 2.45, 2.6])

    def response(*amplitudes):
        rocking = np.full(3, "rocking")
        return Response(
            frequency=frequency, amplitude=np.array(amplitudes), stroke=np.full(3, 0.1), status=rocking
        )

    def told(*hung):
        (note,) = (
            x for x in notes(design(), (response(0.01, 0.01, 0.01), response(*hung))) if "rocks more" in x
        )
        return note

    assert told(0.01, 0.015, 0.019).startswith("at 2.45 Hz")
    assert told(0.01, 0.015, 0.021).startswith("DANGER: at 2.6 Hz")


def test_bounds_that_hold_a_design_are_named():
    space = tpd.DesignSpace(mass_ratio=(0.01, 0.1), damping_ratio=(0.05, 0.1), stroke=0.3)
    said = " ".join(notes(design(space=space)))
    assert "the mass ratio is at the largest allowed, 0.1." in said
    assert "the damping ratio is at the largest allowed, 0.1." in said
    assert "the settled stroke is at its limit, 0.3 rad." in said
    assert "at the largest" not in " ".join(notes(design()))


def test_the_command_repeats_the_run_and_what_users_give_is_escaped():
    html = design_page(told("<b>my & run"))
    assert "<b>my" not in html
    assert "tpd optimise --scene '<b>my & run/scene.toml' --out '<b>my & run-again'" in read(html).text


def test_a_refused_design_is_not_shown_as_an_answer():
    refusal = dataclasses.replace(design().rounds[0], objections=("by the nonlinear equations it falls",))
    page = read(design_page(told(pendulum=None, status=DesignStatus.nonlinear_objects, rounds=(refusal,))))
    assert ("p", {"class": "danger"}) in page.tags
    assert "none to offer" in page.text
    assert "best found, not offered" in page.text
    assert "refused: by the nonlinear equations it falls" in page.text
    assert "mass of the bob" not in page.text


def outcomes(lost: int) -> Outcomes:
    size = 40
    over = np.arange(size) < lost
    angle = np.where(over, np.inf, 0.1)
    return Outcomes(
        ensemble=Ensemble(size=size),
        status=np.where(over, "overturned", "rocking"),
        peak=angle,
        amplitude=angle,
        peak_stroke=angle,
        stroke=angle,
        ramp=np.where(np.arange(size) % 2, 2.0, 0.0),
    )


def test_an_ensemble_in_which_the_pendulum_harms_is_a_danger():
    worse = Verdict(hung=outcomes(20), bare=outcomes(2))
    reader = read(design_page(told(verdict=worse)))
    assert reader.text.index("DANGER: in the ensemble 18 runs overturn") < reader.text.index("The answer")
    assert "50.0% (" in reader.text
    assert "growing for 2 s" in reader.text
    better = Verdict(hung=outcomes(2), bare=outcomes(20))
    assert "DANGER: in the ensemble" not in design_page(told(verdict=better))


def test_elasticities_that_are_refused_say_why():
    none = Elasticities(of="amplitude", value=np.inf, at={}, slopes={}, refused="overturned: it falls <over>")
    text = read(design_page(dataclasses.replace(told(), sensitive=none))).text
    assert "There is no gradient to tell: overturned: it falls <over>" in text


def test_tables_are_escaped_and_numbers_stand_to_the_right():
    reader = read(page.table(("name", "size"), [("<i>", 1.0), ("none", None), ("?", float("nan"))]))
    cells = [attributes for tag, attributes in reader.tags if tag == "td"]
    assert cells == [{}, {"class": "n"}] * 3
    assert "<i>" in reader.text
    assert reader.text.count("–") == 2
    with pytest.raises(ValueError, match="must have 2 cells as the head has, but has 1"):
        page.table(("name", "size"), [("one",)])


def test_only_pictures_that_are_told_in_words_are_shown():
    with pytest.raises(ValueError, match="`alt` must say what is to be seen"):
        page.figure(DOT, alt="", caption="")
    with pytest.raises(ValueError, match="must be a PNG or a GIF"):
        page.figure(b"BM", alt="a bitmap", caption="")


@pytest.mark.parametrize(
    ("x", "text"),
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
def test_numbers_for_people(x, text):
    assert number(x) == text


CHIMNEY = tpd.Scene(tpd.Block(width=1.0, height=10.0, mass=20e3), tpd.Harmonic(amplitude=0.15, frequency=0.8))


@pytest.mark.parametrize(
    ("scene", "pendulum"),
    [
        (tpd.paper_scene(), HUNG),
        (CHIMNEY, tpd.Pendulum(mass=2e3, length=10.0, damping_ratio=0.1)),
        (CHIMNEY, tpd.Pendulum(mass=2e3, length=0.5, damping_ratio=0.1)),
        (CHIMNEY, None),
    ],
)
def test_the_drawing_is_to_scale_and_nothing_is_cut_off_or_covered(scene, pendulum):
    ax = plot_scene(scene, pendulum, stroke=0.0 if pendulum is None else 0.5)
    figure = ax.figure
    figure.canvas.draw()
    assert ax.get_aspect() == 1.0
    block = ax.patches[0].get_window_extent()
    assert block.height / block.width == pytest.approx(scene.block.height / scene.block.width, rel=0.02)
    # An annotation's own extent would count the line that leads to it.
    words = [Text.get_window_extent(t) for t in ax.texts if t.get_text()]
    for i, box in enumerate(words):
        assert figure.bbox.x0 <= box.x0
        assert box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0
        assert box.y1 <= figure.bbox.y1
        assert not any(box.overlaps(other) for other in words[i + 1 :])


@pytest.mark.parametrize("tilt", [0.0, 0.3, -0.3, 0.5 * np.pi])
def test_a_tilted_block_stands_on_its_corner(tilt):
    scene = tpd.paper_scene()
    block = corners(scene, tilt, base=0.02)
    assert block[:, 1].min() == pytest.approx(0.0, abs=1e-12)
    pivot = block[0] if tilt > 0 else block[1]
    assert pivot == pytest.approx((0.02 + (-0.05 if tilt > 0 else 0.05), 0.0), abs=1e-12)
    sides = np.linalg.norm(np.diff(block, axis=0), axis=1)
    assert sides == pytest.approx([0.1, 0.4, 0.1])
    # Counterclockwise: the top moves to the left.
    assert block[2:, 0].mean() - 0.02 == pytest.approx(-np.sign(tilt) * abs(block[2:, 0].mean() - 0.02))
    hinge, bob = rod(block, 0.2, 0.3)
    assert hinge == pytest.approx(0.5 * (block[2] + block[3]))
    assert bob - hinge == pytest.approx((0.2 * np.sin(0.3), -0.2 * np.cos(0.3)))


def test_the_animation_is_small_and_moves():
    film = animate(tpd.paper_scene(), HUNG)
    assert len(film) < 3e6
    image = Image.open(io.BytesIO(film))
    assert image.format == "GIF"
    assert image.n_frames > 60
    assert image.info["duration"] == 50
    frames = []
    for i in (0, 30):
        image.seek(i)
        frames.append(np.asarray(image.convert("L")))
    # Of the block without a pendulum, the upper half.
    height, width = frames[0].shape
    assert (frames[0] != frames[1])[: height // 2, : width // 2].mean() > 0.02


def test_an_overturned_block_lies_and_is_called_so():
    from tpd.plot.animation import _reel

    scene = dataclasses.replace(tpd.paper_scene(), motion=tpd.Harmonic(amplitude=0.05, frequency=2.5))
    reel = _reel(scene, None, np.arange(100) / 20.0)
    assert reel.lost[-1]
    assert not reel.lost[0]
    assert np.abs(reel.tilt).max() == pytest.approx(0.5 * np.pi)
    assert np.isfinite(reel.tilt).all()


def test_elasticities_are_those_of_differences():
    p = tpd.paper_scene().parameters(tpd.Pendulum(mass=1.6, length=0.3, damping_ratio=0.1))
    found = elasticities(p)
    assert found.of == "amplitude"
    assert found.value == float(tpd.steady_state(p).amplitude)
    assert set(found.slopes) == set(NAMES)
    for name in NAMES:
        x, h = getattr(p, name), 1e-5
        sizes = [
            float(tpd.steady_state(dataclasses.replace(p, **{name: x * s})).amplitude) for s in (1 - h, 1 + h)
        ]
        assert found.slopes[name] == pytest.approx(np.diff(np.log(sizes))[0] / (2 * h), rel=1e-4, abs=1e-6)


def test_elasticities_of_rest_are_the_margins_and_of_what_is_lost_refused():
    rest = tpd.Scene(tpd.paper_scene().block, tpd.Harmonic(amplitude=0.005, frequency=2.5)).parameters()
    found = elasticities(rest)
    assert found.of == "margin"
    assert set(found.slopes) == {"nu", "k", "f", "xi"}
    h = 1e-6
    more = float(tpd.uplift(dataclasses.replace(rest, f=rest.f * (1 + h))).margin)
    assert found.slopes["f"] == pytest.approx(0.01 * (more - found.value) / h, rel=1e-4)
    lost = tpd.Scene(tpd.paper_scene().block, tpd.Harmonic(amplitude=0.05, frequency=2.5)).parameters()
    found = elasticities(lost)
    assert found.slopes == {}
    assert found.refused.startswith("overturned: The tilt grows beyond any return")


def test_a_gradient_after_a_value_has_nothing_to_compile(caplog):
    p = tpd.paper_scene().parameters()
    tpd.steady_state(p)
    with jax.log_compiles(), caplog.at_level(logging.WARNING):
        slope = jax.grad(lambda q: tpd.steady_state(q).amplitude)(jax.tree.map(jax.numpy.asarray, p))
    assert np.isfinite(slope.f)
    assert "_solved" not in caplog.text
