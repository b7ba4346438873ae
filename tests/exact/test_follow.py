"""Motions of the linear equations under ground motions: quiet starts, cuts, mirrors, rattles and low hops."""

import numpy as np
import pytest

import tpd
from tests.exact.shaken import SMALL, Case, changed, decided, motions, operands, random_scenes, record
from tests.reference import EventDriven
from tests.truth import GRAVITY, digits, el_centro, shaken
from tpd.answers.shaking_history import shaking_history
from tpd.exact.follow import EVENT_BOUND, OVERTURNED, ROCKED, STOOD
from tpd.models.compiled_nonlinear import shake_nonlinear
from tpd.models.compiled_shaken import follow_all

COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
ANGLES = ("tilt", "swing", "relative")
SCENES = random_scenes(120)


@pytest.fixture(scope="module")
def known():
    return motions([case for case, _, _ in SCENES])


@pytest.mark.mends("records with quiet parts had no answer, or times below zero")
def test_every_motion_has_an_answer_and_times_that_are_not_negative(known):
    assert decided(known)


@pytest.mark.parametrize("nonlinear", [False, True])
def test_motions_under_records_are_those_of_the_event_loop(nonlinear):
    rng, compared = np.random.default_rng(6), 0
    for hung in (None, tpd.Pendulum(mass=60.0, length=0.6, damping_ratio=0.3)):
        for friction, restitution in ((0.0, 0.8), (0.03, 1.0), (0.05, 0.9)):
            block = tpd.Block(width=0.5, height=2.5, mass=1000.0, friction=friction, restitution=restitution)
            a = np.append(0.0, rng.standard_normal(12)) * 2.5
            rows, pieces, rates = operands([Case(block, hung, record(a, 0.1))])
            run = shake_nonlinear if nonlinear else follow_all
            options = {"rtol": 1e-11} if nonlinear else {}
            found = run(rows, pieces, np.zeros(1, int), np.full(1, 2.0), **options)[0]
            x, h = rows[0], rows[0, 6]
            eta = -x[5] * np.append(pieces[0][:, 0], pieces[0][-1].sum())
            loop = EventDriven([*x[:6], 1.0, x[8]], nonlinear=nonlinear, samples=(eta, h))
            times = np.array([0.0, len(pieces[0]) * h + 2.0])
            expected = loop.run(np.zeros(4), times, quiet=1e-4 if nonlinear else 2e-7)
            assert rates[0] == pytest.approx(h / 0.1)
            if len(expected) == 2:
                compared += 1
                felt = slice(None) if hung else slice(None, None, 2)
                reach = 1e-6 if nonlinear else 1e-8
                np.testing.assert_allclose(found.state[0, felt], expected[-1, felt], rtol=0, atol=reach)
    assert compared >= 4


@pytest.mark.mends("a bob at rest was guessed to swing the other way")
def test_two_zeros_before_a_record_do_not_stop_it():
    hung = tpd.Pendulum(mass=100.0, length=1.0, damping_ratio=0.1)
    found = motions([Case(SMALL, hung, record([0.0, 0.0, 3.0, -3.0, 0.0], 0.02))])
    assert found.status[0] == ROCKED
    assert found.tilt[0] == pytest.approx(1.1256e-4, rel=1e-4, abs=0.0)


def test_times_grow_along_a_motion():
    rng, looked = np.random.default_rng(3), 0
    for _ in range(20):
        hung = tpd.Pendulum(
            mass=rng.uniform(20.0, 300.0), length=rng.uniform(0.2, 2.2), damping_ratio=rng.uniform(0.02, 0.6)
        )
        scene = tpd.Scene(SMALL, record([0.0, 0.0, 3.0, -3.0, 0.0], 0.02))
        times = shaking_history(scene, hung, free=2.0).impacts[:, 0]
        assert np.all(np.diff(times) > 0.0)
        assert np.all(times > 0.02)
        looked += len(times)
    assert looked > 200


@pytest.mark.mends("zeros before a record changed its answer")
def test_leading_zeros_change_the_times_only(known):
    later = motions(changed(SCENES, lambda a, dt: (np.append(np.zeros(7), a), dt)))
    assert np.array_equal(later.status, known.status)
    for name in ANGLES:
        assert np.array_equal(getattr(later, name), getattr(known, name))
    by = np.array([7 * dt for _, _, dt in SCENES])
    lifted, rocked = np.isfinite(known.lifted), known.status == ROCKED
    np.testing.assert_allclose(later.lifted[lifted], (known.lifted + by)[lifted], rtol=1e-12)
    np.testing.assert_allclose(later.times[rocked, 0], (known.times[:, 0] + by)[rocked], rtol=1e-12)


@pytest.mark.mends("what was quiet was answered by rounding, which is not mirrored")
def test_the_mirrored_record_has_the_mirrored_motion(known):
    other = motions(changed(SCENES, lambda a, dt: (-a, dt)))
    assert np.array_equal(other.status, known.status)
    assert np.array_equal(other.state, -known.state)
    for name in ANGLES:
        assert np.array_equal(getattr(other, name), getattr(known, name))


@pytest.mark.mends("a motion that went on from a state went another way")
def test_a_record_cut_anywhere_and_continued_is_the_whole_record(known):
    rng = np.random.default_rng(2)
    rows, pieces, rates = operands([case for case, _, _ in SCENES])
    cuts, which = [int(rng.integers(1, len(p) - 1)) for p in pieces], np.arange(len(pieces))
    before, rest = (
        [p[c] for p, c in zip(pieces, map(s, cuts), strict=True)] for s in (slice, lambda i: slice(i, None))
    )
    first, _ = follow_all(rows, before, which, np.zeros(len(rows)))
    second, _ = follow_all(rows, rest, which, 5.0 * rates, y0=first.state)
    sure = (known.status != OVERTURNED) & (first.status != OVERTURNED)
    assert np.count_nonzero(sure) > 60
    np.testing.assert_allclose(second.state[sure], known.state[sure], rtol=1e-9, atol=1e-12)
    tilt = np.maximum(first.tilt, second.tilt)
    np.testing.assert_allclose(tilt[sure], known.tilt[sure], rtol=1e-12)


@pytest.mark.mends("one zero more in front of El Centro left lengths of the pendulum without an answer")
def test_a_zero_before_el_centro():
    lengths = (1.438, 1.533, 1.723, 2.008, 2.103, 3.241, 3.905)
    bobs = [tpd.Pendulum(mass=783.0, length=length, damping_ratio=0.129) for length in lengths]
    a = 1.155 * np.array(el_centro())
    plain, later = (
        motions([Case(COLUMN, bob, record(x, 0.02)) for bob in bobs]) for x in (a, np.append(0.0, a))
    )
    assert decided(later)
    for name in ANGLES:
        assert np.array_equal(getattr(later, name), getattr(plain, name))


@pytest.mark.mends("a spike just above uplift had no answer, or a tilt of rounding")
@pytest.mark.parametrize("shape", [[0.0, 1.0, 0.0], [0.1, 0.3, 1.0, -0.2, 0.1, 0.0]])
def test_a_spike_just_above_uplift_tilts_by_the_cube_of_its_excess(shape):
    excess = 10.0 ** -np.arange(6.0, 15.6, 0.1)
    spikes = [record(np.array(shape) * 0.2 * GRAVITY * (1.0 + x), 0.02) for x in excess]
    found = motions([Case(SMALL, None, spike) for spike in spikes])
    assert decided(found)
    low, high = found.tilt[excess > 1e-8], excess[excess > 1e-8]
    np.testing.assert_allclose(low / high**3, low[0] / high[0] ** 3, rtol=1e-3)
    assert np.all(found.tilt[excess < 1e-12] < 1e-36)


@pytest.mark.mends("shaking that just balances the weight had no answer")
@pytest.mark.parametrize("nonlinear", [False, True])
def test_shaking_that_just_balances_the_weight_has_an_answer(nonlinear):
    shapes = [np.repeat([0.0, 1.0, -0.5, 1.0, 0.0], n) for n in (1, 2, 3, 10)]
    shapes += [np.array([0.0, 3, 3, -1, 2, 3, 0]) / 3.0, np.array(el_centro()) / np.max(np.abs(el_centro()))]
    hung = tpd.Pendulum(mass=60.0, length=0.6, damping_ratio=0.3)
    elastic = tpd.Block(width=0.7, height=2.9, mass=800.0, friction=0.0, restitution=1.0)
    for block in (SMALL, elastic):
        peak = block.width / block.height * GRAVITY
        cases = [Case(block, bob, record(peak * a, 0.02)) for bob in (None, hung) for a in shapes]
        rows, pieces, _ = operands(cases)
        run = shake_nonlinear if nonlinear else follow_all
        found, _ = run(rows, pieces, np.arange(len(cases)), np.full(len(cases), 5.0))
        assert np.all(np.isin(found.status, (STOOD, ROCKED, OVERTURNED)))
        # Nobody computes that of the nonlinear equations.
        assert np.all(np.isnan(found.transversality) == nonlinear)


@pytest.mark.mends("impacts without loss used up the bound on events")
def test_a_rattle_without_losses_has_an_answer():
    a = np.array(el_centro())
    uplift, scales = GRAVITY / 6.0 / np.abs(a).max(), (1.0, 1.001, 1.02, 1.1, 1.5)
    block = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=1.0)
    hung = tpd.Pendulum(mass=900.0, length=3.0, damping_ratio=0.1)
    cases = [Case(block, bob, record(s * uplift * a, 0.02)) for bob in (None, hung) for s in scales]
    found = motions(cases, free=20.0)
    assert decided(found)
    assert np.all(found.status == np.where(found.lifted < np.inf, ROCKED, STOOD))
    assert np.max(found.impacts) > 10_000


def test_a_bound_on_events_that_is_too_low_is_said():
    found = motions([Case(SMALL, None, record([0.0, 4.0, -4.0, 0.0], 0.1))], max_events=1)
    assert found.status[0] == EVENT_BOUND


@pytest.mark.mends("low hops lost digits")
@pytest.mark.parametrize("seed", [15, 256, 390])
def test_low_hops_have_fifty_digits(seed):
    rng = np.random.default_rng(seed)
    width = round(rng.uniform(0.3, 2.0), 3)
    height, loss = round(width * rng.uniform(3.0, 9.0), 3), float(rng.choice([0.9, 0.95, 0.985]))
    bob = ()
    if seed % 3 != 0:
        mass, length = (
            1000.0 * 10.0 ** rng.uniform(-2.5, -0.4),
            0.5 * height * 10.0 ** rng.uniform(-1.0, 0.25),
        )
        bob = round(mass, 2), round(length, 3), float(rng.choice([0.1, 0.4, 0.6, 1.0]))
    lift = width / height * GRAVITY * (1.0 + 10.0 ** rng.uniform(-3.5, -1.0))
    steps = np.repeat(rng.choice([-1, -0.5, 0.3, 0.5, 1.0], 6), 8)
    a = np.round(lift * np.concatenate([[0.2], steps, [0.0]]), 6)
    scene = {"width": width, "height": height, "mass": 1000.0, "friction": 0.0, "restitution": loss}
    scene |= {"gravity": GRAVITY, "scale": 1.0, **dict(zip(("bob", "length", "damping"), bob, strict=False))}
    motion = {"kind": "samples", "dt": 0.01, "acceleration": a.tolist()}
    exact = shaken({"scene": scene, "motion": motion, "y0": (0, 0, 0, 0), "free": 0.1}, digits(40))
    block = tpd.Block(width=width, height=height, mass=1000.0, friction=0.0, restitution=loss)
    pendulum = tpd.Pendulum(mass=bob[0], length=bob[1], damping_ratio=bob[2]) if bob else None
    found = motions([Case(block, pendulum, record(a, 0.01))], free=0.1)
    assert 0.0 < exact.amplitude < 3e-4
    assert found.tilt[0] == pytest.approx(float(exact.amplitude), rel=1e-10, abs=0.0)
    if bob:
        assert found.swing[0] == pytest.approx(float(exact.stroke), rel=1e-10, abs=0.0)
