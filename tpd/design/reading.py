"""Reader of design.json, the file that a report holds its design in.

A `Design` cannot be made of it again: derivatives, single runs and most designs of the search are left out.
What can be made again are the inputs, the pendulum and the verdict, bit for bit.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core.bob import Bob
from tpd.core.conditions import Conditions
from tpd.core.formatting import Printed
from tpd.core.ground_motion import GroundMotion
from tpd.core.scene import Block, Harmonic, Pendulum, Scene, paper_scene
from tpd.design.criteria import KINDS, DesignSpace, Limit, Risk, Room, Worth
from tpd.design.result import DesignStatus

VERSION = 8
"""Version of the file of a design; it grows when a key changes its meaning or goes away."""
GROUND_VERSION = 3
"""Version of the file of a design on ground motions."""
_TYPES = {dict: "a table", str: "a text", int: "a whole number"}


@dataclass(frozen=True, kw_only=True, repr=False)
class StoredDesign(Printed):
    """A design as its report holds it: angles in rad, lengths in m, masses in kg."""

    path: Path
    scene: Scene
    pendulum: Pendulum | None
    """None where no design is offered."""
    status: DesignStatus
    space: DesignSpace
    conditions: Conditions
    """Factors and description; units are not in the file."""
    risk: Risk
    limits: tuple[Limit, ...]
    worth: Worth
    seed: int
    amplitude: float
    """Largest exact settled |phi| with the pendulum, or without where there is none, as in `Design`."""
    amplitude_without: float
    stroke: float
    job: dict[str, dict[str, Any]]
    """Tables of the job file that repeats the run."""
    versions: dict[str, str]
    """Versions of the packages that made the design, by name."""
    content: dict[str, Any]
    """The whole file."""

    def __str__(self) -> str:
        return _words(self.status, self.pendulum)


@dataclass(frozen=True, kw_only=True, repr=False)
class StoredGroundDesign(Printed):
    """A design on ground motions as its report holds it. The motions are not in the file."""

    path: Path
    block: Block
    gravity: float
    pendulum: Pendulum | None
    """None where no design is offered."""
    status: DesignStatus
    seed: int
    records: tuple[str, ...]
    """Files, folders and sets that the motions were read from."""
    versions: dict[str, str]
    content: dict[str, Any]
    """The whole file."""

    def scene(self, motion: Harmonic | GroundMotion) -> Scene:
        """Return the block under a motion."""
        return Scene(self.block, motion, self.gravity)

    def __str__(self) -> str:
        # The sentence of the report has the reasons for its verdict.
        return _words(self.status, self.pendulum, str(self.content.get("status_message", self.status.value)))


def _words(status: DesignStatus, hung: Pendulum | None, sentence: str = "") -> str:
    lines = [f"Stored design: {status.name}", sentence or status.value]
    if hung is not None:
        lines.append(f"  pendulum    {hung.mass:.4g} kg on {hung.length:.4g} m, ζ = {hung.damping_ratio:.4g}")
    return "\n".join(lines)


def read(path: str | Path) -> StoredDesign | StoredGroundDesign:
    """Return the design of a report's directory, or of its design.json, of either kind.

    Raises:
        ValueError: as `tpd.Design.read`.
    """
    file, content = _content(Path(path))
    # Both kinds count their versions for themselves.
    ground = "groups" in content and "job" not in content
    expected = GROUND_VERSION if ground else VERSION
    version = content.get("version", 1)
    if version != expected:
        raise ValueError(f"{file} must be of version {expected}, but is of {version!r}: run the job again")
    try:
        return _ground(file, content) if ground else _design(file, content)
    except ValueError as error:
        raise ValueError(f"{file} is not the design of a report: {error}") from None


def read_design(path: str | Path) -> StoredDesign:
    """As `read`; a design on ground motions is refused."""
    found = read(path)
    if isinstance(found, StoredGroundDesign):
        raise ValueError(
            f"{found.path} is a design on ground motions, not for a harmonic: read it in Python by "
            "`tpd.design.reading.read`, or write its motion under a record by `tpd export`"
        )
    return found


def _content(path: Path) -> tuple[Path, dict[str, Any]]:
    """Path of the file, and what JSON it holds."""
    file = path / "design.json" if path.is_dir() else path
    try:
        content = json.loads(file.read_bytes())
    except OSError as error:
        raise ValueError(f"cannot read {file}: {error.strerror or error}") from None
    # A file of another encoding is no JSON either, and a deep nest no design.
    except (ValueError, RecursionError):
        raise ValueError(f"{file} is not a design in JSON") from None
    if not isinstance(content, dict) or not ("pendulum" in content and {"job", "groups"} & set(content)):
        raise ValueError(f"{file} is not a design: it has no `job` and `pendulum`")
    return file, content


def _design(file: Path, content: dict[str, Any]) -> StoredDesign:
    job = _key(content, "job", dict)
    # A table is read below as a dictionary, whatever keys it lacks.
    for table in job:
        _key(job, table, dict, "job.")
    return StoredDesign(
        path=file,
        scene=_scene(job),
        pendulum=_pendulum(content),
        status=_status(content),
        space=_made(DesignSpace, "job.space", _pairs(job.get("space", {}))),
        conditions=_conditions(_key(content, "conditions", dict)),
        risk=_made(Risk, "risk", _key(content, "risk", dict)),
        limits=_limits(_key(content, "limits", dict)),
        worth=_made(Worth, "worth", _key(content, "worth", dict)),
        seed=_key(content, "seed", int),
        amplitude=_number(content, "amplitude_rad"),
        amplitude_without=_number(content, "amplitude_without_rad"),
        stroke=_number(content, "stroke_rad"),
        job=job,
        versions=_key(content, "versions", dict),
        content=content,
    )


def _ground(file: Path, content: dict[str, Any]) -> StoredGroundDesign:
    records = content.get("records")
    if not (isinstance(records, list) and all(isinstance(name, str) for name in records)):
        raise ValueError(f"`records` must be a list of names, but is {records!r}")
    block = _made(Block, "block", _key(content, "block", dict))
    # A scene checks the gravity; the motion is any.
    scene = Scene(block, paper_scene().motion, _number(content, "gravity"))
    return StoredGroundDesign(
        path=file,
        block=block,
        gravity=float(scene.gravity),
        pendulum=_pendulum(content),
        status=_status(content),
        seed=_key(content, "seed", int),
        records=tuple(records),
        versions=_key(content, "versions", dict),
        content=content,
    )


def _key(content: Mapping[str, Any], name: str, kind: type, under: str = "") -> Any:
    """Value of a key, of the type asked for."""
    if name not in content:
        raise ValueError(f"it has no `{under}{name}`")
    # Python takes true and false for whole numbers.
    if not isinstance(content[name], kind) or isinstance(content[name], bool):
        raise ValueError(f"`{under}{name}` must be {_TYPES[kind]}, but is {content[name]!r}")
    return content[name]


def _number(content: Mapping[str, Any], name: str) -> float:
    """A number; infinite and unknown ones are words."""
    # JSON has no number for these two.
    value = {"infinite": math.inf, "nan": math.nan}.get(str(content.get(name)), content.get(name))
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        raise ValueError(f'`{name}` must be a number, "infinite" or "nan", but is {content.get(name)!r}')
    return float(value)


def _made(kind: type, name: str, values: Mapping[str, Any]) -> Any:
    """Object of a table, which checks its own values."""
    # Without this a misspelt key would be a TypeError of Python, which names no table.
    allowed = [f.name for f in fields(kind)]
    for key in values:
        if key not in allowed:
            raise ValueError(f"`{name}` has an unknown key `{key}`; allowed are {', '.join(allowed)}")
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"[{name}] {error}") from None
    # A key without a default is missing.
    except TypeError:
        raise ValueError(
            f"`{name}` must have {', '.join(allowed)}, but has {', '.join(values) or 'none'}"
        ) from None


def _pendulum(content: Mapping[str, Any]) -> Pendulum | None:
    if content["pendulum"] is None:
        return None
    return _made(Pendulum, "pendulum", _key(content, "pendulum", dict))


def _status(content: Mapping[str, Any]) -> DesignStatus:
    name = _key(content, "status", str)
    if name not in DesignStatus.__members__:
        raise ValueError(f"`status` must be one of {', '.join(DesignStatus.__members__)}, but is {name!r}")
    return DesignStatus[name]


def _scene(job: Mapping[str, Any]) -> Scene:
    """Scene of the tables of a job; what is left out is the paper's, as in a job file."""
    usual, site = paper_scene(), job.get("site", {})
    # A written job has all keys; one that was cut by hand may leave out what is usual.
    shape = {name: getattr(usual.block, name) for name in ("width", "height", "mass")}
    block = _made(Block, "job.block", shape | job.get("block", {}))
    motion = _made(Harmonic, "job.motion", vars(usual.motion) | job.get("motion", {}))
    return Scene(block, motion, _number(site, "gravity") if "gravity" in site else usual.gravity)


def _pairs(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: tuple(x) if isinstance(x, list) else x for name, x in values.items()}


def _conditions(values: Mapping[str, Any]) -> Conditions:
    factors, description = _key(values, "factors", dict, "conditions."), values.get("description")
    if not (isinstance(description, list) and all(isinstance(phrase, str) for phrase in description)):
        raise ValueError(f"`conditions.description` must be a list of texts, but is {description!r}")

    arrays = {name: np.asarray(x) for name, x in factors.items()}
    return Conditions(factors=arrays, description=tuple(description))


def _limits(values: Mapping[str, Any]) -> tuple[Limit, ...]:
    """Limits in the order of a report: JSON has them sorted by name."""
    kinds = {kind.name: kind for kind in KINDS}
    for name in values:
        if name not in kinds:
            raise ValueError(f"`limits` has an unknown key `{name}`; allowed are {', '.join(kinds)}")
    found = []
    for name, kind in kinds.items():
        if name in values:
            # A limit has one value or, as a requirement without a number, none.
            only = next((f.name for f in fields(kind)), None)
            value = _made(Bob, "limits.room", _key(values, name, dict)) if kind is Room else values[name]
            found.append(_made(kind, f"limits.{name}", {} if only is None else {only: value}))
    return tuple(found)
