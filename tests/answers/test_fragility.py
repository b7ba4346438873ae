import itertools
import math
from statistics import NormalDist

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import binomtest, norm

import tpd
from tests.unanswered import unanswered
from tpd.answers.fragility import Fragility, _mcnemar
from tpd.answers.ground_batch import follow_scaled
from tpd.answers.probit import fit_lognormal
from tpd.exact.follow import EVENT_BOUND
from tpd.models import compiled_nonlinear
from tpd.plot.compare import plot_fragility
from tpd.records.intensity import intensity_of, peak_velocity, spectral_acceleration

GRAVITY = 9.80665
STATUE = tpd.Block(width=0.45, height=1.8, mass=900.0, friction=0.0, restitution="housner")
HUNG = tpd.Pendulum(mass=90.0, length=0.9, damping_ratio=0.4)


def noise(seed: int, n: int = 400) -> tpd.Record:
    """A record of filtered noise under an envelope."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 0.02
    white = np.convolve(rng.standard_normal(n + 20), np.hanning(9), "valid")[:n]
    return tpd.Record(white[: len(t)] * np.sin(np.pi * t / t[-1]) ** 2, 0.02, name=f"noise {seed}")


RECORDS = [noise(seed) for seed in range(12)]


@pytest.fixture(scope="module")
def found() -> Fragility:
    return tpd.fragility(STATUE, RECORDS, scales=[0.8, 1.5, 3.0, 6.0, 12.0], pendulum=HUNG)


def test_shares_are_counts_of_single_motions(found):
    unit = GRAVITY * float(STATUE.slenderness)
    for i, stripe in enumerate(found.stripes):
        for hung, curve in ((None, found.bare), (HUNG, found.hung)):
            fallen, lifted = 0, 0
            for record in RECORDS:
                scene = tpd.Scene(STATUE, record.scaled_to(pga=stripe * unit))
                one = tpd.transient(scene, hung)
                fallen += tpd.status_name(one.status) == "overturned"
                lifted += tpd.status_name(one.status) != "stood"
            assert curve["overturned"].counts[i] == fallen
            assert curve["rocking"].counts[i] == lifted


def test_nothing_rocks_below_the_threshold_and_the_first_crossing_is_named(found):
    assert found.bare["rocking"].counts[0] == 0
    assert found.bare["rocking"].counts[1:].tolist() == [12] * 4
    assert found.first_crossings["rocking"] == (1.5, pytest.approx(1.5, abs=0.71))
    assert found.bare["rocking"].fit.separated
    assert 0.8 < found.bare["rocking"].fit.median < 1.5
    assert found.changed is not None
    assert all(0.0 <= share < 0.3 for share in found.changed)
    text = str(found)
    assert "the nonlinear equations change the verdict of" in text
    assert "rocking: bare median" in text


def test_tilts_are_over_the_slenderness(found):
    tilts, hung = found.tilts
    assert tilts.shape == hung.shape == (12, 5)
    fallen = np.isinf(tilts).sum(axis=0)
    assert fallen.tolist() == found.bare["overturned"].counts.tolist()


def test_the_paired_test_is_that_of_mcnemar():
    rng = np.random.default_rng(3)
    a, b = (rng.random((40, 6)) < 0.5).astype(float), (rng.random((40, 6)) < 0.3).astype(float)
    for i, p in enumerate(_mcnemar(a, b)):
        x, y = int(np.sum((a[:, i] == 1) & (b[:, i] == 0))), int(np.sum((a[:, i] == 0) & (b[:, i] == 1)))
        assert p == pytest.approx(binomtest(x, x + y).pvalue)


@pytest.mark.mends("pairs without an answer were left out of the paired test, whatever they could have been")
def test_the_paired_test_is_the_largest_that_unknown_outcomes_allow():
    rng = np.random.default_rng(5)
    for _ in range(40):
        a, b = ((rng.random((9, 1)) < share).astype(float) for share in (0.7, 0.2))
        unknown = rng.permutation(18)[: rng.integers(0, 5)]
        both = np.stack([a, b])
        both.flat[unknown] = np.nan
        values = []
        for outcome in itertools.product((0.0, 1.0), repeat=len(unknown)):
            both_known = both.copy()
            both_known.flat[unknown] = outcome
            values.append(_mcnemar(*both_known)[0])
        assert _mcnemar(*both)[0] == pytest.approx(max(values), rel=1e-12)


@pytest.mark.mends("more than 1023 pairs that differ were beyond the numbers of a double")
def test_the_paired_test_of_many_motions():
    a = np.ones((3000, 1))
    b = (np.arange(3000)[:, None] >= 1500).astype(float)
    a[2950:], b[:60] = 0.0, 1.0
    x, y = int(np.sum((a == 1) & (b == 0))), int(np.sum((a == 0) & (b == 1)))
    assert x + y > 1023
    assert _mcnemar(a, b) == pytest.approx(binomtest(x, x + y).pvalue)


def taken(monkeypatch, hung: bool, fewest: float) -> None:
    """Take the answers of all motions of stripes from `fewest` (PGA over g tan alpha) on."""
    nu = float(STATUE.slenderness)
    unanswered(monkeypatch, lambda rows: (rows[:, 5] > fewest * nu) & ((rows[:, 1] > 0.0) | ~np.bool_(hung)))


@pytest.mark.mends("motions without an answer left no trace in counts, shares and words")
def test_motions_without_an_answer_are_counted_and_named(monkeypatch, found):
    taken(monkeypatch, True, 11.0)
    lost = tpd.fragility(STATUE, RECORDS, scales=found.stripes, pendulum=HUNG)
    assert "without an answer, and not counted: 0 of 60 runs bare, 12 of 60 runs with the pendulum" in str(
        lost
    )
    assert "whatever the motions without an answer do" in str(lost)
    curve, before = lost.hung["overturned"], found.hung["overturned"]
    assert curve.undecided.tolist() == [0, 0, 0, 0, 12]
    assert curve.total.tolist() == [12, 12, 12, 12, 0]
    assert np.isnan(curve.shares).tolist() == [False] * 4 + [True]
    assert np.array_equal(curve.counts[:4], before.counts[:4])
    assert np.array_equal(lost.bare["overturned"].counts, found.bare["overturned"].counts)
    assert not lost.bare["overturned"].undecided.any()
    # The medians whatever these motions do enclose that of the whole set.
    assert curve.medians[0] <= before.fit.median <= curve.medians[1]
    # Nothing is known of the difference there, and the paired test shows none.
    assert lost.p_values["overturned"][4] == 1.0
    # Verdicts of the nonlinear equations are compared where there are two.
    assert np.isfinite(lost.changed).all()


@pytest.mark.mends("a first crossing passed over motions without an answer")
def test_a_first_crossing_that_hangs_on_motions_without_an_answer_is_not_known(monkeypatch, found):
    unit = float(STATUE.slenderness)
    unanswered(monkeypatch, lambda rows: np.isclose(rows[:, 5], 1.5 * unit) & (rows[:, 1] == 0.0))
    lost = tpd.fragility(STATUE, RECORDS, scales=found.stripes, pendulum=HUNG, nonlinear=False)
    assert math.isnan(lost.first_crossings["rocking"][0])
    assert lost.first_crossings["rocking"][1] == found.first_crossings["rocking"][1]


@pytest.mark.mends("a run without an answer counted as a changed verdict")
def test_verdicts_are_compared_where_both_equations_answer(monkeypatch):
    # No motion of the exact run has an answer, and all overturn by the nonlinear equations.
    taken(monkeypatch, False, 29.0)
    found = tpd.fragility(STATUE, RECORDS, scales=[0.8, 30.0])
    assert found.changed == (0.0, 0.0)
    assert found.bare["overturned"].undecided.tolist() == [0, 12]


@pytest.mark.mends("runs that the nonlinear equations do not answer left no trace")
def test_runs_that_the_nonlinear_equations_do_not_answer_are_named(monkeypatch):
    shake = compiled_nonlinear.shake_nonlinear

    def stub(rows, *others, **options):
        found, by = shake(rows, *others, **options)
        return found._replace(status=np.where(rows[:, 5] > 2.0, EVENT_BOUND, found.status)), by

    monkeypatch.setattr(compiled_nonlinear, "shake_nonlinear", stub)
    found = tpd.fragility(STATUE, RECORDS, scales=[0.8, 30.0])
    assert found.changed == (0.0, 0.0)
    assert found.unanswered == (12, 12)
    assert "by these equations, and not compared: 12 of 24 runs bare" in str(found)


@pytest.mark.mends("motions without an answer were not drawn")
def test_motions_without_an_answer_are_drawn(monkeypatch, found):
    taken(monkeypatch, True, 11.0)
    lost = tpd.fragility(STATUE, RECORDS, scales=found.stripes, pendulum=HUNG, nonlinear=False)
    drawn = {c.get_label(): c for c in plot_fragility(lost).collections}
    (bar,) = drawn["with the pendulum: 12 runs without an answer"].get_segments()
    assert bar.tolist() == [[12.0, 0.0], [12.0, 1.0]]
    assert not any(label.startswith("bare block: ") for label in drawn)


@pytest.mark.mends("beyond the stripes a curve and a band were drawn that no stripe sees")
def test_separated_outcomes_are_drawn_as_far_as_they_are_known(found):
    # Rocking begins between two stripes.
    ax = plot_fragility(found, "rocking")
    curve = next(line for line in ax.lines if line.get_label() == "bare block: median 1.1")
    x, y = curve.get_xdata(), curve.get_ydata()
    between = (x > 0.8) & (x < 1.5)
    assert np.isnan(y[between]).all()
    assert set(y[~between]) == {0.0, 1.0}
    # Two bands, that of the bare block first.
    corners = ax.collections[0].get_paths()[0].vertices
    low = binomtest(12, 12).proportion_ci(method="exact").low
    inside = corners[(corners[:, 0] > 0.81) & (corners[:, 0] < 1.49), 1]
    assert set(np.round(inside, 9)) == {0.0, 1.0}
    above = corners[(corners[:, 0] > 1.51) & (corners[:, 0] < 11.9), 1]
    assert set(np.round(above, 9)) == {round(low, 9), 1.0}


def test_the_curve_is_the_most_likely_one():
    rng = np.random.default_rng(1)
    stripes = np.linspace(0.5, 5.0, 9)
    hits = (rng.random((60, 9)) < norm.cdf(np.log(stripes / 2.0) / 0.4)).astype(float)
    hits[5, 4] = np.nan
    fit = fit_lognormal(stripes, hits)

    def loss(b):
        p = norm.cdf(np.log(stripes / math.exp(b[0])) / math.exp(b[1]))
        return -np.nansum(hits * np.log(p) + (1.0 - hits) * np.log1p(-p))

    best = minimize(loss, [0.5, -1.0], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12})
    assert fit.median == pytest.approx(math.exp(best.x[0]), rel=1e-6)
    assert fit.dispersion == pytest.approx(math.exp(best.x[1]), rel=1e-6)
    assert fit.probability(np.array([fit.median])) == pytest.approx([0.5])
    low, high = fit.interval()
    assert low < 2.0 < high
    below, above = fit.band(stripes)
    assert np.all((below < fit.probability(stripes)) & (fit.probability(stripes) < above))


def test_the_interval_covers_and_takes_a_motion_as_one():
    # A motion whose capacity is one number: its outcomes at all stripes hang together.
    rng, stripes, inside, width = np.random.default_rng(0), np.linspace(0.5, 6.0, 12), 0, []
    for _ in range(300):
        capacity = 2.0 * np.exp(0.5 * rng.standard_normal(40))
        fit = fit_lognormal(stripes, (stripes >= capacity[:, None]).astype(float))
        low, high = fit.interval()
        inside += low < 2.0 < high
        width.append(math.log(high / low))
    assert 0.90 < inside / 300 < 0.985
    # The deviation of the mean of 40 logarithms.
    assert np.median(width) == pytest.approx(2 * NormalDist().inv_cdf(0.975) * 0.5 / math.sqrt(40), rel=0.15)


def test_curves_that_the_stripes_do_not_see():
    stripes = np.array([1.0, 2.0, 3.0])
    never, always = fit_lognormal(stripes, np.zeros((4, 3))), fit_lognormal(stripes, np.ones((4, 3)))
    assert "above the stripes" in str(never)
    assert "below the stripes" in str(always)
    falling = fit_lognormal(stripes, np.array([[1.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    assert "does not grow" in str(falling)


def test_intensities_are_their_definitions():
    pulse = tpd.Pulse.one_sine(acceleration=3.0, frequency=2.0)
    unit = GRAVITY * 0.25
    rate = float(tpd.Scene(STATUE, pulse).rate)
    known = {
        "pga": 3.0,
        "pga_star": 3.0 / unit,
        # The integral of a half sine.
        "pgv": 2.0 * 3.0 / (2.0 * math.pi * 2.0),
        "pgv_star": rate * 2.0 * 3.0 / (2.0 * math.pi * 2.0) / unit,
        "scale": 1.0,
    }
    for name, value in known.items():
        assert intensity_of(name, STATUE, GRAVITY, None).value(pulse) == pytest.approx(value, rel=1e-9)
    record = tpd.Record([0.0, 2.0, -1.0, 0.5], 0.1)
    # Triangles up to the zero between the second sample and the third.
    assert peak_velocity(record) == pytest.approx(0.1 * (1.0 + 2.0 / 3.0))


def test_a_stiff_oscillator_feels_the_ground_and_resonance_is_known():
    record = tpd.Record(np.sin(2.0 * np.pi * np.arange(401) / 40.0), 0.025)
    assert spectral_acceleration(record, 0.01) == pytest.approx(1.0, rel=2e-3)
    # Ten periods in resonance at 5 % damping: (1 - exp(-2 pi zeta n))/(2 zeta), nearly.
    steady = (1.0 - math.exp(-2.0 * math.pi * 0.05 * 10.0)) / 0.1
    assert spectral_acceleration(record, 1.0) == pytest.approx(steady, rel=0.01)


def test_bad_input_is_one_sentence():
    with pytest.raises(ValueError, match="`scales` must be a vector of increasing numbers"):
        tpd.fragility(STATUE, RECORDS[:1], scales=[2.0, 1.0])
    with pytest.raises(ValueError, match="`intensity` must be"):
        tpd.fragility(STATUE, RECORDS[:1], scales=[1.0, 2.0], intensity="pgx")
    with pytest.raises(ValueError, match="`period` belongs to"):
        tpd.fragility(STATUE, RECORDS[:1], scales=[1.0, 2.0], intensity="sa")
    with pytest.raises(ValueError, match="`states` must name"):
        tpd.fragility(STATUE, RECORDS[:1], scales=[1.0, 2.0], states={"bad": -1.0})
    with pytest.raises(ValueError, match="`factors` must have a row"):
        follow_scaled(STATUE, None, RECORDS[:2], np.ones((1, 2)), free=1.0)


def test_the_number_of_workers_changes_nothing():
    factors = np.linspace(0.5, 3.0, 5) * np.ones((12, 1))
    one = follow_scaled(STATUE, HUNG, RECORDS, factors, free=5.0, workers=1)
    two = follow_scaled(STATUE, HUNG, RECORDS, factors, free=5.0, workers=3)
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def test_the_nonlinear_equations_tend_to_the_linear_ones():
    differences = []
    for width in (0.08, 0.04):
        block = tpd.Block(width=width, height=2.0, mass=500.0, friction=0.0, restitution=0.9)
        hung = tpd.Pendulum(mass=50.0, length=0.8, damping_ratio=0.2)
        pulse = tpd.Pulse.one_sine(acceleration=1.4 * GRAVITY * width / 2.0, frequency=2.0)
        both = [
            follow_scaled(block, hung, [pulse], np.ones((1, 1)), free=2.0, nonlinear=n).tilt[0, 0]
            for n in (False, True)
        ]
        differences.append(abs(both[1] / both[0] - 1.0))
    # The linear equations drop terms of the order of the slenderness squared.
    assert differences[0] < 0.01
    assert 3.0 < differences[0] / differences[1] < 5.5


def test_the_overturning_spectrum_has_its_tongues():
    column = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
    pulse = tpd.Pulse.one_sine(acceleration=1.0, frequency=1.0)
    ratios = np.array([5.0])
    rate = float(tpd.Scene(column, pulse).rate)
    sizes = np.linspace(0.9, 12.0, 60)
    spectrum = tpd.overturning_spectrum(
        column, pulse, HUNG, frequency_ratios=ratios, acceleration_ratios=sizes
    )
    one = tpd.Pulse.one_sine(acceleration=GRAVITY / 6.0, frequency=5.0 * rate / (2.0 * math.pi))
    tongues = np.asarray(tpd.critical_scale(tpd.Scene(column, one)).tongues)
    inside = np.any((sizes[:, None] >= tongues[:, 0]) & (sizes[:, None] < tongues[:, 1]), axis=1)
    assert np.array_equal(spectrum.bare[:, 0] >= 2, inside)
    assert spectrum.bare[0, 0] == 0
    # After an impact in the first tongue, without one in the last.
    assert spectrum.bare[np.flatnonzero(inside)[0], 0] == 3
    assert spectrum.bare[-1, 0] == 2
    assert spectrum.safe().shape == (2,)


def test_the_rocking_spectrum_is_that_of_single_blocks():
    record = RECORDS[0].scaled_to(pga_g=0.5)
    spectrum = tpd.rocking_spectrum(
        STATUE, record, periods=np.array([1.5, 4.0]), mass_ratio=0.1, length_ratio=1.0, damping_ratio=0.4
    )
    for i, period in enumerate(spectrum.periods):
        # A block of the same shape whose rate is this one.
        size = (float(tpd.Scene(STATUE, record).rate) / (2.0 * math.pi / period)) ** 2
        block = tpd.Block(
            width=0.45 * size, height=1.8 * size, mass=900.0, friction=0.0, restitution="housner"
        )
        hung = tpd.Pendulum(mass=90.0, length=0.9 * size, damping_ratio=0.4)
        for pendulum, tilts in ((None, spectrum.bare), (hung, spectrum.hung)):
            one = tpd.transient(tpd.Scene(block, record), pendulum)
            # Housner's restitution with a bob is another number.
            assert tilts[i] == pytest.approx(float(one.tilt) / 0.25, rel=1e-9)


@pytest.mark.mends("the motions of one earthquake, even copies of one motion, counted as independent")
def test_copies_of_motions_make_nothing_surer(found):
    twice = tpd.fragility(STATUE, [*RECORDS, *RECORDS], scales=found.stripes, pendulum=HUNG, nonlinear=False)
    for once, copies in ((found.bare, twice.bare), (found.hung, twice.hung)):
        for name, curve in once.items():
            assert copies[name].fit.interval() == pytest.approx(curve.fit.interval(), rel=1e-9)
            x = np.geomspace(0.5, 20.0, 30)
            np.testing.assert_allclose(copies[name].fit.band(x), curve.fit.band(x), atol=1e-9)
    for name, p in found.p_values.items():
        np.testing.assert_allclose(twice.p_values[name], p, rtol=1e-12)
    assert found.earthquakes == twice.earthquakes == 12
    assert "24 motions of 12 earthquakes" in str(twice)
