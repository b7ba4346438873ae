"""Motions that a design can settle into, and the share of starts that reach each.

Rest, rocking of several kinds, chaos and overturning exist side by side; which one is reached depends on the
start and on the phase of the shaking. So a seeded set of starts is followed by the exact model, and the
motions that they settle into are sorted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from tpd.answers.steady_state import Steady, steady_state
from tpd.core import checks
from tpd.core.formatting import Printed, counted_periods
from tpd.core.progress import shown_count
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, Settled, follow
from tpd.models.compiled import Piecewise
from tpd.models.settling import scale_of
from tpd.scene.ensemble import StartKind as StartKind
from tpd.scene.ensemble import Starts as Starts
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.quantities import parameters_of
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import MOVING, NOT_ATTRACTING, Status, code_of, is_one_of, status_name
from tpd.theory.equations import Terms

_CLOSE = 1e-4
"""Largest relative difference of the sizes of two motions that may be one. Motions are followed until they
repeat within a tolerance only, so that starts of one motion end at slightly different sizes."""
_DIVIDED = (*MOVING, *NOT_ATTRACTING)
"""Statuses whose motions are told from each other."""
_SAME = 1e-6
"""Largest relative difference of the sizes of two motions that are one, or mirror images, after Newton's
method."""


@dataclass(frozen=True, repr=False)
class Attractor(Printed):
    """One motion that some of the starts reach."""

    status: str
    """Name of the `Status`: rocking, sticking, rest, aperiodic, overturned, not_settled, ..."""
    periods: int
    """Forcing periods in one period of the motion; 1 where it has none."""
    symmetric: bool
    """Whether the motion is its own mirror image half a period of it later."""
    share: float
    """Share of the starts that reach it, or its mirror image, or itself some forcing periods later."""
    starts: tuple[int, ...]
    """Indices of these starts."""
    steady: Steady
    """The settled motion of the first of these; for gradients call `steady_state` from that start."""

    def __str__(self) -> str:
        share = f"{self.status.replace('_', ' ')}: {self.share:.1%} of the starts"
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
    """The motions that a set of starts settles into, the one most often reached first.

    Motions that do not repeat (aperiodic, not_settled, overturned, event_bound) are grouped by their
    status. Motions whose amplitudes and strokes agree within 1e-6 are taken for one or for mirror images.
    The shares are estimates: with n starts, a share s is known to about sqrt(s (1 - s)/n).

    Args:
        subject: dimensionless parameters, or a scene; plain numbers.
        pendulum: in the scene; default none.
        starts: default `Starts()`, 64 of them, seed 0.
        model: settings of the exact model.
        progress: True for a bar on stderr, or called with (starts followed, of how many).

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    model = Piecewise() if model is None else model
    starts = Starts() if starts is None else starts
    checks.instance("model", model, Piecewise)
    checks.instance("starts", starts, Starts)
    fixed = as_arrays(parameters_of(subject, pendulum))
    y0 = starts.states(float(fixed.nu))
    with shown_count(progress, "following") as report:
        forcing, limits = HarmonicForcing(model.max_periods), {**model.accuracy, "tolerance": model.tolerance}
        settled = follow(Terms.linear, row_of(fixed), forcing, y0=y0, progress=report, **limits)
    # The block does not feel a bob without mass (mu = 0), whose swing may still be decaying.
    felt = bool(np.isfinite(np.asarray(scale_of(fixed))[1]))
    motions: list[Attractor] = []
    for code, group in _groups(settled, felt):
        # Only the Lyapunov exponent of each motion separates chaos from slow decay, so that these starts
        # are solved one by one; of the others one start stands for its group.
        for starts_of in [[i] for i in group] if code == code_of(Status.not_settled) else [group]:
            s = _solved(fixed, jnp.asarray(y0[starts_of[0]]), model)
            kind = status_name(s.status), int(s.periods), bool(s.symmetric)
            new = Attractor(*kind, len(starts_of) / len(y0), tuple(starts_of), s)
            at = next((i for i, known in enumerate(motions) if _is_same(known, new, felt)), None)
            if at is None:
                motions.append(new)
            else:
                all_ = tuple(sorted(motions[at].starts + new.starts))
                motions[at] = replace(motions[at], starts=all_, share=len(all_) / len(y0))
    return tuple(sorted(motions, key=lambda a: -a.share))


def _is_same(a: Attractor, b: Attractor, felt: bool) -> bool:
    """Whether both are one motion, or have one status whose motions are not divided."""
    if a.status != b.status or not is_one_of(a.steady.status, *_DIVIDED):
        return a.status == b.status
    x, y = (np.array([m.steady.amplitude, m.steady.swing]) for m in (a, b))
    return a.periods == b.periods and _agree(x, y, _SAME, felt)


def _agree(a: np.ndarray, b: np.ndarray, share: float, felt: bool) -> bool:
    """Whether two pairs (amplitude, stroke) agree; the strokes count only if the block feels the bob."""
    close = np.abs(a - b) <= share * np.maximum(a, b)
    return bool(close[0] and (close[1] or not felt))


def _groups(settled: Settled, felt: bool) -> list[tuple[int, list[int]]]:
    """Numbers of statuses and indices of the starts that seem to reach the same motion."""
    # A coarse grouping saves Newton's method for all but one start of each group; the motions that it finds
    # are compared again, far more closely.
    codes, periods = code_of(settled.status), settled.periods
    sizes = np.stack([np.asarray(settled.amplitude), np.asarray(settled.swing)], axis=-1)
    groups: list[tuple[int, list[int]]] = []
    for i, code in enumerate(codes.tolist()):
        for known, group in groups:
            j = group[0]
            alike = known == code and periods[i] == periods[j]
            if alike and (not is_one_of(code, *MOVING) or _agree(sizes[i], sizes[j], _CLOSE, felt)):
                group.append(i)
                break
        else:
            groups.append((code, [i]))
    return groups


_solved = eqx.filter_jit(lambda p, y0, model: steady_state(p, model=model, y0=y0))
