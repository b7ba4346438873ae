"""Objects that `tpd.optimise` takes, made of the typed tables of a job file."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import msgspec
from msgspec.structs import replace

from tpd.analysis.attractors import Starts
from tpd.analysis.ensemble import Ensemble
from tpd.cli.schema import JobFile
from tpd.core.bob import Bob
from tpd.core.conditions import Conditions, check_restitution
from tpd.core.scene import Block, Harmonic, Scene, paper_scene
from tpd.design.criteria import KINDS, DesignSpace, Limit, Risk, Room, Worsening, Worth
from tpd.design.methods import SMOOTHED, Descent, Method, Sequential
from tpd.design.question import check_moves as refuse_still
from tpd.design.question import check_scatter
from tpd.models.piecewise import Piecewise

_MOST_CONDITIONS = 100_000
"""Beyond it the arrays of a search do not fit into the memory of a usual computer."""


_SHAPE = ("width", "height", "mass")
"""Keys of [block] that a block of one's own needs."""
_SHAKING = ("amplitude", "frequency")
"""Keys of [motion] that the motion of a block of one's own needs."""


@contextlib.contextmanager
def naming(table: str) -> Iterator[None]:
    """Name the table in messages about its values."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"[{table}] {error}") from None


def refuse_mixture(given: Mapping[str, Any]) -> None:
    """Refuse a block or its motion that is partly given and partly the paper's.

    Friction and restitution alone, or a motion alone, are variations of the paper's scene and are allowed.

    Raises:
        ValueError: a size or the mass without the others, or a block without its motion.
    """
    block, motion = given.get("block", {}), given.get("motion", {})
    # Losses alone are no other block: the paper's block with another friction is a fair question.
    own = [key for key in (*_SHAPE, "radius_of_gyration") if key in block]
    needed = (("block", _SHAPE, block), ("motion", _SHAKING, motion))
    missing = {
        table: absent for table, keys, there in needed if (absent := [k for k in keys if k not in there])
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


def scene_of(file: JobFile) -> Scene:
    """Block, base motion and gravity."""
    given = msgspec.structs.asdict(file.block)
    paper = paper_scene().block
    # By numbers and not by what was typed. The paper's block has the cavity that it has in Python as well.
    if given["cavity_width"] is None and all(given[key] == getattr(paper, key) for key in _SHAPE):
        given["cavity_width"] = paper.cavity_width
    with naming("block"):
        block = Block(**given)
    with naming("motion"):
        motion = Harmonic(**msgspec.structs.asdict(file.motion))
    with naming("site"):
        return Scene(block, motion, file.site.gravity)


def conditions_of(file: JobFile, scene: Scene) -> Conditions | None:
    """Each frequency with each amplitude and each sample; None for the neighbourhood of the motion."""
    if file.is_around:
        return None
    if file.size > _MOST_CONDITIONS:
        raise ValueError(f"a job must have at most {_MOST_CONDITIONS} conditions, but has {file.size}")
    asked, out = file.conditions, Conditions()
    with naming("conditions"):
        if asked.band is not None:
            out = out * Conditions.band(scene, *asked.band, asked.frequencies)
        # A factor of one is the scene itself: multiplying by it would only lengthen the description.
        if asked.amplitudes != (1.0,):
            out = out * Conditions.amplitudes(*asked.amplitudes)
    with naming("scatter"):
        if widths := file.widths:
            out = out * Conditions.scatter(asked.samples, file.search.seed, **widths)
    return out


def space_of(file: JobFile) -> DesignSpace:
    """Design space."""
    with naming("space"):
        return DesignSpace(**msgspec.structs.asdict(file.space))


def ensemble_of(file: JobFile) -> Ensemble:
    """Runs of the verification."""
    with naming("ensemble"):
        return Ensemble(**msgspec.structs.asdict(file.ensemble))


def starts_of(file: JobFile) -> Starts:
    """Initial states."""
    match file.starts.kind:
        case "rest":
            return Starts.rest()
        case _:
            return Starts.any()


def risk_of(file: JobFile) -> Risk:
    """Risk measure."""
    match file.risk.measure:
        case "worst":
            return Risk.worst()
        case "expected":
            return Risk.expected()
        case _:
            return Risk.cvar(file.risk.share)


def check_moves(file: JobFile, scene: Scene, conditions: Conditions, space: DesignSpace) -> None:
    """Raise `ValueError` where nothing shakes the block, or where a quantity scatters that is zero."""
    with naming("scatter"):
        check_scatter(scene, file.widths, space)
    with naming("ensemble"):
        if file.ensemble.restitution:
            check_restitution(scene)
    with naming("motion"):
        refuse_still(scene, conditions, space)


def limits_of(file: JobFile) -> tuple[Limit, ...]:
    """Limits, in the order of a report."""
    asked = {kind: getattr(file.limits, kind.name) for kind in KINDS}
    with naming("limits"):
        # The paper's setting, a single motion, has a bob without size and no other condition to compare with.
        left_out = (Room, Worsening) if file.conditions.exactly else ()
        return tuple(
            Room(bob_of(file)) if kind is Room else kind(value)  # type: ignore[call-arg]
            for kind, value in asked.items()
            if value is not None and value is not False and kind not in left_out
        )


def bob_of(file: JobFile) -> Bob:
    """The bob as a body."""
    with naming("bob"):
        return Bob(**msgspec.structs.asdict(file.bob))


def worth_of(file: JobFile) -> Worth:
    """Requirements on the benefit."""
    with naming("worth"):
        return Worth(**msgspec.structs.asdict(file.worth))


def method_of(file: JobFile) -> Method:
    """Method of the search."""
    asked = file.search
    numbers = {name: getattr(asked, name) for name in ("searches", "screening", "steps")}
    given: dict[str, Any] = {name: number for name, number in numbers.items() if number is not None}
    with naming("search"):
        if asked.method == "sequential":
            return Sequential(**given)
        if asked.model is not None:
            given["model"] = SMOOTHED if asked.model == "smoothed" else Piecewise()
        return Descent(optimiser=asked.optimiser or "adam", tolerance=asked.tolerance, **given)


def with_defaults(file: JobFile, scene: Scene, method: Method) -> JobFile:
    """Fill in the defaults that depend on other keys, so that a written job does not depend on them."""
    # Defaults depend on the method: written out, a job keeps its meaning in a later version.
    numbers = {name: getattr(method, name) for name in ("searches", "screening", "steps")}
    return replace(
        file,
        block=replace(file.block, friction=scene.block.friction, cavity_width=scene.block.cavity_width),
        search=replace(file.search, **numbers),
    )
