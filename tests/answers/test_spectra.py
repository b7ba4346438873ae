"""Spectra: against critical scales and single blocks, and cells without a result."""

import math

import numpy as np
import pytest

import tpd
from tests.unanswered import unanswered
from tpd.compiled.columns import XI, F

COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
PENDULUM = tpd.Pendulum(mass=450.0, length=0.9, damping_ratio=0.1)
PULSE = tpd.Pulse.one_sine(acceleration=1.0, frequency=1.0)
STRONG = tpd.Pulse.one_sine(acceleration=3.0, frequency=1.0)
PERIODS = np.array([2.0, 4.0, 8.0])


def spectrum(pendulum=None, ratios=(3.0, 5.0), sizes=(0.8, 2.0, 6.0, 12.0)):
    axes = {"frequency_ratios": np.array(ratios), "acceleration_ratios": np.array(sizes)}
    return tpd.overturning_spectrum(COLUMN, PULSE, pendulum, **axes)


def largest(rows: np.ndarray) -> np.ndarray:
    """Whether a row of parameters is of the largest size of the pulse."""
    return rows[:, F] > 11.0 / 6.0


def rocking():
    return tpd.rocking_spectrum(COLUMN, STRONG, periods=PERIODS, mass_ratio=0.05, length_ratio=0.3)


def middle(rows: np.ndarray) -> np.ndarray:
    """Whether a row of parameters is of the second period."""
    return np.isclose(rows[:, XI], float(STRONG.piece) * 2.0 * np.pi / PERIODS[1])


def test_the_overturning_spectrum_has_the_tongues_of_the_critical_scale():
    sizes = np.linspace(0.9, 12.0, 60)
    found = spectrum(PENDULUM, (5.0,), sizes)
    frequency = 5.0 * float(tpd.Scene(COLUMN, PULSE).rate) / (2.0 * math.pi)
    one = tpd.Pulse.one_sine(acceleration=9.80665 / 6.0, frequency=frequency)
    tongues = np.asarray(tpd.critical_scale(tpd.Scene(COLUMN, one)).tongues)
    inside = np.any((sizes[:, None] >= tongues[:, 0]) & (sizes[:, None] < tongues[:, 1]), axis=1)
    assert np.array_equal(found.without_pendulum[:, 0] >= 2, inside)
    # After an impact in the first tongue, without one in the last.
    assert found.without_pendulum[[0, np.flatnonzero(inside)[0], -1], 0].tolist() == [0, 3, 2]
    assert found.safe().shape == (2,)


def test_the_rocking_spectrum_equals_transients_of_single_blocks():
    noise = np.random.default_rng(0).standard_normal(400) * np.sin(np.pi * np.arange(400) / 399.0) ** 2
    record = tpd.Record(noise, 0.02).scaled_to(pga_g=0.5)
    shape = {"mass": 900.0, "friction": 0.0, "restitution": "housner"}
    statue = tpd.Block(width=0.45, height=1.8, **shape)
    found = tpd.rocking_spectrum(
        statue, record, periods=np.array([1.5, 4.0]), mass_ratio=0.1, length_ratio=1.0, damping_ratio=0.4
    )
    for i, period in enumerate(found.periods):
        # A block of the same shape whose rate is this one.
        size = (float(tpd.Scene(statue, record).rate) / (2.0 * math.pi / period)) ** 2
        block = tpd.Block(width=0.45 * size, height=1.8 * size, **shape)
        with_it = tpd.Pendulum(mass=90.0, length=0.9 * size, damping_ratio=0.4)
        for pendulum, tilts in ((None, found.without_pendulum), (with_it, found.with_pendulum)):
            one = tpd.transient(tpd.Scene(block, record), pendulum)
            # Housner's restitution with a bob is another number.
            assert tilts[i] == pytest.approx(float(one.tilt) / 0.25, rel=1e-9)


def test_the_safe_share_excludes_cells_without_a_result(monkeypatch):
    known = spectrum(PENDULUM)
    unanswered(monkeypatch, largest)
    found = spectrum(PENDULUM)
    assert np.all(known.without_pendulum[-1] >= 2)
    assert np.all(found.without_pendulum[-1] == -1)
    for cells, share in zip(known.cases, found.safe(), strict=True):
        assert share == np.mean(cells[:-1] < 2)
    assert (known.undecided().tolist(), found.undecided().tolist()) == ([0, 0], [2, 2])


def test_a_block_without_a_result_has_no_tilt(monkeypatch):
    known = rocking()
    unanswered(monkeypatch, middle)
    found = rocking()
    for before, after in (
        (known.without_pendulum, found.without_pendulum),
        (known.with_pendulum, found.with_pendulum),
    ):
        assert np.isnan(after).tolist() == [False, True, False]
        assert np.array_equal(before[[0, 2]], after[[0, 2]])
    assert (known.undecided().tolist(), found.undecided().tolist()) == ([0, 0], [1, 1])
