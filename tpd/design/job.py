"""A job file: scene, design space and search settings in TOML, read and written."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from tpd.analysis.ensemble import Ensemble
from tpd.core import checks
from tpd.core.scene import Block, Harmonic, Scene, paper_scene
from tpd.design.many_asked import METHODS, TABLES, Asked, ensemble_of, plain
from tpd.design.result import DesignSpace


@dataclass(frozen=True, kw_only=True)
class Search:
    """Settings of the search; see `optimise`, and over many conditions `optimise_over`.

    Raises:
        ValueError: a value out of range.
    """

    starts: int = 8
    steps: int = 30
    screening: int = 192
    seed: int = 0
    tolerance: float | None = 0.01
    """Under one shaking only: None over many conditions."""
    method: str | None = None
    """Over many conditions only: None under one shaking."""

    def __post_init__(self) -> None:
        for name in ("starts", "steps", "screening"):
            checks.count(name, getattr(self, name))
        checks.not_negative("seed", self.seed)
        if self.tolerance is not None:
            checks.positive("tolerance", self.tolerance)
        if self.method is not None:
            checks.one_of("method", self.method, METHODS)


_OVER = Search(starts=64, steps=40, screening=512, tolerance=None, method="sequential")
"""What is meant over many conditions unless said otherwise: starts cost little there."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """Everything that `tpd optimise` needs to be repeated; the default is the paper's block."""

    scene: Scene = field(default_factory=paper_scene)
    space: DesignSpace = field(default_factory=DesignSpace)
    search: Search = field(default_factory=Search)
    ensemble: Ensemble = field(default_factory=Ensemble)
    """Runs that judge the design."""
    asked: Asked | None = None
    """What is asked over many conditions; None for the scene's own shaking, from rest."""


def defaults() -> dict[str, dict[str, Any]]:
    """The tables of the default job."""
    return tables(Job())


def tables(job: Job) -> dict[str, dict[str, Any]]:
    """The job as nested tables of plain values, without what is None."""
    return {
        "block": plain(job.scene.block),
        "motion": plain(job.scene.motion),
        "site": {"gravity": job.scene.gravity},
        "space": plain(job.space),
        "search": plain(job.search),
        "ensemble": plain(job.ensemble),
        **({} if job.asked is None else job.asked.tables()),
    }


_ALLOWED = {
    "block": [f.name for f in fields(Block)],
    "motion": [f.name for f in fields(Harmonic)],
    "site": ["gravity"],
    "space": [f.name for f in fields(DesignSpace)],
    "search": [f.name for f in fields(Search)],
}
_PAIRS = ("space.mass_ratio", "space.length_ratio", "space.damping_ratio")
_WORDS = ("block.restitution", "search.method")
_WHOLE = ("search.starts", "search.steps", "search.screening", "search.seed")


def build(given: dict[str, Any]) -> Job:
    """The job of nested tables; what is left out is the default's.

    Raises:
        ValueError: an unknown or ill-typed key, or a value out of range.
    """
    merged = defaults()
    asked, ensemble = Asked.of(given), ensemble_of(given)
    if asked is not None:
        merged["search"] = plain(_OVER)
    for table, values in given.items():
        if table in TABLES:
            continue
        if table not in _ALLOWED:
            raise ValueError(f"unknown table [{table}]; allowed are {_listed((*_ALLOWED, *TABLES))}")
        if not isinstance(values, dict):
            raise ValueError(f"`{table}` must be a table, but is {values!r}")
        for key, value in values.items():
            if key not in _ALLOWED[table]:
                raise ValueError(f"unknown key `{key}` in [{table}]; allowed are {_listed(_ALLOWED[table])}")
            merged[table][key] = _typed(f"{table}.{key}", value)
    if asked is not None:
        # Two models that must agree on an amplitude are compared under one shaking only.
        merged["search"]["tolerance"] = None
    elif "method" in merged["search"]:
        raise ValueError("`search.method` goes with conditions, such as a band: none are given")
    block = given.get("block", {})
    if "restitution" in block and "friction" not in block:
        # The default's friction goes with the default's impacts.
        del merged["block"]["friction"]
    space: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in merged["space"].items()}
    scene = Scene(Block(**merged["block"]), Harmonic(**merged["motion"]), **merged["site"])
    space_, search = DesignSpace(**space), Search(**merged["search"])
    return Job(scene=scene, space=space_, search=search, ensemble=ensemble, asked=asked)


def _typed(name: str, value: Any) -> Any:
    if name in _WORDS and isinstance(value, str):
        return value
    pair = name in _PAIRS and isinstance(value, list) and len(value) == 2
    numbers: list[Any] = value if pair else [value]
    if not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in numbers):
        allowed = "a number or a pair of numbers" if name in _PAIRS else "a number"
        raise ValueError(f"`{name}` must be {allowed}, but is {value!r}")
    if name in _WHOLE:
        if not isinstance(value, int):
            raise ValueError(f"`{name}` must be a whole number, but is {value!r}")
        return value
    converted = [float(x) for x in numbers]
    return converted if pair else converted[0]


def _listed(names: Any) -> str:
    return ", ".join(sorted(names))


def read(path: Path) -> dict[str, Any]:
    """The tables of a job file.

    Raises:
        ValueError: the file cannot be read, is not TOML, or holds something beside tables.
    """
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text file in UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path} is not valid TOML: {error}") from None
    for table, values in given.items():
        if not isinstance(values, dict):
            raise ValueError(f"`{table}` must be a table, but is {values!r}")
    return given


def dump(job: Job) -> str:
    """The job as TOML that `read` and `build` turn back into the same job."""
    lines = ["# Repeat this run: tpd optimise --scene <this file> --out <new directory>"]
    for table, values in tables(job).items():
        lines += ["", f"[{table}]", *(f"{key} = {_toml(value)}" for key, value in values.items())]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value)
    return str(value).lower() if isinstance(value, bool) else repr(value)
