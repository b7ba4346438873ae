"""Output files: an existing directory is not overwritten without permission, and a file is complete or
absent."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import json
import math
import os
import platform
import re
import stat
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_OWN = ".tpd-"
"""Prefix of the names of hidden files, which do not count as results."""
_PART, _LIST = f"{_OWN}part-", f"{_OWN}files"
"""Prefix of the names of files that are being written, and which a killed run leaves. Name of the list of the
files of results in a folder, with their checksums."""
REPORT = "design.json"
"""Main file of a report of `tpd optimise`."""
_FORMULA = tuple("=+-@\t\r")
"""First characters of a text that a spreadsheet evaluates."""
_MOST_NAMES = 9
"""Largest number of files that a message lists."""
_WARNINGS: set[str] = set()
"""Reasons why compiled code is not stored, of which the user was warned already."""
PACKAGES = ("jax", "jaxlib", "diffrax", "optax", "equinox", "numpy", "numba")
"""Packages whose versions are stored with results."""


def claim(path: Path, *, overwrite: bool, is_file: bool = False) -> None:
    """Check before any work that results can be written into a folder, or into the file of --out.

    Raises:
        ValueError: the path exists and may not be overwritten, is of the other kind, or cannot be written.
    """
    try:
        nearest = next(x for x in (path, *path.parents) if _exists(x))
        # The system rejects a name that is too long only in a folder that exists.
        for name in path.parts if nearest != path else ():
            _exists(nearest / name)
        if nearest == path and is_file == path.is_dir():
            if is_file:
                raise ValueError(f"--out must name a file, but {path} is a directory")
            raise ValueError(f"cannot write the report: {path} is a file, not a directory")
        if nearest == path and not overwrite:
            if is_file or any(_visible(path)):
                raise _exists_error(path, is_file)
            # The user has removed the files of an earlier result.
            (path / _LIST).unlink(missing_ok=True)
        # Folders are created when the results are written: invalid input leaves no folder behind.
        with tempfile.TemporaryFile(dir=path.parent if is_file and nearest == path else nearest) as file:
            # Write a byte, because a full disk may still accept the name of a file.
            file.write(b" ")
    except OSError as error:
        raise ValueError(f"cannot write to {path}: {error.strerror or error}") from None


def _exists(path: Path) -> bool:
    """Whether a file, a folder or a link has this name; raise `OSError` if nothing can have it."""
    # Other tests of paths hide errors such as a name that is too long, each version of Python different ones.
    with contextlib.suppress(FileNotFoundError):
        path.lstat()
        return True
    return False


def _exists_error(path: Path, is_file: bool) -> ValueError:
    """Return the error for a file, or a folder with files, that may not be overwritten."""
    what, other = ("exists already", "name") if is_file else ("already contains files", "directory")
    return ValueError(f"{path} {what}: choose another {other} with --out, or pass --overwrite")


def _visible(folder: Path) -> list[str]:
    """Return the names in a folder, without the hidden files of this package."""
    return sorted(p.name for p in folder.glob("*") if not p.name.startswith(_OWN))


def path_of(name: str | os.PathLike[str]) -> Path:
    """Return the path of a file or folder from its name. A leading ~ is the home directory of the user.

    Raises:
        ValueError: the argument is neither a string nor a path, is empty, or has control characters.
    """
    text = os.fsdecode(name) if isinstance(name, (str, os.PathLike)) else ""
    # A file with such a name may exist.
    if not text or (re.search(r"[\x00-\x1f]", text) and not os.path.lexists(text)):
        hint = "; in a job file, write a path with backslashes in single quotes" if text else ""
        raise ValueError(f"`path` must name a file, but is {name!r}{hint}")
    # Encode the characters as the file system of this process expects them.
    return Path(os.fsdecode(os.path.expanduser(name).encode("utf-8", "surrogateescape")))


def readable(text: str) -> str:
    """Return a text with the characters of file names.

    If the locale does not have a character, Python represents its bytes by surrogates, which cannot be
    written to a file.
    """
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "surrogateescape")


def label_of(path: Path) -> str:
    """Return the name of a file in one line, for messages and tables."""
    return re.sub(r"[\x00-\x1f\x7f]+", " ", path.name or str(path))


def source_files(folder: Path) -> list[Path]:
    """Return the Python files in a folder of this package, or the wheel that contains the folder."""
    return sorted(folder.rglob("*.py")) or [next(path for path in folder.parents if path.is_file())]


def place(path: Path, content: str | bytes, of: str = "", *, overwrite: bool = True) -> Path:
    """Write a file, and create its directory, so that the file appears completely or not at all; return
    `path`.

    Args:
        path: the file.
        content: text or bytes.
        of: main file of the result to which the file belongs. A folder of results then lists the file.
        overwrite: whether to replace a file, which may have appeared since `claim`.

    Raises:
        ValueError: the file exists and may not be replaced.
        OSError: the file cannot be written; the error contains `path`. No new folder is left behind.
    """
    data = readable(content).encode(errors="replace") if isinstance(content, str) else content
    made, listed = [folder for folder in path.parents if not folder.exists()], path.parent / _LIST
    try:
        if of and listed.exists():
            entry = {path.name: [of, hashlib.sha256(data).hexdigest()]}
            place(listed, as_json(_listed(path.parent) | entry))
        # If a file has the name of the folder, the next statement finds that it is no directory.
        with contextlib.suppress(FileExistsError):
            path.parent.mkdir(parents=True, exist_ok=True)
        # A rename within one directory is atomic, so an interrupted run leaves no incomplete file.
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=_PART)
        try:
            with open(handle, "wb") as file:
                file.write(data)
            # Temporary files are readable only by their owner, so change the mode.
            Path(name).chmod(0o644)
            if not overwrite:
                try:
                    # Of several processes only one can create the file.
                    path.touch(exist_ok=False)
                except FileExistsError:
                    raise _exists_error(path.parent if path == listed else path, path != listed) from None
            Path(name).replace(path)
        except BaseException:
            _remove([Path(name)])
            raise
    except OSError as error:
        _remove(made)
        # The error of the system contains the name of the temporary file, or no name.
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None
    return path


def _remove(paths: Iterable[Path]) -> None:
    """Remove files, and folders that are empty, as far as possible."""
    for path in paths:
        with contextlib.suppress(OSError):
            path.rmdir() if path.is_dir() else path.unlink()


def _listed(folder: Path) -> dict[str, list[str]]:
    """Return the listed files of a folder: main file of the result and checksum of the file, by name."""
    try:
        listed = json.loads((folder / _LIST).read_bytes())
        return {name: [str(of), str(digest)] for name, (of, digest) in listed.items()}
    except (OSError, ValueError, TypeError, AttributeError, RecursionError):
        # Without a list that can be read, all files in the folder are foreign.
        return {}


class Results:
    """Files of one result in a folder. They replace those of an earlier result of the same kind.

    Files of the earlier result are removed first if they are as they were written. Files that were changed,
    files of other results, and files of other programs remain unless the new result has a file of that name.
    `remaining` names them.
    """

    def __init__(self, folder: Path, main: str, *, overwrite: bool) -> None:
        """Remove the files of the earlier result.

        Args:
            folder: folder of the results.
            main: name of the main file, which distinguishes the results of different commands.
            overwrite: whether the folder may contain files, which may have appeared since `claim`.

        Raises:
            ValueError: the folder contains files, or another process is writing its results there.
        """
        self._folder, self._main, self._names = folder, main, list[str]()
        self._made = [path for path in (folder / _LIST, folder, *folder.parents) if not path.exists()]
        if not overwrite:
            place(folder / _LIST, as_json({}), overwrite=False)
            if any(_visible(folder)):
                _remove([folder / _LIST])
                raise _exists_error(folder, is_file=False)
        listed = _listed(folder)
        for name, (of, digest) in listed.items():
            # The name must not contain a folder: a list from elsewhere must not lead out of this one.
            path = folder / Path(name).name
            if of == main and path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == digest:
                path.unlink()
        place(folder / _LIST, as_json({name: entry for name, entry in listed.items() if entry[0] != main}))

    def place(self, name: str, content: str | bytes) -> Path:
        """Write a file of the result and return its path.

        Raises:
            OSError: the file cannot be written. All files of the result are removed, also their folder if it
                is new.
        """
        self._names.append(name)
        try:
            return place(self._folder / name, content, self._main)
        except OSError:
            _remove([*(self._folder / name for name in self._names), *self._made])
            raise

    def draw(self, name: str, function: Callable[[], bytes], warn: Callable[[str], Any]) -> bytes | None:
        """Write a picture and return its content; None if it cannot be drawn, after a call of `warn`."""
        try:
            content = function()
        # Matplotlib raises errors of many classes, for example for a missing font or a missing LaTeX, and a
        # missing picture must not cost the other results.
        except Exception as error:
            # A message may begin with an empty line.
            reason = next((x for x in str(error).splitlines() if x.strip()), type(error).__name__)
            warn(f"{name} is not drawn: {reason}")
            return None
        self.place(name, content)
        return content

    @property
    def remaining(self) -> str:
        """Sentence on the files in the folder that do not belong to this result; empty if there are none."""
        names = [name for name in _visible(self._folder) if name not in self._names]
        more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
        listed = f"{', '.join(names[:_MOST_NAMES])}{more}"
        return f"{self._folder} also contains files that are not of this run: {listed}" if names else ""


def say_damaged(what: str, where: Path, then: str) -> None:
    """Warn that stored files are damaged, and how they are replaced."""
    warnings.warn(f"{what} in {where} were damaged, and are {then} again", stacklevel=2)


def check_own(folder: Path) -> None:
    """Check that only the user of this process can write to a folder of compiled code.

    Code in this folder is executed without a check. The folder is created if it does not exist.

    Raises:
        OSError: the folder cannot be written to, or other users can write to it.
    """
    other = "set other folders with NUMBA_CACHE_DIR and JAX_COMPILATION_CACHE_DIR"
    if not folder.is_absolute():
        raise OSError(f"there is no home directory for {folder}; {other}")
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            about = folder.stat()
    except OSError as error:
        raise OSError(f"{folder} cannot be written to ({error.strerror}); {other}") from None
    if not hasattr(os, "getuid"):  # Windows
        return
    # Check only the folder itself: a user who replaces it through its parents would be the owner of the new
    # folder.
    if about.st_uid != os.getuid():
        raise OSError(f"{folder} belongs to another user; {other}")
    # A group with the same number as the owner has no other members.
    others = stat.S_IWOTH | (stat.S_IWGRP if about.st_gid != about.st_uid else 0)
    if about.st_mode & others:
        raise OSError(f"other users can write to {folder}; run `chmod go-w {folder}`, or {other}")


def say_unkept(why: Exception) -> None:
    """Warn once for each reason that compiled code is not stored, with the reason and a remedy."""
    if str(why) not in _WARNINGS:
        _WARNINGS.add(str(why))
        warnings.warn(f"compiled code is not stored, so every run compiles it: {why}", stacklevel=3)


@contextlib.contextmanager
def file_lock(path: Path) -> Iterator[None]:
    """Hold the lock of a file, if the system supports it. The file is created if it does not exist.

    Raises:
        OSError: the file cannot be opened for writing.
    """
    with path.open("ab") as file:
        if fcntl is not None:
            with contextlib.suppress(OSError):
                fcntl.flock(file, fcntl.LOCK_EX)
        yield


def as_json(content: Any) -> str:
    """Format as JSON with sorted keys. Infinities and NaN become the words "infinite", "-infinite" and
    "nan"."""
    return json.dumps(_finite(content), indent=1, sort_keys=True, allow_nan=False) + "\n"


def as_csv(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Format a table with a header as CSV, with all digits of the numbers.

    NaN becomes an empty cell, and a list becomes its items with semicolons between them. A text that a
    spreadsheet would evaluate as a formula begins with an apostrophe.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        # Every program reads an empty cell as a missing value, but not a word such as "nan".
        cells = ("; ".join(map(str, x)) if isinstance(x, (list, tuple)) else x for x in row)
        cells = (f"'{x}" if isinstance(x, str) and x[:1] in _FORMULA else x for x in cells)
        writer.writerow(["" if x != x else x for x in cells])
    return text.getvalue()


def as_table(columns: Mapping[str, Any]) -> str:
    """Format arrays of one length, by their names, as CSV, see `as_csv`."""
    return as_csv(columns, zip(*(column.tolist() for column in columns.values()), strict=True))


def versions() -> dict[str, str]:
    """Return the versions of Python, of this package and of the packages that results depend on, by name."""
    # Use the version in the module, because the metadata of an installation can be older. The package is not
    # imported here, which would be circular.
    own = {"python": platform.python_version(), "tpd": sys.modules["tpd"].__version__}
    return own | {name: _version(name) for name in PACKAGES}


@lru_cache
def _version(name: str) -> str:
    """Return the version of an installed package. Reading it takes 4 ms."""
    # This import takes as long as all other modules of `tpd --help` together.
    from importlib.metadata import version

    return version(name)


def today() -> str:
    """Return the date in UTC, such as 2026-11-23.

    The date is that of `SOURCE_DATE_EPOCH` (seconds) if this variable is set, else that of the clock.

    Raises:
        ValueError: `SOURCE_DATE_EPOCH` is not a number of seconds.
    """
    written = os.environ.get("SOURCE_DATE_EPOCH")
    try:
        seconds = time.time() if written is None else int(written)
        return datetime.fromtimestamp(seconds, UTC).date().isoformat()
    except (ValueError, OverflowError, OSError):
        allowed = "a whole number of seconds since 1970"
        raise ValueError(f"`SOURCE_DATE_EPOCH` must be {allowed}, but is {written!r}") from None


def _finite(value: Any) -> Any:
    """Replace infinities and NaN, which JSON does not have, by words, and make names of files readable."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    if isinstance(value, str):
        return readable(value)
    if isinstance(value, float) and not math.isfinite(value):
        # Both signs of infinity are kept: the lower end of an unknown interval must not look like the upper
        # end.
        return {math.inf: "infinite", -math.inf: "-infinite"}.get(value, "nan")
    return value
