"""Report as JSON: the design in full, SI and dimensionless, as `design.schema.json` describes it.

All designs have the same keys; what only harmonics, or only ground motions, have lies under `details`.
"""

from __future__ import annotations

import enum
from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from tpd.answers.ensemble import Outcomes
from tpd.answers.paired import Benefit, Verdict
from tpd.core import files
from tpd.design.criteria import Limit
from tpd.design.ground.design import GroundDesign
from tpd.design.ground.judgement import Judged
from tpd.design.orbits import KINDS
from tpd.design.reading import VERSION
from tpd.design.result import Design, HarmonicDesign
from tpd.design.study import Study
from tpd.design.survey import Survey
from tpd.design.verified import Reason
from tpd.records.reading import summary
from tpd.report.answer import verdict
from tpd.report.notes import notes
from tpd.scene.conditions import Conditions

_EVALUATION = ("tilt", "stroke", "margin", "multiplier", "reserve")
_SINGLE = ("runs", "fits", "ends")
"""Fields of a group of motions that are runs by the hundred, or follow from the others."""


def as_json(design: Design, study: Study, job_tables: dict[str, Any], said: Sequence[str] = ()) -> str:
    """The design as sorted JSON; infinite and unknown numbers are the words "infinite" and "nan"."""
    hung, gravity = design.pendulum, float(design.scene.gravity)
    entries = {
        "version": VERSION,
        "status": design.status.name,
        "verdict": verdict(design).text,
        "reasons": list(design.refusals),
        "notes": notes(design, study),
        "pendulum": hung,
        "hinge_damping_N_m_s_per_rad": None if hung is None else float(hung.hinge_damping(gravity)),
        **{n: getattr(design, n) for n in ("alike", "comparison", "risk", "conditions", "space", "seed")},
        **{n: getattr(study, n) for n in ("build", "front")},
        "worth": replace(design.worth, strikes=design.strikes_allowed),
        "limits": {limit.name: _limit(limit) for limit in design.limits},
        "job": job_tables,
        "versions": files.versions(),
        "details": _harmonic(design, study) if isinstance(design, HarmonicDesign) else _ground(design, said),
    }
    return files.as_json(plain(entries))


def _harmonic(design: HarmonicDesign, study: Study) -> dict[str, Any]:
    p = design.scene.parameters(design.pendulum)
    return {
        "kind": "harmonic",
        "amplitude_rad": design.amplitude,
        "amplitude_without_rad": design.amplitude_without,
        "stroke_rad": design.stroke,
        "parameters": {**vars(p), "rho": p.inertia_ratio, "e": p.velocity_ratio},
        "surveys": [_survey(found) for found in design.surveys],
        **{n: getattr(design, n) for n in ("verified", "bare", "nearest", "search", "losses", "settings")},
        "responses": study.responses,
        "usage": dict(study.usage),
    }


def _ground(design: Any, said: Sequence[str]) -> dict[str, Any]:
    assert isinstance(design, GroundDesign)
    named = ("mu", "lam", "zeta")
    return {
        "kind": "ground motions",
        "best": None if design.best is None else dict(zip(named, design.best, strict=True)),
        "value": {"best": design.value, "trend": design.trend, "bare": design.bare},
        "groups": design.judged,
        "reading": {
            "records": [{"group": g.name, **f} for g in design.groups for f in summary(g.motions)["records"]],
            "notes": list(said),
        },
        "usage": {} if design.usage is None else dict(zip(design.names, design.usage, strict=True)),
        "searched": None if design.searched is None else design.searched._asdict(),
        "block": design.scene.block,
        "gravity": float(design.scene.gravity),
    }


def _limit(limit: Limit) -> Any:
    """Value of a limit, or true where it has none; of a user's own all its fields."""
    values = vars(limit)
    return next(iter(values.values())) if len(values) == 1 else values or True


def plain(x: Any) -> Any:
    """Dictionaries, lists and numbers in place of objects."""
    match x:
        case enum.Enum():
            return x.name
        case np.ndarray() | np.generic():
            return x.tolist()
        case Outcomes() | Verdict():
            return plain(x.summary())
        case Survey():
            # Of one design.
            return {"bare": x.bare.tolist(), **(_surveyed(x, 0) or {})}
        case Conditions():
            return {"description": list(x.description), "factors": plain(dict(x.factors))}
        case Benefit():
            # A pair in a list would leave open which of the two is with the pendulum.
            pair = dict(zip(("with", "without"), x.by_condition, strict=True))
            return plain({f.name: getattr(x, f.name) for f in fields(x)} | {"by_condition": pair})
        case Judged():
            medians = [fit.median for fit in x.fits]
            kept = {f.name: getattr(x, f.name) for f in fields(x) if f.name not in _SINGLE}
            return plain(kept | {"medians": medians})
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
