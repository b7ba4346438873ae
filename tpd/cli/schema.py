"""Schema of the job file: its tables, the type and range of every key, and the default of each.

The command line takes its help texts from here, so that a key is described once. Nothing here imports JAX.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct, inspect

NEIGHBOURHOOD = 10
"""Conditions of a neighbourhood of the motion: see `Conditions.around`."""
_LARGEST = 2**31 - 1
"""Largest count or seed: beyond it the random generators and the arrays of NumPy fail."""

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Count = Annotated[int, Meta(ge=1, le=_LARGEST)]
Seed = Annotated[int, Meta(ge=0, le=_LARGEST)]
HalfWidth = Annotated[float, Meta(ge=0, le=0.5)]
Fraction = Annotated[float, Meta(ge=0, le=1)]
Share = Annotated[float, Meta(ge=1e-9, le=1)]
Modulus = Annotated[float, Meta(ge=1e-6, le=1)]
Pair = tuple[float, float]


def _says(text: str) -> Meta:
    """Description of a key, in the schema and in the help of the command line."""
    return Meta(description=text)


class Table(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One table of a job file. A key of None is left out, and has the default that its description says."""


class ProjectTable(Table, frozen=True, kw_only=True):
    """The project that a report belongs to."""

    name: Annotated[
        str,
        Meta(max_length=100, pattern=r"^[^\x00-\x1f\x7f]*$"),
        _says("name of the project, for titles (default none)"),
    ] = ""


class BlockTable(Table, frozen=True, kw_only=True):
    """The block."""

    width: Annotated[Positive, _says("whole width of the block, m")] = 0.1
    height: Annotated[Positive, _says("whole height of the block, m")] = 0.4
    mass: Annotated[Positive, _says("mass of the block, kg")] = 16.224
    friction: Annotated[
        NotNegative | None,
        _says("friction moment of the contact over M g b (default 0.05, or 0 with a restitution)"),
    ] = None
    restitution: Annotated[
        Positive | Literal["housner"] | None,
        _says(
            "velocity ratio across an impact of the base, at most 1, or `housner` for that of the block's "
            "shape (default: no impact loss)"
        ),
    ] = None
    radius_of_gyration: Annotated[
        Positive | None, _says("about the centroid, m (default: that of a uniform rectangle)")
    ] = None
    cavity_width: Annotated[
        Positive | None,
        _says("width of the space in which the bob swings, m: needed where the limits ask for room"),
    ] = None


class MotionTable(Table, frozen=True, kw_only=True):
    """The base motion, x = amplitude sin(2 pi frequency t)."""

    amplitude: Annotated[NotNegative, _says("amplitude of the base motion, m")] = 0.015
    frequency: Annotated[Positive, _says("frequency of the base motion, Hz")] = 2.5


class BobTable(Table, frozen=True, kw_only=True):
    """The bob as a body."""

    shape: Annotated[Literal["ball", "cylinder"], _says("shape of the bob: ball or cylinder")] = "ball"
    density: Annotated[
        Annotated[float, Meta(ge=100, le=25000)], _says("density of the bob, kg/m^3 (steel: 7850)")
    ] = 7850.0
    aspect: Annotated[Annotated[float, Meta(ge=0.1, le=20)], _says("height over diameter of a cylinder")] = (
        2.0
    )


class SiteTable(Table, frozen=True, kw_only=True):
    """The site."""

    gravity: Annotated[Positive, _says("gravity, m/s^2")] = 9.80665


class SpaceTable(Table, frozen=True, kw_only=True):
    """The design space."""

    mass_ratio: Annotated[Pair, _says("bounds of bob over block mass")] = (0.01, 0.2)
    length_ratio: Annotated[Pair, _says("bounds of pendulum length over half height")] = (0.1, 1.5)
    damping_ratio: Annotated[
        float | Pair, _says("damping ratio of the hinge, or two bounds to search it as well")
    ] = 0.1


class ConditionsTable(Table, frozen=True, kw_only=True):
    """Conditions under which a design is sought: each frequency with each amplitude and each sample. Without
    any of these it is a neighbourhood of the motion: 5 % in frequency, and 10 % more amplitude."""

    exactly: Annotated[
        bool, _says("search for the motion itself alone with a point bob, as in the paper")
    ] = False
    band: Annotated[
        Pair | None, _says("lower and upper end of a band of frequencies, Hz (default: the one of [motion])")
    ] = None
    frequencies: Annotated[int, Meta(ge=2, le=_LARGEST), _says("number of frequencies in the band")] = 20
    amplitudes: Annotated[
        tuple[Positive, ...], Meta(min_length=1), _says("factors on the amplitude of the base motion")
    ] = (1.0,)
    samples: Annotated[Count, _says("number of samples of what [scatter] holds")] = 64


class ScatterTable(Table, frozen=True, kw_only=True):
    """Uncertain quantities, each by its relative half width."""

    amplitude: Annotated[HalfWidth | None, _says("amplitude of the base motion")] = None
    frequency: Annotated[HalfWidth | None, _says("frequency of the base motion")] = None
    friction: Annotated[HalfWidth | None, _says("friction moment of the contact")] = None
    slenderness: Annotated[HalfWidth | None, _says("slenderness of the block")] = None
    mass: Annotated[HalfWidth | None, _says("mass of the pendulum")] = None
    length: Annotated[HalfWidth | None, _says("length of the pendulum")] = None
    damping: Annotated[HalfWidth | None, _says("damping ratio of the pendulum")] = None
    restitution: Annotated[HalfWidth | None, _says("restitution of the block, where it is a number")] = None


class StartsTable(Table, frozen=True, kw_only=True):
    """Initial states from which the settled motion counts in the search."""

    kind: Annotated[
        Literal["rest", "any"],
        _says("any: the largest motion that attracts; rest: rest wherever it holds"),
    ] = "any"


class RiskTable(Table, frozen=True, kw_only=True):
    """Risk measure: how the tilts under all conditions become one number."""

    measure: Annotated[
        Literal["worst", "expected", "cvar"],
        _says("worst, expected or cvar, the mean of the worst share of the conditions"),
    ] = "worst"
    share: Annotated[Share, _says("share of the conditions in the measure cvar")] = 0.1


class LimitsTable(Table, frozen=True, kw_only=True):
    """Limits that a design keeps under every condition."""

    stroke: Annotated[Positive, _says("largest bob angle of the settled motion, rad")] = 0.5
    relative_stroke: Annotated[Positive | None, _says("largest angle of the bob against the block, rad")] = (
        None
    )
    tilt: Annotated[Positive | None, _says("largest tilt, as a share of the slenderness")] = None
    mass: Annotated[Positive | None, _says("largest mass of the bob, kg")] = None
    offset: Annotated[
        Positive | None, _says("largest distance of the settled bob's centre from the block's axis, m")
    ] = None
    room: Annotated[bool, _says("the bob as a body must keep off the walls")] = True
    worsening: Annotated[
        NotNegative | None,
        _says("largest share by which a condition's settled tilt may exceed that of the bare block"),
    ] = 0.05
    multiplier: Annotated[
        Modulus | None,
        _says("largest modulus of the Floquet multipliers; `reserve` is the better limit"),
    ] = None
    reserve: Annotated[
        Positive, _says("least distance of an orbit from where it stops attracting, dimensionless")
    ] = 0.05


class SearchTable(Table, frozen=True, kw_only=True):
    """The search. The defaults of its numbers depend on the method."""

    method: Annotated[
        Literal["descent", "sequential"] | None,
        _says("method of the search (default descent)"),
    ] = None
    optimiser: Annotated[
        Literal["adam", "rmsprop"] | None,
        _says("optimiser of optax that the method descent takes (default adam)"),
    ] = None
    model: Annotated[
        Literal["smoothed", "piecewise"] | None,
        _says(
            "model whose gradients the method descent takes (default smoothed: signs and impacts smoothed, "
            "orbits followed by diffrax; piecewise: the exact ones)"
        ),
    ] = None
    searches: Annotated[Count | None, _says("number of searches (default descent 16, sequential 64)")] = None
    screening: Annotated[Count | None, _says("designs solved before the searches (default 512)")] = None
    steps: Annotated[Count | None, _says("most steps of each search (default 40)")] = None
    tolerance: Annotated[
        Positive,
        _says("largest relative difference between the model of the method descent and the exact amplitude"),
    ] = 0.01
    seed: Annotated[Seed, _says("seed of the screening and the samples")] = 0


class WorthTable(Table, frozen=True, kw_only=True):
    """Requirements on the benefit, by paired runs of the nonlinear equations."""

    at_least: Annotated[Fraction, _says("least share by which the mean tilt of all runs must fall")] = 0.1
    worse: Annotated[Fraction, _says("largest share by which the mean tilt under one condition may rise")] = (
        0.05
    )
    strikes: Annotated[
        Fraction | None,
        _says(
            "largest share of the standing runs in which the bob may strike a wall, or under records any "
            "limit may be broken (default 0.01, under records 0.1)"
        ),
    ] = None
    runs: Annotated[
        Count | None, _says("most runs with the pendulum and without (default all of the ensemble)")
    ] = None


class EnsembleTable(Table, frozen=True, kw_only=True):
    """Runs by which a design is verified."""

    size: Annotated[Count, _says("number of runs")] = 512
    seed: Annotated[Seed, _says("seed of the runs")] = 0
    periods: Annotated[Count, _says("most forcing periods of a run")] = 100
    tilt: Annotated[NotNegative, _says("largest |phi| at the start, as a share of nu")] = 0.05
    tilt_rate: Annotated[NotNegative, _says("largest |phi'| at the start, as a share of nu")] = 0.05
    swing: Annotated[NotNegative, _says("largest |psi| at the start, rad")] = 0.05
    swing_rate: Annotated[NotNegative, _says("largest |psi'| at the start, rad per unit tau")] = 0.05
    any_phase: Annotated[bool, _says("whether the shaking may begin at any of its phases")] = True
    ramps: Annotated[
        tuple[NotNegative, ...], Meta(min_length=1), _says("times over which the shaking grows, s")
    ] = (0.0, 2.0)
    amplitude: Annotated[HalfWidth, _says("relative half width of the base's amplitude")] = 0.01
    frequency: Annotated[HalfWidth, _says("relative half width of the base's frequency")] = 0.01
    friction: Annotated[HalfWidth, _says("relative half width of k")] = 0.2
    damping: Annotated[HalfWidth, _says("relative half width of zeta")] = 0.2
    restitution: Annotated[
        HalfWidth | None,
        _says("relative half width of the restitution (default 0.02 where it is a number below 1, else 0)"),
    ] = None
    slenderness: Annotated[HalfWidth, _says("relative half width of the block's slenderness")] = 0.02
    mass: Annotated[HalfWidth, _says("relative half width of the bob's mass")] = 0.02
    length: Annotated[HalfWidth, _says("relative half width of the rod's length")] = 0.02


class JobFile(Table, frozen=True, kw_only=True):
    """A job file of `tpd optimise`. A table or a key that is left out has its default."""

    project: ProjectTable = ProjectTable()
    block: BlockTable = BlockTable()
    motion: MotionTable = MotionTable()
    bob: BobTable = BobTable()
    site: SiteTable = SiteTable()
    space: SpaceTable = SpaceTable()
    conditions: ConditionsTable = ConditionsTable()
    scatter: ScatterTable = ScatterTable()
    starts: StartsTable = StartsTable()
    risk: RiskTable = RiskTable()
    limits: LimitsTable = LimitsTable()
    worth: WorthTable = WorthTable()
    search: SearchTable = SearchTable()
    ensemble: EnsembleTable = EnsembleTable()

    @property
    def widths(self) -> dict[str, float]:
        """Relative half widths of what is uncertain."""
        return {n: w for n, w in msgspec.structs.asdict(self.scatter).items() if w is not None}

    @property
    def is_around(self) -> bool:
        """Whether the conditions are the neighbourhood of the motion, which is the default."""
        asked = self.conditions
        given = asked.band is not None or asked.amplitudes != (1.0,) or bool(self.widths)
        return not given and not asked.exactly

    @property
    def size(self) -> int:
        """Number of conditions."""
        if self.is_around:
            return NEIGHBOURHOOD
        asked = self.conditions
        frequencies = 1 if asked.band is None else asked.frequencies
        return frequencies * len(asked.amplitudes) * (asked.samples if self.widths else 1)


@dataclass(frozen=True)
class Key:
    """Type, description and default of one key."""

    type: Any
    description: str
    default: Any

    @property
    def allowed(self) -> str:
        """Values that the key may have, as in "a number above 0"."""
        return _allowed(inspect.type_info(self.type))

    @property
    def words(self) -> tuple[str, ...]:
        """Words that the key may be."""
        return tuple(_words(inspect.type_info(self.type)))

    @property
    def counts(self) -> tuple[int, ...]:
        """Numbers of values that the key may have; 0 stands for any number of them."""
        return tuple(sorted({_count(part) for part in _parts(inspect.type_info(self.type))}))


@lru_cache(maxsize=1)
def keys() -> dict[str, dict[str, Key]]:
    """All keys by table and name."""
    return {table.name: _keys_of(table.type) for table in msgspec.structs.fields(JobFile)}


def _keys_of(kind: type[Table]) -> dict[str, Key]:
    """Keys of one table."""
    found = {}
    for field in msgspec.structs.fields(kind):
        metas = [m for m in getattr(field.type, "__metadata__", ()) if isinstance(m, Meta)]
        text = next(m.description for m in reversed(metas) if m.description is not None)
        found[field.name] = Key(field.type, text, field.default)
    return found


def json_schema() -> str:
    """The schema as JSON Schema, for editors and other programs."""
    content = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Job file of tpd optimise",
        **msgspec.json.schema(JobFile),
    }
    return json.dumps(content, indent=1) + "\n"


def _parts(info: inspect.Type) -> list[inspect.Type]:
    """Alternatives of a type, without None."""
    if isinstance(info, inspect.Metadata):
        return _parts(info.type)
    if isinstance(info, inspect.UnionType):
        return [part for each in info.types for part in _parts(each)]
    return [] if isinstance(info, inspect.NoneType) else [info]


def _count(info: inspect.Type) -> int:
    if isinstance(info, inspect.TupleType):
        return len(info.item_types)
    return 0 if isinstance(info, inspect.VarTupleType) else 1


def _words(info: inspect.Type) -> list[str]:
    literals = [part for part in _parts(info) if isinstance(part, inspect.LiteralType)]
    return sorted(str(word) for literal in literals for word in literal.values)


def _allowed(info: inspect.Type) -> str:
    """Values of a type in words."""
    return " or ".join(_noun(part) for part in _parts(info))


def _noun(info: inspect.Type) -> str:
    match info:
        case inspect.BoolType():
            return "true or false"
        case inspect.StrType():
            return f"a text in one line of at most {info.max_length} characters"
        case inspect.LiteralType():
            words = _words(info)
            return f"one of {', '.join(words)}" if len(words) > 1 else repr(words[0])
        case inspect.TupleType():
            return "a pair of numbers"
        case inspect.VarTupleType():
            return f"a list, not empty, each {_noun(info.item_type)}"
        case inspect.IntType():
            return "a whole number" + _range(info)
        case inspect.FloatType():
            return "a number" + _range(info)
    raise TypeError(f"no words for {info}")


def _range(info: inspect.IntType | inspect.FloatType) -> str:
    """Range of a number in words."""
    if info.gt is not None:
        return f" above {info.gt:g}"
    if info.ge is None:
        return ""
    return f" of at least {info.ge:g}" if info.le is None else f" from {info.ge:g} to {info.le:.10g}"
