"""Response over frequency: all branches of orbits, and the motions that a block settles into from rest."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from tpd.answers.bifurcations import Bifurcation, Sweep, along, bifurcations
from tpd.answers.run_table import follow_runs
from tpd.answers.statistics import Share
from tpd.answers.steady_state import steady_state
from tpd.compiled.simulate import HarmonicForcing
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular, counted, span
from tpd.core.progress import Progress, bar_for
from tpd.scene.parameters import Parameters, as_arrays, from_row
from tpd.scene.quantities import UNITS, Axis
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import status_name
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import uplift

_DISTANCES = np.geomspace(1e-5, 0.5, 12)
"""Distances of additional values from a bifurcation, in steps of the sweep. At a fold the amplitude changes
like a square root, so equal steps would miss the end of the branch."""
_STEP, _STEPS = 0.004, 12
"""Relative step of additional frequencies near the natural frequency, and their number on either side."""

_LOG_STEP, _WINDOW = 0.002, 0.05
"""Step between the frequencies of neighbouring runs, in the natural logarithm, and largest relative
difference between a frequency and the runs near it."""
BAND = (0.7, 1.5)
"""Lower and upper end of the nearby frequencies, relative to the frequency of the scene."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Branches(Printed, Tabular):
    """Symmetric period-one orbits and the block at rest, over a frequency, a parameter or a quantity.

    Attributes:
        sweep: orbits at the values; its values are denser near the bifurcations.
        bifurcations: values at which orbits end or change.
        margin: uplift margin at the values of the sweep, shape (n,).
        rest_swing: largest bob angle under a block at rest, rad, shape (n,).
        has_pendulum: whether the block has a pendulum.
    """

    sweep: Sweep
    """Orbits at the values; `sweep.line(i)` is one branch. The values are denser near the bifurcations."""
    bifurcations: tuple[Bifurcation, ...]
    """Values at which orbits fold, lose their symmetry, stick or graze."""
    margin: np.ndarray
    """Uplift margin at the values of the sweep, shape (n,). Where it is positive, a block at rest does not
    lift."""
    rest_swing: np.ndarray
    """Largest bob angle under a block at rest, rad, shape (n,)."""
    has_pendulum: bool
    """Whether the block has a pendulum. Without a pendulum the swing is that of a bob that is too light to
    act on the block."""

    @property
    def name(self) -> str:
        """Name of the varying parameter or quantity."""
        return self.sweep.name

    def columns(self) -> dict[str, Any]:
        """Columns of a table with a row for each orbit: branch, value, status, and angles in rad."""
        s = self.sweep
        at = [np.array(s.line(i)) for i in range(s.branches)]
        # Each branch has its own rows and columns; the table lists one branch after the other.
        branch = np.repeat(np.arange(len(at)), [places.shape[1] for places in at])
        i, j = np.concatenate([np.zeros((2, 0), int), *at], axis=1)
        sizes = {f"{n}_rad": getattr(s, n)[i, j] for n in ("amplitude", "swing", "phase")}
        return {"branch": branch, self.name: s.value[i], "status": s.status[i, j], **sizes}

    def __str__(self) -> str:
        s, unit = self.sweep, f" {UNITS.get(self.name, '')}".rstrip()
        lines = [f"{s.branches} branches from {s.value[0]:.4g} to {s.value[-1]:.4g}{unit}"]
        lines += [f"  {b}" for b in self.bifurcations]
        if s.overflow.any():
            at = f"at {int(s.overflow.sum())} of {len(s.value)} values"
            lines.append(f"  there may be more orbits than those listed {at}")
        return "\n".join(lines)


def branches(
    subject: Parameters | Scene,
    name: str,
    low: checks.Real,
    high: checks.Real,
    *,
    pendulum: Pendulum | None = None,
    samples: checks.Whole = 400,
) -> Branches:
    """Compute the branches of symmetric period-one orbits, stable and unstable, and their bifurcations.

    `branches(scene, "frequency", 1.0, 5.0)` is the response at constant amplitude of the base, in Hz.
    `branches(p, "xi", 1.0, 5.0)` is the response at a constant base acceleration f. Orbits that are
    asymmetric, stick, or repeat after several periods are not included: see `settled_response`.

    Args:
        subject: dimensionless parameters, or a scene. Its own value of `name` is not used.
        name: name of the varying parameter or quantity, see `tpd.answers.bifurcations`.
        low: lower end of the range.
        high: upper end of the range.
        pendulum: pendulum of the scene; None without a pendulum.
        samples: number of evenly spaced values, at least 8. Values near the bifurcations are added.

    Raises:
        ValueError: an unknown name, batched parameters, an empty interval, values out of range, or fewer
            than 8 samples.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.0, lam=0.5, zeta=0.1, k=0.05, f=0.1, xi=2.0)
        >>> response = tpd.branches(p, "xi", 1.0, 1.5, samples=20)
        >>> response.sweep.branches
        2
        >>> [b.kind.value for b in response.bifurcations]
        ['symmetry_breaking', 'sticking']
    """
    low, high = checks.interval("(low, high)", (low, high), -math.inf, math.inf)
    samples = checks.count("samples", samples, 8, 100_000)
    points = tuple(bifurcations(subject, name, low, high, samples=samples, pendulum=pendulum))
    axis = Axis.of(subject, name, pendulum)
    # Additional values on both sides of each bifurcation, at fractions of the step of the sweep.
    near = (high - low) / (samples - 1) * np.concatenate([-_DISTANCES, _DISTANCES])
    # Far from a bifurcation the branches are smooth, and equal steps are sufficient.
    beside = [b.value + near for b in points]
    grid = np.unique(np.concatenate([np.linspace(low, high, samples), *beside]))
    grid = grid[(grid >= low) & (grid <= high)]
    # The closed form of the block at rest, at all values at once.
    still = uplift(from_row(list(jnp.asarray(axis.at(grid).T))))
    return Branches(
        sweep=along(axis, grid),
        bifurcations=points,
        margin=np.asarray(still.margin),
        rest_swing=np.asarray(still.swing),
        has_pendulum=axis.setup.has_pendulum,
    )


def frequencies(own: float, low: float, high: float, count: int) -> np.ndarray:
    """Return values from `low` to `high`, evenly spaced, and with a step of 0.4 % within 5 % of `own`.

    `own` is the natural frequency of the pendulum. A design that fails at some frequency is likely to fail
    near its natural frequency, because a pendulum is tuned.
    """
    near = own * (1.0 + _STEP * np.arange(-_STEPS, _STEPS + 1))
    near = near[(near >= low) & (near <= high)]
    coarse = np.linspace(low, high, count)
    # Values of the coarse grid inside the fine one are removed.
    coarse = coarse[np.abs(coarse / own - 1.0) > _STEP * (_STEPS + 0.5)]
    return np.unique(np.concatenate([coarse, near]))


@dataclass(frozen=True, kw_only=True, repr=False)
class Response(Printed, Tabular):
    """Motions that a block settles into from rest, over a frequency or another quantity.

    Arrays have the shape (n,).

    Attributes:
        frequency: values in Hz, or values of `name`.
        amplitude: settled |phi|, rad; infinite if the block overturns.
        swing: settled |psi|, rad.
        status: names of the statuses.
        name: name of the varying parameter or quantity.
        runs: runs from rest near the values, shape (2, m); None if the frequency does not vary.
    """

    frequency: np.ndarray
    """Values in Hz, or values of `name`."""
    amplitude: np.ndarray
    """Settled |phi| from rest, rad; infinite if the block overturns."""
    swing: np.ndarray
    """Settled |psi|, rad."""
    status: np.ndarray
    """Names of the statuses of the steady states."""
    name: str = "frequency"
    """Name of the varying parameter or quantity."""
    runs: np.ndarray | None = None
    """Runs from rest near the values, shape (2, m). The first row has the frequency of each run, the second
    row 1 if the block overturns, 0 if it does not, and NaN without a result. The frequencies are powers of
    one number, which is the same in every response, so two responses count the same runs. None if
    another quantity than the frequency varies."""

    def share_overturned(self, low: float, high: float) -> Share:
        """Return the share of the runs from rest between two frequencies in which the block overturns."""
        # Without runs the share is unknown, see `Share.of`.
        value, overturned = np.zeros((2, 0)) if self.runs is None else self.runs
        inside = (value >= low) & (value <= high) & np.isfinite(overturned)
        return Share.of(overturned[inside] == 1.0)

    @property
    def overturning(self) -> np.ndarray:
        """Share of the runs from rest within 5 % of each value that overturn, with its 95 % interval, (3, n).

        Without runs the share is NaN and the interval is 0 to 1.
        """
        each = [self.share_overturned(*window(x)) for x in self.frequency]
        return np.reshape(each, (-1, 3)).T

    def between(self, low: float, high: float) -> Response:
        """Return the part of this response from the value `low` to the value `high`, with all runs."""
        close = (self.frequency >= low) & (self.frequency <= high)
        names = ("frequency", "amplitude", "swing", "status")
        # The runs are kept, because those near the ends belong to values inside the range.
        return replace(self, **{n: getattr(self, n)[close] for n in names})

    def columns(self) -> dict[str, Any]:
        """Columns of a table with a row for each value: status, angles in rad, share of overturned runs."""
        names = ("share_overturned", "share_low", "share_high")
        shares = {} if self.runs is None else dict(zip(names, self.overturning, strict=True))
        sizes = {"amplitude_rad": self.amplitude, "swing_rad": self.swing}
        return {self.name: self.frequency, "status": self.status, **sizes, **shares}

    def __str__(self) -> str:
        over = f"{len(self.frequency)} values, {span(self.frequency, UNITS.get(self.name, ''))}"
        head = f"Response from rest over {self.name}: {over}\n  status      {counted(self.status)}"
        sizes = f"  amplitude   {span(self.amplitude, 'rad')}\n  swing       {span(self.swing, 'rad')}"
        return f"{head}\n{sizes}"


def settled_response(
    subject: Parameters | Scene,
    name: str,
    values: Any,
    *,
    pendulum: Pendulum | None = None,
    progress: Progress | bool | None = None,
) -> Response:
    """Compute the motions that a block settles into from rest, over one parameter or quantity.

    `steady_state` solves each value in about 20 ms, so the amplitudes are exact. For thousands of
    designs see `tpd.design_map`.

    Args:
        subject: dimensionless parameters, or a scene. Its own value of `name` is not used.
        name: name of the varying parameter or quantity, see `tpd.answers.bifurcations`.
        values: values in any order, shape (n,).
        pendulum: pendulum of the scene; None without a pendulum.
        progress: True for a progress bar on stderr, or a function that is called with ("responding",
            number of computed values, number of all values).

    Raises:
        ValueError: an unknown name, batched parameters, or a value out of range.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> response = tpd.settled_response(p, "xi", [3.0, 4.0, 5.0])
        >>> [str(status) for status in response.status]
        ['rocking', 'rocking', 'rocking']
        >>> [round(float(amplitude), 4) for amplitude in response.amplitude]
        [0.0552, 0.0324, 0.0212]
    """
    axis = Axis.of(subject, name, pendulum)
    listed = [values] if np.ndim(values) == 0 else values
    line = checks.array("values", listed, (-1,), "one or more numbers")
    axis.check(*line)
    rows = []
    with bar_for(progress) as report:
        # One value after the other, because in a batch all values would wait for the slowest transient.
        for i, value in enumerate(line):
            steady = steady_state(as_arrays(axis.setup.at({axis.name: float(value)})))
            rows.append((float(steady.amplitude), float(steady.swing), status_name(steady.status)))
            report("responding", i + 1, len(line))
    amplitude, swing, status = map(np.array, zip(*rows, strict=True))
    return Response(
        frequency=line,
        amplitude=amplitude,
        swing=swing,
        status=status,
        name=axis.name,
        # Only responses over the frequency have runs near each value.
        runs=_runs_near(axis, line) if axis.name in ("frequency", "xi") else None,
    )


def window(value: float) -> tuple[float, float]:
    """Return the range of the frequencies of the runs near a value."""
    return value * (1.0 - _WINDOW), value * (1.0 + _WINDOW)


def _runs_near(axis: Axis, line: np.ndarray) -> np.ndarray:
    """Follow runs from rest near the values, see `Response.runs`."""
    # Next to overturning a change of the frequency by a thousandth is decisive, so one run at each value
    # says little.
    low, high = window(line.min())[0], window(line.max())[1]
    # The frequencies are on a fixed grid. The report and `tpd response`, whose ranges differ, therefore
    # follow the same runs.
    first, last = math.ceil(math.log(low) / _LOG_STEP), math.floor(math.log(high) / _LOG_STEP)
    fine = np.exp(_LOG_STEP * np.arange(first, last + 1))
    runs = follow_runs(Terms.linear, axis.at(fine), HarmonicForcing())
    return np.stack([fine, np.where(runs.is_unanswered, np.nan, runs.is_overturned)])
