"""Pictures as files that repeat, and axes with two scales."""

import io
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.plots import examples
from tpd.plots.animation import animate
from tpd.plots.compare import plot_benefit, plot_conditions, plot_front
from tpd.plots.drawing import plot_design
from tpd.plots.landscape import plot_landscape
from tpd.plots.response import plot_motions, plot_response
from tpd.plots.style import CASES, LABELS, edge, in_degrees, legend, new_axes, saved
from tpd.scene.parameters import NAMES
from tpd.scene.quantities import QUANTITIES


def test_picture_files_are_reproducible_and_keep_text_as_text():
    def drawn():
        ax = new_axes()
        ax.plot([0.0, 1.0], [0.0, 0.1], label="tilt")
        legend(ax)
        in_degrees(ax)
        return ax

    ax, found = drawn(), saved(drawn().figure, "svg")
    assert found == saved(ax.figure, "svg")
    assert b">tilt</text>" in found
    assert saved(ax.figure).startswith(b"\x89PNG")
    (degrees,) = ax.child_axes
    assert degrees.get_ylim() == pytest.approx(np.degrees(ax.get_ylim()))


def test_the_label_of_an_edge_lies_on_its_longest_part():
    ax, x = new_axes(), np.linspace(0.0, 1.0, 11)
    edge(ax, x, x, np.add.outer(0.0 * x, x - 0.5), "limit", 0.5)
    (name,) = ax.texts
    assert name.get_text() == "limit"
    assert name.xy == pytest.approx((0.5, 0.5), abs=0.1)


def test_two_axes_share_the_horizontal_scale_and_an_empty_legend_is_omitted():
    above, below = new_axes(2)
    below.set_xlim(0.0, 7.0)
    assert above.get_xlim() == (0.0, 7.0)
    legend(above)
    assert above.get_legend() is None


def test_both_cases_can_be_distinguished_without_colour():
    without, pendulum = CASES
    assert all(without[key] != pendulum[key] for key in ("marker", "ls", "mfc"))
    assert all(label.endswith(")") for label in LABELS.values())


HOSTILE = {
    "text.usetex": True,
    "font.family": ["No Such Font"],
    "mathtext.fontset": "stix",
    "axes.unicode_minus": False,
    "axes.prop_cycle": matplotlib.cycler(color=["red"], ls=[":"]),
    "axes.facecolor": "black",
    "text.color": "white",
    "figure.facecolor": "black",
    "figure.constrained_layout.use": True,
    "figure.dpi": 30.0,
    "savefig.format": "pdf",
    "savefig.bbox": "tight",
    "savefig.dpi": 20.0,
    "savefig.facecolor": "black",
    "svg.fonttype": "path",
    "path.sketch": (3, 100, 2),
    "interactive": True,
}
"""Settings of a user that change or break a picture: no TeX is installed here that has all packages."""
RESPONSE = examples.response(0.1, 0.2, 0.3)
PICTURES: dict[str, Any] = {
    "response": lambda _: plot_response((RESPONSE,), 2.5),
    "motions": lambda _: plot_motions(examples.HISTORIES, 0.25),
    "front": lambda _: plot_front(examples.FRONT),
    "benefit": plot_benefit,
    "conditions": plot_conditions,
    "landscape": plot_landscape,
    "drawing": plot_design,
}
"""Pictures of a design, which some do not need."""


def pictures(draw) -> dict[str, bytes]:
    """Files of a picture: by this package, by its user, and as a notebook shows it."""
    found = {kind: saved(draw(), kind) for kind in ("png", "svg")}
    figure = np.ravel(draw())[0].figure
    for name, save in {
        "saved": lambda file: figure.savefig(file, format="png"),
        "shown": lambda file: figure.canvas.print_figure(
            file, format="png", bbox_inches="tight", facecolor="white", dpi=figure.dpi
        ),
    }.items():
        save(file := io.BytesIO())
        found[name] = file.getvalue()
    return found


@pytest.mark.parametrize("name", PICTURES)
def test_matplotlib_settings_of_a_user_do_not_change_a_picture(name, band):
    usual = pictures(lambda: PICTURES[name](band))
    with matplotlib.rc_context(HOSTILE):
        before = dict(matplotlib.rcParams)
        found = pictures(lambda: PICTURES[name](band))
        assert dict(matplotlib.rcParams) == before
    assert [kind for kind in usual if usual[kind] != found[kind]] == []


def test_films_and_user_axes_do_not_depend_on_matplotlib_settings():
    film = examples.SCENE, examples.PENDULUM, examples.HISTORIES
    usual = animate(*film)
    with matplotlib.rc_context(HOSTILE):
        assert animate(*film) == usual
        ax = Figure().subplots()
        plot_front(examples.FRONT, ax)
        assert not any(text.get_usetex() for text in ax.get_legend().get_texts())


def test_every_number_that_can_be_varied_has_a_label():
    assert LABELS.keys() == {*NAMES, *QUANTITIES}
