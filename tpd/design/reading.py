"""The question of a design as a job: of one in Python, and of one that a report holds as design.json.

A `Design` cannot be made of design.json again: derivatives, single runs and most designs of the search are
left out. What can be made again are the job, the pendulum and the verdict, bit for bit.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core.files import path_of
from tpd.core.formatting import Printed
from tpd.design.criteria import DEFAULT_LIMITS, KINDS, Room, SteadyTilt, limit_of
from tpd.design.job import Job, job_of
from tpd.design.job_keys import TABLES
from tpd.design.reasons import DesignStatus
from tpd.design.settings import SCATTERED
from tpd.records.reading import BUILT_IN
from tpd.scene.conditions import Conditions
from tpd.scene.ground_motion import STANDARD_GRAVITY, GroundMotion, Pulse
from tpd.scene.record import Record
from tpd.scene.scene import Harmonic, Pendulum
from tpd.scene.starts import StartKind

VERSION = 9
"""Version of the file; it grows when a key that is read here changes its meaning or goes away."""
_TYPES = {dict: "a table", str: "a text"}


@dataclass(frozen=True, kw_only=True, repr=False)
class StoredDesign(Printed):
    """A design as its report holds it."""

    path: Path
    status: DesignStatus
    pendulum: Pendulum | None
    """None where no design is offered."""
    tables: dict[str, Any]
    """Tables of the job file that repeats the run."""
    versions: dict[str, str]
    """Versions of the packages that made the design, by name."""
    content: dict[str, Any]
    """The whole file."""

    @cached_property
    def job(self) -> Job:
        """The question, a `Job`: scene, space, limits, and what else `tpd.optimise` takes. Records are read
        again."""
        return job_of(self.tables)

    def __str__(self) -> str:
        # The sentence of the report has the reasons for its verdict.
        sentence = str(self.content.get("verdict", self.status.value))
        lines = [f"Stored design: {self.status.name}", sentence]
        if (hung := self.pendulum) is not None:
            size = f"{hung.mass:.4g} kg on {hung.length:.4g} m, ζ = {hung.damping_ratio:.4g}"
            lines.append(f"  pendulum    {size}")
        return "\n".join(lines)


def read_design(path: str | Path) -> StoredDesign:
    """Return what the design.json of a report, or of the report's directory, holds of its design.

    Raises:
        ValueError: a file that cannot be read, of another version, without a key, or with a value that is
            not allowed.
    """
    file = path_of(path)
    try:
        file = file / "design.json" if file.is_dir() else file
        content = json.loads(file.read_bytes())
    except OSError as error:
        raise ValueError(f"cannot read {file}: {error.strerror or error}") from None
    # A file of another encoding is no JSON either, and a deep nest no design.
    except (ValueError, RecursionError):
        raise ValueError(f"{file} is not a design in JSON") from None
    if not isinstance(content, dict) or "pendulum" not in content:
        raise ValueError(f"{file} is not a design: it has no `pendulum`")
    version = content.get("version", 1)
    if version != VERSION:
        raise ValueError(f"{file} must be of version {VERSION}, but is of {version!r}: run the job again")
    try:
        found = StoredDesign(
            path=file,
            tables=_key(content, "job", dict),
            pendulum=_pendulum(content),
            status=_status(content),
            versions=_key(content, "versions", dict),
            content=content,
        )
        # A damaged job is found here, and not where it is first used.
        _ = found.job
    except ValueError as error:
        raise ValueError(f"{file} is not the design of a report: {error}") from None
    return found


def _key(content: dict[str, Any], name: str, kind: type) -> Any:
    """Value of a key, of the type asked for."""
    if name not in content:
        raise ValueError(f"it has no `{name}`")
    if not isinstance(content[name], kind):
        raise ValueError(f"`{name}` must be {_TYPES[kind]}, but is {content[name]!r}")
    return content[name]


def _pendulum(content: dict[str, Any]) -> Pendulum | None:
    if content["pendulum"] is None:
        return None
    values, names = _key(content, "pendulum", dict), [f.name for f in fields(Pendulum)]
    if set(values) != set(names):
        raise ValueError(f"`pendulum` must have {', '.join(names)}, but has {', '.join(values) or 'none'}")
    try:
        return Pendulum(**values)
    except ValueError as error:
        raise ValueError(f"[pendulum] {error}") from None


def _status(content: dict[str, Any]) -> DesignStatus:
    name = _key(content, "status", str)
    if name not in DesignStatus.__members__:
        raise ValueError(f"`status` must be one of {', '.join(DesignStatus.__members__)}, but is {name!r}")
    return DesignStatus[name]


def job_of_design(design: Any) -> Job:
    """Return the job that poses a problem again.

    Raises:
        ValueError: a problem that no job file can describe: motions or a limit that exist only in Python.
    """
    scene, found = design.scene, _asked(design)
    try:
        job = job_of({table: _said(values) for table, values in found.items()})
    except ValueError as error:
        raise ValueError(f"a job file cannot say what this design was asked: {error}") from None
    if getattr(design, "objective", SteadyTilt()) != SteadyTilt():
        raise ValueError("a job file cannot state an objective, which exists only in Python")
    for name in ("space", "risk", "limits", "method", "ensemble", "worth", "seed"):
        # Models and optimisers of one kind are equal by what they print.
        if repr(getattr(job, name)) != repr(getattr(design, name)):
            raise ValueError(f"a job file cannot say the `{name}` of this design, {getattr(design, name)}")
    if isinstance(scene.motion, Harmonic):
        conditions = Conditions.around(scene) if job.conditions is None else job.conditions
        rows = conditions.factor_rows(), design.conditions.factor_rows()
        if job.scene != scene or not np.array_equal(*rows):
            raise ValueError(
                "a job file cannot say the conditions of this design: it has bands, amplitudes and scatter, "
                f"and these are {', '.join(design.conditions.description) or 'of Python'}"
            )
    return job


def _said(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values that a file can hold, without those that are left out."""
    plain = {key: x.tolist() if isinstance(x, np.generic) else x for key, x in values.items()}
    return {key: list(x) if isinstance(x, tuple) else x for key, x in plain.items() if x is not None}


def _asked(design: Any) -> dict[str, dict[str, Any]]:
    """Tables of the question of a design, as far as they can say it."""
    scene, risk, method = design.scene, design.risk, design.method
    limits: dict[str, Any] = {
        kind.name: False
        for kind in KINDS
        if limit_of(DEFAULT_LIMITS, kind) and limit_of(design.limits, kind) is None
    }
    bob = {}
    for limit in design.limits:
        if type(limit) not in KINDS:
            raise ValueError(f"a job file cannot say the limit `{limit.name}`, which exists only in Python")
        number = next((x for x in vars(limit).values() if isinstance(x, (int, float))), True)
        limits[limit.name] = number
        bob |= vars(limit.bob) if isinstance(limit, Room) else {}
    if bob.get("shape") == "ball":
        bob.pop("aspect")
    search = {name: value for name, value in vars(method).items() if name in TABLES["search"]}
    if not isinstance(search.get("model"), str):
        search["model"] = None
    search["seed"] = design.seed
    measure = {0.0: "worst", 1.0: "expected"}.get(risk.share, "cvar")
    asked: dict[str, dict[str, Any]] = {
        "block": vars(scene.block),
        "site": {"gravity": scene.gravity},
        "bob": bob,
        "space": vars(design.space),
        "risk": {"measure": measure, "share": risk.share if measure == "cvar" else None},
        "limits": limits,
        "search": search,
    }
    if isinstance(scene.motion, Harmonic):
        asked |= {
            "motion": vars(scene.motion),
            "worth": vars(design.worth),
            # Runs without a seed of their own use the seed of the search.
            "ensemble": vars(design.ensemble)
            | ({"seed": None} if design.ensemble.seed == design.seed else {}),
        }
        asked |= {"starts": {"kind": "rest" if design.starts.kind is StartKind.rest else "any"}}
        return _with_conditions(asked, design)
    widths = {name: getattr(design.ensemble, name) for name in SCATTERED}
    worth = {"at_least": design.worth.at_least, "strikes": design.worth.strikes}
    return asked | {"motion": _motion_of(design), "worth": worth, "ensemble": widths}


def _with_conditions(asked: dict[str, dict[str, Any]], design: Any) -> dict[str, dict[str, Any]]:
    """The tables with those of the conditions, from their factors and the phrases that describe them."""
    found, phrases = design.conditions, " * ".join(design.conditions.description)
    if np.array_equal(found.factor_rows(), Conditions.around(design.scene).factor_rows()):
        return asked
    if len(found) == 1 and not found.factors:
        return asked | {"conditions": {"exactly": True}}
    table: dict[str, Any] = {}
    if said := re.search(r"(\d+) frequencies from (\S+) to (\S+) Hz", phrases):
        table |= {"band": [float(said[2]), float(said[3])], "frequencies": int(said[1])}
    if said := re.search(r"amplitudes ([^a-z]+) times", phrases):
        table["amplitudes"] = [float(x) for x in said[1].split(",")]
    scatter = {}
    if said := re.search(r"(\d+) samples of", phrases):
        table["samples"] = int(said[1])
        scatter = {name: 0.01 * float(x) for name, x in re.findall(r"(\w+) within (\d+)%", phrases)}
    return asked | {"conditions": table, "scatter": scatter}


def _motion_of(design: Any) -> dict[str, Any]:
    """Table of the motions of a design, each of which must be a built-in record, or one pulse."""
    groups = {g.name: [_name_of(m) for m in g.motions] for g in design.groups if g.role.name == "held_out"}
    motions, asked = design.conditions.motions, design.conditions
    size = {"scales": asked.scales, "intensity": asked.intensity}
    if len(motions) == 1 and isinstance(motions[0], Pulse) and not groups:
        pulse = motions[0]
        found = {"pulse": pulse.kind, "pulse_frequency": pulse.frequency, **size}
        shape = {name: getattr(pulse, name) for name in ("cycles", "phase")}
        return found | {"pga": float(pulse.pga) / STANDARD_GRAVITY} | (shape if "-" in pulse.kind[6:] else {})
    held = [name for names in groups.values() for name in names] or 0.0
    return {"records": [_name_of(m) for m in motions], "held_out": held, **size}


def _name_of(motion: GroundMotion) -> str:
    """Name of a built-in record."""
    for name, make in BUILT_IN.items():
        known = make()
        if isinstance(motion, Record) and motion.name == known.name and motion.pga == known.pga:
            return name
    raise ValueError(
        "a job file cannot say motions that exist only in Python: it names files, folders and sets of records"
    )
