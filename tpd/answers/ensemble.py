"""Ensembles of runs: how the block may be found when the shaking begins, how the shaking begins, and which
numbers of both are uncertain.

One run decides little: rest, rocking and overturning exist side by side, and a per cent of the amplitude may
change which of them is reached. Shares of a seeded set of runs are stable. Designs that are verified are
put to the same runs (common random numbers) and compared run by run; see `tpd.answers.paired`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tpd.answers.runs import Runs, follow_runs
from tpd.cluster.cluster import Cluster, check_where
from tpd.core import checks
from tpd.core.progress import shown_count
from tpd.exact.rows import row_of
from tpd.exact.runs import HarmonicForcing
from tpd.scene.conditions import FACTORS, Conditions, check_restitution, factors_at, under
from tpd.scene.ensemble import Ensemble
from tpd.scene.parameters import Parameters
from tpd.scene.quantities import parameters_of
from tpd.scene.scene import Pendulum, Scene
from tpd.theory.equations import Terms


class Plan(NamedTuple):
    """Inputs of `follow_runs` for the runs of an ensemble: arrays of leading axis (size,)."""

    p: Parameters
    y0: np.ndarray
    begin: np.ndarray
    """Dimensionless times at which the runs begin."""
    periods: np.ndarray
    """Forcing periods over which the shaking grows."""
    ramp: np.ndarray
    """Seconds (or units of tau, where time has no unit) over which the shaking grows."""
    condition: np.ndarray
    """Index of the condition."""


def plan(p: Parameters, ensemble: Ensemble, rate: float = 1.0, conditions: Conditions | None = None) -> Plan:
    """Return the runs of an ensemble for one design.

    Args:
        p: dimensionless parameters, plain numbers.
        ensemble: spreads of the runs.
        rate: omega0 in rad/s where the ramps are in seconds.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
    """
    # Tilts scale with nu: at |phi| = nu a block of any shape stands on its corner, about to fall.
    e, unit, nu = ensemble, ensemble.draws(), float(p.nu)
    reach = np.array([e.tilt * nu, e.swing, e.tilt_rate * nu, e.swing_rate])
    scatter = factors_at(unit[:, 6:], e.widths(p.e))
    conditions = Conditions() if conditions is None else conditions
    dealt = e.dealt(len(conditions))
    factor = np.stack([scatter.get(name, 1.0) * conditions.column(name)[dealt] for name in FACTORS])
    design = np.repeat([[float(x)] for x in (p.mu, p.lam, p.zeta)], e.size, axis=1)
    q = under(p, design, factor)
    # Every leaf is given for every run: then all ensembles, also that of the bare block, share one program.
    rho, ratio = (np.broadcast_to(np.asarray(x), e.size) for x in (q.inertia_ratio, q.velocity_ratio))
    q = replace(q, rho=rho, e=ratio)
    xi = np.asarray(q.xi)
    begin = unit[:, 4] * 2.0 * np.pi / xi if e.any_phase else np.zeros(e.size)
    ramps = np.array(e.ramps)
    ramp = ramps[np.minimum((unit[:, 5] * len(ramps)).astype(int), len(ramps) - 1)]
    return Plan(q, (2.0 * unit[:, :4] - 1.0) * reach, begin, ramp * rate * xi / (2.0 * np.pi), ramp, dealt)


def outcomes(
    subject: Parameters | Scene,
    pendulum: Pendulum | None = None,
    *,
    ensemble: Ensemble | None = None,
    conditions: Conditions | None = None,
    equations: Terms | str = Terms.linear,
    rtol: checks.Real = 1e-8,
    workers: checks.Whole | None = None,
    cluster: Cluster | None = None,
    progress: Callable[[int, int], None] | bool | None = None,
) -> Runs:
    """Follow the runs of an ensemble.

    Args:
        subject: a scene, or dimensionless parameters (plain numbers).
        pendulum: in the scene; default none.
        ensemble: default `Ensemble()`.
        conditions: dealt out evenly among the runs, on top of their scatter; default the scene's own.
        equations: the linear ones by their exact solution, or the nonlinear ones by a compiled event loop.
        rtol: relative tolerance of a step of the nonlinear equations.
        workers: threads; default the number of cores.
        cluster: processes or machines in place of threads.
        progress: True for a bar on stderr, or called with (runs done, of how many).

    Raises:
        ValueError: bad input, or a pendulum beside parameters.
        RuntimeError: JAX is in 32-bit mode.
    """
    checks.require_x64()
    check_where(workers, cluster)
    checks.one_of("equations", equations, (Terms.linear.value, Terms.nonlinear.value))
    terms = Terms(equations)
    ensemble = Ensemble() if ensemble is None else ensemble
    checks.instance("ensemble", ensemble, Ensemble)
    ensemble = ensemble.seeded(0)
    if ensemble.restitution and isinstance(subject, Scene):
        check_restitution(subject)
    checks.optional("conditions", conditions, Conditions)
    rate = float(subject.rate) if isinstance(subject, Scene) else 1.0
    runs = plan(parameters_of(subject, pendulum), ensemble, rate, conditions)
    forcing = HarmonicForcing(ensemble.periods, runs.begin, runs.periods)
    inputs = {"condition": runs.condition, "ramp": runs.ramp, "seed": ensemble.seed or 0}
    with shown_count(progress, "following") as report:
        where = {"workers": workers, "cluster": cluster, "progress": report}
        return follow_runs(terms, row_of(runs.p), forcing, y0=runs.y0, rtol=rtol, **inputs, **where)
