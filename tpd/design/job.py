"""The job file: the arguments of `tpd.optimise` as tables of TOML, read and written."""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from tpd.core import checks
from tpd.core.files import path_of
from tpd.core.formatting import decimal_comma
from tpd.design.criteria import (
    KINDS,
    TWINS,
    Clearance,
    DesignSpace,
    Limit,
    Requirements,
    Risk,
    Worsening,
    check_moves,
    check_scatter,
)
from tpd.design.job_keys import (
    MOTIONS,
    PAPER,
    READING,
    SHAPE,
    Tables,
    as_typed,
    complete,
    default_of,
    is_around,
    keys_of,
    kinds_in,
    lacks,
    placed,
    size_of,
    widths_of,
)
from tpd.design.settings import SCATTERED, Descent, GroundSearch
from tpd.exact import compiling
from tpd.formats.table import ROWS
from tpd.formats.text import UnreadableRecord
from tpd.records.intensity import OF_JOBS, intensity_of
from tpd.records.read import described, in_words, read_motions
from tpd.scene.bob import Bob
from tpd.scene.conditions import MEASURES, Conditions, check_restitution
from tpd.scene.ensemble import Ensemble, Starts
from tpd.scene.ground_motion import STANDARD_GRAVITY, GroundMotion, Pulse, events_of
from tpd.scene.scene import Block, Harmonic, Scene

_FEW = 9
"""Most records that a message names."""
_MOST_CONDITIONS = 100_000
"""Beyond it the arrays of a search do not fit into the memory of a usual computer."""


@contextmanager
def naming(table: str, **keys: str) -> Iterator[None]:
    """Name the table in messages about its values; `keys` are names of a dataclass that the table has under
    another name."""
    try:
        yield
    except ValueError as error:
        if str(error).startswith("["):
            # Another table was read in between, which the message names.
            raise
        said = re.sub(r"`(\w+)`", lambda found: f"`{keys.get(found[1], found[1])}`", str(error))
        raise ValueError(f"[{table}] {said}") from None


@dataclass(frozen=True, kw_only=True)
class Job(ABC):
    """Arguments of `tpd.optimise` by the tables of a job file. Each kind of motion has a class of its own.
    Records are read when they are first asked for."""

    full: Tables
    """All keys of all tables; None for what is left out and has no default."""
    compiled: ClassVar[tuple[str, ...]]
    """Modules with the compiled code that the motions need."""
    search: ClassVar[type[Descent | GroundSearch]]
    """Class of the settings of the search."""
    only: ClassVar[str]
    """Argument of `tpd.optimise` that jobs of the other kinds do not have."""
    beside: ClassVar[tuple[str, ...]] = ()
    """Keys of [motion] that must be given beside a block of one's own."""

    @staticmethod
    def read(path: str | Path) -> Job:
        """Job of a file in TOML.

        Raises:
            ValueError: a file that cannot be read, or a job that is not allowed.
        """
        return job_of(read(path_of(path)))

    @property
    def kind(self) -> str:
        """Kind of the motion: harmonic, pulse or records."""
        return self.full["motion"]["kind"]

    @property
    def seed(self) -> int:
        """Seed of the search."""
        return self.full["search"]["seed"]

    @cached_property
    def block(self) -> Block:
        """The block; the paper's has the losses and the cavity that it has in Python."""
        given = {name: x for name, x in self.full["block"].items() if x is not None}
        if all(given[x] == getattr(PAPER.block, x) for x in SHAPE):
            given = vars(PAPER.block) | given
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
        return self.under(self.motions[0])

    @abstractmethod
    def check_motion(self) -> None:
        """Raise `ValueError` for a motion that is not allowed, as far as that is known without its files."""

    @cached_property
    @abstractmethod
    def _read(self) -> tuple[Sequence[Any], Sequence[str]]:
        """The motions, and notes on them."""

    @property
    def motions(self) -> tuple[Any, ...]:
        """The harmonic, the pulse or the records."""
        return tuple(self._read[0])

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was left out of the records, or assumed of them."""
        return tuple(self._read[1])

    @property
    def told(self) -> tuple[str, ...]:
        """Lines for a terminal on the records that were read, and the notes."""
        return (*described(self.motions), *self.notes)

    @property
    def ground_motions(self) -> tuple[GroundMotion, ...]:
        """The pulse or the records.

        Raises:
            ValueError: a harmonic.
        """
        return self.motions

    @abstractmethod
    def settled_scene(self, asker: str, again: str) -> Scene:
        """Return the scene, for answers about motions that settle.

        Args:
            asker: what needs such a motion.
            again: option of the command line that gives block and pendulum without their motion.

        Raises:
            ValueError: a pulse or records.
        """

    @property
    def intensity(self) -> str:
        """Name in `tpd.records.intensity` of what the scales count."""
        asked: str = self.full["motion"]["intensity"]
        return OF_JOBS.get(asked, asked)

    @property
    def shaking(self) -> GroundMotion:
        """The only pulse or record, at its only size.

        Raises:
            ValueError: a harmonic, several records, or several sizes.
        """
        asked = self.full["motion"]
        motions, scales = self.ground_motions, asked["scales"] or (1.0,)
        if len(motions) > 1:
            named = "; ".join(getattr(m, "source", "") or getattr(m, "name", "") for m in motions[:_FEW])
            more = "; and more" if len(motions) > _FEW else ""
            raise ValueError(
                f"the job has {len(motions)} records ({named}{more}), but one is needed: --record FILE, "
                "--channel N"
            )
        if len(scales) > 1:
            raise ValueError(f"the job has {len(scales)} sizes of its motion: give one by --scale X")
        motion = next(iter(motions))
        if motion.pga == 0.0 or scales[0] == 0.0:
            raise ValueError("the motion must have an acceleration, but is zero at all times")
        size = 1.0
        if asked["scales"] is not None and asked["intensity"] != "scale":
            size = intensity_of(self.intensity, self.block, self.full["site"]["gravity"], None).value(motion)
        return motion.scaled(scales[0] / size)

    @property
    def single(self) -> Scene:
        """The scene under its only motion, at its only size.

        Raises:
            ValueError: several records, or several sizes.
        """
        return self.under(self.shaking)

    @cached_property
    @abstractmethod
    def conditions(self) -> Conditions | None:
        """Each frequency with each amplitude and each sample, or each motion at each size; None for the
        neighbourhood of a harmonic."""

    @property
    def in_words(self) -> str:
        """Words for the ground motions with their sizes; empty for a harmonic, which its scene describes."""
        return ""

    @cached_property
    def space(self) -> DesignSpace:
        """Design space."""
        with naming("space"):
            return DesignSpace(**self.full["space"])

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
        left_out = (Clearance, Worsening) if self.full["conditions"]["exactly"] else ()
        found: list[Limit] = []
        bob = self.bob
        with naming("limits"):
            for kind in KINDS:
                value, needed = self.full["limits"][kind.name], lacks(self.full, "limits", kind.name)
                if value is None or value is False or kind in left_out or needed:
                    continue
                given: list[Any] = [bob] if kind is Clearance else [] if value is True else [value]
                try:
                    found.append(kind(*given))
                except TypeError:
                    raise ValueError(f"`{kind.name}` must be a number or false, but is true") from None
        return tuple(found)

    @cached_property
    def requirements(self) -> Requirements:
        """Requirements on the benefit."""
        with naming("requirements"):
            return Requirements(**self.full["requirements"])

    @cached_property
    def method(self) -> Descent | GroundSearch:
        """Settings of the search."""
        asked = self.full["search"]
        with naming("search"):
            return self.search(**{x: asked[x] for x in keys_of(self.search) if asked[x] is not None})

    @cached_property
    @abstractmethod
    def ensemble(self) -> Ensemble:
        """Runs of the verification."""

    @cached_property
    def _held(self) -> tuple[float | dict[str, list[GroundMotion]], list[str]]:
        asked, found, said = (
            self.full["motion"]["validation_share"],
            dict[str, list[GroundMotion]](),
            list[str](),
        )
        if not isinstance(asked, tuple):
            return asked or 0.0, said
        names = [Path(word).name or word for word in asked]
        for word, name in zip(asked, names, strict=True):
            # Two folders of one name have their whole paths.
            group = word if names.count(name) > 1 else name
            found[group], notes = self._records([word], None)
            # Over both sides together: the comparison of the groups leaves these records out without a word.
            events = events_of([*self.motions, *found[group]])
            used, own = events[: len(self.motions)], events[len(self.motions) :]
            if tuned := [m for m, event in zip(found[group], own, strict=True) if event in used]:
                listed = ", ".join(getattr(m, "source", "") or getattr(m, "name", "") for m in tuned)
                notes = [*notes, f"left out, since the design is tuned to their earthquakes: {listed}"]
            said += [f"validation, {group}: {line}" for line in notes]
        return found, said

    def _records(self, names: Sequence[str], events: Sequence[str] | None) -> Any:
        how = {name: x for name in READING if (x := self.full["motion"][name]) is not None}
        if "columns" in how:
            how["columns"] = _columns_of(how["columns"])
        try:
            return read_motions(names, events=events, **how)
        except UnreadableRecord as error:
            flags = (f"--{name} {_words(value)}" for name, value in error.options.items())
            more = "; options that read the file: " + " ".join(flags) if error.options else ""
            raise ValueError(_in_words_of_jobs(error.args[0]) + more) from None
        except ValueError as error:
            raise ValueError(_in_words_of_jobs(str(error))) from None

    @property
    def validation_share(self) -> float | dict[str, list[GroundMotion]]:
        """Share of the records, or groups of others by name; 0 for none."""
        return self._held[0]

    @property
    def validation_notes(self) -> tuple[str, ...]:
        """Sentences on what was left out of the records that are held out, or assumed of them."""
        return tuple(self._held[1])

    @property
    def all_messages(self) -> tuple[str, ...]:
        """As `told`, with the records that are held out."""
        groups = self.validation_share if isinstance(self.validation_share, dict) else {}
        held = [f"validation, {name}: {line}" for name, group in groups.items() for line in described(group)]
        return (*self.told, *held, *self.validation_notes)

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `tpd.optimise` beside the scene."""
        names = (
            "space",
            "conditions",
            "risk",
            "limits",
            "method",
            "ensemble",
            "requirements",
            "seed",
            self.only,
        )
        return {name: getattr(self, name) for name in names}

    @property
    def tables(self) -> Tables:
        """All tables as plain values, without the keys that have no effect."""
        out: Tables = {}
        for table, values in self.full.items():
            # TOML has no null: what is not set is left out.
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
        """The job as a file that is read back as the same job."""
        lines = ["# Repeat this run: tpd optimise --scene <this file> --out <new directory>"]
        for table, values in self.tables.items():
            # Lists, texts and numbers of TOML are written as those of JSON are.
            lines += ["", f"[{table}]", *(f"{key} = {json.dumps(value)}" for key, value in values.items())]
        return "\n".join(lines) + "\n"


class HarmonicJob(Job):
    """A job of harmonic motion."""

    compiled, search, only, beside = compiling.HARMONIC, Descent, "starts", tuple(keys_of(Harmonic))

    def check_motion(self) -> None:
        """See `Job.check_motion`."""
        conditions = self.conditions or Conditions.exactly()
        with naming("motion"):
            check_moves(self.scene, conditions)

    @cached_property
    def _read(self) -> tuple[Sequence[Harmonic], Sequence[str]]:
        with naming("motion"):
            return (Harmonic(**{name: self.full["motion"][name] for name in self.beside}),), ()

    @property
    def ground_motions(self) -> tuple[GroundMotion, ...]:
        """See `Job.ground_motions`."""
        raise ValueError("a harmonic has no end: give --record FILE or --pulse KIND, or a job of these")

    @property
    def single(self) -> Scene:
        """See `Job.single`."""
        return self.scene

    def settled_scene(self, asker: str, again: str) -> Scene:
        """See `Job.settled_scene`."""
        return self.scene

    @cached_property
    def conditions(self) -> Conditions | None:
        """See `Job.conditions`."""
        asked, out = self.full["conditions"], Conditions()
        if is_around(self.full):
            return None
        if size_of(self.full) > _MOST_CONDITIONS:
            raise ValueError(
                f"a job must have at most {_MOST_CONDITIONS} conditions, but has {size_of(self.full)}"
            )
        with naming("conditions", factors="amplitudes", count="frequencies"):
            if asked["band"] is not None:
                low, high = asked["band"]
                out = out * Conditions.band(self.scene, low, high, asked["frequencies"])
            # A factor of one is the scene itself: multiplying by it would only lengthen the description.
            if asked["amplitudes"] != (1.0,):
                out = out * Conditions.amplitudes(*asked["amplitudes"])
        with naming("scatter", size="samples"):
            if widths := widths_of(self.full):
                out = out * Conditions.scatter(asked["samples"], self.seed, **widths)
        return out

    @cached_property
    def starts(self) -> Starts:
        """Initial states."""
        return Starts.rest() if self.full["starts"]["kind"] == "rest" else Starts.any()

    @cached_property
    def ensemble(self) -> Ensemble:
        """See `Job.ensemble`."""
        with naming("ensemble"):
            return Ensemble(**self.full["ensemble"]).seeded(self.seed)


class RecordsJob(Job):
    """A job of records."""

    compiled, search, only = compiling.GROUND, GroundSearch, "validation_share"

    def check_motion(self) -> None:
        """See `Job.check_motion`."""
        if not self.full["motion"]["records"]:
            raise ValueError("records need `motion.records` (--records FILE), which this job does not have")

    def settled_scene(self, asker: str, again: str) -> Scene:
        """See `Job.settled_scene`."""
        raise ValueError(
            f"{asker} is about harmonic motion, and the job has {MOTIONS[self.kind]}: give {again} with "
            "--amplitude and --frequency"
        )

    @cached_property
    def _read(self) -> tuple[Sequence[GroundMotion], Sequence[str]]:
        asked = self.full["motion"]
        found, notes = self._records(asked["records"], asked["event"])
        if asked["pga"] is not None:
            with naming("motion", pga_g="pga"):
                found = [motion.scaled_to(pga_g=asked["pga"]) for motion in found]
        return found, notes

    @cached_property
    def conditions(self) -> Conditions:
        """See `Job.conditions`."""
        motion = self.full["motion"]
        scales, intensity = motion["scales"], self.intensity
        if scales is None and motion["pga"] is not None:
            # All records have this size already.
            scales, intensity = (1.0,), "scale"
        if scales is None:
            raise ValueError(
                "a design on records needs `motion.scales` (--scales), the sizes that every record is "
                "scaled to, or one `motion.pga` (--pga) in g; `tpd fragility` and `tpd shake` follow a "
                "design through records as they are"
            )
        with naming("motion"):
            return Conditions.records(self.motions, scales, intensity=intensity)

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
        given: dict[str, Any] = {name: self.full["ensemble"][name] for name in SCATTERED} | widths
        with naming("scatter" if widths else "ensemble"):
            return Ensemble(**given)


class PulseJob(RecordsJob):
    """A job of a pulse in place of records."""

    def check_motion(self) -> None:
        """See `Job.check_motion`."""
        _ = self.motions

    @cached_property
    def _read(self) -> tuple[Sequence[GroundMotion], Sequence[str]]:
        asked = self.full["motion"]
        if asked["pulse"] is None or asked["pulse_frequency"] is None:
            raise ValueError(
                "a pulse needs `motion.pulse` (--pulse KIND) and `motion.pulse_frequency` "
                "(--pulse-frequency HZ)"
            )
        shape = {name: asked[name] for name in ("cycles", "phase")}
        shape |= {"kind": asked["pulse"], "frequency": asked["pulse_frequency"]}
        with naming("motion", kind="pulse", frequency="pulse_frequency", pga_g="pga"):
            pulse = Pulse(acceleration=STANDARD_GRAVITY, **shape)
            # Of 1 g where its size is not given.
            return (pulse.scaled_to(pga_g=1.0 if asked["pga"] is None else asked["pga"]),), ()


_JOBS: dict[str, type[Job]] = {"harmonic": HarmonicJob, "pulse": PulseJob, "records": RecordsJob}
"""Classes of jobs by the kind of motion."""


def read(path: Path) -> dict[str, Any]:
    """Return the tables of a job file, not yet checked; paths of records are relative to the file.

    Raises:
        ValueError: the file cannot be read, or is not TOML.
    """
    text = ""
    try:
        text = path.read_text(encoding="utf-8-sig")
        found = tomllib.loads(text)
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text file in UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        line = re.search(r"line (\d+)", str(error))
        comma = decimal_comma(text.splitlines()[int(line[1]) - 1]) if line else ""
        raise ValueError(f"{path} is not valid TOML: {error}{comma}") from None
    except RecursionError:
        raise ValueError(f"{path} is not a job file: it nests too deeply") from None
    if not found:
        raise ValueError(f"{path} is empty: `tpd new` writes a job file to begin with")
    return {table: placed(table, values, path.parent) for table, values in found.items()}


def merged(given: Mapping[str, Any], over: Mapping[str, Any]) -> Tables:
    """Return the tables `given` with the values of `over` in place of theirs.

    A key that has no effect any more, because `over` chooses otherwise, is left out: a file with a share for
    the measure cvar can be run with another measure, and a file about a harmonic with records.

    Raises:
        ValueError: an unknown table or key, or a value of the wrong type.
    """
    out = {table: dict(values) for table, values in as_typed(given).items()}
    for table, values in over.items():
        # A ratio replaces its value in SI units, and the other way round.
        replaced = {pair[1 - i] for pair in TWINS.items() for i in (0, 1) if pair[i] in values}
        kept = {k: x for k, x in out.get(table, {}).items() if table != "space" or k not in replaced}
        out[table] = kept | dict(values)
    if "seed" in over.get("search", {}):
        # It is of every random choice, also of the runs.
        out.get("ensemble", {}).pop("seed", None)
    chosen = list(kinds_in(as_typed(over).get("motion", {})))
    if len(chosen) == 1:
        out["motion"]["kind"] = chosen[0]
    # What a key needs may be in the file, among the options, or the default: it is asked before and after.
    is_switched = bool(chosen) and set(kinds_in(given.get("motion", {})) or ["harmonic"]) != set(chosen)
    after = complete(out)
    before = after if is_switched else complete(given)
    for table, values in given.items():
        for key in values:
            is_idle = key not in over.get(table, {}) and lacks(after, table, key)
            if is_idle and (is_switched or not lacks(before, table, key)):
                del out[table][key]
    return out


def job_of(given: Mapping[str, Any]) -> Job:
    """Return the job of the tables of a job file; what is left out has its default.

    Raises:
        ValueError: an unknown table or key, a bad value, a key that has no effect, or a block of which a
            part is missing.
    """
    full = complete(given)
    for table, values in full.items():
        for key, value in values.items():
            # A silent key would let somebody believe in a limit or a seed that does nothing. A file may list
            # defaults, and limits that it turns off.
            is_usual = value == default_of(full["motion"]["kind"], table, key) or key == "kind"
            is_off = table == "limits" and value is False
            needed = "" if is_usual or is_off else lacks(full, table, key)
            if needed:
                raise ValueError(f"`{table}.{key}` goes with {needed}, which this job does not have")
    job = _JOBS[full["motion"]["kind"]](full=full)
    _refuse_mixture(given, job.beside)
    with naming("search"):
        checks.count("seed", job.seed, least=0)
    # The block comes first: what is wrong with it is the reason for much else.
    site, ensemble = job.under(PAPER.motion), job.ensemble
    job.check_motion()
    with naming("scatter"):
        check_scatter(site, widths_of(full), job.space)
    with naming("ensemble"):
        if ensemble.restitution:
            check_restitution(site)
    with naming("space"):
        job.space.of(site.block)
    _ = job.risk, job.limits, job.requirements
    # Defaults depend on other keys: written out, a job keeps its meaning in a later version.
    numbers = {name: getattr(job.method, name) for name in keys_of(job.search)}
    filled = {"block": ("friction", "restitution", "cavity_width"), "search": tuple(numbers)}
    filled["space"] = tuple(TWINS.values())
    found = {"block": vars(job.block), "search": numbers, "space": vars(job.space)}
    return replace(job, full={t: v | {k: found[t][k] for k in filled.get(t, ())} for t, v in full.items()})


def _refuse_mixture(given: Mapping[str, Any], beside: Sequence[str]) -> None:
    """Refuse a block or its motion that is partly given and partly the paper's.

    Losses alone, or a motion alone, are variations of the paper's scene and are allowed.
    """
    block, motion = given.get("block", {}), given.get("motion", {})
    own = [key for key in (*SHAPE, "radius_of_gyration") if key in block]
    missing = {
        "block": [k for k in SHAPE if k not in block],
        "motion": [k for k in beside if k not in motion],
    }
    if not own or not any(missing.values()):
        return
    lacking = " and ".join(f"{_listed(keys)} in [{table}]" for table, keys in missing.items() if keys)
    are = "is" if sum(map(len, missing.values())) == 1 else "are"
    raise ValueError(
        f"a block of your own must be whole, with a motion of its own, but {lacking} {are} missing beside "
        f"{_listed(own)}; without any of these the block is the paper's"
    )


def _listed(names: Sequence[str]) -> str:
    """Names in a row: `a`, `b` and `c`."""
    quoted = [f"`{name}`" for name in names]
    return " and ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)


def _in_words_of_jobs(said: str) -> str:
    """A message on options of `tpd.Record.read`, with the keys and options that set them."""
    said = re.sub(r", such as (\w+)=", r", such as \1 = ", said)
    return re.sub(rf"`({'|'.join(READING)})`", r"`motion.\1` (--\1)", said)


def _words(value: Any) -> str:
    """The value of an option as it is written on the command line."""
    if isinstance(value, Mapping):
        return " ".join(shlex.quote(f"{name}={at}") for name, at in value.items())
    return shlex.quote(value if isinstance(value, str) else f"{value:.12g}")


def _columns_of(pairs: Sequence[str]) -> dict[str, int] | str:
    """The columns of a table that are written as NAME=NUMBER; or "rows".

    Raises:
        ValueError: something else.
    """
    if list(pairs) == [ROWS]:
        return ROWS
    columns: dict[str, int] = {}
    for pair in pairs:
        name, _, at = pair.rpartition("=")
        if not name or not re.fullmatch(r"\d{1,6}", at) or name in columns:
            raise ValueError(
                f"`motion.columns` (--columns) must be {ROWS}, or names with numbers of columns, such as "
                f"time=1 N=2, but has {pair!r}"
            )
        columns[name] = int(at)
    return columns
