"""Computations behind a report: time histories, responses, comparison of models, sensitivities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tpd.answers.response import Response, frequencies, settled_response
from tpd.answers.steady_state import sampled, simulate
from tpd.core.progress import Progress
from tpd.design.build import Build, build_of, moved_of
from tpd.design.objective import geometry_of
from tpd.design.result import Design, DesignStatus, HarmonicDesign
from tpd.models.piecewise import Piecewise
from tpd.scene.parameters import as_arrays
from tpd.scene.scene import Pendulum, Scene

if TYPE_CHECKING:
    from tpd.design.front import FrontPoint

_BAND = frequencies(1.0, 0.7, 1.5, 41)
"""Frequencies of a response, in shares of the scene's own."""
_Part = TypeVar("_Part")


@dataclass(frozen=True, kw_only=True)
class TimeHistory:
    """One motion from rest under the scene's own shaking, shapes (times,)."""

    with_pendulum: bool
    time: np.ndarray
    """s"""
    tilt: np.ndarray
    """phi, rad; NaN where the model has no answer, as after an overturning."""
    bob: np.ndarray
    """psi, rad."""


@dataclass(frozen=True, kw_only=True)
class Study:
    """Everything that a report shows beside the design; None where a part does not apply or was left out. A
    design on ground motions has the build and the front alone."""

    build: Build | None = None
    """None where no pendulum is offered."""
    histories: tuple[TimeHistory, ...] | None = None
    """First 24 periods from rest."""
    responses: tuple[Response, ...] | None = None
    """Over frequency from rest: the bare block and, if there is one, the block with the pendulum. Only for
    the scene's own shaking."""
    usage: tuple[tuple[str, float], ...] = ()
    """Limited quantities of the best design over their limits, the largest of all conditions."""
    front: tuple[FrontPoint, ...] = ()
    left_out: tuple[str, ...] = ()
    """Parts that an interruption left out."""


def study(design: Design, *, front: tuple[FrontPoint, ...] = (), progress: Progress | None = None) -> Study:
    """Compute everything that a report shows beside the design, once.

    Ctrl-C during one part leaves this part out and goes on with the next one. Of an interrupted design
    nothing is computed.

    Args:
        design: the answer of `optimise`.
        front: the answer of `tpd.front`, to be shown as well.
        progress: called with (stage, units done, units in all).

    Raises:
        RuntimeError: JAX is in 32-bit mode.
    """
    harmonic = design if isinstance(design, HarmonicDesign) else None
    used = () if harmonic is None else usage(harmonic)
    # After Ctrl-C the user wants the prompt back, not minutes of further work.
    if design.status is DesignStatus.interrupted:
        return Study(front=front, usage=used)
    left_out: list[str] = []

    def part(name: str, compute: Callable[..., _Part], *inputs: Any) -> _Part | None:
        try:
            return compute(*inputs)
        except KeyboardInterrupt:
            left_out.append(name)
            return None

    moved = part("what the benefit hangs on", moved_of, design, progress) or ()
    out = Study(build=part("the loads", build_of, design, moved), front=front, usage=used)
    if harmonic is not None:
        scene, hung = design.scene, design.pendulum
        # A response over frequency belongs to conditions that differ in the motion of the base alone.
        varied = set(design.conditions.factors) <= {"amplitude", "frequency"}
        out = replace(
            out,
            histories=part("the time histories", time_histories, scene, hung),
            responses=part("the response over frequency", _responses, harmonic, progress) if varied else None,
        )
    return replace(out, left_out=tuple(left_out))


def time_histories(scene: Scene, pendulum: Pendulum | None) -> tuple[TimeHistory, ...]:
    """Histories from rest by the exact solution: bare and, if there is one, with the pendulum."""
    cases, out = (None,) if pendulum is None else (None, pendulum), []
    for hung in cases:
        p = as_arrays(scene.parameters(hung))
        tau = sampled(p)
        tilt, bob = np.asarray(simulate(p, np.zeros(4), tau, model=Piecewise()).ys).T[:2]
        time = np.asarray(tau) / scene.rate
        out.append(TimeHistory(with_pendulum=hung is not None, time=time, tilt=tilt, bob=bob))
    return tuple(out)


def _responses(design: HarmonicDesign, progress: Progress | None) -> tuple[Response, ...]:
    values = design.scene.motion.frequency * _BAND
    cases = (None,) if design.pendulum is None else (None, design.pendulum)
    return tuple(
        settled_response(design.scene, "frequency", values, pendulum=hung, progress=progress)
        for hung in cases
    )


def usage(design: HarmonicDesign) -> tuple[tuple[str, float], ...]:
    """Limited quantities of the best design over their limits, the largest of all conditions."""
    if design.best is None:
        return ()
    evaluation, bare = design.best.evaluation, design.bare.evaluation
    tilt = np.where(bare.attracts[0], bare.tilt[0], np.nan)
    where = replace(geometry_of(design.scene, design.conditions), bare_tilt=tilt)
    sizes = [size for limit in design.limits for size in limit.sizes(evaluation, where)]
    return tuple((size.name, float(np.max(size.value))) for size in sizes)
