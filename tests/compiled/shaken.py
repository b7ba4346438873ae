"""Motions under records and pulses, followed many at once, and random scenes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import tpd
from tests.truth import GRAVITY, el_centro
from tpd.compiled.columns import XI
from tpd.compiled.rows import ground_row_of
from tpd.compiled.simulate import GroundForcing, Run, follow
from tpd.scene.pytrees import single
from tpd.scene.status import STANDING, is_one_of

SMALL = tpd.Block(width=0.5, height=2.5, mass=1000.0, friction=0.0, restitution=0.9)


class Case(NamedTuple):
    """A block with or without a pendulum under a motion."""

    block: tpd.Block
    pendulum: tpd.Pendulum | None
    motion: Any


def operands(cases: list[Case]) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Rows of parameters, pieces, and units of tau in a second."""
    scenes = [tpd.Scene(c.block, c.motion, GRAVITY) for c in cases]
    p = [scene.ground_parameters(c.pendulum) for scene, c in zip(scenes, cases, strict=True)]
    rows = np.array([ground_row_of(single(x)) for x in p])
    rates = rows[:, XI] / np.array([float(case.motion.piece) for case in cases])
    return rows, [np.asarray(case.motion.pieces(), dtype=float) for case in cases], rates


def motions(cases: list[Case], free: float = 5.0, terms: tpd.Terms = tpd.Terms.linear, **options: Any) -> Run:
    """All the motions, followed freely for `free` seconds after their ends; times in s."""
    rows, pieces, rates = operands(cases)
    forcing = GroundForcing(pieces, free * rates, np.arange(len(cases)))
    found = follow(terms, rows, forcing, **options)
    return found._replace(times=found.times / rates[:, None], uplift_time=found.uplift_time / rates)


def decided(found: Run) -> bool:
    """Whether every motion has an answer, and all its times are those of a motion."""
    known = is_one_of(found.status, *STANDING, tpd.Status.overturned)
    return bool(np.all(known) and np.all(found.times >= 0.0) and np.all(found.uplift_time >= 0.0))


def record(acceleration: Any, dt: float) -> tpd.Record:
    return tpd.Record(acceleration=np.asarray(acceleration, dtype=float), dt=dt)


def _samples(rng: np.random.Generator) -> tuple[np.ndarray, float]:
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


def random_scenes(count: int) -> list[tuple[Case, np.ndarray, float]]:
    """Cases with their samples and intervals."""
    rng, out = np.random.default_rng(1), []
    for _ in range(count):
        width, slenderness = rng.uniform(0.2, 2.0), rng.uniform(3.0, 10.0)
        block = tpd.Block(
            width=width,
            height=width * slenderness,
            mass=1000.0,
            friction=float(rng.choice([0.0, 0.0, 0.02, 0.1])),
            restitution=float(rng.choice([0.3, 0.6, 0.9, 0.98])),
        )
        pendulum = tpd.Pendulum(
            mass=1000.0 * 10.0 ** rng.uniform(-3.0, -0.3),
            length=0.5 * width * slenderness * 10.0 ** rng.uniform(-1.5, 0.3),
            damping_ratio=float(rng.choice([0.0, 0.02, 0.1, 0.6, 1.0, 2.0])),
        )
        with_it = pendulum if rng.random() < 0.8 else None
        a, dt = _samples(rng)
        share = rng.choice([1.0, rng.uniform(0.5, 1.0), rng.uniform(1.0, 3.0)], p=[0.1, 0.2, 0.7])
        a = a * share * GRAVITY / slenderness
        out.append((Case(block, with_it, record(a, dt)), a, dt))
    return out


def changed(scenes: Any, change: Any) -> list[Case]:
    """The same scenes under records changed by `change`, a function of the samples and their interval."""
    return [case._replace(motion=record(*change(a, dt))) for case, a, dt in scenes]
