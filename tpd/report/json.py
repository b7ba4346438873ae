"""Report as JSON: the design in full, SI and dimensionless, as `design.schema.json` describes it."""

from __future__ import annotations

import enum
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from tpd.analysis.benefit import Benefit, Change
from tpd.analysis.outcomes import Outcomes
from tpd.analysis.paired import Verdict
from tpd.core import files
from tpd.core.conditions import Conditions
from tpd.design.criteria import Limit
from tpd.design.front import FrontPoint
from tpd.design.objective import KINDS
from tpd.design.reading import VERSION
from tpd.design.result import HarmonicDesign
from tpd.design.study import Study
from tpd.design.survey import Survey
from tpd.design.verified import Reason
from tpd.report.notes import notes

_STUDY = ("responses", "comparison", "elasticities", "front", "earthquakes", "left_out")
"""Parts of a study; time histories and the uplift region follow from the job in no time."""
_EVALUATION = ("tilt", "stroke", "margin", "multiplier", "reserve")


def as_json(design: HarmonicDesign, study: Study, job_tables: dict[str, Any]) -> str:
    """The design as sorted JSON; infinite and unknown numbers are the words "infinite" and "nan"."""
    p, hung = design.scene.parameters(design.pendulum), design.pendulum
    entries = {
        "version": VERSION,
        "status": design.status.name,
        "status_message": design.status.value,
        "notes": notes(design, study),
        "pendulum": hung,
        "hinge_damping_N_m_s_per_rad": None if hung is None else hung.hinge_damping(design.scene.gravity),
        "amplitude_rad": design.amplitude,
        "amplitude_without_rad": design.amplitude_without,
        "stroke_rad": design.stroke,
        "parameters": {**vars(p), "rho": p.inertia_ratio, "e": p.velocity_ratio},
        "risk": design.risk,
        "worth": replace(design.worth, strikes=design.worth.allowed),
        "limits": {limit.name: _limit(limit) for limit in design.limits},
        "conditions": design.conditions,
        "verified": design.verified,
        "bare": design.bare,
        "nearest": design.nearest,
        "search": design.search,
        "surveys": [_survey(found) for found in design.surveys],
        "losses": design.losses,
        "elasticities": design.elasticities,
        "study": {name: getattr(study, name) for name in _STUDY} | {"usage": dict(study.usage)},
        "seed": design.seed,
        "settings": design.settings,
        "job": job_tables,
        "versions": files.versions(),
    }
    return files.as_json(plain(entries))


def _limit(limit: Limit) -> Any:
    """Value of a limit, or true where it has none."""
    return next(iter(vars(limit).values()), True)


def plain(x: Any) -> Any:
    """Dictionaries, lists and numbers in place of objects."""
    match x:
        case enum.Enum():
            return x.name
        case np.ndarray() | np.generic():
            return x.tolist()
        case Outcomes() | Verdict():
            return x.summary()
        case Survey():
            # Of one design.
            return {"bare": x.bare.tolist(), **(_surveyed(x, 0) or {})}
        case Change() | FrontPoint():
            return plain(x._asdict())
        case Benefit():
            # A pair in a list would leave open which of the two is with the pendulum.
            with_it, without = x.by_condition
            named = {f.name: plain(getattr(x, f.name)) for f in fields(x)}
            return named | {"by_condition": {"with": with_it.tolist(), "without": without.tolist()}}
        case Conditions():
            return {"description": list(x.description), "factors": plain(dict(x.factors))}
        case dict():
            return {k: plain(v) for k, v in x.items()}
    # By its fields and not by its class: an evaluation is a tuple, and tuples are lists below.
    if hasattr(x, "merit_slope"):
        return _evaluation(x)
    if is_dataclass(x):
        # A reason is data first; the sentence spares every reader the making of one.
        sentence = {"sentence": str(x)} if isinstance(x, Reason) else {}
        return {f.name: plain(getattr(x, f.name)) for f in fields(x)} | sentence
    return [plain(v) for v in x] if isinstance(x, (list, tuple)) else x


def _evaluation(e: Any) -> dict[str, Any]:
    """One design under all conditions, without derivatives."""
    kinds = [KINDS[int(k)] for k in e.kind[0]]
    return {n: getattr(e, n)[0].tolist() for n in _EVALUATION} | {"kind": kinds}


def _survey(found: Survey) -> dict[str, Any]:
    """Counts, the best design, and the best one where a limit is left out; not the thousands of others."""
    # Thousands of designs would make a file of tens of megabytes that nobody reads; a seed repeats them.
    broken = {name: int(np.sum(x > 0.0)) for name, x in found.excess.items()}
    without = {name: _surveyed(found, found.best_without(name)) for name, n in broken.items() if n}
    return {
        "equations": found.equations,
        "designs": len(found.designs),
        "keep_to_limits": int(found.keeps.sum()),
        "better_than_bare": found.better,
        "broken": broken,
        "severity_without": found.bare.tolist(),
        "best": _surveyed(found, found.best_without()),
        "best_without": without,
    }


def _surveyed(found: Survey, i: int | None) -> dict[str, Any] | None:
    """One design of a survey, under every condition."""
    if i is None:
        return None
    excess = {name: float(x[i]) for name, x in found.excess.items()}
    return {"design": found.designs[i].tolist(), "severity": found.severity[i].tolist(), "excess": excess}
