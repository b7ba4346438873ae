"""A design through the whole ladder of models: what each says, what it neglects and what it costs."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from tpd.analysis.steady_state import steady_state
from tpd.closed_form.harmonic_balance import one_harmonic
from tpd.closed_form.no_uplift import uplift
from tpd.core import checks
from tpd.core.equations import Terms
from tpd.core.parameters import Parameters, as_arrays
from tpd.core.scene import Pendulum, Scene
from tpd.core.status import SETTLED, Status, status_name
from tpd.models.base import AbstractModel, Settled
from tpd.models.piecewise import Piecewise
from tpd.models.segmented import Segmented
from tpd.models.smoothed import Smoothed

TOP = "nonlinear"
"""Name of the rung that the others are judged by."""

_MODELS: dict[str, tuple[AbstractModel, str]] = {
    "exact": (Piecewise(), "terms of second order in the angles"),
    "smoothed": (Smoothed(), "the same, and the sharpness of signs"),
    "parametric": (Smoothed(terms=Terms.parametric), "the same but s f nu phi sin(xi tau)"),
    "smoothed nonlinear": (Smoothed(terms=Terms.nonlinear), "the sharpness of signs"),
    TOP: (Segmented(), "nothing of the paper's (4)"),
}
"""Rungs that follow a motion from rest, and what each neglects."""

_CLOSED = {
    "uplift": "everything but the settled bob under a resting block",
    "one harmonic": "all harmonics but one",
}
"""Closed forms, and what each neglects."""
_LOSSLESS = ("one harmonic", "smoothed", "parametric", "smoothed nonlinear")
"""Rungs that have no impact loss, and nothing to say where there is one."""

RUNGS = (*_CLOSED, *_MODELS)
"""All rungs, the cheapest first."""
QUICK = ("uplift", "one harmonic", "exact", TOP)
"""Those that do not take long to compile."""


@dataclass(frozen=True, kw_only=True)
class Rung:
    """What one model says of a design; angles in rad, NaN where it has nothing to say: the status is
    "no impacts" where impacts lose energy and the model does not have that."""

    name: str
    amplitude: float
    """Largest |phi| of the settled motion from rest."""
    stroke: float
    """Largest |psi|."""
    status: str
    seconds: float
    """Of a second run: compiled already."""
    first: float
    """Of the first run, compilation included; near zero if it had been compiled before."""
    neglects: str


@dataclass(frozen=True, kw_only=True)
class Check:
    """A design's way up the ladder."""

    rungs: tuple[Rung, ...]
    limit: float
    """Largest allowed stroke, rad."""
    bare: float
    """Nonlinear amplitude of the bare block, rad; infinite if it overturns, NaN if not asked for."""

    @property
    def top(self) -> Rung:
        """The nonlinear rung."""
        return next(r for r in self.rungs if r.name == TOP)

    @property
    def objections(self) -> tuple[str, ...]:
        """What the nonlinear equations have against the design, a sentence each; none if sound."""
        return objections(self.top.amplitude, self.top.stroke, self.top.status, self.limit, self.bare)

    def table(self) -> str:
        """The rungs as text."""
        head = f"{'rung':20}{'amplitude':>11}{'stroke':>10}  {'status':13}{'time':>10}{'first':>9}  neglects"
        return "\n".join([head, *(_row(r) for r in self.rungs)])


def check(
    scene: Scene,
    pendulum: Pendulum | None,
    *,
    stroke: float = math.inf,
    rungs: tuple[str, ...] = RUNGS,
    progress: Callable[[str, int, int], None] | None = None,
) -> Check:
    """A design by all models, from rest.

    Args:
        scene: block and base motion, SI.
        pendulum: the design; None for the bare block.
        stroke: limit on the bob's angle, rad.
        rungs: names out of `RUNGS`; the nonlinear one is always there.
        progress: called with (rung, how many are done, of how many).

    Raises:
        ValueError: an unknown rung or a limit that is not positive.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    if not stroke > 0:
        raise ValueError(f"`stroke` must be positive, but is {stroke:g}")
    unknown = [name for name in rungs if name not in RUNGS]
    if unknown:
        raise ValueError(f"`rungs` must be of {', '.join(RUNGS)}, but has {', '.join(unknown)}")
    p, asked = as_arrays(scene.parameters(pendulum)), [r for r in RUNGS if r in rungs or r == TOP]
    done = []
    for i, name in enumerate(asked):
        done.append(_rung(name, p))
        if progress is not None:
            progress("checking", i + 1, len(asked))
    if pendulum is None:
        # There is no bob, whatever stands for it.
        return Check(rungs=tuple(replace(r, stroke=math.nan) for r in done), limit=math.inf, bare=math.nan)
    return Check(rungs=tuple(done), limit=stroke, bare=nonlinear(as_arrays(scene.parameters()))[0])


def objections(amplitude: float, stroke: float, status: str, limit: float, bare: float) -> tuple[str, ...]:
    """What a nonlinear motion has against its design: it does not settle, its stroke is beyond the limit,
    or the bare block rocks less."""
    by, out = "by the nonlinear equations", []
    if status not in SETTLED:
        return (f"{by} the motion ends {status}",)
    if stroke > limit:
        out.append(f"{by} the stroke is {stroke:.4g} rad, above {limit:g}")
    if amplitude > 0.0 and amplitude >= bare:
        out.append(f"{by} the block rocks {amplitude:.4g} rad, and {bare:.4g} without the pendulum")
    return tuple(out)


def nonlinear(p: Parameters) -> tuple[float, float, str]:
    """(amplitude, stroke, status) by the nonlinear equations from rest, without derivatives."""
    return _followed(_MODELS[TOP][0], as_arrays(p))


def _rung(name: str, p: Parameters) -> Rung:
    def run() -> tuple[float, float, str]:
        if name in _LOSSLESS and float(p.e) < 1.0:
            return math.nan, math.nan, "no impacts"
        return _followed(_MODELS[name][0], p) if name in _MODELS else _closed(name, p)

    begin = time.perf_counter()
    run()
    middle = time.perf_counter()
    amplitude, stroke, status = run()
    end = time.perf_counter()
    return Rung(
        name=name,
        amplitude=amplitude,
        stroke=stroke,
        status=status,
        seconds=end - middle,
        first=middle - begin,
        neglects=_CLOSED[name] if name in _CLOSED else _MODELS[name][1],
    )


def _closed(name: str, p: Parameters) -> tuple[float, float, str]:
    if name == "uplift":
        lift = _uplift(p)
        stays = float(lift.margin) >= 0.0
        return (0.0 if stays else math.nan), float(lift.stroke), "rest" if stays else "lifts"
    found = _harmonic(p)
    exists = bool(found.exists)
    sizes = (float(found.amplitude), float(found.stroke)) if exists else (math.nan, math.nan)
    return *sizes, "rocking" if exists else "no_orbit"


_uplift = eqx.filter_jit(uplift)
_harmonic = eqx.filter_jit(one_harmonic)


def _followed(model: AbstractModel, p: Parameters) -> tuple[float, float, str]:
    # Between its samples the smoothed motion is known only once its orbit is polished; the others are
    # exact at their turns. Polishing the exact one is compiled by `optimise` already.
    polished = isinstance(model, (Piecewise, Smoothed))
    solve = functools.partial(steady_state, model=model) if polished else _settler(model)
    settled = jax.block_until_ready(solve(p))
    resolution, status = float(model.resolution(p)), settled.status
    amplitude, stroke = float(settled.amplitude), float(settled.stroke)
    if status_name(status) in SETTLED and amplitude <= resolution:
        return 0.0, stroke, "rest"
    lost = bool(status == Status.overturned)
    return (math.inf, math.inf, "overturned") if lost else (amplitude, stroke, status_name(status))


@lru_cache(maxsize=16)
def _settler(model: AbstractModel) -> Callable[[Any], Settled]:
    return eqx.filter_jit(lambda p: model.settle(p, jnp.zeros(4)))


def _row(r: Rung) -> str:
    def number(x: float, width: int) -> str:
        return f"{'-':>{width}}" if math.isnan(x) else f"{x:{width}.6f}"

    return (
        f"{r.name:20}{number(r.amplitude, 11)}{number(r.stroke, 10)}  {r.status:13}{r.seconds * 1e3:7.2f} ms"
        f"{r.first:7.1f} s  {r.neglects}"
    )
