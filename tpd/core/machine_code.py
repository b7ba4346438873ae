"""Numba's machine code: made of whole entries alone, and loaded from the store only as it was written.

Numba unpickles and executes what it finds. A file that a loss of power has cut or emptied would stop every
later process, and one with other bits would end it. So the files of a function have a checksum beside them.

Numba takes 0.3 s to load: no module imports this one before it is needed.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba.core import caching, codegen, compiler, config
from numba.core.compiler_lock import global_compiler_lock

from tpd.core import files

_STORED = (".nbi", ".nbc")
"""Ends of the names of Numba's files: an index, and the machine code."""
_TESTED = (("0.68.1", "0.50.0"),)
"""Versions of Numba and llvmlite whose inner functions `entry_alone` is known to fit."""
_UNUSED = (
    "WithLifting InlineClosureLikes RewriteDynamicRaises MakeFunctionToJitFunction FindLiterallyCalls "
    "LiteralUnroll LiteralPropagationSubPipelinePass InlineOverloads NopythonRewrites "
    "NoPythonSupportedFeatureValidation DumpParforDiagnostics"
)
"""Passes of Numba that change nothing in scalar code: those for closures, objects as contexts, computed
messages of exceptions, loops over unlike items, expressions of arrays, and parallel loops."""


@contextlib.contextmanager
def entry_alone() -> Iterator[None]:
    """Optimise and make machine code of the function that is compiled meanwhile, not of each that it calls.

    Numba does both for every function together with all that it calls, and again for its caller. The results
    are the same to the last bit in half of the time. What was called can be called by compiled code
    afterwards, not by Python. With other versions than the tested ones Numba compiles as usual.
    """
    # No other thread compiles while Numba's functions are replaced.
    with global_compiler_lock, contextlib.ExitStack() as undo:
        for owner, name, now in _replacements():
            undo.callback(setattr, owner, name, owner.__dict__[name])
            setattr(owner, name, now)
        if gc.isenabled():
            # A compilation makes millions of objects that live as long as it does.
            undo.callback(gc.enable)
            gc.disable()
        yield


def _replacements() -> list[tuple[type, str, Callable[..., Any]]]:
    """Functions of Numba to replace, by class and name; none where Numba is not as expected."""
    if (numba.__version__, llvmlite.__version__) not in _TESTED:
        return []
    try:
        library, generator = codegen.CPUCodeLibrary, codegen.JITCPUCodegen
        compile_plainly = compiler.CompilerBase.__dict__["compile_extra"]
        optimise, finish = (library.__dict__[f"_{n}_final_module"] for n in ("optimize", "finalize"))
        set_plainly, passes_of = generator.__dict__["set_env"], compiler.Compiler.__dict__["define_pipelines"]
    except (AttributeError, KeyError):
        return []
    depth = 0

    def compile_extra(self: Any, func: Any) -> Any:
        nonlocal depth
        depth += 1
        try:
            return compile_plainly(self, func)
        finally:
            depth -= 1

    def optimize(self: Any) -> None:
        if depth <= 1:
            optimise(self)

    def finalize(self: Any) -> None:
        if depth <= 1:
            finish(self)
        else:
            # It is complete as a part to be linked, and unknown to the engine that runs machine code.
            self._finalize_dynamic_globals()
            self._finalized = True

    def set_env(self: Any, name: str, env: Any) -> None:
        if self._engine.is_symbol_defined(name):
            set_plainly(self, name, env)

    def define_pipelines(self: Any) -> Any:
        pipelines = passes_of(self)
        # Numba's own functions are no scalar code.
        if not self.state.func_id.modname.startswith("numba."):
            for one in pipelines:
                one.passes = [p for p in one.passes if p[0].__name__ not in _UNUSED.split()]
        return pipelines

    return [
        (compiler.CompilerBase, "compile_extra", compile_extra),
        (compiler.Compiler, "define_pipelines", define_pipelines),
        (library, "_optimize_final_module", optimize),
        (library, "_finalize_final_module", finalize),
        (generator, "set_env", set_env),
    ]


@contextlib.contextmanager
def whole(function: Callable[..., Any]) -> Iterator[None]:
    """Remove damaged machine code of a function before it is loaded, and seal what is stored at the end.

    Of several processes that ask for the same function at once, one compiles it.

    Raises:
        RuntimeError: Numba has no folder that can be written to.
        OSError: the folder is no place for what is executed, or what is damaged cannot be removed.
    """
    folder, stem = _place(function)
    files.check_own(folder)
    seal = folder / f"{stem}.sum"
    was_sealed = seal.exists()
    # What others have written before they lost the right to is not executed either.
    if was_sealed and not files.belongs(seal):
        seal.unlink()
    with files.held(seal) as file:
        file.seek(0)
        checksum = file.read()
        if (found := _stored(folder, stem, *_STORED)) and _checksum(found) != checksum:
            for path in found:
                path.unlink()
            # Without a seal it is of an earlier version, or of a process that was killed.
            if was_sealed:
                files.say_damaged("files of machine code", folder, "compiled")
        yield
        if (found := _stored(folder, stem, *_STORED)) and (now := _checksum(found)) not in (None, checksum):
            file.truncate(0)
            file.write(now)


def _place(function: Callable[..., Any]) -> tuple[Path, str]:
    """Folder in which Numba stores a function, and how the names of its files begin."""
    beside = caching.InTreeCacheLocator.from_function(function, function.__code__.co_filename)
    chosen = config.CACHE_DIR  # type: ignore[attr-defined]
    home = "XDG_CACHE_HOME" in os.environ or not os.path.expanduser("~").startswith("~")
    if not (chosen or beside or home):
        # Numba would make a folder with the name ~ where the command is given.
        raise RuntimeError("there is no home; name a folder by NUMBA_CACHE_DIR")
    cache = caching.FunctionCache(function)
    return Path(cache.cache_path), cache._impl.filename_base


def _stored(folder: Path, stem: str, *ends: str) -> list[Path]:
    return sorted(p for p in folder.iterdir() if p.name.startswith(f"{stem}.") and p.suffix in ends)


def _checksum(paths: list[Path]) -> bytes | None:
    """Checksum of files with their names; None where one of them cannot be read, or is another user's."""
    digest = hashlib.sha256()
    for path in paths:
        try:
            if not files.belongs(path):
                return None
            data = path.read_bytes()
        except OSError:
            return None
        digest.update(f"{path.name}\0{len(data)}\0".encode() + data)
    return digest.hexdigest().encode()
