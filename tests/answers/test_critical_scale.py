"""Where a scan of factors begins and ends, and what it says of runs without a result."""

from dataclasses import replace

import jax
import numpy as np
import pytest

import tpd
from tests.unanswered import unanswered
from tpd.compiled.columns import F

GRAVITY = 9.80665
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
SINE = tpd.Scene(COLUMN, tpd.Pulse.one_sine(acceleration=GRAVITY / 6.0, frequency=1.2375))
CROSSING = 2.4864693038
"""From which factor on it overturns, see `test_transient.py`."""
BLOCK = tpd.Block(width=1.0, height=4.0, mass=9000.0, friction=0.0, restitution="housner")


def resonant(damping: float, cycles: int, length: float = 1.0) -> tuple[tpd.Scene, tpd.Pendulum]:
    """A block under a train of sines at the own frequency of its bob."""
    frequency = np.sqrt(GRAVITY / length) / (2.0 * np.pi)
    train = tpd.Pulse.sine_train(acceleration=GRAVITY / 4.0, frequency=frequency, cycles=cycles)
    return tpd.Scene(BLOCK, train), tpd.Pendulum(mass=900.0, length=length, damping_ratio=damping)


def falls(scene: tpd.Scene, pendulum: tpd.Pendulum, factor: float) -> bool:
    moved = tpd.Scene(scene.block, scene.excitation.scaled(factor))
    status = tpd.status_name(tpd.transient(moved, pendulum).status)
    assert status in ("stood", "rocked", "overturned")
    return status == "overturned"


HIGH = {"width": 1.3, "height": 10.0, "mass": 16280.0, "centroid_height": 6.5, "radius_of_gyration": 3.2}


@pytest.mark.parametrize(("frequency", "overturns"), [(0.5, 0.13444835), (1.0, 0.31950708)])
def test_a_high_centroid_overturns_at_the_acceleration_of_an_independent_program(frequency, overturns):
    """Digits in g from DOP853 between impacts. With the centroid at half the height it is 27 % more."""
    block = tpd.Block(**HIGH)
    assert block.slenderness == pytest.approx(0.1, rel=1e-15)
    pulse = tpd.Pulse.one_sine(frequency=frequency, acceleration=0.1 * GRAVITY)
    found = tpd.critical_scale(tpd.Scene(block, pulse), highest=4.0)
    assert 0.1 * float(found.scale) == pytest.approx(overturns, rel=1e-7)


def test_a_resonant_bob_overturns_its_block_below_half_the_uplift_scale():
    scene, pendulum = resonant(0.02, 10)
    found = tpd.critical_scale(scene, pendulum, scan=0.05)
    scale = float(found.scale)
    assert 0.05 < scale < 0.34
    assert falls(scene, pendulum, scale * (1.0 + 1e-9))
    assert not falls(scene, pendulum, scale * (1.0 - 1e-9))
    # Well below, nothing that a finer scan tries overturns the block, down to where it no longer lifts.
    assert not any(falls(scene, pendulum, x) for x in np.geomspace(0.3 * scale, 0.95 * scale, 8))


@pytest.mark.parametrize("highest", [2.6, 14.9])
def test_a_tongue_ends_at_the_highest_scale_of_the_scan(highest):
    found = tpd.critical_scale(SINE, scan=0.1, highest=highest)
    assert float(found.scale) == pytest.approx(CROSSING, rel=1e-9)
    assert np.nanmax(found.tongues) <= highest
    # Just below its crossing the block does not overturn, whatever the grid of the scan.
    below = tpd.critical_scale(SINE, scan=0.1, highest=2.486)
    assert np.isinf(float(below.scale))
    assert np.isnan(below.tongues).all()


def test_a_scan_below_uplift_has_no_critical_scale():
    # With a step of 50 % the first factor after half of what lifts the block is 0.75 of it.
    for scene, pendulum in ((SINE, None), resonant(0.01, 30)):
        found = tpd.critical_scale(scene, pendulum, scan=0.5, highest=0.06)
        assert np.isinf(float(found.scale))
        assert "does not overturn up to 0.06 times" in str(found)
        assert np.isnan(found.tongues).all()
    assert np.isnan(jax.jit(jax.grad(lambda e: tpd.critical_scale(lossy(e), highest=0.06).scale))(0.95))
    scene, pendulum = resonant(0.01, 30)
    found = tpd.critical_scale(scene, pendulum, scan=0.02, highest=0.2)
    assert float(found.scale) < 0.17
    assert np.nanmax(found.tongues) == pytest.approx(0.2)


def test_a_record_of_zeros_cannot_be_scaled():
    still, moving = tpd.Record(np.zeros(50), 0.02, name="quiet"), tpd.Record(np.sin(np.arange(50.0)), 0.02)
    with pytest.raises(ValueError, match=r"motion of zeros cannot be scaled to any intensity.*quiet"):
        tpd.critical_scale(tpd.Scene(COLUMN, still))
    for intensity in ("pga_star", "pgv", "scale"):
        with pytest.raises(ValueError, match=r"motion of zeros.*quiet"):
            tpd.fragility(COLUMN, [moving, still], scales=[1.0], intensity=intensity)
        with pytest.raises(ValueError, match=r"motion of zeros.*quiet"):
            tpd.Conditions.records([still, moving], (1.0,), intensity=intensity)


def between(low: float, high: float):
    """Whether the factor on the motion of SINE lies within bounds."""
    unit = float(SINE.ground_parameters().f)
    return lambda rows: (rows[:, F] > low * unit) & (rows[:, F] < high * unit)


def lossy(e) -> tpd.Scene:
    return tpd.Scene(replace(COLUMN, restitution=e), SINE.excitation)


def test_a_run_without_a_result_below_the_crossing_makes_the_scale_unknown(monkeypatch):
    unanswered(monkeypatch, between(1.3, 1.4))
    found = tpd.critical_scale(SINE, scan=0.02)
    assert np.isnan(float(found.scale))
    assert "critical scale unknown" in str(found)
    assert "no result at" in str(found)
    (low, high), *others = np.asarray(found.undecided)
    # The next factors of the scan that have an answer.
    assert 1.3 / 1.02 <= low <= 1.3
    assert 1.4 <= high <= 1.4 * 1.02
    assert np.isnan(others).all()
    assert float(found.tongues[0, 0]) == pytest.approx(CROSSING, rel=1e-9)
    assert np.isnan(jax.grad(lambda e: tpd.critical_scale(lossy(e), scan=0.02).scale)(0.95))


def test_a_run_without_a_result_above_the_crossing_is_reported(monkeypatch):
    known = tpd.critical_scale(SINE, scan=0.02)
    inside = 0.5 * float(known.tongues[0].sum())
    unanswered(monkeypatch, between(0.98 * inside, 1.02 * inside))
    found = tpd.critical_scale(SINE, scan=0.02)
    assert float(found.scale) == float(known.scale)
    assert "; no result at" in str(found)
    low, high = (float(x) for x in found.undecided[0])
    assert low <= 0.98 * inside
    assert high >= 1.02 * inside
    # No part of the interval is listed as overturning, and what is known around it still is.
    assert float(found.tongues[0, 1]) == low
    assert float(found.tongues[1, 0]) == high


def test_runs_without_a_result_at_the_crossing_make_the_scale_unknown(monkeypatch):
    # Within one step of the scan: only the bisection meets them.
    rows = unanswered(monkeypatch, between(CROSSING * (1.0 - 1e-4), CROSSING * (1.0 + 1e-4)))
    found = tpd.critical_scale(SINE, scan=0.03)
    assert np.isnan(float(found.scale))
    low, high = (float(x) / CROSSING - 1.0 for x in found.undecided[0])
    assert -3e-4 < low <= -1e-4
    assert 1e-4 <= high < 3e-4
    assert float(found.tongues[0, 0]) == float(found.undecided[0, 1])
    assert sum(map(len, rows)) < 3000


def test_derivatives_in_the_shape_of_a_pulse_are_nan_and_change_no_others():
    def scale(cycles, phase, width):
        shape = {"cycles": cycles, "phase": phase, "velocity": 0.5, "frequency": 1.0}
        scene = tpd.Scene(replace(COLUMN, width=width), tpd.Pulse.mavroeidis_papageorgiou(**shape))
        return tpd.critical_scale(scene, scan=0.1, highest=4.0).scale

    x, step = np.array([2.0, 0.3, 1.0]), np.array([0.0, 0.0, 1e-5])
    quotient = (float(scale(*(x + step))) - float(scale(*(x - step)))) / 2e-5
    slopes = np.array(jax.jit(jax.jacrev(scale, argnums=(0, 1, 2)))(*x))
    assert np.all(np.isnan(slopes[:2]))
    assert slopes[2] == pytest.approx(quotient, rel=1e-6)


def test_a_gap_of_rounding_size_at_the_crossing_is_ignored(monkeypatch):
    known = float(tpd.critical_scale(SINE, scan=0.02).scale)
    unanswered(monkeypatch, between(known * (1.0 - 1e-12), known * (1.0 + 1e-12)))
    found = tpd.critical_scale(SINE, scan=0.02)
    assert float(found.scale) == pytest.approx(known, rel=1e-9)
    assert np.isnan(found.undecided).all()


def test_a_scan_without_any_result_ends_early(monkeypatch):
    rows = unanswered(monkeypatch, lambda rows: np.ones(len(rows), dtype=bool))
    found = tpd.critical_scale(SINE, scan=0.05)
    assert np.isnan(float(found.scale))
    assert float(found.undecided[0, 1]) == pytest.approx(float(found.highest))
    assert sum(map(len, rows)) < 1000
