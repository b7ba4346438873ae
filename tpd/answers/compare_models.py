"""Comparison of models for one design: the result of each model, what it neglects, and its computing time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import equinox as eqx
import jax

from tpd.answers.steady_state import steady_state
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, follow
from tpd.core import checks
from tpd.core.formatting import Printed
from tpd.core.progress import Progress, bar_for
from tpd.scene.parameters import Parameters, as_arrays
from tpd.scene.quantities import Setup, parameters_without_pendulum
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import SETTLED, names_of, status_name
from tpd.theory.equations import Terms
from tpd.theory.harmonic_balance import one_harmonic
from tpd.theory.no_uplift import uplift

_Sizes = tuple[float, float, str]
"""Amplitude and swing (rad), and the name of the status."""


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Result of one model. Angles are in rad; they are NaN if the model has no result.

    Attributes:
        name: name of the model.
        amplitude: largest |phi| of the settled motion from rest, rad.
        swing: largest |psi| of this motion, rad.
        status: name of the status.
        seconds: computing time without compilation, s.
        first: computing time of the first solution, with compilation, s.
        neglects: text that says what the model neglects.
    """

    name: str
    """Name of the model."""
    amplitude: float
    """Largest |phi| of the settled motion from rest, rad."""
    swing: float
    """Largest |psi| of the settled motion from rest, rad."""
    status: str
    """Name of the status."""
    seconds: float
    """Computing time of a second solution, which needs no compilation, s."""
    first: float
    """Computing time of the first solution, s. It includes compilation, unless the model was compiled
    before."""
    neglects: str
    """Text that says what the model neglects."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Check(Printed):
    """Results of several models for one design, the fastest model first.

    Attributes:
        models: results of the models.
        limit: largest allowed swing, rad.
        without: nonlinear amplitude without the pendulum, rad.
    """

    models: tuple[Answer, ...]
    """Results of the models."""
    limit: float
    """Largest allowed swing, rad."""
    without: float
    """Nonlinear amplitude without the pendulum, rad. Infinite if the block overturns; NaN if the design has
    no pendulum."""

    @property
    def top(self) -> Answer:
        """Result of the nonlinear model."""
        return next(r for r in self.models if r.name == TOP)

    @property
    def objections(self) -> tuple[str, ...]:
        """Sentences that explain why the nonlinear model does not confirm the design; empty if they do."""
        return objections(self.top.amplitude, self.top.swing, self.top.status, self.limit, self.without)

    @property
    def lines(self) -> list[str]:
        """Lines of the table: the head, and one line for each model."""
        lines = [
            f"{'model':20}{'amplitude':>11}{'swing':>10}  {'status':13}{'time':>10}{'first':>9}  neglects"
        ]
        for r in self.models:
            # A model without a result has NaN, which the table shows as a dash.
            sizes = (
                f"{'-':>{w}}" if math.isnan(x) else f"{x:{w}.6f}"
                for x, w in ((r.amplitude, 11), (r.swing, 10))
            )
            times = f"{r.seconds * 1e3:7.2f} ms{r.first:7.1f} s"
            lines.append(f"{r.name:20}{''.join(sizes)}  {r.status:13}{times}  {r.neglects}")
        return lines

    def table(self) -> str:
        """Return a table with one line for each model, and its explanation."""
        return "\n".join([*self.lines, MEANING])

    def __str__(self) -> str:
        verdict = [f"objection: {x}" for x in self.objections] or ["no objection by the nonlinear model"]
        return "\n".join([self.table(), *verdict])


@checks.keywords
def check(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    swing_limit: checks.Real = math.inf,
    models: tuple[str, ...] | None = None,
    progress: Progress | bool | None = None,
) -> Check:
    """Solve a design from rest with all models.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: pendulum of the scene; None without a pendulum.
        swing_limit: largest allowed angle of the bob, rad.
        models: names of models, see `tpd.answers.compare_models.MODELS`; all by default. The nonlinear model
            is always included.
        progress: True for a progress bar on stderr, or a function that is called with ("checking", number of
            finished models, number of all models).

    Raises:
        ValueError: an unknown model, a limit that is not positive, traced or batched parameters, or a
            pendulum together with dimensionless parameters.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> comparison = tpd.check(p, swing_limit=0.5, models=("uplift", "exact", "nonlinear"))
        >>> [(r.name, r.status, round(r.amplitude, 4)) for r in comparison.models]
        [('uplift', 'lifts', nan), ('exact', 'rocking', 0.0552), ('nonlinear', 'rocking', 0.0554)]
        >>> len(comparison.objections)
        1
    """
    checks.require_x64()
    # The default, infinity, is no limit. It is not a valid value of the check below.
    if not (isinstance(swing_limit, float) and swing_limit == math.inf):
        swing_limit = checks.positive("swing_limit", swing_limit)
    models = MODELS if models is None else models
    checks.instance("models", models, (tuple, list))
    for name in models:
        checks.one_of("models", name, MODELS)
    setup = Setup.of(subject, pendulum)
    # Traced or batched parameters are rejected here, because the models are called one after the other.
    p, names = as_arrays(setup.at({})), [r for r in MODELS if r in models or r == TOP]
    rows = []
    with bar_for(progress) as report:
        for i, name in enumerate(names):
            rows.append(_timed(name, p))
            report("checking", i + 1, len(names))
    if not setup.has_pendulum:
        # The parameters then have a bob that is too light to act on the block. Its swing has no meaning.
        return Check(models=tuple(replace(r, swing=math.nan) for r in rows), limit=math.inf, without=math.nan)
    return Check(
        models=tuple(rows),
        limit=swing_limit,
        # The nonlinear amplitude without the pendulum, for the objection that the pendulum makes it worse.
        without=nonlinear(parameters_without_pendulum(subject))[0],
    )


def objections(amplitude: float, swing: float, status: str, limit: float, without: float) -> tuple[str, ...]:
    """Return sentences that explain why a nonlinear motion does not confirm a design.

    The reasons are: the motion does not settle, its swing exceeds the limit, or the block rocks less without
    the pendulum.

    Args:
        amplitude: settled tilt, rad.
        swing: settled angle of the bob, rad.
        status: name of the status.
        limit: largest allowed angle of the bob, rad.
        without: settled tilt without the pendulum, rad.
    """
    by, out = "by the nonlinear model", []
    # A motion that does not settle has no sizes to compare.
    if status not in names_of(SETTLED):
        return (f"{by} the motion ends {status}",)
    if swing > limit:
        out.append(f"{by} the swing is {swing:.4g} rad, above {limit:g}")
    # A block at rest with the pendulum cannot be worse than without.
    if amplitude > 0.0 and amplitude >= without:
        out.append(f"{by} the block rocks {amplitude:.4g} rad, and {without:.4g} without the pendulum")
    return tuple(out)


def nonlinear(p: Parameters) -> tuple[float, float, str]:
    """Return (amplitude, swing, status) with the nonlinear model from rest, without derivatives."""
    run = follow(Terms.nonlinear, row_of(p), HarmonicForcing())
    return float(run.settled_tilt), float(run.settled_swing), status_name(run.status)


def _timed(name: str, p: Parameters) -> Answer:
    """Return the result of one model, and its computing times with and without compilation."""
    neglects, solve = _MODELS[name]
    begin = time.perf_counter()
    # The first call includes compilation, the second does not.
    solve(p)
    middle = time.perf_counter()
    amplitude, swing, status = solve(p)
    times = {"first": middle - begin, "seconds": time.perf_counter() - middle}
    sizes = {"amplitude": amplitude, "swing": swing}
    return Answer(name=name, status=status, neglects=neglects, **sizes, **times)


_one_harmonic = eqx.filter_jit(one_harmonic)


def _at_rest(p: Parameters) -> _Sizes:
    lift = uplift(p)
    # The closed form gives no amplitude of a block that lifts.
    amplitude, status = (0.0, "rest") if lift.margin >= 0.0 else (math.nan, "lifts")
    return amplitude, float(lift.swing), status


def _balanced(p: Parameters) -> _Sizes:
    balance = _one_harmonic(p)
    if not bool(balance.exists):
        return math.nan, math.nan, "no_orbit"
    return float(balance.amplitude), float(balance.swing), "rocking"


def exact(p: Parameters) -> _Sizes:
    """Return (amplitude, swing, status) with the linear model from rest."""
    # A computation of JAX returns before it has ended, which would falsify the times.
    steady = jax.block_until_ready(steady_state(p))
    return float(steady.amplitude), float(steady.swing), status_name(steady.status)


MEANING = (
    "Amplitude and swing are the largest tilt and bob angle (rad) of the motion that each model reaches from "
    "rest. If they differ from those of the nonlinear model, the terms that a model neglects are important."
)
"""Explanation of the table of models."""
TOP = "nonlinear"
"""Name of the model with which the others are compared."""
_MODELS: dict[str, tuple[str, Callable[[Parameters], _Sizes]]] = {
    "uplift": ("everything except the steady swing of the bob under a block at rest", _at_rest),
    "one harmonic": ("all harmonics but one", _balanced),
    "exact": ("terms of second order in the angles", exact),
    TOP: ("nothing of equations (4)", nonlinear),
}
"""Models by name: the terms that a model neglects, and the function that solves it."""
MODELS = tuple(_MODELS)
"""Names of all models, the fastest first."""
