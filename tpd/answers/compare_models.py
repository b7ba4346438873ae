"""Comparison of models for one design: the answer of each, what it neglects and how long it takes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax

from tpd.answers.steady_state import Steady, steady_state
from tpd.core import checks
from tpd.core.formatting import Printed
from tpd.core.progress import Progress, shown
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, Settled, follow
from tpd.models.base import AbstractModel
from tpd.models.compiled import Piecewise
from tpd.models.smoothed import Smoothed
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.quantities import Setup, parameters_without_pendulum
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import SETTLED, Status, names_of, status_name
from tpd.theory.equations import Terms
from tpd.theory.harmonic_balance import one_harmonic
from tpd.theory.no_uplift import uplift

_Sizes = tuple[float, float, str]
"""Amplitude and stroke (rad), and the name of the status."""


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Answer of one model; angles in rad, NaN where it has none: the status is "no impacts" where impacts
    lose energy and the model has no impact loss."""

    name: str
    amplitude: float
    """Largest |phi| of the settled motion from rest."""
    swing: float
    """Largest |psi|."""
    status: str
    seconds: float
    """Time of a second solution: compiled already."""
    first: float
    """Time of the first solution, compilation included; near zero if it had been compiled before."""
    neglects: str


@dataclass(frozen=True, kw_only=True, repr=False)
class Check(Printed):
    """A design by several models, the cheapest first."""

    models: tuple[Answer, ...]
    limit: float
    """Largest allowed stroke, rad."""
    without: float
    """Nonlinear amplitude of the bare block, rad; infinite if it overturns, NaN without a pendulum."""

    @property
    def top(self) -> Answer:
        """The answer of the nonlinear equations."""
        return next(r for r in self.models if r.name == TOP)

    @property
    def objections(self) -> tuple[str, ...]:
        """Sentences that say why the nonlinear equations refuse the design; empty if they confirm it."""
        return objections(self.top.amplitude, self.top.swing, self.top.status, self.limit, self.without)

    def table(self) -> str:
        """One line for each model."""
        lines = [
            f"{'model':20}{'amplitude':>11}{'swing':>10}  {'status':13}{'time':>10}{'first':>9}  neglects"
        ]
        for r in self.models:
            sizes = (
                f"{'-':>{w}}" if math.isnan(x) else f"{x:{w}.6f}"
                for x, w in ((r.amplitude, 11), (r.swing, 10))
            )
            times = f"{r.seconds * 1e3:7.2f} ms{r.first:7.1f} s"
            lines.append(f"{r.name:20}{''.join(sizes)}  {r.status:13}{times}  {r.neglects}")
        return "\n".join([*lines, _MEANING])

    def __str__(self) -> str:
        verdict = [f"objection: {x}" for x in self.objections] or ["no objection by the nonlinear equations"]
        return "\n".join([self.table(), *verdict])


def check(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    swing_limit: checks.Real = math.inf,
    models: tuple[str, ...] | None = None,
    progress: Progress | bool | None = None,
) -> Check:
    """Solve a design by all models, from rest.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: in the scene; default none, the bare block.
        swing_limit: limit on the bob's angle, rad.
        models: names of models out of `MODELS`, default all; the nonlinear one is always there.
        progress: True for a bar on stderr, or called with ("checking", models done, of how many).

    Raises:
        ValueError: an unknown model, a limit that is not positive, traced or batched parameters, or a
            pendulum beside parameters.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    if not (isinstance(swing_limit, float) and swing_limit == math.inf):
        swing_limit = checks.positive("swing_limit", swing_limit)
    models = MODELS if models is None else models
    checks.instance("models", models, (tuple, list))
    for name in models:
        checks.one_of("models", name, MODELS)
    setup = Setup.of(subject, pendulum)
    p, asked = as_arrays(setup.at({})), [r for r in MODELS if r in models or r == TOP]
    done = []
    with shown(progress) as report:
        for i, name in enumerate(asked):
            done.append(_timed(name, p))
            report("checking", i + 1, len(asked))
    if not setup.has_pendulum:
        # The parameters of a bare block stand for a bob too light to be felt; its stroke means nothing.
        return Check(models=tuple(replace(r, swing=math.nan) for r in done), limit=math.inf, without=math.nan)
    return Check(
        models=tuple(done),
        limit=swing_limit,
        without=nonlinear(parameters_without_pendulum(subject))[0],
    )


def objections(amplitude: float, swing: float, status: str, limit: float, without: float) -> tuple[str, ...]:
    """Sentences that say why a nonlinear motion speaks against its design: it does not settle, its stroke
    exceeds the limit, or the bare block rocks less. Angles in rad."""
    by, out = "by the nonlinear equations", []
    if status not in names_of(SETTLED):
        return (f"{by} the motion ends {status}",)
    if swing > limit:
        out.append(f"{by} the swing is {swing:.4g} rad, above {limit:g}")
    # A block that rests with the pendulum is no worse than any bare block.
    if amplitude > 0.0 and amplitude >= without:
        out.append(f"{by} the block rocks {amplitude:.4g} rad, and {without:.4g} without the pendulum")
    return tuple(out)


def nonlinear(p: Parameters) -> tuple[float, float, str]:
    """(amplitude, stroke, status) by the nonlinear equations from rest, without derivatives."""
    return _sizes_of(follow(Terms.nonlinear, row_of(p), HarmonicForcing()))


def _timed(name: str, p: Parameters) -> Answer:
    """The answer of one model, solved twice to separate the time to compile from the time to solve."""
    model = _MODELS[name]
    knows = model.impact_loss or float(p.velocity_ratio) == 1.0
    solve = model.solve if knows else lambda _: (math.nan, math.nan, "no impacts")
    begin = time.perf_counter()
    solve(p)
    middle = time.perf_counter()
    amplitude, swing, status = solve(p)
    times = {"first": middle - begin, "seconds": time.perf_counter() - middle}
    sizes = {"amplitude": amplitude, "swing": swing}
    return Answer(name=name, status=status, neglects=model.neglects, **sizes, **times)


_one_harmonic = eqx.filter_jit(one_harmonic)


def _at_rest(p: Parameters) -> _Sizes:
    lift = uplift(p)
    amplitude, status = (0.0, "rest") if lift.margin >= 0.0 else (math.nan, "lifts")
    return amplitude, float(lift.swing), status


def _balanced(p: Parameters) -> _Sizes:
    found = _one_harmonic(p)
    if not bool(found.exists):
        return math.nan, math.nan, "no_orbit"
    return float(found.amplitude), float(found.swing), "rocking"


def _followed(model: AbstractModel, p: Parameters) -> _Sizes:
    # A smoothed motion is known between its samples only once its orbit is polished; polishing the exact one
    # is compiled by `optimise` already.
    return _sizes_of(jax.block_until_ready(steady_state(p, model=model)))


def _sizes_of(settled: Settled | Steady) -> _Sizes:
    name = status_name(settled.status)
    if settled.status == Status.overturned:
        return math.inf, math.inf, name
    return float(settled.amplitude), float(settled.swing), name


class _Model(NamedTuple):
    """A model that can be asked for its answer from rest."""

    neglects: str
    solve: Callable[[Parameters], _Sizes]
    impact_loss: bool = True
    """Whether the model has the loss of energy at impacts."""


_MEANING = (
    "Amplitude and stroke are the largest tilt and bob angle (rad) of the motion that each model reaches "
    "from rest; where they differ from those of the model nonlinear, what a model neglects matters."
)
TOP = "nonlinear"
"""Name of the model that the others are compared with."""
_MODELS = {
    "uplift": _Model("everything but the settled bob under a resting block", _at_rest),
    "one harmonic": _Model("all harmonics but one", _balanced, impact_loss=False),
    "exact": _Model("terms of second order in the angles", partial(_followed, Piecewise())),
    "smoothed": _Model("terms of second order, and the sharpness of signs", partial(_followed, Smoothed())),
    "parametric": _Model(
        "as smoothed, but for s f nu phi sin(xi tau)", partial(_followed, Smoothed(terms=Terms.parametric))
    ),
    "smoothed nonlinear": _Model(
        "the sharpness of signs", partial(_followed, Smoothed(terms=Terms.nonlinear)), impact_loss=False
    ),
    TOP: _Model("nothing of the paper's (4)", nonlinear),
}
MODELS = tuple(_MODELS)
"""Names of all models, the cheapest first."""
QUICK = ("uplift", "one harmonic", "exact", TOP)
"""Names of the models that do not take long to compile."""
