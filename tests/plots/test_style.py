"""Pictures as files that repeat, and axes with two scales."""

import io
from typing import Any

import matplotlib
import numpy as np
import pytest

from tests.plots import examples
from tpd.plots.drawing import plot_design
from tpd.plots.landscape import plot_landscape
from tpd.plots.response import plot_motions
from tpd.plots.style import LABELS, in_degrees, legend, new_axes, saved
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
PICTURES: dict[str, Any] = {
    "motions": lambda _: plot_motions(examples.HISTORIES, 0.25),
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


def test_every_number_that_can_be_varied_has_a_label():
    assert LABELS.keys() == {*NAMES, *QUANTITIES}
