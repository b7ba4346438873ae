"""The integrated model with true signs and all terms: against the event loop and the linear limit."""

from functools import cache

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import tpd
from tests import reference
from tests.contact import SLIP, Mode
from tests.exact.test_trajectory import STICKING
from tests.reference import (
    LEANING,
    NAMES,
    OVERTURNING,
    REST,
    STILL,
    WITH,
    Answer,
    EventDriven,
    assert_overturned,
    differences,
    exact,
    parameters,
)
from tests.reference import exact as linear
from tests.segmented import _TURN, Segmented, _begin, _transversality
from tests.segmented import _split as split
from tests.segmented import _through as through
from tpd import Smoothed, Terms, simulate, status_name, steady_state
from tpd.exact.terms import GRAZING
from tpd.models.settling import scale_of
from tpd.scene.impacts import housner
from tpd.scene.parameters import as_arrays
from tpd.scene.status import Status
from tpd.theory.equations import Equations

X = WITH[3].x
SETTLED = 0.0659875
"""rad; of X with all terms: also what SciPy's LSODA comes to on (4) written out anew with tanh for the
signs, of width 1e-3, 3e-4 and 1e-4: 0.066007, 0.066000, 0.065997."""


def nonlinear(x, slopes=False):
    """Answer of the nonlinear equations, by the program that `steady_state` compiles for all its callers."""

    def sizes(x):
        s = steady_state(as_arrays(parameters(x)), model=Segmented())
        return jnp.stack([s.amplitude, s.swing, *s.state])

    s = steady_state(as_arrays(parameters(x)), model=Segmented())
    derivatives = np.asarray(jax.jacrev(sizes)(jnp.array(x))) if slopes else np.empty(0)
    return Answer(float(s.amplitude), float(s.swing), status_name(s.status), derivatives, s)


@jax.jit
def followed(x, y0, times):
    """By (25), and by (4)."""
    models = (Segmented(terms=terms, rtol=1e-10, rest_rate=1e-7) for terms in (Terms.linear, Terms.nonlinear))
    return [simulate(parameters(x), y0, times, model=model) for model in models]


@pytest.mark.parametrize(
    ("x", "y0", "periods"),
    [
        (X, REST, 5),
        ((0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 2.0), (0.16, 0.0, 0.0, 0.0), 5),
        ((0.2, 0.1, 0.5, 0.1, 0.08, 0.3, 3.0, 0.7), (0.1, 0.1, 0.0, 0.3), 4),
        ((0.25, 0.05, 0.8, 0.1, 0.2, 0.5, 3.5), (0.08, 0.1, 0.0, 0.0), 4),
    ],
    ids=["hung", "bare", "impacts", "sticking"],
)
def test_motions_are_those_of_the_event_loop(x, y0, periods):
    full = np.array([*x, *[1.0] * (8 - len(x))])
    times = np.linspace(0.0, periods * 2.0 * np.pi / x[6], 11)
    felt = [0, 2] if x[1] == 0 else [0, 1, 2, 3]
    for motion, terms in zip(followed(full, np.array(y0), times), (False, True), strict=True):
        expected = EventDriven(full, nonlinear=terms).run(y0, times, quiet=1e-7)
        assert (status_name(motion.status) == "overturned") == (len(expected) < 11)
        known = expected[:, felt]
        np.testing.assert_allclose(motion.ys[: len(known), felt], known, rtol=0, atol=2e-6 * x[0])


@cache
def settled():
    return nonlinear(X, slopes=True)


def test_the_settled_nonlinear_amplitude_is_known_and_near_the_linear_one():
    answer = settled()
    assert answer.status == "rocking"
    assert answer.amplitude == pytest.approx(SETTLED, rel=1e-5)
    assert answer.amplitude == pytest.approx(linear(X).amplitude, rel=0.01)
    assert answer.amplitude != pytest.approx(linear(X).amplitude, rel=1e-3)


def test_smoothed_comes_to_the_same():
    smoothed = steady_state(as_arrays(parameters(X)), model=Smoothed(terms=Terms.nonlinear))
    assert status_name(smoothed.status) == "rocking"
    sizes = [settled().amplitude, settled().swing]
    np.testing.assert_allclose([smoothed.amplitude, smoothed.swing], sizes, rtol=1e-4)


def test_an_overturning_has_a_status_and_no_gradient():
    assert_overturned(nonlinear(OVERTURNING, slopes=True))


def test_a_held_block_has_its_status():
    steady = steady_state(parameters(LEANING[0]), y0=np.array(LEANING[1]), model=Segmented())
    assert status_name(steady.status) == "held"
    assert float(steady.amplitude) == pytest.approx(LEANING[1][0], rel=1e-12)


def test_rest_is_exact():
    answer = nonlinear(STILL.x, slopes=True)
    assert (answer.status, answer.amplitude) == ("rest", 0.0)
    np.testing.assert_array_equal(answer.slopes[0], 0.0)
    assert answer.swing == pytest.approx(linear(STILL.x).swing, rel=0.02)


def test_polishing_changes_neither_status_nor_sizes_of_a_sticking_block():
    # It hardly lifts, and is held for a part of every half period.
    x, known, tolerance = (0.217, 0.436, 0.754, 0.718, 0.122, 0.35, 2.344, 0.575), 7e-6, 1e-3
    answer, p = nonlinear(x), as_arrays(parameters(x))
    assert answer.status == "sticking"
    assert answer.amplitude == pytest.approx(known, abs=5e-6 * x[0])
    found = reference.settled(tpd.Terms.nonlinear, p)
    assert status_name(found.status) == "sticking"
    assert float(found.amplitude) == pytest.approx(answer.amplitude, abs=2e-6 * x[0])
    assert float(found.swing) == pytest.approx(answer.swing, rel=tolerance)


def test_an_implicit_solver_settles_into_the_same_motion():
    # Without the polishing, which is not that solver's; followed until it repeats within 1e-5.
    p = as_arrays(parameters(X))
    found = eqx.filter_jit(Segmented(solver=diffrax.Kvaerno5()).settle)(p, np.zeros(4))
    assert status_name(found.status) == "rocking"
    assert np.max(np.abs(found.y - settled().steady.state) / scale_of(p)) < 1e-3


def transversality(away):
    """At a turn of a falling block, where phi'' is `away` times the forcing from zero as well."""
    equations = Equations(as_arrays(parameters(X)), Terms.linear)
    falling = Mode(jnp.asarray(SLIP), jnp.asarray(1.0), jnp.asarray(-1.0))
    y = jnp.array([0.05, 0.1, 0.0, 0.2])
    pull, more = (float(equations.rates(y, 1.0, -1.0, sine)[2]) for sine in (0.0, 1.0))
    sine = pull / (pull - more) + away
    run = _begin(equations, y, falling, jnp.asarray(0.0))
    return float(_transversality(equations, run, y, jnp.asarray(_TURN), falling, jnp.asarray(sine)))


def test_a_turn_that_only_touches_is_a_grazing():
    assert transversality(0.0) < 1e-2 * GRAZING
    assert transversality(1e-3) > 1e2 * GRAZING
    assert transversality(2e-3) == pytest.approx(2 * transversality(1e-3), rel=1e-9)


def test_gradients_are_those_of_differences():
    x = (0.25, 0.2, 0.8, 0.1, 0.02, 0.5, 3.5, 0.9)
    answer = nonlinear(x, slopes=True)
    assert answer.status == "rocking"
    for i in (1, 2, 4, 7):
        # rho is tied to nu; steps of 0.2 %.
        expected = differences(
            lambda x: np.array([nonlinear(x).amplitude, nonlinear(x).swing]), x, i, share=2e-3
        )
        # The motion is integrated to 1e-11: over the step in k, the smallest, that is 1e-7 of a difference.
        atol = 1e-7 if NAMES[i] == "k" else 1e-8
        np.testing.assert_allclose(answer.slopes[:2, i], expected, rtol=1e-5, atol=atol)


def test_the_distance_to_the_linear_model_falls_as_the_square_of_the_angles():
    """nu, k and f all in proportion scale the linear motion and nothing else; rho stays."""
    scales, apart = np.geomspace(0.5, 0.01, 4), []
    for s in scales:
        x = np.array(X) * np.array([s, 1, 1, 1, s, s, 1])
        x = np.array([*x, housner(x[0], 0.75 / (1.0 + x[0] ** 2), x[1])])
        apart.append(abs(nonlinear(x).amplitude / linear(x).amplitude - 1.0))
    slopes = np.diff(np.log(apart)) / np.diff(np.log(scales))
    assert np.polyfit(np.log(scales), np.log(apart), 1)[0] == pytest.approx(2.0, abs=0.1)
    assert np.all(np.abs(slopes - 2.0) < 0.2)


def test_steps_that_run_out_are_told_by_name_and_without_a_nan():
    model = Segmented(max_steps=4, max_periods=3)
    found = jax.jit(lambda x: model.settle(parameters(x), jnp.zeros(4)))(np.array(WITH[0].x))
    assert status_name(found.status) == "event_bound"
    for size in (found.amplitude, found.swing, found.y):
        assert np.all(np.isfinite(np.asarray(size)))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"rtol": 0.0}, "`rtol` must be positive and finite, but is 0"),
        ({"max_events": 0}, r"`max_events` must be a whole number, 1 or more, but is 0"),
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Segmented(**wrong)


# Long times in whole forcing periods: late motions of the integrated models are the first ones.


def test_times_are_whole_periods_and_what_is_left_with_their_derivatives():
    p = as_arrays(parameters(WITH[0].x))
    period = float(p.period)
    times = jnp.array([0.0, 0.3, 1.0 - 1e-13, 7.25, 1e6 + 0.5]) * period
    whole, since = split(p, times)
    assert whole.tolist() == [0.0, 0.0, 1.0, 7.0, 1e6]
    np.testing.assert_allclose(since / period, [0.0, 0.3, 0.0, 0.25, 0.5], rtol=0, atol=1e-9)
    slopes = jax.jacfwd(lambda t: split(p, t)[1])(times)
    np.testing.assert_array_equal(slopes, np.eye(5))


def test_legs_end_at_every_time_and_at_every_period_and_a_failure_ends_all():
    p = as_arrays(parameters(WITH[0].x))

    def leg(y, seen, begin, end):
        failed = Status.where(seen >= 4, Status.event_bound, Status.rocking)
        return y + (end - begin), seen + 1, failed

    times = jnp.array([0.2, 0.6, 2.1, 9.0]) * p.period
    ys, status = through(p, jnp.zeros(4), jnp.zeros((), int), times, leg)
    np.testing.assert_allclose(ys[1:3, 0], (times - times[0])[1:3], rtol=1e-12)
    assert status_name(status) == "event_bound"
    assert np.all(np.isnan(ys[3]))


@pytest.mark.parametrize(
    ("model", "error"),
    [(Segmented(terms=Terms.linear), 1e-6), (Smoothed(rtol=1e-9), 1e-5)],
    ids=["segmented", "smoothed"],
)
def test_a_period_that_begins_late_is_the_first_one_of_integrated_models(model, error):
    x = STICKING if isinstance(model, Segmented) else STICKING[:7]
    y0, period = np.asarray(exact(x).steady.state), 2.0 * np.pi / x[6]

    @jax.jit
    def solve(times):
        motion = simulate(parameters(x), y0, times, model=model)
        return motion.ys, motion.status

    first, _ = solve(np.array([0.0, 0.4, 1.0]) * period)
    for count in (1, 1_000, 1_000_000):
        ys, status = solve((count + np.array([0.0, 0.4, 1.0])) * period)
        assert status_name(status) == "rocking"
        np.testing.assert_allclose(ys, first, rtol=0, atol=error)
