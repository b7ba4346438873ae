"""Keys of the job file: their types, defaults and descriptions, and what each of them goes with.

Types, defaults and ranges are those of the dataclasses that the tables become; what no dataclass holds is
declared here. `python -m tpd.design.job_keys` writes `job.schema.json`, from which the command line takes its
options and their help, and editors what may stand in a file.
"""

from __future__ import annotations

import ast
import inspect
import json
import textwrap
import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta

from tpd.core.checks import shown
from tpd.core.files import path_of, readable
from tpd.core.formatting import decimal_comma, meant
from tpd.design.criteria import DEFAULT_LIMITS, KINDS, DesignSpace, Limit, Requirements, Risk, limit_of
from tpd.design.settings import (
    DEFAULT_SPACE,
    SCATTERED,
    VALIDATION_RUNS,
    VALIDATION_SHARE,
    Descent,
    GroundSearch,
)
from tpd.records.read import BUILT_IN, SETS
from tpd.scene.bob import Bob
from tpd.scene.conditions import FACTORS, Conditions
from tpd.scene.ensemble import Ensemble
from tpd.scene.ground_motion import PULSES, Pulse
from tpd.scene.scene import Block, Harmonic, Scene, paper_scene

Tables = dict[str, dict[str, Any]]
"""Values of a job by table and key."""
SCHEMA = Path(__file__).with_name("job.schema.json")
PAPER = paper_scene()
SHAPE = "width", "height", "mass"
"""Keys of [block] that a block of one's own needs."""
_Whole = Annotated[int, Meta(le=2**31 - 1)]
"""A count or a seed: beyond it random generators and arrays fail."""


class Key(NamedTuple):
    """A key of a table."""

    type: Any
    default: Any
    """None where the key is left out, or where its default depends on other keys."""
    says: str | tuple[type, str | None]
    """Description, or the class and the field whose docstring is it; without a field the class's own."""


def keys_of(kind: type, *names: str) -> dict[str, Key]:
    """Keys of the fields of a dataclass, or of some of them, that a file can say."""
    hints, found = get_type_hints(kind), {}
    for f in fields(kind):
        plain = _plain(hints[f.name])
        if plain is not None and f.name in (names or hints):
            default = f.default if f.default_factory is MISSING else f.default_factory()
            found[f.name] = Key(plain, None if default is MISSING else default, (kind, f.name))
    return found


def _plain(hint: Any) -> Any:
    """The part of a type that a file can hold; None where there is none."""
    if get_origin(hint) in (Union, types.UnionType):
        parts = [part for part in map(_plain, get_args(hint)) if part is not None]
        return Union[tuple(parts)] if parts else None  # noqa: UP007
    if get_origin(hint) is tuple:
        return hint
    # Numbers that may be traced are of any type for Python.
    return {float: float, Any: float, int: _Whole, str: str, bool: bool}.get(hint)


def _limit(kind: type[Limit]) -> Key:
    """Key of a limit: its number, or whether it is asked for."""
    preset, own = limit_of(DEFAULT_LIMITS, kind), [f.name for f in fields(kind)]
    is_number = len(own) == 1 and get_type_hints(kind)[own[0]] in (float, Any)
    default = None if preset is None else getattr(preset, own[0]) if is_number else True
    return Key(float | bool if is_number else bool, default, (kind, None))


def _of_searches() -> dict[str, Key]:
    """Keys of both searches; where they have different defaults these depend on the search."""
    found: dict[str, Key] = {}
    for kind in (Descent, GroundSearch):
        for name, key in keys_of(kind).items():
            other = found.setdefault(name, key)
            if other.default != key.default:
                found[name] = other._replace(default=None)
    return found


_names = ", ".join((*BUILT_IN, *SETS))
_pulse = keys_of(Pulse)
TABLES: dict[str, dict[str, Key]] = {
    "project": {
        "name": Key(
            Annotated[str, Meta(max_length=100, pattern=r"^[^\x00-\x1f\x7f]*$")],
            None,
            "name of the project, for titles",
        )
    },
    "block": {
        name: key._replace(default=getattr(PAPER.block, name) if name in SHAPE else None)
        for name, key in keys_of(Block).items()
    },
    "motion": {
        "kind": Key(
            Literal["harmonic", "pulse", "records"],
            None,
            "kind of motion (default: that whose keys are given, else harmonic)",
        ),
        **{
            name: key._replace(default=getattr(PAPER.motion, name)) for name, key in keys_of(Harmonic).items()
        },
        "pulse": _pulse["kind"],
        "pulse_frequency": _pulse["frequency"],
        "pga": Key(float, None, "largest acceleration of a pulse, or of each record, g"),
        "cycles": _pulse["cycles"],
        "phase": _pulse["phase"],
        "records": Key(
            tuple[str, ...], None, f"files and folders of records, in a job file relative to it, or {_names}"
        ),
        "scales": Key(
            tuple[float, ...],
            None,
            "values of the intensity, in its unit, that every motion is scaled to, such as 1.5 2 3",
        ),
        "intensity": Key(
            str,
            None,
            "what the scales count: pga_star, which is PGA over g tan(alpha), pgv_star, pga in g, pgv in m/s "
            "or scale, a factor (default pga_star, of a pulse scale)",
        ),
        "validation_share": Key(
            float | tuple[str, ...],
            None,
            "share of the records, whole earthquakes, that the design is judged on and not tuned to, or "
            f"files, folders and sets of others (default {VALIDATION_SHARE:g})",
        ),
        "event": Key(
            tuple[str, ...],
            None,
            "earthquakes of records whose files name none: one name, or one for each of the records "
            "(default: a folder is one earthquake)",
        ),
        "channel": Key(_Whole, None, "channel of files with several, from 0 (default: all horizontal ones)"),
        "dt": Key(float, None, "sampling interval of files without times, s"),
        "columns": Key(
            tuple[str, ...],
            None,
            "columns of a table by their names, from 1, such as time=1 N=2 'E (gal)'=3; or rows: samples row "
            "by row",
        ),
        "skip": Key(_Whole, None, "number of lines at the top of a table that are not read"),
        "scale": Key(float, None, "factor on all samples of a file whose numbers have to be multiplied"),
        "unit": Key(str, None, "unit of files that do not say: g, m/s2, cm/s2"),
        "baseline": Key(
            str,
            None,
            "mean, linear or none: remove an offset, a drift, or nothing (default: the mean of uncorrected "
            "records)",
        ),
    },
    "bob": keys_of(Bob),
    "site": keys_of(Scene, "gravity"),
    "space": keys_of(DesignSpace),
    "conditions": {
        "exactly": Key(bool, False, "search for the motion itself alone with a point bob, as in the paper"),
        "band": Key(
            tuple[float, float], None, "lower and upper end of a band of frequencies, Hz (default: around it)"
        ),
        "frequencies": Key(
            _Whole,
            inspect.signature(Conditions.band).parameters["count"].default,
            "number of frequencies in the band",
        ),
        "amplitudes": Key(tuple[float, ...], (1.0,), "factors on the amplitude of the base motion"),
        "samples": Key(_Whole, 64, "number of samples of what [scatter] holds"),
    },
    "scatter": {name: Key(float, None, (Ensemble, name)) for name in FACTORS},
    "starts": {
        "kind": Key(
            Literal["any", "rest"],
            "any",
            "any: the largest motion that attracts; rest: rest wherever it holds",
        )
    },
    "risk": {
        "measure": Key(
            Literal["worst", "expected", "cvar"],
            "worst",
            "worst, expected or cvar, the mean of the worst share of the conditions (under pulses and "
            "records the default is expected)",
        ),
        "share": Key(
            float,
            inspect.signature(Risk.cvar).parameters["share"].default,
            "share of the conditions in the measure cvar",
        ),
    },
    "limits": {kind.name: _limit(kind) for kind in KINDS},
    "requirements": {
        **keys_of(Requirements),
        "measure": Key(Literal["overturning", "tilt"], None, (Requirements, "measure")),
    },
    "search": {
        "model": Key(
            Literal["smoothed", "piecewise"],
            None,
            "model whose gradients the descents take (default smoothed: signs and impacts smoothed, "
            "orbits followed by diffrax; piecewise: the exact ones)",
        ),
        **_of_searches(),
        "seed": Key(_Whole, 0, "seed of every random choice, the runs that verify and judge included"),
        "pareto": Key(bool, False, "also find three lighter pendulums, each verified"),
    },
    "ensemble": keys_of(Ensemble),
}
"""All keys by table and name."""
READING = ("channel", "dt", "unit", "baseline", "columns", "skip", "scale")
"""Keys of [motion] that say how files of records are read."""
_SHAKEN = ("pulse", "records")
_USUAL = {("space", "damping_ratio"): DEFAULT_SPACE.damping_ratio, ("risk", "measure"): "expected"}
_DEFAULTS: dict[str, dict[tuple[str, str], Any]] = {
    "harmonic": {("ensemble", "size"): VALIDATION_RUNS},
    "pulse": _USUAL | {("motion", "intensity"): "scale", ("motion", "scales"): (1.0,)},
    "records": _USUAL
    | {("motion", "intensity"): "pga_star", ("motion", "validation_share"): VALIDATION_SHARE},
}
"""Defaults that depend on the kind of motion, in place of those of `TABLES`."""
_KINDS: dict[tuple[str, str], tuple[str, ...]] = {
    **{("motion", name): ("harmonic",) for name in ("amplitude", "frequency")},
    **{("motion", name): ("pulse",) for name in ("pulse", "pulse_frequency", "cycles", "phase")},
    **{("motion", name): _SHAKEN for name in ("pga", "scales", "intensity")},
    **{("motion", name): ("records",) for name in ("records", "validation_share", "event", *READING)},
    **{(table, name): ("harmonic",) for table in ("conditions", "starts") for name in TABLES[table]},
    **{("limits", kind.name): ("harmonic",) for kind in KINDS if not kind.of_motion},
    **{
        ("search", name): ("harmonic",)
        for name in ("model", *_of_searches())
        if name not in keys_of(GroundSearch)
    },
    **{("search", name): _SHAKEN for name in keys_of(GroundSearch) if name not in keys_of(Descent)},
    **{
        (table, name): ("harmonic",)
        for table in ("scatter", "ensemble")
        for name in TABLES[table]
        if name not in SCATTERED
    },
}
"""Kinds of motion under which a key has an effect; others have it under all."""
MOTIONS = {"harmonic": "a harmonic motion", "pulse": "a pulse", "records": "records"}
_CYCLIC = [name for name, kind in PULSES.items() if kind.periods is None]
_FILE = ("a file of a record", lambda full: full["motion"]["records"] is None or _names_files(full))
_SEVERAL = ("several conditions, [conditions] or [scatter]", lambda full: size_of(full) > 1)
_ONLY_WITH: dict[tuple[str, str], tuple[str, Callable[[Tables], bool]]] = {
    ("motion", "cycles"): (
        f"the pulses {' and '.join(_CYCLIC)}",
        lambda full: full["motion"]["pulse"] in _CYCLIC,
    ),
    **{("motion", name): _FILE for name in ("event", *READING)},
    ("motion", "phase"): (
        "the pulse mavroeidis-papageorgiou",
        lambda full: full["motion"]["pulse"] == "mavroeidis-papageorgiou",
    ),
    ("conditions", "exactly"): (
        "one motion: no band, no amplitudes and no scatter",
        lambda full: size_of(full) == 1,
    ),
    ("bob", "aspect"): ("`bob.shape` cylinder", lambda full: full["bob"]["shape"] == "cylinder"),
    ("conditions", "frequencies"): (
        "a band, `conditions.band`",
        lambda full: full["conditions"]["band"] is not None,
    ),
    ("conditions", "samples"): ("a width in [scatter]", lambda full: bool(widths_of(full))),
    ("search", "pareto"): (
        "two bounds for the mass, `space.mass` or `space.mass_ratio`",
        lambda full: not any(isinstance(full["space"][x], float) for x in ("mass", "mass_ratio")),
    ),
    ("risk", "measure"): _SEVERAL,
    ("risk", "share"): ("`risk.measure` cvar", lambda full: full["risk"]["measure"] == "cvar"),
}
"""Keys that have an effect only together with another one: this one in words, and whether a job has it."""


def widths_of(full: Tables) -> dict[str, float]:
    """Relative half widths of what is uncertain."""
    return {name: width for name, width in full["scatter"].items() if width is not None}


def is_around(full: Tables) -> bool:
    """Whether the conditions are the neighbourhood of the motion, which is the default."""
    asked = full["conditions"]
    return not (
        asked["exactly"] or asked["band"] is not None or asked["amplitudes"] != (1.0,) or widths_of(full)
    )


def size_of(full: Tables) -> int:
    """Number of conditions."""
    asked = full["conditions"]
    if is_around(full):
        return len(Conditions.around(PAPER))
    frequencies = 1 if asked["band"] is None else asked["frequencies"]
    return frequencies * len(asked["amplitudes"]) * (asked["samples"] if widths_of(full) else 1)


def _names_files(full: Tables) -> bool:
    """Whether some record is of a file: those that are built in state all that there is to say."""
    held = full["motion"]["validation_share"]
    names = *full["motion"]["records"], *(held if isinstance(held, tuple) else ())
    return not {*names} <= {*BUILT_IN, *SETS}


def placed(table: str, values: Any, folder: Path) -> Any:
    """Values of a table, those of records with absolute paths."""
    if table != "motion" or not isinstance(values, Mapping):
        return values

    def place(value: Any) -> Any:
        listed = isinstance(value, (list, tuple)) and all(isinstance(name, str) for name in value)
        known = {*BUILT_IN, *SETS}
        if not listed:
            return value
        return [x if x in known else readable(str(folder.resolve() / path_of(x))) for x in value]

    return {key: place(x) if key in ("records", "validation_share") else x for key, x in values.items()}


def as_typed(given: Mapping[str, Any]) -> Tables:
    """The tables, each value of its type.

    Raises:
        ValueError: an unknown table or key, or a value of the wrong type.
    """
    out: Tables = {}
    for table, values in given.items():
        if table not in TABLES:
            raise ValueError(f"unknown table [{_cut(table)}]{meant(table, TABLES)}")
        if not isinstance(values, Mapping):
            raise ValueError(f"`{table}` must be a table, but is {shown(values)}")
        out[table] = {}
        for key, value in values.items():
            if key not in TABLES[table]:
                raise ValueError(f"unknown key `{_cut(key)}` in [{table}]{meant(key, TABLES[table])}")
            type_ = TABLES[table][key].type
            # Key by key: the sentence can then name the key and what is allowed.
            try:
                out[table][key] = msgspec.convert(value, type_, strict=True)
            except msgspec.ValidationError:
                words, close = allowed(msgspec.json.schema(type_)), ""
                if isinstance(value, str):
                    close = meant(value, msgspec.json.schema(type_).get("enum", ()), listing=False)
                close = close or decimal_comma(shown(value))
                raise ValueError(f"`{table}.{key}` must be {words}, but is {shown(value)}{close}") from None
    return out


def _cut(name: str) -> str:
    """A name as it stands in a message."""
    return shown(name).strip("'")


def allowed(schema: Mapping[str, Any]) -> str:
    """Values of a JSON schema of a key in words."""
    if "anyOf" in schema:
        return " or ".join(map(allowed, schema["anyOf"]))
    if "enum" in schema:
        return f"one of {', '.join(schema['enum'])}"
    if schema["type"] == "array":
        pair = "prefixItems" in schema
        return "a pair of numbers" if pair else f"a list, each {allowed(schema['items'])}"
    nouns = {"number": "a number", "boolean": "true or false", "string": "a text"}
    nouns["integer"] = f"a whole number up to {schema.get('maximum')}"
    most = schema.get("maxLength")
    return nouns[schema["type"]] + ("" if most is None else f" in one line of at most {most} characters")


def kinds_in(motion: Mapping[str, Any]) -> dict[str, list[str]]:
    """Kinds of motion that keys of [motion] are of, and these keys."""
    if "kind" in motion:
        return {motion["kind"]: ["kind"]}
    found: dict[str, list[str]] = {}
    for key in motion:
        kinds = _KINDS["motion", key]
        if len(kinds) == 1:
            found.setdefault(kinds[0], []).append(key)
    return found


def complete(given: Mapping[str, Any]) -> Tables:
    """The typed tables with all keys; what is left out has its default."""
    typed = as_typed(given)
    kinds = kinds_in(typed.get("motion", {}))
    if len(kinds) > 1:
        named = " and ".join(f"of {MOTIONS[kind]} (`{keys[0]}`)" for kind, keys in kinds.items())
        raise ValueError(f"[motion] has keys {named}, but a motion is of one kind")
    kind = next(iter(kinds), "harmonic")
    full: Tables = {}
    for table, keys in TABLES.items():
        usual = {name: default_of(kind, table, name) for name in keys}
        full[table] = usual | typed.get(table, {})
    full["motion"]["kind"] = kind
    # Of words of the command line the paths are relative to where it runs.
    full["motion"] |= {
        key: tuple(x) if isinstance(x, list) else x
        for key, x in placed("motion", full["motion"], Path()).items()
    }
    return full


def default_of(kind: str, table: str, name: str) -> Any:
    """Default of a key under a kind of motion."""
    return _DEFAULTS[kind].get((table, name), TABLES[table][name].default)


def lacks(full: Tables, table: str, key: str) -> str:
    """Words for what a key needs and the job does not have; empty where the key has an effect."""
    kinds = _KINDS.get((table, key), tuple(MOTIONS))
    if full["motion"]["kind"] not in kinds:
        return " or ".join(MOTIONS[kind] for kind in kinds)
    words, holds = _ONLY_WITH.get((table, key), ("", bool))
    return "" if holds(full) else words


def json_schema() -> str:
    """The schema of a job file as JSON Schema, for the command line and for editors."""
    tables = {}
    for table, keys in TABLES.items():
        properties = {}
        for name, key in keys.items():
            says = {"description": key.says if isinstance(key.says, str) else _doc(*key.says)}
            usual = {} if key.default is None else {"default": msgspec.to_builtins(key.default)}
            properties[name] = says | usual | msgspec.json.schema(key.type)
        tables[table] = {"type": "object", "additionalProperties": False, "properties": properties}
    content = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Job file of tpd optimise",
        "type": "object",
        "additionalProperties": False,
        "properties": tables,
    }
    return json.dumps(content, indent=1) + "\n"


def _doc(owner: type, name: str | None) -> str:
    """Docstring of a class, or of one of its fields, in one line."""
    if name is None:
        return " ".join(str(owner.__doc__).split())
    for kind in owner.__mro__:
        body = [] if kind is object else ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0].body  # type: ignore[attr-defined]
        for field, text in pairwise(body):
            is_field = isinstance(field, ast.AnnAssign) and getattr(field.target, "id", "") == name
            if is_field and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                return " ".join(str(text.value.value).split())
    raise ValueError(f"the field `{name}` of {owner.__name__} has no docstring")


if __name__ == "__main__":
    SCHEMA.write_text(json_schema(), encoding="utf-8")
