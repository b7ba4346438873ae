"""Design that was read from the design.json of a report.

The file does not contain a whole `Design`: derivatives, single runs and most designs of the search are left
out. It contains the job, the pendulum and the verdict, bit for bit.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from tpd.core import checks
from tpd.core.files import path_of
from tpd.core.formatting import Printed
from tpd.design.job import Job, job_of, naming
from tpd.design.reasons import DesignStatus
from tpd.scene.scene import Pendulum

VERSION = 15
"""Version of the file. It increases when a key that is read here changes its meaning or is removed."""


@dataclass(frozen=True, kw_only=True, repr=False)
class StoredDesign(Printed):
    """Design that was read from the design.json of a report."""

    path: Path
    """Path of the file."""
    status: DesignStatus
    """Verdict on the design."""
    pendulum: Pendulum | None
    """Pendulum of the design, in SI units; None if none is recommended."""
    tables: dict[str, Any] | None
    """Tables of the job file that repeats the search; None for a design of Python objects."""
    content: dict[str, Any]
    """Whole content of the file."""

    @cached_property
    def job(self) -> Job:
        """Inputs of the design as a `Job`: scene, design space, limits and all other arguments of
        `tpd.optimise`.

        Records are read again from their files.

        Raises:
            ValueError: the design was not made from a job.
        """
        if self.tables is None:
            remedy = "give a job file and the pendulum, or pass a `tpd.Job` to `tpd.optimise`"
            raise ValueError(f"{self.path} has no job, because its design was made in Python: {remedy}")
        return job_of(self.tables)

    @property
    def crossed(self) -> Any:
        """Designs (mu, lam, zeta) of the groups of cross-fitting, as a list of rows; None if the pendulum was
        not searched with cross-fitting."""
        validated = self.content.get("validated") or [{}]
        return validated[-1].get("crossed")

    def __str__(self) -> str:
        # The sentence of the report contains the reasons for the verdict as well.
        sentence = str(self.content.get("verdict", self.status.value))
        lines = [f"Stored design: {self.status.name}", sentence]
        if (pendulum := self.pendulum) is not None:
            size = f"{pendulum.mass:.4g} kg on a rod of {pendulum.length:.4g} m"
            lines.append(f"  pendulum    {size}, damping ratio {pendulum.damping_ratio:.4g}")
        return "\n".join(lines)


def read_design(path: str | Path) -> StoredDesign:
    """Read the design of a report.

    Args:
        path: the file design.json, or the directory of the report.

    Raises:
        ValueError: the file cannot be read, is of another version, lacks a key, or has a value that is not
            allowed.

    Example:
        >>> import tpd
        >>> tpd.read_design("no-such-report")  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        ValueError: cannot read no-such-report: No such file or directory
    """
    file = path_of(path)
    try:
        file = file / "design.json" if file.is_dir() else file
        content = json.loads(file.read_bytes())
    except OSError as error:
        raise ValueError(f"cannot read {file}: {error.strerror or error}") from None
    # A file of another encoding raises `ValueError` as well, and a deeply nested one raises `RecursionError`.
    except (ValueError, RecursionError):
        raise ValueError(f"{file} is not a design in JSON") from None
    if not isinstance(content, dict) or "pendulum" not in content:
        raise ValueError(f"{file} is not a design: it has no `pendulum`")
    version = content.get("version", 1)
    if version != VERSION:
        raise ValueError(f"{file} must be of version {VERSION}, but is of {version!r}: run the job again")
    try:
        for name in ("job", "pendulum"):
            if name not in content:
                raise ValueError(f"it has no `{name}`")
            if not isinstance(value := content[name], dict | None):
                raise ValueError(f"`{name}` must be a table, but is {value!r}")
        checks.one_of("status", content.get("status"), tuple(DesignStatus.__members__))
        values, names = content["pendulum"], [f.name for f in fields(Pendulum)]
        if values is not None and values.keys() != set(names):
            have = ", ".join(values) or "none"
            raise ValueError(f"`pendulum` must have {', '.join(names)}, but has {have}")
        with naming("pendulum"):
            pendulum = None if values is None else Pendulum(**values)
        stored = StoredDesign(
            path=file,
            tables=content["job"],
            pendulum=pendulum,
            status=DesignStatus[content["status"]],
            content=content,
        )
        # Build the job now: a damaged file is rejected here, and not later when the job is used.
        _ = stored.tables and stored.job
    except ValueError as error:
        raise ValueError(f"{file} is not the design of a report: {error}") from None
    return stored
