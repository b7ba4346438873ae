"""Amplitude, stroke, status and uplift margin of the designs on a grid of any two numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tpd.answers.symmetric_orbits import Orbits, all_symmetric_orbits
from tpd.cluster.cluster import Cluster, check_where
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular, counted, span
from tpd.core.progress import shown_count
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing, follow
from tpd.models.settling import scale_of
from tpd.scene.parameters import NAMES, Parameters, from_row
from tpd.scene.quantities import UNITS, Setup
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status, code_of, is_one_of, names_of
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import uplift

_MATCH = 1e-3
"""Largest distance, in shares of the scales, between a followed motion and the orbit that it is on."""
_CHUNK, _CHUNK_FOLLOWED = 16_384, 2048
"""Designs in a chunk for a cluster, without and with a start: some tenths of a second of work."""
_CHOICE = (
    *(Status.rocking, Status.near_fold, Status.grazing, Status.rest),
    *(Status.neutral, Status.unstable, Status.not_known),
)
"""Statuses in the order in which one of them becomes the answer where no start is given."""


@dataclass(frozen=True, kw_only=True, repr=False)
class DesignMap(Printed, Tabular):
    """A grid of designs: arrays (ny, nx), row by row along y. Angles in rad."""

    x_name: str
    x: np.ndarray
    """(nx,), in SI units if `x_name` is one of a scene's quantities."""
    y_name: str
    y: np.ndarray
    """(ny,)"""
    start: tuple[float, ...] | None
    """State at tau = 0 that the designs were followed from; None where none was asked for."""
    amplitude: np.ndarray
    """Largest |phi| of the motion that `design_map` describes. Infinite where the block overturns."""
    swing: np.ndarray
    """Largest |psi| of this motion. Without a pendulum, that of a bob too light to be felt."""
    status: np.ndarray
    """Names of statuses."""
    margin: np.ndarray
    """Uplift margin: where positive, a block at rest under the settled pendulum stays at rest."""
    exact: np.ndarray
    """Whether amplitude and stroke are exact to rounding. Elsewhere the motion was followed until it repeated
    within 1e-6 of nu (amplitude) and of nu + f (stroke), or until its periods ended."""
    overflow: np.ndarray
    """Whether a design may have more orbits than were solved for."""

    @property
    def counts(self) -> dict[str, int]:
        """Number of designs of each status, the most frequent first."""
        names, counts = np.unique(self.status, return_counts=True)
        return {str(names[i]): int(counts[i]) for i in np.argsort(-counts, kind="stable")}

    def columns(self) -> dict[str, Any]:
        """A row for every design: both numbers, status, sizes in rad and uplift margin."""
        x, y = np.meshgrid(self.x, self.y)
        names = {"amplitude": "amplitude_rad", "swing": "swing_rad", "margin": "uplift_margin"}
        fields = ("status", "amplitude", "swing", "margin", "exact", "overflow")
        columns = {names.get(n, n): getattr(self, n).ravel() for n in fields}
        return {self.x_name: x.ravel(), self.y_name: y.ravel()} | columns

    def __str__(self) -> str:
        lines = ["Design map" if self.start is None else f"Design map from the start {self.start}"]
        for name, values in ((self.x_name, self.x), (self.y_name, self.y)):
            lines.append(f"  {name:15} {len(values)} values, {span(values, UNITS.get(name, ''))}")
        sizes = {"amplitude": "rad", "swing": "rad", "margin": ""}
        lines.append(f"  {'status':15} {counted(self.status)}")
        return "\n".join([*lines, *(f"  {n:15} {span(getattr(self, n), u)}" for n, u in sizes.items())])


def design_map(
    subject: Parameters | Scene,
    x: tuple[str, Any],
    y: tuple[str, Any],
    *,
    pendulum: Pendulum | None = None,
    start: Any = None,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> DesignMap:
    """The motion of every design on a grid of two parameters, or of two quantities of a scene.

    Without a `start` the answer is the largest attracting motion among the symmetric period-one orbits
    that `symmetric_orbits` finds and rest, each known in closed form (some 15 µs a design and core). Other
    motions may attract as well. Its status is

    - rocking: this orbit attracts; the block may rest or rock less as well, from another start;
    - near_fold, grazing: this orbit attracts, but is about to be lost;
    - rest: no orbit that was found attracts, and a block at rest stays at rest; the amplitude is zero, and
      the stroke is that of the bob under the resting block;
    - neutral: an orbit was found, but nothing takes energy from it, so that it does not attract;
    - unstable: orbits were found, but all repel, and a block at rest lifts: the block settles into another
      motion, which depends on the start. Amplitude and stroke are those of the largest orbit;
    - not_known: no orbit was found, which does not prove that there is none, and a block at rest lifts;
      amplitude and stroke are NaN. A `start` shows what the block settles into.

    With a `start` every design is followed from it by events (some 0.6 ms a design) until the motion
    repeats: rocking, sticking, rest, held, overturned (infinite), not_settled, event_bound or failed, as in
    `steady_state`, which alone separates aperiodic motions from those not settled. Where the motion is a
    symmetric period-one orbit its exact sizes are given; see `DesignMap.exact`.

    Args:
        subject: dimensionless parameters, or a scene; its values of the two names are not used.
        x: a name, see `tpd.answers.bifurcations`, and its values, shape (nx,), increasing. A name in SI units
            can be combined with a parameter that it does not move; the other parameters are held then.
        y: name and values of the other axis, shape (ny,).
        pendulum: in the scene; default none.
        start: (phi, psi, phi', psi') at tau = 0 in rad and rad per unit tau; zeros are from rest.
        cluster: processes or machines in place of threads.
        progress: True for a bar on stderr, or called with (designs done, of how many).

    Raises:
        ValueError: unknown names or two that move the same, batched parameters, or values that do not
            increase or lie outside their range.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    check_where(None, cluster)
    setup = Setup.of(subject, pendulum)
    (x_name, xs), (y_name, ys) = _line(setup, "x", x), _line(setup, "y", y)
    _check_together(setup, {x_name: xs, y_name: ys})
    # All designs on the grid, row by row, leaves of shape (ny nx,).
    across, up = np.meshgrid(xs, ys)
    vector = setup.vector({x_name: across.ravel(), y_name: up.ravel()})
    designs = from_row([jnp.broadcast_to(jnp.asarray(v), across.size) for v in vector])
    wanted = "four numbers (phi, psi, phi', psi')"
    y0 = None if start is None else checks.array("start", start, (4,), wanted)
    with shown_count(progress, "mapping") as report:
        if cluster is None:
            answer = _answers(designs, y0, None, report)
        else:
            chunk = _CHUNK_FOLLOWED if y0 is not None else _CHUNK
            answer = cluster.map("map", _answers, designs, (y0,), chunk=chunk, progress=report)
    answer["status"] = names_of(answer["status"])
    shaped = {n: v.reshape(len(ys), len(xs)) for n, v in answer.items()}
    at = None if y0 is None else tuple(map(float, y0))
    return DesignMap(x_name=x_name, x=xs, y_name=y_name, y=ys, start=at, **shaped)


def _answers(
    designs: Parameters, y0: np.ndarray | None, workers: int | None = 1, progress: Any = None
) -> dict[str, np.ndarray]:
    """Fields of `DesignMap` of designs, flat, statuses by their codes; in one thread on a cluster, whose
    processes share the cores."""
    still = {n: np.asarray(v) for n, v in uplift(designs)._asdict().items()}
    # The bar is that of the longer part: of the motions, where there are any.
    orbits = all_symmetric_orbits(designs, workers=workers, progress=progress if y0 is None else None)
    if y0 is None:
        answer = _largest(orbits, still["margin"], still["swing"])
    else:
        how = {"workers": workers, "progress": progress}
        answer = _followed(designs, orbits, still["swing"], y0, how)
    return {**answer, "margin": still["margin"], "overflow": np.asarray(orbits.overflow)}


def _line(setup: Setup, argument: str, axis: tuple[str, Any]) -> tuple[str, np.ndarray]:
    """The name and values of one axis, checked."""
    if not (isinstance(axis, (tuple, list)) and len(axis) == 2):
        raise ValueError(f"`{argument}` must be a name and its values, but is {checks.shown(axis)}")
    name, values = axis[0], checks.increasing(f"values of {argument}", axis[1])
    setup.check_name(argument, name)
    for value in (values[0], values[-1]):
        setup.check_sign(name, float(value))
    setup.check_plausible(name, values)
    return name, values


def _check_together(setup: Setup, lines: dict[str, np.ndarray]) -> None:
    """`ValueError` for two axes that move the same, or corners of the grid that are out of range."""
    if len(lines) < 2:
        raise ValueError(f"`x` and `y` must differ, but both are {next(iter(lines))!r}")
    # A quantity and a parameter that it moves would both set this parameter.
    for name, other in (tuple(lines), tuple(lines)[::-1]):
        if other in NAMES and other in setup.moved(name):
            raise ValueError(f"`x` and `y` must not both move {other}, but {name!r} does so as well")
    (x, xs), (y, ys) = lines.items()
    # Each parameter with a range is monotonic in each quantity, so that the corners decide for the grid.
    for corner in ((i, j) for i in (0, -1) for j in (0, -1)):
        setup.at({x: float(xs[corner[0]]), y: float(ys[corner[1]])})


def _largest(orbits: Orbits, margin: np.ndarray, reach: np.ndarray) -> dict[str, np.ndarray]:
    """The answers where no start is given: one of the orbits of each design, or rest."""
    resting = np.where(margin > 0.0, code_of(Status.rest), code_of(Status.not_known))[:, None]
    codes = np.concatenate([code_of(orbits.status), resting], axis=1)
    amplitude = np.concatenate([orbits.amplitude, np.where(margin > 0.0, 0.0, np.nan)[:, None]], axis=1)
    swing = np.concatenate([orbits.swing, np.where(margin > 0.0, reach, np.nan)[:, None]], axis=1)
    place = np.select(
        [codes == code_of(status) for status in _CHOICE], list(range(len(_CHOICE))), len(_CHOICE)
    )
    # Orbits are sorted by amplitude, the largest first, and `argmin` returns the first minimum: the largest
    # orbit of the best status.
    best = np.argmin(place, axis=1)[:, None]
    taken = {"amplitude": amplitude, "swing": swing, "status": codes}
    chosen = {n: np.take_along_axis(v, best, axis=1)[:, 0] for n, v in taken.items()}
    return {**chosen, "exact": np.ones(len(margin), bool)}


def _followed(
    p: Parameters, orbits: Orbits, reach: np.ndarray, y0: np.ndarray, how: dict[str, Any]
) -> dict[str, np.ndarray]:
    """The answers from a start: sizes of the orbit that the motion is on, or those of the motion itself."""
    n = len(np.asarray(p.nu))
    forcing = HarmonicForcing()
    settled = follow(Terms.linear, row_of(p), forcing, y0=np.tile(y0, (n, 1)), **how)
    codes = np.asarray(code_of(settled.status))
    overturned, rocking = codes == code_of(Status.overturned), code_of(Status.rocking)
    amplitude = np.where(overturned, math.inf, np.asarray(settled.amplitude))
    swing = np.where(overturned, math.inf, np.asarray(settled.swing))
    # Without damping the bob rings for ever, and its reach depends on how the block came to rest.
    swing = np.where((codes == code_of(Status.rest)) & (np.asarray(p.zeta) > 0.0), reach, swing)
    scale = np.asarray(jax.vmap(scale_of)(p))
    # A followed motion ends near its orbit, not on it; the orbit's own sizes are exact.
    apart = np.abs(np.asarray(orbits.state) - np.asarray(settled.y)[:, None]) / scale[:, None]
    apart = np.where(np.asarray(code_of(orbits.status)) == rocking, apart.max(axis=-1), np.inf)
    nearest = np.argmin(apart, axis=1)
    alike = (codes == rocking) & (np.asarray(settled.periods) == 1)
    on = alike & (apart[np.arange(n), nearest] < _MATCH)
    return {
        "amplitude": np.where(on, orbits.amplitude[np.arange(n), nearest], amplitude),
        "swing": np.where(on, orbits.swing[np.arange(n), nearest], swing),
        "status": codes,
        "exact": on | is_one_of(codes, Status.rest, Status.overturned),
    }
