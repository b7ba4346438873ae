"""The main job: find the pendulum for a scene, and prove it by the exact solution."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable

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
from tpd.scene import Pendulum, Scene
from tpd.search import (
    Evaluation,
    Progress,
    Trace,
    descend,
    evaluator,
    start_status,
    starting_points,
    with_design,
)
from tpd.status import status_name
from tpd.steady import Steady, steady_state


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

    Closed forms say where a settled block cannot lift; the exact solution screens `screening`
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
    evaluate = evaluator(p, model, len(space.names))

    compiling = _compile_aside(evaluate, np.tile(_bare(p), (starts, 1)))
    screened, interrupted = _screen(p, space, max(screening, starts), seed, progress)
    chosen = _choose(screened, space, starts)
    compiling.join()
    trace, stopped = descend(evaluate, space, chosen, steps=0 if interrupted else steps, progress=progress)
    interrupted = interrupted or stopped
    best = trace.best(space.stroke)
    near = np.stack([trace.designs[i, j] if j >= 0 else chosen[i] for i, j in enumerate(best)])
    finish, stopped = polish(evaluate, space, near, steps=0 if interrupted else steps // 2, progress=progress)
    interrupted, trace = interrupted or stopped, trace.then(finish)
    best = trace.best(space.stroke)
    found = [trace.designs[i, j] for i, j in enumerate(best) if j >= 0]
    found += list(screened.designs[screened.order(space.stroke)[:2]])
    bare, *candidates = _candidates(p, evaluate, [_bare(p), *found], len(chosen), tolerance, model, progress)
    winner, runner_up = _rank(candidates, space)
    judged = tuple(start_status(trace, space, i, int(j)) for i, j in enumerate(best))
    return Design(
        scene=scene,
        space=space,
        pendulum=None if winner is None else _pendulum(scene, winner),
        amplitude=bare.amplitude if winner is None else winner.amplitude,
        amplitude_without=bare.amplitude,
        stroke=0.0 if winner is None else winner.stroke,
        status=_judge(winner, bare),
        winner=winner,
        runner_up=runner_up,
        bare=bare,
        starts=tuple(StartStatus.interrupted for _ in chosen) if interrupted else judged,
        history=_history(trace, screened),
        tolerance=tolerance,
        seed=seed,
        interrupted=interrupted,
        settings={"starts": starts, "steps": steps, "screening": screening, "model": _describe(model)},
    )


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
        settled = np.isin(self.status, ("rocking", "rest")) & (self.stroke <= limit)
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
    evaluate: Callable[[Array], Evaluation],
    designs: list[np.ndarray],
    batch: int,
    tolerance: float,
    model: AbstractModel,
    progress: Progress | None,
) -> list[Candidate]:
    """Every design solved by both models; smoothed in batches of the size already compiled."""
    out: list[Candidate] = []
    for begin in range(0, len(designs), batch):
        part = designs[begin : begin + batch]
        padded = np.stack(part + [part[-1]] * (batch - len(part)))
        smoothed = evaluate(jnp.asarray(padded))
        for i, design in enumerate(part):
            out.append(_candidate(p, design, smoothed, i, tolerance, model))
            if progress is not None:
                progress("verifying", len(out), len(designs))
    return out


def _candidate(
    p: Parameters, design: np.ndarray, smoothed: Evaluation, i: int, tolerance: float, model: AbstractModel
) -> Candidate:
    q = with_design(p, jnp.asarray(design))
    exact = _exact(p, design)
    amplitude, other = float(exact.amplitude), float(smoothed.amplitude[i])
    name, other_name = status_name(exact.status), status_name(jax.tree.map(lambda x: x[i], smoothed.status))
    near = abs(amplitude - other) <= tolerance * max(amplitude, other) + float(model.resolution(q))
    settled = {name, other_name} <= {"rocking", "rest"}
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
        smoothed_stroke=float(smoothed.stroke[i]),
        smoothed_status=other_name,
        agree=bool(settled and near) or name == other_name == "overturned",
    )


def _rank(candidates: list[Candidate], space: DesignSpace) -> tuple[Candidate | None, Candidate | None]:
    """The best and the second best candidate, the latter another design and not a neighbour."""
    feasible = [c for c in candidates if c.status in ("rocking", "rest") and c.stroke <= space.stroke]
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


def _judge(winner: Candidate | None, bare: Candidate) -> DesignStatus:
    if bare.status == "rest":
        return DesignStatus.no_uplift
    if winner is None:
        return DesignStatus.none_feasible
    if not winner.agree or not bare.agree:
        return DesignStatus.models_disagree
    return DesignStatus.found if winner.amplitude < bare.amplitude else DesignStatus.no_improvement


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
