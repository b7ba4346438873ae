"""What a job file asks of a design over many conditions: its tables, read, checked and written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from tpd.analysis.attractors import Starts
from tpd.analysis.ensemble import Ensemble
from tpd.core import checks
from tpd.core.conditions import FACTORS, Conditions, Limits, Measure
from tpd.core.scene import Scene

MEASURES = ("worst", "expected", "cvar")
"""What can be minimised."""
METHODS = ("sequential", "adam", "lbfgs")
"""How to descend."""
TABLES = ("conditions", "scatter", "limits", "ensemble")
"""Tables of a job file that are read here."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """The table [conditions]: under what, and by which measure.

    Raises:
        ValueError: a value out of range.
    """

    band: tuple[float, ...] = ()
    """From and to, Hz; empty for the scene's own frequency."""
    frequencies: int = 20
    """In the band."""
    amplitudes: tuple[float, ...] = (1.0,)
    """Factors on the amplitude of the base motion."""
    samples: int = 64
    """Of what [scatter] holds."""
    measure: str = "worst"
    share: float = 0.1
    """Of the conditions that the measure "cvar" is the mean of, the worst."""
    from_rest: bool = False
    reached: int = 0
    """Starts that the search is finished over, at what they reach; 0 for all symmetric orbits instead."""
    by_share: bool = True
    by_overturning: bool = False

    def __post_init__(self) -> None:
        checks.one_of("measure", self.measure, MEASURES)
        if len(self.band) not in (0, 2):
            raise ValueError(f"`band` must be two frequencies, but has {len(self.band)}")
        checks.count("frequencies", self.frequencies, least=2)
        checks.count("samples", self.samples)
        checks.within("share", self.share, 1e-9, 1.0)
        checks.count("reached", self.reached, least=0)
        if not self.by_share and not self.reached:
            raise ValueError("the worst start (`by_share` false) is among those of `reached`: none are given")
        if self.from_rest and self.reached:
            raise ValueError(f"`from_rest` is for one start: `reached` must then be 0, but is {self.reached}")


@dataclass(frozen=True, kw_only=True)
class Asked:
    """Everything a job asks of a design over many conditions."""

    wanted: Wanted = field(default_factory=Wanted)
    scatter: Mapping[str, float] = field(default_factory=dict)
    """Relative half widths of what is uncertain, by names of `FACTORS`."""
    limits: Limits = field(default_factory=Limits)

    @staticmethod
    def of(given: Mapping[str, Any]) -> Asked | None:
        """What the tables of a job ask; None if they ask for no conditions.

        Raises:
            ValueError: an unknown or ill-typed key, or a value out of range.
        """
        wanted = _read(Wanted, "conditions", given.get("conditions", {}))
        limits = _read(Limits, "limits", given.get("limits", {}))
        scatter = _table("scatter", given.get("scatter", {}), FACTORS)
        for name, width in scatter.items():
            checks.within(f"scatter.{name}", width, 0.0, 0.5)
        if not {"conditions", "scatter"} & set(given):
            if "limits" in given:
                raise ValueError(
                    "[limits] goes with conditions, such as a band, and so does --walls: none are given"
                )
            return None
        return Asked(wanted=wanted, scatter=dict(scatter), limits=limits)

    def conditions(self, scene: Scene, seed: int) -> Conditions:
        """The conditions for a scene."""
        out = Conditions()
        if self.wanted.band:
            low, high = self.wanted.band
            out = out * Conditions.band(scene, low, high, self.wanted.frequencies)
        if self.wanted.amplitudes != (1.0,):
            out = out * Conditions.amplitudes(*self.wanted.amplitudes)
        if self.scatter:
            out = out * Conditions.scatter(self.wanted.samples, seed, **self.scatter)
        return out

    def reached(self, seed: int) -> Starts | None:
        """The starts that the search is finished over, if any."""
        return Starts(size=self.wanted.reached, seed=seed) if self.wanted.reached else None

    @property
    def measure(self) -> Measure:
        """What is minimised."""
        kinds = {"worst": Measure.worst, "expected": Measure.expected}
        return (
            kinds[self.wanted.measure]() if self.wanted.measure in kinds else Measure.cvar(self.wanted.share)
        )

    def tables(self) -> dict[str, dict[str, Any]]:
        """The same as tables of plain values, without what is None."""
        return {
            "conditions": plain(self.wanted),
            "scatter": dict(self.scatter),
            "limits": plain(self.limits),
        }


def ensemble_of(given: Mapping[str, Any]) -> Ensemble:
    """The table [ensemble] of a job.

    Raises:
        ValueError: an unknown or ill-typed key, or a value out of range.
    """
    return _read(Ensemble, "ensemble", given.get("ensemble", {}))


def plain(thing: Any) -> dict[str, Any]:
    """A dataclass as a table, without what is None."""
    values = asdict(thing)
    return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items() if v is not None}


def _read(kind: type, table: str, values: Any) -> Any:
    """A dataclass of a table's values."""
    known = {f.name: f for f in fields(kind)}
    given = {}
    for name, value in _table(table, values, tuple(known)).items():
        default = known[name].default
        given[name] = _typed(f"{table}.{name}", value, default)
    return kind(**given)


def _table(table: str, values: Any, allowed: tuple[str, ...]) -> dict[str, Any]:
    if not isinstance(values, dict):
        raise ValueError(f"`{table}` must be a table, but is {values!r}")
    for name in values:
        if name not in allowed:
            raise ValueError(f"unknown key `{name}` in [{table}]; allowed are {', '.join(sorted(allowed))}")
    return values


def _typed(name: str, value: Any, default: Any) -> Any:
    """The value in the type of its default."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if isinstance(default, (bool, str)):
        if not isinstance(value, type(default)):
            kind = "true or false" if isinstance(default, bool) else "a word"
            raise ValueError(f"`{name}` must be {kind}, but is {value!r}")
        return value
    if isinstance(default, tuple):
        items = value if isinstance(value, list) else [value]
        if not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in items):
            raise ValueError(f"`{name}` must be numbers, but is {value!r}")
        return tuple(float(x) for x in items)
    if not number or (isinstance(default, int) and not isinstance(value, int)):
        kind = "a whole number" if isinstance(default, int) else "a number"
        raise ValueError(f"`{name}` must be {kind}, but is {value!r}")
    return value if isinstance(default, int) else float(value)
