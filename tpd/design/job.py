"""Job file: the arguments of `tpd.optimise` as tables in TOML, to be read and written."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tpd.compiled import compiling
from tpd.core import checks
from tpd.core.files import path_of
from tpd.core.formatting import argument_names, number_hint
from tpd.design.risk import Risk
from tpd.design.settings import SCATTERED, Descent, GroundSearch
from tpd.design.space import TWINS, DesignSpace, check_moves, check_scatter
from tpd.design.tables import (
    PAPER,
    READING,
    TABLES,
    Tables,
    complete_tables,
    is_around,
    kinds_in,
    lacks,
    required_keys,
    size_of,
    typed_tables,
    widths_of,
    with_absolute_paths,
)
from tpd.formats.table import ROWS
from tpd.formats.text import UnreadableRecord
from tpd.limits import LIMIT_KINDS, OBJECTIVES, Clearance, Limit, Objective, Requirements, Worsening
from tpd.records.intensity import intensity_of
from tpd.records.read import described, in_words, read_motions
from tpd.scene.bob import Bob
from tpd.scene.conditions import MEASURES, Conditions, check_restitution
from tpd.scene.ensemble import Ensemble, Starts
from tpd.scene.ground_motion import STANDARD_GRAVITY, GroundMotion, Pulse, events_of
from tpd.scene.hazard import Hazard
from tpd.scene.impacts import housner
from tpd.scene.scene import Block, Harmonic, Scene

_MOST_NAMES = 9
"""Largest number of records that a message lists."""
_MOST_CONDITIONS = 100_000
"""Largest number of conditions. With more, the arrays of a search do not fit in the memory of a usual
computer."""


class TableError(ValueError):
    """Error in the values of a table, which the message names."""


@contextmanager
def naming(table: str, **keys: str) -> Iterator[None]:
    """Add the name of a table to the messages about its values.

    `keys` maps names of arguments to the keys of the table, if they differ.
    """
    try:
        with argument_names({name: f"`{key}`" for name, key in keys.items()}):
            yield
    except TableError:
        # The message contains the name of another table, which was read in between.
        raise
    except ValueError as error:
        raise TableError(f"[{table}] {error}") from None


@dataclass(frozen=True, kw_only=True)
class Job(ABC):
    """Arguments of `tpd.optimise` from the tables of a job file. Each kind of motion has a subclass.

    Records are read on first use. The field `full` contains all keys of all tables with their values.

    Example:
        >>> import tempfile, pathlib, tpd
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "job.toml"
        >>> _ = path.write_text("limits = {stroke = 0.4, clearance = false}")
        >>> job = tpd.Job.read(path)
        >>> job.kind, [limit.name for limit in job.limits]
        ('harmonic', ['stroke', 'worsening', 'reserve'])
    """

    full: Tables
    """All keys of all tables; None for a key that is left out and has no default."""
    compiled: ClassVar[tuple[str, ...]]
    """Modules with the compiled code that the motions use."""
    search: ClassVar[type[Descent | GroundSearch]]
    """Class of the settings of the search."""
    only: ClassVar[tuple[str, ...]]
    """Arguments of `tpd.optimise` that other kinds of jobs do not have."""
    settles: ClassVar[bool] = False
    """Whether motions under the excitation settle."""

    @staticmethod
    def read(path: str | Path) -> Job:
        """Read a job from a file in TOML.

        Raises:
            ValueError: the file cannot be read, or the job is not allowed.
        """
        return job_of(read_tables(path_of(path)))

    @property
    def kind(self) -> str:
        """Kind of the motion: harmonic, pulse or records."""
        return self.full["excitation"]["kind"]

    @property
    def seed(self) -> int:
        """Seed of all random choices."""
        return self.full["search"]["seed"]

    @cached_property
    def block(self) -> Block:
        """Block of the job. The block of the paper also has the losses and the cavity that it has in
        Python."""
        values: dict[str, Any] = {name: x for name, x in self.full["block"].items() if x is not None}
        wide = self.full["frame"]["width"]
        # The default block is that of the paper. A user's own block has the defaults of `Block`.
        if all(values[x] == getattr(PAPER.block, x) for x in required_keys("block")):
            # The bob swings in the cavity of the paper's block, unless there is a frame.
            values = vars(PAPER.block) | ({} if wide is None else {"cavity_width": None}) | values
        with naming("block"):
            block = Block(**values)
        if wide is not None:
            with naming(
                "frame", cavity_width="block.cavity_width", frame_width="frame.width", hinge_height="height"
            ):
                block = replace(block, frame_width=wide)
                block.check_hinge(self.full["frame"]["height"])
        # Some authors state the ratio of the energies, which is e^2.
        e, stated = housner(block.slenderness, block.inertia_ratio), block.velocity_ratio
        if abs(stated - e**2) <= _RESTITUTION_DIFFERENCE < abs(stated - e):
            question = "is it the ratio of the energies instead of that of the angular velocities?"
            near = f"the square of Housner's coefficient {e:.4g} for this shape"
            warnings.warn(f"`block.restitution` is {stated:g}, about {near}: {question}", stacklevel=2)
        return block

    def under(self, motion: Harmonic | GroundMotion) -> Scene:
        """Return the block at its site under another motion."""
        block = self.block
        with naming("site"):
            return Scene(block, motion, self.full["site"]["gravity"])

    @cached_property
    def scene(self) -> Scene:
        """Block, motion and gravity. With several records the motion is the first of them."""
        return self.under(self.motions[0])

    @abstractmethod
    def check_motion(self) -> None:
        """Raise `ValueError` if the motion is not allowed, as far as this can be checked without reading its
        files."""

    @cached_property
    @abstractmethod
    def _read(self) -> tuple[Sequence[Any], Sequence[str]]:
        """Motions, and notes on them."""

    @property
    def motions(self) -> tuple[Any, ...]:
        """The harmonic, the pulse or the records."""
        return tuple(self._read[0])

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was left out of the records, or assumed about them."""
        return tuple(self._read[1])

    @property
    def messages(self) -> tuple[str, ...]:
        """Lines for a terminal: the records that were read, and the notes on them."""
        return (*described(self.motions), *self.notes)

    @property
    def ground_motions(self) -> tuple[GroundMotion, ...]:
        """The pulse or the records.

        Raises:
            ValueError: the motion is a harmonic.
        """
        if self.settles:
            raise ValueError("the motion must be a pulse or a record: give --record FILE or --pulse KIND")
        return self.motions

    @property
    def intensity(self) -> str:
        """Name in `tpd.records.intensity` of the measure that the scales refer to."""
        return self.full["excitation"]["intensity"]

    @cached_property
    def hazard(self) -> Hazard | None:
        """Seismic hazard of the site; None if the job has none."""
        keys: dict[str, Any] = dict(self.full["hazard"])
        if keys == {name: key.default for name, key in TABLES["hazard"].items()}:
            return None
        with naming("hazard"):
            return Hazard(**keys)

    @property
    def shaking(self) -> GroundMotion:
        """The only pulse or record, at its only scale.

        Raises:
            ValueError: the motion is a harmonic, or there are several records or several scales.
        """
        keys = self.full["excitation"]
        motions, scales = self.ground_motions, keys["scales"] or (1.0,)
        if len(motions) > 1:
            names = "; ".join(
                getattr(m, "source", "") or getattr(m, "name", "") for m in motions[:_MOST_NAMES]
            )
            more = "; and more" if len(motions) > _MOST_NAMES else ""
            raise ValueError(
                f"the job has {len(motions)} records ({names}{more}), but exactly one is needed: choose it "
                "with --record FILE and --channel N"
            )
        if len(scales) > 1:
            raise ValueError(
                f"the job has {len(scales)} scales, but exactly one is needed: choose it with --scale X"
            )
        motion = next(iter(motions))
        if motion.pga == 0.0 or scales[0] == 0.0:
            raise ValueError("the acceleration of the motion must not be zero at all times")
        with naming("excitation"):
            checks.plausible("the largest of `scales`", scales[0], self.intensity)
        if keys["scales"] is None:
            return motion
        # A scale is a value of the intensity, so divide by the intensity of the motion as it is.
        measure = intensity_of(self.intensity, self.block, self.full["site"]["gravity"], None)
        return motion.scaled(scales[0] / measure.value(motion))

    @property
    def single(self) -> Scene:
        """Scene under its only motion, at its only scale.

        Raises:
            ValueError: there are several records or several scales.
        """
        return self.scene if self.settles else self.under(self.shaking)

    @cached_property
    @abstractmethod
    def conditions(self) -> Conditions | None:
        """Each frequency with each amplitude and each sample, or each motion at each scale.

        None stands for the neighbourhood of a harmonic, which is the default.
        """

    @property
    def in_words(self) -> str:
        """Description of the ground motions with their scales; empty for a harmonic, which its scene
        describes."""
        return ""

    @cached_property
    def space(self) -> DesignSpace:
        """Design space."""
        keys, hinge = self.full["space"], self.full["frame"]["height"]
        with naming("space"):
            if hinge is not None and keys["hinge_height"] is not None:
                raise ValueError("`hinge_height` must not be stated with `frame.height`, which is the same")
            return DesignSpace(**(keys if hinge is None else keys | {"hinge_height": hinge}))

    @cached_property
    def risk(self) -> Risk:
        """Risk measure."""
        keys = self.full["search"]
        with naming("search", share="risk_share"):
            name = keys["risk"]
            return Risk.cvar(keys["risk_share"]) if name == "cvar" else getattr(Risk, name)()

    @cached_property
    def bob(self) -> Bob:
        """Bob as a body."""
        with naming("bob"):
            return Bob(**self.full["bob"])

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """Limits, in the order of a report."""
        # The setting of the paper is a single motion and a bob without size: clearance and comparison with
        # other conditions do not apply.
        skipped = (Clearance, Worsening) if self.full["conditions"]["exactly"] else ()
        limits: list[Limit] = []
        bob = self.bob
        with naming("limits"):
            for kind in LIMIT_KINDS:
                value, missing = self.full["limits"][kind.name], lacks(self.full, "limits", kind.name)
                # Skip limits that are switched off, and those that have no effect with this motion.
                if value is None or value is False or kind in skipped or missing:
                    continue
                # A value of true stands for the default number of the limit.
                arguments: list[Any] = [bob] if kind is Clearance else [] if value is True else [value]
                try:
                    limits.append(kind(*arguments))
                except TypeError:
                    # This limit has no default number.
                    raise ValueError(f"`{kind.name}` must be a number or false, but is true") from None
        return tuple(limits)

    @cached_property
    def requirements(self) -> Requirements:
        """Requirements on benefit and harm."""
        with naming("requirements"):
            return Requirements(**self.full["requirements"])

    @property
    def _search_keys(self) -> set[str]:
        """Keys of [search] that are settings of the search."""
        return {f.name for f in fields(self.search)} & self.full["search"].keys()

    @cached_property
    def method(self) -> Descent | GroundSearch:
        """Settings of the search."""
        keys = self.full["search"]
        with naming("search"):
            return self.search(**{x: keys[x] for x in self._search_keys if keys[x] is not None})

    @cached_property
    @abstractmethod
    def ensemble(self) -> Ensemble:
        """Runs of the validation."""

    @cached_property
    def _validation(self) -> tuple[float | dict[str, list[GroundMotion]] | None, list[str]]:
        """Validation share or validation groups, and notes on the records of the groups."""
        share = self.full["excitation"]["validation_share"]
        groups, messages = dict[str, list[GroundMotion]](), list[str]()
        if not isinstance(share, tuple):
            return share, messages
        # The names of the groups in the report are the last parts of the paths.
        names = [Path(word).name or word for word in share]
        for word, name in zip(share, names, strict=True):
            # If two folders have the same name, their whole paths are the names of the groups.
            group = word if names.count(name) > 1 else name
            groups[group], notes = self._records([word])
            # The problem leaves out records of earthquakes that the search uses, without a message. Number
            # the earthquakes of both sides together to report these records here.
            events = events_of([*self.motions, *groups[group]])
            used, own = events[: len(self.motions)], events[len(self.motions) :]
            if tuned := [m for m, event in zip(groups[group], own, strict=True) if event in used]:
                records = ", ".join(getattr(m, "source", "") or getattr(m, "name", "") for m in tuned)
                notes = [*notes, f"left out, because the search uses the same earthquakes: {records}"]
            messages += [f"validation, {group}: {line}" for line in notes]
        return groups, messages

    @property
    def reading(self) -> dict[str, Any]:
        """Options with which the files of records are read."""
        how = {name: x for name in READING if (x := self.full["excitation"][name]) is not None}
        # Columns are texts NAME=NUMBER in a job file, and a mapping in Python.
        return how | ({"columns": _columns_of(how["columns"])} if "columns" in how else {})

    def _records(self, names: Sequence[str]) -> Any:
        """Read records with the reading options of the job; messages use the keys of the job file."""
        called = {name: f"`excitation.{name}` (--{name})" for name in READING}
        with argument_names(called | {"events": "`records.events` (--event)"}):
            try:
                read: tuple[Any, Any] = read_motions(
                    names, events=self.full["records"]["events"], **self.reading
                )
            except UnreadableRecord as error:
                flags = (f"--{name} {_words(value)}" for name, value in error.options.items())
                more = "; try these options: " + " ".join(flags) if error.options else ""
                raise ValueError("\n".join([error.args[0] + more, *error.preview])) from None
        (motions, notes), site = read, self.full["site"]
        # The records are of the ground, and the block stands on the building.
        if (period := site["building_period"]) is not None:
            with naming("site", period="building_period", damping="building_damping"):
                motions = [m.on_building(period, site["building_damping"]) for m in motions]
        return motions, notes

    @property
    def validation_share(self) -> float | dict[str, list[GroundMotion]] | None:
        """Share of the records that is kept for the validation, or groups of other records by name; None
        for cross-fitting."""
        return self._validation[0]

    @property
    def file_notes(self) -> tuple[str, ...]:
        """Notes on all records, followed by those on the validation records."""
        return (*self.notes, *self._validation[1])

    @property
    def all_messages(self) -> tuple[str, ...]:
        """Messages as in `messages`, followed by those on the validation records."""
        groups = self.validation_share if isinstance(self.validation_share, dict) else {}
        lines = [f"validation, {name}: {line}" for name, group in groups.items() for line in described(group)]
        return (*self.messages, *lines, *self._validation[1])

    @cached_property
    def level(self) -> float | None:
        """Peak acceleration (g) for which measures without a pendulum are estimated; None if not stated."""
        if (stated := self.full["alternatives"]["level"]) is not None:
            with naming("alternatives"):
                checks.plausible("`level`", checks.positive("level", stated), "pga")
        return stated

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `tpd.optimise` except the scene."""
        names = ["space", "conditions", "risk", "limits", "method", "ensemble", "requirements", "seed"]
        return {name: getattr(self, name) for name in [*names, *self.only]}

    @property
    def tables(self) -> Tables:
        """All tables as plain values, without the keys that have no effect."""
        out: Tables = {}
        for table, values in self.full.items():
            # TOML has no null, so a key without a value is left out.
            effective = {
                key: list(value) if isinstance(value, tuple) else value
                for key, value in values.items()
                if value is not None and not lacks(self.full, table, key)
            }
            if effective:
                out[table] = effective
        return out

    @property
    def toml(self) -> str:
        """Text of a job file that is read back as the same job."""
        lines = ["# Repeat this run: tpd optimise <this file> --out <new directory>"]
        for table, values in self.tables.items():
            lines += ["", f"[{table}]", *(f"{key} = {_toml(value)}" for key, value in values.items())]
        return "\n".join(lines) + "\n"


class HarmonicJob(Job):
    """Job with a harmonic motion."""

    compiled, search, only, settles = compiling.HARMONIC, Descent, ("starts", "objective"), True

    def check_motion(self) -> None:
        """See `Job.check_motion`."""
        conditions = self.conditions or Conditions.exactly()
        with naming("excitation"):
            check_moves(self.scene, conditions)

    @cached_property
    def _read(self) -> tuple[Sequence[Harmonic], Sequence[str]]:
        with naming("excitation"):
            return [Harmonic(**{x: self.full["excitation"][x] for x in required_keys("excitation")})], ()

    @cached_property
    def conditions(self) -> Conditions | None:
        """See `Job.conditions`."""
        keys, out = self.full["conditions"], Conditions()
        if is_around(self.full):
            return None
        if size_of(self.full) > _MOST_CONDITIONS:
            raise ValueError(
                f"a job must have at most {_MOST_CONDITIONS} conditions, but has {size_of(self.full)}"
            )
        with naming("conditions", factors="amplitudes", count="frequencies"):
            if keys["band"] is not None:
                out = out * Conditions.band(self.scene, *keys["band"], count=keys["frequencies"])
            # A single factor of one is the scene itself, and would only lengthen the description.
            if keys["amplitudes"] is not None:
                out = out * Conditions.amplitudes(*keys["amplitudes"])
        with naming("scatter", size="samples"):
            if widths := widths_of(self.full):
                out = out * Conditions.scatter(keys["samples"], self.seed, **widths)
        return out

    @cached_property
    def starts(self) -> Starts:
        """Initial states of the search."""
        return Starts.rest() if self.full["starts"]["kind"] == "rest" else Starts.any()

    @property
    def objective(self) -> Objective:
        """Quantity that the descents reduce."""
        return OBJECTIVES[self.full["search"]["objective"]]

    @cached_property
    def ensemble(self) -> Ensemble:
        """See `Job.ensemble`."""
        with naming("ensemble"):
            return Ensemble(**self.full["ensemble"]).seeded(self.seed)


class RecordsJob(Job):
    """Job with records."""

    compiled, search, only = compiling.GROUND, GroundSearch, ("validation_share",)

    def check_motion(self) -> None:
        """See `Job.check_motion`."""
        if not self.full["excitation"]["records"]:
            raise ValueError(
                "a job with records needs `excitation.records` (--records FILE), but it is missing"
            )

    @cached_property
    def _read(self) -> tuple[Sequence[GroundMotion], Sequence[str]]:
        keys = self.full["excitation"]
        records, notes = self._records(keys["records"])
        if keys["pga"] is not None:
            with naming("excitation", pga_g="pga"):
                records = [motion.scaled_to(pga_g=keys["pga"]) for motion in records]
        return records, notes

    @cached_property
    def conditions(self) -> Conditions:
        """See `Job.conditions`."""
        keys = self.full["excitation"]
        scales, intensity = keys["scales"], self.intensity
        if scales is None and keys["pga"] is not None:
            # All records have this size already.
            scales, intensity = (1.0,), "scale"
        if scales is None:
            raise ValueError(
                "a design for records needs `excitation.scales` (--scales), the intensities that every "
                "record is scaled to, or one `excitation.pga` (--pga) in g; `tpd fragility` and `tpd shake` "
                "use unscaled records"
            )
        with naming("excitation"):
            return Conditions.records(self.motions, scales, intensity=intensity, hazard=self.hazard)

    @property
    def in_words(self) -> str:
        """See `Job.in_words`."""
        c, motions = self.conditions, in_words(self.motions)
        if (c.intensity, c.scales) == ("scale", (1.0,)):
            # The words for one motion state its size.
            return motions if len(self.motions) == 1 else f"{motions}, each at its own size"
        return f"{motions}, each at {', '.join(f'{x:g}' for x in c.scales)} ({MEASURES[c.intensity]})"

    @cached_property
    def ensemble(self) -> Ensemble:
        """See `Job.ensemble`."""
        widths = widths_of(self.full)
        settings: dict[str, Any] = {name: self.full["ensemble"][name] for name in SCATTERED} | widths
        with naming("scatter" if widths else "ensemble"):
            return Ensemble(**settings)


class PulseJob(RecordsJob):
    """Job with a pulse instead of records."""

    def check_motion(self) -> None:
        """See `Job.check_motion`."""
        _ = self.motions

    @cached_property
    def _read(self) -> tuple[Sequence[GroundMotion], Sequence[str]]:
        keys = self.full["excitation"]
        if keys["pulse"] is None or keys["pulse_frequency"] is None:
            raise ValueError(
                "a pulse needs `excitation.pulse` (--pulse KIND) and `excitation.pulse_frequency` "
                "(--pulse-frequency HZ)"
            )
        shape = {name: keys[name] for name in ("cycles", "phase")}
        shape |= {"kind": keys["pulse"], "frequency": keys["pulse_frequency"]}
        # The keys of a job file have other names than the fields of `Pulse`.
        with naming("excitation", kind="pulse", frequency="pulse_frequency", pga_g="pga"):
            pulse = Pulse(acceleration=STANDARD_GRAVITY, **shape)
            if keys["pga"] is None and keys["intensity"] == "scale":
                raise ValueError("`pga`, the peak acceleration of the pulse in g, is missing (--pga G)")
            # If an intensity states the size, any acceleration will do.
            return (pulse.scaled_to(pga_g=1.0 if keys["pga"] is None else keys["pga"]),), ()

    @property
    def validation_share(self) -> float:
        """Pulses are no sample of earthquakes, so that a verdict is on these pulses only."""
        return 0.0

    @property
    def in_words(self) -> str:
        """See `Job.in_words`."""
        pulses: tuple[Any, ...] = self.conditions.motions
        periods = sorted(1.0 / float(m.frequency) for m in pulses)
        if len(periods) == 1:
            return super().in_words
        ends = f"{periods[0]:.3g} to {periods[-1]:.3g} s"
        return f"{super().in_words}; {len(periods)} periods from {ends}"

    @cached_property
    def conditions(self) -> Conditions:
        """See `Job.conditions`. The pulse has five periods and three sizes in its band."""
        keys = self.full["excitation"]
        with naming("excitation", period="pulse_band", acceleration="pulse_band"):
            widths = [checks.within("pulse_band", x, 0.0, 0.5) for x in keys["pulse_band"]]
            # The pulse as stated comes first, as a scene is the first of the conditions.
            period, size = (
                1.0 + w * np.array(steps if w else (0.0,))
                for w, steps in zip(widths, ((0.0, -1.0, -0.5, 0.5, 1.0), (0.0, -1.0, 1.0)), strict=True)
            )
            pulse = self.motions[0]
            pulses = [replace(pulse, frequency=pulse.frequency / x) for x in period]
            scales = list(dict.fromkeys(np.outer(size, keys["scales"]).ravel()))
            return Conditions.records(pulses, scales, intensity=self.intensity, hazard=self.hazard)


_RESTITUTION_DIFFERENCE = 0.01
"""Difference of a coefficient of restitution from the square of Housner's that gets a question."""
_JOBS: dict[str, type[Job]] = {"harmonic": HarmonicJob, "pulse": PulseJob, "records": RecordsJob}
"""Classes of jobs, by the kind of motion."""


def read_tables(path: Path) -> dict[str, Any]:
    """Read the tables of a job file without checking them. Paths of records become relative to the file.

    Raises:
        ValueError: the file cannot be read, or is not TOML.
    """
    text = ""
    try:
        text = path.read_text(encoding="utf-8-sig")
        tables = tomllib.loads(text)
    except OSError as error:
        hint = f"; name a job file, such as {path / 'scene.toml'}" if path.is_dir() else ""
        raise ValueError(f"cannot read {path}: {error.strerror or error}{hint}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text file in UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        # Look for a decimal comma, a percentage, and a path of Windows in the line of the error.
        line = re.search(r"line (\d+)", str(error))
        wrong = text.splitlines()[int(line[1]) - 1] if line else ""
        path_hint = "; write a path with backslashes in single quotes" if "\\" in wrong else ""
        raise ValueError(f"{path} is not valid TOML: {error}{number_hint(wrong) or path_hint}") from None
    except RecursionError:
        raise ValueError(f"{path} is not a job file: it nests too deeply") from None
    if not tables:
        raise ValueError(f"{path} is empty: create a job file with `tpd new`")
    return {table: with_absolute_paths(table, values, path.parent) for table, values in tables.items()}


def merge_tables(base: Mapping[str, Any], over: Mapping[str, Any]) -> tuple[Tables, Tables]:
    """Return the tables `base`, in which values of `over` replace earlier ones, as given and complete.

    A key that has no effect any more because of `over` is left out. A file with a share for the measure cvar
    can then be run with another measure, and a file with a harmonic can be run with records.

    Raises:
        ValueError: a table or key is unknown, or a value has the wrong type.
    """
    out = {table: dict(values) for table, values in typed_tables(base).items()}
    for table, values in over.items():
        # A ratio replaces the value in SI units of the same quantity, and vice versa.
        replaced = {pair[1 - i] for pair in TWINS.items() for i in (0, 1) if pair[i] in values}
        others = {k: x for k, x in out.get(table, {}).items() if table != "space" or k not in replaced}
        out[table] = others | dict(values)
    # The bob swings in a cavity or in a frame: an option for one of them replaces the other in the file.
    if "frame" not in over:
        if "cavity_width" in over.get("block", {}):
            out["frame"] = {}
    else:
        for table, key in (("block", "cavity_width"), ("space", "hinge_height")):
            if key not in over.get(table, {}):
                out.get(table, {}).pop(key, None)
    if "seed" in over.get("search", {}):
        # A new seed of the search applies to all random choices, also to those of the runs.
        out.get("ensemble", {}).pop("seed", None)
    # Options that belong to one kind of motion switch the job to this kind.
    chosen = list(kinds_in(typed_tables(over).get("excitation", {})))
    if len(chosen) == 1:
        out["excitation"]["kind"] = chosen[0]
    # A key may depend on another key of the file, on an option, or on a default. Compare before and after:
    # only a key that had an effect before and has none after is left out.
    is_switched = bool(chosen) and set(kinds_in(base.get("excitation", {})) or ["harmonic"]) != set(chosen)
    full = complete_tables(out)
    places = ((table, key) for table, values in base.items() for key in values.keys() - over.get(table, {}))
    idle = [place for place in places if lacks(full, *place)]
    before = complete_tables(base) if idle and not is_switched else None
    for table, key in idle:
        if before is None or not lacks(before, table, key):
            out[table].pop(key, None)
            full[table][key] = TABLES[table][key].default_under(full["excitation"]["kind"])
    return out, full


def job_of(tables: Mapping[str, Any], full: Tables | None = None) -> Job:
    """Return the job from the tables of a job file. Keys that are left out have their defaults.

    Args:
        tables: tables as given.
        full: the complete tables, if they are known; see `merge_tables`.

    Raises:
        ValueError: a table or key is unknown, a value is not allowed, a key has no effect, or the block is
            incomplete.
    """
    full = complete_tables(tables) if full is None else full
    for table, values in full.items():
        for key, value in values.items():
            # A key without an effect is an error, because a user would rely on the limit or the seed. A file
            # may still contain defaults, and limits that are switched off.
            is_usual = value == TABLES[table][key].default_under(full["excitation"]["kind"]) or key == "kind"
            is_off = table == "limits" and value is False
            missing = "" if is_usual or is_off else lacks(full, table, key)
            if missing:
                missing += " of several levels" if table == "hazard" else ""
                raise ValueError(f"`{table}.{key}` requires {missing}, which this job does not have")
    job = _JOBS[full["excitation"]["kind"]](full=full)
    _check_whole_block(tables, job.kind)
    with naming("search"):
        checks.count("seed", job.seed, least=0)
    # Check the block first, because a wrong block causes many other errors.
    site, ensemble = job.under(PAPER.excitation), job.ensemble
    job.check_motion()
    with naming("scatter"):
        check_scatter(site, widths_of(full), job.space)
    with naming("ensemble"):
        if ensemble.restitution:
            check_restitution(site, in_runs=True)
    with naming("space"):
        _ = job.space.of(job.block)
    _ = job.risk, job.limits, job.requirements, job.hazard, job.level
    # Some defaults depend on other keys. Their values are stored, so that the job keeps its meaning in a
    # later version with other defaults.
    full["block"] |= {name: getattr(job.block, name) for name in ("friction", "restitution", "cavity_width")}
    full["search"] |= {name: getattr(job.method, name) for name in job._search_keys}
    full["space"] |= {name: getattr(job.space, name) for name in TWINS.values()}
    return job


def _check_whole_block(tables: Mapping[str, Any], kind: str) -> None:
    """Raise `ValueError` if a user's own block or its excitation is incomplete.

    The values of the paper must not complete such a block. Losses alone, or an excitation alone, are
    variations of the scene of the paper and are allowed.
    """
    missing = {
        table: [x for x in required_keys(table, kind) if x not in tables.get(table, {})]
        for table in ("block", "excitation")
    }
    # If one of these keys is present, the job describes another block than that of the paper.
    shape = (*required_keys("block"), "radius_of_gyration", "centroid_height")
    own = [key for key in shape if key in tables.get("block", {})]
    if not own or not any(missing.values()):
        return
    lacking = " and ".join(f"{_listed(keys)} in [{table}]" for table, keys in missing.items() if keys)
    are = "is" if sum(map(len, missing.values())) == 1 else "are"
    raise ValueError(
        f"{lacking} {are} missing. A block with {_listed(own)} needs all sizes and an excitation; without "
        "any of these keys the block is that of the paper"
    )


def _listed(names: Sequence[str]) -> str:
    """Return names as a list in words: `a`, `b` and `c`."""
    quoted = [f"`{name}`" for name in names]
    return " and ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)


def _toml(value: Any) -> str:
    """Return a value as TOML, which writes lists, strings and numbers like JSON."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{json.dumps(name)} = {json.dumps(x)}' for name, x in value.items())} }}"
    return json.dumps(value)


def _words(value: Any) -> str:
    """Return the value of an option in the notation of the command line."""
    if isinstance(value, Mapping):
        return " ".join(shlex.quote(f"{name}={at}") for name, at in value.items())
    return shlex.quote(value if isinstance(value, str) else f"{value:.12g}")


def _columns_of(pairs: Sequence[str]) -> dict[str, int] | str:
    """Return the columns of a table from texts NAME=NUMBER; or "rows".

    Raises:
        ValueError: a text is of another form, or a name occurs twice.
    """
    # The word "rows" instead of columns means that the samples continue row by row.
    if list(pairs) == [ROWS]:
        return ROWS
    # A name may contain an equals sign, so the number follows the last one.
    columns: dict[str, int] = {}
    for pair in pairs:
        name, _, at = pair.rpartition("=")
        if not name or not re.fullmatch(r"\d{1,6}", at) or name in columns:
            raise ValueError(
                f"`excitation.columns` (--columns) must be {ROWS}, or names with column numbers, such as "
                f"time=1 N=2, but it has {pair!r}"
            )
        columns[name] = int(at)
    return columns
