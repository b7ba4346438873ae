"""Machine code of Numba: translated once per entry function, and loaded only from a cache of the user.

Numba takes 0.3 s to load, so no module imports this one before it is needed.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numba

from tpd.core import files

PIPELINE: dict[str, Any] = {}
"""Options of `numba.njit` for functions that only compiled code calls.

They are empty if Numba lacks one of the names below. Its usual compiler then takes twice as long.
"""

try:
    # These names are not public. Another version of Numba may lack them.
    from numba import _dynfunc  # type: ignore[attr-defined]
    from numba.core import codegen, compiler, compiler_machinery, typed_passes, untyped_passes

    class PartLibrary(codegen.JITCodeLibrary):
        """Code of a part: a function that is compiled together with its caller.

        Numba links, optimises and translates each function together with all functions that it calls. In a
        chain of calls it would repeat this for each caller. A part is only stored. The entry function at the
        end of the chain does everything once, with the same result to the last bit.
        """

        def finalize(self) -> None:
            """Skip the linking, optimisation and translation that Numba does here."""
            self._finalize_dynamic_globals()
            self._finalized = True

    @compiler_machinery.register_pass(mutates_CFG=True, analysis_only=False)
    class PartLowering(typed_passes.NativeLowering):
        """Compiler pass that creates the code of a part, without a function that Python could call."""

        _name = "part_lowering"

        def run_pass(self, state: Any) -> Literal[True]:
            """Lower the function into a `PartLibrary`."""
            state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            state.flags.no_compile = True
            super().run_pass(state)
            # Numba finds the code of a function by the object that Python would call. Create such an object
            # without an address.
            descriptor, name, own = state.cr.fndesc, state.func_id.func_name, (state.library,)
            part = _dynfunc.make_function(descriptor.lookup_module(), name, "", 0, state.cr.env, own)
            state.cr = state.cr._replace(cfunc=part)
            # A caller also needs the parts that this part calls, each of them once, and after all parts that
            # call it: Numba drops code that nothing before it uses.
            libraries = dict.fromkeys(reversed([state.library, *state.library._linking_libraries]))
            state.targetctx.insert_user_function(part, descriptor, list(libraries)[::-1])
            return True

    _OWN = {
        typed_passes.NativeLowering: PartLowering,
        untyped_passes.InlineClosureLikes: None,
        typed_passes.NopythonRewrites: None,
    }
    """Passes of Numba that are replaced, or left out because they are for closures and whole arrays."""

    class PartCompiler(compiler.CompilerBase):
        """Compiler of parts; the usual compiler with a version of Numba in which a trial of it fails."""

        def define_pipelines(self) -> list[Any]:
            """Return the usual passes of Numba, with `PartLowering` if possible."""
            passes = compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
            if _can_compile_parts():
                passes.passes = [
                    (_OWN.get(one, one), why) for one, why in passes.passes if _OWN.get(one, one)
                ]
                passes.finalize()
            return [passes]

    PIPELINE["pipeline_class"] = PartCompiler
except (ImportError, AttributeError):
    pass


_possible: list[bool] = []
"""Whether this version of Numba compiles parts. The list is empty before the trial."""


def _can_compile_parts() -> bool:
    """Return whether this version of Numba compiles a part and its caller, which a trial shows."""
    if not _possible:
        # The trial itself compiles a part.
        _possible.append(bool(PIPELINE))
        try:
            options: Any = {**PIPELINE, "no_cpython_wrapper": True}
            part = numba.njit(**options)(lambda x: x + 1.0)
            numba.cfunc("float64(float64)")(lambda x: part(x))
        except Exception:
            _possible[0] = False
    return _possible[0]


def stored(function: Callable[..., Any], compiler: Any, signature: Any, **options: Any) -> Any:
    """Compile a function for one signature by `njit` or `cfunc` of Numba, or load its machine code from the
    cache.

    The cache of Numba is used only if no other user can write to it. If several processes request the same
    function at once, one of them compiles it. Machine code that cannot be loaded, for example after a power
    failure, is removed and compiled again.
    """
    plain = inspect.unwrap(function)
    try:
        # Numba does not document this module.
        from numba.core import caching

        make = compiler(signature, cache=True, error_model="numpy", **options)
        if not (numba.config.CACHE_DIR or Path(os.path.expanduser("~")).is_absolute()):  # type: ignore[attr-defined]
            # Numba would create a folder with the name ~ in the working directory.
            raise RuntimeError("there is no home directory; set a folder with NUMBA_CACHE_DIR")
        cache = caching.FunctionCache(plain)
        folder = Path(cache.cache_path)
        for place in filter(None, (numba.config.CACHE_DIR, folder)):  # type: ignore[attr-defined]
            files.check_own(Path(place).absolute())
        with files.file_lock(folder / f"{plain.__module__}.{plain.__qualname__}.lock"):
            try:
                return make(plain)
            except OSError:
                raise
            except Exception:
                # The cache consists of pickle files, and a damaged pickle file can raise any exception.
                cache.flush()
                compiled = make(plain)
                files.say_damaged("files of machine code", folder, "compiled")
                return compiled
    except (RuntimeError, OSError, ImportError, AttributeError) as error:
        files.say_unkept(error)
        return compiler(signature, error_model="numpy", **options)(plain)
