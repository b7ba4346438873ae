"""Answers known from elsewhere, each with its source and tolerance, and one independent event loop.

Symbols and equation numbers are those of Collini et al. (2016). Answers are of the linear equations (25) with
their misprints corrected and without the parametric term s f nu phi sin, for a block that is a uniform
rectangle.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from tpd import Parameters, Piecewise, Smoothed, simulate, status_name, steady_state, symmetric_orbits
from tpd.answers.steady_state import Steady
from tpd.answers.symmetric_orbits import Orbits, all_symmetric_orbits
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, Run, follow
from tpd.models.base import Model
from tpd.theory.equations import Linear, Terms

NAMES = ("nu", "mu", "lam", "zeta", "k", "f", "xi", "e", "kappa")
"""The order of a vector of parameters; e = 1 and kappa = 2 may be left out, and rho is tied to nu."""

REST = (0.0, 0.0, 0.0, 0.0)


def parameters(x: Any) -> Parameters:
    """The parameters in a vector of seven, eight or nine."""
    return Parameters(**dict(zip(NAMES, x, strict=False)))


def box(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Random parameters, corners of their ranges among them, and starts."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(
        [0.05, 0.0, 0.05, 0.0, 0.0, 0.0, 0.3, 0.3], [0.5, 0.5, 2.0, 1.0, 0.3, 0.8, 6.0, 1.0], (count, 8)
    )
    for column, edge in ((1, 0.0), (3, 0.0), (4, 0.0), (7, 1.0)):
        x[rng.random(count) < 0.25, column] = edge
    y = rng.normal(size=(count, 4)) * np.stack([0.3 * x[:, 0], np.full(count, 0.2)] * 2, axis=1)
    y[::2] = 0.0
    return x, y


class Case(NamedTuple):
    """The settled motion from `y0` at tau = 0: its amplitude, and the gradient in NAMES[:7] (NaN
    where no value is known), each with the error that its source allows."""

    name: str
    x: tuple[float, ...]
    amplitude: float
    gradient: tuple[float, ...]
    y0: tuple[float, ...] = REST
    amplitude_rtol: float = 1e-8
    amplitude_atol: float = 0.0
    gradient_rtol: float = 1e-6
    gradient_atol: float = 0.0


_UNKNOWN = np.nan

# Source: an event-driven integration, closed forms with events and unknown crossing times, which
# agree to the digits given. The gradients keep rho = 3/(4 (1 + nu^2)) tied to nu.
WITH = (
    Case(
        "short light pendulum",
        (0.25, 0.05, 0.2, 0.1, 0.05, 0.377, 2.67),
        0.061932440888,
        (0.088406446, -0.41660356, -0.0062934797, 0.21672844, -0.1266605, 0.13301148, -0.04460438),
    ),
    Case(
        "short damped pendulum",
        (0.25, 0.1, 0.15, 0.3, 0.05, 0.377, 2.67),
        0.068304382745,
        (0.11694413, -0.10989899, -0.021102565, 0.027878079, -0.06251327, 0.11967109, -0.049064885),
    ),
    Case(
        "long light pendulum",
        (0.2, 0.05, 0.8, 0.1, 0.05, 0.3, 3.0),
        0.055180823714,
        (0.13110946, 0.030211314, -0.0012112051, -0.001382551, -0.039803904, 0.10256576, -0.033327373),
    ),
    # d/dzeta of this row is by Richardson differences: the source is 1.6e-6 off.
    Case(
        "long heavy pendulum",
        (0.25, 0.2, 0.8, 0.1, 0.05, 0.5, 3.5),
        0.065674637832,
        (0.11176773, 0.026663952, -0.0040882568, -0.0035352973, -0.022521521, 0.075127689, -0.035414122),
    ),
)

STILL = Case("stays at rest", (0.2, 0.1, 0.4, 0.2, 0.03, 0.25, 4.0), 0.0, (0.0,) * 7)
"""Rattles and sticks after the start, then rests for good: flat, so the gradient is zero."""


def _bare(xi: float, amplitude: float, nu: float, k: float, f: float, dxi: float) -> Case:
    """A bare block (mu = 0), started at 0.8 nu; nothing about the bob matters but d/dmu."""
    x, gradient = (0.2, 0.0, 0.4, 0.2, 0.05, 0.1, xi), (nu, _UNKNOWN, 0.0, 0.0, k, f, dxi)
    errors = (0.0, 5e-8, 0.0, 5.1e-7)
    return Case(f"bare block at xi = {xi:g}", x, amplitude, gradient, (0.16, 0.0, 0.0, 0.0), *errors)


# Source: as above, to the digits printed there; lam and zeta do nothing when mu = 0.
WITHOUT = (
    _bare(1.5, 0.0973880, 0.382245, -0.375897, 0.397339, -0.087944),
    _bare(2.0, 0.0637170, 0.248983, -0.237463, 0.257936, -0.050442),
    _bare(4.0, 0.0188571, _UNKNOWN, _UNKNOWN, _UNKNOWN, _UNKNOWN),
)

MOVING = (*WITH, *WITHOUT)
CASES = (*MOVING, STILL)

UNSTABLE = ((0.2, 0.0, 0.4, 0.2, 0.05, 0.1, 1.0), 0.155239, 1.458)
"""A bare block whose symmetric orbit repels (same source): parameters, amplitude (six digits), and
the size of the largest multiplier of half a period."""

OVERTURNING = (0.25, 0.1, 0.2, 0.1, 0.05, 0.6, 2.67)

LEANING = ((0.1, 0.0, 1.0, 0.3, 0.05, 0.01, 2.0), (0.09, 0.0, 0.0, 0.0))
"""|(1 + 2 mu) phi - (1 + mu) nu| = 0.01, and the moment of the shaking at most 0.01: friction 0.05 holds."""

CONSERVING = (
    (0.2, 0.0, 0.4, 0.2, 0.0, 0.1, 2.0, 1.0),
    (0.2, 0.0, 0.4, 0.2, 0.0, 0.1, 4.0, 1.0),
    (0.2, 0.1, 0.4, 0.0, 0.0, 0.2, 3.0, 1.0),
    (0.25, 0.2, 0.8, 0.0, 0.0, 0.3, 3.5, 1.0),
    (0.15, 0.3, 0.3, 0.0, 0.0, 0.15, 4.2, 1.0),
)
"""Without friction, damping or loss at impacts."""

SLOW = (0.269, 0.445, 1.989, 0.098, 0.004, 0.387, 4.151)
"""Comes to its orbit so slowly that 500 periods of following alone are not enough."""


def named(case: Case) -> str:
    """What pytest calls a case."""
    return case.name


class Answer(NamedTuple):
    """What the package says, with d(amplitude, stroke, state)/d(parameters)."""

    amplitude: float
    swing: float
    status: str
    slopes: np.ndarray
    steady: Steady


def solver(model: Model | Callable[..., Model]) -> Callable[..., Answer]:
    """`steady_state` of one model, or of what gives one for the arguments after `y0`, as a function of a
    vector, compiled once for all tests."""

    @jax.jit
    def solve(x: jax.Array, y0: jax.Array, *settings: jax.Array) -> tuple[jax.Array, Steady]:
        chosen = model if isinstance(model, Model) else model(*settings)

        def sizes(x: jax.Array) -> tuple[jax.Array, Steady]:
            s = steady_state(parameters(x), model=chosen, y0=y0)
            return jnp.stack([s.amplitude, s.swing, *s.state]), s

        return jax.jacrev(sizes, has_aux=True)(x)

    def answer(x: Any, y0: Any = REST, *settings: float) -> Answer:
        full = np.array([*x, *(1.0, 2.0)[len(x) - 7 :]], dtype=float)
        slopes, s = solve(full, np.asarray(y0, dtype=float), *map(np.asarray, settings))
        slopes = np.asarray(slopes)[:, : len(x)]
        return Answer(float(s.amplitude), float(s.swing), status_name(s.status), slopes, s)

    return answer


def settled(equations: Terms, p: Parameters, y0: Any = None, **options: Any) -> Run:
    """Where the runs of a batch settle under a harmonic; at rest for the start of one run."""
    forcing = HarmonicForcing(*(options.pop(name, x) for name, x in HarmonicForcing()._asdict().items()))
    return follow(equations, row_of(p), forcing, y0=y0, **options)


def orbits_of(p: Parameters) -> Orbits:
    """`symmetric_orbits` of one design, or of many along a leading axis."""
    many = any(jnp.ndim(x) for x in jax.tree.leaves(p))
    return all_symmetric_orbits(p) if many else symmetric_orbits(p)


MOST_TIMES = 361
"""Points in time of `along`, and its one compiled shape."""


@jax.jit
def _along(x: jax.Array, y0: jax.Array, times: jax.Array) -> tuple:
    def run(y0: jax.Array) -> tuple:
        motion = simulate(parameters(x), y0, times)
        return motion.ys, (motion.ys, motion.status)

    return jax.jacfwd(run, has_aux=True)(y0)


def along(x: Any, y0: Any, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    """States at the times, their derivatives with respect to the start, and the status; compiled once."""
    full, padded = np.ones(8), np.full(MOST_TIMES, times[-1], dtype=float)
    full[: len(x)], padded[: len(times)] = x, times
    slopes, (ys, status) = _along(full, np.asarray(y0, dtype=float), padded)
    return np.asarray(ys)[: len(times)], np.asarray(slopes)[: len(times)], status_name(status)


def assert_overturned(answer: Answer) -> None:
    """Check that the status is of an overturning, without sizes or a gradient."""
    assert answer.status == "overturned"
    assert answer.amplitude == answer.swing == np.inf
    assert np.all(np.isnan(answer.slopes))
    assert np.isnan(answer.steady.multiplier)


def matrices(linear: Linear) -> tuple[np.ndarray, ...]:
    """Mass, damping and stiffness matrices of (25)."""
    mass = [[linear.m11, linear.m12], [linear.m21, linear.m22]]
    damping = [[linear.c1, -linear.c1], [-linear.c2, linear.c2]]
    return tuple(np.array(x, dtype=float) for x in (mass, damping, [[-linear.tilt, 0.0], [0.0, 1.0]]))


exact = solver(Piecewise())
"""(parameters, y0) to the answer of `Piecewise()`; e = 1 unless given."""


class Coarser(Smoothed):
    """`Smoothed` whose widths are multiplied by a number that a compiled program takes."""

    times: jax.Array = eqx.field(kw_only=True)

    def widths(self, p: Parameters) -> tuple[jax.Array, jax.Array]:
        """See `Smoothed.widths`."""
        return tuple(self.times * width for width in super().widths(p))


_by_smoothed = solver(lambda times: Coarser(times=times))


def smoothed(x: Any, y0: Any = REST, coarser: float = 1.0) -> Answer:
    """The same of `Smoothed()`, or with all its widths some times as large."""
    return _by_smoothed(x, y0, coarser)


def differences(function: Callable[[np.ndarray], Any], x: Any, i: int, *, share: float = 0.01) -> Any:
    """d function / d x[i]: central differences with steps of `share` of x[i], a half and a quarter
    of that, extrapolated twice (Richardson), so the error is of the sixth power of the step."""
    x = np.asarray(x, dtype=float)
    step = share * max(abs(x[i]), 0.1)

    def central(h: float) -> Any:
        up, down = x.copy(), x.copy()
        up[i] += h
        down[i] -= h
        return (function(up) - function(down)) / (2.0 * h)

    d1, d2, d4 = (central(step / n) for n in (1, 2, 4))
    e2, e4 = (4.0 * d2 - d1) / 3.0, (4.0 * d4 - d2) / 3.0
    return (16.0 * e4 - e2) / 15.0


def largest(x: np.ndarray) -> float:
    """The largest value, from a parabola through the largest sample and its neighbours."""
    i = int(np.clip(np.argmax(x), 1, len(x) - 2))
    slope, bend = 0.5 * (x[i + 1] - x[i - 1]), x[i + 1] - 2.0 * x[i] + x[i - 1]
    return max(x[i] - 0.5 * slope**2 / bend if bend < 0.0 else x[i], x.max())


Mode = tuple[str, float, float]
"""Slip, stick or rest, with the signs of the tilt and of its rate."""


class EventDriven:
    """The equations integrated adaptively (SciPy's DOP853) from event to event: slow, obvious, and sharing
    nothing with the package. A trap of such codes: two events within one step go unseen, so the steps are
    short."""

    STEP, GONE = 0.02, 2.0

    def __init__(
        self,
        x: Any,
        *,
        onset: float = 0.0,
        growth: float = 0.0,
        nonlinear: bool = False,
        parametric: bool = False,
        samples: tuple[np.ndarray, float] | None = None,
        kappa: float = 2.0,
    ) -> None:
        """Equations (25), with the parametric term if `parametric`, or (4) if `nonlinear`.

        The excitation is a harmonic of full size or, from `onset` on, one that grows linearly for the time
        `growth`; or eta = `samples` of an interval in tau, and zero afterwards."""
        self.nu, self.mu, self.lam, zeta, self.k, self.f, self.xi = x[:7]
        self.e = x[7] if len(x) > 7 else 1.0
        self.onset, self.growth, self.nonlinear, self.samples = onset, growth, nonlinear, samples
        self.parametric, self.kappa = parametric, kappa
        self.rho = 3.0 / (4.0 * (1.0 + self.nu**2))
        self.hinge = 2.0 * zeta * np.sqrt(self.lam * self.rho)
        self.knots = [] if samples is None else list(samples[1] * np.arange(1, len(samples[0])))
        self.kinds: list[str] = []
        self.fell = np.inf

    @property
    def period_of_excitation(self) -> float:
        """Period of the harmonic in tau."""
        return 2.0 * np.pi / self.xi

    def run(self, y0: Any, times: np.ndarray, *, quiet: float = 2e-8) -> np.ndarray:
        """The states at `times`, as many as there are before an overturning."""
        t, y, out = times[0], np.array(y0, dtype=float), [np.array(y0, dtype=float)]
        mode = self._mode(t, y)
        while len(out) < len(times):
            self.kinds.append(mode[0])
            end = min([times[-1], *(knot for knot in self.knots if knot > t)])
            t, y, which = self._arc(t, y, mode, end, times, out)
            if which == 2:
                self.fell = t
                break
            if which is not None:
                y, mode = self._event(t, y, mode, which, quiet * self.nu)
            elif mode[0] != "slip":
                mode = self._mode(t, y)
        return np.array(out)

    def period(self, y0: Any, periods: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest |phi| and |psi| within so many periods of the excitation, and the last state."""
        ys = self.run(y0, np.linspace(0.0, periods * self.period_of_excitation, 2001 * periods))
        return np.array([largest(x) for x in np.abs(ys[:, :2]).T]), ys[-1]

    def _shaking(self, t: float) -> float:
        if self.samples is not None:
            eta, dt = self.samples
            return float(np.interp(t, dt * np.arange(len(eta)), eta, right=0.0))
        share = min((t - self.onset) / self.growth, 1.0) if self.growth else 1.0
        return share * self.f * np.sin(self.xi * t)

    def _forces(self, t: float, y: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix and right-hand sides of both equations without friction, the second over mu lam; `s` is
        the side of the corner about which the block turns."""
        (phi, psi, dphi, dpsi), eta, nu, mu, rho = y, self._shaking(t), self.nu, self.mu, self.rho
        high, slide, weight, lam = self.kappa, self.hinge * (dphi - dpsi), (1.0 + mu) * nu, self.lam
        up = 1.0 + high * mu
        if not self.nonlinear:
            arm, block, bob = high, up * (phi - eta) - s * weight, eta - psi
            block -= s * eta * weight * phi if self.parametric else 0.0
        else:
            # Lagrange's equations of T = a phi'^2/2 - mu rho lam arm phi' psi' + mu rho lam^2 psi'^2/2.
            arm = high * np.cos(phi - psi) + s * nu * np.sin(phi - psi)
            bend = s * nu * np.cos(phi - psi) - high * np.sin(phi - psi)
            block = up * np.sin(phi) - s * weight * np.cos(phi) - mu * rho * lam * bend * dpsi**2
            block -= eta * (up * np.cos(phi) + s * weight * np.sin(phi))
            bob = eta * np.cos(psi) - np.sin(psi) + rho * bend * dphi**2
        mass = np.array(
            [[1.0 + mu * rho * (high**2 + nu**2), -mu * rho * lam * arm], [-rho * arm, lam * rho]]
        )
        return mass, np.array([block - mu * lam * slide, bob + slide])

    def _slip(self, t: float, y: np.ndarray, s: float, sigma: float) -> np.ndarray:
        mass, right = self._forces(t, y, s)
        (a, b), (c, d) = mass
        p, q = right[0] - sigma * self.k, right[1]
        return np.array([y[2], y[3], (d * p - b * q) / (a * d - b * c), (a * q - c * p) / (a * d - b * c)])

    def held(self, t: float, y: np.ndarray) -> np.ndarray:
        mass, right = self._forces(t, y, 1.0)
        return np.array([0.0, y[3], 0.0, right[1] / mass[1, 1]])

    def excess(self, t: float, y: np.ndarray, s: float) -> float:
        """What friction must balance while the block is held."""
        mass, right = self._forces(t, y, s)
        return right[0] - mass[0, 1] * right[1] / mass[1, 1]

    def _mode(self, t: float, y: np.ndarray) -> Mode:
        s, sigma = np.sign(y[0]), np.sign(y[2])
        if sigma:
            return "slip", s or sigma, sigma
        up, down = self.excess(t, y, s or 1.0), self.excess(t, y, s or -1.0)
        way = 1.0 if up > self.k else (-1.0 if down < -self.k else 0.0)
        return ("slip", s or way, way) if way else ("stick" if s else "rest", s, 0.0)

    def _arc(
        self, t: float, y: np.ndarray, mode: Mode, end: float, times: np.ndarray, out: list
    ) -> tuple[float, np.ndarray, int | None]:
        """Until the next event: when, where, and which (0, 1; 2 is overturning; None is the end)."""
        kind, s, sigma = mode
        step = self.STEP
        if kind == "slip":
            rates = functools.partial(self._slip, s=s, sigma=sigma)
            # A block that friction lets go begins with no acceleration but rounding.
            signals = [lambda t, y: s * y[0], lambda t, y: sigma * y[2] + 1e-13]
            pull = rates(t, y)[2]
            if y[0] == 0.0 and pull * y[2] < 0.0 and abs(y[2] / pull) < 2.0 * step:
                # A hop lasts for some four of these steps, unless it becomes a longer arc.
                step = max(0.5 * abs(y[2] / pull), 1e-11)
                end = min(end, t + 20.0 * step)
        else:
            rates = self.held
            signals = [
                lambda t, y: self.k - self.excess(t, y, s or 1.0),
                lambda t, y: self.k + self.excess(t, y, s or -1.0),
            ]
        signals.append(lambda t, y: self.GONE - abs(y[0]))
        for signal in signals:
            signal.terminal, signal.direction = True, -1  # type: ignore[attr-defined]
        options: Any = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-16, "max_step": step}
        sol = solve_ivp(rates, (t, end), y, events=signals, dense_output=True, **options)
        passed = times[len(out) : np.searchsorted(times, sol.t[-1], side="right")]
        out += list(sol.sol(passed).T) if len(passed) else []
        met = [i for i, found in enumerate(sol.t_events) if len(found)]
        return sol.t[-1], sol.y[:, -1].copy(), met[0] if met else None

    def _event(
        self, t: float, y: np.ndarray, mode: Mode, which: int, quiet: float
    ) -> tuple[np.ndarray, Mode]:
        kind, s, _ = mode
        if kind != "slip":
            way = 1.0 if which == 0 else -1.0
            return y, ("slip", s or way, way)
        if which == 1:
            y[2] = 0.0
            return y, self._mode(t, y)
        before, y[0] = y[2], 0.0
        after = before * (self._ratio(y[1], s) if self.nonlinear and self.e < 1.0 else self.e)
        if abs(before) <= quiet and self._mode(t, np.array([0.0, y[1], 0.0, y[3]]))[0] == "rest":
            after = 0.0
        # The rod transmits no transverse force: the bob keeps its transverse speed.
        if not self.nonlinear:
            y[3] += self.kappa / self.lam * (after - before)
        elif after != before:
            turned = self.kappa * np.cos(y[1]) * (after - before)
            turned += s * self.nu * np.sin(y[1]) * (after + before)
            y[3] += turned / self.lam
        y[2] = after
        return y, self._mode(t, y)

    def _ratio(self, psi: float, s: float) -> float:
        """phi' after an impact with the bob at an angle over that before: the angular momentum about the
        corner that is struck stays, but for a loss that makes the ratio e with the bob below its hinge."""
        new, old = (self.kappa * np.sin(psi) - way * self.nu * np.cos(psi) for way in (s, -s))
        share, loss = self.mu * self.rho, self.rho * self.mu * self.nu**2
        ratio = (self.e * (1.0 + loss) + loss + share * new * old) / (1.0 + share * new**2)
        # At the most the impact conserves the energy.
        return min(ratio, np.sqrt((1.0 + share * old**2) / (1.0 + share * new**2)))
