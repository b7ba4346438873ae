"""Scenes of `ground_truth`: SI values, motions and what each is there for."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np

GRAVITY = 9.80665
REST = (0.0, 0.0, 0.0, 0.0)
_RECORD = Path(__file__).parents[1] / "tpd" / "records" / "data" / "elcentro_1940_ns.csv.gz"


def el_centro() -> list[float]:
    """El Centro 1940 NS in m/s², 0.02 s apart."""
    lines = gzip.decompress(_RECORD.read_bytes()).decode().split("\n")[1:]
    return [float(line.split(",")[1]) * GRAVITY for line in lines if line]


def noise(seed: int, count: int, dt: float, frequency: float, jump: float = 0.0) -> dict[str, Any]:
    """Seeded noise through a damped oscillator of the given frequency, under an envelope that ends at zero.

    Its peak is 1 m/s² and five digits are kept. With `jump` the record begins and ends there, not at zero."""
    random = np.random.default_rng(seed)
    turn, out = 2 * np.pi * frequency * dt, np.zeros(count)
    bell = np.sin(np.pi * np.linspace(0, 1, count)) ** 0.7
    decay = np.exp(-0.5 * turn)
    for i, v in enumerate(random.standard_normal(count)):
        out[i] = v + 2 * decay * np.cos(turn * 0.866) * out[i - 1] * (i > 0) - decay**2 * out[i - 2] * (i > 1)
    out *= bell
    out /= np.abs(out).max()
    if jump:
        out[0], out[-1] = jump, -jump
    return {"kind": "samples", "dt": dt, "acceleration": [round(float(v), 5) for v in out]}


def scene(
    size: tuple[float, float, float], loss: tuple[float, float], bob: tuple[float, ...], scale: float
) -> dict[str, float]:
    width, height, mass = size
    friction, restitution = loss
    scene = {
        "width": width,
        "height": height,
        "mass": mass,
        "friction": friction,
        "restitution": restitution,
        "gravity": GRAVITY,
        "scale": scale,
    }
    return {**scene, **dict(zip(("bob", "length", "damping"), bob, strict=False))}


STATUE, COLUMN, TOWER = (0.45, 1.8, 900.0), (1.0, 6.0, 9000.0), (2.0, 10.0, 40000.0)

# Name; width, height, mass; k, e; bob, length, damping ratio; scale.
_RECORD_SCENES = (
    ("El Centro, statue", STATUE, (0.01, 0.9), (), 1.192),
    ("El Centro, statue with pendulum", STATUE, (0.0, 0.95), (72.9, 0.308, 0.147), 1.738),
    ("El Centro, column", COLUMN, (0.01, 0.95), (), 0.882),
    ("El Centro, column with pendulum", COLUMN, (0.0, 0.9595), (783.0, 2.042, 0.129), 1.155),
    ("El Centro, tower", TOWER, (0.0, 0.95), (), 0.964),
    ("El Centro, tower with pendulum", TOWER, (0.0, 0.9423), (5440.0, 4.165, 0.136), 1.564),
    ("El Centro, statue overturns", STATUE, (0.0, 0.9), (), 3.0),
)

# The same, then the arguments of `noise` and, where it is not rest, the start.
_NOISE_SCENES = (
    ("bare, losses", (0.6, 3.4, 8000.0), (0.0, 0.909), (), 4.15, (154, 100, 0.005, 0.85, 0.3), REST),
    ("bare, losses, coarse", (0.8, 4.5, 1000.0), (0.0, 0.91), (), 2.71, (707, 400, 0.02, 1.31, 0.3), REST),
    ("bare, friction", (1.5, 8.2, 8000.0), (0.018, 1.0), (), 3.2, (451, 150, 0.005, 0.7), REST),
    ("bare, friction, long", (0.8, 4.0, 500.0), (0.012, 1.0), (), 3.32, (956, 400, 0.01, 1.13, 0.3), REST),
    ("bare, both", (1.0, 4.2, 8000.0), (0.013, 0.902), (), 4.37, (528, 300, 0.02, 1.51, 0.3), REST),
    (
        "bare, sticks tilted",
        (0.8, 3.2, 1000.0),
        (0.083, 0.95),
        (),
        6.16,
        (60, 400, 0.005, 1.77),
        (0.003, 0.0, 0.036, 0.0),
    ),
    (
        "undamped bob, losses",
        (0.5, 2.6, 500.0),
        (0.0, 0.933),
        (97.0, 0.55, 0.0),
        3.88,
        (407, 300, 0.005, 2.22),
        REST,
    ),
    ("bob, losses", (0.8, 3.3, 500.0), (0.0, 0.921), (80.0, 1.97, 0.5), 6.33, (204, 200, 0.005, 1.88), REST),
    (
        "bob, losses, coarse",
        (1.0, 5.2, 3000.0),
        (0.0, 0.956),
        (335.0, 1.83, 0.1),
        4.86,
        (803, 400, 0.02, 1.42),
        REST,
    ),
    (
        "overdamped bob, friction",
        (1.5, 6.0, 8000.0),
        (0.014, 1.0),
        (1459.0, 2.06, 1.3),
        5.64,
        (57, 400, 0.005, 1.38),
        REST,
    ),
    (
        "bob, friction, sticks",
        (0.4, 2.3, 1000.0),
        (0.024, 1.0),
        (91.0, 0.72, 0.1),
        4.51,
        (874, 100, 0.01, 0.95, 0.3),
        REST,
    ),
    (
        "short bob, both",
        (0.4, 1.5, 8000.0),
        (0.008, 0.961),
        (402.0, 0.29, 0.5),
        8.92,
        (198, 100, 0.01, 1.95),
        REST,
    ),
    (
        "long bob, both",
        (1.5, 6.7, 500.0),
        (0.007, 0.946),
        (90.0, 4.02, 1.3),
        5.14,
        (989, 200, 0.02, 0.85),
        REST,
    ),
    (
        "bob, from a tilt",
        (0.8, 3.4, 1000.0),
        (0.015, 0.902),
        (109.0, 1.1, 0.5),
        4.16,
        (798, 300, 0.005, 1.69),
        (-0.087, -0.028, -0.058, -0.035),
    ),
    (
        "bob, from a small tilt",
        (0.6, 3.2, 1000.0),
        (0.012, 0.949),
        (197.0, 1.41, 0.2),
        5.16,
        (2, 200, 0.01, 1.0),
        (-0.003, 0.049, -0.047, 0.238),
    ),
    (
        "undamped bob, sticks tilted",
        (0.5, 2.9, 500.0),
        (0.08, 1.0),
        (89.0, 0.48, 0.0),
        3.69,
        (282, 400, 0.005, 1.34, 0.3),
        REST,
    ),
    (
        "bob, both, sticks tilted",
        (0.6, 2.8, 500.0),
        (0.057, 0.95),
        (82.0, 0.97, 0.05),
        12.34,
        (73, 300, 0.005, 1.81, 0.3),
        REST,
    ),
    (
        "bob overturns",
        (0.8, 3.3, 500.0),
        (0.0, 0.921),
        (80.0, 1.97, 0.5),
        30.0,
        (204, 200, 0.005, 1.88),
        REST,
    ),
)

# The same with the motion: kind, peak (m/s²) and Hz; for the last kind velocity, Hz, gamma, phase.
_PULSE_SCENES = (
    ("bare, losses", (1.5, 8.9, 500.0), (0.0, 0.896), (), 1.0, ("one_sine", 2.67, 0.99), REST),
    (
        "bob, friction, sticks",
        (0.4, 2.3, 3000.0),
        (0.028, 1.0),
        (410.0, 0.75, 0.1),
        1.0,
        ("one_sine", 2.99, 1.17),
        REST,
    ),
    (
        "bob, both",
        (1.2, 5.6, 3000.0),
        (0.014, 0.945),
        (534.0, 3.12, 0.1),
        1.0,
        ("one_sine", 8.61, 1.23),
        REST,
    ),
    (
        "bob, losses",
        (1.0, 4.2, 8000.0),
        (0.0, 0.896),
        (1453.0, 1.06, 0.2),
        1.0,
        ("one_cosine", 4.9, 1.05),
        REST,
    ),
    (
        "from a tilt",
        (0.5, 2.2, 1000.0),
        (0.011, 0.925),
        (),
        1.0,
        ("one_cosine", 4.39, 1.19),
        (-0.052, 0.0, 0.052, 0.0),
    ),
    (
        "undamped bob, sticks tilted",
        (0.5, 2.1, 500.0),
        (0.092, 0.95),
        (86.0, 0.58, 0.0),
        1.0,
        ("one_cosine", 9.91, 1.58),
        REST,
    ),
    (
        "overdamped bob",
        (1.2, 6.4, 1000.0),
        (0.0, 0.896),
        (170.0, 2.3, 1.3),
        1.0,
        ("ricker", 9.47, 1.27),
        REST,
    ),
    ("bare, both", (1.5, 6.2, 3000.0), (0.011, 0.903), (), 1.0, ("ricker", 5.75, 0.68), REST),
    (
        "bob, both",
        (0.5, 2.2, 3000.0),
        (0.006, 0.929),
        (262.0, 1.09, 0.2),
        1.0,
        ("mavroeidis", 0.764, 2.24, 2.5, 0.5),
        REST,
    ),
    (
        "bare, friction",
        (0.8, 4.5, 500.0),
        (0.023, 1.0),
        (),
        1.0,
        ("mavroeidis", 0.79, 1.16, 1.5, 0.0),
        REST,
    ),
    (
        "light bob, losses",
        (0.4, 1.8, 3000.0),
        (0.0, 0.954),
        (194.0, 1.07, 0.5),
        1.0,
        ("one_cosine", 8.32, 2.56),
        REST,
    ),
    (
        "bob, both, sticks",
        (0.6, 2.9, 8000.0),
        (0.013, 0.925),
        (856.0, 0.31, 0.0),
        1.0,
        ("mavroeidis", 0.466, 1.36, 2.0, 1.5),
        REST,
    ),
    ("bare overturns", (1.5, 8.9, 500.0), (0.0, 0.896), (), 1.5, ("one_sine", 2.67, 0.6), REST),
    (
        "bob overturns",
        (1.0, 4.2, 8000.0),
        (0.0, 0.896),
        (1453.0, 1.06, 0.2),
        1.5,
        ("one_cosine", 4.9, 0.7),
        REST,
    ),
    (
        "bob overturns, friction",
        (0.4, 2.3, 3000.0),
        (0.028, 1.0),
        (410.0, 0.75, 0.1),
        1.6,
        ("ricker", 2.99, 0.8),
        REST,
    ),
)

DERIVED = (
    "El Centro, statue with pendulum",
    "El Centro, column with pendulum",
    "El Centro, tower with pendulum",
    "noise: bob, from a small tilt",
    "one_sine: bob, both",
    "mavroeidis: bob, both",
)
"""Cases with derivatives of the largest tilt."""


def _pulse(kind: str, *numbers: float) -> dict[str, Any]:
    names = ("velocity", "frequency", "gamma", "phase") if kind == "mavroeidis" else ("peak", "frequency")
    return {"kind": kind, **dict(zip(names, numbers, strict=True))}


def cases() -> list[dict[str, Any]]:
    """Scene, motion, start and seconds of free motion of every case."""
    record = {"kind": "samples", "record": "el_centro", "dt": 0.02, "acceleration": el_centro()}
    out = [
        {"name": name, "scene": scene(*numbers), "motion": record, "y0": REST, "free": 20.0}
        for name, *numbers in _RECORD_SCENES
    ]
    for name, *numbers, motion, y0 in _NOISE_SCENES:
        case = {"name": f"noise: {name}", "scene": scene(*numbers), "motion": noise(*motion)}
        out.append({**case, "y0": y0, "free": 10.0})
    for name, *numbers, motion, y0 in _PULSE_SCENES:
        case = {"name": f"{motion[0]}: {name}", "scene": scene(*numbers), "motion": _pulse(*motion)}
        out.append({**case, "y0": y0, "free": 10.0})
    return out


LOSS = 1 - 1.5 * float(np.sin(0.25)) ** 2

# W, e and, near them, the scales in g nu from which one sine overturns a bare block after one impact, is safe
# again, and overturns it without impact.
BOUNDARIES = (
    (1.0, 0.9, (1.132047,)),
    (2.0, 0.9, (1.225179, 2.314403, 2.349903)),
    (3.0, 0.9, (1.403565, 3.484663, 3.631150)),
    (4.0, 0.9, (1.795442, 4.850111, 5.238964)),
    (5.0, 0.9, (3.018600, 6.318071, 7.168129)),
    (6.0, 0.9, (5.164159, 7.669873, 9.416966)),
    (1.0, LOSS, (1.131682,)),
    (2.0, LOSS, (1.224174, 2.317812, 2.349903)),
    (3.0, LOSS, (1.400100, 3.499172, 3.631150)),
    (4.0, LOSS, (1.778667, 4.890763, 5.238964)),
    (5.0, LOSS, (2.920561, 6.416141, 7.168129)),
    (6.0, LOSS, (4.909871, 7.924169, 9.416966)),
)

# Motion, Hz, bob, and near it the scale in g nu from which the column overturns; k = 0, e = 0.9595.
CRITICAL = (
    ("one_sine", 0.7425, (), 1.3850197621),
    ("one_sine", 0.7425, (450.0, 0.9, 0.1), 1.4137807077),
    ("one_sine", 0.7425, (900.0, 2.1, 0.1), 1.5237469028),
    ("one_sine", 1.2375, (), 2.4864693038),
    ("one_sine", 1.2375, (450.0, 0.9, 0.1), 2.9952308074),
    ("one_sine", 1.2375, (900.0, 2.1, 0.1), 7.0009413860),
    ("one_sine", 1.4850, (), 3.9828414953),
    ("one_sine", 1.4850, (450.0, 0.9, 0.1), 5.4064918106),
    ("one_sine", 1.4850, (900.0, 2.1, 0.1), 9.2069563473),
    ("one_cosine", 0.7425, (), 1.8031136707),
    ("one_cosine", 0.7425, (450.0, 0.9, 0.1), 1.8880083403),
    ("one_cosine", 0.7425, (900.0, 2.1, 0.1), 1.9844558175),
)
