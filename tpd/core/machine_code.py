"""Numba's machine code: translated once for an entrance, and loaded from the store only as it was written.

Numba unpickles and executes what it finds. A file that a loss of power has cut or emptied would stop every
later process, and one with other bits would end it. So the files of a function have a checksum beside them.

Numba takes 0.3 s to load: no module imports this one before it is needed.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba import _dynfunc
from numba.core import caching, codegen, compiler, compiler_machinery, config, typed_passes

from tpd.core import files

_STORED = (".nbi", ".nbc")
"""Ends of the names of Numba's files: an index, and the machine code."""


class PartLibrary(codegen.JITCodeLibrary):
    """Code of a part, which waits for the function that calls it.

    Numba optimises and translates each function together with all functions that it calls. In a chain of calls
    it would do so again at each link. A part is only linked: the entrance at the end of the chain optimises
    and translates everything once, with the same result to the last bit.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(typed_passes.NativeLowering):
    """Make the code of a part, and no function that Python could call."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower the function into a `PartLibrary`."""
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        # Numba finds the code of a function by the object that Python would call: here without an address.
        known, name = state.cr.fndesc, state.func_id.func_name
        part = _dynfunc.make_function(known.lookup_module(), name, "", 0, state.cr.env, (state.library,))
        state.cr = state.cr._replace(cfunc=part)
        state.targetctx.insert_user_function(part, known, [state.library])
        return True


class PartCompiler(compiler.CompilerBase):
    """Compiler of functions that only compiled code calls."""

    def define_pipelines(self) -> list[Any]:
        """Return Numba's usual passes, with `PartLowering` in place of its own."""
        passes = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        own = {typed_passes.NativeLowering: PartLowering}
        passes.passes = [(own.get(one, one), why) for one, why in passes.passes]
        passes.finalize()
        return [passes]


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
