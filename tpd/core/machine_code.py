"""Numba's machine code: translated once for an entrance, and loaded only from a cache that is the user's.

Numba takes 0.3 s to load: no module imports this one before it is needed.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core import caching, codegen, compiler, compiler_machinery, config, typed_passes, untyped_passes

from tpd.core import files


class PartLibrary(codegen.JITCodeLibrary):
    """Code of a part, which waits for the function that calls it.

    Numba links, optimises and translates each function together with all functions that it calls. In a chain
    of calls it would do so again for each caller. A part is only kept: the entrance at the end of the chain
    does everything once, with the same result to the last bit.
    """

    def finalize(self) -> None:
        """Do nothing of what Numba does here."""
        self._finalize_dynamic_globals()
        self._finalized = True


@compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(typed_passes.NativeLowering):
    """Make the code of a part, and no function that Python could call."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> Literal[True]:
        """Lower the function into a `PartLibrary`."""
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        # Numba finds the code of a function by the object that Python would call: here without an address.
        known, name = state.cr.fndesc, state.func_id.func_name
        part = _dynfunc.make_function(known.lookup_module(), name, "", 0, state.cr.env, (state.library,))
        state.cr = state.cr._replace(cfunc=part)
        # A caller needs the parts that this part calls as well, each once.
        needed = dict.fromkeys([state.library, *state.library._linking_libraries])
        state.targetctx.insert_user_function(part, known, list(needed))
        return True


class PartCompiler(compiler.CompilerBase):
    """Compiler of functions that only compiled code calls."""

    def define_pipelines(self) -> list[Any]:
        """Return Numba's usual passes with `PartLowering`, without those for closures and whole arrays."""
        passes = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        own = {typed_passes.NativeLowering: PartLowering}
        unused = untyped_passes.InlineClosureLikes, typed_passes.NopythonRewrites
        passes.passes = [(own.get(one, one), why) for one, why in passes.passes if one not in unused]
        passes.finalize()
        return [passes]


def stored(function: Callable[..., Any], compiler: Any, signature: Any, **options: Any) -> Any:
    """Compile a function for one kind of arguments, by `njit` or `cfunc` of Numba, or load its machine code
    from Numba's cache, if only the user can write there.

    Of several processes that ask for the same function at once, one compiles it. Machine code that cannot be
    loaded, as after a loss of power, is removed and compiled again.
    """
    plain = inspect.unwrap(function)
    try:
        make = compiler(signature, cache=True, error_model="numpy", **options)
        if not (config.CACHE_DIR or Path(os.path.expanduser("~")).is_absolute()):  # type: ignore[attr-defined]
            # Numba would make a folder with the name ~ where the command is given.
            raise RuntimeError("there is no home; name a folder by NUMBA_CACHE_DIR")
        cache = caching.FunctionCache(plain)
        folder = Path(cache.cache_path)
        for place in filter(None, (config.CACHE_DIR, folder)):  # type: ignore[attr-defined]
            files.check_own(Path(place).absolute())
        with files.held(folder / f"{plain.__module__}.{plain.__name__}.lock"):
            try:
                return make(plain)
            except OSError:
                raise
            except Exception:
                # Pickle, of which a cache consists, raises whatever a damaged file leads to.
                cache.flush()
                made = make(plain)
                files.say_damaged("files of machine code", folder, "compiled")
                return made
    except (RuntimeError, OSError) as error:
        files.say_unkept(error)
        return compiler(signature, error_model="numpy", **options)(plain)
