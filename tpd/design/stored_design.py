"""A design as its report holds it, design.json.

A `Design` cannot be made of it again: derivatives, single runs and most designs of the search are left out.
What can be made again are the job, the pendulum and the verdict, bit for bit.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from tpd.core.files import path_of
from tpd.core.formatting import Printed
from tpd.design.job import Job, job_of
from tpd.design.reasons import DesignStatus
from tpd.scene.scene import Pendulum

VERSION = 10
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
        if (with_it := self.pendulum) is not None:
            size = f"{with_it.mass:.4g} kg on {with_it.length:.4g} m, ζ = {with_it.damping_ratio:.4g}"
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
