"""Errors of smoothed orbits near the exact ones, and step sizes at which solvers fail.

"Both" is the extrapolation 2 a(w/2) - a(w) from two widths; its time is that of two runs.
"""

import math
import time
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tests.benchmarks.stored import columns, markdown
from tests.reference import WITH, Answer, Case, exact, parameters
from tests.reference import solver as solver_of
from tpd import Parameters, Smoothed
from tpd.models.smoothed import rocking_scale
from tpd.scene.pytrees import Number
from tpd.theory.equations import smoothed_rates

QUESTION = "What error does smoothing cause, and at which step size does an explicit solver fail?"
MEASURES = "models/smoothed", "models/smoothed_orbit", "theory/equations"
SEED = None
WIDTHS = tuple(float(x) for x in np.geomspace(1e-4, 1e-1, 7))
TABLED = (1e-2, 1e-3)
SHARP = 1e-5
"""Width of a sign that is almost sharp."""
WAYS = {"both signs": (1, 1), "sign of the tilt": (1, 0), "sign of the rate": (0, 1)}
RATIOS = (1.0, 0.8, 0.5)
"""Velocity ratios of impacts."""
SOLVERS = ("Heun", "Tsit5", "Dopri8")
QUANTITIES = ("amplitude", "gradient")


class Widths(Smoothed):
    """`Smoothed` with two widths of any size, compiled once for all of them."""

    shares: Float[Array, "2"] = eqx.field(kw_only=True)
    """Widths of tilt and rate; `sharpness` is the width of both."""

    def widths(self, p: Parameters) -> tuple[Number, Number]:
        """See `Smoothed`."""
        scale = rocking_scale(p)
        return self.shares[0] * scale, self.shares[1] * p.xi * scale


def _errors(found: Answer, truth: Answer) -> tuple[float, float]:
    """Return the relative error of the amplitude, and that of the gradient over its largest component."""
    if found.status != "rocking":
        return math.nan, math.nan
    apart = np.abs(found.slopes[0] - truth.slopes[0]).max() / np.abs(truth.slopes[0]).max()
    return abs(found.amplitude / truth.amplitude - 1.0), float(apart)


def _row(solve: Callable, case: Case, e: float, way: str, width: float) -> dict[str, Any]:
    """Return errors of the orbit next to the exact one, and the time from the initial state of the scene."""
    x, shares = (*case.x, e), np.where(WAYS[way], width, SHARP)
    truth = exact(x, case.y0)
    state = np.asarray(truth.steady.state)
    one, half = (solve(x, state, of) for of in (shares, np.where(WAYS[way], 0.5 * width, SHARP)))
    begun = time.perf_counter()
    solve(x, case.y0, shares)
    row = {"what": "bias", "scene": case.name, "e": e, "way": way, "width": width}
    status = "rocking" if one.status == half.status == "rocking" else "none"
    twice = {name: 2.0 * getattr(half, name) - getattr(one, name) for name in ("amplitude", "slopes")}
    both = half._replace(**twice, status=status)
    for name, found in (("", one), (", both", both)):
        row |= {q + name: v for q, v in zip(QUANTITIES, _errors(found, truth), strict=True)}
    return row | {"ms": 1e3 * (time.perf_counter() - begun)}


def stable_step(solver: diffrax.AbstractSolver, steps: int = 2000) -> tuple[float, float]:
    """Of a resting block of the default width the stiffest eigenvalue (its modulus, per unit tau), and by
    bisection the largest step of an explicit solver with which a push within the layer dies away."""
    x = WITH[0].x
    widths = Smoothed().widths(parameters(x))
    field = smoothed_rates(parameters((*x[:5], 0.0, *x[6:])), *(float(w) for w in widths))
    slopes = jax.jacfwd(lambda y: field(jnp.zeros(()), y, None))(jnp.zeros(4))
    pace = float(np.abs(np.linalg.eigvals(np.asarray(slopes))).max())
    push = jnp.array([1e-9 * float(widths[0]), 0.0, 0.0, 0.0])

    @jax.jit
    def grows(h: Array) -> Array:
        given = {"adjoint": diffrax.ForwardMode(), "saveat": diffrax.SaveAt(steps=True)}
        given |= {"max_steps": steps + 2}
        ys = diffrax.diffeqsolve(diffrax.ODETerm(field), solver, 0.0, steps * h, h, push, **given).ys
        size = jnp.hypot(pace * ys[:steps, 0], ys[:steps, 2])
        early, late = (jnp.max(part) for part in (size[steps // 4 : steps // 2], size[-steps // 4 :]))
        # What has grown far grows no more, as the smoothed signs are bounded.
        return ~(late < early) | ~(late < 1e3 * pace * push[0])

    low, high = 0.5 / pace, 20.0 / pace
    while high > 1.001 * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if bool(grows(jnp.asarray(middle))) else (middle, high)
    return pace, low


def run(quick: bool) -> list[dict[str, Any]]:
    """Return errors over the widths, and largest stable steps."""
    solve = solver_of(lambda shares: Widths(shares=shares))
    cases, widths = (WITH[:1], WIDTHS[:5:2]) if quick else (WITH, WIDTHS)
    of = [(e, "both signs") for e in RATIOS] + [(1.0, way) for way in list(WAYS)[1:]]
    rows = [_row(solve, c, e, way, w) for e, way in of for w in widths for c in cases]
    for name in SOLVERS[: 1 if quick else None]:
        pace, step = stable_step(getattr(diffrax, name)())
        rows.append({"what": "step", "solver": name, "step": step, "times pace": pace * step})
    return rows


def errors(rows: list[dict[str, Any]], e: float, way: str, quantity: str) -> np.ndarray:
    """Return errors (widths, scenes), NaN without an orbit."""
    there = [r for r in rows if r["what"] == "bias" and (r["e"], r["way"]) == (e, way)]
    widths = sorted({r["width"] for r in there})
    return np.array([[r[quantity] for r in there if r["width"] == w] for w in widths], dtype=float)


def slope(rows: list[dict[str, Any]], e: float, way: str, quantity: str) -> float:
    """d log(error) / d log(width) of the median scene between 10⁻⁴ and 10⁻²; that of the tilt's sign alone,
    which is small, from 3·10⁻³ on."""
    widths = np.array(sorted({r["width"] for r in rows if r["what"] == "bias"}))
    middle = np.nanmedian(errors(rows, e, way, quantity), axis=1)
    low, high = (2.9e-3, 0.11) if way == "sign of the tilt" else (9e-5, 1.1e-2)
    use = (widths > low) & (widths < high) & np.isfinite(middle)
    return float(np.polyfit(np.log(widths[use]), np.log(middle[use]), 1)[0]) if use.sum() > 1 else math.nan


def short(rows: list[dict[str, Any]]) -> str:
    """Return the table of the largest errors over the scenes, by impacts and width."""
    out, widths = [], sorted({r["width"] for r in rows if r["what"] == "bias"})
    for e in RATIOS:
        for i, width in enumerate(widths):
            if not any(abs(width / w - 1.0) < 0.01 for w in TABLED):
                continue
            cells = []
            for q in ("amplitude", "amplitude, both", "gradient", "gradient, both"):
                of = errors(rows, e, "both signs", q)[i]
                cells.append("" if np.all(np.isnan(of)) else f"{np.nanmax(of):.1e}")
            ms = float(np.nanmedian(errors(rows, e, "both signs", "ms")[i]))
            out.append((f"{e:g}", f"{width:.0e}", *cells, f"{ms:.3g}"))
    head = ("e", "width", "amplitude", "extrapolated", "gradient", "extrapolated", "ms")
    return markdown(head, out)


def table(rows: list[dict[str, Any]]) -> str:
    """Return the tables of errors, of their order in the width, and of the largest stable steps."""
    of = [(e, "both signs") for e in RATIOS] + [(1.0, way) for way in list(WAYS)[1:]]
    orders = [(f"{e:g}", way, *(f"{slope(rows, e, way, q):.2f}" for q in QUANTITIES)) for e, way in of]
    order = markdown(
        ("e", "smoothed", "order of the error, amplitude", "order of the error, gradient"), orders
    )
    steps = [r for r in rows if r["what"] == "step"]
    heads = {"solver": "{solver}", "largest stable step at rest (τ)": "{step:.4g}"}
    more = {"step times the stiffest eigenvalue": "{times pace:.3f}"}
    return "\n\n".join((short(rows), order, columns(steps, **heads, **more)))


def pictures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Draw errors over the width: thin for a scene, thick for the median, dashed for two widths."""
    from tpd.plots.style import BLUE, GREY, INK, ORANGE, new_axes

    axes = new_axes(2, (7.0, 7.4))
    widths = np.array(sorted({r["width"] for r in rows if r["what"] == "bias"}))
    for e, colour, marker in zip(RATIOS, (INK, BLUE, ORANGE), "osD", strict=True):
        for ax, quantity in zip(axes, QUANTITIES, strict=True):
            one, both = (errors(rows, e, "both signs", quantity + more) for more in ("", ", both"))
            ax.plot(widths, one, color=colour, lw=0.5, alpha=0.4)
            look = {"color": colour, "marker": marker, "ms": 3.5, "lw": 2.0, "label": f"e = {e:g}"}
            ax.plot(widths, np.nanmedian(one, axis=1), **look)
            ax.plot(widths, np.nanmedian(both, axis=1), color=colour, lw=1.0, ls="--")
    for ax, quantity in zip(axes, QUANTITIES, strict=True):
        ax.axvline(Smoothed().sharpness, color=GREY, lw=1.0, zorder=0)
        ax.set(xscale="log", yscale="log", ylabel=f"relative error of the {quantity} (-)")
    heading = "velocity ratio of impacts (median of scenes;\ndashed: extrapolated from two widths)"
    axes[0].legend(title=heading, fontsize=8)
    axes[-1].set_xlabel("smoothing width as a share of the expected tilt (grey: the default) (-)")
    return {"bias.png": axes[0].figure}
