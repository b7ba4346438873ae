"""`tpd fragility`: share of the ground motions of each intensity that overturn a block."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from tpd.cli import common, ground

if TYPE_CHECKING:
    from tpd.analysis.fragility import Fragility
    from tpd.core.scene import Pendulum, Scene

_DESCRIPTION = (
    "Scale every record to every stripe of an intensity and follow the block through all of them, bare and, "
    "if one is given, with a pendulum on the same motions. Exit status: 0 done, 2 bad input, 130 interrupted."
)


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    fragility = commands.add_parser(
        "fragility", help="fragility curves over records", description=_DESCRIPTION
    )
    ground.add_block(fragility)
    common.add_pendulum(fragility)
    fragility.add_argument(
        "--records",
        nargs="+",
        required=True,
        metavar="FILE",
        help=f"files, folders, {', '.join((*ground.BUILT_IN, *ground.SETS))}",
    )
    ground.add_reading(fragility)
    fragility.add_argument(
        "--intensity", default="pga_star", help=f"{', '.join(ground.INTENSITIES)} (default pga_star)"
    )
    fragility.add_argument("--period", type=float, metavar="S", help="of --intensity sa")
    fragility.add_argument(
        "--scales", nargs="+", type=float, metavar="X", help="stripes (default 20 from 0.5 to 8)"
    )
    common.add_cluster(fragility)
    common.add_out(fragility, "tpd-fragility")
    fragility.set_defaults(run=run, does="following the block, for {out}")


def run(options: argparse.Namespace) -> int:
    """Follow all motions, write tables and pictures, and print the medians; return the exit status."""
    common.use_64_bits(ground=True)
    import numpy as np

    from tpd.analysis.fragility import fragility
    from tpd.core import files

    motions = ground.motions(options.records, options.baseline, **ground.reading(options))
    scene = ground.scene(options, motions[0])
    hung = ground.pendulum(options, scene)
    files.claim(options.out, overwrite=options.overwrite)
    ground.say(scene, hung, f"  motion  {len(motions)} records")
    stripes = np.linspace(0.5, 8.0, 20) if options.scales is None else np.array(options.scales)
    with common.bar() as bar, common.cluster(options) as cluster:
        found = fragility(
            scene.block,
            motions,
            scales=stripes,
            pendulum=hung,
            intensity=options.intensity,
            period=options.period,
            gravity=float(scene.gravity),
            cluster=cluster,
            progress=lambda done, total: bar("following motions", done, total),
        )
    print(found)
    for path, content in list(_files(scene, hung, found)):
        print(f"written: {files.place(options.out / path, content)}")
    return common.SOUND


def _files(scene: Scene, hung: Pendulum | None, found: Fragility) -> Iterator[tuple[str, str | bytes]]:
    from tpd.core import files
    from tpd.plot import style

    header = ("state", "stripe", "motions", "bare", "hung", "p_value", "undecided_bare", "undecided_hung")
    yield "fragility.csv", files.as_csv(header, _rows(found))
    content = {
        **ground.inputs(scene, hung),
        "intensity": found.intensity,
        "motions": list(found.motions),
        "earthquakes": found.earthquakes,
        "fits": {name: _fits(found, name) for name in found.bare},
        "first_crossings": {k: list(v) for k, v in found.first_crossings.items()},
        "changed_by_nonlinear_equations": None if found.changed is None else list(found.changed),
        "undecided_by_nonlinear_equations": None if found.unanswered is None else list(found.unanswered),
    }
    yield "fragility.json", files.as_json(content)
    for name in found.bare:
        yield f"fragility_{name}.png", style.png(found.plot(name).figure)


def _fits(found: Fragility, name: str) -> dict[str, Any]:
    """Median with its interval, and dispersion, of the curves of one state, and what motions without an
    answer leave open."""
    curves = {"bare": found.bare[name]} | ({} if found.hung is None else {"hung": found.hung[name]})
    return {
        case: {
            "median": c.fit.median,
            "dispersion": c.fit.dispersion,
            "interval": list(c.fit.interval()) if 0.0 < c.fit.median < math.inf else None,
            "separated": c.fit.separated,
            "undecided": int(c.undecided.sum()),
            "medians_whatever_the_undecided_do": list(c.medians),
        }
        for case, c in curves.items()
    }


def _rows(found: Fragility) -> Iterator[tuple]:
    for name, bare in found.bare.items():
        hung = None if found.hung is None else found.hung[name]
        for i, stripe in enumerate(found.stripes):
            p = "" if found.p_values is None else found.p_values[name][i]
            with_it = ("", "") if hung is None else (hung.counts[i], hung.undecided[i])
            n, fallen, lost = bare.total[i], bare.counts[i], bare.undecided[i]
            yield name, stripe, n, fallen, with_it[0], p, lost, with_it[1]
