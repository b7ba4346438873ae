"""Blocks of a rocking spectrum without an answer."""

import numpy as np
import pytest

import tpd
from tests.unanswered import unanswered
from tpd.plot.maps import plot_rocking_spectrum

COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
PULSE = tpd.Pulse.one_sine(acceleration=3.0, frequency=1.0)
PERIODS = np.array([2.0, 4.0, 8.0])
RATE = 2.0 * np.pi / PERIODS


def spectrum():
    return tpd.rocking_spectrum(COLUMN, PULSE, periods=PERIODS, mass_ratio=0.05, length_ratio=0.3)


def middle(rows: np.ndarray) -> np.ndarray:
    """Whether a row of parameters is of the second period."""
    return np.isclose(rows[:, 6], float(PULSE.piece) * RATE[1])


@pytest.mark.mends("the tilt up to where the bound on events ended a motion was given as its largest")
def test_a_block_without_an_answer_has_no_tilt(monkeypatch):
    known = spectrum()
    unanswered(monkeypatch, middle)
    found = spectrum()
    for before, after in ((known.bare, found.bare), (known.hung, found.hung)):
        assert np.isnan(after).tolist() == [False, True, False]
        assert np.array_equal(before[[0, 2]], after[[0, 2]])
    assert found.undecided().tolist() == [1, 1]
    assert known.undecided().tolist() == [0, 0]


@pytest.mark.mends("blocks without an answer were not drawn as such")
def test_blocks_without_an_answer_are_drawn(monkeypatch):
    assert not any("no answer" in line.get_label() for line in plot_rocking_spectrum(spectrum()).lines)
    unanswered(monkeypatch, lambda rows: middle(rows) & (rows[:, 1] > 0.0))
    drawn = {line.get_label(): line for line in plot_rocking_spectrum(spectrum()).lines}
    assert drawn["with the pendulum: no answer"].get_xdata().tolist() == [4.0]
    assert "bare block: no answer" not in drawn
