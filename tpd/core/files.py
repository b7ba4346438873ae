"""Output files: a directory is not overwritten unless asked, and a file is complete or absent."""

from __future__ import annotations

import contextlib
import csv
import errno
import hashlib
import io
import json
import math
import os
import platform
import stat
import sys
import tempfile
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_PART = ".tpd-part-"
"""Begin of the names of files that are being written; what a killed run leaves of them counts as nothing."""
_SAID: set[str] = set()
"""Why compiled code is not kept, as far as it was said."""
PACKAGES = ("jax", "jaxlib", "diffrax", "optax", "equinox", "numpy", "numba")


def claim(directory: Path, *, overwrite: bool) -> None:
    """Check, before any work, that results can be written.

    Raises:
        ValueError: the directory exists and may not be overwritten, or cannot be written.
    """
    if os.path.lexists(directory) and not directory.is_dir():
        raise ValueError(f"cannot write the report: {directory} is a file, not a directory")
    strangers = (p for p in directory.glob("*") if not p.name.startswith(_PART))
    if not overwrite and any(strangers):
        raise ValueError(
            f"{directory} already holds files: choose another directory with --out, or pass --overwrite"
        )
    try:
        make_folder(directory.parent)
        with tempfile.TemporaryFile(dir=directory if directory.exists() else directory.parent) as file:
            # A full disk still has room for a name.
            file.write(b" ")
    except OSError as error:
        raise ValueError(f"cannot write to {directory}: {error.strerror or error}") from None


def path_of(name: str | os.PathLike[str]) -> Path:
    """Return the path that a name of a file or folder stands for; ~ at its beginning is the user's home.

    Raises:
        ValueError: neither a text nor a path.
    """
    if not isinstance(name, (str, os.PathLike)):
        raise ValueError(f"`path` must name a file, but is {name!r}")
    # The letters of a text file are encoded as the file system of this process expects them.
    return Path(os.fsdecode(os.path.expanduser(name).encode("utf-8", "surrogateescape")))


def readable(text: str) -> str:
    """Return text with the letters of file names. Where the locale does not know a letter, Python has its
    bytes in place of it, which no file can hold."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "surrogateescape")


def make_folder(folder: Path) -> None:
    """Make a folder, and those that it lies in, unless it exists.

    Raises:
        OSError: it cannot be made, or something else has its name.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder)) from None


def place(path: Path, content: str | bytes) -> Path:
    """Write a file, and its directory, so that it appears complete or not at all; return `path`.

    Raises:
        OSError: it cannot be written; the error names `path`.
    """
    data = readable(content).encode(errors="replace") if isinstance(content, str) else content
    try:
        make_folder(path.parent)
        # A rename within one directory is atomic: a run that is ended leaves no half-written file.
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=_PART)
        try:
            with open(handle, "wb") as file:
                file.write(data)
            # Temporary files are readable by their owner only.
            Path(name).chmod(0o644)
            Path(name).replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                Path(name).unlink()
            raise
    except OSError as error:
        # The system names the temporary file, or none.
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None
    return path


def missing_picture(name: str, error: Exception) -> str:
    """Return a sentence on a picture that cannot be drawn."""
    return f"{name} is not drawn: {next(iter(str(error).splitlines()), type(error).__name__)}"


def sealed(data: bytes, of: str = "") -> bytes:
    """Return data behind the checksum (SHA-256) of them and of what they belong to; see `unsealed`."""
    return hashlib.sha256(of.encode() + data).digest() + data


def unsealed(content: bytes, of: str = "") -> bytes | None:
    """Return the data of `sealed`; None where these are not the bytes that were written for `of`."""
    data = content[32:]
    return data if sealed(data, of) == content else None


def say_damaged(what: str, where: Path, then: str) -> None:
    """Warn that stored files are not as they were written, and say what is done about it."""
    warnings.warn(f"{what} in {where} were damaged, and are {then} again", stacklevel=2)


def check_own(folder: Path) -> None:
    """Check that only the user of this process can write to a folder of compiled code, which is executed as
    it is found there. The folder is made if it does not exist.

    Raises:
        OSError: the folder cannot be written to, or other users can write to it.
    """
    other = "name other folders by NUMBA_CACHE_DIR and JAX_COMPILATION_CACHE_DIR"
    if not folder.is_absolute():
        raise OSError(f"there is no home for {folder}; {other}")
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            about = folder.stat()
    except OSError as error:
        raise OSError(f"{folder} cannot be written to ({error.strerror}); {other}") from None
    if not hasattr(os, "getuid"):  # Windows
        return
    # Whoever could replace the folder by way of its parents would be the owner of the new one.
    if about.st_uid != os.getuid():
        raise OSError(f"{folder} belongs to another user; {other}")
    # A group with the number of its owner has no other members.
    others = stat.S_IWOTH | (stat.S_IWGRP if about.st_gid != about.st_uid else 0)
    if about.st_mode & others:
        raise OSError(f"others may write to {folder}; `chmod go-w {folder}`, or {other}")


def say_unkept(why: Exception) -> None:
    """Warn, once for each reason, that compiled code is not kept, with the reason and what to do about it."""
    if str(why) not in _SAID:
        _SAID.add(str(why))
        warnings.warn(f"compiled code is not kept, so that every run compiles anew: {why}", stacklevel=3)


@contextlib.contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the lock of a file, made if it does not exist, where the system has such locks.

    Raises:
        OSError: the file cannot be opened for writing.
    """
    with path.open("ab") as file:
        if fcntl is not None:
            with contextlib.suppress(OSError):
                fcntl.flock(file, fcntl.LOCK_EX)
        yield


def as_json(content: Any) -> str:
    """Format as JSON with sorted keys; infinities and NaN become words: "infinite", "-infinite" and
    "nan"."""
    return json.dumps(_finite(content), indent=1, sort_keys=True, allow_nan=False) + "\n"


def as_csv(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Format a table with a header as CSV, numbers with all digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def as_table(columns: Mapping[str, Any]) -> str:
    """Format arrays of one length, by their names, as CSV; cells are empty in place of NaN."""
    # An empty cell is read as missing by every program; a word such as "nan" is not.
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return as_csv(columns, (["" if x != x else x for x in row] for row in rows))


def versions() -> dict[str, str]:
    """Versions of Python, of this package and of the packages that results depend on, by name."""
    # Its own number: the metadata of an installation can be of an earlier one. No module imports the package.
    own = {"python": platform.python_version(), "tpd": sys.modules["tpd"].__version__}
    return own | {name: _version(name) for name in PACKAGES}


@lru_cache
def _version(name: str) -> str:
    """Version of an installed package; reading one takes 4 ms."""
    # This import takes as long as that of all other modules for `tpd --help`.
    from importlib.metadata import version

    return version(name)


def today() -> str:
    """Return the date in UTC, as in 2026-11-23: of `SOURCE_DATE_EPOCH` (seconds) if it is set, else of the
    clock.

    Raises:
        ValueError: a `SOURCE_DATE_EPOCH` that is no number of seconds.
    """
    written = os.environ.get("SOURCE_DATE_EPOCH")
    try:
        seconds = time.time() if written is None else int(written)
        return datetime.fromtimestamp(seconds, UTC).date().isoformat()
    except (ValueError, OverflowError, OSError):
        raise ValueError(
            f"`SOURCE_DATE_EPOCH` must be a whole number of seconds since 1970, but is {written!r}"
        ) from None


def _finite(value: Any) -> Any:
    """Replace infinities and NaN, for which JSON has no number, by words, and names of files by text."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if isinstance(value, str):
        return readable(value)
    if isinstance(value, float) and not math.isfinite(value):
        # The lower end of an unknown interval must not read as the upper one.
        return {math.inf: "infinite", -math.inf: "-infinite"}.get(value, "nan")
    return value
