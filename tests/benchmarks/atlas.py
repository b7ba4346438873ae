"""A picture of every regime of the atlas, into `notebooks/pictures/atlas`.

.venv/bin/python -m tests.benchmarks.atlas
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

jax.config.update("jax_enable_x64", True)

from tests.answers.test_bifurcations import BARE as FOLDING  # noqa: E402
from tests.answers.test_bifurcations import HELD, TOUCHING, Kind, lost  # noqa: E402
from tests.exact.orbits import among  # noqa: E402
from tests.exact.orbits import solve as orbits  # noqa: E402
from tests.exact.test_settle import after, hops  # noqa: E402
from tests.exact.test_steady import CHAOTIC  # noqa: E402
from tests.exact.test_trajectory import SAMPLES, tossed  # noqa: E402
from tests.models.test_piecewise import XI, F, dimensionless, fast_limit, moved  # noqa: E402
from tests.reference import BARE, HUNG, UNSTABLE, along, exact, parameters  # noqa: E402
from tpd import Piecewise  # noqa: E402
from tpd.plot.style import BLUE, GREY, INK, ORANGE  # noqa: E402
from tpd.scene.parameters import as_arrays  # noqa: E402

PICTURES = Path(__file__).parents[2] / "notebooks" / "pictures" / "atlas"


def axes(count: int, rows: int = 1) -> tuple[Figure, Any]:
    """A figure and its axes, always a vector."""
    columns = count // rows
    figure = Figure(figsize=(5.2 * columns, 4.2 * rows), layout="constrained", dpi=110)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False).ravel()


def power(ax: Any, distances: np.ndarray, value: float, exponent: float) -> None:
    """A line of that exponent, through a value at the first distance."""
    line = value * (distances / distances[0]) ** exponent
    ax.plot(distances, line, ":", color=INK, lw=1.2, label=f"exponent {exponent:g}")


def fold() -> Figure:
    """Gradient on both branches, and where it is refused."""
    figure, (left, right) = axes(2)
    b, distances = lost(Kind.fold), 10.0 ** np.linspace(-14.0, -2.0, 49)
    o = among(FOLDING, "f", b.value * (1.0 + distances))
    for j, (label, marker, color) in enumerate((("attracting", "o", BLUE), ("repelling", "s", ORANGE))):
        slopes = np.abs(o.slopes[:, j, 0, F])
        left.loglog(distances, slopes, marker, ms=8 - 4 * j, color=color, mfc="none", label=label)
    known = np.isfinite(o.slopes[:, 0, 0, F])
    power(left, distances[known], np.abs(o.slopes[known, 0, 0, F])[0], -0.5)
    left.axvspan(distances[0], distances[known][0], color=GREY, alpha=0.35, label="near_fold: refused")
    left.set(
        xlabel="distance from the fold, f/f* - 1 (-)", ylabel="size of the gradient d(amplitude)/df (rad)"
    )
    values = b.value * (1.0 + 0.05 * np.linspace(1e-5, 1.0, 60) ** 2)
    o = among(FOLDING, "f", values)
    for j, style in enumerate(("-", "--")):
        right.plot(values, o.amplitude[:, j], style, color=BLUE if j == 0 else ORANGE)
    right.axvline(b.value, color=GREY, lw=1)
    right.set(xlabel="base acceleration f (-)", ylabel="amplitude of the tilt (rad)")
    right.annotate("no orbit", (b.value - 1e-4, o.amplitude[0, 0]), ha="right", va="center")
    right.set_xlim(b.value - 8e-4, None)
    right.locator_params(axis="x", nbins=5)
    right.set_title("solid: attracting, dashed: repelling")
    left.legend()
    return figure


def symmetry() -> Figure:
    """The branches where symmetry breaks, and the gradient of the leaning motion."""
    figure, (left, right) = axes(2)
    b = lost(Kind.symmetry_breaking)
    values = b.value * (1.0 + np.linspace(-0.02, 0.02, 61))
    o = among(UNSTABLE[0], "xi", values)
    for name, style in (("rocking", "-"), ("unstable", "--")):
        there = o.status[:, 0] == name
        left.plot(values[there], o.amplitude[there, 0], style, color=BLUE, label=f"symmetric, {name}")
    distances = 10.0 ** np.linspace(np.log10(0.02), -4.5, 14)
    straight = among(UNSTABLE[0], "xi", b.value * (1.0 - distances))
    lean, leaning = 0.01 * straight.state[0, 0], []
    for i, distance in enumerate(distances):
        x = moved(UNSTABLE[0], XI, b.value * (1.0 - distance))
        leaning.append(exact(x, straight.state[i, 0] + lean))
        lean = np.asarray(leaning[-1].steady.state) - straight.state[i, 0]
        lean = lean * np.sqrt(distances[min(i + 1, 13)] / distance)
    left.plot(
        b.value * (1.0 - distances),
        [a.amplitude for a in leaning],
        "-o",
        ms=3,
        color=ORANGE,
        label="leaning, rocking",
    )
    left.axvline(b.value, color=GREY, lw=1)
    left.set(xlabel="frequency ratio (-)", ylabel="amplitude of the tilt (rad)")
    left.legend()
    slopes = np.abs([a.slopes[0, XI] for a in leaning])
    right.loglog(distances, slopes, "o", mfc="none", color=ORANGE, label="leaning motion")
    right.loglog(
        distances, np.abs(straight.slopes[:, 0, 0, XI]), "s", ms=4, color=BLUE, label="symmetric orbit"
    )
    power(right, distances[::-1], slopes[-1], -0.5)
    right.set(
        xlabel="distance from the breaking, 1 - xi/xi* (-)",
        ylabel="size of the gradient d(amplitude)/d(xi) (rad)",
    )
    right.legend()
    return figure


def grazing() -> Figure:
    """Derivative of a motion that touches its base, and the margin of an orbit."""
    figure, (left, right) = axes(2)
    x, begin, v, touch = tossed()
    times = begin + np.linspace(0.0, 1.3 * touch, SAMPLES)
    distances = 10.0 ** np.linspace(-10.0, -2.0, 33)
    for sign, label, marker, color in ((1, "crosses the base", "o", ORANGE), (-1, "turns before", "s", BLUE)):
        slopes = [
            abs(along(x, (0.05, 0.0, -v * (1.0 + sign * d), 0.0), times)[1][-1, 2, 2]) for d in distances
        ]
        left.loglog(distances, slopes, marker, mfc="none", ms=5, color=color, label=label)
        if sign > 0:
            power(left, distances, slopes[0], -0.5)
    left.set(
        xlabel="distance from the touch, in shares of the speed (-)",
        ylabel="derivative of the rate after it by that before (-)",
    )
    left.legend()
    b, distances = lost(Kind.grazing), 10.0 ** np.linspace(-10.0, -2.0, 33)
    o = among(TOUCHING, "f", b.value * (1.0 - distances))
    for name, marker, color in (("unstable", "o", BLUE), ("grazing", "x", INK)):
        there = o.status[:, 1] == name
        right.loglog(distances[there], o.grazing[there, 1], marker, mfc="none", color=color, label=name)
    right.axhline(1e-7, color=GREY, lw=1, label="below: refused")
    right.set(xlabel="distance from the grazing, 1 - f/f* (-)", ylabel="margin to grazing (-)")
    right.legend()
    return figure


def sticking() -> Figure:
    """Amplitude, its slope and the margin across the onset of sticking."""
    figure, (left, right) = axes(2)
    b = lost(Kind.sticking)
    shares = np.concatenate([-(10.0 ** np.linspace(-1.7, -5.0, 14)), 10.0 ** np.linspace(-5.0, -1.7, 14)])
    o = among(HELD, "f", b.value * (1.0 + np.abs(shares)))
    found = [exact(moved(HELD, F, b.value * (1 + d)), o.state[i, 0]) for i, d in enumerate(shares)]
    for name, marker, color in (("sticking", "s", ORANGE), ("rocking", "o", BLUE)):
        there = np.array([a.status == name for a in found])
        values = b.value * (1.0 + shares[there])
        left.plot(
            values,
            [a.amplitude for a in found if a.status == name],
            marker,
            mfc="none",
            color=color,
            label=name,
        )
        right.plot(
            values,
            [a.slopes[0, F] for a in found if a.status == name],
            marker,
            mfc="none",
            color=color,
            label=name,
        )
    for ax in (left, right):
        ax.axvline(b.value, color=GREY, lw=1)
        ax.set_xlabel("base acceleration f (-)")
        ax.legend()
    left.set_ylabel("amplitude of the tilt (rad)")
    right.set_ylabel("its gradient d(amplitude)/df (rad)")
    return figure


def rattling() -> Figure:
    """Hops until capture, and what the capture leaves out."""
    figure, (left, right) = axes(2)
    nu, e, tilt, speeds = 0.2, 0.8, 0.01, 10.0 ** np.linspace(-7.0, -1.0, 25)
    x = (nu, 0.0, 0.4, 0.2, 0.0, 0.0, 1.0, e)
    counts = [hops(x, tilt, q) for q in speeds]
    fastest = np.sqrt(2.0 * nu * tilt - tilt**2)
    fine = 10.0 ** np.linspace(-7.0, -1.0, 2000)
    left.semilogx(
        fine, 1 + np.ceil(np.log(fine * nu / fastest) / np.log(e)), "-", color=GREY, label="closed form"
    )
    left.semilogx(speeds, counts, "o", mfc="none", color=BLUE, label="followed, e = 0.8, k = 0")
    x = (nu, 0.0, 0.4, 0.2, 0.05, 0.0, 1.0, 1.0)
    left.semilogx(
        speeds,
        [hops(x, tilt, q) for q in speeds],
        "s",
        mfc="none",
        color=ORANGE,
        label="followed, e = 1, k = 0.05",
    )
    left.axvline(2e-7, color=INK, lw=1, ls="--", label="default capture speed")
    left.set(xlabel="capture speed, in units of the slenderness (-)", ylabel="impacts until rest (-)")
    left.legend()
    x, y0 = np.array((0.2, 0.2, 0.5, 0.1, 0.02, 0.05, 2.0, 0.8)), np.array([0.02, 0.05, 0.0, 0.0])
    ends = [np.asarray(after(x, y0, np.array(10.0), np.array(0.2 * q))[0]) for q in (1e-7, *speeds)]
    apart = np.linalg.norm(np.array(ends[1:]) - ends[0], axis=1)
    seen = apart > 3e-15
    right.loglog(speeds[seen], apart[seen], "o", mfc="none", color=BLUE, label="state of the bob later on")
    right.loglog(speeds, (0.2 * speeds) ** 2, "-", color=GREY, label="square of the speed")
    power(right, speeds[seen][::-1], apart[seen][-1], 3.0)
    right.set(
        xlabel="capture speed, in units of the slenderness (-)",
        ylabel="difference from capture at 1e-7 (rad)",
        ylim=(1e-16, 1e-2),
    )
    right.legend()
    return figure


def chaos() -> Figure:
    """Growth of the gradient through a simulation, chaotic and on an orbit."""
    figure, (ax,) = axes(1)
    x, periods = CHAOTIC, np.arange(SAMPLES)
    times = periods * 2.0 * np.pi / x[XI]
    answer = exact(x)
    settled = eqx.filter_jit(Piecewise().settle)(as_arrays(parameters(x)), np.zeros(4))
    sizes = np.linalg.norm(along(x, settled.y, times)[1], axis=(1, 2))
    ax.semilogy(periods, sizes, "-", color=BLUE, label="simulated, chaotic")
    rate = float(answer.steady.lyapunov)
    ax.semilogy(
        periods, sizes[0] * np.exp(rate * times), ":", color=INK, label=f"reported rate {rate:.3f} per tau"
    )
    o = orbits([x])
    i = list(o.status[0]).index("unstable")
    on = np.linalg.norm(along(x, o.state[0, i], times)[1], axis=(1, 2))[:140]
    ax.semilogy(periods[:140], on, "--", color=ORANGE, label="simulated, on an unstable orbit")
    size = np.abs(o.slopes[0, i, 2:6]).max()
    ax.axhline(size, color=GREY, lw=2, label="derivative of that orbit by shooting")
    ax.set(xlabel="forcing periods simulated (-)", ylabel="size of the derivative of the state (-)")
    ax.legend()
    return figure


def overturning() -> Figure:
    """What is settled into from a tilt, and how long that takes next to the boundary."""
    figure, (left, right) = axes(2)
    x, tilts = BARE[1].x, np.linspace(0.15, 0.22, 281)
    found = [exact(x, (t, 0.0, 0.0, 0.0)) for t in tilts]
    rows = {"rest": 0, "rocking": 1, "unstable": 2, "overturned": 3}
    places = np.array([rows[a.status] for a in found])
    left.plot(tilts, places, "|", ms=14, color=BLUE)
    left.set_yticks(list(rows.values()), list(rows))
    left.set(xlabel="tilt at the start (rad)", ylabel="status", ylim=(-0.5, 3.5))
    low, high, close = 0.16, 0.3, []
    for _ in range(48):
        tilt = 0.5 * (low + high)
        answer = exact(x, (tilt, 0.0, 0.0, 0.0))
        close.append((tilt, answer.status, int(answer.steady.elapsed)))
        low, high = (low, tilt) if answer.status == "overturned" else (tilt, high)
    marks = {"overturned": ("x", INK), "rocking": ("o", BLUE), "rest": ("s", ORANGE), "unstable": ("^", GREY)}
    for name, (marker, color) in marks.items():
        some = [(abs(t - low), n) for t, status, n in close if status == name and t != low]
        right.semilogx(*zip(*some, strict=True), marker, color=color, label=name)
    right.set(
        xlabel="distance of the start from the last that stays (rad)",
        ylabel="forcing periods until it is told (-)",
    )
    right.legend()
    return figure


def limits() -> Figure:
    """Four limits against what is known of them."""
    figure, (a, b, c, d) = axes(4, rows=2)
    shares = 10.0 ** np.linspace(0.0, -4.0, 9)
    sizes = [exact(np.array(HUNG[3].x) * np.array([s, 1, 1, 1, s, s, 1])).amplitude / s for s in shares]
    limit = exact(np.array(HUNG[3].x) * np.array([1e-8, 1, 1, 1, 1e-8, 1e-8, 1])).amplitude / 1e-8
    apart = np.abs(np.array(sizes) / limit - 1.0)
    a.loglog(0.25 * shares, apart, "o", mfc="none", color=BLUE, label="amplitude over slenderness")
    power(a, 0.25 * shares, apart[0], 2.0)
    a.set(xlabel="slenderness (-)", ylabel="relative distance from the limit (-)", title="slender blocks")
    rates = 10.0 ** np.linspace(0.9, 2.5, 9)
    o = among((0.2, 0.0, 0.4, 0.2, 0.05, 0.5, 1.0, 1.0), "xi", rates)
    apart = np.abs(o.amplitude[:, 0] * rates**2 / fast_limit(0.2, 0.05, 0.5) - 1.0)
    b.loglog(rates, apart, "o", mfc="none", color=BLUE, label="amplitude times its square")
    power(b, rates, apart[0], -2.0)
    b.set(xlabel="frequency ratio (-)", ylabel="relative distance from the limit (-)", title="fast shaking")
    rates = 10.0 ** np.linspace(-1.0, -6.0, 21)
    found = [exact((0.2, 0.1, 0.4, 0.2, 0.05, 0.1, xi)) for xi in rates]
    rests = np.array([answer.status == "rest" for answer in found])
    apart = np.abs(np.array([answer.stroke for answer in found]) / 0.1 - 1.0)
    c.loglog(rates[rests], apart[rests], "o", mfc="none", color=BLUE, label="rest: stroke of the bob")
    power(c, rates[rests], apart[0], 2.0)
    c.axvspan(rates[-1], rates[~rests].max(), color=GREY, alpha=0.35, label="event_bound: told")
    c.set(xlabel="frequency ratio (-)", ylabel="relative distance from f (-)", title="slow shaking")
    damping = 10.0 ** np.linspace(-1.0, -8.0, 15)
    xi = np.sqrt((1.0 + 0.25**2) / (0.75 * 0.8))
    for mu, marker, color in ((0.0, "o", BLUE), (0.1, "s", INK)):
        found = [exact((0.25, mu, 0.8, z, 0.05, 0.1, xi)) for z in damping]
        rest = np.array([answer.status == "rest" for answer in found])
        strokes = np.array([answer.stroke for answer in found])
        d.loglog(damping[rest], strokes[rest], marker, mfc="none", color=color, label=f"rest, mu = {mu:g}")
        gone = ~rest
        if gone.any():
            d.loglog(damping[gone], np.full(gone.sum(), 0.2), "+", color=ORANGE, label="no motion, mu = 0.1")
    d.loglog(damping, 0.05 / damping, ":", color=INK, label="f/(2 zeta)")
    d.set(xlabel="damping ratio of the hinge (-)", ylabel="stroke of the bob (rad)", title="resonance")
    for ax in (a, b, c, d):
        ax.legend(fontsize=8)
    return figure


def scales() -> Figure:
    """Dimensionless answers over sizes and masses in SI units."""
    figure, (ax,) = axes(1)
    usual = exact(dimensionless(1.0, 16.2)).amplitude
    heights = 10.0 ** np.linspace(-3.0, 3.0, 13)
    for mass, marker, color in ((1e-6, "o", BLUE), (1.0, "s", ORANGE), (1e9, "x", INK)):
        apart = [abs(exact(dimensionless(h / 0.4, mass)).amplitude / usual - 1.0) + 1e-17 for h in heights]
        ax.loglog(heights, apart, marker, mfc="none", color=color, label=f"{mass:g} kg")
    ax.set(
        xlabel="height of the block (m)",
        ylabel="relative difference of the amplitude, plus 1e-17 (-)",
        ylim=(5e-18, 1e-10),
    )
    ax.legend()
    return figure


REGIMES: dict[str, Callable[[], Figure]] = {
    f.__name__: f for f in (fold, symmetry, grazing, sticking, rattling, chaos, overturning, limits, scales)
}


def main() -> None:
    """Draw those that are named, or all."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or REGIMES:
        REGIMES[name]().savefig(PICTURES / f"{name}.png", metadata={"Software": None})
        print(PICTURES / f"{name}.png", flush=True)


if __name__ == "__main__":
    main()
