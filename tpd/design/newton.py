"""Newton's method on a smoothed worst case, as a transformation of optax.

A search minimises a risk measure of n functions f_i (the maximum, the mean, or the mean of the worst share)
under l constraints c_j <= 0. The measure has kinks where several functions are equally bad, and the optimum
usually lies on one. It is smoothed,

    F(x) = min over s of  s + cap width sum softplus((f_i - s)/width)  +  C width sum softplus(c_j/width),

which tends to the measure plus the exact penalty C sum max(c_j, 0) as the width decreases (R. A. Polyak's
smoothing; R. T. Rockafellar and S. Uryasev, Journal of Risk 2, 2000, for the level s). A narrow kink is a
valley that is steep across and flat along. The second derivative of the smoothing across the valley is known
from the slopes alone. The rest of the curvature follows from the changes of the slopes (damped BFGS update,
M. J. D. Powell, 1978). The step is damped until it lowers F (Levenberg and Marquardt).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import optax

PENALTY = 10.0
"""Weight C of a violated constraint. The penalty is exact as long as no multiplier exceeds C."""
WIDE, NARROW = (1e-2, 1e-4), (1e-3, 1e-5)
"""First and last width of the smoothing, in units of the functions: far from the optimum, and near it."""
_LAST_SHARE = 0.75
"""Share of the steps after which the width is the last one."""
_LONGEST = 0.25
"""Longest step along any coordinate, in shares of the bounds."""
_DECREASE, _INCREASE, _DAMPING = 0.3, 5.0, (1e-4, 1e6)
"""Factors on the damping after a step that lowers F and after one that does not, and its bounds."""
_SUFFICIENT_SHARE, _POWELL, _STEEPEST = 1e-4, 0.2, 1e4
"""Share of the predicted decrease that is sufficient; bound on the curvature of an update relative to the old
one; and largest curvature."""


class Linearisation(NamedTuple):
    """Values of n functions and l constraints (<= 0) at m designs, with their slopes along d scaled
    coordinates."""

    value: np.ndarray
    """Values of the functions, (m, n)."""
    slope: np.ndarray
    """Slopes of the functions, (m, n, d)."""
    limit: np.ndarray
    """Values of the constraints, (m, l)."""
    limit_slope: np.ndarray
    """Slopes of the constraints, (m, l, d)."""

    def at(self, rows: np.ndarray | slice) -> Linearisation:
        """Return the linearisation at some of the designs."""
        return Linearisation(*(x[rows] for x in self))


class Smooth(NamedTuple):
    """Smoothed measure F at m designs."""

    value: np.ndarray
    """F, (m,); infinite where a function is infinite."""
    slope: np.ndarray
    """Slopes of F, (m, d)."""
    weights: tuple[np.ndarray, np.ndarray]
    """Derivatives of F with respect to the functions, (m, n), and to the constraints, (m, l)."""
    curvature: np.ndarray
    """Second derivatives of F for functions and constraints that are planes, (m, d, d)."""


def width_at(step: int, steps: int, widths: tuple[float, float]) -> float:
    """Return the width of the smoothing at a step, between the first and the last width."""
    return widths[0] * (widths[1] / widths[0]) ** min(step / max(_LAST_SHARE * steps, 1.0), 1.0)


def smoothed(at: Linearisation, cap: float, width: float) -> Smooth:
    """Return the smoothed measure at all designs."""
    is_finite = np.asarray(np.all(np.isfinite(at.value), axis=1))
    value = np.where(is_finite[:, None], at.value, 0.0)
    # Find by bisection the level s at which the weights sum to one.
    low = value.min(axis=1) - 40.0 * width
    high = value.max(axis=1) + width * np.log(value.shape[1] + 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        over = cap * np.sum(_sigmoid((value - middle[:, None]) / width), axis=1) < 1.0
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    level = 0.5 * (low + high)
    # The same width smooths the constraints: a sharper penalty would be a steeper valley without any use.
    above, over = (value - level[:, None]) / width, at.limit / width
    total = level + cap * width * np.sum(np.logaddexp(0.0, above), axis=1)
    total = total + PENALTY * width * np.sum(np.logaddexp(0.0, over), axis=1)
    share, broken = _sigmoid(above), _sigmoid(over)
    # The envelope theorem: the level s is a minimum, so it adds nothing to the first derivative.
    weights = cap * share, PENALTY * broken
    sharp, steep = (w * (1.0 - x) / width for w, x in zip(weights, (share, broken), strict=True))
    # The level moves with the design: hence the product that is subtracted.
    mean = np.einsum("mn,mnd->md", sharp, at.slope)
    curvature = np.einsum("mn,mni,mnj->mij", sharp, at.slope, at.slope)
    curvature -= mean[:, :, None] * mean[:, None] / np.maximum(sharp.sum(axis=1), 1e-300)[:, None, None]
    curvature += np.einsum("ml,mli,mlj->mij", steep, at.limit_slope, at.limit_slope)
    slope = np.where(is_finite[:, None], _weighted(at, weights), 0.0)
    return Smooth(np.where(is_finite, total, np.inf), slope, weights, curvature)


def _sigmoid(x: np.ndarray) -> np.ndarray:
    return 0.5 * (1.0 + np.tanh(0.5 * x))


def _weighted(at: Linearisation, weights: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the weighted sum of the slopes of functions and constraints, (m, d)."""
    slope = np.einsum("mn,mnd->md", weights[0], at.slope)
    return slope + np.einsum("ml,mld->md", weights[1], at.limit_slope)


class State(NamedTuple):
    """State of the method at m designs."""

    step: int
    """Number of steps so far."""
    x: np.ndarray
    """Designs from which the last steps were made, (m, d)."""
    at: Linearisation | None
    """Functions and constraints at `x`; None before the first step."""
    curvature: np.ndarray
    """Weighted curvatures of functions and constraints, (m, d, d)."""
    damping: np.ndarray
    """Damping of the next steps, (m,)."""


def newton(cap: float, steps: int, widths: tuple[float, float]) -> optax.GradientTransformationExtraArgs:
    """Return the transformation, for m designs between 0 and 1 at once, (m, d).

    Its updates need the functions at the present designs as the extra argument `at`, a `Linearisation`. It
    computes with NumPy: matrices of 3 x 3 are not worth the compilation of a program.

    Args:
        cap: largest weight of one function: 1 for the maximum, 1/n for the mean.
        steps: number of steps.
        widths: first and last width of the smoothing.
    """

    def init(params: Any) -> Any:
        m, d = params.shape
        return State(0, params, None, np.tile(np.eye(d), (m, 1, 1)), np.ones(m))

    def update(updates: Any, state: Any, params: Any = None, *, at: Any, **_: Any) -> Any:
        width = width_at(state.step, steps, widths)
        here, x, base = smoothed(at, cap, width), params, at
        curvature, damping = state.curvature, state.damping
        # The width has decreased since the last step, so both designs are compared under the new one.
        if state.at is not None:
            before, moved = smoothed(state.at, cap, width), params - state.x
            enough = before.value + _SUFFICIENT_SHARE * np.sum(before.slope * moved, axis=1)
            accepted = np.isfinite(here.value) & ~(here.value > enough)
            change = _weighted(at, here.weights) - _weighted(state.at, here.weights)
            # A rejected design shows the curvature as well as an accepted one.
            curvature = _updated(curvature, moved, change)
            # After a rejection the next step is shorter and turns towards steepest descent.
            damping = np.clip(damping * np.where(accepted, _DECREASE, _INCREASE), *_DAMPING)
            x = np.where(accepted[:, None], params, state.x)
            base = Linearisation(*(_choose(accepted, *pair) for pair in zip(at, state.at, strict=True)))
            here = smoothed(base, cap, width)
        step = _bounded_steps(x, here, curvature + damping[:, None, None] * np.eye(x.shape[1]))
        return x + step - params, State(state.step + 1, x, base, curvature, damping)

    # The types of optax do not have the extra argument.
    with_functions: Any = update
    return optax.GradientTransformationExtraArgs(init, with_functions)


def _choose(rows: np.ndarray, new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """Return the new values in some rows, and the old ones in the others."""
    return np.where(rows.reshape(-1, *(1,) * (new.ndim - 1)), new, old)


@np.errstate(all="ignore")
def _updated(curvature: np.ndarray, moved: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return the curvatures after steps in which the slopes changed, by a damped BFGS update."""
    flat = np.einsum("mij,mj->mi", curvature, moved)
    old, new = np.sum(moved * flat, axis=1), np.sum(moved * change, axis=1)
    # A change with too little curvature is mixed with the old curvature, so that the result stays positive.
    mixed = np.where(new < _POWELL * old, (1.0 - _POWELL) * old / (old - new), 1.0)[:, None]
    towards = mixed * change + (1.0 - mixed) * flat
    gained = towards[:, :, None] * towards[:, None] / np.sum(moved * towards, axis=1)[:, None, None]
    updated = curvature - flat[:, :, None] * flat[:, None] / old[:, None, None] + gained
    # Without a step, and across the edge between two kinds of motion, the change means nothing.
    sound = np.all(np.abs(updated) < _STEEPEST, axis=(1, 2))
    return _choose(sound, updated, curvature)


def _bounded_steps(x: np.ndarray, at: Smooth, damped: np.ndarray) -> np.ndarray:
    """Return the damped Newton steps from designs between 0 and 1 that do not leave the bounds."""
    matrix, slope, step = at.curvature + damped, at.slope, np.zeros_like(x)
    fixed = ((x <= 0.0) & (slope > 0.0)) | ((x >= 1.0) & (slope < 0.0))
    # A coordinate at its bound that would leave it is fixed. The step of the others may change then.
    for _ in range(2):
        free = np.where(fixed, 0.0, 1.0)
        inner = matrix * free[:, :, None] * free[:, None] + (1.0 - free)[:, :, None] * np.eye(x.shape[1])
        step = -free * np.linalg.solve(inner, (free * slope)[:, :, None]).squeeze(-1)
        fixed = fixed | ((x <= 0.0) & (step < 0.0)) | ((x >= 1.0) & (step > 0.0))
    step = np.where(fixed, 0.0, step)
    # A valley may bend: a longer step would leave it, however well the model fits here.
    step *= np.minimum(1.0, _LONGEST / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
    return np.clip(x + step, 0.0, 1.0) - x
