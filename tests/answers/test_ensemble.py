"""Ensembles of runs: what each run is, and what is said of all of them."""

import dataclasses
import functools

import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests import reference
from tests.designs import outcomes as by_hand
from tests.reference import WITH as CASES
from tpd.answers.ensemble import outcomes, plan
from tpd.answers.statistics import Share
from tpd.scene.impacts import housner
from tpd.scene.status import Status, code_of, names_of

WITH = tpd.Parameters(nu=0.25, mu=0.2, lam=0.8, zeta=0.1, k=0.05, f=0.5, xi=3.5)
SPREADS = (
    *("tilt", "tilt_rate", "swing", "swing_rate", "amplitude", "frequency", "friction", "damping"),
    *("restitution", "slenderness", "mass", "length"),
)
STILL = tpd.Ensemble(size=8, any_phase=False, growth=(0.0,), **dict.fromkeys(SPREADS, 0.0))


def followed(p, y0, *, begin=0.0, ramp=0.0, periods):
    """Where one run has come that is cut after so many periods."""
    return reference.settled(tpd.Terms.linear, p, np.array([y0]), begin=begin, ramp=ramp, periods=periods)


@pytest.mark.parametrize(
    # Source of the second: `SETTLED` of tests/models/test_piecewise.py.
    ("equations", "amplitude", "rtol"),
    [("linear", CASES[3].amplitude, 1e-5), ("nonlinear", 0.0659875, 1.5e-5)],
)
def test_without_scatter_every_run_reaches_the_steady_state_from_rest(equations, amplitude, rtol):
    found = outcomes(WITH, ensemble=dataclasses.replace(STILL, periods=200), equations=equations)
    assert set(names_of(found.outcome)) == {"rocking"}
    np.testing.assert_allclose(found.settled_tilt, amplitude, rtol=rtol)
    assert np.all(found.tilt >= found.settled_tilt)


def test_scatter_of_restitution_does_not_change_other_samples():
    lossy = dataclasses.replace(WITH, e=0.9)
    without, scattered = (plan(lossy, tpd.Ensemble(size=96, restitution=w)) for w in (0.0, 0.05))
    np.testing.assert_array_equal(without.y0, scattered.y0)
    np.testing.assert_array_equal(without.p.k, scattered.p.k)
    np.testing.assert_array_equal(without.p.e, 0.9)
    assert 0.855 <= scattered.p.e.min() < 0.87 < scattered.p.e[0] == 0.9 < 0.93 < scattered.p.e.max() <= 0.945
    with pytest.raises(
        ValueError, match="`restitution` can vary only if it is a number below 1, but it is 1"
    ):
        outcomes(tpd.paper_scene(), ensemble=tpd.Ensemble(size=4, restitution=0.1))


def test_housners_restitution_has_the_scatter_measured_on_limestone():
    p = tpd.Parameters(nu=0.25, mu=0.1, lam=0.8, zeta=0.1, k=0.0, f=0.5, xi=3.5, e=None)
    q = plan(p, tpd.Ensemble(size=2000)).p
    # Each run has Housner's e of its own block and bob.
    apart = np.asarray(q.e) - housner(q.nu, q.rho, q.mu)
    assert np.mean(apart) == pytest.approx(-0.01, abs=1e-3)
    assert np.std(apart) == pytest.approx(0.03, abs=1e-3)
    assert apart[0] == pytest.approx(-0.01, abs=1e-15)
    assert -0.1 - 1e-4 <= np.min(apart) < -0.09
    # A normal distribution has 31.7 % of its values beyond one standard deviation.
    assert np.mean(np.abs(apart + 0.01) > 0.03) == pytest.approx(0.317, abs=2e-3)
    # A run without the bob has the same difference: the cases of a pair differ by Housner's formula only.
    alone = plan(dataclasses.replace(p, mu=0.0), tpd.Ensemble(size=2000)).p
    np.testing.assert_allclose(np.asarray(alone.e) - housner(alone.nu, alone.rho), apart, atol=1e-14)
    slender = plan(dataclasses.replace(p, nu=0.1), tpd.Ensemble(size=2000)).p
    # Every impact loses energy, so every run can end at rest.
    assert np.max(slender.e) == 0.999
    assert np.mean(np.asarray(slender.e) == 0.999) == pytest.approx(0.2, abs=0.1)


def test_block_and_pendulum_scatter_by_default():
    e = tpd.Ensemble(size=256, tilt=0.2, disturbed=0.5)
    runs, lossy = plan(WITH, e), plan(dataclasses.replace(WITH, e=0.9), e)
    spread = (("nu", 0.02), ("mu", 0.02), ("lam", 0.02), ("zeta", 0.2), ("k", 0.2), ("xi", e.frequency))
    for name, width in spread:
        factor = np.asarray(getattr(runs.p, name)) / getattr(WITH, name)
        assert factor[0] == pytest.approx(1.0, rel=1e-15)
        assert 1.0 - width <= factor.min() < 1.0 - 0.98 * width
        assert 1.0 + 0.98 * width < factor.max() <= 1.0 + width
    np.testing.assert_array_equal(runs.p.e, 1.0)
    # The base's displacement stays: f goes with the square of the frequency.
    amplitude = np.asarray(runs.p.f) / WITH.f / (np.asarray(runs.p.xi) / WITH.xi) ** 2
    np.testing.assert_allclose(amplitude, 1.0, atol=e.amplitude + 1e-12)
    assert np.abs(runs.y0[:, 0]).max() <= 0.2 * WITH.nu
    assert np.all((runs.begin >= 0) & (runs.begin < 2 * np.pi / np.asarray(runs.p.xi)))
    assert set(runs.growth) == {0.0, 10.0}
    assert np.mean(runs.growth == 0.0) == pytest.approx(0.5, abs=0.02)
    assert (*runs.y0[0], runs.begin[0], runs.growth[0], runs.disturbed[0]) == (0.0,) * 7
    assert 0.882 <= np.min(lossy.p.e) < 0.883
    found = outcomes(WITH, ensemble=dataclasses.replace(e, size=4, periods=10))
    np.testing.assert_allclose(found.lam, plan(WITH, dataclasses.replace(e, size=4)).p.lam)


def test_the_share_overturned_by_growing_excitation_equals_an_independent_code():
    """Source: closed forms over steps of 0.02 and of 0.01 for 100 periods (commit 42b9f9c)."""
    scene = tpd.paper_scene()
    runs = plan(scene.parameters(), tpd.Ensemble(size=256, seed=5, disturbed=1.0, slenderness=0.0))
    # That code lets the shaking grow over 2 s, whatever the frequency of the run.
    two_seconds = 2.0 * float(scene.rate) * np.asarray(runs.p.xi) / (2.0 * np.pi)
    how = {"begin": runs.begin, "ramp": two_seconds, "periods": 100}
    found = reference.settled(tpd.Terms.linear, runs.p, runs.y0, **how)
    # The motions are chaotic: rounding may decide a run.
    assert abs(np.sum(code_of(found.status) == code_of(Status.overturned)) - 135) <= 1


def test_no_run_is_called_rest_while_the_excitation_grows():
    p = dataclasses.replace(WITH, f=0.3)
    assert names_of(followed(p, np.zeros(4), periods=1).status)[0] == "rest"
    slow = followed(p, np.zeros(4), ramp=10.0, periods=100)
    assert names_of(slow.status)[0] == "rest"
    assert slow.elapsed[0] >= 10


def test_three_quarters_of_the_runs_begin_at_rest_with_either_growth():
    e = tpd.Ensemble(size=400, seed=3)
    runs = plan(WITH, e)
    moves = np.any(runs.y0 != 0.0, axis=1)
    np.testing.assert_array_equal(moves, runs.disturbed)
    for is_disturbed, count in ((False, 150), (True, 50)):
        for growth in e.growth:
            rows = (runs.disturbed == is_disturbed) & (runs.growth == growth)
            assert abs(np.sum(rows) - count) <= 1
    assert plan(WITH, dataclasses.replace(e, disturbed=1.0)).disturbed.all()
    assert not plan(WITH, dataclasses.replace(e, disturbed=0.0)).disturbed.any()
    # A disturbance without a size is a start from rest.
    assert not plan(WITH, STILL).disturbed.any()


def test_quantiles_count_overturned_runs_as_infinite():
    lost = np.arange(100) < 5
    found = by_hand(np.where(lost, np.inf, 0.4))
    assert found.quantiles("tilt", (0.0, 0.5, 0.95, 0.96)) == pytest.approx((0.1, 0.1, 0.1, np.inf))
    with pytest.raises(ValueError, match="`at` must be between 0 and 1, but is 95"):
        found.quantiles("tilt", (95.0,))


def test_each_condition_has_the_same_number_of_runs():
    conditions = tpd.Conditions.amplitudes(0.5, 1.0)
    runs = plan(WITH, dataclasses.replace(STILL, size=64), conditions)
    assert sorted(np.round(np.asarray(runs.p.f), 12)) == [0.25] * 32 + [0.5] * 32


def test_invalid_subjects_are_rejected():
    with pytest.raises(ValueError, match="`pendulum` is allowed only with a scene"):
        outcomes(WITH, tpd.Pendulum(mass=3.2448, length=0.203, damping_ratio=0.1))
    with pytest.raises(ValueError, match="`f` must be a single number, but is"):
        outcomes(dataclasses.replace(WITH, f=jnp.array([0.1, 0.2])))
    for wrong in ("parametric", tpd.Terms.parametric):
        with pytest.raises(ValueError, match="`equations` must be one of linear, nonlinear, but is"):
            outcomes(WITH, ensemble=STILL, equations=wrong)


# The paper's Table 1: cases of which it says what happens, as shares over ensembles of runs. A block of
# 0.1 m x 0.4 m, excitation 15 mm x cos(2 pi 2.5 Hz t) from rest, 20 s, Housner's impacts, no damping in the
# hinge; the base's amplitude within 1 %, half of the starts sudden and half growing over 5 periods (2 s).
# MuJoCo, Siconos and Chrono settle the bare block at 0.345 to 0.349 of arctan nu.

BLOCK = tpd.Block(width=0.1, height=0.4, mass=16.224, restitution="housner")
SCENE = tpd.Scene(BLOCK, tpd.Harmonic(amplitude=0.015, frequency=2.5))
EVEN = dict.fromkeys([n for n in SPREADS if n != "amplitude"], 0.0)
TABLE_1 = tpd.Ensemble(size=48, periods=50, any_phase=False, growth=(0.0, 5.0), **EVEN)


@functools.cache
def settled(mass, length, equations):
    """Settled tilts over that of toppling, infinite where the block overturns, of a mass ratio and a length
    over the whole height: of the sudden starts, the first of them with 15 mm, and of the growing ones."""
    with_it = SCENE.pendulum(mass_ratio=mass, length_ratio=2.0 * length, damping_ratio=0.0) if mass else None
    runs = plan(SCENE.parameters(with_it), TABLE_1)
    # A cosine is a sine that begins a quarter of a period late.
    how = {"begin": 0.5 * np.pi / np.asarray(runs.p.xi), "ramp": runs.growth}
    found = reference.settled(tpd.Terms(equations), runs.p, runs.y0, periods=TABLE_1.periods, **how)
    fell = (code_of(found.status) == code_of(Status.overturned)) | (np.asarray(found.tilt) > 1.3)
    tilts = np.where(fell, np.inf, np.asarray(found.settled_tilt)) / np.arctan(0.25)
    return tilts[runs.growth == 0.0], tilts[runs.growth > 0.0]


@pytest.mark.parametrize(
    ("equations", "tolerance", "least"), [("linear", 0.006, 0.5), ("nonlinear", 0.0025, 0.75)]
)
def test_runs_of_table_1_of_the_paper_have_its_outcomes(equations, tolerance, least):
    def tilts(mass, *lengths):
        return np.concatenate([x for length in lengths for x in settled(mass, length, equations)])

    sudden, growing = settled(0.0, 0.4, equations)
    assert sudden[0] == pytest.approx(0.347, abs=tolerance)
    assert np.isfinite(sudden).all()
    assert 0.2 < np.isinf(growing).mean() < 0.8
    # Only 40 % of the mass on a long rod prevents rocking; 30 % do where the shaking grows.
    for length in (0.4, 0.6):
        assert tilts(0.4, length).max() < 0.01
        sudden, growing = settled(0.3, length, equations)
        assert growing.max() < 0.01
        assert np.isinf(sudden).mean() > 0.1
    # A short rod overturns the block at every mass, and up to 20 % of mass nothing is gained.
    without_it = tilts(0.0, 0.4)
    for mass in (0.05, 0.1, 0.2, 0.3, 0.4):
        assert np.isinf(tilts(mass, 0.1)).mean() > (0.85 if mass == 0.4 else least)
    for mass in (0.05, 0.1, 0.2):
        found = tilts(mass, 0.1, 0.4, 0.6)
        assert Share.of(np.isinf(found)).low > np.isinf(without_it).mean()
        assert np.median(found[np.isfinite(found)]) > np.median(without_it[np.isfinite(without_it)])
