"""`tpd map`: amplitude, stroke, status and uplift margin over two parameters."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from tpd.cli import common
from tpd.core.progress import Bar

if TYPE_CHECKING:
    from tpd.answers.design_map import DesignMap

_MOST_POINTS = 2000.0
"""Along each axis: four million designs take a minute and a gigabyte of memory."""


_DESCRIPTION = (
    "Solve every design on a grid of two names: dimensionless parameters (nu, mu, lam, zeta, "
    "k, f, xi, e, rho) or, in SI units, width, height, mass, friction, restitution, amplitude, "
    "frequency, pendulum-mass, pendulum-length and pendulum-damping. Shown is the largest attracting "
    "symmetric period-one orbit, or rest; with --from-rest what is settled into from rest. Exit status: "
    "0 done, 2 bad input, 130 interrupted."
)


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    mapping = commands.add_parser(
        "map",
        help="amplitude, stroke, status and uplift over any two parameters",
        description=_DESCRIPTION,
        epilog="\nExample: tpd map --scene tower.toml --x mu 0.01 0.1 --y lam 0.1 0.9",
    )
    common.add_case(mapping, common.HARMONIC)
    for axis in ("x", "y"):
        mapping.add_argument(
            f"--{axis}", nargs=3, required=True, metavar=("NAME", "LO", "HI"), help=f"the {axis} axis"
        )
    mapping.add_argument("--points", type=int, default=200, metavar="N", help="along each axis (default 200)")
    mapping.add_argument(
        "--from-rest", action="store_true", help="follow every design from rest: forty times slower"
    )
    common.add_cluster(mapping)
    common.add_out(mapping, "tpd-map")
    mapping.set_defaults(run=run, does="solving the designs of a map, for {out}")


def run(options: argparse.Namespace) -> int:
    """Solve the grid, write it and print the counts of the statuses; return the exit status."""
    from tpd.core import checks, files

    checks.count("--points", options.points, least=2)
    checks.within("--points", options.points, 2.0, _MOST_POINTS)
    x, y = (_axis(flag, given) for flag, given in (("--x", options.x), ("--y", options.y)))
    scene, hung = common.harmonic(options, (x[0], y[0]))
    import numpy as np

    from tpd.answers.design_map import design_map

    files.claim(options.out, overwrite=options.overwrite)
    with Bar() as bar, common.cluster(options) as cluster:
        bar("mapping", 0, options.points**2)
        m = design_map(
            scene,
            (x[0], np.linspace(x[1], x[2], options.points)),
            (y[0], np.linspace(y[1], y[2], options.points)),
            pendulum=hung,
            start=np.zeros(4) if options.from_rest else None,
            cluster=cluster,
            progress=partial(bar, "mapping"),
        )
    # Not before: `design_map` refuses names that cannot be varied together.
    common.say(scene)
    print("\n".join(f"{count:8} {status.replace('_', ' ')}" for status, count in m.counts.items()))
    if not options.from_rest:
        print("motions that repeat; whether the block reaches one, or overturns, --from-rest says")
    common.write(options.out, _files(m, common.inputs(scene, hung)))
    return common.SOUND


def _axis(flag: str, given: list[str]) -> tuple[str, float, float]:
    """Name and bounds of an axis."""
    from tpd.core import checks

    try:
        low, high = (float(v) for v in given[1:])
    except ValueError:
        raise ValueError(f"`{flag}` must be a name and two numbers, but is {' '.join(given)}") from None
    if not low < high:
        raise ValueError(f"`{flag}` must go up, but goes from {low:g} to {high:g}")
    name = given[0].replace("-", "_")
    if name in common.MOST:
        checks.at_most(flag, high, *common.MOST[name])
    return name, low, high


def _files(m: DesignMap, inputs: dict[str, Any]) -> Iterator[tuple[str, str | bytes]]:
    from tpd.core import files
    from tpd.plot import style as canvas

    yield "map.csv", files.as_table(m.columns())
    axes = {"x": (m.x_name, *m.x[[0, -1]].tolist()), "y": (m.y_name, *m.y[[0, -1]].tolist())}
    # Along an axis its values replace those of the scene and the pendulum.
    content = {**inputs, "varied": axes, "points": len(m.x), "start": m.start, "statuses": m.counts}
    yield "map.json", files.as_json(content)
    for quantity in ("amplitude", "stroke", "margin"):
        yield f"{quantity}.png", canvas.png(m.plot(quantity).figure)
