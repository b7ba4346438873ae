"""Batches on many processes or machines, with Dask: a file for each chunk, written when it is finished.

The bounds of chunks depend on the batch alone, and one process computes each from the same inputs. So the
answer depends neither on the number of workers nor on which of them are lost: Dask gives the chunk of a lost
worker to another one. A batch that was stopped goes on with the missing chunks. Only the caller writes:
workers need no common folder.
"""

from __future__ import annotations

import contextlib
import enum
import hashlib
import inspect
import io
import logging
import os
import re
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import checks, files, process
from tpd.core.batch import elements
from tpd.core.progress import unreported

Results = dict[str, np.ndarray]
Task = Callable[..., Results]
"""Function at the top level of a module: of the elements of a chunk and of what all chunks share, to arrays
whose leading axis is the elements."""
_CHUNKS, _AHEAD, _DEATHS, _WAIT = 24, 3, 10, 30.0
"""Least chunks of a batch; chunks that wait at a worker, so that none is idle while results are written;
workers that may be lost over a chunk before it is taken for the cause; seconds to wait for a first worker."""
# A terminal sends Ctrl-C to all its processes; the caller answers it and ends these.
_DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"


class ClusterError(RuntimeError):
    """A batch that a cluster cannot compute: its workers, its scheduler or a chunk failed."""


class Cluster(contextlib.AbstractContextManager["Cluster"]):
    """Worker processes on this machine, or a Dask cluster, and the folder in which chunks are stored.

    A context manager: the processes begin with the first batch and end with the block. A script that starts
    processes must do so under `if __name__ == "__main__":`, as always with Python's multiprocessing.
    """

    def __init__(
        self, folder: Path | str, *, workers: checks.Whole | None = None, dask: str | None = None
    ) -> None:
        """Nothing is started yet.

        Args:
            folder: for chunks. The same batch goes on from what is there; other batches lie beside it.
            workers: processes on this machine; default the number of cores.
            dask: address of a Dask scheduler, such as tcp://host:8786, in place of `workers`. Its workers
                need the same version of this package; JAX is set to 64 bits in them.

        Raises `ValueError`: both, workers below one, what is no address, or Dask is not installed.
        """
        checks.instance("folder", folder, (Path, str))
        checks.optional("dask", dask, str)
        place = files.path_of(folder)
        if not str(folder) or (place.exists() and not place.is_dir()):
            raise ValueError(f"`folder` must be a folder, but is {checks.shown(str(folder))}")
        if workers is not None and dask is not None:
            raise ValueError("`workers` and `dask` exclude one another, but both are given")
        if workers is not None:
            workers = checks.count("workers", workers)
        if dask is not None and not re.fullmatch(r"(\w+://)?[^:/\s]+:\d+|(tcp|tls)://\[.+\]:\d+", dask):
            # Dask itself answers after a minute.
            raise ValueError(f"`dask` must be an address such as tcp://host:8786, but is {dask!r}")
        try:
            import distributed
            from dask.config import set as settings
        except ModuleNotFoundError:
            raise ValueError("a cluster needs Dask: install `tpd[dask]`") from None
        self.folder, self.workers, self.dask = place, workers or os.cpu_count() or 1, dask
        self._distributed: Any = distributed
        self._settings: Any = settings
        self._client: Any = None
        self._local: Any = None

    def map(
        self,
        name: str,
        task: Task,
        batch: Any,
        shared: tuple[Any, ...] = (),
        *,
        chunk: int,
        progress: Callable[[int, int], None] | None = None,
    ) -> Results:
        """`task` of every chunk of a batch, put together: arrays by name.

        Args:
            name: of the batch, for its folder.
            task: see `Task`.
            batch: pytree of arrays with one leading axis; single numbers belong to every element.
            shared: further arguments of `task`, sent once.
            chunk: most elements of a chunk; a short batch has shorter ones.
            progress: called with (elements done, of how many) after each chunk.

        Raises:
            ValueError: a folder that cannot be used, a cluster that cannot be reached, or inputs or a task
                that cannot be told from others.
            ClusterError: workers of another version, a scheduler or too many workers that are lost. An
                error of the task itself is raised as it is.
        """
        part_of, length = elements(batch)
        chunk = min(chunk, -(-length // _CHUNKS))
        try:
            key = fingerprint(of_environment(), *_source(task), chunk, part_of(slice(None)), shared)
        except TypeError as error:
            raise ValueError(f"these inputs cannot be computed on a cluster: {error}") from None
        folder, starts = self.folder / f"{name}-{key[:16]}", range(0, length, chunk)
        try:
            found = stored(folder, key, len(starts))
        except OSError as error:
            raise ValueError(f"cannot use {folder} for the chunks of a batch: {error}") from None
        report, sizes = progress or unreported, [min(chunk, length - a) for a in starts]
        if found:
            report(sum(sizes[i] for i in found), length)
        parts = {i: part_of(slice(a, a + chunk)) for i, a in enumerate(starts) if i not in found}
        # Nothing is started for a batch that is there already.
        for i, results in self._computed(task, shared, parts) if parts else ():
            store(folder, key, i, results)
            found[i] = results
            report(sum(sizes[i] for i in found), length)
        return {x: np.concatenate([found[i][x] for i in range(len(sizes))]) for x in found[0]}

    def _computed(self, task: Task, shared: Any, parts: dict[int, Any]) -> Iterator[tuple[int, Results]]:
        """Results of chunks in the order in which they finish."""
        client, pickle, version = self.client, self._distributed.protocol.pickle, of_environment()
        try:
            client.wait_for_workers(1, timeout=_WAIT)
        except TimeoutError:
            raise ClusterError(
                f"the cluster has had no worker for {_WAIT:.0f} s: start one by `dask worker`"
            ) from None
        # Every submission is a new one: Dask would give back the failure of a former run. What all chunks
        # share is the result of one as well, so that Dask makes it again where its worker is lost.
        queue, rest = self._distributed.as_completed(loop=client.loop), iter(parts.items())
        try:
            with self._settings({"distributed.admin.large-graph-warning-threshold": "1 TiB"}):
                common = client.submit(bytes, pickle.dumps((task, shared)), pure=False)
            while True:
                # Workers may have joined since the last time.
                workers = len(client.scheduler_info(n_workers=-1)["workers"])
                while queue.count() < _AHEAD * max(1, workers) and (part := next(rest, None)) is not None:
                    queue.add(client.submit(_compute, version, common, pickle.dumps(part), pure=False))
                if queue.is_empty():
                    return
                yield next(queue).result()
        except self._distributed.KilledWorker as error:
            raise ClusterError(f"too many workers were lost over one chunk: {error}") from None
        except (CancelledError, self._distributed.comm.CommClosedError) as error:
            self.close()
            raise ClusterError(
                f"the scheduler of the cluster is lost ({error}); the finished chunks are stored"
            ) from None
        finally:
            queue.clear()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes that were started; an external cluster is not stopped."""
        for opened in (self._client, self._local):
            # A connection that is lost cannot be closed.
            with contextlib.suppress(OSError):
                if opened is not None:
                    opened.close()
        self._client = self._local = None

    @property
    def client(self) -> Any:
        """Dask's client; connected, and local processes started, on first use.

        Raises:
            ValueError: nobody answers at the address.
        """
        if self._client is None:
            with self._settings({"distributed.scheduler.allowed-failures": _DEATHS}):
                if self.dask is None:
                    how = {"threads_per_worker": 1, "dashboard_address": "127.0.0.1:0", "preload": [_DEAF]}
                    # After Ctrl-C a process would log that it has lost the others, with tracebacks. Work that
                    # fails is an error here anyway.
                    how["silence_logs"] = logging.CRITICAL
                    self._local = self._distributed.LocalCluster(n_workers=self.workers, **how)
                try:
                    self._client = self._distributed.Client(self._local or self.dask, set_as_default=False)
                except (OSError, ValueError) as error:
                    if self.dask is None:
                        raise
                    raise ValueError(f"no Dask scheduler answers at {self.dask}: {error}") from None
        return self._client


def _compute(version: str, common: bytes, part: bytes) -> tuple[int, Results]:
    """Number and results of a chunk, in a worker; `ClusterError` where it would compute other digits."""
    from distributed.protocol import pickle

    if of_environment() != version:
        raise ClusterError(
            "a worker of the cluster has another version of Python, tpd or its packages: install the same"
        )
    # Before anything is unpickled: arrays of JAX would be cut to 32 bits.
    process.use_64_bits()
    (task, shared), (number, own) = pickle.loads(common), pickle.loads(part)
    return number, {name: np.asarray(values) for name, values in task(own, *shared).items()}


def stored(folder: Path, key: str, count: int) -> dict[int, Results]:
    """Chunks of the batch with a fingerprint, by number from 0 to `count`, as far as their files are as they
    were written; damaged ones are said. The folder is made where there is none."""
    folder.mkdir(parents=True, exist_ok=True)
    there = [i for i in range(count) if (folder / f"{i}.npz").exists()]
    read = {i: files.unsealed((folder / f"{i}.npz").read_bytes(), f"{key} {i}") for i in there}
    sound = {i: dict(np.load(io.BytesIO(data))) for i, data in read.items() if data is not None}
    if len(sound) < len(there):
        files.say_damaged(f"{len(there) - len(sound)} chunks", folder, "computed")
    return sound


def store(folder: Path, key: str, number: int, results: Results) -> None:
    """Write a chunk to its file, behind a checksum; see `stored`."""
    np.savez(data := io.BytesIO(), **results)  # type: ignore[arg-type]
    files.place(folder / f"{number}.npz", files.sealed(data.getvalue(), f"{key} {number}"))


def check_where(workers: object, cluster: object, progress: object = None) -> None:
    """Raise `ValueError` unless work can be done by so many threads, or on a cluster, and reported so."""
    if workers is not None:
        checks.count("workers", workers)
    checks.optional("cluster", cluster, Cluster)
    checks.function("progress", progress)


def _source(task: Task) -> tuple[str, str]:
    """Full name of a task, and the text of its module where that is not of this package; `ValueError` for a
    function that workers cannot import by its name."""
    module, name = getattr(task, "__module__", None), getattr(task, "__qualname__", "<locals>")
    if "<locals>" in name or "<lambda>" in name or module is None:
        raise ValueError("`task` must be a function at the top level of a module")
    try:
        own = module.startswith("tpd.")
        return f"{module}.{name}", "" if own else inspect.getsource(inspect.getmodule(task) or task)
    except (OSError, TypeError):
        raise ValueError(f"`task` must be in a file, but {module}.{name} is not") from None


def fingerprint(*values: Any) -> str:
    """Hexadecimal SHA-256 of values: numbers, text, arrays, dataclasses, and containers of these.

    Raises:
        TypeError: an object of any other kind, which no words tell from another one.
    """
    digest = hashlib.sha256()
    _add(digest, values)
    return digest.hexdigest()


@lru_cache(maxsize=1)
def of_sources() -> str:
    """Fingerprint of the source of this package: another version may compute other digits."""
    root = Path(__file__).parents[1]
    return fingerprint([(p.relative_to(root).as_posix(), p.read_bytes()) for p in sorted(root.rglob("*.py"))])


@lru_cache(maxsize=1)
def of_environment() -> str:
    """Fingerprint of the source of this package and of the versions that results depend on."""
    return fingerprint(of_sources(), files.versions())


def _add(digest: Any, value: Any) -> None:
    """Add a value, with its type and its length, so that no two values run into one another."""
    kind, own, parts = f"{type(value).__module__}.{type(value).__qualname__}", b"", []
    if isinstance(value, enum.Enum):
        own = value.name.encode()
    elif isinstance(value, (str, bytes, bool, int, float, type(None), np.generic)):
        own = repr(value).encode()
    elif is_dataclass(value) and not isinstance(value, type):
        parts = [(f.name, getattr(value, f.name)) for f in fields(value)]
    elif isinstance(value, Mapping):
        parts = sorted(value.items())
    elif isinstance(value, (list, tuple)):
        parts = value
    elif hasattr(value, "__array__"):
        array = np.asarray(value)
        kind, own = f"{array.dtype.str}{array.shape}", array.tobytes()
    else:
        raise TypeError(f"no fingerprint of a {type(value).__name__}")
    digest.update(f"{kind} {len(own)} {len(parts)};".encode() + own)
    for part in parts:
        _add(digest, part)
