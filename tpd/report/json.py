"""The file design.json: all results of a design, in SI units and dimensionless.

The file `design.schema.json` describes its format."""

from __future__ import annotations

import enum
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from msgspec import structs

from tpd.answers.paired import PairedRuns
from tpd.answers.run_table import Runs
from tpd.core import files
from tpd.design.as_built import Details
from tpd.design.design import Design
from tpd.design.reasons import Reason
from tpd.design.sizes import MOTION_KINDS
from tpd.design.stored_design import VERSION
from tpd.design.trend import Trend
from tpd.design.variations import Dependence
from tpd.report import words
from tpd.report.blocks import Summary
from tpd.scene.conditions import Conditions

_DESIGN = ("equivalent", "benefit", "overturning_reduction", "conditions", "space", "seed")
_COMPARISON = "pairs", "undecided", "benefit", "overturning_reduction"
_EVALUATION = ("tilt", "swing", "margin", "multiplier", "reserve")


def as_json(design: Design, details: Details, first: Summary) -> str:
    """Return a design as JSON with sorted keys. Infinite and unknown numbers are strings."""
    pendulum, gravity, problem = design.pendulum, float(design.scene.gravity), design.problem
    # Dimensionless parameters exist only under harmonic excitation.
    p = None if problem.has_earthquakes else design.scene.parameters(pendulum)
    # A limit with one field is written as the value of this field, and a limit without fields as true. A
    # limit that the user defined may have several fields.
    fields_of = {limit.name: vars(limit) for limit in problem.limits}
    limits = {n: next(iter(x.values())) if len(x) == 1 else x or True for n, x in fields_of.items()}
    # The measure that was decided is known only after the validation, if the job leaves the choice to the
    # program.
    measure = (design.best and design.best.measure) or problem.requirements.reduce
    entries = {
        "version": VERSION,
        "status": design.status.name,
        "verdict": first.verdict.text,
        "reasons": list(design.refusals),
        "notes": [structs.asdict(n) for n in first.notes],
        "pendulum": pendulum,
        "hinge_damping_N_m_s_per_rad": None if pendulum is None else float(pendulum.hinge_damping(gravity)),
        **{n: getattr(design, n) for n in _DESIGN},
        # The motions from rest are drawn, and would make the file large.
        **{name: x for name, x in vars(details).items() if name != "histories"},
        "risk": problem.risk,
        "requirements": replace(problem.requirements, wall_contacts=problem.allowed, reduce=measure),
        "limits": limits,
        "utilisation": design.usage,
        "job": problem.job and problem.job.tables,
        "versions": files.versions(),
        "parameters": p and {**vars(p), "rho": p.inertia_ratio, "e": p.velocity_ratio},
        "runs": design.runs,
        "levels": shares_at_levels(design),
        "without_pendulum": problem.without_pendulum,
        "validated": design.validated,
        "rule": next((i for i, v in enumerate(design.validated) if v is design.rule), None),
        "trials": design.trials,
        "search": design.search,
        "records": {
            "files": [{"group": name, **facts} for name, facts in words.records(design)],
            "notes": list(problem.job.file_notes if problem.job else ()),
        },
    }
    return files.as_json(json_of(entries))


def shares_at_levels(design: Design) -> list[dict[str, Any]]:
    """Return the shares of the counted runs that overturn with and without the pendulum, in each stratum of
    the levels of ground motions; empty if there are none."""
    if (runs := design.runs) is None:
        return []
    counted = True if runs.counted is None else runs.counted
    cases, edges = (runs.with_pendulum, runs.without_pendulum), design.problem.edges
    return [
        {
            "level": edges[i : i + 2].tolist(),
            "overturned": [case.of(rows & counted).share_overturned.value for case in cases],
        }
        for i, rows in enumerate(design.problem.levels.values())
    ]


def json_of(x: Any) -> Any:
    """Convert results to dictionaries, lists, numbers and strings, as JSON needs them."""
    match x:
        case enum.Enum():
            return x.name
        case np.ndarray() | np.generic():
            return x.tolist()
        # Arrays of all runs would make the file large, so shares and quantiles are written.
        case Runs() | PairedRuns():
            return json_of(x.summary())
        case Dependence():
            # A variation is compared with the stated design: all else of its runs would repeat much.
            runs = {name: getattr(x.runs, name) for name in _COMPARISON}
            changes = [x.runs.change(name) for name in ("mean tilt", "overturned")]
            return json_of(x._asdict() | {"runs": runs | {"changes": changes}})
        case Trend():
            # The trend follows from the trials, which are written as well.
            return None
        case Conditions():
            return {"description": list(x.description), "factors": json_of(dict(x.factors))}
        case dict():
            return {k: json_of(v) for k, v in x.items()}
    # An evaluation is a named tuple with derivatives that no reader of the file needs. It must be recognised
    # before the branches for tuples below.
    if hasattr(x, "merit_slope"):
        kinds = [MOTION_KINDS[int(k)] for k in x.kind[0]]
        return {n: getattr(x, n)[0].tolist() for n in _EVALUATION} | {"kind": kinds}
    # Results are frozen dataclasses: their fields become the keys.
    if is_dataclass(x):
        # Readers of the file get the sentence of a reason and need not build it from the numbers.
        sentence = {"sentence": str(x)} if isinstance(x, Reason) else {}
        return {f.name: json_of(getattr(x, f.name)) for f in fields(x)} | sentence
    # Named tuples keep their field names, other tuples become lists.
    if hasattr(x, "_asdict"):
        return json_of(x._asdict())
    return [json_of(v) for v in x] if isinstance(x, (list, tuple)) else x
