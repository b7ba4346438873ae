"""Specification of the job file: one `Key` for each key of each table.

A key has its type, description with unit, option of the command line, default, and what it needs to have an
effect: kinds of excitation and other keys. If a dataclass is made from a table, its fields give the types,
defaults and descriptions. Everything else follows from the keys: reading, checking, completing, messages, and
`job.schema.json`, which `python -m tpd.design.tables` writes. The command line takes options and help from
this file, and editors can check a job file with it.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import json
import textwrap
import types
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta

from tpd.core.checks import quote
from tpd.core.files import path_of, readable
from tpd.core.formatting import meant, number_hint
from tpd.design.risk import Risk
from tpd.design.settings import PULSE_BAND, SCATTERED, VALIDATION_RUNS, Descent, GroundSearch
from tpd.design.space import DesignSpace
from tpd.limits import DEFAULT_LIMITS, LIMIT_KINDS, Limit, Requirements, Stroke, Worsening, limit_of
from tpd.records.read import BUILT_IN, SETS
from tpd.scene.bob import Bob
from tpd.scene.conditions import FACTORS, Conditions
from tpd.scene.ensemble import DISTURBANCE, Ensemble
from tpd.scene.ground_motion import PULSES, Pulse
from tpd.scene.hazard import Hazard
from tpd.scene.scene import Block, Harmonic, Scene, paper_scene

Tables = dict[str, dict[str, Any]]
"""Values of a job, by table and key."""
SCHEMA = Path(__file__).with_name("job.schema.json")
"""File with the JSON schema of a job file."""
PAPER = paper_scene()
"""Scene of the paper, whose block and excitation are the defaults."""
EXCITATIONS = {"harmonic": "a harmonic motion", "pulse": "a pulse", "records": "records"}
"""Kinds of excitation in words."""
_Whole = Annotated[int, Meta(le=2**31 - 1)]
"""Count or seed. Random generators and arrays fail for larger numbers."""
_Line = Annotated[str, Meta(max_length=100, pattern=r"^[^\x00-\x1f\x7f]*$")]
"""Text in one line."""


class Need(msgspec.Struct, frozen=True):
    """Condition on the other keys of a job without which a key has no effect."""

    words: str = ""
    """Words for the condition."""
    holds: Callable[[Tables], bool] = lambda full: True
    """Whether a complete job has it."""


class Key(msgspec.Struct, frozen=True):
    """Key of a table. Type, default and help come from the field of a class that declares the key."""

    option: str = ""
    """Option of the command line with the placeholders of its values, such as "--cavity M"; empty if there is
    none. Without a name the option is named like the key."""
    kinds: tuple[str, ...] = ()
    """Kinds of excitation under which the key has an effect; empty for all kinds."""
    need: Need = Need()
    """Condition on other keys without which the key has no effect."""
    defaults: Mapping[str, Any] = {}
    """Defaults under some kinds of excitation, which replace `default`."""
    default: Any = None
    """Default value; None if the key has no default, or if its default depends on other keys."""
    type: Any = None
    """Type of the value."""
    help: tuple[type, str] = (object, "")
    """Class and field whose docstring is the description, with the unit. Without a field it is the docstring
    of the class."""
    is_required: bool = False
    """Whether a user's own block needs the key."""

    def default_under(self, kind: str) -> Any:
        """Return the default under a kind of excitation."""
        return self.defaults.get(kind, self.default)


def widths_of(full: Tables) -> dict[str, float]:
    """Return the relative half widths of the uncertain quantities."""
    return {name: width for name, width in full["scatter"].items() if width is not None}


def is_around(full: Tables) -> bool:
    """Whether the conditions are the neighbourhood of the excitation, which is the default."""
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
    samples = conditions["samples"] if widths_of(full) else 1
    return frequencies * len(conditions["amplitudes"] or (1.0,)) * samples


def _names_files(full: Tables) -> bool:
    """Whether at least one record comes from a file. Built-in records need no reading options."""
    records, validation = (full["excitation"][key] for key in ("records", "validation_share"))
    names = *(records or ("",)), *(validation if isinstance(validation, tuple) else ())
    return not {*names} <= {*BUILT_IN, *SETS}


def _is(table: str, key: str, *values: Any) -> Callable[[Tables], bool]:
    """Return a function that tests whether a key of a job has one of the values."""
    return lambda full: full[table][key] in values


_HARMONIC, _PULSE, _RECORDS, _GROUND_MOTIONS = ("harmonic",), ("pulse",), ("records",), ("pulse", "records")
_CYCLIC_PULSES = [name for name, kind in PULSES.items() if kind.periods is None]
_WITH_PHASE = "mavroeidis-papageorgiou"
_CYCLES = Need(f"the pulses {' and '.join(_CYCLIC_PULSES)}", _is("excitation", "pulse", *_CYCLIC_PULSES))
_PHASE = Need(f"the pulse {_WITH_PHASE}", _is("excitation", "pulse", _WITH_PHASE))
_FILE = Need("a file of a record", _names_files)
_OFF_VALUES = None, False
_WALLS = Need(
    "a limit on `clearance` in [limits]",
    lambda full: full["limits"]["clearance"] not in _OFF_VALUES and not full["conditions"]["exactly"],
)
_COMPARISON = Need(
    "more than the stated motion (no `exactly`)",
    lambda full: full["limits"]["worsening"] in _OFF_VALUES or not full["conditions"]["exactly"],
)
_LIMITS = Need(
    "a limit on runs in [limits]",
    lambda full: any(full["limits"][kind.name] not in _OFF_VALUES for kind in LIMIT_KINDS if kind.of_motion),
)
_PUSHES = Need("a share `ensemble.disturbed` above 0", lambda full: full["ensemble"]["disturbed"] != 0.0)
_DAMPER = Need("a `space.damping_ratio` above 0", lambda full: full["space"]["damping_ratio"] != 0.0)
_CONTACT_FRICTION = Need("a `block.friction` above 0", lambda full: full["block"]["friction"] != 0.0)
_MOTION_SIZE = Need(
    "`excitation.intensity` scale, or no `excitation.scales`",
    lambda full: (
        None in (full["excitation"]["records"], full["excitation"]["scales"])
        or full["excitation"]["intensity"] == "scale"
    ),
)
_CYLINDER = Need("`bob.shape` cylinder", _is("bob", "shape", "cylinder"))
_MOTION = Need("a single motion (no band, no amplitudes and no scatter)", lambda full: size_of(full) == 1)
_CONDITION_SET = Need("several conditions, [conditions] or [scatter]", lambda full: size_of(full) > 1)
_BAND = Need("a band, `conditions.band`", lambda full: bool(full["conditions"]["band"]))
_WIDTH = Need("a width in [scatter]", lambda full: bool(widths_of(full)))
# A single condition has no risk measure, so that its default does not count either.
_IS_CVAR = _is("search", "risk", "cvar")
_CVAR = Need("`search.risk` cvar", lambda full: _IS_CVAR(full) and _CONDITION_SET.holds(full))


_BUILDING = Need("a building, `site.building_period`", lambda full: bool(full["site"]["building_period"]))
_HINGE = Need("the height of its hinge, `frame.height`", lambda full: full["frame"]["height"] is not None)
_FRAME = Need("a width, `frame.width`", lambda full: full["frame"]["width"] is not None)


# Each of the following classes declares the keys of one table that are no fields of a dataclass.


class _Project(msgspec.Struct):
    name: _Line | None = None
    """Name of the project, for titles."""
    author: _Line | None = None
    """Author of the report."""
    checker: _Line | None = None
    """Person who checks the report."""
    revision: _Line | None = None
    """Revision of the report."""
    source: _Line | None = None
    """Source of the excitation, such as a measurement, a code or a hazard study."""
    return_period: _Line | None = None
    """Return period of the excitation, in words."""


class _Frame(msgspec.Struct):
    width: Annotated[float | None, Key("--frame-width M", need=_HINGE)] = None
    """Clear width of a frame or mast above the block in which the bob swings, instead of a cavity, m. Its
    mass is a part of that of the block."""
    height: Annotated[float | None, Key("--frame-height M", need=_FRAME)] = None
    """Height of its hinge above the base of the block, m."""


class _Excitation(msgspec.Struct):
    kind: Literal["harmonic", "pulse", "records"] | None = None
    """Kind of motion (default: the kind to which the given keys belong, else harmonic)."""
    pga: Annotated[float | None, Key("G", _GROUND_MOTIONS, _MOTION_SIZE)] = None
    """Peak acceleration of a pulse, or of each record, in g."""
    records: Annotated[tuple[str, ...] | None, Key("FILE", _RECORDS)] = None
    """Files and folders of records, relative to a job file, or el-centro, loma-prieta, fema-p695,
    fema-p695-far-field, fema-p695-near-field-pulse, fema-p695-near-field-no-pulse."""
    scales: Annotated[tuple[float, ...] | None, Key("X", _GROUND_MOTIONS, defaults={"pulse": (1.0,)})] = None
    """Values of the intensity, in its unit, to which every motion is scaled, such as 1.5 2 3."""
    intensity: Annotated[
        str | None, Key("WORD", _GROUND_MOTIONS, defaults={"pulse": "scale", "records": "pga_star"})
    ] = None
    """Intensity measure of the scales: pga_star (PGA divided by the uplift acceleration g width/height),
    pgv_star, pga in g, pgv in m/s, or scale, a factor (default pga_star; for a pulse scale)."""
    pulse_band: Annotated[
        tuple[float, float] | None, Key("PERIOD PGA", _PULSE, defaults={"pulse": PULSE_BAND})
    ] = None
    """Relative half widths of the band of periods and of peak accelerations around a pulse; 0 0 for the
    stated pulse alone (default 0.3 0.1)."""
    validation_share: Annotated[float | tuple[str, ...] | None, Key("X", _RECORDS)] = None
    """Share of the records, in whole earthquakes, that is kept for the validation of the search, or files,
    folders and sets of other records for it (default: cross-fitting, in which all earthquakes validate)."""


class _Alternatives(msgspec.Struct):
    level: Annotated[float | None, Key()] = None
    """Peak acceleration for which ties, wider bases and isolation are estimated, in g (default: a harmonic as
    stated; else the level that is exceeded once in 475 years, if the hazard states PGA, or the lowest
    level)."""


class _Records(msgspec.Struct):
    events: Annotated[dict[str, str] | None, Key("--event FILE=NAME", _RECORDS, _FILE)] = None
    """Names of the earthquakes, by file or folder (default: what the files state, else one earthquake)."""


class _Site(msgspec.Struct):
    building_period: Annotated[float | None, Key(kinds=_RECORDS)] = None
    """Natural period of a building on whose roof the block stands, s. The records pass an oscillator with
    this period. Levels and hazard are those of the ground."""
    building_damping: Annotated[float, Key(kinds=_RECORDS, need=_BUILDING)] = 0.05
    """Damping ratio of this building."""


class _Reading(msgspec.Struct):
    channel: Annotated[int | None, Key("N")] = None
    """Number of the channel, from 0 (default: all horizontal ones)."""
    dt: Annotated[float | None, Key("S")] = None
    """Sampling interval of files that do not contain times, s."""
    columns: Annotated[tuple[str, ...] | None, Key("NAME=N")] = None
    """Names and numbers (from 1) of the columns of a table, such as time=1 N=2 'E (gal)'=3; or rows, if the
    samples continue row by row."""
    skip: Annotated[int | None, Key("N")] = None
    """Number of lines at the top of a table that are skipped."""
    factor: Annotated[float | None, Key("X")] = None
    """Factor by which all samples of a file are multiplied."""
    unit: Annotated[str | None, Key("UNIT")] = None
    """Unit of files that do not state one: g, m/s2, cm/s2."""
    baseline: Annotated[str | None, Key("WORD")] = None
    """Baseline correction: mean removes an offset, linear a drift, none nothing (default: mean for
    uncorrected records)."""


class _Conditions(msgspec.Struct):
    exactly: Annotated[bool, Key("--exactly", _HARMONIC, _MOTION)] = False
    """Search only for the stated motion, with a point bob, as in the paper."""
    band: Annotated[tuple[float, float] | None, Key("LO HI", _HARMONIC)] = None
    """Ends of a band of frequencies, Hz (default: around the frequency)."""
    frequencies: Annotated[int, Key(kinds=_HARMONIC, need=_BAND)] = (
        inspect.signature(Conditions.band).parameters["count"].default
    )
    """Number of frequencies in the band."""
    amplitudes: Annotated[tuple[float, ...] | None, Key("X", _HARMONIC)] = None
    """Factors on the amplitude of the excitation."""
    samples: Annotated[int, Key(kinds=_HARMONIC, need=_WIDTH)] = 64
    """Number of samples of the quantities in [scatter]."""


class _Starts(msgspec.Struct):
    kind: Annotated[Literal["any", "rest"], Key(kinds=_HARMONIC)] = "any"
    """Initial states: any (the largest stable motion), or rest (wherever rest is possible;
    `--from-rest`)."""


class _Search(msgspec.Struct):
    objective: Annotated[Literal["settling", "steady tilt"], Key("WORD", _HARMONIC)] = "settling"
    """Quantity that the descents reduce: settling (what remains of a disturbance after a few periods), or
    steady tilt (the objective of the paper, which says little about overturning)."""
    risk: Annotated[
        Literal["worst", "expected", "cvar"],
        Key("WORD", (), _CONDITION_SET, defaults={"pulse": "expected", "records": "expected"}),
    ] = "cvar"
    """Risk measure: worst, expected, or cvar, the mean over the worst share of the conditions. Under a
    harmonic motion the descents use it (default cvar); under pulses and records the trial runs compare
    designs by it (default expected)."""
    risk_share: Annotated[float, Key(need=_CVAR)] = inspect.signature(Risk.cvar).parameters["share"].default
    """Share of the conditions that the measure cvar uses."""
    seed: Annotated[int, Key("N")] = 0
    """Seed of all random choices, including those of the validation runs."""


def keys_of(owner: type, example: object = None, /, **more: str | Key) -> dict[str, Key]:
    """Return the keys for the fields of a dataclass or `Struct`, as far as a file can state them.

    Args:
        owner: class with the fields.
        example: object whose values are the defaults of the fields that have none. The defaults of the other
            fields then depend on whether the object is used.
        more: what the fields themselves do not state, by their names; a text is an option.
    """
    is_struct = issubclass(owner, msgspec.Struct)
    every = msgspec.structs.fields(owner) if is_struct else dataclasses.fields(owner)
    hints, keys = get_type_hints(owner, include_extras=True), {}
    # Fields that a file cannot state, such as objects of Python, have no key.
    for f in (f for f in every if _plain_type(hints[f.name]) is not None):
        stated = more.get(f.name, next(iter(getattr(hints[f.name], "__metadata__", ())), ""))
        key = Key(stated) if isinstance(stated, str) else stated
        is_open = f.default in (dataclasses.MISSING, msgspec.NODEFAULT)
        default = f.default if example is None and not is_open else None
        keys[f.name] = msgspec.structs.replace(
            key,
            default=getattr(example, f.name, None) if is_open else default,
            type=_plain_type(hints[f.name]),
            help=(owner, f.name),
            is_required=is_open and example is not None,
        )
    return keys


def under(kinds: tuple[str, ...], keys: Mapping[str, Key], **more: Any) -> dict[str, Key]:
    """Return keys that have an effect only under some kinds of excitation, with `more` fields changed."""
    return {name: msgspec.structs.replace(key, kinds=kinds, **more) for name, key in keys.items()}


def of_ground_motions(keys: Mapping[str, Key]) -> dict[str, Key]:
    """Return keys for quantities of runs, of which only some vary under pulses and records."""
    return {**keys, **under(_HARMONIC, {name: key for name, key in keys.items() if name not in SCATTERED})}


def _plain_type(hint: Any) -> Any:
    """Return the part of a type that a file can contain; None if there is none."""
    if get_origin(hint) in (Union, types.UnionType):
        parts = [part for part in map(_plain_type, get_args(hint)) if part is not None]
        return Union[tuple(parts)] if parts else None  # noqa: UP007
    if get_origin(hint) is Annotated:
        # The limits of a text are a part of its type, and a `Key` is none.
        metas = [x for x in hint.__metadata__ if isinstance(x, Meta)]
        return Annotated[hint.__origin__, metas[0]] if metas else _plain_type(hint.__origin__)
    if get_origin(hint) in (tuple, Literal) or hint == dict[str, str]:
        return hint
    # Numbers that JAX may trace are annotated with `Any`.
    return {float: float, Any: float, int: _Whole, str: str, bool: bool}.get(hint)


def _limit(kind: type[Limit]) -> Key:
    """Return the key of a limit: a number, or true if the limit has none."""
    preset, own = limit_of(DEFAULT_LIMITS, kind), [f.name for f in dataclasses.fields(kind)]
    # A limit with a single number has this number as its value. Any other limit is only switched on or off.
    is_number = len(own) == 1 and get_type_hints(kind)[own[0]] in (float, Any)
    return Key(
        "RAD" if kind is Stroke else "",
        kinds=() if kind.of_motion else _HARMONIC,
        need=_COMPARISON if kind is Worsening else Need(),
        default=None if preset is None else getattr(preset, own[0]) if is_number else True,
        type=float | bool if is_number else bool,
        help=(kind, ""),
    )


_pulse = keys_of(
    Pulse, cycles=Key("N", (), _CYCLES), phase=Key("RAD", (), _PHASE), kind="KIND", frequency="HZ"
)
# The size of a pulse is the key `pga`, and two other names are those of other keys of the table.
_names = {"kind": "pulse", "frequency": "pulse_frequency", "cycles": "cycles", "phase": "phase"}
_descent = under(_HARMONIC, keys_of(Descent, optimiser="WORD", searches="N", steps="N"))
READING = under(_RECORDS, keys_of(_Reading), need=_FILE)
"""Keys of [excitation] that control how files of records are read."""
TABLES: dict[str, dict[str, Key]] = {
    "project": keys_of(_Project),
    # The frame has a table, which also states its hinge.
    "block": keys_of(
        Block,
        PAPER.block,
        **{"width": "M", "height": "M", "mass": "KG", "friction": "K", "restitution": "E"},
        **{
            "radius_of_gyration": "M",
            "centroid_height": "M",
            "cavity_width": "--cavity M",
            "base_friction": "X",
        },
        effective_width="SHARE",
    ),
    "frame": keys_of(_Frame),
    "excitation": {
        **under(_HARMONIC, keys_of(Harmonic, PAPER.excitation, amplitude="M", frequency="HZ")),
        **under(_PULSE, {new: _pulse[name] for name, new in _names.items()}),
        **keys_of(_Excitation),
        **READING,
    },
    "records": keys_of(_Records),
    "hazard": under(_GROUND_MOTIONS, keys_of(Hazard)),
    "bob": keys_of(
        Bob, shape=Key("--bob WORD", need=_WALLS), density=Key(need=_WALLS), aspect=Key(need=_CYLINDER)
    ),
    "site": {"gravity": keys_of(Scene)["gravity"], **keys_of(_Site)},
    "space": keys_of(
        DesignSpace,
        **{"mass_ratio": "LO HI", "length_ratio": "LO HI", "damping_ratio": "--damping LO HI"},
        **{"mass": "--pendulum-mass LO HI", "length": "--pendulum-length LO HI"},
        hinge_height="M",
    ),
    "conditions": keys_of(_Conditions),
    "scatter": of_ground_motions({name: Key(type=float, help=(Ensemble, name)) for name in FACTORS}),
    "starts": keys_of(_Starts),
    "limits": {kind.name: _limit(kind) for kind in LIMIT_KINDS},
    "alternatives": keys_of(_Alternatives),
    "requirements": keys_of(Requirements, at_least="X", reduce="WORD", wall_contacts=Key("X", need=_LIMITS)),
    "search": {
        **_descent,
        **under(_GROUND_MOTIONS, keys_of(GroundSearch, designs="N", method="WORD")),
        # The default depends on the search.
        "steps": msgspec.structs.replace(_descent["steps"], kinds=(), default=None),
        **keys_of(_Search),
    },
    "ensemble": of_ground_motions(
        keys_of(
            Ensemble,
            size=Key(defaults={"harmonic": VALIDATION_RUNS}),
            **dict.fromkeys(DISTURBANCE, Key(need=_PUSHES)),
            friction=Key(need=_CONTACT_FRICTION),
            damping=Key(need=_DAMPER),
        )
    ),
}
"""All keys, by table and name."""
del TABLES["block"]["frame_width"]


def required_keys(table: str, kind: str = "harmonic") -> list[str]:
    """Return the keys of a table that a user's own block needs under a kind of excitation."""
    keys = TABLES[table].items()
    return [name for name, key in keys if key.is_required and (not key.kinds or kind in key.kinds)]


def with_absolute_paths(table: str, values: Any, folder: Path) -> Any:
    """Return the values of a table, with absolute paths of records."""
    if table not in ("excitation", "records") or not isinstance(values, Mapping):
        return values

    # An empty name would become the folder, and the reader rejects it.
    kept, out = {*BUILT_IN, *SETS, ""}, dict(values)
    for key in values.keys() & {"records", "validation_share"}:
        # Values of a wrong type are left as they are: their check comes later.
        if isinstance(x := values[key], (list, tuple)) and all(isinstance(name, str) for name in x):
            out[key] = type(x)(n if n in kept else _absolute(n, folder) for n in x)
    if isinstance(events := values.get("events"), Mapping):
        out["events"] = {_absolute(name, folder): event for name, event in events.items()}
    return out


def _absolute(name: str, folder: Path) -> str:
    """Return the path of a file, relative to a folder, as an absolute one."""
    return readable(str(folder.resolve() / path_of(name)))


def typed_tables(tables: Mapping[str, Any]) -> Tables:
    """Return the tables with every value converted to the type of its key.

    Raises:
        ValueError: a table or key is unknown, or a value has the wrong type.
    """
    out: Tables = {}
    for table, values in tables.items():
        if table not in TABLES:
            raise ValueError(f"there is no table [{_cut(table)}]{meant(table, TABLES)}")
        if not isinstance(values, Mapping):
            raise ValueError(f"`{table}` must be a table, but is {quote(values)}")
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
                close = close or number_hint(quote(value))
                raise ValueError(f"`{table}.{key}` must be {words}, but is {quote(value)}{close}") from None
    return out


def _cut(name: str) -> str:
    """Return a name in the form in which a message shows it."""
    return quote(name).strip("'")


def allowed(schema: Mapping[str, Any]) -> str:
    """Return words for the values that the JSON schema of a key allows."""
    if "anyOf" in schema:
        return " or ".join(map(allowed, schema["anyOf"]))
    if "enum" in schema:
        return f"one of {', '.join(schema['enum'])}"
    if schema["type"] == "object":
        return 'a table of texts, such as { "quakes/a.csv" = "Kobe 1995" }'
    if schema["type"] == "array":
        # A tuple of fixed length has one schema per element, and a list has one schema for all elements.
        pair = "prefixItems" in schema
        return "a pair of numbers" if pair else f"a list, each {allowed(schema['items'])}"
    nouns = {"number": "a number", "boolean": "true or false", "string": "a text"}
    nouns["integer"] = f"a whole number up to {schema.get('maximum')}"
    most = schema.get("maxLength")
    return nouns[schema["type"]] + ("" if most is None else f" in one line of at most {most} characters")


def kinds_in(excitation: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the kinds of excitation to which the keys of [excitation] belong, with these keys."""
    # A stated kind decides, whatever the other keys are.
    if "kind" in excitation:
        return {excitation["kind"]: ["kind"]}
    keys: dict[str, list[str]] = {}
    for key in excitation:
        kinds = TABLES["excitation"][key].kinds
        # A key that several kinds of excitation have does not decide between them.
        if len(kinds) == 1:
            keys.setdefault(kinds[0], []).append(key)
    return keys


def complete_tables(tables: Mapping[str, Any]) -> Tables:
    """Return the tables with typed values and all keys. Keys that are left out have their defaults."""
    typed = typed_tables(tables)
    kinds = kinds_in(typed.get("excitation", {}))
    if len(kinds) > 1:
        listed = " and ".join(f"of {EXCITATIONS[kind]} (`{keys[0]}`)" for kind, keys in kinds.items())
        raise ValueError(f"[excitation] has keys {listed}, but a job has only one kind of motion")
    # The paper and most jobs have a harmonic, so this is the kind if no key decides.
    kind = next(iter(kinds), "harmonic")
    full = {
        table: {name: key.default_under(kind) for name, key in keys.items()} | typed.get(table, {})
        for table, keys in TABLES.items()
    }
    full["excitation"]["kind"] = kind
    # Paths from the command line are relative to the working directory. Those of a file are absolute already.
    return {table: with_absolute_paths(table, values, Path()) for table, values in full.items()}


def lacks(full: Tables, table: str, name: str) -> str:
    """Return words for what a key needs and the job does not have; empty if the key has an effect."""
    key = TABLES[table][name]
    if key.kinds and full["excitation"]["kind"] not in key.kinds:
        return " or ".join(EXCITATIONS[kind] for kind in key.kinds)
    return "" if key.need.holds(full) else key.need.words


def json_schema() -> str:
    """Return the JSON schema of a job file, for the command line and for editors."""
    tables = {}
    for table, keys in TABLES.items():
        properties = {}
        for name, key in keys.items():
            text = {"description": _doc(*key.help)}
            # A key with a default that depends on other keys has no default in the schema.
            default = {} if key.default is None else {"default": msgspec.to_builtins(key.default)}
            flag = "" if key.option.startswith("--") else f"--{name.replace('_', '-')} "
            option = {"option": flag + key.option} if key.option else {}
            properties[name] = text | default | option | msgspec.json.schema(key.type)
        tables[table] = {"type": "object", "additionalProperties": False, "properties": properties}
    content = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Job file of tpd optimise",
        "type": "object",
        "additionalProperties": False,
        "properties": tables,
    }
    return json.dumps(content, indent=1) + "\n"


def _doc(owner: type, name: str) -> str:
    """Return the docstring of a class without its example, or that of one of its fields, in one line."""
    if not name:
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
