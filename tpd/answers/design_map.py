"""Amplitude, swing, status and uplift margin of designs on a grid of any two parameters or quantities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from tpd.answers.symmetric_orbits import Orbits, all_symmetric_orbits
from tpd.compiled.rows import row_of
from tpd.compiled.simulate import HarmonicForcing, follow
from tpd.core import checks
from tpd.core.formatting import Printed, Tabular, counted, span
from tpd.core.progress import count_for
from tpd.models.base import scale_of
from tpd.scene.parameters import NAMES, Parameters, from_row
from tpd.scene.quantities import UNITS, Setup, named
from tpd.scene.scene import Pendulum, Scene
from tpd.scene.status import Status, code_of, is_one_of, names_of
from tpd.theory.equations import Terms
from tpd.theory.no_uplift import uplift

_MATCH = 1e-3
"""Largest distance between a motion and the orbit to which it belongs, relative to the scale of the state."""
_CHOICE = (
    *(Status.rocking, Status.near_fold, Status.grazing, Status.rest),
    *(Status.neutral, Status.unstable, Status.not_known),
)
"""Statuses in order of priority, for designs without an initial state."""


@dataclass(frozen=True, kw_only=True, repr=False)
class DesignMap(Printed, Tabular):
    """Motions of the designs on a grid. Arrays have the shape (ny, nx): one row for each y. Angles in rad.

    Attributes:
        x_name, y_name: names of the two parameters or quantities.
        x, y: their values, shapes (nx,) and (ny,).
        start: initial state of all designs; None if there is none.
        amplitude: largest |phi|; infinite if the block overturns.
        swing: largest |psi|.
        status: names of the statuses.
        margin: uplift margin.
        exact: whether amplitude and swing are exact except for rounding.
        overflow: whether a design may have more orbits than the solved ones.
    """

    x_name: str
    """Name of the parameter or quantity along x."""
    x: np.ndarray
    """Values along x, shape (nx,); in SI units if `x_name` is a quantity of a scene."""
    y_name: str
    """Name of the parameter or quantity along y."""
    y: np.ndarray
    """Values along y, shape (ny,)."""
    start: tuple[float, ...] | None
    """Initial state at tau = 0 of all designs; None if there is none."""
    amplitude: np.ndarray
    """Largest |phi| of the motion that `design_map` describes; infinite if the block overturns."""
    swing: np.ndarray
    """Largest |psi| of this motion. Without a pendulum it is that of a bob too light to act on the block."""
    status: np.ndarray
    """Names of the statuses."""
    margin: np.ndarray
    """Uplift margin. Where it is positive, a block at rest under the settled pendulum does not lift."""
    exact: np.ndarray
    """Whether amplitude and swing are exact except for rounding. Otherwise the motion was followed until it
    repeated within 1e-6 of nu (amplitude) and of nu + f (swing), or until the largest number of periods."""
    overflow: np.ndarray
    """Whether a design may have more orbits than the solved ones."""

    @property
    def counts(self) -> dict[str, int]:
        """Number of designs of each status, the most frequent status first."""
        names, counts = np.unique(self.status, return_counts=True)
        # `np.unique` sorts the names, and a stable sort keeps this order where counts are equal.
        return {str(names[i]): int(counts[i]) for i in np.argsort(-counts, kind="stable")}

    def columns(self) -> dict[str, Any]:
        """Columns of a table with a row for each design: x, y, status, angles in rad and uplift margin."""
        x, y = np.meshgrid(self.x, self.y)
        names = {"amplitude": "amplitude_rad", "swing": "swing_rad", "margin": "uplift_margin"}
        fields = ("status", "amplitude", "swing", "margin", "exact", "overflow")
        columns = {names.get(n, n): getattr(self, n).ravel() for n in fields}
        return {self.x_name: x.ravel(), self.y_name: y.ravel()} | columns

    def __str__(self) -> str:
        lines = ["Design map" if self.start is None else f"Design map from the initial state {self.start}"]
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
    progress: Callable[[int, int], None] | bool | None = None,
) -> DesignMap:
    """Compute the motion of every design on a grid of two parameters, or of two quantities of a scene.

    Without `start` the result is the largest attracting motion among the orbits of `symmetric_orbits` and
    rest. Both are known in closed form (about 15 µs per design and core). Other motions may attract as well.
    The status is

    - rocking: this orbit attracts. From another initial state the block may rest or rock less;
    - near_fold, grazing: this orbit attracts, but a small change of the design may remove it;
    - rest: none of the orbits attracts, and a block at rest does not lift. The amplitude is zero, and the
      swing is that of the bob under the block at rest;
    - neutral: an orbit exists, but it loses no energy, so it does not attract;
    - unstable: all orbits repel, and a block at rest lifts. The block settles into another motion, which
      depends on the initial state. Amplitude and swing are those of the largest orbit;
    - not_known: no orbit was found, which does not prove that there is none, and a block at rest lifts.
      Amplitude and swing are NaN. Use `start` to see what the block settles into.

    With `start` every design is followed from this initial state (about 0.6 ms per design) until the motion
    repeats. The status is rocking, sticking, rest, held, overturned (infinite angles), not_settled,
    event_bound or failed, as in `steady_state`. Only `steady_state` distinguishes aperiodic motions from
    motions that have not settled. If the motion is a symmetric period-one orbit, its exact angles are
    returned, see `DesignMap.exact`.

    Args:
        subject: dimensionless parameters, or a scene. Its own values of the two names are not used.
        x: a name, see `tpd.answers.bifurcations`, and its increasing values, shape (nx,). A quantity in SI
            units can be combined with a parameter that does not depend on it. The other parameters are then
            constant.
        y: name and values of the other axis, shape (ny,).
        pendulum: pendulum of the scene; None without a pendulum.
        start: initial state (phi, psi, phi', psi') at tau = 0, in rad and rad per unit tau; zeros are rest.
            For the signs see `y0` of `tpd.simulate`.
        progress: True for a progress bar on stderr, or a function that is called with (number of finished
            designs, number of all designs).

    Raises:
        ValueError: unknown names, two names that change the same parameter, batched parameters, or values
            that do not increase or are out of range.
        RuntimeError: JAX is in 32-bit mode.

    Example:
        >>> import tpd
        >>> p = tpd.Parameters(nu=0.2, mu=0.05, lam=0.8, zeta=0.1, k=0.05, f=0.3, xi=3.0)
        >>> designs = tpd.design_map(p, ("mu", [0.05, 0.1]), ("lam", [0.4, 0.6, 0.8]))
        >>> designs.counts
        {'rocking': 6}
        >>> round(float(designs.amplitude[2, 0]), 4)
        0.0552
    """
    checks.require_x64()
    setup = Setup.of(subject, pendulum)
    (x_name, xs), (y_name, ys) = line_of(setup, "x", x), line_of(setup, "y", y)
    check_together(setup, {x_name: xs, y_name: ys})
    # All designs of the grid, row by row. Each field has the shape (ny nx,).
    across, up = np.meshgrid(xs, ys)
    vector = setup.vector({x_name: across.ravel(), y_name: up.ravel()})
    # Parameters that do not vary are repeated for all designs.
    designs = from_row([jnp.broadcast_to(jnp.asarray(v), across.size) for v in vector])
    expected = "four numbers (phi, psi, phi', psi')"
    y0 = None if start is None else checks.array("start", start, (4,), expected)
    margin, reach = map(np.asarray, uplift(designs))
    with count_for(progress, "mapping") as report:
        # The progress is that of the longer part: of the followed motions, if there are any.
        orbits = all_symmetric_orbits(designs, progress=report if y0 is None else None)
        if y0 is None:
            # Without an initial state no motion is followed.
            answer = _largest(orbits, margin, reach)
        else:
            answer = _followed(designs, orbits, reach, y0, report)
    answer["status"], overflow = names_of(answer["status"]), np.asarray(orbits.overflow)
    answer |= {"margin": margin, "overflow": overflow}
    shaped = {n: v.reshape(len(ys), len(xs)) for n, v in answer.items()}
    at = None if y0 is None else tuple(map(float, y0))
    return DesignMap(x_name=x_name, x=xs, y_name=y_name, y=ys, start=at, **shaped)


def line_of(setup: Setup, argument: str, axis: tuple[str, Any]) -> tuple[str, np.ndarray]:
    """Return name and values of one axis after their checks."""
    if not (isinstance(axis, (tuple, list)) and len(axis) == 2):
        raise ValueError(f"`{argument}` must be a name and its values, but is {checks.quote(axis)}")
    name, values = named(axis[0]), checks.increasing(f"values of {argument}", axis[1])
    setup.check_name(argument, name)
    for value in (values[0], values[-1]):
        # All values between the first and the last have the same sign as these two.
        setup.check_sign(name, float(value))
    setup.check_plausible(name, values)
    return name, values


def check_together(setup: Setup, lines: dict[str, np.ndarray]) -> None:
    """Raise `ValueError` if both axes change the same parameter, or leave its range."""
    if len(lines) < 2:
        raise ValueError(f"`x` and `y` must differ, but both are {next(iter(lines))!r}")
    # A quantity and a parameter that depends on it would both set this parameter.
    for name, other in (tuple(lines), tuple(lines)[::-1]):
        if other in NAMES and other in setup.moved(name):
            raise ValueError(f"`x` and `y` must not both move {other}, but {name!r} does so as well")
    (x, xs), (y, ys) = lines.items()
    # Each parameter with a range is monotonic in each quantity, so a check of the corners is sufficient.
    for corner in ((i, j) for i in (0, -1) for j in (0, -1)):
        setup.at({x: float(xs[corner[0]]), y: float(ys[corner[1]])})


def _largest(orbits: Orbits, margin: np.ndarray, reach: np.ndarray) -> dict[str, np.ndarray]:
    """Return the answers without an initial state: one of the orbits of each design, or rest."""
    # Rest is one more candidate of each design. If a block at rest lifts, it is replaced by not_known.
    resting = np.where(margin > 0.0, code_of(Status.rest), code_of(Status.not_known))[:, None]
    codes = np.concatenate([code_of(orbits.status), resting], axis=1)
    amplitude = np.concatenate([orbits.amplitude, np.where(margin > 0.0, 0.0, np.nan)[:, None]], axis=1)
    swing = np.concatenate([orbits.swing, np.where(margin > 0.0, reach, np.nan)[:, None]], axis=1)
    # Priority of each candidate: the place of its status in `_CHOICE`.
    place = np.select(
        [codes == code_of(status) for status in _CHOICE], list(range(len(_CHOICE))), len(_CHOICE)
    )
    # Orbits are sorted by amplitude, the largest first, and `argmin` returns the first minimum. Hence the
    # result is the largest orbit of the status with the highest priority.
    best = np.arange(len(place)), np.argmin(place, axis=1)
    candidates = {"amplitude": amplitude, "swing": swing, "status": codes}
    return {n: v[best] for n, v in candidates.items()} | {"exact": np.ones(len(margin), bool)}


def _followed(
    p: Parameters, orbits: Orbits, reach: np.ndarray, y0: np.ndarray, progress: Any
) -> dict[str, np.ndarray]:
    """Return the answers from an initial state: the angles of the orbit reached, or of the motion itself."""
    n = len(np.asarray(p.nu))
    run = follow(Terms.linear, row_of(p), HarmonicForcing(), y0=np.tile(y0, (n, 1)), progress=progress)
    codes = np.asarray(code_of(run.status))
    # An undamped bob swings for ever, and its swing depends on how the block came to rest. A damped bob has
    # the steady swing of the closed form.
    swing = np.where((codes == code_of(Status.rest)) & (np.asarray(p.zeta) > 0.0), reach, run.settled_swing)
    scale = np.asarray(jax.vmap(scale_of)(p))
    # A followed motion ends near its orbit, but not on it. The amplitude and swing of the orbit are exact.
    apart = np.abs(np.asarray(orbits.state) - np.asarray(run.state)[:, None]) / scale[:, None]
    rocking = code_of(Status.rocking)
    apart = np.where(np.asarray(code_of(orbits.status)) == rocking, apart.max(axis=-1), np.inf)
    nearest = np.argmin(apart, axis=1)
    alike = (codes == rocking) & (np.asarray(run.periods) == 1)
    on = alike & (apart[np.arange(n), nearest] < _MATCH)
    return {
        "amplitude": np.where(on, orbits.amplitude[np.arange(n), nearest], run.settled_tilt),
        "swing": np.where(on, orbits.swing[np.arange(n), nearest], swing),
        "status": codes,
        "exact": on | is_one_of(codes, Status.rest, Status.overturned),
    }
