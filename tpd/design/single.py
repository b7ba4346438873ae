"""The main job: find the pendulum for a scene, and prove it by the exact solution."""

from __future__ import annotations

import math
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from tpd.analysis.ensemble import Ensemble
from tpd.analysis.steady_state import sampled, simulate, steady_state
from tpd.core import checks
from tpd.core.parameters import Parameters, as_arrays
from tpd.core.progress import Progress
from tpd.core.scene import Harmonic, Pendulum, Scene
from tpd.core.status import status_name
from tpd.design.result import Design, DesignSpace, DesignStatus, History
from tpd.design.single_candidates import candidates
from tpd.design.single_found import Screened, bare_design, exact, search
from tpd.design.single_jury import Jury, pendulum_of
from tpd.design.single_rounds import Inside, at_rest, confirmed
from tpd.design.single_search import Trace
from tpd.models.base import AbstractModel
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed

_NEARBY = (-0.01, -0.005, 0.005, 0.01)
"""Changes of the base motion's amplitude and of its frequency under which an answer must stand."""


def optimise(
    scene: Scene,
    space: DesignSpace | None = None,
    *,
    seed: int = 0,
    starts: int = 8,
    steps: int = 30,
    screening: int = 192,
    tolerance: float = 0.01,
    ensemble: Ensemble | None = None,
    model: AbstractModel | None = None,
    progress: Progress | None = None,
) -> Design:
    """The pendulum of least settled rocking amplitude from rest, within a design space.

    Closed forms say where a resting block stays at rest; the exact solution screens `screening`
    designs; optax descends from the best `starts` of them on the gradients of `model`; and the
    exact solution judges what they found. Designs on which both models agree come first, then
    the smaller amplitude; among designs at rest the larger uplift margin. The best one is put to the
    nonlinear equations: if it breaks a limit there, the search goes on under a corrected one.

    Args:
        scene: block and base motion, SI.
        space: bounds and stroke limit; default `DesignSpace()`.
        seed: of the screened designs; the same seed gives the same answer.
        starts: searches run at once.
        steps: bound on the steps of the search.
        screening: designs solved exactly before the search.
        tolerance: largest relative difference of the two models' amplitudes.
        ensemble: runs that judge the design: one that overturns in significantly more of them than the bare
            block is not offered; default `Ensemble()`.
        model: the model searched with; default `Smoothed()`, or where impacts lose energy, which it does not
            have, `Piecewise()`.
        progress: called after every unit of work.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    space = DesignSpace() if space is None else space
    for name, value in {"starts": starts, "steps": steps, "screening": screening}.items():
        checks.count(name, value)
    checks.positive("tolerance", tolerance)
    checks.not_negative("seed", seed)
    p = as_arrays(scene.parameters())
    model = searched_with(p) if model is None else model
    model.check(p)
    rests = status_name(exact(p, bare_design(p)).status) == "rest"
    screening = 1 if rests else max(screening, starts)
    jury = Jury(scene, Ensemble() if ensemble is None else ensemble, progress, not rests)
    found = search(p, space, model, starts, 0 if rests else steps, screening, seed, progress)
    bare, *others = candidates(p, found, space, tolerance, model, progress)
    if len(others) < len(found.designs(space.stroke)):
        found = replace(found, interrupted=True)
    inside = Inside(p, space, model, tolerance, 0 if rests else steps, progress, jury.objections)
    winner, runner_up, status, rounds = confirmed(inside, found, bare, [] if rests else others)
    if rests:
        status, rounds = at_rest(inside, bare)
    helps = winner is not None and status in (DesignStatus.found, DesignStatus.models_disagree)
    pendulum = pendulum_of(scene, winner) if helps and winner is not None else None
    interrupted = found.interrupted or status is DesignStatus.interrupted
    verdict, nearby, peak = None, (0, 0, 0), (math.nan, math.nan)
    try:
        verdict = None if pendulum is None or interrupted else jury.verdict(pendulum)
        nearby, peak = _overturned_nearby(scene, pendulum), _peak(scene, pendulum)
    except KeyboardInterrupt:
        interrupted = True
    if status is DesignStatus.found and nearby[1] > 0:
        status = DesignStatus.fragile
    return Design(
        scene=scene,
        space=space,
        pendulum=pendulum,
        amplitude=bare.amplitude if pendulum is None or winner is None else winner.amplitude,
        amplitude_without=bare.amplitude,
        stroke=0.0 if pendulum is None or winner is None else winner.stroke,
        status=DesignStatus.interrupted if interrupted else status,
        winner=winner,
        runner_up=runner_up,
        bare=bare,
        starts=found.statuses(space),
        history=_history(found.trace, found.screened),
        peak=peak,
        overturned_nearby=nearby,
        verdict=verdict,
        rounds=rounds,
        tolerance=tolerance,
        searched_with=type(model).__name__.lower(),
        seed=seed,
        interrupted=interrupted,
        settings={"starts": starts, "steps": steps, "screening": screening, "model": _describe(model)},
    )


def searched_with(p: Parameters) -> AbstractModel:
    """The model that a search runs on unless another is given."""
    return Smoothed(max_periods=200) if float(p.e) == 1.0 else Piecewise(max_periods=200, lyapunov_periods=0)


def _overturned_nearby(scene: Scene, pendulum: Pendulum | None) -> tuple[int, int, int]:
    """How many of eight shakings within 1 % in amplitude or frequency overturn the block from rest,
    with the pendulum and without; one settled motion does not say that it is reached safely."""
    shakes = [(1.0 + d, 1.0) for d in _NEARBY] + [(1.0, 1.0 + d) for d in _NEARBY]

    def overturned(hung: Pendulum | None) -> int:
        count = 0
        for amplitude, frequency in shakes:
            motion = Harmonic(
                amplitude=scene.motion.amplitude * amplitude, frequency=scene.motion.frequency * frequency
            )
            q = as_arrays(replace(scene, motion=motion).parameters(hung))
            count += status_name(steady_state(q, model=Piecewise()).status) == "overturned"
        return count

    without = overturned(None)
    return len(shakes), without if pendulum is None else overturned(pendulum), without


def _peak(scene: Scene, pendulum: Pendulum | None) -> tuple[float, float]:
    """Largest |phi| and |psi| among samples of the first periods from rest."""
    p = as_arrays(scene.parameters(pendulum))
    ys = np.abs(np.asarray(simulate(p, jnp.zeros(4), sampled(p)).ys))
    phi, psi = (float(x) for x in np.nanmax(ys[:, :2], axis=0))
    return phi, psi


def _history(trace: Trace, screened: Screened) -> History:
    return History(
        designs=trace.designs,
        amplitude=trace.amplitude,
        stroke=trace.stroke,
        margin=trace.margin,
        status=trace.status,
        screened=screened.designs,
        screened_amplitude=screened.amplitude,
        screened_stroke=screened.stroke,
        screened_status=screened.status,
    )


def _describe(model: AbstractModel) -> str:
    return repr(model).replace("\n", " ")
