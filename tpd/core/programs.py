"""Compiled programs, which may be kept for later processes.

JAX's own cache keeps what the compiler has made; to find it there a program is traced first, which takes
about as long as everything else together. What is kept here is found by what it is made of: the source of
this package, versions, the processor, settings, the function, and the shapes of its arguments. Of functions
and classes of anybody else the source is not looked at: what is made of them is not kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import os
import pickle
import platform
import re
import warnings
import zlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from threading import Lock, local
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from tpd.core import files
from tpd.core.fingerprints import of_sources
from tpd.core.threads import aside

_MOST = 64
"""Programs that are kept; of more the oldest go."""
_SOURCES = frozenset({__name__.partition(".")[0]})
"""Packages with the functions that are kept: of changes in others `_here` would know nothing."""
_VALUES = _SOURCES | {"builtins", *files.PACKAGES}
"""Packages with the types of what such a function closes over: `_here` knows their sources or versions."""
_SHORT = 16
"""Letters of a program's name that JAX's cache has in the name of its file."""
_CHECKERS = ("jaxtyping.", "beartype.")
_OTHERS = 0o022
"""Rights of others to write: what they may have written is not executed."""
_OPTIONS: dict[str, Any] = {"xla_backend_optimization_level": 1, "xla_cpu_use_fusion_emitters": False}
"""Options of the compiler for processors: it takes two thirds of its time with them, and what it makes is as
fast."""
_LAPACK = "lapack_"
CALLED: dict[str, Callable[[], None]] = {}
"""Names of this package's own code that programs call, and functions that load it or raise an exception."""
_folder: list[Path] = []
_found = local()
"""Whether this thread has found a program in JAX's cache."""


def _heard(event: str, **_: Any) -> None:
    if event.endswith("/cache_hits"):
        _found.here = True


jax.monitoring.register_event_listener(_heard)


def keep_in(folder: Path) -> None:
    """Keep programs in a folder of the user's own; one of somebody else is not used.

    Raises:
        OSError: the folder cannot be made.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    _folder[:] = [folder] if _is_own(folder) else []


class Program:
    """A function of pytrees of arrays, compiled once for each shape of its arguments.

    Two threads that ask for the same one do not both compile it.
    """

    def __init__(self, function: Callable[..., Any], *, mapped: bool = False) -> None:
        """If `mapped`, the function is one of an element, and the arguments have a leading axis."""
        self.function, self.mapped = function, mapped
        self._ready: dict[Any, tuple[Callable[..., Any], Any]] = {}
        self._traced: dict[Any, tuple[Any, Any]] = {}
        self._lock = Lock()

    def __call__(self, *args: Any) -> Any:
        """The function's value."""
        leaves, structure = jax.tree.flatten(args)
        run, out = self._at(leaves, structure)
        return jax.tree.unflatten(out, run(*leaves))

    def prepare(self, *args: Any) -> None:
        """Compile for arguments of these shapes, or find what was kept."""
        self._at(*jax.tree.flatten(args))

    def begin(self, *args: Any) -> None:
        """Begin to `prepare` in a thread; a call waits for it. A program that is not stored is traced here,
        because threads share Python. The thread compiles it, or loads what is stored, and traces only where a
        stored file cannot be used."""
        leaves, structure = jax.tree.flatten(args)
        key = _key(leaves, structure)
        with self._lock:
            if key in self._ready or key in self._traced:
                return
            path = self._path(key)
            if path is None or not path.exists():
                self._traced[key] = self._lowered(leaves, structure, key)
        aside(lambda: self._at(leaves, structure))

    def _at(self, leaves: list[Any], structure: Any) -> tuple[Callable[..., Any], Any]:
        key = _key(leaves, structure)
        if key not in self._ready:
            with self._lock:
                if key not in self._ready:
                    self._ready[key] = self._made(leaves, structure, key)
        return self._ready[key]

    def _made(self, leaves: list[Any], structure: Any, key: Any) -> tuple[Callable[..., Any], Any]:
        known = self._traced.pop(key, None)
        kept = self._kept(key, leaves) if known is None else None
        if kept is not None:
            return kept
        lowered, out = known or self._lowered(leaves, structure, key)
        _found.here = False
        run, path = _compiled(lowered), self._path(key)
        # What comes out of JAX's cache lacks a part of its code when it is written once more.
        calls = _calls(lowered)
        known = all(name.startswith(_LAPACK) or name in CALLED for name in calls)
        if path is not None and known and not _found.here:
            _write(path, run, out, calls)
        return run, out

    def _path(self, key: Any) -> Path | None:
        name = _identity(self.function) if _folder else None
        return None if name is None else _folder[0] / _digest(_here(), name, str((self.mapped, key)))

    def _kept(self, key: Any, leaves: list[Any]) -> tuple[Callable[..., Any], Any] | None:
        path = self._path(key)
        return None if path is None else _read(path, leaves)

    def _lowered(self, leaves: list[Any], structure: Any, key: Any) -> tuple[Any, Any]:
        function = jax.vmap(self.function) if self.mapped else self.function
        structures: list[Any] = []

        def flat(*leaves: Any) -> list[Any]:
            out, its = jax.tree.flatten(function(*jax.tree.unflatten(structure, leaves)))
            structures.append(its)
            return out

        path = self._path(key)
        # A name of its own: JAX's cache has no other version of it either.
        name = getattr(self.function, "__name__", "program")
        flat.__name__ = name if path is None else f"{name}_{path.name[:_SHORT]}"
        return jax.jit(flat).lower(*leaves), structures[-1]


def _compiled(lowered: Any) -> Any:
    """A program in machine code."""
    if jax.default_backend() == "cpu":
        # Other versions of the compiler may not know these options.
        with contextlib.suppress(jax.errors.JaxRuntimeError):
            return lowered.compile(compiler_options=_OPTIONS)
    return lowered.compile()


def _calls(lowered: Any) -> list[str]:
    """Names of the code outside of it that a program calls."""
    return sorted(set(re.findall(r"custom_call @([^\s(]+)", lowered.as_text())))


@lru_cache(maxsize=1)
def _load_lapack() -> None:
    jax.jit(jnp.linalg.solve).trace(np.eye(1), np.ones(1)).lower(lowering_platforms=("cpu",))


def _key(leaves: list[Any], structure: Any) -> Any:
    """Everything about arguments that a program is made for."""
    wide = bool(jax.config.jax_enable_x64)  # type: ignore[attr-defined]
    return structure, wide, *((x.shape, x.dtype) for x in leaves)


def _read(path: Path, leaves: list[Any]) -> tuple[Callable[..., Any], Any] | None:
    """A program that was kept and runs with such arguments, with the structure of its results; None if there
    is none that can be used."""
    try:
        if not path.exists() or not _is_own(path):
            return None
        data = files.unsealed(path.read_bytes())
        if data is None:
            _remove(path)
            return None
        calls, *parts, sample = pickle.loads(zlib.decompress(data))
        # Tracing loads what a program calls, such as LAPACK. What was not traced here would crash without it.
        for name in calls:
            (_load_lapack if name.startswith(_LAPACK) else CALLED[name])()
        run, out = deserialize_and_load(*parts), jax.tree.structure(sample)
        # Some defects show when it runs.
        jax.block_until_ready(run(*leaves))
        return run, out
    except Exception as error:
        # A compiler may refuse code that it made itself, as on some processors with AVX-512.
        warnings.warn(
            f"compiled programs that were kept cannot be used, and are compiled again: {error}", stacklevel=2
        )
        return None


def _remove(path: Path) -> None:
    """Remove a program that is damaged, also from JAX's cache: out of that it could not be kept again."""
    cache = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    copies = [] if cache is None else Path(cache).glob(f"*_{path.name[:_SHORT]}*-cache")
    for file in (path, *copies):
        with contextlib.suppress(OSError):
            file.unlink()
    files.say_damaged("programs", path.parent, "compiled")


def _write(path: Path, run: Any, out: Any, calls: list[str]) -> None:
    """Keep a program, where that is possible at all."""
    with contextlib.suppress(Exception):
        # An object in place of its structure: equinox marks what a structure lacks by an object that pickle
        # copies, and then does not know the copy.
        sample = jax.tree.unflatten(out, [0] * out.num_leaves)
        data = zlib.compress(pickle.dumps((calls, *serialize(run), sample)), level=1)
        files.place(path, files.sealed(data))
        old = sorted(path.parent.iterdir(), key=lambda x: x.stat().st_mtime)[:-_MOST]
        for other in old:
            other.unlink(missing_ok=True)


def _is_own(path: Path) -> bool:
    """Whether nobody else can have written to a path."""
    about = path.stat()
    return hasattr(os, "getuid") and about.st_uid == os.getuid() and not about.st_mode & _OTHERS


def _identity(function: Any) -> str | None:
    """Name of a function and what it closes over; None where no words tell it from any other, or where it is
    made of what `_here` does not know."""
    plain = _unchecked(function)
    if not inspect.isfunction(plain) or _package(plain) not in _SOURCES:
        return None
    parts = [_words(cell.cell_contents) for cell in plain.__closure__ or ()]
    known = None not in parts and "<lambda>" not in plain.__qualname__
    return f"{plain.__module__}.{plain.__qualname__}{parts}" if known else None


def _unchecked(function: Any) -> Any:
    """The function that a checker of types has wrapped, or the function itself."""
    # Others wrap as well, as `jax.vmap` does, but what they return is another function.
    while inspect.isfunction(function) and function.__globals__["__name__"].startswith(_CHECKERS):
        function = function.__wrapped__  # type: ignore[attr-defined]
    return function


def _words(value: Any) -> str | None:
    """A value in words that tell it from any other; None for one whose words may not."""
    leaves, structure = jax.tree.flatten(value)
    plain = all(isinstance(x, (bool, int, float, str)) for x in leaves) and _is_known(structure)
    words = f"{leaves} {structure}"
    return words if plain and " at 0x" not in words else None


def _is_known(structure: Any) -> bool:
    """Whether all types in a structure are of packages that `_here` knows."""
    node = structure.node_data()
    known = node is None or _package(node[0]) in _VALUES
    return known and all(map(_is_known, structure.children()))


def _package(definition: Any) -> str:
    return definition.__module__.partition(".")[0]


def _digest(*parts: str) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


@lru_cache(maxsize=1)
def _here() -> str:
    """Everything that a program depends on beside its function: sources, versions, processor, settings."""
    processor = platform.processor()
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = "\n".join(sorted({x for x in lines if x.startswith(("flags", "model name", "Features"))}))
    settings = sorted((k, v) for k, v in os.environ.items() if k.startswith(("XLA_", "JAX_", "EQX_")))
    devices = [str(x) for x in jax.devices()]
    parts = of_sources(), files.versions(), processor, platform.platform(), settings, devices
    return "\n".join(map(str, (*parts, np.dtype(int).str)))
