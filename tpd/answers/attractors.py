"""Motions that a design can settle into, and the share of initial states that reach each of them.

Rest, rocking of several kinds, chaos and overturning exist for the same design. The initial state and the
phase of the excitation decide which motion is reached. The linear model therefore follows a seeded set of
initial states, and the settled motions are grouped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from tpd.answers.steady_state import Steady, steady_state
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, Run, follow
from tpd.core import checks
from tpd.core.formatting import Printed, counted_periods
from tpd.core.progress import count_for
from tpd.models.base import scale_of
from tpd.models.piecewise import Piecewise
from tpd.scene.ensemble import StartKind as StartKind
from tpd.scene.ensemble import Starts as Starts
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.quantities import parameters_of
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import MOVING, NOT_ATTRACTING, Status, code_of, is_one_of, status_name
from tpd.theory.equations import Terms

_CLOSE = 1e-4
"""Largest relative difference of the sizes of two motions that may be the same. Motions are followed until
they repeat within a tolerance, so two runs of one motion end with slightly different sizes."""
_DIVIDED = (*MOVING, *NOT_ATTRACTING)
"""Statuses whose motions are compared with each other."""
_NEWTON_TOLERANCE = 1e-6
"""Largest relative difference of the sizes, after Newton's method, of two motions that are the same or mirror
images."""


@dataclass(frozen=True, repr=False)
class Attractor(Printed):
    """Settled motion that some of the initial states reach.

    Attributes:
        status: name of the status.
        periods: number of forcing periods in one period of the motion.
        symmetric: whether the motion is its own mirror image half a period later.
        share: share of the initial states that reach the motion.
        starts: indices of these initial states.
        steady: settled motion of the first of them.
    """

    status: str
    """Name of the status: rocking, sticking, rest, aperiodic, overturned, not_settled, ..."""
    periods: int
    """Number of forcing periods in one period of the motion; 1 if it is not periodic."""
    symmetric: bool
    """Whether the motion is its own mirror image half a period later."""
    share: float
    """Share of the initial states that reach the motion, its mirror image, or the motion shifted by some
    forcing periods."""
    starts: tuple[int, ...]
    """Indices of these initial states."""
    steady: Steady
    """Settled motion of the first of these initial states. For gradients call `steady_state` with this
    state."""

    def __str__(self) -> str:
        share = f"{self.status.replace('_', ' ')}: {100.0 * self.share:.1f} % of the starts"
        # Only moving blocks have a symmetry, a period and sizes worth printing.
        if not is_one_of(self.steady.status, *MOVING):
            return share
        kind = f"{'symmetric' if self.symmetric else 'asymmetric'}, {counted_periods(self.periods)}"
        s = self.steady
        return f"{share}, {kind}, amplitude {s.amplitude:.4g} rad, swing {s.swing:.4g} rad"


def attractors(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    starts: Starts | None = None,
    model: Piecewise | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> tuple[Attractor, ...]:
    """Find the motions that a set of initial states settles into, and sort them by their share.

    Motions that do not repeat (aperiodic, not_settled, overturned, event_bound) are grouped by their status.
    Other motions are the same, or mirror images, if their amplitudes and swings agree within 1e-6. The shares
    are estimates: with n initial states the standard error of a share s is about sqrt(s (1 - s)/n).

    Args:
        subject: dimensionless parameters, or a scene, with plain numbers.
        pendulum: pendulum of the scene; None without a pendulum.
        starts: initial states, by default `Starts()`, which has 64 states and the seed 0.
        model: settings of the linear model.
        progress: True for a progress bar on stderr, or a function that is called with (number of followed
            initial states, number of all initial states).

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.1, k=0.05, f=0.1, xi=2.0)
        >>> for motion in tpd.attractors(p, starts=tpd.Starts(size=16)):
        ...     print(motion.status, len(motion.starts))
        rocking 9
        rest 7
    """
    checks.require_x64()
    model = Piecewise() if model is None else model
    starts = Starts() if starts is None else starts
    checks.instance("model", model, Piecewise)
    checks.instance("starts", starts, Starts)
    fixed = as_arrays(parameters_of(subject, pendulum))
    y0 = starts.states(float(fixed.nu))
    with count_for(progress, "following") as report:
        # All initial states are followed at once, without Newton's method.
        forcing, limits = HarmonicForcing(model.max_periods), {**model.accuracy, "tolerance": model.tolerance}
        settled = follow(Terms.linear, row_of(fixed), forcing, y0=y0, progress=report, **limits)
    # A bob without mass (mu = 0) does not act on the block. Its swing, which may still be decaying, must not
    # divide a motion into several.
    felt = bool(np.isfinite(np.asarray(scale_of(fixed))[1]))
    motions: list[Attractor] = []
    for code, group in _groups(settled, felt):
        # Only the Lyapunov exponent separates chaos from slow decay, so each motion that has not settled
        # is solved. In other groups one initial state represents the group.
        for starts_of in [[i] for i in group] if code == code_of(Status.not_settled) else [group]:
            s = _solved(fixed, jnp.asarray(y0[starts_of[0]]), model)
            kind = status_name(s.status), int(s.periods), bool(s.symmetric)
            new = Attractor(*kind, len(starts_of) / len(y0), tuple(starts_of), s)
            # An earlier group may have the same motion, because the coarse grouping can divide a motion.
            at = next((i for i, other in enumerate(motions) if _is_same(other, new, felt)), None)
            if at is None:
                motions.append(new)
            else:
                members = tuple(sorted(motions[at].starts + new.starts))
                motions[at] = replace(motions[at], starts=members, share=len(members) / len(y0))
    return tuple(sorted(motions, key=lambda a: -a.share))


def _is_same(a: Attractor, b: Attractor, felt: bool) -> bool:
    """Whether two motions are the same, or have the same status whose motions are not compared."""
    # Motions that do not repeat are grouped by their status only.
    if a.status != b.status or not is_one_of(a.steady.status, *_DIVIDED):
        return a.status == b.status
    x, y = (np.array([m.steady.amplitude, m.steady.swing]) for m in (a, b))
    return a.periods == b.periods and _agree(x, y, _NEWTON_TOLERANCE, felt)


def _agree(a: np.ndarray, b: np.ndarray, share: float, felt: bool) -> bool:
    """Whether two pairs (amplitude, swing) agree. The swings count only if the block feels the bob."""
    close = np.abs(a - b) <= share * np.maximum(a, b)
    return bool(close[0] and (close[1] or not felt))


def _groups(settled: Run, felt: bool) -> list[tuple[int, list[int]]]:
    """Group the initial states that seem to reach the same motion, by number of status."""
    # This coarse grouping saves Newton's method for all but one initial state of each group. The motions that
    # Newton's method returns are then compared with a much smaller tolerance.
    codes, periods = code_of(settled.status), settled.periods
    sizes = np.stack([settled.settled_tilt, settled.settled_swing], axis=-1)
    groups: list[tuple[int, list[int]]] = []
    for i, code in enumerate(codes.tolist()):
        for other, group in groups:
            # Each group is represented by its first member.
            j = group[0]
            alike = other == code and periods[i] == periods[j]
            if alike and (not is_one_of(code, *MOVING) or _agree(sizes[i], sizes[j], _CLOSE, felt)):
                group.append(i)
                break
        else:
            groups.append((code, [i]))
    return groups


_solved = eqx.filter_jit(lambda p, y0, model: steady_state(p, model=model, y0=y0))
