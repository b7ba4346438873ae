"""Cells of an overturning spectrum without an answer."""

import numpy as np
import pytest

import tpd
from tests.unanswered import unanswered
from tpd.plot.maps import plot_overturning_spectrum

COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
HUNG = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
PULSE = tpd.Pulse.one_sine(acceleration=1.0, frequency=1.0)
RATIOS, SIZES = np.array([3.0, 5.0]), np.array([0.8, 2.0, 6.0, 12.0])


def spectrum(pendulum=None):
    return tpd.overturning_spectrum(
        COLUMN, PULSE, pendulum, frequency_ratios=RATIOS, acceleration_ratios=SIZES
    )


def largest(rows: np.ndarray) -> np.ndarray:
    """Whether a row of parameters is of the largest size of the pulse."""
    return rows[:, 5] > 11.0 / 6.0


@pytest.mark.mends("cells without an answer counted as overturned")
def test_the_share_that_is_safe_is_that_of_the_cells_with_an_answer(monkeypatch):
    known = spectrum(HUNG)
    unanswered(monkeypatch, largest)
    found = spectrum(HUNG)
    assert np.all(known.bare[-1] >= 2)
    assert np.all(found.bare[-1] == -1)
    for cells, share in zip((known.bare, known.hung), found.safe(), strict=True):
        assert share == np.mean(cells[:-1] < 2)
    assert known.safe()[0] < found.safe()[0]
    assert found.undecided().tolist() == [2, 2]
    assert known.undecided().tolist() == [0, 0]


@pytest.mark.mends("without any answer no cell was safe")
def test_without_any_answer_no_share_is_known(monkeypatch):
    unanswered(monkeypatch, lambda rows: np.ones(len(rows), dtype=bool))
    assert np.isnan(spectrum().safe()).tolist() == [True]


@pytest.mark.mends("cells without an answer had the colour of those that stand")
def test_cells_without_an_answer_are_drawn(monkeypatch):
    unanswered(monkeypatch, lambda rows: largest(rows) & (rows[:, 1] > 0.0))
    bare, hung = plot_overturning_spectrum(spectrum(HUNG))
    assert not bare.lines
    (crosses,) = hung.lines
    assert crosses.get_label() == "no answer: 2 of 8"
    assert crosses.get_marker() == "x"
    assert crosses.get_xdata().tolist() == [3.0, 5.0]
    assert crosses.get_ydata().tolist() == [12.0, 12.0]
    assert hung.get_legend() is not None
