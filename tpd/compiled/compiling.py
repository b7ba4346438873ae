"""Compilation of the kernels, once for each machine and version, in processes of their own.

Numba compiles for about twenty seconds, in Python. In the same process it would block everything else.
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

HARMONIC = ("tpd.compiled.orbit_entry", "tpd.compiled.run_entry")
"""Modules with the compiled code of runs under a harmonic."""
GROUND = ("tpd.compiled.run_entry",)
"""Modules with the compiled code of runs under pulses and records."""
_COMMAND = """
import gc, os, sys, threading, warnings
# A compilation creates millions of objects that live as long as this process.
gc.disable()
# The pipe closes when the command ends, for whatever reason.
threading.Thread(target=lambda: os.read(0, 1) or os._exit(1), daemon=True).start()
sys.excepthook = lambda *_: None
warnings.showwarning = lambda text, kind, *_: kind is UserWarning and print(text, file=sys.stderr)
from tpd.compiled.compiling import load
load(sys.argv[2])
open(sys.argv[1], "w", encoding="utf-8").write(sys.argv[3])
"""
_running: dict[str, tuple[subprocess.Popen[bytes], IO[bytes]]] = {}
"""Processes that compile, by the name of the module, with the files of their messages. The messages go to
files, not to pipes: a program that reads the error output of a command would wait until all processes with
that pipe have ended."""


def sources() -> list[Path]:
    """Return the files that are compiled, or that call compiled code, or the wheel that contains them."""
    folder = Path(__file__).parent
    scene = folder.parent / "scene"
    own = files.source_files(folder)
    return [*own, *filter(Path.exists, (scene / "impacts.py", scene / "parameters.py"))]


@lru_cache(maxsize=1)
def checksum() -> int:
    """Return the checksum of `sources`."""
    return zlib.crc32(b"".join(f.read_bytes() for f in sources()))


def compile_beside(folder: Path, modules: tuple[str, ...]) -> None:
    """Start to compile modules in separate processes, unless marks in `folder` say that this was done.

    Raises:
        OSError: a process cannot be started.
    """
    if not Path(__file__).exists():
        # Numba stores nothing for a package in a wheel, and another process would compile for nothing.
        return
    # Numba's cache belongs to one installation, or is the folder that the environment variable names.
    version, chosen = str(checksum()), os.environ.get("NUMBA_CACHE_DIR")
    store = Path(chosen).absolute() if chosen else Path(__file__).parent / "__pycache__"
    try:
        if chosen or os.access(store, os.W_OK):
            files.check_own(store)
    except OSError as error:
        # Without a writable cache, another process would compile for nothing.
        return files.say_unkept(error)
    for module in modules:
        # The mark belongs to this installation, this Python and this cache.
        place = f"{module} {Path(__file__)} {sys.version} {chosen}"
        mark = folder / f"compiled-{zlib.crc32(os.fsencode(place)):08x}"
        mark_text = mark.read_text(encoding="utf-8") if mark.exists() else ""
        if mark_text == version or module in _running or module in sys.modules:
            continue
        if mark_text:
            warnings.warn(f"code in {store} belongs to another version and is compiled again", stacklevel=2)
        messages = tempfile.TemporaryFile()  # noqa: SIM115
        atexit.register(messages.close)
        process = subprocess.Popen(
            # -P keeps the current folder out of the import path, because it may contain another `tpd`.
            [sys.executable, "-P", "-c", _COMMAND, str(mark), module, version],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=messages,
            # A separate session: Ctrl-C only reaches the command, and the compiling process ends with the
            # command.
            start_new_session=True,
        )
        assert process.stdin is not None
        atexit.register(process.stdin.close)
        _running[module] = process, messages


def load(module: str) -> None:
    """Import a module with compiled code. If another process compiles it, wait for that process.

    Messages of that process, for example about damaged code in the cache, are repeated as warnings.
    """
    process, messages = _running.get(module, (None, None))
    if process:
        process.wait()
    # If several threads wait, only one of them repeats the messages.
    if messages and _running.pop(module, None):
        messages.seek(0)
        for line in messages.read().decode(errors="replace").splitlines():
            warnings.warn(line, stacklevel=2)
    # If another thread is importing the module, this waits for it.
    import_module(module)
