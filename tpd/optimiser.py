"""The main job: find the pendulum for a scene, and prove it by the exact solution."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from tpd import checks
from tpd.balance import uplift
from tpd.design import Candidate, Design, DesignSpace, DesignStatus, History, StartStatus
from tpd.models.interface import AbstractModel
from tpd.models.piecewise import Piecewise
from tpd.models.smoothed import Smoothed
from tpd.parameters import Parameters, as_arrays
from tpd.polish import polish
from tpd.scene import Harmonic, Pendulum, Scene
from tpd.search import (
    Evaluation,
    Progress,
    Trace,
    descend,
    evaluator,
    start_status,
    starting_points,
    trace,
    with_design,
)
from tpd.status import SETTLED, status_name
from tpd.steady import Steady, sampled, simulate, steady_state

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
    model: AbstractModel | None = None,
    progress: Progress | None = None,
) -> Design:
    """The pendulum of least settled rocking amplitude from rest, within a design space.

    Closed forms say where a resting block stays at rest; the exact solution screens `screening`
    designs; optax descends from the best `starts` of them on the gradients of `model`; and the
    exact solution judges what they found. Designs on which both models agree come first, then
    the smaller amplitude; among designs at rest the larger uplift margin.

    Args:
        scene: block and base motion, SI.
        space: bounds and stroke limit; default `DesignSpace()`.
        seed: of the screened designs; the same seed gives the same answer.
        starts: searches run at once.
        steps: bound on the steps of the search.
        screening: designs solved exactly before the search.
        tolerance: largest relative difference of the two models' amplitudes.
        model: the model searched with; default `Smoothed()`.
        progress: called after every unit of work.

    Raises:
        ValueError: bad input.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    space = DesignSpace() if space is None else space
    for name, value in {"starts": starts, "steps": steps, "screening": screening}.items():
        _count(name, value)
    checks.positive("tolerance", tolerance)
    checks.not_negative("seed", seed)
    model = Smoothed(max_periods=200) if model is None else model
    p = as_arrays(scene.parameters())
    rests = status_name(_exact(p, _bare(p)).status) == "rest"
    screening = 1 if rests else max(screening, starts)
    found = _search(p, space, model, starts, 0 if rests else steps, screening, seed, progress)
    bare, *candidates = _candidates(p, found, space, tolerance, model, progress)
    winner, runner_up = _rank(candidates, space)
    status = DesignStatus.no_uplift if rests else _judge(winner, bare, tolerance)
    helps = winner is not None and status in (DesignStatus.found, DesignStatus.models_disagree)
    pendulum = _pendulum(scene, winner) if helps and winner is not None else None
    nearby = _overturned_nearby(scene, pendulum)
    if status is DesignStatus.found and nearby[1] > 0:
        status = DesignStatus.fragile
    return Design(
        scene=scene,
        space=space,
        pendulum=pendulum,
        amplitude=bare.amplitude if pendulum is None or winner is None else winner.amplitude,
        amplitude_without=bare.amplitude,
        stroke=0.0 if pendulum is None or winner is None else winner.stroke,
        status=DesignStatus.interrupted if found.interrupted else status,
        winner=winner,
        runner_up=runner_up,
        bare=bare,
        starts=found.statuses(space),
        history=_history(found.trace, found.screened),
        peak=_peak(scene, pendulum),
        overturned_nearby=nearby,
        tolerance=tolerance,
        seed=seed,
        interrupted=found.interrupted,
        settings={"starts": starts, "steps": steps, "screening": screening, "model": _describe(model)},
    )


@dataclass(frozen=True)
class _Found:
    """What a search leaves behind, whole or interrupted."""

    evaluate: Callable[[Array], Evaluation] | None
    """The compiled evaluator; None if Ctrl-C came before it was ready."""
    screened: Screened
    trace: Trace
    best: np.ndarray
    interrupted: bool

    def designs(self, limit: float) -> list[np.ndarray]:
        """The best design of every start, and the two best screened."""
        paths = [self.trace.designs[i, j] for i, j in enumerate(self.best) if j >= 0]
        return paths + list(self.screened.designs[self.screened.order(limit)[:2]])

    def statuses(self, space: DesignSpace) -> tuple[StartStatus, ...]:
        """How every start ended."""
        if self.interrupted:
            return tuple(StartStatus.interrupted for _ in self.best)
        return tuple(start_status(self.trace, space, i, int(j)) for i, j in enumerate(self.best))


def _search(
    p: Parameters,
    space: DesignSpace,
    model: AbstractModel,
    starts: int,
    steps: int,
    screening: int,
    seed: int,
    progress: Progress | None,
) -> _Found:
    """Screen, descend and polish; Ctrl-C at any point keeps what there is."""
    evaluate = evaluator(p, model, len(space.names))
    compiling = _compile_aside(evaluate, np.tile(_bare(p), (starts, 1)))
    screened, interrupted = _screen(p, space, screening, seed, progress)
    chosen = _choose(screened, space, starts)
    nothing = np.full(len(chosen), -1)
    if interrupted:
        return _Found(None, screened, trace([], len(chosen)), nothing, True)
    compiling.join()
    path, interrupted = descend(evaluate, space, chosen, steps=steps, progress=progress)
    best = path.best(space.stroke)
    if not interrupted and steps > 0:
        near = np.stack([path.designs[i, j] if j >= 0 else chosen[i] for i, j in enumerate(best)])
        finish, interrupted = polish(evaluate, space, near, steps=(steps + 1) // 2, progress=progress)
        path = path.then(finish)
        best = path.best(space.stroke)
    return _Found(evaluate, screened, path, best, interrupted)


class Screened:
    """Designs solved exactly before the search."""

    def __init__(self, planned: np.ndarray, results: list[Steady]) -> None:
        self.planned = planned
        self.designs = planned[: len(results)]
        self.amplitude = np.array([float(s.amplitude) for s in results])
        self.stroke = np.array([float(s.stroke) for s in results])
        self.status = np.array([status_name(s.status) for s in results], dtype=str)

    def order(self, limit: float) -> np.ndarray:
        """Indices of the designs that settle within the limit, best first."""
        settled = np.isin(self.status, SETTLED) & (self.stroke <= limit)
        order = np.argsort(np.where(settled, self.amplitude, np.inf), kind="stable")
        return order[: settled.sum()]


def _count(name: str, value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ValueError(f"`{name}` must be a whole number of at least 1, but is {value!r}")


def _screen(
    p: Parameters, space: DesignSpace, count: int, seed: int, progress: Progress | None
) -> tuple[Screened, bool]:
    designs = starting_points(p, space, count, seed)
    results: list[Steady] = []
    try:
        for i, design in enumerate(designs):
            results.append(_exact(p, design))
            if progress is not None:
                progress("screening", i + 1, count)
    except KeyboardInterrupt:
        return Screened(designs, results), True
    return Screened(designs, results), False


def _exact(p: Parameters, design: np.ndarray) -> Steady:
    return jax.block_until_ready(steady_state(with_design(p, jnp.asarray(design)), model=Piecewise()))


def _choose(screened: Screened, space: DesignSpace, starts: int) -> np.ndarray:
    """The best screened designs that lie apart from one another, then the rest in order."""
    order = list(screened.order(space.stroke))
    order += [i for i in range(len(screened.planned)) if i not in set(order)]
    low, high = space.bounds
    unit = (screened.planned[:, : low.size] - low) / (high - low)
    chosen: list[int] = []
    for apart in (0.1, 0.0):
        for i in order:
            far = all(np.linalg.norm(unit[i] - unit[j]) > apart for j in chosen)
            if len(chosen) < starts and i not in chosen and far:
                chosen.append(i)
    return screened.planned[chosen]


def _compile_aside(evaluate: Callable[[Array], Evaluation], designs: np.ndarray) -> threading.Thread:
    """Compile the search's function while the other core screens; what fails, fails again there."""

    def run() -> None:
        with contextlib.suppress(Exception):
            jax.block_until_ready(evaluate(jnp.asarray(designs)).merit)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def _bare(p: Parameters) -> np.ndarray:
    return np.array([0.0, float(p.lam), float(p.zeta)])


def _candidates(
    p: Parameters,
    found: _Found,
    space: DesignSpace,
    tolerance: float,
    model: AbstractModel,
    progress: Progress | None,
) -> list[Candidate]:
    """The bare block and every design found, solved by both models; smoothed in batches of the
    size already compiled."""
    designs, batch = [_bare(p), *found.designs(space.stroke)], len(found.best)
    out: list[Candidate] = []
    for begin in range(0, len(designs), batch):
        part = designs[begin : begin + batch]
        padded = np.stack(part + [part[-1]] * (batch - len(part)))
        smoothed = None if found.evaluate is None else found.evaluate(jnp.asarray(padded))
        for i, design in enumerate(part):
            out.append(_candidate(p, design, smoothed, i, tolerance, model))
            if progress is not None:
                progress("verifying", len(out), len(designs))
    return out


def _candidate(
    p: Parameters,
    design: np.ndarray,
    smoothed: Evaluation | None,
    i: int,
    tolerance: float,
    model: AbstractModel,
) -> Candidate:
    q = with_design(p, jnp.asarray(design))
    exact = _exact(p, design)
    amplitude, name = float(exact.amplitude), status_name(exact.status)
    other, other_stroke, other_name = np.nan, np.nan, "not solved"
    if smoothed is not None:
        other, other_stroke = float(smoothed.amplitude[i]), float(smoothed.stroke[i])
        other_name = status_name(jax.tree.map(lambda x: x[i], smoothed.status))
    near = abs(amplitude - other) <= tolerance * max(amplitude, other) + float(model.resolution(q))
    settled = {name, other_name} <= set(SETTLED)
    mu, lam, zeta = (float(x) for x in design)
    return Candidate(
        mass_ratio=mu,
        length_ratio=lam,
        damping_ratio=zeta,
        amplitude=amplitude,
        stroke=float(exact.stroke),
        status=name,
        periods=int(exact.periods),
        multiplier=float(exact.multiplier),
        margin=float(uplift(q).margin),
        smoothed_amplitude=other,
        smoothed_stroke=other_stroke,
        smoothed_status=other_name,
        agree=bool(settled and near) or name == other_name == "overturned",
    )


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


def _rank(candidates: list[Candidate], space: DesignSpace) -> tuple[Candidate | None, Candidate | None]:
    """The best and the second best candidate, the latter another design and not a neighbour."""
    feasible = [c for c in candidates if c.status in SETTLED and c.stroke <= space.stroke]
    feasible.sort(key=lambda c: (not c.agree, c.amplitude, -c.margin))
    if not feasible:
        return None, None
    low, high = space.bounds

    def place(c: Candidate) -> np.ndarray:
        x = np.array([c.mass_ratio, c.length_ratio, c.damping_ratio])[: low.size]
        return (x - low) / (high - low)

    best = feasible[0]
    others = [c for c in feasible[1:] if np.linalg.norm(place(c) - place(best)) > 0.02]
    return best, others[0] if others else None


def _judge(winner: Candidate | None, bare: Candidate, tolerance: float) -> DesignStatus:
    if winner is None:
        return DesignStatus.none_feasible
    if not winner.amplitude < (1.0 - tolerance) * bare.amplitude:
        return DesignStatus.no_improvement
    return DesignStatus.found if winner.agree else DesignStatus.models_disagree


def _pendulum(scene: Scene, winner: Candidate) -> Pendulum:
    return scene.pendulum(
        mass_ratio=winner.mass_ratio,
        length_ratio=winner.length_ratio,
        damping_ratio=winner.damping_ratio,
    )


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
