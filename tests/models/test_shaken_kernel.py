"""Motions of the linear equations under ground motions: quiet starts, cuts, mirrors, rattles and low hops."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

import tpd
from tests.ground_scenes import GRAVITY, el_centro
from tests.ground_series import digits, follow
from tpd.answers.ground_batch import rows_of
from tpd.answers.shaking_history import shaking_history
from tpd.exact.follow import EVENT_BOUND, OVERTURNED, ROCKED, STOOD
from tpd.models.compiled_shaken import Followed, follow_all

SMALL = tpd.Block(width=0.5, height=2.5, mass=1000.0, friction=0.0, restitution=0.9)
COLUMN = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
ELASTIC = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=1.0)
ANGLES = ("tilt", "swing", "relative")


class Case(NamedTuple):
    """A block with or without a pendulum under a motion."""

    block: tpd.Block
    pendulum: tpd.Pendulum | None
    motion: Any

    def row(self) -> np.ndarray:
        return rows_of(self.block, self.pendulum, [self.motion], GRAVITY)[0]


def motions(cases: list[Case], free: float = 5.0, **options: Any) -> Followed:
    """All the motions, followed freely for `free` seconds after their ends; times in s."""
    rows = np.array([case.row() for case in cases])
    rates = rows[:, 6] / np.array([float(case.motion.piece) for case in cases])
    pieces = [np.asarray(case.motion.pieces(), dtype=float) for case in cases]
    found, _ = follow_all(rows, pieces, np.arange(len(cases)), free * rates, **options)
    return found._replace(times=found.times / rates[:, None], lifted=found.lifted / rates)


def decided(found: Followed) -> bool:
    """Whether every motion has an answer, and all its times are those of a motion."""
    known = np.isin(found.status, (STOOD, ROCKED, OVERTURNED))
    return bool(np.all(known) and np.all(found.times >= 0.0) and np.all(found.lifted >= 0.0))


def record(acceleration: Any, dt: float) -> tpd.Record:
    return tpd.Record(acceleration=np.asarray(acceleration, dtype=float), dt=dt)


def samples(rng: np.random.Generator) -> tuple[np.ndarray, float]:
    """A record that begins at zero: noise, single samples, steps, integers, or a part of El Centro."""
    kind = rng.integers(5)
    if kind == 0:
        a = rng.standard_normal(rng.integers(20, 200))
    elif kind == 1:
        a = rng.standard_normal(150) * (rng.random(150) < 0.1)
        a[40] = 1.0
    elif kind == 2:
        a = np.repeat(rng.choice([-1.0, -0.5, 0.0, 0.5, 1.0], 15), 10)
        a[30] = 1.0
    elif kind == 3:
        a = rng.integers(-3, 4, 100).astype(float)
        a[50] = 3.0
    else:
        a = np.array(el_centro()[: rng.integers(100, 400)])
    return np.append(0.0, a / np.abs(a).max()), float(rng.choice([0.005, 0.01, 0.02, 0.1, 0.48]))


def random_scene(rng: np.random.Generator) -> tuple[tpd.Block, tpd.Pendulum | None, float]:
    """Block, pendulum, and the base acceleration (m/s²) at which the bare block lifts."""
    width, slenderness = rng.uniform(0.2, 2.0), rng.uniform(3.0, 10.0)
    height = width * slenderness
    block = tpd.Block(
        width=width,
        height=height,
        mass=1000.0,
        friction=float(rng.choice([0.0, 0.0, 0.02, 0.1])),
        restitution=float(rng.choice([0.3, 0.6, 0.9, 0.98])),
    )
    pendulum = tpd.Pendulum(
        mass=1000.0 * 10.0 ** rng.uniform(-3.0, -0.3),
        length=0.5 * height * 10.0 ** rng.uniform(-1.5, 0.3),
        damping_ratio=float(rng.choice([0.0, 0.02, 0.1, 0.6, 1.0, 2.0])),
    )
    return block, pendulum if rng.random() < 0.8 else None, GRAVITY / slenderness


@pytest.fixture(scope="module")
def scenes() -> list[tuple[Case, np.ndarray, float]]:
    """Cases with their samples and intervals."""
    rng, out = np.random.default_rng(1), []
    for _ in range(200):
        block, pendulum, lift = random_scene(rng)
        a, dt = samples(rng)
        a = a * lift * rng.choice([1.0, rng.uniform(0.5, 1.0), rng.uniform(1.0, 3.0)], p=[0.1, 0.2, 0.7])
        out.append((Case(block, pendulum, record(a, dt)), a, dt))
    return out


@pytest.fixture(scope="module")
def known(scenes) -> Followed:
    return motions([case for case, _, _ in scenes])


def changed(scenes: Any, change: Any) -> list[Case]:
    """The same scenes under records changed by `change`, a function of the samples and their interval."""
    return [case._replace(motion=record(*change(a, dt))) for case, a, dt in scenes]


@pytest.mark.mends("a bob at rest was guessed to swing the other way")
def test_two_zeros_before_a_record_do_not_stop_it():
    hung = tpd.Pendulum(mass=100.0, length=1.0, damping_ratio=0.1)
    found = motions([Case(SMALL, hung, record([0.0, 0.0, 3.0, -3.0, 0.0], 0.02))])
    assert found.status[0] == ROCKED
    assert found.tilt[0] == pytest.approx(1.1256e-4, rel=1e-4, abs=0.0)


@pytest.mark.mends("records with quiet parts had no answer, or times below zero")
def test_every_motion_has_an_answer_and_times_that_are_not_negative(known):
    assert decided(known)


def test_times_grow_along_a_motion():
    rng, looked = np.random.default_rng(3), 0
    for _ in range(40):
        hung = tpd.Pendulum(
            mass=rng.uniform(20.0, 300.0), length=rng.uniform(0.2, 2.2), damping_ratio=rng.uniform(0.02, 0.6)
        )
        shaken = tpd.Scene(SMALL, record([0.0, 0.0, 3.0, -3.0, 0.0], 0.02))
        times = shaking_history(shaken, hung, free=2.0).impacts[:, 0]
        assert np.all(np.diff(times) > 0.0)
        assert np.all(times > 0.02)
        looked += len(times)
    assert looked > 400


@pytest.mark.mends("zeros before a record changed its answer")
def test_leading_zeros_change_the_times_only(scenes, known):
    count = 7
    later = motions(changed(scenes, lambda a, dt: (np.append(np.zeros(count), a), dt)))
    assert np.array_equal(later.status, known.status)
    for name in ANGLES:
        assert np.array_equal(getattr(later, name), getattr(known, name))
    by = np.array([count * dt for _, _, dt in scenes])
    lifted = np.isfinite(known.lifted)
    np.testing.assert_allclose(later.lifted[lifted], (known.lifted + by)[lifted], rtol=1e-12)
    rocked = known.status == ROCKED
    np.testing.assert_allclose(later.times[rocked, 0], (known.times[:, 0] + by)[rocked], rtol=1e-12)


@pytest.mark.mends("what was quiet was answered by rounding, which is not mirrored")
def test_the_mirrored_record_has_the_mirrored_motion(scenes, known):
    other = motions(changed(scenes, lambda a, dt: (-a, dt)))
    assert np.array_equal(other.status, known.status)
    assert np.array_equal(other.state, -known.state)
    for name in ANGLES:
        assert np.array_equal(getattr(other, name), getattr(known, name))


@pytest.mark.mends("low tilts lost digits from one piece to the next")
def test_samples_doubled_by_their_middles_change_nothing(scenes, known):
    def doubled(a: np.ndarray, dt: float) -> tuple[np.ndarray, float]:
        out = np.empty(2 * len(a) - 1)
        out[::2], out[1::2] = a, 0.5 * (a[1:] + a[:-1])
        return out, 0.5 * dt

    finer = motions(changed(scenes, doubled))
    assert np.array_equal(finer.status, known.status)
    rocked = known.status == ROCKED
    hung = rocked & np.array([case.pendulum is not None for case, _, _ in scenes])
    for name, sure in zip(ANGLES, (rocked, hung, hung), strict=True):
        error = np.abs(getattr(finer, name)[sure] / getattr(known, name)[sure] - 1.0)
        # A long rattle doubles a rounding at every few impacts.
        assert np.median(error) < 1e-14
        assert np.quantile(error, 0.95) < 1e-10


@pytest.mark.mends("a motion that went on from a state went another way")
def test_a_record_cut_anywhere_and_continued_is_the_whole_record(scenes, known):
    rng = np.random.default_rng(2)
    rows = np.array([case.row() for case, _, _ in scenes])
    rates = rows[:, 6] / np.array([float(case.motion.piece) for case, _, _ in scenes])
    pieces = [np.asarray(case.motion.pieces(), dtype=float) for case, _, _ in scenes]
    cuts = [int(rng.integers(1, len(p) - 1)) for p in pieces]
    which = np.arange(len(pieces))
    first, _ = follow_all(
        rows, [p[:i] for p, i in zip(pieces, cuts, strict=True)], which, np.zeros(len(rows))
    )
    rest = [p[i:] for p, i in zip(pieces, cuts, strict=True)]
    second, _ = follow_all(rows, rest, which, 5.0 * rates, y0=first.state)
    sure = (known.status != OVERTURNED) & (first.status != OVERTURNED)
    assert np.count_nonzero(sure) > 100
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
    blocks = [SMALL, tpd.Block(width=0.7, height=2.9, mass=800.0, friction=0.0, restitution=1.0)]
    for block in blocks:
        for pendulum in (None, hung):
            peak = block.width / block.height * GRAVITY
            cases = [Case(block, pendulum, record(peak * a, 0.02)) for a in shapes]
            from tpd.models.compiled_nonlinear import shake_nonlinear

            rows = np.array([case.row() for case in cases])
            pieces = [np.asarray(case.motion.pieces(), dtype=float) for case in cases]
            run = shake_nonlinear if nonlinear else follow_all
            found, _ = run(rows, pieces, np.arange(len(cases)), np.full(len(cases), 5.0))
            assert np.all(np.isin(found.status, (STOOD, ROCKED, OVERTURNED)))
            # Nobody computes that of the nonlinear equations.
            assert np.all(np.isnan(found.transversality) == nonlinear)


@pytest.mark.mends("impacts without loss used up the bound on events")
def test_a_rattle_without_losses_has_an_answer():
    a = np.array(el_centro())
    a /= np.abs(a).max()
    uplift = GRAVITY / 6.0
    scales = (1.0, 1.001, 1.01, 1.02, 1.05, 1.1, 1.2, 1.3, 1.5, 2.0)
    hung = tpd.Pendulum(mass=900.0, length=3.0, damping_ratio=0.1)
    cases = [Case(ELASTIC, bob, record(s * uplift * a, 0.02)) for bob in (None, hung) for s in scales]
    found = motions(cases, free=20.0)
    assert decided(found)
    assert np.all(found.status == np.where(found.lifted < np.inf, ROCKED, STOOD))
    assert np.max(found.impacts) > 10_000


def test_a_bound_on_events_that_is_too_low_is_said():
    found = motions([Case(SMALL, None, record([0.0, 4.0, -4.0, 0.0], 0.1))], max_events=1)
    assert found.status[0] == EVENT_BOUND


@pytest.mark.mends("low hops lost digits")
@pytest.mark.parametrize("seed", [15, 245, 256, 270, 390])
def test_low_hops_have_the_digits_of_an_independent_series(seed):
    rng = np.random.default_rng(seed)
    width = round(rng.uniform(0.3, 2.0), 3)
    height, loss = round(width * rng.uniform(3.0, 9.0), 3), float(rng.choice([0.9, 0.95, 0.985]))
    bob = (
        ()
        if seed % 3 == 0
        else (
            round(1000.0 * 10.0 ** rng.uniform(-2.5, -0.4), 2),
            round(0.5 * height * 10.0 ** rng.uniform(-1.0, 0.25), 3),
            float(rng.choice([0.1, 0.4, 0.6, 1.0])),
        )
    )
    lift = width / height * GRAVITY * (1.0 + 10.0 ** rng.uniform(-3.5, -1.0))
    steps = np.repeat(rng.choice([-1, -0.5, 0.3, 0.5, 1.0], 6), 8)
    a = np.round(lift * np.concatenate([[0.2], steps, [0.0]]), 6)
    scene: dict[str, float] = {"width": width, "height": height, "mass": 1000.0, "friction": 0.0}
    scene |= {"restitution": loss, "gravity": GRAVITY, "scale": 1.0}
    scene |= dict(zip(("bob", "length", "damping"), bob, strict=False))
    motion = {"kind": "samples", "dt": 0.01, "acceleration": a.tolist()}
    exact = follow({"scene": scene, "motion": motion, "y0": (0, 0, 0, 0), "free": 0.1}, digits(40))
    block = tpd.Block(width=width, height=height, mass=1000.0, friction=0.0, restitution=loss)
    pendulum = tpd.Pendulum(mass=bob[0], length=bob[1], damping_ratio=bob[2]) if bob else None
    found = motions([Case(block, pendulum, record(a, 0.01))], free=0.1)
    assert 0.0 < exact.amplitude < 3e-4
    assert found.tilt[0] == pytest.approx(float(exact.amplitude), rel=1e-10, abs=0.0)
    if bob:
        assert found.swing[0] == pytest.approx(float(exact.stroke), rel=1e-10, abs=0.0)
