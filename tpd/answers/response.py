"""Amplitude and stroke against frequency: all branches of orbits, and the motions settled into from rest."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from tpd.answers.bifurcations import Bifurcation, Sweep, along, bifurcations
from tpd.answers.runs import follow_runs
from tpd.answers.statistics import Share
from tpd.answers.steady_state import steady_state
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular, counted, span
from tpd.core.progress import Progress, shown
from tpd.exact.runs import HarmonicForcing
from tpd.scene.parameters import Parameters, as_arrays, from_row
from tpd.scene.quantities import UNITS, Axis
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import status_name
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import uplift

_TOWARDS = np.geomspace(1e-5, 0.5, 12)
"""Distances of further values from a bifurcation, in spacings of the sweep. At a fold the amplitude turns
round like a square root: an even spacing would cut the tip off."""
_STEP, _STEPS = 0.004, 12
"""Relative distance of frequencies next to the scene's own, and their number to either side."""

_BETWEEN, _NEAR = 0.002, 0.05
"""Natural logarithm of the ratio of one run's value to that of the run before, and the share of a value by
which the runs near it differ from it at most."""
BAND = (0.7, 1.5)
"""Ends of the range of nearby frequencies, over the scene's own frequency."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Branches(Printed, Tabular):
    """The symmetric period-one orbits, and the resting block, over one frequency, parameter or quantity."""

    sweep: Sweep
    """The orbits; `sweep.line(i)` is one branch. Its values crowd towards the bifurcations."""
    bifurcations: tuple[Bifurcation, ...]
    """Places where orbits fold, lose their symmetry, stick or graze."""
    margin: np.ndarray
    """(n,), uplift margin at the values of the sweep: where positive, a block at rest stays at rest."""
    rest_swing: np.ndarray
    """(n,), the bob's largest angle under a resting block, rad."""
    has_pendulum: bool
    """Whether there is a pendulum; without one strokes are those of a bob too light to be felt."""

    @property
    def name(self) -> str:
        """Name of the parameter or quantity that varies."""
        return self.sweep.name

    def columns(self) -> dict[str, Any]:
        """A row for every orbit: branch, value of the name, status, and sizes in rad."""
        s = self.sweep
        at = [np.array(s.line(i)) for i in range(s.branches)]
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
            lines.append(f"  {at} there were more orbits than places")
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
    """The branches of symmetric period-one orbits, stable and unstable, and the bifurcations that end them.

    `branches(scene, "frequency", 1.0, 5.0)` is the response at constant base amplitude, in Hz;
    `branches(p, "xi", 1.0, 5.0)` is the response at constant base acceleration f. Orbits that lean, stick
    or repeat after several periods are not among them: see `settled_response`.

    Args:
        subject: dimensionless parameters, or a scene; its value of `name` is not used.
        name: parameter or quantity that varies, see `tpd.answers.bifurcations`.
        low: lower end of its range.
        high: upper end.
        pendulum: in the scene; default none.
        samples: values evenly spaced, 8 or more; some are added next to the bifurcations.

    Raises:
        ValueError: an unknown name, batched parameters, no interval, values out of range, or fewer
            than 8 samples.
        RuntimeError: JAX is in 32-bit mode.
    """
    low, high = checks.interval("(low, high)", (low, high), -math.inf, math.inf)
    samples = checks.count("samples", samples, 8, 100_000)
    found = tuple(bifurcations(subject, name, low, high, samples=samples, pendulum=pendulum))
    axis = Axis.of(subject, name, pendulum)
    near = (high - low) / (samples - 1) * np.concatenate([-_TOWARDS, _TOWARDS])
    # Far from a bifurcation branches are smooth, and the even spacing is enough.
    beside = [b.value + near for b in found]
    grid = np.unique(np.concatenate([np.linspace(low, high, samples), *beside]))
    grid = grid[(grid >= low) & (grid <= high)]
    still = uplift(from_row(list(jnp.asarray(axis.at(grid).T))))
    return Branches(
        sweep=along(axis, grid),
        bifurcations=found,
        margin=np.asarray(still.margin),
        rest_swing=np.asarray(still.swing),
        has_pendulum=axis.setup.has_pendulum,
    )


def frequencies(own: float, low: float, high: float, count: int) -> np.ndarray:
    """Values from `low` to `high`, evenly spaced, and every 0.4 % within 5 % of `own`, if that is between.

    A pendulum is tuned: where a design is worth nothing is likely to be near its own frequency.
    """
    near = own * (1.0 + _STEP * np.arange(-_STEPS, _STEPS + 1))
    near = near[(near >= low) & (near <= high)]
    coarse = np.linspace(low, high, count)
    coarse = coarse[np.abs(coarse / own - 1.0) > _STEP * (_STEPS + 0.5)]
    return np.unique(np.concatenate([coarse, near]))


@dataclass(frozen=True, kw_only=True, repr=False)
class Response(Printed, Tabular):
    """Motions settled into from rest over a frequency, or another quantity `name`: arrays (n,)."""

    frequency: np.ndarray
    """Hz, or values of `name`."""
    amplitude: np.ndarray
    """Settled |phi| from rest, rad; infinite where the block overturns."""
    swing: np.ndarray
    """Settled |psi|, rad."""
    status: np.ndarray
    """Names of the steady states' statuses."""
    name: str = "frequency"
    runs: np.ndarray | None = None
    """Runs from rest near the values, (2, m): the value of each run, and 1 if the block overturns, 0 if it
    does not, NaN without an answer. A run's value is a power of the same number in every response, so that
    two responses count the same runs. None of another quantity than the frequency."""

    def share_overturned(self, low: float, high: float) -> Share:
        """Share of the runs from rest between two values in which the block overturns."""
        value, overturned = np.zeros((2, 0)) if self.runs is None else self.runs
        inside = (value >= low) & (value <= high) & np.isfinite(overturned)
        return Share.of(overturned[inside] == 1.0)

    @property
    def overturning(self) -> np.ndarray:
        """Share of the runs from rest within 5 % of each value that overturn, and its 95 % interval, (3, n);
        NaN between 0 and 1 without runs."""
        each = [self.share_overturned(*window(x)) for x in self.frequency]
        return np.reshape(each, (-1, 3)).T

    def between(self, low: float, high: float) -> Response:
        """The part of this response from the value `low` to `high`, with all runs."""
        close = (self.frequency >= low) & (self.frequency <= high)
        names = ("frequency", "amplitude", "swing", "status")
        return replace(self, **{n: getattr(self, n)[close] for n in names})

    def columns(self) -> dict[str, Any]:
        """A row for every value: status, sizes in rad, share of the runs near it that overturn."""
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
    """The motion that the block settles into from rest, over one parameter or quantity.

    Each value is solved by `steady_state`, so that amplitudes are exact: some 20 ms a value. For thousands of
    designs see `tpd.design_map`.

    Args:
        subject: dimensionless parameters, or a scene; its value of `name` is not used.
        name: parameter or quantity that varies, see `tpd.answers.bifurcations`.
        values: shape (n,), in any order.
        pendulum: in the scene; default none.
        progress: True for a bar on stderr, or called with ("responding", values done, of how many).

    Raises:
        ValueError: an unknown name, batched parameters, or a value out of range.
        RuntimeError: JAX is in 32-bit mode.
    """
    axis = Axis.of(subject, name, pendulum)
    listed = [values] if np.ndim(values) == 0 else values
    line = checks.array("values", listed, (-1,), "one or more numbers")
    axis.check(*line)
    found = []
    with shown(progress) as report:
        # One value after the other: in a batch all values would wait for the slowest transient.
        for i, value in enumerate(line):
            steady = steady_state(as_arrays(axis.setup.at({axis.name: float(value)})))
            found.append((float(steady.amplitude), float(steady.swing), status_name(steady.status)))
            report("responding", i + 1, len(line))
    amplitude, swing, status = map(np.array, zip(*found, strict=True))
    return Response(
        frequency=line,
        amplitude=amplitude,
        swing=swing,
        status=status,
        name=axis.name,
        runs=_runs_near(axis, line) if axis.name in ("frequency", "xi") else None,
    )


def window(value: float) -> tuple[float, float]:
    """Return the range of the runs that are near a value."""
    return value * (1.0 - _NEAR), value * (1.0 + _NEAR)


def _runs_near(axis: Axis, line: np.ndarray) -> np.ndarray:
    """See `Response.runs`."""
    # Next to overturning a change of a thousandth decides: one run at each value says little.
    low, high = window(line.min())[0], window(line.max())[1]
    # The same numbers whatever the range is: the report and `tpd response` have ranges of their own.
    first, last = math.ceil(math.log(low) / _BETWEEN), math.floor(math.log(high) / _BETWEEN)
    fine = np.exp(_BETWEEN * np.arange(first, last + 1))
    runs = follow_runs(Terms.linear, axis.at(fine), HarmonicForcing())
    return np.stack([fine, np.where(runs.is_unanswered, np.nan, runs.is_overturned)])
