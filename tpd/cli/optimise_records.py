"""`tpd optimise --records ... --scales ...`: design on ground motions."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tpd.cli import common, ground

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tpd.core.ground_motion import GroundMotion
    from tpd.core.scene import Scene

_UNFINISHED = "unfinished.npz"
_USED = {
    "space": None,
    "bob": None,
    "block": None,
    "site": None,
    "scatter": None,
    "motion": None,
    "project": None,
    "risk": None,
    "search": ("seed", "searches"),
    "worth": ("at_least", "strikes"),
}
"""Tables of a job, and keys of them, that a design on ground motions takes."""
_INSTEAD = {
    "motion": "the records shake the block",
    "conditions": "the motions are the records, each as strong as --scales says",
    "starts": "every motion starts from rest",
    "limits": "records have limits on stroke, relative_stroke, tilt, mass, offset and room",
    "worth": "records take `at_least` and `strikes`, and significant harm refuses",
    "search": "the search on records takes `searches` and `seed`",
    "ensemble": "the runs that judge are the records on scattered blocks",
}
"""Words for what a design on records has in the place of a table's keys."""


def add(group: Any) -> None:
    """Add the options to a group of `tpd optimise`."""
    group.add_argument(
        "--scales",
        nargs="+",
        type=float,
        metavar="X",
        help="design on the records, each scaled to these values of the intensity, such as 1.5 2 3 4",
    )
    group.add_argument(
        "--intensity", default="pga_star", choices=_INTENSITIES, help="that --scales count (default pga_star)"
    )
    group.add_argument(
        "--held-out",
        nargs="+",
        default=("0.5",),
        metavar="X",
        help="share of the records (whole earthquakes) that the design is judged on and not tuned to, or "
        "files, folders and sets of others (default 0.5)",
    )


_INTENSITIES = ("pga_star", "pgv_star", "pga", "pgv", "scale")


def run(options: argparse.Namespace) -> int:
    """Search, judge, write the report and print it; return the exit status."""
    common.use_64_bits(ground=True)
    from tpd.cli import optimise as harmonic
    from tpd.core.conditions import Conditions
    from tpd.design.optimise import optimise
    from tpd.report.ground import write

    if not options.records:
        raise ValueError("--scales goes with --records FILE")
    given = common.tables(options)
    _refuse_others(given, options)
    motions = ground.motions(options.records, **ground.reading(options))
    # Bad files and values end here, before anything is written or claimed.
    held_out = _held_out(options.held_out, options)
    scene = ground.scene(options, motions[0])
    arguments = _arguments(given, scene)
    unfinished = options.out / _UNFINISHED
    harmonic.claim(options, unfinished)
    stripes = ", ".join(f"{x:g}" for x in options.scales)
    ground.say(scene, None, f"  motion  {len(motions)} records, each at {options.intensity} {stripes}")
    conditions = Conditions.records(motions, options.scales, intensity=options.intensity)
    with common.bar() as bar, harmonic.hinting(unfinished):
        design: Any = optimise(
            scene,
            conditions=conditions,
            held_out=held_out,
            checkpoint=unfinished,
            progress=bar,
            **arguments,
        )
        points = harmonic.front_of(design, bar) if options.pareto else ()
    written = write(options.out, design, _command(options), list(options.records), points)
    print("\n" + (options.out / "report.txt").read_text(encoding="utf-8"))
    print("\n".join(f"written: {path}" for path in written))
    if design.status.name == "interrupted":
        print(harmonic.hint(unfinished))
        return common.INTERRUPTED
    unfinished.unlink(missing_ok=True)
    return common.SOUND if design.status.is_sound else common.UNSOUND


def _refuse_others(given: Mapping[str, Mapping[str, Any]], options: argparse.Namespace) -> None:
    """Refuse what would have no effect on records, and say where it stands: in the job, or an option."""
    from tpd.cli.options import given as by_options
    from tpd.design.criteria import KINDS

    limits = {kind.name for kind in KINDS if kind.of_motion}
    for table, values in given.items():
        keys = limits if table == "limits" else _USED.get(table, ())
        for key, value in values.items():
            option = key in by_options(options).get(table, {})
            used = keys is None or key in keys
            # A job has a motion beside its block all the same; and a limit turned off asks for nothing.
            if (used and not (option and table == "motion")) or (table == "limits" and value is False):
                continue
            where = _flag(table, key) if option else f"in {options.scene}"
            raise ValueError(
                f"`{table}.{key}` ({where}) is for harmonics and has no effect on a design on records, which "
                f"--scales asks for: {_INSTEAD[table]}; leave it out"
            )


def _flag(table: str, key: str) -> str:
    """Option that sets a key."""
    from tpd.cli.optimise import CONDITIONS, DESIGN, SEARCH

    every = (*CONDITIONS, *DESIGN, *SEARCH, *common.SCENE)
    return next((x.flag for x in every if (x.table, x.key) == (table, key)), f"--{table}")


def _arguments(given: Mapping[str, Mapping[str, Any]], scene: Scene) -> dict[str, Any]:
    """Arguments of `tpd.optimise` from the tables of a job; what is left out has the default of records."""
    from tpd.analysis.ensemble import Ensemble
    from tpd.cli import build, config
    from tpd.design.criteria import Worth
    from tpd.design.ground.judgement import SCATTERED
    from tpd.design.ground.optimise import DEFAULT_SPACE
    from tpd.design.ground.search import GroundSearch
    from tpd.design.question import check_scatter

    file = config.chosen({k: v for k, v in given.items() if k != "motion"})
    space = dict(given.get("space", {}))
    # Records ask for other defaults than harmonics, where the user has said nothing.
    # A job of harmonics has one damping; under records it is searched unless the job names it.
    space.setdefault("damping_ratio", list(DEFAULT_SPACE.damping_ratio))  # type: ignore[arg-type]
    searched = config.chosen({"space": space})
    out: dict[str, Any] = {
        "space": build.space_of(searched),
        "limits": tuple(x for x in build.limits_of(file) if x.of_motion),
        "seed": file.search.seed,
        "worth": Worth(at_least=file.worth.at_least, strikes=file.worth.strikes),
    }
    if file.widths:
        with build.naming("scatter"):
            check_scatter(scene, file.widths, out["space"])
            widths: dict[str, Any] = file.widths
            for name in sorted(set(widths) - set(SCATTERED)):
                raise ValueError(f"`{name}` cannot scatter on records: --scales says how strong they are")
            out["ensemble"] = Ensemble(**widths)
    if "risk" in given:
        out["risk"] = build.risk_of(file)
    if "searches" in given.get("search", {}):
        out["method"] = GroundSearch(starts=given["search"]["searches"])
    return out


def _held_out(words: Sequence[str], options: argparse.Namespace) -> float | dict[str, list[GroundMotion]]:
    """A share, or groups of other motions by name."""
    if len(words) == 1:
        # A word that is no number names a file or a set.
        try:
            return float(words[0])
        except ValueError:
            pass
    # The names of --event are those of --records.
    reading = {**ground.reading(options), "events": None}
    names = [Path(word).name or word for word in words]
    # Two folders of one name have their whole paths.
    names = [word if names.count(name) > 1 else name for word, name in zip(words, names, strict=True)]
    return {name: ground.motions([word], **reading) for word, name in zip(words, names, strict=True)}


def _command(options: argparse.Namespace) -> str:
    """Command that repeats the run into another directory."""
    words = list(sys.argv[1:]) if Path(sys.argv[0]).name == "tpd" else []
    if not words:
        return ""
    # Another directory, so that the command overwrites nothing.
    drop = {"--resume", "--overwrite"}
    kept = [w for i, w in enumerate(words) if w not in drop and w != "--out" and words[i - 1] != "--out"]
    again = options.out.with_name(options.out.name + "-again")
    return shlex.join(["tpd", *kept, "--out", str(again)])
