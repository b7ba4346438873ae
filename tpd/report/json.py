"""Report as JSON: the design in full, SI and dimensionless, as `design.schema.json` describes it."""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.paired import PairedRuns
from tpd.answers.runs import Runs
from tpd.core import files
from tpd.design.as_built import Details
from tpd.design.design import Design
from tpd.design.gaussian_process import GaussianProcess
from tpd.design.orbits import KINDS
from tpd.design.reasons import Reason
from tpd.design.stored_design import VERSION
from tpd.records.read import summary
from tpd.report import words
from tpd.report.answer import verdict
from tpd.report.notes import notes
from tpd.scene.conditions import Conditions

_DESIGN = "equivalent", "benefit", "overturning_reduction", "conditions", "space", "seed"
_EVALUATION = ("tilt", "swing", "margin", "multiplier", "reserve")


def as_json(design: Design, details: Details, job_tables: dict[str, Any], said: Sequence[str] = ()) -> str:
    """The design as sorted JSON; infinite and unknown numbers are words."""
    with_it, gravity, problem = design.pendulum, float(design.scene.gravity), design.problem
    p = design.scene.parameters(with_it) if design.problem.without_pendulum is not None else None
    # A limit is its value, or true where it has none; one of the user's own has all its fields.
    fields_of = {limit.name: vars(limit) for limit in problem.limits}
    limits = {n: next(iter(x.values())) if len(x) == 1 else x or True for n, x in fields_of.items()}
    measure = (
        problem.requirements.measure
        if design.best is None
        else design.best.measure or problem.requirements.measure
    )
    entries = {
        "version": VERSION,
        "status": design.status.name,
        "verdict": verdict(design, details).text,
        "reasons": list(design.refusals),
        "notes": notes(design, details),
        "pendulum": with_it,
        "hinge_damping_N_m_s_per_rad": None if with_it is None else float(with_it.hinge_damping(gravity)),
        **{n: getattr(design, n) for n in _DESIGN},
        **{n: getattr(details, n) for n in ("build", "sensitivity", "losses", "responses", "front")},
        "risk": problem.risk,
        "requirements": replace(problem.requirements, wall_contacts=problem.allowed, measure=measure),
        "limits": limits,
        "usage": design.usage,
        "job": job_tables,
        "versions": files.versions(),
        "parameters": p and {**vars(p), "rho": p.inertia_ratio, "e": p.velocity_ratio},
        "runs": design.runs,
        "without_pendulum": problem.without_pendulum,
        "validated": design.validated,
        "trials": design.trials,
        "search": design.search,
        "reading": {
            "records": [
                {"group": name, **f}
                for name, motions in words.groups(design).items()
                for f in summary(motions)["records"]
            ],
            "notes": list(said),
        },
    }
    return files.as_json(plain(entries))


def plain(x: Any) -> Any:
    """Dictionaries, lists and numbers in place of objects."""
    match x:
        case enum.Enum():
            return x.name
        case np.ndarray() | np.generic():
            return x.tolist()
        case Runs() | PairedRuns():
            return plain(x.summary())
        case GaussianProcess():
            # It follows from the trials.
            return None
        case Conditions():
            return {"description": list(x.description), "factors": plain(dict(x.factors))}
        case dict():
            return {k: plain(v) for k, v in x.items()}
    # By its fields and not by its class: an evaluation is a tuple, and tuples are lists below.
    if hasattr(x, "merit_slope"):
        kinds = [KINDS[int(k)] for k in x.kind[0]]
        return {n: getattr(x, n)[0].tolist() for n in _EVALUATION} | {"kind": kinds}
    if is_dataclass(x):
        # A reason is data first; the sentence spares every reader the making of one.
        sentence = {"sentence": str(x)} if isinstance(x, Reason) else {}
        return {f.name: plain(getattr(x, f.name)) for f in fields(x)} | sentence
    if hasattr(x, "_asdict"):
        return plain(x._asdict())
    return [plain(v) for v in x] if isinstance(x, (list, tuple)) else x
