"""Keys of the job file: their types, defaults and descriptions, and their dependence on other keys.

Types, defaults and ranges come from the dataclasses that are made from the tables. Keys without a dataclass
are declared here. `python -m tpd.design.job_keys` writes `job.schema.json`. The command line takes its
options and their help from this file, and editors can check a job file with it.
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
from tpd.core.formatting import meant, number_hint
from tpd.design.risk import Risk
from tpd.design.settings import (
    SCATTERED,
    VALIDATION_RUNS,
    VALIDATION_SHARE,
    Descent,
    GroundSearch,
)
from tpd.design.space import DesignSpace
from tpd.limits import DEFAULT_LIMITS, LIMIT_KINDS, Limit, Requirements, limit_of
from tpd.records.read import BUILT_IN, SETS
from tpd.scene.bob import Bob
from tpd.scene.conditions import FACTORS, Conditions
from tpd.scene.ensemble import Ensemble
from tpd.scene.ground_motion import PULSES, Pulse
from tpd.scene.scene import Block, Harmonic, Scene, paper_scene

Tables = dict[str, dict[str, Any]]
"""Values of a job, by table and key."""
SCHEMA = Path(__file__).with_name("job.schema.json")
"""File with the JSON schema of a job file."""
PAPER = paper_scene()
"""Scene of the paper, whose block and motion are the defaults."""
SHAPE = "width", "height", "mass"
"""Keys of [block] that are required for a user's own block."""
_Whole = Annotated[int, Meta(le=2**31 - 1)]
"""Count or seed. Random generators and arrays fail for larger numbers."""


class Key(NamedTuple):
    """Key of a table."""

    type: Any
    """Type of the value."""
    default: Any
    """Default value; None if the key has no default, or if its default depends on other keys."""
    says: str | tuple[type, str | None]
    """Description as a text, or as a class and the name of a field whose docstring is the description.
    Without a field it is the docstring of the class."""


def keys_of(kind: type, *names: str) -> dict[str, Key]:
    """Return the keys for the fields of a dataclass, or for some of them, as far as a file can state them."""
    hints, keys = get_type_hints(kind), {}
    # Fields that a file cannot state, such as objects of Python, have no key.
    for f in fields(kind):
        plain = _plain(hints[f.name])
        if plain is not None and f.name in (names or hints):
            default = f.default if f.default_factory is MISSING else f.default_factory()
            keys[f.name] = Key(plain, None if default is MISSING else default, (kind, f.name))
    return keys


def _plain(hint: Any) -> Any:
    """Return the part of a type that a file can contain; None if there is none."""
    if get_origin(hint) in (Union, types.UnionType):
        parts = [part for part in map(_plain, get_args(hint)) if part is not None]
        return Union[tuple(parts)] if parts else None  # noqa: UP007
    if get_origin(hint) is tuple:
        return hint
    # Numbers that JAX may trace are annotated with `Any`.
    return {float: float, Any: float, int: _Whole, str: str, bool: bool}.get(hint)


def _limit(kind: type[Limit]) -> Key:
    """Return the key of a limit: a number, or true if the limit has none."""
    preset, own = limit_of(DEFAULT_LIMITS, kind), [f.name for f in fields(kind)]
    # A limit with a single number has this number as its value. Any other limit is only switched on or off.
    is_number = len(own) == 1 and get_type_hints(kind)[own[0]] in (float, Any)
    default = None if preset is None else getattr(preset, own[0]) if is_number else True
    return Key(float | bool if is_number else bool, default, (kind, None))


_names = ", ".join((*BUILT_IN, *SETS))
_pulse, _descent, _ground_search = map(keys_of, (Pulse, Descent, GroundSearch))
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
    "excitation": {
        "kind": Key(
            Literal["harmonic", "pulse", "records"],
            None,
            "kind of motion (default: the kind to which the given keys belong, else harmonic)",
        ),
        **{
            name: key._replace(default=getattr(PAPER.excitation, name))
            for name, key in keys_of(Harmonic).items()
        },
        "pulse": _pulse["kind"],
        "pulse_frequency": _pulse["frequency"],
        "pga": Key(float, None, "peak acceleration of a pulse, or of each record, in g"),
        "cycles": _pulse["cycles"],
        "phase": _pulse["phase"],
        "records": Key(
            tuple[str, ...], None, f"files and folders of records, relative to a job file, or {_names}"
        ),
        "scales": Key(
            tuple[float, ...],
            None,
            "values of the intensity, in its unit, to which every motion is scaled, such as 1.5 2 3",
        ),
        "intensity": Key(
            str,
            None,
            "intensity measure of the scales: pga_star (PGA over g tan(alpha)), pgv_star, pga in g, pgv in "
            "m/s, or scale, a factor (default pga_star; for a pulse scale)",
        ),
        "validation_share": Key(
            float | tuple[str, ...],
            None,
            "share of the records, in whole earthquakes, that is kept for the validation, or files, folders "
            f"and sets of other records for it (default {VALIDATION_SHARE:g})",
        ),
        "event": Key(
            tuple[str, ...],
            None,
            "names of the earthquakes, if the files do not state them: one name for all records, or one for "
            "each record (default: each folder is one earthquake)",
        ),
        "channel": Key(_Whole, None, "number of the channel, from 0 (default: all horizontal ones)"),
        "dt": Key(float, None, "sampling interval of files that do not contain times, s"),
        "columns": Key(
            tuple[str, ...],
            None,
            "names and numbers (from 1) of the columns of a table, such as time=1 N=2 'E (gal)'=3; or rows, "
            "if the samples continue row by row",
        ),
        "skip": Key(_Whole, None, "number of lines at the top of a table that are skipped"),
        "factor": Key(float, None, "factor by which all samples of a file are multiplied"),
        "unit": Key(str, None, "unit of files that do not state one: g, m/s2, cm/s2"),
        "baseline": Key(
            str,
            None,
            "baseline correction: mean removes an offset, linear a drift, none nothing (default: mean for "
            "uncorrected records)",
        ),
    },
    "bob": keys_of(Bob),
    "site": keys_of(Scene, "gravity"),
    "space": keys_of(DesignSpace),
    "conditions": {
        "exactly": Key(bool, False, "search only for the stated motion, with a point bob, as in the paper"),
        "band": Key(
            tuple[float, float], None, "ends of a band of frequencies, Hz (default: around the frequency)"
        ),
        "frequencies": Key(
            _Whole,
            inspect.signature(Conditions.band).parameters["count"].default,
            "number of frequencies in the band",
        ),
        "amplitudes": Key(tuple[float, ...], None, "factors on the amplitude of the base motion"),
        "samples": Key(_Whole, 64, "number of samples of the quantities in [scatter]"),
    },
    "scatter": {name: Key(float, None, (Ensemble, name)) for name in FACTORS},
    "starts": {
        "kind": Key(
            Literal["any", "rest"],
            "any",
            "initial states: any (the largest motion that attracts), or rest (wherever rest is possible)",
        )
    },
    "limits": {kind.name: _limit(kind) for kind in LIMIT_KINDS},
    "requirements": {
        **keys_of(Requirements),
        "reduce": Key(Literal["overturning", "tilt"], None, (Requirements, "reduce")),
    },
    "search": {
        "model": _descent["model"],
        **_descent,
        **_ground_search,
        # The default depends on the search.
        "steps": _descent["steps"]._replace(default=None),
        "risk": Key(
            Literal["worst", "expected", "cvar"],
            "worst",
            "risk measure: worst, expected, or cvar, the mean over the worst share of the conditions. Under "
            "a harmonic motion only the descents use it, and later stages compare mean tilts; under pulses "
            "and records the trial runs compare designs by it (default expected)",
        ),
        "risk_share": Key(
            float,
            inspect.signature(Risk.cvar).parameters["share"].default,
            "share of the conditions that the measure cvar uses",
        ),
        "seed": Key(_Whole, 0, "seed of all random choices, including those of the validation runs"),
        "pareto": Key(bool, False, "also find three lighter pendulums, each with its own validation"),
    },
    "ensemble": keys_of(Ensemble),
}
"""All keys, by table and name."""
READING = ("channel", "dt", "unit", "baseline", "columns", "skip", "factor")
"""Keys of [excitation] that control how files of records are read."""
_SHAKEN = ("pulse", "records")
_DEFAULTS: dict[str, dict[str, Any]] = {
    "harmonic": {"ensemble.size": VALIDATION_RUNS},
    "pulse": {"search.risk": "expected", "excitation.intensity": "scale", "excitation.scales": (1.0,)},
    "records": {
        "search.risk": "expected",
        "excitation.intensity": "pga_star",
        "excitation.validation_share": VALIDATION_SHARE,
    },
}
"""Defaults that depend on the kind of motion and replace those of `TABLES`."""
_KINDS: dict[str, tuple[str, ...]] = {
    **{f"excitation.{name}": ("harmonic",) for name in ("amplitude", "frequency")},
    **{f"excitation.{name}": ("pulse",) for name in ("pulse", "pulse_frequency", "cycles", "phase")},
    **{f"excitation.{name}": _SHAKEN for name in ("pga", "scales", "intensity")},
    **{f"excitation.{name}": ("records",) for name in ("records", "validation_share", "event", *READING)},
    **{f"{table}.{name}": ("harmonic",) for table in ("conditions", "starts") for name in TABLES[table]},
    **{f"limits.{kind.name}": ("harmonic",) for kind in LIMIT_KINDS if not kind.of_motion},
    **{f"search.{name}": ("harmonic",) for name in _descent.keys() - _ground_search},
    **{f"search.{name}": _SHAKEN for name in _ground_search.keys() - _descent},
    **{f"scatter.{name}": ("harmonic",) for name in TABLES["scatter"].keys() - SCATTERED},
    **{f"ensemble.{name}": ("harmonic",) for name in TABLES["ensemble"].keys() - SCATTERED},
}
"""Kinds of motion under which a key, TABLE.KEY, has an effect. Keys that are not listed have an effect under
all kinds."""
MOTIONS = {"harmonic": "a harmonic motion", "pulse": "a pulse", "records": "records"}
"""Kinds of motion in words."""
_WITH_PHASE = "mavroeidis-papageorgiou"
_CYCLIC = [name for name, kind in PULSES.items() if kind.periods is None]
_FILE = ("a file of a record", lambda full: full["excitation"]["records"] is None or _names_files(full))
_SEVERAL = ("several conditions, [conditions] or [scatter]", lambda full: size_of(full) > 1)
_TWO_BOUNDS = "two bounds for the mass, `space.mass` or `space.mass_ratio`"
_ALONE = "a single motion (no band, no amplitudes and no scatter)"
_ONLY_WITH: dict[str, tuple[str, Callable[[Tables], bool]]] = {
    "excitation.cycles": (
        f"the pulses {' and '.join(_CYCLIC)}",
        lambda full: full["excitation"]["pulse"] in _CYCLIC,
    ),
    "excitation.phase": (f"the pulse {_WITH_PHASE}", lambda full: full["excitation"]["pulse"] == _WITH_PHASE),
    **{f"excitation.{name}": _FILE for name in ("event", *READING)},
    "conditions.exactly": (_ALONE, lambda full: size_of(full) == 1),
    "conditions.frequencies": ("a band, `conditions.band`", lambda full: bool(full["conditions"]["band"])),
    "conditions.samples": ("a width in [scatter]", lambda full: bool(widths_of(full))),
    "bob.aspect": ("`bob.shape` cylinder", lambda full: full["bob"]["shape"] == "cylinder"),
    "search.pareto": (
        _TWO_BOUNDS,
        lambda full: not any(isinstance(full["space"][x], float) for x in ("mass", "mass_ratio")),
    ),
    "search.risk": _SEVERAL,
    "search.risk_share": ("`search.risk` cvar", lambda full: full["search"]["risk"] == "cvar"),
}
"""Keys that have an effect only together with another key: words for the other key, and a function that tests
whether a job has it."""


def widths_of(full: Tables) -> dict[str, float]:
    """Return the relative half widths of the uncertain quantities."""
    return {name: width for name, width in full["scatter"].items() if width is not None}


def is_around(full: Tables) -> bool:
    """Whether the conditions are the neighbourhood of the motion, which is the default."""
    conditions = full["conditions"]
    is_many = conditions["band"] is not None or conditions["amplitudes"] is not None or widths_of(full)
    return not (conditions["exactly"] or is_many)


def size_of(full: Tables) -> int:
    """Return the number of conditions."""
    conditions = full["conditions"]
    # The neighbourhood has the same number of conditions around any scene.
    if is_around(full):
        return len(Conditions.around(PAPER))
    frequencies = 1 if conditions["band"] is None else conditions["frequencies"]
    return (
        frequencies
        * len(conditions["amplitudes"] or (1.0,))
        * (conditions["samples"] if widths_of(full) else 1)
    )


def _names_files(full: Tables) -> bool:
    """Whether at least one record comes from a file. Built-in records need no reading options."""
    validation = full["excitation"]["validation_share"]
    names = *full["excitation"]["records"], *(validation if isinstance(validation, tuple) else ())
    return not {*names} <= {*BUILT_IN, *SETS}


def placed(table: str, values: Any, folder: Path) -> Any:
    """Return the values of a table, with absolute paths of records."""
    if table != "excitation" or not isinstance(values, Mapping):
        return values

    # An empty name would become the folder, and the reader rejects it.
    kept, out = {*BUILT_IN, *SETS, ""}, dict(values)
    for key in values.keys() & {"records", "validation_share"}:
        # Values of a wrong type are left as they are: their check comes later.
        if isinstance(x := values[key], (list, tuple)) and all(isinstance(name, str) for name in x):
            out[key] = type(x)(n if n in kept else readable(str(folder.resolve() / path_of(n))) for n in x)
    return out


def as_typed(tables: Mapping[str, Any]) -> Tables:
    """Return the tables with every value converted to the type of its key.

    Raises:
        ValueError: a table or key is unknown, or a value has the wrong type.
    """
    out: Tables = {}
    for table, values in tables.items():
        if table not in TABLES:
            raise ValueError(f"there is no table [{_cut(table)}]{meant(table, TABLES)}")
        if not isinstance(values, Mapping):
            raise ValueError(f"`{table}` must be a table, but is {shown(values)}")
        out[table] = {}
        for key, value in values.items():
            if key not in TABLES[table]:
                raise ValueError(f"there is no key `{_cut(key)}` in [{table}]{meant(key, TABLES[table])}")
            type_ = TABLES[table][key].type
            # Convert one key at a time, so that the message contains the key and the allowed values.
            try:
                out[table][key] = msgspec.convert(value, type_, strict=True)
            except msgspec.ValidationError:
                words, close = allowed(msgspec.json.schema(type_)), ""
                if isinstance(value, str):
                    close = meant(value, msgspec.json.schema(type_).get("enum", ()), listing=False)
                close = close or number_hint(shown(value))
                raise ValueError(f"`{table}.{key}` must be {words}, but is {shown(value)}{close}") from None
    return out


def _cut(name: str) -> str:
    """Return a name in the form in which a message shows it."""
    return shown(name).strip("'")


def allowed(schema: Mapping[str, Any]) -> str:
    """Return words for the values that the JSON schema of a key allows."""
    if "anyOf" in schema:
        return " or ".join(map(allowed, schema["anyOf"]))
    if "enum" in schema:
        return f"one of {', '.join(schema['enum'])}"
    if schema["type"] == "array":
        # A tuple of fixed length has one schema per element, and a list has one schema for all elements.
        pair = "prefixItems" in schema
        return "a pair of numbers" if pair else f"a list, each {allowed(schema['items'])}"
    nouns = {"number": "a number", "boolean": "true or false", "string": "a text"}
    nouns["integer"] = f"a whole number up to {schema.get('maximum')}"
    most = schema.get("maxLength")
    return nouns[schema["type"]] + ("" if most is None else f" in one line of at most {most} characters")


def kinds_in(motion: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the kinds of motion to which the keys of [excitation] belong, with these keys."""
    # A stated kind decides, whatever the other keys are.
    if "kind" in motion:
        return {motion["kind"]: ["kind"]}
    keys: dict[str, list[str]] = {}
    for key in motion:
        kinds = _KINDS[f"excitation.{key}"]
        # A key that several kinds of motion have does not decide between them.
        if len(kinds) == 1:
            keys.setdefault(kinds[0], []).append(key)
    return keys


def complete(tables: Mapping[str, Any]) -> Tables:
    """Return the tables with typed values and all keys. Keys that are left out have their defaults."""
    typed = as_typed(tables)
    kinds = kinds_in(typed.get("excitation", {}))
    if len(kinds) > 1:
        listed = " and ".join(f"of {MOTIONS[kind]} (`{keys[0]}`)" for kind, keys in kinds.items())
        raise ValueError(f"[excitation] has keys {listed}, but a job has only one kind of motion")
    # The paper and most jobs have a harmonic, so this is the kind if no key decides.
    kind = next(iter(kinds), "harmonic")
    full: Tables = {}
    for table, keys in TABLES.items():
        defaults = {name: default_of(kind, table, name) for name in keys}
        full[table] = defaults | typed.get(table, {})
    full["excitation"]["kind"] = kind
    # Paths from the command line are relative to the working directory. Those of a file are absolute already.
    full["excitation"] = placed("excitation", full["excitation"], Path())
    return full


def default_of(kind: str, table: str, name: str) -> Any:
    """Return the default of a key under a kind of motion."""
    return _DEFAULTS[kind].get(f"{table}.{name}", TABLES[table][name].default)


def lacks(full: Tables, table: str, key: str) -> str:
    """Return words for what a key requires and the job does not have; empty if the key has an effect."""
    kinds = _KINDS.get(f"{table}.{key}", tuple(MOTIONS))
    if full["excitation"]["kind"] not in kinds:
        return " or ".join(MOTIONS[kind] for kind in kinds)
    words, holds = _ONLY_WITH.get(f"{table}.{key}", ("", bool))
    return "" if holds(full) else words


def json_schema() -> str:
    """Return the JSON schema of a job file, for the command line and for editors."""
    tables = {}
    for table, keys in TABLES.items():
        properties = {}
        for name, key in keys.items():
            text = {"description": key.says if isinstance(key.says, str) else _doc(*key.says)}
            default = {} if key.default is None else {"default": msgspec.to_builtins(key.default)}
            # A key with a default that depends on other keys has no default in the schema.
            properties[name] = text | default | msgspec.json.schema(key.type)
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
    """Return the docstring of a class without its example, or that of one of its fields, in one line."""
    if name is None:
        # The example of a class is for users of Python, and not for the help of a job file.
        return " ".join(str(owner.__doc__).partition("Example:")[0].split())
    # Python does not store the docstrings of fields, so read them from the source, also of the base classes.
    for kind in owner.__mro__:
        body = [] if kind is object else ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0].body  # type: ignore[attr-defined]
        for field, text in pairwise(body):
            is_field = isinstance(field, ast.AnnAssign) and getattr(field.target, "id", "") == name
            if is_field and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                return " ".join(str(text.value.value).split())
    raise ValueError(f"the field `{name}` of {owner.__name__} has no docstring")


if __name__ == "__main__":
    SCHEMA.write_text(json_schema(), encoding="utf-8")
