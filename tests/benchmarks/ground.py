"""Motions under records: error and time, with fixed time steps for comparison, and batches.

The fixed steps are those of codes of structural engineering: Runge's method of the fourth order, an impact at
the end of a step, compiled by Numba. Motions in El Centro are held against arithmetic of 50 digits
(`tests/ground_truth.json`); in the scenes of the comparison, which are like them, ours is the reference.
"""

import json
from functools import partial
from typing import Any

import jax
import numba
import numpy as np

import tpd
from tests.benchmarks.stored import ROOT, columns, timed
from tpd.scene.parameters import as_arrays

QUESTION = "How accurate and how fast are motions under records?"
MEASURES = "compiled", "answers/transient", "answers/fragility", "answers/spectra"
SEED, FREE = 0, 10.0
"""Seconds of free motion after the record."""
PARTS = (1, 5, 20, 100, 200)
"""Time steps per sample."""


def scenes() -> dict[str, tuple[tpd.Scene, tpd.Pendulum | None]]:
    """Return two blocks in El Centro, one with a pendulum; neither overturns."""
    record = tpd.records.el_centro()
    statue = tpd.Block(width=0.45, height=1.8, mass=900.0, friction=0.01, restitution=0.9)
    column = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
    with_it = tpd.Pendulum(mass=783.0, length=2.042, damping_ratio=0.129)
    return {
        "statue, without pendulum": (tpd.Scene(statue, record.scaled(1.192)), None),
        "column, with pendulum": (tpd.Scene(column, record.scaled(1.155)), with_it),
    }


def against_digits() -> float:
    """Return the largest relative error of the largest tilt, over the cases of El Centro that stand."""
    worst = 0.0
    for case in json.loads((ROOT / "tests" / "ground_truth.json").read_text())["cases"]:
        s, known = case["scene"], case["results"]
        if case["motion"].get("record") != "el_centro" or known["overturned"]:
            continue
        sizes = ("width", "height", "mass", "friction", "restitution")
        block, with_it = tpd.Block(**{k: float(s[k]) for k in sizes}), None
        if "bob" in s:
            bob, length, damping = (float(s[k]) for k in ("bob", "length", "damping"))
            with_it = tpd.Pendulum(mass=bob, length=length, damping_ratio=damping)
        motion = tpd.records.el_centro().scaled(float(s["scale"]))
        scene = tpd.Scene(block, motion, float(s.get("gravity", 9.80665)))
        y0 = np.array(case["y0"], float) * [1.0, 1.0, float(scene.rate), float(scene.rate)]
        found = tpd.transient(scene, with_it, y0=y0, free=float(case["free"]))
        worst = max(worst, abs(float(found.tilt) / float(known["tilt"]) - 1.0))
    return worst


@numba.njit
def fixed_steps(p: Any, a: np.ndarray, h: float, parts: int, free: float) -> float:
    """Return the largest tilt; p = (nu, mu, lam, zeta, k, rho, e), forcing `a` at intervals `h`."""
    nu, mu, lam, zeta, k, rho, e = p
    c, up, weight = 2.0 * zeta * np.sqrt(lam * rho), 1.0 + 2.0 * mu, (1.0 + mu) * nu
    m11, m12, m21, m22 = 1.0 + mu * rho * (4.0 + nu * nu), -2.0 * mu * rho * lam, -2.0 * rho, lam * rho
    det = m11 * m22 - m12 * m21
    best, side, rests, d = 0.0, 1.0, True, h / parts
    y, z, slope, added = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4)
    for step in range(int((len(a) - 1) * parts + free / d)):
        i = step // parts
        slow = (a[i + 1] - a[i]) / h if i < len(a) - 1 else 0.0
        eta0 = a[i] + slow * d * (step % parts) if i < len(a) - 1 else 0.0
        held = -eta0 - 2.0 * mu * y[1] + mu * c * (lam - 2.0) * y[3]
        if rests and abs(held) > weight + k:
            rests, side = False, np.sign(held)
        for j in range(4):
            part = 0.0 if j == 0 else (1.0 if j == 3 else 0.5)
            # Element by element: arrays that are made anew would take most of the time.
            for m in range(4):
                z[m] = y[m] + part * d * slope[m]
            rate, eta = z[2] - z[3], eta0 + slow * part * d
            slope[0], slope[1], slope[2] = 0.0, z[3], 0.0
            slope[3] = (eta - z[1] - c * z[3]) / m22
            if not rests:
                r1 = up * (z[0] - eta) - weight * side - k * np.sign(z[2]) - mu * lam * c * rate
                r2 = eta - z[1] + c * rate
                slope[0], slope[2], slope[3] = z[2], (m22 * r1 - m12 * r2) / det, (m11 * r2 - m21 * r1) / det
            for m in range(4):
                added[m] = slope[m] if j == 0 else added[m] + (1.0 if j == 3 else 2.0) * slope[m]
        for m in range(4):
            y[m] += d / 6.0 * added[m]
        best = max(best, abs(y[0]))
        if not rests and y[0] * side < 0.0:
            rests = abs(y[2]) < 1e-4 * nu
            change = -y[2] if rests else (e - 1.0) * y[2]
            y[0], y[2], y[3] = 0.0, y[2] + change, y[3] + 2.0 / lam * change
            side = side if rests else np.sign(y[2])
    return best


def _peer(scene: tpd.Scene, with_it: tpd.Pendulum | None) -> tuple:
    """Return the arguments of `fixed_steps`."""
    shaken = tpd.Scene(scene.block, tpd.Harmonic(amplitude=0.01, frequency=1.0), scene.gravity)
    p = as_arrays(shaken.parameters(with_it))
    rho = 3.0 / (4.0 * (1.0 + p.nu**2))
    given = tuple(float(x) for x in (p.nu, p.mu, p.lam, p.zeta, p.k, rho, p.e))
    a = -np.asarray(scene.excitation.acceleration) * float(scene.excitation.scale) / float(scene.gravity)
    return given, a, float(scene.excitation.dt) * float(scene.rate)


def run(quick: bool) -> list[dict[str, Any]]:
    """Return errors and times."""
    rows: list[dict[str, Any]] = [{"what": "50 digits", "error": against_digits()}]
    for name, (scene, with_it) in scenes().items():
        value = jax.jit(lambda s, h: tpd.transient(s, h, free=FREE).tilt)
        exact = float(value(scene, with_it))
        row = {"what": "motion", "scene": name, "steps": 0, "error": 0.0}
        rows.append(row | {"ms": 1e3 * timed(partial(value, scene, with_it), 31)})
        p, a, h = _peer(scene, with_it)
        for parts in PARTS:
            work = partial(fixed_steps, p, a, h, parts, FREE * float(scene.rate))
            row = {"what": "motion", "scene": name, "steps": parts, "error": abs(work() / exact - 1.0)}
            rows.append(row | {"ms": 1e3 * timed(work, 5)})
    for name, work in batches(4 if quick else 44).items():
        work()
        rows.append({"what": "batch", "work": name, "seconds": timed(work, 1 if quick else 3)})
    return rows


def batches(motions: int) -> dict[str, Any]:
    """Return functions that compute a long record with derivatives, a fragility, and a spectrum."""
    rng = np.random.default_rng(SEED)
    column = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution="housner")
    with_it = tpd.Pendulum(mass=900.0, length=3.0, damping_ratio=0.4)

    def noise() -> tpd.Record:
        white = np.convolve(rng.standard_normal(4021), np.hanning(21), "valid")
        return tpd.Record(white * np.sin(np.linspace(0.0, np.pi, len(white))), 0.01).scaled_to(pga_g=0.3)

    records = [noise() for _ in range(motions)]
    scene = tpd.Scene(column, records[0])
    both = jax.jit(jax.value_and_grad(lambda h: tpd.transient(scene, h).tilt))
    curves = partial(tpd.fragility, column, records, scales=np.linspace(0.5, 4.0, 20), pendulum=with_it)
    grid = np.linspace(0.5, 10.0, 5 * motions)
    sine = tpd.Pulse.one_sine(acceleration=1.0, frequency=1.0)
    ratios = {"frequency_ratios": grid, "acceleration_ratios": grid}
    spectrum = partial(tpd.overturning_spectrum, column, sine, with_it, **ratios)
    return {
        "40 s at 0.01 s, tilt and 3 derivatives": lambda: both(with_it),
        f"fragility, {motions} records × 20 stripes × 2": partial(curves, nonlinear=False),
        "fragility, also by the nonlinear equations": curves,
        f"overturning spectrum, {len(grid)}² × 2": spectrum,
    }


def table(rows: list[dict[str, Any]]) -> str:
    """Return the tables of errors and times, of batches, and the error against 50 digits."""
    digits, motions, work = ([r for r in rows if r["what"] == k] for k in ("50 digits", "motion", "batch"))
    heads = {"scene": "{scene}", "steps per sample (0: tpd)": "{steps}"}
    heads |= {"error of the largest tilt": "{error:.1e}", "ms": "{ms:.3g}"}
    line = f"Largest error of the largest tilt against 50 digits, El Centro: {digits[0]['error']:.0e}."
    return "\n\n".join((line, columns(motions, **heads), columns(work, work="{work}", s="{seconds:.3g}")))
