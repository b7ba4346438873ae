"""Reader and writer of the job file: the arguments of `tpd.optimise` as tables of TOML or JSON.

A job file is read by `read`, its tables become a `Job` by `job_of`, and `dump` writes a job as a file that is
read back as the same job. `python -m tpd.cli.config` prints the JSON schema of the file.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from tpd.analysis.attractors import Starts
from tpd.analysis.ensemble import Ensemble
from tpd.cli import build
from tpd.cli.schema import JobFile, json_schema, keys
from tpd.core.conditions import Conditions
from tpd.core.scene import Scene
from tpd.design.criteria import DesignSpace, Limit, Risk, Worth
from tpd.design.methods import Method

_Holds = Callable[[JobFile], bool]
_SEVERAL = "several conditions, [conditions] or [scatter]"


def _is_descent(file: JobFile) -> bool:
    return file.search.method == "descent"


def _has_several(file: JobFile) -> bool:
    return file.size > 1


_ONLY_WITH: dict[tuple[str, str], tuple[str, _Holds]] = {
    ("conditions", "exactly"): (
        "one motion: no band, no amplitudes and no scatter",
        lambda file: file.size == 1,
    ),
    ("bob", "aspect"): ("`bob.shape` cylinder", lambda file: file.bob.shape == "cylinder"),
    ("conditions", "frequencies"): (
        "a band, `conditions.band`",
        lambda file: file.conditions.band is not None,
    ),
    ("conditions", "samples"): ("a width in [scatter]", lambda file: bool(file.widths)),
    ("risk", "measure"): (_SEVERAL, _has_several),
    ("risk", "share"): ("`risk.measure` cvar", lambda file: file.risk.measure == "cvar"),
    ("search", "optimiser"): ("`search.method` descent", _is_descent),
    ("search", "model"): ("`search.method` descent", _is_descent),
    ("search", "tolerance"): ("`search.method` descent", _is_descent),
}
"""Keys that have an effect only together with another one: this one in words, and whether a job has it."""


@dataclass(frozen=True, kw_only=True)
class Job:
    """Arguments of `tpd.optimise`, and the tables that they were made of. Two jobs are equal if these are."""

    file: JobFile
    """All tables; defaults that depend on other keys are filled in."""
    scene: Scene = field(compare=False)
    space: DesignSpace = field(compare=False)
    conditions: Conditions | None = field(compare=False)
    """None for the neighbourhood of the motion."""
    starts: Starts = field(compare=False)
    risk: Risk = field(compare=False)
    limits: tuple[Limit, ...] = field(compare=False)
    method: Method = field(compare=False)
    ensemble: Ensemble = field(compare=False)
    worth: Worth = field(compare=False)

    @property
    def seed(self) -> int:
        """Seed of the search."""
        return self.file.search.seed

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `tpd.optimise` beside the scene."""
        names = "space", "conditions", "starts", "risk", "limits", "method", "ensemble", "worth", "seed"
        return {name: getattr(self, name) for name in names}


def read(path: Path) -> dict[str, Any]:
    """Return the tables of a job file, not yet checked.

    Raises:
        ValueError: the file cannot be read, or is not TOML.
    """
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text file in UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path} is not valid TOML: {error}") from None
    except RecursionError:
        raise ValueError(f"{path} is not a job file: it nests too deeply") from None
    if not found:
        raise ValueError(f"{path} is empty: `tpd new` writes a job file to begin with")
    return found


def typed(given: Mapping[str, Any]) -> JobFile:
    """Return the tables as typed values; what is left out has its default.

    Raises:
        ValueError: an unknown table or key, or a value of the wrong type or out of range.
    """
    plain = {table: _checked(table, values) for table, values in given.items()}
    return msgspec.convert(plain, JobFile)


def _checked(table: str, values: Any) -> dict[str, Any]:
    """The values of a table, each of the type that the schema says."""
    if table not in keys():
        raise ValueError(f"unknown table [{table}]; allowed are {', '.join(keys())}")
    known = keys()[table]
    if not isinstance(values, Mapping):
        raise ValueError(f"`{table}` must be a table, but is {values!r}")
    for key, value in values.items():
        if key not in known:
            raise ValueError(f"unknown key `{key}` in [{table}]; allowed are {', '.join(known)}")
        # Key by key rather than table by table: the sentence can then name the key and what is allowed.
        try:
            msgspec.convert(value, known[key].type, strict=True)
        except msgspec.ValidationError:
            raise ValueError(f"`{table}.{key}` must be {known[key].allowed}, but is {value!r}") from None
    return dict(values)


def chosen(given: Mapping[str, Any]) -> JobFile:
    """Return the typed tables, with the method and the optimiser filled in.

    Raises:
        ValueError: an unknown table or key, or a value of the wrong type or out of range.
    """
    file = typed(given)
    method = file.search.method or "descent"
    optimiser = file.search.optimiser or ("adam" if method == "descent" else None)
    return replace(file, search=replace(file.search, method=method, optimiser=optimiser))


def merged(given: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the tables `given` with the values of `over` in place of theirs.

    A key that has no effect any more, because `over` chooses otherwise, is left out: a file with a share for
    the measure cvar can be run with another measure.

    Raises:
        ValueError: an unknown table or key, or a value of the wrong type or out of range.
    """
    # What a key needs may be in the file, among the options, or the default: it is asked before and after.
    before = chosen(given)
    out = {table: dict(values) for table, values in given.items()}
    for table, values in over.items():
        out.setdefault(table, {}).update(values)
    after = chosen(out)
    for (table, key), (_, holds) in _ONLY_WITH.items():
        is_from_file = key in given.get(table, {}) and key not in over.get(table, {})
        if is_from_file and holds(before) and not holds(after):
            del out[table][key]
    return out


def job_of(given: Mapping[str, Any]) -> Job:
    """Return the job of the tables of a job file; what is left out has its default.

    Raises:
        ValueError: an unknown table or key, a bad value, a key that has no effect, or a scene of which a
            part is missing.
    """
    file = chosen(given)
    build.refuse_mixture(given)
    _refuse_without_effect(file)
    scene = build.scene_of(file)
    method, space = build.method_of(file), build.space_of(file)
    conditions = build.conditions_of(file, scene)
    build.check_moves(file, scene, conditions or Conditions.exactly(), space)
    return Job(
        file=build.with_defaults(file, scene, method),
        scene=scene,
        space=space,
        conditions=conditions,
        starts=build.starts_of(file),
        risk=build.risk_of(file),
        limits=build.limits_of(file),
        method=method,
        ensemble=build.ensemble_of(file),
        worth=build.worth_of(file),
    )


def _refuse_without_effect(file: JobFile) -> None:
    """Refuse a value that has no effect, unless it is the default: a file may list all keys."""
    for (table, key), (needed, holds) in _ONLY_WITH.items():
        # A silent key would let somebody believe in a limit or a seed that does nothing.
        is_default = getattr(getattr(file, table), key) == keys()[table][key].default
        if not is_default and not holds(file):
            raise ValueError(f"`{table}.{key}` goes with {needed}, which this job does not have")


def scene_of(given: Mapping[str, Any]) -> Scene:
    """Return the scene of the tables of a job file; what is left out has its default.

    Raises:
        ValueError: an unknown table or key, a value of the wrong type or out of range, or a scene of which
            a part is missing.
    """
    file = typed(given)
    build.refuse_mixture(given)
    return build.scene_of(file)


def tables(job: Job) -> dict[str, dict[str, Any]]:
    """Return the tables of a job as plain values, without the keys that have no effect in it."""
    out: dict[str, dict[str, Any]] = {}
    for table, values in msgspec.to_builtins(job.file).items():
        # TOML has no null: what is not set is left out, and so is a text that is empty.
        effective = {
            key: list(value) if isinstance(value, tuple) else value
            for key, value in values.items()
            if value not in (None, "") and _has_effect(job.file, table, key)
        }
        if effective:
            out[table] = effective
    return out


def _has_effect(file: JobFile, table: str, key: str) -> bool:
    return (table, key) not in _ONLY_WITH or _ONLY_WITH[table, key][1](file)


def dump(job: Job) -> str:
    """Return the job as TOML that is read back as the same job."""
    lines = ["# Repeat this run: tpd optimise --scene <this file> --out <new directory>"]
    for table, values in tables(job).items():
        lines += ["", f"[{table}]", *(f"{key} = {_toml(value)}" for key, value in values.items())]
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    """A word, a number, true or false, or a list of numbers in TOML."""
    if isinstance(value, str):
        # A basic string of TOML is written as one of JSON is.
        return json.dumps(value)
    return str(value).lower() if isinstance(value, bool) else repr(value)


if __name__ == "__main__":
    print(json_schema(), end="")
