"""The paper's Table 1: cases of which it says what happens, as shares over ensembles of runs.

A block of 0.1 m x 0.4 m, base motion 15 mm x cos(2 pi 2.5 Hz t) from rest, 20 s, Housner's impacts, no
damping in the hinge; the base's amplitude within 1 %, half of the starts sudden and half growing over 2 s.
Engines (MuJoCo, Drake, Siconos, Chrono) settle the bare block at 0.345 to 0.349 of arctan nu.
"""

import functools
import math

import numpy as np
import pytest

import tpd
from tpd.answers.ensemble import plan
from tpd.answers.outcomes import LOST, Share
from tpd.models.compiled_nonlinear import settle_nonlinear
from tpd.models.rows import settle_all
from tpd.scene.status import names_of

BLOCK = tpd.Block(width=0.1, height=0.4, mass=16.224, restitution="housner")
SCENE = tpd.Scene(BLOCK, tpd.Harmonic(amplitude=0.015, frequency=2.5))
TOPPLES = math.atan(0.25)
FALLEN = 1.3
STILL = dict.fromkeys(
    (
        "tilt",
        "tilt_rate",
        "swing",
        "swing_rate",
        "frequency",
        "friction",
        "damping",
        "slenderness",
        "mass",
        "length",
    ),
    0.0,
)
ENSEMBLE = tpd.Ensemble(size=48, seed=0, periods=50, ramps=(0.0, 2.0), any_phase=False, **STILL)
BARE = (0.0, 0.4)
MASSES = (0.05, 0.1, 0.2, 0.3, 0.4)
EQUATIONS = ("linear", "nonlinear")


def drawn(mass, length):
    """Pendulum of a mass ratio and of a length over the whole height, and the runs."""
    hung = SCENE.pendulum(mass_ratio=mass, length_ratio=2.0 * length, damping_ratio=0.0) if mass else None
    runs = plan(SCENE.parameters(hung), ENSEMBLE, float(SCENE.rate))
    # A cosine is a sine that begins a quarter of a period late.
    return hung, runs._replace(begin=0.5 * np.pi / np.asarray(runs.p.xi))


@functools.cache
def settled(mass, length, equations):
    """Settled tilts over that of toppling, infinite where the block overturns: of the sudden starts, the
    first of them with 15 mm, and of the growing ones."""
    _, runs = drawn(mass, length)
    how = {"begin": runs.begin, "ramp": runs.periods}
    if equations == "linear":
        found = settle_all(runs.p, runs.y0, model=tpd.Piecewise(max_periods=ENSEMBLE.periods), **how)
    else:
        found = settle_nonlinear(runs.p, runs.y0, periods=ENSEMBLE.periods, **how)
    fell = np.isin(names_of(found.status), LOST) | (np.asarray(found.peak) > FALLEN)
    return parted(np.where(fell, np.inf, np.asarray(found.amplitude)), runs)


@functools.cache
def settled_in_engine(mass, length):
    """The same in MuJoCo."""
    pytest.importorskip("mujoco")
    from tpd.engines.rigid_body import body_of
    from tpd.engines.rollouts import follow

    hung, runs = drawn(mass, length)
    omega, n = SCENE.motion.rate, ENSEMBLE.size
    f, grow = np.asarray(runs.p.f)[:, None] * 9.80665, runs.ramp[:, None]

    def acceleration(t):
        since = t[None] + 0.1
        share = np.where(since < grow, since / np.where(grow > 0.0, grow, 1.0), 1.0)
        return f * share * np.sin(omega * since)

    bodies = [body_of(SCENE, SCENE.parameters(hung), 0.6)] * n
    found = follow(bodies, np.zeros((n, 4)), acceleration, np.full(n, 20.0), np.full(n, 16.0))
    return parted(found.settled, runs)


def parted(tilts, runs):
    return tilts[runs.ramp == 0.0] / TOPPLES, tilts[runs.ramp > 0.0] / TOPPLES


def check_the_bare_block(sudden, growing, tolerance):
    assert sudden[0] == pytest.approx(0.347, abs=tolerance)
    assert np.isfinite(sudden).all()
    assert 0.2 < np.isinf(growing).mean() < 0.8


def check_the_heavier_ones(found):
    """Where 30 and 40 % of mass prevent rocking, and where not; `found(mass, length)` has the tilts."""
    for length in (0.4, 0.6):
        assert np.concatenate(found(0.4, length)).max() < 0.01
        sudden, growing = found(0.3, length)
        assert growing.max() < 0.01
        assert np.isinf(sudden).mean() > 0.1
    assert np.isinf(np.concatenate(found(0.4, 0.1))).mean() > 0.85


@pytest.mark.parametrize(("equations", "tolerance"), [("linear", 0.006), ("nonlinear", 0.0025)])
def test_the_bare_block_settles_if_shaken_suddenly(equations, tolerance):
    check_the_bare_block(*settled(*BARE, equations), tolerance)


@pytest.mark.parametrize("equations", EQUATIONS)
def test_only_forty_per_cent_on_a_long_rod_prevents_rocking(equations):
    check_the_heavier_ones(lambda mass, length: settled(mass, length, equations))


@pytest.mark.parametrize(("equations", "least"), [("linear", 0.5), ("nonlinear", 0.75)])
def test_a_short_rod_overturns_the_block_at_every_mass(equations, least):
    for mass in MASSES:
        assert np.isinf(np.concatenate(settled(mass, 0.1, equations))).mean() > least


@pytest.mark.parametrize("equations", EQUATIONS)
def test_up_to_twenty_per_cent_of_mass_nothing_is_gained(equations):
    bare = np.concatenate(settled(*BARE, equations))
    for mass in MASSES[:3]:
        tilts = np.concatenate([np.concatenate(settled(mass, x, equations)) for x in (0.1, 0.4, 0.6)])
        assert Share.of(np.isinf(tilts)).low > Share.of(np.isinf(bare)).value
        assert np.median(tilts[np.isfinite(tilts)]) > np.median(bare[np.isfinite(bare)])


@pytest.mark.slow
def test_an_engine_says_the_same():
    check_the_bare_block(*settled_in_engine(*BARE), 0.006)
    check_the_heavier_ones(settled_in_engine)
    for case in (BARE, (0.05, 0.1), (0.1, 0.6), (0.2, 0.4), (0.3, 0.6)):
        ours, theirs = (
            Share.of(np.isinf(np.concatenate(tilts)))
            for tilts in (settled(*case, "nonlinear"), settled_in_engine(*case))
        )
        assert ours.low < theirs.high
        assert theirs.low < ours.high
