"""The step at which explicit solvers go unstable on the smoothed block at rest, measured and by theory.

Within the smoothing width the block has a stiff spring where the true one rests, and a stiff damper. A solver
of constant step is stable there while |R(h s)| <= 1 for every eigenvalue s of the equations linearised at
rest, R being its stability polynomial. The step is measured by bisection: does a small push die away?
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from tests.reference import HUNG, parameters
from tpd import Smoothed
from tpd.theory.equations import smoothed_rates

STEPS = 4000
"""Steps over which a push dies away or grows."""
PUSH = 1e-9
"""Of the tilt, over its smoothing width, so that this is felt as linear."""
FAR = 1e3
"""Growth after which there is no doubt."""

X = HUNG[0].x
SCENES = {
    "default width": (X, Smoothed().sharpness),
    "a tenth of it": (X, 0.1 * Smoothed().sharpness),
    "default width, friction k = 0.0005": ((*X[:4], 0.0005, *X[5:]), Smoothed().sharpness),
}
"""Parameters and sharpness: an overdamped block, the same and stiffer, and one that swings in its layer."""


def polynomial(solver: diffrax.AbstractSolver) -> np.ndarray:
    """Coefficients of R(z), lowest first: 1 and b A^j 1 of the Butcher tableau (A, b)."""
    if isinstance(solver, diffrax.Euler):
        return np.ones(2)
    assert isinstance(solver, diffrax.AbstractERK)
    b = np.asarray(solver.tableau.b_sol)
    a = np.zeros((len(b), len(b)))
    for i, row in enumerate(solver.tableau.a_lower, 1):
        a[i, : len(row)] = row
    power, out = np.ones(len(b)), [1.0]
    for _ in b:
        out.append(float(b @ power))
        power = a @ power
    return np.array(out)


def limit(coefficients: np.ndarray, eigenvalue: complex) -> float:
    """The least h > 0 beyond which |R(h s)| > 1, on the ray of an eigenvalue s of negative real part."""

    def beyond(h: np.ndarray | float) -> Any:
        return np.abs(np.polynomial.polynomial.polyval(h * eigenvalue, coefficients)) > 1.0

    h = np.linspace(0.0, 20.0, 20_001)[1:] / abs(eigenvalue)
    first = int(np.argmax(beyond(h)))
    assert beyond(h[first])
    low, high = h[first] - h[0], h[first]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if beyond(middle) else (middle, high)
    return float(low)


def field(x: Any, sharpness: float) -> tuple[Callable, float]:
    """The smoothed equations without shaking, and the width of the tilt's sign."""
    p = parameters((*x[:5], 0.0, *x[6:]))
    widths = [float(w) for w in Smoothed(sharpness=sharpness).widths(parameters(x))]
    return smoothed_rates(p, *widths), widths[0]


def eigenvalues(x: Any, sharpness: float) -> np.ndarray:
    """Of the smoothed equations linearised at rest, the stiffest first."""
    rates, _ = field(x, sharpness)
    values = np.linalg.eigvals(np.asarray(jax.jacfwd(lambda y: rates(jnp.zeros(()), y, None))(jnp.zeros(4))))
    return values[np.argsort(-np.abs(values))]


def theory(solver: diffrax.AbstractSolver, x: Any, sharpness: float) -> float:
    """The largest stable step."""
    coefficients = polynomial(solver)
    return min(limit(coefficients, s) for s in eigenvalues(x, sharpness))


def measured(
    solver: diffrax.AbstractSolver, x: Any, sharpness: float, near: float, *, steps: int = STEPS
) -> float:
    """The same by bisection between a half and twice `near`, to 0.05 %."""
    rates, width = field(x, sharpness)
    pace = float(np.abs(eigenvalues(x, sharpness)[0]))
    push = jnp.array([PUSH * width, 0.0, 0.0, 0.0])

    @jax.jit
    def grown(h: Array) -> Array:
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(rates),
            solver,
            0.0,
            steps * h,
            h,
            push,
            saveat=diffrax.SaveAt(steps=True),
            adjoint=diffrax.ForwardMode(),
            max_steps=steps + 2,
        )
        ys: Array = solution.ys  # type: ignore[assignment]
        size = jnp.hypot(pace * ys[:steps, 0], ys[:steps, 2]) / (pace * push[0])
        quarters = jnp.max(size.reshape(4, -1), axis=1)
        # What has grown far no longer grows, as the smoothed signs are bounded.
        return ~(quarters[3] < quarters[1]) | ~(quarters[3] < FAR)

    low, high = 0.5 * near, 2.0 * near
    assert not bool(grown(jnp.asarray(low)))
    assert bool(grown(jnp.asarray(high)))
    while high > 1.0005 * low:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if bool(grown(jnp.asarray(middle))) else (middle, high)
    return float(np.sqrt(low * high))
