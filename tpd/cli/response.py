"""`tpd response`: amplitude and stroke of the settled motion over frequency."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from tpd.cli import common, stored

if TYPE_CHECKING:
    from tpd.analysis.response import Branches, Response
    from tpd.core.progress import Bar
    from tpd.core.scene import Pendulum, Scene

BARE, HUNG = "bare block", "with the pendulum"


_DESCRIPTION = (
    "All branches of symmetric period-one orbits against frequency, stable and unstable, and "
    "where they are lost: of the bare block and, if one is given, with a pendulum. The amplitude of the "
    "base stays as it is, or with --dimensionless its acceleration f. Beside them, what a start from rest "
    "settles into, every 0.4 % within 5 % of the scene's frequency. Without options: the block of Collini "
    "et al. (2016). Exit status: 0 done, 2 bad input, 130 interrupted."
)


def add(commands: Any) -> None:
    """Add the command to the grammar of the command line."""
    response = commands.add_parser(
        "response",
        help="amplitude and stroke against frequency",
        description=_DESCRIPTION,
    )
    stored.add(response)
    common.add_scene(response)
    common.add_pendulum(response)
    response.add_argument("--from", dest="low", type=float, metavar="HZ", help="default 0.4 of the scene's")
    response.add_argument("--to", dest="high", type=float, metavar="HZ", help="default twice the scene's")
    response.add_argument("--points", type=int, default=400, metavar="N", help="of each branch (default 400)")
    response.add_argument(
        "--dimensionless", action="store_true", help="against xi at constant f; --from and --to are xi"
    )
    response.add_argument(
        "--from-rest",
        type=int,
        default=40,
        metavar="N",
        help="frequencies over the whole range at which the motion from rest is followed (default 40), 0 for "
        "none",
    )
    common.add_out(response, "tpd-response")
    response.set_defaults(run=run, does="following the motions over frequency, for {out}")


def run(options: argparse.Namespace) -> int:
    """Follow the branches, write them and print where they are lost; return the exit status."""
    common.use_64_bits()
    from tpd.core import checks, files

    scene, hung = _case(options)
    name, low, high = _range(options, scene)
    if options.from_rest != 0:
        checks.count("--from-rest", options.from_rest, least=2)
    files.claim(options.out, overwrite=options.overwrite)
    common.say(scene, hung)
    with common.bar() as bar:
        cases = _branches(scene, hung, name, (low, high), options.points, bar)
        settled = _settled(scene, hung, name, (low, high), options.from_rest, bar)
    print("\n".join(f"{label}: {case}" for label, case in cases.items()))
    print(_counted(settled, _own(scene, name)))
    # Everything is drawn before the first file is written: an interruption leaves all files or none.
    for path, content in list(_files(scene, hung, cases, settled)):
        print(f"written: {files.place(options.out / path, content)}")
    return common.SOUND


def _case(options: argparse.Namespace) -> tuple[Scene, Pendulum | None]:
    """Scene and pendulum of a design or of the options."""
    # A design has a scene and a pendulum; `stored.read` refuses options that describe others.
    if options.design is not None:
        job, hung = stored.read(options)
        return job.scene, hung
    scene = common.scene(options)
    return scene, common.pendulum(options, scene)


def _own(scene: Scene, name: str) -> float:
    """Value of the scene's own frequency, Hz, or of its xi."""
    return float(scene.parameters().xi) if name == "xi" else float(scene.motion.frequency)


def _near(settled: Mapping[str, Response], own: float) -> dict[str, Response]:
    """The motions from rest within 5 % of the own frequency."""
    return {label: r.between(0.95 * own, 1.05 * own) for label, r in settled.items()}


def _counted(settled: Mapping[str, Response] | None, own: float) -> str:
    """Line on the motions from rest near the own frequency: a single one says little."""
    if settled is None:
        return "motions that repeat; whether the block reaches one, or overturns, --from-rest N says"
    near = _near(settled, own)
    lost = ", ".join(f"{(r.status == 'overturned').sum()} {label}" for label, r in near.items())
    tried = len(near[BARE].frequency)
    return f"from rest, of {tried} frequencies within 5 % of {own:.4g}, overturned: {lost}"


def _range(options: argparse.Namespace, scene: Scene) -> tuple[str, float, float]:
    """Name of the varied quantity, and its bounds."""
    from tpd.core import checks

    name = "xi" if options.dimensionless else "frequency"
    own = _own(scene, name)
    low = 0.4 * own if options.low is None else options.low
    high = 2.0 * own if options.high is None else options.high
    checks.positive("--from", low)
    checks.positive("--to", high)
    if not low < high:
        raise ValueError(f"`--from` must be below `--to`, but they are {low:g} and {high:g}")
    checks.within("--points", options.points, 8.0, 100_000.0)
    return name, low, high


def _hangings(hung: Pendulum | None) -> dict[str, Pendulum | None]:
    return {BARE: None} if hung is None else {BARE: None, HUNG: hung}


def _branches(
    scene: Scene,
    hung: Pendulum | None,
    name: str,
    bounds: tuple[float, float],
    points: int,
    bar: Bar,
) -> dict[str, Branches]:
    from tpd.analysis.response import branches

    hangings, cases = _hangings(hung), {}
    bar("following branches", 0, len(hangings))
    for label, pendulum in hangings.items():
        cases[label] = branches(scene, name, *bounds, pendulum=pendulum, samples=points)
        bar("following branches", len(cases), len(hangings))
    return cases


def _settled(
    scene: Scene,
    hung: Pendulum | None,
    name: str,
    bounds: tuple[float, float],
    points: int,
    bar: Bar,
) -> dict[str, Response] | None:
    from tpd.analysis.response import frequencies, settled_response

    if points == 0:
        return None
    values = frequencies(_own(scene, name), *bounds, points)
    return {
        label: settled_response(scene, name, values, pendulum=pendulum, progress=bar)
        for label, pendulum in _hangings(hung).items()
    }


def _files(
    scene: Scene,
    hung: Pendulum | None,
    cases: Mapping[str, Branches],
    settled: Mapping[str, Response] | None,
) -> Iterator[tuple[str, str | bytes]]:
    from tpd.core import files
    from tpd.plot import style as canvas
    from tpd.plot.response import plot_branches, plot_response
    from tpd.report.responses import response_csv, topplings

    name = next(iter(cases.values())).name
    header = ("case", "branch", name, "status", "amplitude_rad", "stroke_rad", "phase_rad", "multiplier")
    rows = (row for label, case in cases.items() for row in _rows(label, case))
    yield "branches.csv", files.as_csv(header, rows)
    content = {
        **common.inputs(scene, hung),
        "bifurcations": {label: [asdict(b) for b in case.bifurcations] for label, case in cases.items()},
        "over": name,
    }
    yield "response.json", files.as_json(content)
    yield "branches.png", canvas.png(plot_branches(cases, settled=settled)[0].figure)
    if settled is not None:
        yield "response.csv", response_csv(tuple(settled.values()))
        own, levels = _own(scene, name), topplings(scene, hung)
        # Over the whole range the marks next to the own frequency hide each other.
        shown = {"response.png": settled, "response_near.png": _near(settled, own)}
        for file, responses in shown.items():
            if len(responses[BARE].frequency):
                axes = plot_response(tuple(responses.values()), own, toppling=levels)
                yield file, canvas.png(axes[0].figure)


def _rows(label: str, case: Branches) -> Iterator[tuple]:
    import numpy as np

    s = case.sweep
    largest = np.abs(s.multipliers).max(axis=-1)
    for branch in range(s.branches):
        for i, j in zip(*s.line(branch), strict=True):
            sizes = (s.amplitude[i, j], s.stroke[i, j], s.phase[i, j], largest[i, j])
            yield (label, branch, s.value[i], s.status[i, j], *sizes)
    for value, margin, stroke in zip(s.value, case.margin, case.rest_stroke, strict=True):
        if margin > 0.0:
            yield (label, "rest", value, "rest", 0.0, stroke, "", "")
