"""The job file: the arguments of `tpd.optimise` as tables of TOML.

Types, defaults and ranges of its keys are those of the dataclasses that the tables become; what no dataclass
holds is declared here. `python -m tpd.design.job` writes `job.schema.json`, from which the command line takes
its options and their help, and editors what may stand in a file.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
import textwrap
import tomllib
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta

from tpd.analysis.attractors import StartKind, Starts
from tpd.analysis.ensemble import Ensemble
from tpd.core import checks
from tpd.core.bob import Bob
from tpd.core.conditions import FACTORS, MEASURES, Conditions, check_restitution
from tpd.core.formatting import meant
from tpd.core.ground_motion import STANDARD_GRAVITY, GroundMotion, Pulse
from tpd.core.intensity import intensity_of
from tpd.core.record import Record
from tpd.core.scene import Block, Harmonic, Scene, paper_scene
from tpd.design.criteria import (
    DEFAULT_LIMITS,
    KINDS,
    DesignSpace,
    Limit,
    Risk,
    Room,
    Worsening,
    Worth,
    limit_of,
)
from tpd.design.ground.groups import Role
from tpd.design.ground.judgement import SCATTERED
from tpd.design.ground.optimise import DEFAULT_SPACE, HELD_OUT
from tpd.design.ground.search import GroundSearch
from tpd.design.methods import SMOOTHED, Descent, Method, Sequential
from tpd.design.question import check_moves, check_scatter
from tpd.design.result import Design, HarmonicDesign
from tpd.models.piecewise import Piecewise
from tpd.records.reading import BUILT_IN, SETS, read_motions

Tables = dict[str, dict[str, Any]]
"""Values of a job by table and key."""
SCHEMA = Path(__file__).with_name("job.schema.json")
_PAPER = paper_scene()
_MOST_CONDITIONS = 100_000
"""Beyond it the arrays of a search do not fit into the memory of a usual computer."""
_SHAPE = "width", "height", "mass"
"""Keys of [block] that a block of one's own needs."""
_Whole = Annotated[int, Meta(le=2**31 - 1)]
"""A count or a seed: beyond it random generators and arrays fail."""
_METHODS: dict[str, type[Method]] = {kind.name: kind for kind in (Descent, Sequential)}
_MODELS = {"smoothed": SMOOTHED, "piecewise": Piecewise()}


class Key(NamedTuple):
    """A key of a table."""

    type: Any
    default: Any
    """None where the key is left out, or where its default depends on other keys."""
    says: str | tuple[type, str | None]
    """What it is, or the class and its field whose docstring says so; without a field that of the class."""


def _keys(kind: type, *names: str) -> dict[str, Key]:
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
    is_number = len(own) == 1 and get_type_hints(kind)[own[0]] is float
    default = None if preset is None else getattr(preset, own[0]) if is_number else True
    return Key(float | bool if is_number else bool, default, (kind, None))


def _of_methods() -> dict[str, Key]:
    """Keys of all methods; where they have different defaults these depend on the method."""
    found: dict[str, Key] = {}
    for kind in (Descent, Sequential, GroundSearch):
        for name, key in _keys(kind).items():
            other = found.setdefault(name, key)
            if other.default != key.default:
                found[name] = other._replace(default=None)
    return found


_names = ", ".join((*BUILT_IN, *SETS))
_pulse = _keys(Pulse)
TABLES: dict[str, dict[str, Key]] = {
    "project": {
        "name": Key(
            Annotated[str, Meta(max_length=100, pattern=r"^[^\x00-\x1f\x7f]*$")],
            None,
            "name of the project, for titles",
        )
    },
    "block": {
        name: key._replace(default=getattr(_PAPER.block, name)) if name in _SHAPE else key
        for name, key in _keys(Block).items()
    },
    "motion": {
        "kind": Key(
            Literal["harmonic", "pulse", "records"],
            None,
            "kind of motion (default: that whose keys are given, else harmonic)",
        ),
        **{name: key._replace(default=getattr(_PAPER.motion, name)) for name, key in _keys(Harmonic).items()},
        "pulse": _pulse["kind"],
        "pulse_frequency": _pulse["frequency"],
        "pga": Key(float, None, "largest acceleration of a pulse, or of each record, g"),
        "cycles": _pulse["cycles"],
        "phase": _pulse["phase"],
        "records": Key(
            tuple[str, ...], None, f"files and folders of records, in a job file relative to it, or {_names}"
        ),
        "scales": Key(
            tuple[float, ...], None, "values of the intensity that every motion is scaled to, such as 1.5 2 3"
        ),
        "intensity": Key(
            str,
            None,
            f"what the scales count: {', '.join(MEASURES)} (default pga_star, of a pulse scale: factors)",
        ),
        "held_out": Key(
            float | tuple[str, ...],
            None,
            "share of the records, whole earthquakes, that the design is judged on and not tuned to, or "
            f"files, folders and sets of others (default {HELD_OUT:g})",
        ),
        "event": Key(
            tuple[str, ...],
            None,
            "earthquakes of records whose files name none: one name, or one for each of the records "
            "(default: a folder is one earthquake)",
        ),
        "channel": Key(_Whole, None, "channel of files with several, from 0 (default: all horizontal ones)"),
        "dt": Key(float, None, "sampling interval of files without times, s"),
        "unit": Key(str, None, "unit of files that do not say: g, m/s2, cm/s2"),
        "baseline": Key(str, None, "mean or linear: remove an offset, or a drift"),
    },
    "bob": _keys(Bob),
    "site": _keys(Scene, "gravity"),
    "space": _keys(DesignSpace),
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
    "worth": _keys(Worth),
    "search": {
        "method": Key(Literal["descent", "sequential"], None, "method of the search (default descent)"),
        "model": Key(
            Literal["smoothed", "piecewise"],
            None,
            "model whose gradients the method descent takes (default smoothed: signs and impacts smoothed, "
            "orbits followed by diffrax; piecewise: the exact ones)",
        ),
        **_of_methods(),
        "seed": Key(_Whole, 0, "seed of every random choice of the search"),
        "pareto": Key(bool, False, "also find three lighter pendulums, each verified"),
    },
    "ensemble": _keys(Ensemble),
}
"""All keys by table and name."""

_SHAKEN = ("pulse", "records")
_USUAL = {("space", "damping_ratio"): DEFAULT_SPACE.damping_ratio, ("risk", "measure"): "expected"}
_DEFAULTS: dict[str, dict[tuple[str, str], Any]] = {
    "harmonic": {("search", "method"): "descent"},
    "pulse": _USUAL | {("motion", "intensity"): "scale", ("motion", "scales"): (1.0,)},
    "records": _USUAL | {("motion", "intensity"): "pga_star", ("motion", "held_out"): HELD_OUT},
}
"""Defaults that depend on the kind of motion, in place of those of `TABLES`."""
_KINDS: dict[tuple[str, str], tuple[str, ...]] = {
    **{("motion", name): ("harmonic",) for name in ("amplitude", "frequency")},
    **{("motion", name): ("pulse",) for name in ("pulse", "pulse_frequency", "cycles", "phase")},
    **{("motion", name): _SHAKEN for name in ("pga", "scales", "intensity")},
    **{
        ("motion", name): ("records",)
        for name in ("records", "held_out", "event", "channel", "dt", "unit", "baseline")
    },
    **{(table, name): ("harmonic",) for table in ("conditions", "starts") for name in TABLES[table]},
    **{("worth", name): ("harmonic",) for name in ("worse", "runs")},
    **{("limits", kind.name): ("harmonic",) for kind in KINDS if not kind.of_motion},
    **{
        ("search", name): ("harmonic",)
        for name in ("method", "model", *_of_methods())
        if name not in _keys(GroundSearch)
    },
    **{("search", name): _SHAKEN for name in _keys(GroundSearch) if name not in _keys(Descent)},
    **{
        (table, name): ("harmonic",)
        for table in ("scatter", "ensemble")
        for name in TABLES[table]
        if name not in SCATTERED
    },
}
"""Kinds of motion under which a key has an effect; others have it under all."""
_MOTIONS = {"harmonic": "a harmonic motion", "pulse": "a pulse", "records": "records"}
_DESCENT = ("`search.method` descent", lambda full: full["search"]["method"] == "descent")
_SEVERAL = ("several conditions, [conditions] or [scatter]", lambda full: _size(full) > 1)
_ONLY_WITH: dict[tuple[str, str], tuple[str, Callable[[Tables], bool]]] = {
    ("motion", "cycles"): (
        "the pulses mavroeidis-papageorgiou and sine-train",
        lambda full: full["motion"]["pulse"] in ("mavroeidis-papageorgiou", "sine-train"),
    ),
    ("motion", "phase"): (
        "the pulse mavroeidis-papageorgiou",
        lambda full: full["motion"]["pulse"] == "mavroeidis-papageorgiou",
    ),
    ("conditions", "exactly"): (
        "one motion: no band, no amplitudes and no scatter",
        lambda full: _size(full) == 1,
    ),
    ("bob", "aspect"): ("`bob.shape` cylinder", lambda full: full["bob"]["shape"] == "cylinder"),
    ("conditions", "frequencies"): (
        "a band, `conditions.band`",
        lambda full: full["conditions"]["band"] is not None,
    ),
    ("conditions", "samples"): ("a width in [scatter]", lambda full: bool(_widths(full))),
    ("risk", "measure"): _SEVERAL,
    ("risk", "share"): ("`risk.measure` cvar", lambda full: full["risk"]["measure"] == "cvar"),
    **{("search", name): _DESCENT for name in ("optimiser", "model", "tolerance")},
}
"""Keys that have an effect only together with another one: this one in words, and whether a job has it."""


def _widths(full: Tables) -> dict[str, float]:
    """Relative half widths of what is uncertain."""
    return {name: width for name, width in full["scatter"].items() if width is not None}


def _is_around(full: Tables) -> bool:
    """Whether the conditions are the neighbourhood of the motion, which is the default."""
    asked = full["conditions"]
    return not (
        asked["exactly"] or asked["band"] is not None or asked["amplitudes"] != (1.0,) or _widths(full)
    )


def _size(full: Tables) -> int:
    """Number of conditions."""
    asked = full["conditions"]
    if full["motion"]["kind"] != "harmonic" or _is_around(full):
        return len(Conditions.around(_PAPER))
    frequencies = 1 if asked["band"] is None else asked["frequencies"]
    return frequencies * len(asked["amplitudes"]) * (asked["samples"] if _widths(full) else 1)


@contextmanager
def naming(table: str, **keys: str) -> Iterator[None]:
    """Name the table in messages about its values; `keys` are names of a dataclass that the table has under
    another name."""
    try:
        yield
    except ValueError as error:
        said = re.sub(r"`(\w+)`", lambda found: f"`{keys.get(found[1], found[1])}`", str(error))
        raise ValueError(f"[{table}] {said}") from None


@dataclass(frozen=True, kw_only=True)
class Job:
    """Arguments of `tpd.optimise` by the tables of a job file. Records are read when they are first asked
    for."""

    full: Tables
    """All keys of all tables; None for what is left out and has no default."""

    @property
    def kind(self) -> str:
        """Kind of the motion: harmonic, pulse or records."""
        return self.full["motion"]["kind"]

    @property
    def name(self) -> str:
        """Name of the project."""
        return self.full["project"]["name"] or ""

    @property
    def seed(self) -> int:
        """Seed of the search."""
        return self.full["search"]["seed"]

    @property
    def pareto(self) -> bool:
        """Whether lighter pendulums are asked for as well."""
        return self.full["search"]["pareto"]

    @cached_property
    def block(self) -> Block:
        """The block; the paper's has the cavity that it has in Python."""
        given = dict(self.full["block"])
        if given["cavity_width"] is None and all(given[x] == getattr(_PAPER.block, x) for x in _SHAPE):
            given["cavity_width"] = _PAPER.block.cavity_width
        with naming("block"):
            return Block(**given)

    def under(self, motion: Harmonic | GroundMotion) -> Scene:
        """The block on its site under another motion."""
        block = self.block
        with naming("site"):
            return Scene(block, motion, self.full["site"]["gravity"])

    @cached_property
    def scene(self) -> Scene:
        """Block, motion and gravity; the motion is the first of the records."""
        return self.under(self.harmonic if self.kind == "harmonic" else self.motions[0])

    @property
    def harmonic(self) -> Harmonic:
        """The harmonic motion."""
        with naming("motion"):
            return Harmonic(**{name: self.full["motion"][name] for name in _keys(Harmonic)})

    @property
    def motions(self) -> tuple[GroundMotion, ...]:
        """The pulse or the records."""
        return self._read[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was left out of the records, or assumed of them."""
        return self._read[1]

    @cached_property
    def _read(self) -> tuple[tuple[GroundMotion, ...], tuple[str, ...]]:
        asked = self.full["motion"]
        if self.kind == "pulse":
            return (self._pulse(),), ()
        found, notes = self._records(asked["records"], asked["event"])
        if asked["pga"] is not None:
            with naming("motion", pga_g="pga"):
                found = [motion.scaled_to(pga_g=asked["pga"]) for motion in found]
        return tuple(found), tuple(notes)

    def _pulse(self) -> Pulse:
        """The pulse, of 1 g where its size is not given."""
        asked = self.full["motion"]
        if asked["pulse"] is None or asked["pulse_frequency"] is None:
            raise ValueError(
                "a pulse needs `motion.pulse` (--pulse KIND) and `motion.pulse_frequency` (--pulse-frequency "
                "HZ)"
            )
        shape = {name: asked[name] for name in ("cycles", "phase")}
        with naming("motion", kind="pulse", frequency="pulse_frequency", pga_g="pga"):
            found = Pulse(
                kind=asked["pulse"],
                acceleration=STANDARD_GRAVITY,
                frequency=asked["pulse_frequency"],
                **shape,
            )
            return found.scaled_to(pga_g=1.0 if asked["pga"] is None else asked["pga"])

    def _records(self, names: Sequence[str], events: Sequence[str] | None) -> Any:
        how = {name: self.full["motion"][name] for name in ("channel", "dt", "unit", "baseline")}
        try:
            return read_motions(names, events=events, **how)
        except ValueError as error:
            said = re.sub(r", such as (\w+)=", r", such as \1 = ", str(error))
            raise ValueError(re.sub(r"`(unit|dt|channel|baseline)`", r"`motion.\1` (--\1)", said)) from None

    @property
    def shaking(self) -> GroundMotion:
        """The only pulse or record, at its only size.

        Raises:
            ValueError: a harmonic, several records, or several sizes.
        """
        asked = self.full["motion"]
        if self.kind == "harmonic":
            raise ValueError(
                "give either --record FILE or --pulse KIND, or a job of one: a harmonic has no end"
            )
        if len(self.motions) > 1:
            raise ValueError(
                f"the job has {len(self.motions)} records, but one is needed: --record FILE, --channel N"
            )
        motion, scales = self.motions[0], asked["scales"] or (1.0,)
        if len(scales) > 1:
            raise ValueError(f"the job has {len(scales)} sizes of its motion: give one by --scale X")
        if asked["scales"] is None or asked["intensity"] == "scale":
            return motion.scaled(scales[0])
        measure = intensity_of(asked["intensity"], self.block, self.full["site"]["gravity"], None)
        return motion.scaled(scales[0] / measure.value(motion))

    @cached_property
    def conditions(self) -> Conditions | None:
        """Each frequency with each amplitude and each sample, or each motion at each size; None for the
        neighbourhood of a harmonic."""
        asked, out = self.full["conditions"], Conditions()
        if self.kind != "harmonic":
            return self._shaken()
        if _is_around(self.full):
            return None
        if _size(self.full) > _MOST_CONDITIONS:
            raise ValueError(
                f"a job must have at most {_MOST_CONDITIONS} conditions, but has {_size(self.full)}"
            )
        with naming("conditions", factors="amplitudes", count="frequencies"):
            if asked["band"] is not None:
                out = out * Conditions.band(self.scene, *asked["band"], asked["frequencies"])
            # A factor of one is the scene itself: multiplying by it would only lengthen the description.
            if asked["amplitudes"] != (1.0,):
                out = out * Conditions.amplitudes(*asked["amplitudes"])
        with naming("scatter", size="samples"):
            if widths := _widths(self.full):
                out = out * Conditions.scatter(asked["samples"], self.seed, **widths)
        return out

    def _shaken(self) -> Conditions:
        asked = self.full["motion"]
        if asked["scales"] is None:
            raise ValueError(
                "a design on records needs `motion.scales` (--scales), the sizes that every record is scaled "
                "to; `tpd fragility` and `tpd shake` follow a design through records as they are"
            )
        with naming("motion"):
            return Conditions.records(self.motions, asked["scales"], intensity=asked["intensity"])

    @cached_property
    def space(self) -> DesignSpace:
        """Design space."""
        with naming("space"):
            return DesignSpace(**self.full["space"])

    @cached_property
    def starts(self) -> Starts:
        """Initial states."""
        return Starts.rest() if self.full["starts"]["kind"] == "rest" else Starts.any()

    @cached_property
    def risk(self) -> Risk:
        """Risk measure."""
        asked = self.full["risk"]
        with naming("risk"):
            return (
                Risk.cvar(asked["share"]) if asked["measure"] == "cvar" else getattr(Risk, asked["measure"])()
            )

    @cached_property
    def bob(self) -> Bob:
        """The bob as a body."""
        with naming("bob"):
            return Bob(**self.full["bob"])

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """Limits, in the order of a report."""
        # The paper's setting, a single motion, has a bob without size and no other condition to compare with.
        left_out = (Room, Worsening) if self.full["conditions"]["exactly"] else ()
        found: list[Limit] = []
        bob = self.bob
        with naming("limits"):
            for kind in KINDS:
                value = self.full["limits"][kind.name]
                wanted = value is not None and value is not False and kind not in left_out
                if not wanted or not (kind.of_motion or self.kind == "harmonic"):
                    continue
                given = [bob] if kind is Room else [] if value is True else [value]
                try:
                    found.append(kind(*given))
                except TypeError:
                    raise ValueError(f"`{kind.name}` must be a number or false, but is true") from None
        return tuple(found)

    @cached_property
    def worth(self) -> Worth:
        """Requirements on the benefit."""
        with naming("worth"):
            return Worth(**self.full["worth"])

    @cached_property
    def method(self) -> Method | GroundSearch:
        """Method of the search."""
        asked = self.full["search"]
        kind: Any = GroundSearch if self.kind != "harmonic" else _METHODS[asked["method"]]
        given = {name: asked[name] for name in _keys(kind) if asked[name] is not None}
        if kind is Descent and asked["model"] is not None:
            given["model"] = _MODELS[asked["model"]]
        with naming("search"):
            return kind(**given)

    @cached_property
    def ensemble(self) -> Ensemble:
        """Runs of the verification."""
        with naming("ensemble"):
            if self.kind == "harmonic":
                return Ensemble(**self.full["ensemble"])
        given = {name: self.full["ensemble"][name] for name in SCATTERED} | _widths(self.full)
        with naming("scatter" if _widths(self.full) else "ensemble"):
            return Ensemble(**given)

    @cached_property
    def held_out(self) -> float | dict[str, list[GroundMotion]] | None:
        """Share of the records, or groups of others by name; None under a harmonic."""
        asked = self.full["motion"]["held_out"]
        if self.kind == "harmonic" or asked is None:
            return None if self.kind == "harmonic" else 0.0
        if isinstance(asked, float):
            return asked
        names = [Path(word).name or word for word in asked]
        # Two folders of one name have their whole paths.
        names = [word if names.count(name) > 1 else name for word, name in zip(asked, names, strict=True)]
        return {name: self._records([word], None)[0] for word, name in zip(asked, names, strict=True)}

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `tpd.optimise` beside the scene."""
        names = "space", "conditions", "risk", "limits", "method", "ensemble", "worth", "seed"
        other = "starts" if self.kind == "harmonic" else "held_out"
        return {name: getattr(self, name) for name in (*names, other)}

    @property
    def tables(self) -> Tables:
        """All tables as plain values, without the keys that have no effect."""
        out: Tables = {}
        for table, values in self.full.items():
            # TOML has no null: what is not set is left out.
            effective = {
                key: list(value) if isinstance(value, tuple) else value
                for key, value in values.items()
                if value is not None and not _lacks(self.full, table, key)
            }
            if effective:
                out[table] = effective
        return out

    @property
    def toml(self) -> str:
        """The job as a file that is read back as the same job."""
        lines = ["# Repeat this run: tpd optimise --scene <this file> --out <new directory>"]
        for table, values in self.tables.items():
            # Lists, texts and numbers of TOML are written as those of JSON are.
            lines += ["", f"[{table}]", *(f"{key} = {json.dumps(value)}" for key, value in values.items())]
        return "\n".join(lines) + "\n"


def read(path: Path) -> dict[str, Any]:
    """Return the tables of a job file, not yet checked; paths of records are relative to the file.

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
    return {table: _placed(table, values, path.parent) for table, values in found.items()}


def _placed(table: str, values: Any, folder: Path) -> Any:
    """Values of a table, those of records with absolute paths."""
    if table != "motion" or not isinstance(values, Mapping):
        return values

    def place(value: Any) -> Any:
        listed = isinstance(value, (list, tuple)) and all(isinstance(name, str) for name in value)
        known = {*BUILT_IN, *SETS}
        return [x if x in known else str(folder.resolve() / x) for x in value] if listed else value

    return {key: place(x) if key in ("records", "held_out") else x for key, x in values.items()}


def _typed(given: Mapping[str, Any]) -> Tables:
    """The tables, each value of its type.

    Raises:
        ValueError: an unknown table or key, or a value of the wrong type.
    """
    out: Tables = {}
    for table, values in given.items():
        if table not in TABLES:
            raise ValueError(f"unknown table [{table}]{meant(table, TABLES)}")
        if not isinstance(values, Mapping):
            raise ValueError(f"`{table}` must be a table, but is {values!r}")
        out[table] = {}
        for key, value in values.items():
            if key not in TABLES[table]:
                raise ValueError(f"unknown key `{key}` in [{table}]{meant(key, TABLES[table])}")
            type_ = TABLES[table][key].type
            # Key by key: the sentence can then name the key and what is allowed.
            try:
                out[table][key] = msgspec.convert(value, type_, strict=True)
            except msgspec.ValidationError:
                words, close = allowed(msgspec.json.schema(type_)), ""
                if isinstance(value, str):
                    close = meant(value, msgspec.json.schema(type_).get("enum", ()), listing=False)
                raise ValueError(f"`{table}.{key}` must be {words}, but is {value!r}{close}") from None
    return out


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


def _kinds_in(motion: Mapping[str, Any]) -> dict[str, list[str]]:
    """Kinds of motion that keys of [motion] are of, and these keys."""
    if "kind" in motion:
        return {motion["kind"]: ["kind"]}
    found: dict[str, list[str]] = {}
    for key in motion:
        kinds = _KINDS["motion", key]
        if len(kinds) == 1:
            found.setdefault(kinds[0], []).append(key)
    return found


def _complete(given: Mapping[str, Any]) -> Tables:
    """The typed tables with all keys; what is left out has its default."""
    typed = _typed(given)
    kinds = _kinds_in(typed.get("motion", {}))
    if len(kinds) > 1:
        named = " and ".join(f"of {_MOTIONS[kind]} (`{keys[0]}`)" for kind, keys in kinds.items())
        raise ValueError(f"[motion] has keys {named}, but a motion is of one kind")
    kind = next(iter(kinds), "harmonic")
    full: Tables = {}
    for table, keys in TABLES.items():
        usual = {name: _default(kind, table, name) for name in keys}
        full[table] = usual | typed.get(table, {})
    full["motion"]["kind"] = kind
    # Of words of the command line the paths are relative to where it runs.
    full["motion"] |= {
        key: tuple(x) if isinstance(x, list) else x
        for key, x in _placed("motion", full["motion"], Path()).items()
    }
    return full


def _default(kind: str, table: str, name: str) -> Any:
    return _DEFAULTS[kind].get((table, name), TABLES[table][name].default)


def _lacks(full: Tables, table: str, key: str) -> str:
    """What a key needs for an effect and the job does not have, in words; empty where it has an effect."""
    kinds = _KINDS.get((table, key), tuple(_MOTIONS))
    if full["motion"]["kind"] not in kinds:
        return " or ".join(_MOTIONS[kind] for kind in kinds)
    words, holds = _ONLY_WITH.get((table, key), ("", bool))
    return "" if holds(full) else words


def merged(given: Mapping[str, Any], over: Mapping[str, Any]) -> Tables:
    """Return the tables `given` with the values of `over` in place of theirs.

    A key that has no effect any more, because `over` chooses otherwise, is left out: a file with a share for
    the measure cvar can be run with another measure, and a file about a harmonic with records.

    Raises:
        ValueError: an unknown table or key, or a value of the wrong type.
    """
    out = {table: dict(values) for table, values in _typed(given).items()}
    for table, values in over.items():
        out.setdefault(table, {}).update(values)
    chosen = list(_kinds_in(_typed(over).get("motion", {})))
    if len(chosen) == 1:
        out["motion"]["kind"] = chosen[0]
    # What a key needs may be in the file, among the options, or the default: it is asked before and after.
    is_switched = bool(chosen) and set(_kinds_in(given.get("motion", {})) or ["harmonic"]) != set(chosen)
    after = _complete(out)
    before = after if is_switched else _complete(given)
    for table, values in given.items():
        for key in values:
            is_idle = key not in over.get(table, {}) and _lacks(after, table, key)
            if is_idle and (is_switched or not _lacks(before, table, key)):
                del out[table][key]
    return out


def job_of(given: Mapping[str, Any]) -> Job:
    """Return the job of the tables of a job file; what is left out has its default.

    Raises:
        ValueError: an unknown table or key, a bad value, a key that has no effect, or a block of which a
            part is missing.
    """
    full = _complete(given)
    _refuse_mixture(given, full["motion"]["kind"])
    for table, values in full.items():
        for key, value in values.items():
            # A silent key would let somebody believe in a limit or a seed that does nothing. A file may list
            # defaults, and limits that it turns off.
            is_usual = value == _default(full["motion"]["kind"], table, key) or key == "kind"
            is_off = table == "limits" and value is False
            needed = "" if is_usual or is_off else _lacks(full, table, key)
            if needed:
                raise ValueError(f"`{table}.{key}` goes with {needed}, which this job does not have")
    job = Job(full=full)
    with naming("search"):
        checks.count("seed", job.seed, least=0)
    # The block comes first: what is wrong with it is the reason for much else.
    _ = job.block
    site = job.under(job.harmonic if job.kind == "harmonic" else _PAPER.motion)
    conditions = job.conditions if job.kind == "harmonic" else None
    if job.kind == "pulse":
        _ = job.motions
    if job.kind == "records" and not full["motion"]["records"]:
        raise ValueError("records need `motion.records` (--records FILE), which this job does not have")
    with naming("scatter"):
        check_scatter(site, _widths(full), job.space)
    ensemble = job.ensemble
    with naming("ensemble"):
        if ensemble.restitution:
            check_restitution(site)
    if job.kind == "harmonic":
        with naming("motion"):
            check_moves(site, conditions or Conditions.exactly(), job.space)
    _ = job.risk, job.limits, job.worth
    # Defaults depend on other keys: written out, a job keeps its meaning in a later version.
    numbers = {name: getattr(job.method, name) for name in _keys(type(job.method))}
    filled = {"block": ("friction", "cavity_width"), "search": tuple(numbers)}
    found = {"block": vars(job.block), "search": numbers}
    return Job(full={t: v | {k: found[t][k] for k in filled.get(t, ())} for t, v in full.items()})


def _refuse_mixture(given: Mapping[str, Any], kind: str) -> None:
    """Refuse a block or its motion that is partly given and partly the paper's.

    Losses alone, or a motion alone, are variations of the paper's scene and are allowed.
    """
    block, motion = given.get("block", {}), given.get("motion", {})
    own = [key for key in (*_SHAPE, "radius_of_gyration") if key in block]
    needed = {"block": (_SHAPE, block), "motion": (_keys(Harmonic) if kind == "harmonic" else (), motion)}
    missing = {
        table: absent
        for table, (keys, there) in needed.items()
        if (absent := [k for k in keys if k not in there])
    }
    if not own or not missing:
        return
    lacking = " and ".join(f"{_listed(keys)} in [{table}]" for table, keys in missing.items())
    are = "is" if sum(map(len, missing.values())) == 1 else "are"
    raise ValueError(
        f"a block of your own must be whole, with a motion of its own, but {lacking} {are} missing beside "
        f"{_listed(own)}; without any of these the block is the paper's"
    )


def _listed(names: Sequence[str]) -> str:
    """Names in a row: `a`, `b` and `c`."""
    quoted = [f"`{name}`" for name in names]
    return " and ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)


def of(design: Design) -> Job:
    """Return the job that asks the question of a design.

    Raises:
        ValueError: a question that no job file can ask: motions or a limit that exist only in Python.
    """
    scene, found = design.scene, _asked(design)
    try:
        job = job_of({table: _said(values) for table, values in found.items()})
    except ValueError as error:
        raise ValueError(f"a job file cannot say what this design was asked: {error}") from None
    for name in ("space", "risk", "limits", "method", "ensemble", "worth", "seed"):
        # Models and optimisers of one kind are equal by what they print.
        if repr(getattr(job, name)) != repr(getattr(design, name)) and not _is_usual_model(job, design, name):
            raise ValueError(f"a job file cannot say the `{name}` of this design, {getattr(design, name)}")
    if isinstance(design, HarmonicDesign):
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


def _is_usual_model(job: Job, design: Design, name: str) -> bool:
    """Whether two methods differ in the model alone that the search itself has chosen."""
    ours, theirs = job.method, design.method
    if name != "method" or not (isinstance(ours, Descent) and isinstance(theirs, Descent)):
        return False
    return ours.model is None and repr(theirs.model) in map(repr, _MODELS.values())


def _asked(design: Design) -> dict[str, dict[str, Any]]:
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
    models = {repr(model): name for name, model in _MODELS.items()}
    search |= {"model": models.get(repr(search.get("model"))), "seed": design.seed}
    if isinstance(method, Method):
        search["method"] = method.name
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
    if isinstance(design, HarmonicDesign):
        asked |= {
            "motion": vars(scene.motion),
            "worth": vars(design.worth),
            "ensemble": vars(design.ensemble),
        }
        asked |= {"starts": {"kind": "rest" if design.starts.kind is StartKind.rest else "any"}}
        return _with_conditions(asked, design)
    widths = {name: getattr(design.ensemble, name) for name in SCATTERED}
    worth = {"at_least": design.worth.at_least, "strikes": design.worth.strikes}
    return asked | {"motion": _motion_of(design), "worth": worth, "ensemble": widths}


def _with_conditions(asked: dict[str, dict[str, Any]], design: HarmonicDesign) -> dict[str, dict[str, Any]]:
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
    groups = {g.name: [_name_of(m) for m in g.motions] for g in design.groups if g.role is Role.held_out}
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
