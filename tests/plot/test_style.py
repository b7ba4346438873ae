"""Pictures as files that repeat, and axes with two scales."""

import numpy as np
import pytest

from tpd.plot.style import CASES, LABELS, edge, in_degrees, legend, new_axes, png, svg


def test_files_repeat_and_words_stay_words():
    def drawn():
        ax = new_axes()
        ax.plot([0.0, 1.0], [0.0, 0.1], label="tilt")
        legend(ax)
        in_degrees(ax)
        return ax

    ax, found = drawn(), svg(drawn().figure)
    assert found == svg(ax.figure)
    assert b">tilt</text>" in found
    assert png(ax.figure).startswith(b"\x89PNG")
    (degrees,) = ax.child_axes
    assert degrees.get_ylim() == pytest.approx(np.degrees(ax.get_ylim()))


def test_an_edge_bears_its_name_at_a_share_of_its_longest_part():
    ax, x = new_axes(), np.linspace(0.0, 1.0, 11)
    edge(ax, x, x, np.add.outer(0.0 * x, x - 0.5), "limit", 0.5)
    (name,) = ax.texts
    assert name.get_text() == "limit"
    assert name.xy == pytest.approx((0.5, 0.5), abs=0.1)


def test_several_axes_share_the_scale_between_them_and_an_empty_legend_is_none():
    above, below = new_axes(2)
    below.set_xlim(0.0, 7.0)
    assert above.get_xlim() == (0.0, 7.0)
    legend(above)
    assert above.get_legend() is None


def test_both_cases_differ_without_colour_and_labels_have_units():
    bare, hung = CASES
    assert all(bare[key] != hung[key] for key in ("marker", "ls", "mfc"))
    assert all(label.endswith(")") for label in LABELS.values())
