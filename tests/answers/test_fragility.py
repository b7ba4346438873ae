"""Fragility: counts of single motions, and what is said of motions without a result."""

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.special import log_ndtr
from scipy.stats import binomtest

import tpd
from tests.unanswered import unanswered
from tpd.answers.fragility import Fragility, fit_lognormal
from tpd.compiled import simulate
from tpd.compiled.columns import MU, F
from tpd.scene.status import code_of, status_of

GRAVITY = 9.80665
STATUE = tpd.Block(width=0.45, height=1.8, mass=900.0, friction=0.0, restitution="housner")
PENDULUM = tpd.Pendulum(mass=90.0, length=0.9, damping_ratio=0.4)


def noise(seed: int, n: int = 400) -> tpd.Record:
    """A record of filtered noise under an envelope."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * 0.02
    white = np.convolve(rng.standard_normal(n + 20), np.hanning(9), "valid")[:n]
    samples, name = white[: len(t)] * np.sin(np.pi * t / t[-1]) ** 2, f"noise {seed}"
    return tpd.Record(samples, 0.02, name=name, event=name)


RECORDS = [noise(seed) for seed in range(12)]


@pytest.fixture(scope="module")
def found() -> Fragility:
    return tpd.fragility(STATUE, RECORDS, scales=[0.8, 1.5, 3.0, 6.0, 12.0], pendulum=PENDULUM)


def test_shares_of_a_fragility_count_single_runs(found):
    unit = GRAVITY * float(STATUE.slenderness)
    for i, stripe in enumerate(found.stripes):
        scenes = [tpd.Scene(STATUE, record.scaled(stripe * unit / record.pga)) for record in RECORDS]
        for with_it, curve in ((None, found.without_pendulum), (PENDULUM, found.with_pendulum)):
            ends = [tpd.status_name(tpd.transient(scene, with_it).status) for scene in scenes]
            assert curve["overturned"].counts[i] == ends.count("overturned")
            assert curve["overturned"].shares[i] == ends.count("overturned") / 12
            assert curve["rocking"].counts[i] == 12 - ends.count("stood")
    # Tilts are over the slenderness.
    assert (
        np.isinf(found.tilts[0]).sum(axis=0).tolist() == found.without_pendulum["overturned"].counts.tolist()
    )


def test_no_block_rocks_below_the_uplift_threshold(found):
    assert found.without_pendulum["rocking"].counts.tolist() == [0, 12, 12, 12, 12]
    assert found.first_crossings["rocking"] == (1.5, pytest.approx(1.5, abs=0.71))
    assert 0.8 < found.without_pendulum["rocking"].fit.median < 1.5
    assert all(0.0 <= share < 0.3 for share in found.changed)
    assert "the nonlinear model changes the outcome of" in str(found)
    assert "fewer than 5 earthquakes" not in str(found)


def test_the_test_of_the_medians_counts_earthquakes(found):
    """All stripes of an earthquake are one observation: the sign test of the motions' capacities."""
    hits = np.isinf(found.tilts).sum(axis=2)
    more, less = int(np.sum(hits[0] > hits[1])), int(np.sum(hits[0] < hits[1]))
    expected = binomtest(more, more + less).pvalue if more + less else 1.0
    assert found.p_medians["overturned"] == pytest.approx(expected)


def taken(monkeypatch, with_it: bool, fewest: float) -> None:
    """Take the answers of all motions of stripes from `fewest` (PGA over g tan alpha) on."""
    nu = float(STATUE.slenderness)
    unanswered(
        monkeypatch, lambda rows: (rows[:, F] > fewest * nu) & ((rows[:, MU] > 0.0) | ~np.bool_(with_it))
    )


def test_records_without_a_result_are_counted_and_listed(monkeypatch, found):
    taken(monkeypatch, True, 11.0)
    lost = tpd.fragility(STATUE, RECORDS, scales=found.stripes, pendulum=PENDULUM)
    assert "and not counted: 0 of 60 runs without pendulum, 12 of 60 runs with pendulum" in str(lost)
    assert "depending on the motions without a result" in str(lost)
    curve, before = lost.with_pendulum["overturned"], found.with_pendulum["overturned"]
    assert curve.undecided.tolist() == [0, 0, 0, 0, 12]
    assert curve.total.tolist() == [12, 12, 12, 12, 0]
    assert np.isnan(curve.shares).tolist() == [False] * 4 + [True]
    assert np.array_equal(curve.counts[:4], before.counts[:4])
    assert np.array_equal(
        lost.without_pendulum["overturned"].counts, found.without_pendulum["overturned"].counts
    )
    assert not lost.without_pendulum["overturned"].undecided.any()
    # The medians whatever these motions do enclose that of the whole set.
    assert curve.medians[0] <= before.fit.median <= curve.medians[1]
    # Nothing is known of the difference there, and the paired test shows none.
    assert lost.p_values["overturned"][4] == 1.0
    assert np.isfinite(lost.changed).all()


def test_runs_without_a_nonlinear_result_are_reported(monkeypatch):
    follow = simulate.follow

    def stub(equations, rows, *others, **options):
        found = follow(equations, rows, *others, **options)
        lost = (equations is tpd.Terms.nonlinear) & (rows[:, F] > 2.0)
        ends = np.where(lost, code_of(tpd.Status.event_bound), code_of(found.status))
        return found._replace(status=status_of(ends))

    monkeypatch.setattr(simulate, "follow", stub)
    found = tpd.fragility(STATUE, RECORDS, scales=[0.8, 30.0])
    assert found.changed == (0.0,)
    assert found.unanswered == (12,)
    assert "with these equations, and not compared: 12 of 24 runs without pendulum" in str(found)


def test_a_fragility_plot_marks_runs_without_a_result(monkeypatch, found):
    taken(monkeypatch, True, 11.0)
    lost = tpd.fragility(STATUE, RECORDS, scales=found.stripes, pendulum=PENDULUM, nonlinear=False)
    drawn = {c.get_label(): c for c in tpd.plot(lost).collections}
    (bar,) = drawn["with pendulum: 12 runs without a result"].get_segments()
    assert bar.tolist() == [[12.0, 0.0], [12.0, 1.0]]
    assert not any(label.startswith("without pendulum: ") for label in drawn)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"scales": [2.0, 1.0]}, "`scales` must be a vector of 1 or more increasing numbers"),
        ({"intensity": "pgx"}, "`intensity` must be"),
        ({"intensity": "sa"}, "a spectral acceleration, needs `period`"),
        ({"states": {"bad": -1.0}}, "`states` must name"),
    ],
)
def test_invalid_input_of_a_fragility_is_rejected_in_one_sentence(options, said):
    with pytest.raises(ValueError, match=said):
        tpd.fragility(STATUE, RECORDS[:1], **{"scales": [1.0, 2.0], **options})


def test_copies_of_records_do_not_narrow_the_interval(found):
    twice = tpd.fragility(
        STATUE, [*RECORDS, *RECORDS], scales=found.stripes, pendulum=PENDULUM, nonlinear=False
    )
    for once, copies in (
        (found.without_pendulum, twice.without_pendulum),
        (found.with_pendulum, twice.with_pendulum),
    ):
        for name, curve in once.items():
            assert copies[name].fit.interval() == pytest.approx(curve.fit.interval(), rel=1e-9)
            x = np.geomspace(0.5, 20.0, 30)
            np.testing.assert_allclose(copies[name].fit.band(x), curve.fit.band(x), atol=1e-9)
    for name, p in found.p_values.items():
        np.testing.assert_allclose(twice.p_values[name], p, rtol=1e-12)
    assert found.earthquakes == twice.earthquakes == 12
    assert "24 motions of 12 earthquakes" in str(twice)


def test_a_curve_of_identical_earthquakes_has_no_interval():
    hits = np.tile([0.0, 1.0, 0.0, 1.0], (6, 1))
    found = fit_lognormal(np.array([0.5, 1.0, 2.0, 4.0]), hits)
    assert found.interval() == (0.0, math.inf)
    assert np.isnan(found.covariance).all()
    assert found.covariance.shape == (2, 2)
    # Three earthquakes show a spread, and two do not.
    differ = np.array([[0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0], [0.0, 1.0, 0.0, 1.0]])
    ends = [fit_lognormal(np.array([0.5, 1.0, 2.0, 4.0]), differ[i:]).interval() for i in (0, 1)]
    assert 0.0 < ends[0][0] < ends[0][1] < math.inf
    assert ends[1] == (0.0, math.inf)
    # One earthquake that ends otherwise shows a spread.
    low, high = fit_lognormal(
        np.array([0.5, 1.0, 2.0, 4.0]), np.vstack([hits, [0.0, 0.0, 0.0, 1.0]])
    ).interval()
    assert 0.0 < low < high < math.inf


def outcomes(counts: list[int], motions: int) -> np.ndarray:
    """Outcomes of motions of which so many reach the state at each stripe."""
    return (np.arange(motions)[:, None] < np.array(counts)).astype(float)


def likelihood(a, b, stripes: np.ndarray, hits: np.ndarray) -> np.ndarray:
    """Logarithm of the likelihood of intercepts and slopes in the logarithm of the intensity."""
    eta = np.asarray(a)[..., None] + np.asarray(b)[..., None] * np.log(stripes)
    known = np.isfinite(hits)
    counts, n = np.where(known, hits, 0.0).sum(axis=0), known.sum(axis=0)
    return (counts * log_ndtr(eta) + (n - counts) * log_ndtr(-eta)).sum(axis=-1)


def against(a, b, stripes: np.ndarray, hits: np.ndarray) -> float:
    return -float(likelihood(a, b, stripes, hits))


SEPARATED = [
    # Shares, motions, and between which of the stripes 1, 2, 3 ... the share passes a half.
    ([0, 2, 4], 4, (2.0, 2.0)),
    ([0, 0, 0, 3], 20, (4.0, math.inf)),
    ([7, 9, 9], 9, (0.0, 1.0)),
    ([0, 1], 1, (1.0, 2.0)),
]


@pytest.mark.parametrize(("counts", "motions", "passes"), SEPARATED)
def test_the_median_of_separated_outcomes_lies_between_two_stripes(counts, motions, passes):
    stripes = np.arange(1.0, len(counts) + 1.0)
    fit = fit_lognormal(stripes, outcomes(counts, motions))
    assert fit.separated
    assert "too small to resolve with these stripes" in str(fit)
    assert math.isnan(fit.dispersion)
    assert fit.covariance.shape == (2, 2)
    assert fit.median == pytest.approx(math.sqrt(passes[0] * passes[1]))
    assert fit.interval()[0] <= passes[0]
    assert fit.interval()[1] >= passes[1]
    exact = [binomtest(k, motions).proportion_ci(0.9, method="exact") for k in counts]
    # Below and above the stripes nothing limits the probability on one side.
    lows, highs = [0.0, *(e.low for e in exact)], [*(e.high for e in exact), 1.0]
    between = np.arange(0.5, len(counts) + 1.0)
    np.testing.assert_allclose(fit.band(between, level=0.9), [lows, highs], atol=1e-12)
    np.testing.assert_allclose(fit.band(stripes, level=0.9), [lows[1:], highs[:-1]], atol=1e-12)
    # The curve is drawn only where the stripes on both sides say the same.
    shares = np.array([0.0, *counts, motions]) / motions
    known = shares[1:] == shares[:-1]
    assert np.array_equal(np.isfinite(fit.probability(between)), known)
    np.testing.assert_allclose(fit.probability(stripes), shares[1:-1])


def test_a_single_stripe_determines_no_dispersion():
    for count, median in ((3, math.inf), (5, 2.0), (8, 0.0)):
        fit = fit_lognormal(np.array([2.0]), outcomes([count], 10))
        assert (fit.separated, fit.median) == (True, median)
        assert math.isnan(fit.dispersion)
        assert "unknown with one stripe" in str(fit)


def test_only_a_share_that_grows_with_intensity_has_a_curve():
    stripes = np.array([0.5, 1.0, 2.0, 4.0])
    fit = fit_lognormal(stripes, outcomes([10, 12, 14, 16], 40))
    assert 1.0 / fit.dispersion == pytest.approx(0.2021, abs=1e-4)
    assert "does not grow" not in str(fit)
    # The median of these, about exp(719), is no double.
    assert math.isnan(fit_lognormal(stripes, outcomes([100, 100, 100, 102], 10_000)).median)
    for counts in ([10, 10, 10, 10], [16, 14, 12, 10], [40, 40, 0, 0], [40, 20, 0, 0]):
        fit = fit_lognormal(stripes, outcomes(counts, 40))
        assert math.isnan(fit.median)
        assert "does not grow" in str(fit)


def test_every_fit_is_a_maximum_of_the_likelihood():
    rng, seen = np.random.default_rng(35), {"maximum": 0, "separated": 0, "flat": 0}
    for _ in range(200):
        stripes = np.sort(np.exp(rng.normal(0.0, 1.0, rng.integers(2, 9))))
        motions = int(rng.choice([2, 4, 12, 40, 200]))
        median, dispersion = np.exp(rng.normal(0.0, 1.0)), np.exp(rng.normal(-0.3, 1.2))
        capacity = median * np.exp(dispersion * rng.standard_normal((motions, len(stripes))))
        # Either the outcomes of a motion at all stripes hang together, or they do not.
        hits = (stripes >= (capacity[:, :1] if rng.random() < 0.5 else capacity)).astype(float)
        hits[rng.random(hits.shape) < rng.choice([0.0, 0.1])] = np.nan
        fit = fit_lognormal(stripes, hits)
        fell, stood = (stripes[np.any(hits == x, axis=0)] for x in (1.0, 0.0))
        assert fit.separated == (not fell.size or not stood.size or stood.max() <= fell.min())
        if fit.separated:
            seen["separated"] += 1
        elif math.isnan(fit.median):
            seen["flat"] += 1
            # With the best intercept of each slope the likelihood falls from a slope of zero on.
            best = [minimize_scalar(against, args=(b, stripes, hits)).fun for b in (0.0, 0.03, 0.3)]
            assert best == sorted(best)
        else:
            seen["maximum"] += 1
            b = 1.0 / fit.dispersion
            a = -b * math.log(fit.median)
            top = likelihood(a, b, stripes, hits)
            # The likelihood is concave: a maximum among its neighbours is the maximum.
            turns, size = np.linspace(0.0, 2.0 * math.pi, 40), np.array([[1e-4], [1e-2], [0.3]])
            near = a + size * np.cos(turns), b + size * np.sin(turns) * max(1.0, b)
            assert np.all(likelihood(*near, stripes, hits) < top + 1e-9)
    assert min(seen.values()) > 2
    assert seen["maximum"] > 100


@pytest.mark.parametrize("rows", [[[0, 1, 0, 1, 1]], [[0, 1, 0, 1, 1], [0, 0, 1, 1, 1]]], ids=["one", "two"])
def test_one_or_two_earthquakes_determine_no_interval(rows):
    stripes, hits = np.arange(1.0, 6.0), np.array(rows, dtype=float)
    # Rows without any outcome are no motions, and copies are no more earthquakes.
    padded = np.vstack([hits, np.full((3, 5), np.nan)])
    copies = fit_lognormal(stripes, np.tile(hits, (6, 1)), np.arange(6 * len(hits)) % len(hits))
    for fit in (fit_lognormal(stripes, hits), fit_lognormal(stripes, padded), copies):
        assert not fit.separated
        assert fit.interval() == (0.0, math.inf)
        np.testing.assert_array_equal(fit.band(np.array([1.0, 3.0])), [[0.0, 0.0], [1.0, 1.0]])


def test_without_outcomes_there_is_no_median():
    fit = fit_lognormal(np.array([1.0, 2.0]), np.full((5, 2), np.nan))
    assert math.isnan(fit.median)
    assert "no outcome is known" in str(fit)
    np.testing.assert_array_equal(fit.band(np.array([0.5, 1.5, 3.0])), [[0.0] * 3, [1.0] * 3])


def test_equal_outcomes_bound_the_probability():
    never, always = (fit_lognormal(np.array([1.0, 2.0, 3.0]), np.full((20, 3), x)) for x in (0.0, 1.0))
    assert (str(never), never.interval()) == ("median above the stripes, dispersion unknown", (3.0, math.inf))
    assert (str(always), always.interval()) == ("median below the stripes, dispersion unknown", (0.0, 1.0))
    known = binomtest(0, 20).proportion_ci(method="exact").high
    known = [0.0] * 3, [known, known, 1.0]
    np.testing.assert_allclose(never.band(np.array([0.5, 2.5, 3.5])), known, rtol=1e-6)


def test_fits_of_large_counts_and_close_stripes_are_accurate():
    stripes = np.array([1.0, 1.0 + 1e-6, 1.0 + 2e-6])
    hits = outcomes([10_000, 30_000, 70_000], 100_000)
    near, wide = fit_lognormal(stripes, hits), fit_lognormal(7.0 * stripes**1e6, hits)
    assert near.median**1e6 == pytest.approx(wide.median / 7.0, rel=1e-7)
    assert near.dispersion * 1e6 == pytest.approx(wide.dispersion, rel=1e-7)


def test_the_interval_of_few_earthquakes_uses_student_quantiles():
    hits = np.array([[0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    fit = fit_lognormal(np.array([1.0, 2.0, 4.0, 8.0]), hits)
    toward = -fit.dispersion * np.array([1.0, math.log(fit.median)])
    width = 4.302652729911275 * math.sqrt(toward @ fit.covariance @ toward)
    assert fit.interval() == pytest.approx((fit.median * math.exp(-width), fit.median * math.exp(width)))


def test_the_interval_of_the_median_has_its_stated_coverage():
    # The outcomes of a motion at all stripes hang together.
    rng, stripes, inside, width = np.random.default_rng(0), np.linspace(0.5, 6.0, 12), 0, []
    for _ in range(200):
        capacity = 2.0 * np.exp(0.5 * rng.standard_normal(40))
        fit = fit_lognormal(stripes, (stripes >= capacity[:, None]).astype(float))
        low, high = fit.interval()
        inside += low < 2.0 < high
        width.append(math.log(high / low))
    assert 0.90 < inside / 200 < 0.985
    # The deviation of the mean of 40 logarithms.
    assert np.median(width) == pytest.approx(2 * 1.959964 * 0.5 / math.sqrt(40), rel=0.15)
