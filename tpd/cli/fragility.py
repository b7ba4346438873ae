"""`tpd fragility`: share of the ground motions of each intensity that overturn a block."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from tpd.cli import common
from tpd.core.progress import Bar

if TYPE_CHECKING:
    from tpd.answers.fragility import Fragility
    from tpd.scene.scene import Pendulum, Scene

_DESCRIPTION = (
    "Scale every record to every stripe of an intensity (--scales; default 20 from 0.5 to 8) and follow the "
    "block through all of them, bare and, if one is given, with a pendulum on the same motions. Exit status: "
    "0 done, 2 bad input, 130 interrupted."
)


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    fragility = commands.add_parser(
        "fragility",
        help="fragility curves over records",
        description=_DESCRIPTION,
        epilog="\nExample: tpd fragility --scene tower.toml --records el-centro loma-prieta --scales 1 2 4",
    )
    common.add_case(fragility, common.RECORDS, common.PULSE)
    fragility.add_argument(
        "--period", type=float, metavar="S", help="of --intensity sa, the spectral acceleration"
    )
    common.add_cluster(fragility)
    common.add_out(fragility, "tpd-fragility")
    fragility.set_defaults(run=run, does="following the block, for {out}")


def run(options: argparse.Namespace) -> int:
    """Follow all motions, write tables and pictures, and print the medians; return the exit status."""
    job, hung = common.case(options)
    import numpy as np

    from tpd.answers.fragility import fragility
    from tpd.core import files

    if job.kind == "harmonic":
        raise ValueError("give --records FILE, or a job of records: a harmonic has no end")
    asked, scene = job.full["motion"], job.scene
    files.claim(options.out, overwrite=options.overwrite)
    common.say(scene, hung, f"{len(job.motions)} records", job.notes)
    stripes = np.linspace(0.5, 8.0, 20) if asked["scales"] is None else np.array(asked["scales"])
    with Bar() as bar, common.cluster(options) as cluster:
        found = fragility(
            scene.block,
            job.motions,
            scales=stripes,
            pendulum=hung,
            intensity=asked["intensity"],
            period=options.period,
            gravity=float(scene.gravity),
            cluster=cluster,
            progress=lambda done, total: bar("following motions", done, total),
        )
    print(found)
    common.write(options.out, _files(scene, hung, found))
    return common.SOUND


def _files(scene: Scene, hung: Pendulum | None, found: Fragility) -> Iterator[tuple[str, str | bytes]]:
    from tpd.core import files
    from tpd.plot import style

    yield "fragility.csv", files.as_table(found.columns())
    content = {
        **common.inputs(scene, hung),
        "intensity": found.intensity,
        "motions": list(found.motions),
        "earthquakes": found.earthquakes,
        "p_values": found.p_values and {name: p.tolist() for name, p in found.p_values.items()},
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
