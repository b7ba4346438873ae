"""When the compiled code of the equations is made: once for a machine and a version, in other processes.

Numba compiles for some twenty seconds, in Python: in the same process it would hold up everything else.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import tempfile
import warnings
import zlib
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import IO

from tpd.core import files

HARMONIC = ("tpd.exact.orbit_entry", "tpd.exact.linear_entry", "tpd.exact.nonlinear_entry")
"""Modules with the compiled code of motions under a harmonic."""
GROUND = ("tpd.exact.linear_entry", "tpd.exact.nonlinear_entry")
"""Modules of motions under pulses and records."""
_COMMAND = """
import gc, os, sys, threading, warnings
# A compilation makes millions of objects, which live as long as this process.
gc.disable()
# The end of the pipe is that of the command, however it ends.
threading.Thread(target=lambda: os.read(0, 1) or os._exit(1), daemon=True).start()
sys.excepthook = lambda *_: None
warnings.showwarning = lambda text, kind, *_: kind is UserWarning and print(text, file=sys.stderr)
from tpd.exact.compiling import load
load(sys.argv[2])
open(sys.argv[1], "w", encoding="utf-8").write(sys.argv[3])
"""
_running: dict[str, tuple[subprocess.Popen[bytes], IO[bytes]]] = {}
"""Processes by the module that they compile, with the files of what they have to say. No pipes: who reads the
errors of a command would wait for the end of all processes that hold its pipe."""


def sources() -> list[Path]:
    """Files that are compiled, or call what is."""
    folder = Path(__file__).parent
    scene = folder.parent / "scene"
    return [*sorted(folder.glob("*.py")), scene / "impacts.py", scene / "parameters.py"]


@lru_cache(maxsize=1)
def checksum() -> int:
    """Checksum of `sources`."""
    return zlib.crc32(b"".join(f.read_bytes() for f in sources()))


def compile_beside(folder: Path, modules: tuple[str, ...]) -> None:
    """Begin to compile modules in processes of their own, unless marks in `folder` say that it was done.

    Raises:
        OSError: no process can be started.
    """
    # Numba's store belongs to one installation, or is the folder that the environment names.
    version, chosen = str(checksum()), os.environ.get("NUMBA_CACHE_DIR")
    store = Path(chosen).absolute() if chosen else Path(__file__).parent / "__pycache__"
    try:
        if chosen or os.access(store, os.W_OK):
            files.check_own(store)
    except OSError as error:
        # What another process compiles would be of no use to this one.
        return files.say_unkept(error)
    for module in modules:
        place = f"{module} {Path(__file__)} {sys.version} {chosen}"
        mark = folder / f"compiled-{zlib.crc32(os.fsencode(place)):08x}"
        made = mark.read_text(encoding="utf-8") if mark.exists() else ""
        if made == version or module in _running or module in sys.modules:
            continue
        if made:
            warnings.warn(f"what is compiled in {store} is of another version: it is made anew", stacklevel=2)
        said = tempfile.TemporaryFile()  # noqa: SIM115
        atexit.register(said.close)
        process = subprocess.Popen(
            # -P: the folder in which a command is given may hold another `tpd`, or anything.
            [sys.executable, "-P", "-c", _COMMAND, str(mark), module, version],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=said,
            # A session of its own: Ctrl-C is for the command, and this process ends with it.
            start_new_session=True,
        )
        assert process.stdin is not None
        atexit.register(process.stdin.close)
        _running[module] = process, said


def load(module: str) -> None:
    """Import a module with compiled code, made by another process if that was begun. What that had to say,
    such as that stored code was damaged, is said."""
    if begun := _running.get(module):
        begun[0].wait()
    # Of several threads that wait, one repeats what was said.
    if begun and _running.pop(module, None):
        said = begun[1]
        said.seek(0)
        for line in said.read().decode(errors="replace").splitlines():
            warnings.warn(line, stacklevel=2)
    # Where another thread is importing it, this waits for that.
    import_module(module)
