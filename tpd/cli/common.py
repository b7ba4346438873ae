"""What the commands share: exit statuses, the scene's options, the pendulum's, and the progress bar."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tpd.core.scene import Pendulum, Scene
    from tpd.design.job import Job

SOUND, BAD_INPUT, UNSOUND, INTERRUPTED = 0, 2, 3, 130

_SCENE: dict[str, tuple[str, str, str, str]] = {
    # flag: (table, key, metavar, help)
    "width": ("block", "width", "M", "whole width of the block, m (default 0.1)"),
    "height": ("block", "height", "M", "whole height of the block, m (default 0.4)"),
    "mass": ("block", "mass", "KG", "mass of the block, kg (default 16.224)"),
    "friction": (
        "block",
        "friction",
        "K",
        "friction moment of the contact over M g b (default 0.05, or 0 with --restitution)",
    ),
    "restitution": (
        "block",
        "restitution",
        "E",
        "velocity ratio across an impact of the base, or `housner` for that of the block's shape "
        "(default: no impact loss)",
    ),
    "amplitude": ("motion", "amplitude", "M", "amplitude of the base motion, m (default 0.015)"),
    "frequency": ("motion", "frequency", "HZ", "frequency of the base motion, Hz (default 2.5)"),
}


def add_scene(command: argparse.ArgumentParser) -> None:
    """The options that describe block and base motion."""
    command.add_argument("--scene", type=Path, metavar="FILE", help="TOML file; options override it")
    for flag, (_, _, metavar, text) in _SCENE.items():
        kind = _restitution if flag == "restitution" else float
        command.add_argument(f"--{flag}", type=kind, metavar=metavar, help=text)


def _restitution(text: str) -> float | str:
    """A number, or a name, which the block knows or refuses."""
    try:
        return float(text)
    except ValueError:
        return text


def add_out(command: argparse.ArgumentParser, default: str) -> None:
    """Where results go."""
    command.add_argument("--out", type=Path, default=Path(default), metavar="DIR", help=f"default {default}")
    command.add_argument("--overwrite", action="store_true", help="replace the results in an existing DIR")


def add_pendulum(command: argparse.ArgumentParser) -> None:
    """The options that describe one pendulum."""
    mass, length = command.add_mutually_exclusive_group(), command.add_mutually_exclusive_group()
    mass.add_argument("--pendulum-mass", type=float, metavar="KG", help="mass of the bob, kg")
    mass.add_argument("--mass-ratio", type=float, metavar="MU", help="the same over the block's")
    length.add_argument("--pendulum-length", type=float, metavar="M", help="length of the pendulum, m")
    length.add_argument("--length-ratio", type=float, metavar="LAM", help="the same over the half height")
    command.add_argument(
        "--pendulum-damping", type=float, metavar="ZETA", help="damping ratio of the hinge (default 0.1)"
    )


def tables(options: argparse.Namespace, more: list[tuple[str, str, Any]]) -> dict[str, dict[str, Any]]:
    """The job's tables of a scene file, overridden by options, and by `more` (table, key, value)."""
    from tpd.design import job

    given = {} if options.scene is None else job.read(options.scene)
    over = [(table, key, getattr(options, flag)) for flag, (table, key, _, _) in _SCENE.items()]
    for table, key, value in [*over, *more]:
        if value is not None:
            given.setdefault(table, {})[key] = value
    return given


def scene(options: argparse.Namespace) -> Scene:
    """The scene of a file and the options."""
    from tpd.design import job

    work: Job = job.build(tables(options, []))
    return work.scene


def pendulum(options: argparse.Namespace, of: Scene, varied: tuple[str, ...] = ()) -> Pendulum | None:
    """The pendulum of the options, if there is any; what is varied need not be given.

    Raises:
        ValueError: a pendulum of which half is missing, or a value out of range.
    """
    from tpd.core.scene import Pendulum

    mass = _one(options.pendulum_mass, options.mass_ratio, of.block.mass)
    length = _one(options.pendulum_length, options.length_ratio, of.block.half_height)
    damping = options.pendulum_damping
    if mass is None and {"pendulum_mass", "mu"} & set(varied):
        mass = of.block.mass
    if length is None and {"pendulum_length", "lam"} & set(varied):
        length = of.block.half_height
    named = damping is not None or {"pendulum_damping", "zeta"} & set(varied)
    if mass is None and length is None and not named:
        return None
    if mass is None or length is None:
        missing = "--pendulum-mass or --mass-ratio" if mass is None else "--pendulum-length or --length-ratio"
        raise ValueError(f"half of the pendulum is missing: give {missing} as well")
    return Pendulum(mass=mass, length=length, damping_ratio=0.1 if damping is None else damping)


def _one(value: float | None, ratio: float | None, unit: float) -> float | None:
    return value if ratio is None else ratio * unit


def inputs(of: Scene, hung: Pendulum | None) -> dict[str, Any]:
    """What results depend on, for their JSON."""
    from dataclasses import asdict

    from tpd.core import files

    pendulum = None if hung is None else asdict(hung)
    # Nothing in a response or a map is random.
    return {"scene": asdict(of), "pendulum": pendulum, "versions": files.versions(), "seed": None}


def use_64_bits() -> None:
    """Before anything else is done with JAX. What it compiles is kept for later runs, in the user's cache
    or where `JAX_COMPILATION_CACHE_DIR` says."""
    if "equinox" not in sys.modules:
        # Times out of order, which diffrax looks for, are then NaN in place of an exception: a program that
        # calls back to Python to raise one is never kept.
        os.environ.setdefault("EQX_ON_ERROR", "nan")
    import jax

    jax.config.update("jax_enable_x64", True)
    if jax.config.jax_compilation_cache_dir is None:  # type: ignore[attr-defined]
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tpd" / "compiled"
        with contextlib.suppress(OSError):
            cache.mkdir(parents=True, exist_ok=True)
            jax.config.update("jax_compilation_cache_dir", str(cache))
            jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)


@contextlib.contextmanager
def left_out(what: str) -> Iterator[None]:
    """Something beside the answer: Ctrl-C leaves it out, says so, and keeps the answer."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"tpd: interrupted; the report goes without {what}", file=sys.stderr)


class Bar:
    """One progress bar for all stages, on a terminal only."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._stage = ""

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show that of a stage so much is done."""
        from tqdm import tqdm

        if stage != self._stage or self._bar is None or done == 1:
            if self._bar is not None:
                self._bar.close()
            self._bar = tqdm(total=total, desc=stage, disable=None, leave=False, file=sys.stderr)
            self._stage = stage
        self._bar.update(done - self._bar.n)
