"""What a search should minimise: rank correlation of objectives with the share of runs that overturn.

In each scene random designs, without any limit, are simulated by nonlinear runs. Each objective is computed
from the symmetric orbits of the same designs, without any run. A scene counts if at least 5 % of the runs
separate its best design from its worst one. The objective was chosen in the same scenes, with other designs.
"""

import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numba
import numpy as np
from scipy.stats import spearmanr

import tpd
from tests.benchmarks.stored import columns

QUESTION = "Which quantity of the steady motion goes with the share of runs that overturn?"
MEASURES = "compiled", "design/orbits", "design/risk", "answers/ensemble"
SEED, RUNS_SEED = 2026, 7
"""Seed of the designs, and of the runs."""
DESIGNS, RUNS = 44, 512
"""Numbers of designs of a scene, and of runs of a design."""
LOW, HIGH = (0.006, 0.06, 0.05), (0.1, 1.2, 0.6)
"""Smallest and largest (mu, lam, zeta) of the designs."""
DIFFERENT = 0.05
"""Difference between the best and the worst share in a scene that counts."""
OBJECTIVES = {
    "settling": "settling, worst half (default)",
    "settling_worst": "settling, worst condition",
    "settling_mean": "settling, mean",
    "four": "after 4 periods, block",
    "norm": "after 16 periods, block and bob",
    "multiplier": "largest multiplier",
    "tilt": "steady tilt, worst",
    "tilt_mean": "steady tilt, mean",
}
"""Objectives with their words."""
SHOWN = "chimney", "13.6 m"
"""Scenes whose designs are drawn."""


@dataclass(frozen=True)
class Case:
    """Scene with its conditions."""

    scene: tpd.Scene
    conditions: tpd.Conditions


def case(scene: tpd.Scene, width: float = 0.05) -> Case:
    """Return a scene with frequencies in a band of a half width, as the default conditions have it."""
    return Case(scene, tpd.Conditions.around(scene, width))


def column(height: float, nu: float, xi: float, strength: float, **block: Any) -> tpd.Scene:
    """Return a uniform block under a harmonic with the frequency ratio `xi` and the acceleration `strength`
    over that of uplift."""
    rate = np.sqrt(9.80665 * 0.75 / (1.0 + nu**2) / (0.5 * height))
    of = tpd.Block(width=nu * height, height=height, mass=1000.0 * nu * height**2, **block)
    amplitude = strength * nu * 9.80665 / (xi * rate) ** 2
    return tpd.Scene(of, tpd.Harmonic(amplitude=amplitude, frequency=xi * rate / (2.0 * np.pi)))


def cases() -> Iterator[tuple[str, Callable[[], Case]]]:
    """Yield names and scenes."""
    from tpd.cli.new import template
    from tpd.design.job import job_of

    for name in ("chimney", "tower", "statue"):
        scene = job_of(tomllib.loads(template(name))).scene
        yield name, lambda scene=scene: case(scene)
    slender = (
        *((3.6, 0.15, 4.1, 1.57), (13.7, 0.17, 4.3, 2.5), (13.6, 0.16, 4.0, 2.04), (11.3, 0.17, 4.5, 2.61)),
        *((7.1, 0.11, 4.1, 2.11), (3.5, 0.16, 4.9, 2.23), (7.6, 0.2, 4.2, 2.24), (6.3, 0.13, 4.6, 2.29)),
        (5.9, 0.12, 4.6, 2.36),
    )
    for height, nu, xi, strength in slender:
        yield f"{height:g} m, ν {nu:g}", lambda x=(height, nu, xi, strength): case(column(*x))
    paper = tpd.paper_scene()
    for words, e, amplitude, friction in (
        ("e 1, 15 mm", 1.0, 0.015, 0.05),
        ("e 1, 20 mm", 1.0, 0.02, 0.05),
        ("e .9, 20 mm", 0.9, 0.02, 0.05),
        ("Housner, 20 mm", "housner", 0.02, 0.05),
        ("Housner, no friction, 20 mm", "housner", 0.02, 0.0),
    ):
        block = replace(paper.block, restitution=e, friction=friction)
        scene = replace(paper, block=block, excitation=tpd.Harmonic(amplitude=amplitude, frequency=2.5))
        yield f"paper's block, {words}", lambda scene=scene: case(scene)
    others: tuple[tuple[float, float, float, dict[str, Any], float], ...] = (
        (8.0, 0.12, 4.0, {"restitution": 0.9}, 0.05),
        (5.0, 0.15, 3.5, {"restitution": 0.8}, 0.05),
        (10.0, 0.14, 5.0, {"restitution": 0.7}, 0.05),
        (8.0, 0.12, 4.0, {"friction": 0.02}, 0.05),
        (5.0, 0.15, 3.5, {"friction": 0.03}, 0.05),
        (3.0, 0.2, 4.5, {"friction": 0.03, "restitution": 0.95}, 0.05),
        (3.0, 0.3, 4.0, {}, 0.05),
        (2.0, 0.35, 3.2, {}, 0.05),
        (1.5, 0.25, 5.0, {}, 0.05),
        (20.0, 0.1, 5.5, {}, 0.05),
        (25.0, 0.08, 4.5, {}, 0.05),
        (8.0, 0.12, 4.0, {}, 0.15),
        (12.0, 0.15, 3.2, {}, 0.2),
    )
    for height, nu, xi, block, width in others:
        words = ", ".join(f"{'e' if key == 'restitution' else 'k'} {x:g}" for key, x in block.items())
        band = f", ±{100 * width:.0f} % in frequency" if width > 0.05 else ""
        name = f"{height:g} m, ν {nu:g}" + (f", {words}" if words else "") + band
        yield name, lambda x=(height, nu, xi, block, width): strong(*x)


def strong(height: float, nu: float, xi: float, block: dict[str, Any], width: float) -> Case:
    """Return the scene with the weakest excitation of a scan that overturns a quarter of the runs."""
    for strength in np.arange(1.3, 4.0, 0.15):
        found = case(column(height, nu, xi, float(strength), **block), width)
        if share(found, None, 192) > 0.25:
            break
    return found


def share(of: Case, pendulum: tpd.Pendulum | None, runs: int = RUNS) -> float:
    """Return the share of nonlinear runs that overturn."""
    ensemble = tpd.Ensemble(size=runs, periods=100, seed=RUNS_SEED)
    found = tpd.outcomes(
        of.scene, pendulum, ensemble=ensemble, conditions=of.conditions, equations="nonlinear"
    )
    return float(found.share_overturned.value)


def objectives(of: Case, designs: np.ndarray) -> dict[str, np.ndarray]:
    """Return each objective of designs (m, 3), (m,)."""
    from tpd.compiled.columns import XI
    from tpd.compiled.rows import row_of
    from tpd.design.optimise import problem_of
    from tpd.scene.conditions import under_all
    from tpd.scene.parameters import as_arrays

    problem = problem_of(of.scene, conditions=of.conditions, limits=(), seed=SEED)
    e = problem.orbits.evaluate(designs)
    x = row_of(under_all(as_arrays(of.scene.parameters()), designs, of.conditions))
    maps = period_maps(x).reshape(*e.kind.shape, 4, 4)
    scale = np.ones((*e.kind.shape, 4))
    scale[..., 2:] = x[:, XI].reshape(e.kind.shape)[..., None]
    maps = maps * scale[..., None, :] / scale[..., None]
    four = np.linalg.matrix_power(maps, 4)[..., ::2, ::2]
    logs = {
        "four": np.log(np.linalg.norm(four, axis=(-2, -1))) / 4.0,
        "norm": np.log(np.linalg.norm(np.linalg.matrix_power(maps, 16), axis=(-2, -1))) / 16.0,
        "multiplier": e.multiplier,
    }
    # Where no orbit attracts, a design is as bad as one that never settles.
    mean = {
        name: np.where(e.kind <= 1, v, np.where(e.kind == 2, -1.0, 1.0)).mean(axis=1)
        for name, v in logs.items()
    }
    tilt = np.where(np.isfinite(e.tilt), e.tilt, 1.0)
    return {
        "settling": problem.orbits.value(e),
        "settling_worst": e.merit.max(axis=1),
        "settling_mean": e.merit.mean(axis=1),
        **mean,
        "tilt": tilt.max(axis=1),
        "tilt_mean": tilt.mean(axis=1),
    }


def period_maps(x: np.ndarray) -> np.ndarray:
    """Return the derivatives of the maps over a period at the largest attracting orbits, (n, 4, 4)."""
    from tpd.compiled import symmetric_orbit_kernel as kernel
    from tpd.compiled.columns import SIZES
    from tpd.compiled.half_map_kernel import store_half_map
    from tpd.compiled.half_period_kernel import half, path_of
    from tpd.compiled.orbits import solve_orbits
    from tpd.compiled.plant import plant

    @numba.njit
    def store(row, t, gamma, work, out):
        plant(row, work.plant)
        m = half(work.plant)
        store_half_map(work.plant, m, t, path_of(work.plant, m, t, gamma), work.map)
        out[:] = work.map @ work.map

    orbits, out, work = solve_orbits(x), np.full((len(x), 4, 4), np.nan), np.zeros(1, kernel.WORK)
    for i, row in enumerate(x):
        best = orbits[i, int(np.argmin(orbits[i]["status"]))]
        if best["status"] <= 1:
            t, gamma = (float(best["sizes"][SIZES[name]]) for name in ("crossing", "phase"))
            store(row, t, gamma, work[0], out[i])
    return out


def run(quick: bool) -> list[dict[str, Any]]:
    """Return a row for each scene."""
    rows = []
    for n, (name, make) in enumerate(cases()):
        if quick and n:
            break
        of, rng = make(), np.random.default_rng([SEED, n])
        shares = rng.random((8 if quick else DESIGNS, 3))
        # Masses and lengths cover decades, damping ratios do not.
        low, high = np.array(LOW), np.array(HIGH)
        designs = low + shares * (high - low)
        designs[:, :2] = low[:2] * (high[:2] / low[:2]) ** shares[:, :2]
        pendulums = [
            of.scene.pendulum(mass_ratio=mu, length_ratio=lam, damping_ratio=zeta)
            for mu, lam, zeta in designs.tolist()
        ]
        true = np.array([share(of, pendulum) for pendulum in pendulums])
        row = {"scene": name, "without": share(of, None), "least": true.min(), "most": true.max()}
        found = objectives(of, designs)
        if np.ptp(true) > DIFFERENT:
            row |= {key: float(spearmanr(true, x)[0]) for key, x in found.items()}
            for key in OBJECTIVES:
                row[f"least_{key}"] = float(true[np.argsort(found[key])[:3]].mean())
        if name.startswith(SHOWN):
            row["shares"] = true.tolist()
            row |= {f"values_{key}": found[key].tolist() for key in ("settling", "tilt")}
        rows.append(row)
        print(
            name,
            {k: round(v, 2) for k, v in row.items() if isinstance(v, float)},
            file=sys.stderr,
            flush=True,
        )
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return the correlations, and the shares of the three designs of least value of two objectives."""
    counted = [row for row in rows if "settling" in row]
    words = {"scene": "{scene}", "without": "{without:.2f}", "designs": "{least:.2f} to {most:.2f}"}
    words |= {text: f"{{{key}:+.2f}}" for key, text in OBJECTIVES.items()}
    words |= {
        "three of least settling": "{least_settling:.2f}",
        "three of least steady tilt": "{least_tilt:.2f}",
    }
    summary = [
        {"of": name} | {key: function([row[key] for row in counted]) for key in OBJECTIVES}
        for name, function in (("median", np.median), ("smallest", np.min), ("below 0.3", below))
    ]
    heads = {"": "{of}"} | {text: f"{{{key}:.3g}}" for key, text in OBJECTIVES.items()}
    left_out = [row["scene"] for row in rows if row not in counted]
    note = f"\n\nWithout a difference between designs: {'; '.join(left_out)}." if left_out else ""
    return f"{columns(summary, **heads)}\n\n{columns(counted, **words)}{note}"


def below(values: list[float]) -> float:
    """Return the number of correlations below 0.3."""
    return float(np.sum(np.array(values) < 0.3))


def pictures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the share that overturns against both objectives."""
    from matplotlib.figure import Figure

    shown = [row for row in rows if "shares" in row]
    figure = Figure(figsize=(7.0, 3.0 * len(shown)), layout="constrained")
    for axes, row in zip(figure.subplots(len(shown), 2, squeeze=False, sharey="row"), shown, strict=True):
        for ax, key in zip(axes, ("tilt", "settling"), strict=True):
            ax.plot(
                row[f"values_{key}"], np.array(row["shares"]) * 100.0, "o", ms=4, mfc="white", mec="black"
            )
            ax.axhline(100.0 * row["without"], color="black", lw=0.8, ls="--")
            ax.set_title(f"{row['scene']}: rank correlation {row[key]:+.2f}", fontsize=9)
        axes[0].set(xlabel="steady tilt over ν, worst condition (-)", ylabel="runs that overturn (%)")
        axes[1].set(xlabel="what remains of a disturbance, per period (-)")
    return {"objectives.png": figure}
