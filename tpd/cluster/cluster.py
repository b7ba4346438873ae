"""Batches on many processes or machines with Dask. Each finished chunk is stored in a file.

The division into chunks depends only on the batch, and one process computes each chunk from the same inputs.
The result therefore depends neither on the number of workers nor on the loss of workers: Dask gives the chunk
of a lost worker to another one. If a batch was stopped, it continues with the missing chunks. Only the caller
writes files, so workers need no common folder.
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

from tpd.core import checks, files, jax_setup
from tpd.core.batch import elements
from tpd.core.formatting import install
from tpd.core.progress import unreported

Results = dict[str, np.ndarray]
Task = Callable[..., Results]
"""Function at the top level of a module. Its arguments are the elements of a chunk and the shared arguments.
It returns arrays whose leading axis is that of the elements."""
_CHUNKS, _AHEAD, _DEATHS, _WAIT = 24, 3, 10, 30.0
"""Smallest number of chunks of a batch; number of chunks that wait at each worker, so that no worker is idle
while results are written; number of workers that may be lost during one chunk before the chunk is considered
the cause; seconds to wait for the first worker."""
# A terminal sends Ctrl-C to all of its processes. Only the caller reacts, and it then stops the workers.
_IGNORE_INTERRUPTS = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"


class ClusterError(RuntimeError):
    """Error of a batch that a cluster cannot compute, because workers, the scheduler or a chunk failed."""


class Cluster(contextlib.AbstractContextManager["Cluster"]):
    """Worker processes on this machine or a Dask cluster, with a folder for finished chunks.

    Use it as a context manager. The processes start with the first batch and end with the block. A script
    that starts processes must do so under `if __name__ == "__main__":`, as always with multiprocessing in
    Python. It needs Dask, the extra `dask`.

    Example:
        >>> import tempfile
        >>> import tpd
        >>> # Functions such as tpd.outcomes have an argument `cluster`.
        >>> with tpd.Cluster(tempfile.mkdtemp(), workers=2) as cluster:
        ...     cluster.workers
        2
    """

    def __init__(
        self, folder: Path | str, *, workers: checks.Whole | None = None, dask: str | None = None
    ) -> None:
        """Prepare a cluster. No process is started before the first batch.

        Args:
            folder: folder for finished chunks. A repeated batch continues with the stored chunks. The folder
                can contain chunks of several batches.
            workers: number of processes on this machine; all cores by default.
            dask: address of a Dask scheduler, such as tcp://host:8786, instead of `workers`. Its workers
                need the same version of this package. JAX is set to 64 bits in them.

        Raises:
            ValueError: `workers` and `dask` together, `workers` below one, an invalid address, or Dask is not
                installed.
        """
        checks.instance("folder", folder, (Path, str))
        checks.optional("dask", dask, str)
        place = files.path_of(folder)
        if place.exists() and not place.is_dir():
            raise ValueError(f"`folder` must be a folder, but is {checks.quote(str(folder))}")
        if workers is not None and dask is not None:
            raise ValueError("`workers` and `dask` exclude one another, but both are given")
        if workers is not None:
            workers = checks.count("workers", workers)
        if dask is not None and not re.fullmatch(r"(\w+://)?[^:/\s]+:\d+|(tcp|tls)://\[.+\]:\d+", dask):
            # Dask itself rejects such an address only after a minute.
            raise ValueError(f"`dask` must be an address such as tcp://host:8786, but is {dask!r}")
        try:
            # Dask is an optional dependency, and only clusters import it.
            import distributed
            from dask.config import set as settings
        except ModuleNotFoundError:
            raise ValueError(f"a cluster needs Dask: {install('dask')}") from None
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
        """Compute `task` for every chunk of a batch, and return the joined arrays by name.

        Args:
            name: name of the batch, which is a part of the name of its folder.
            task: function to compute, see `tpd.cluster.cluster.Task`.
            batch: pytree of arrays with the same leading axis. Single numbers belong to every element.
            shared: further arguments of `task`, which are sent only once.
            chunk: largest number of elements of a chunk. A short batch has smaller chunks.
            progress: function that is called with (number of finished elements, number of all elements) after
                each chunk.

        Raises:
            ValueError: a folder that cannot be used, a cluster that cannot be reached, or inputs or a task
                that have no fingerprint.
            ClusterError: workers of another version, no worker, a lost scheduler, or too many lost workers.
                An error in the task itself is raised unchanged.
        """
        part_of, length = elements(batch)
        # A short batch is divided into at least `_CHUNKS` chunks, so that all workers have work.
        chunk = min(chunk, -(-length // _CHUNKS))
        try:
            # The fingerprint covers everything on which the results depend.
            key = fingerprint(environment_fingerprint(), *_source(task), chunk, part_of(slice(None)), shared)
        except TypeError as error:
            raise ValueError(f"these inputs cannot be computed on a cluster: {error}") from None
        folder, starts = self.folder / f"{name}-{key[:16]}", range(0, length, chunk)
        try:
            results = stored(folder, key, len(starts))
        except OSError as error:
            raise ValueError(f"cannot use {folder} for the chunks of a batch: {error}") from None
        report, sizes = progress or unreported, [min(chunk, length - a) for a in starts]
        if results:
            report(sum(sizes[i] for i in results), length)
        # Only missing chunks are computed.
        parts = {i: part_of(slice(a, a + chunk)) for i, a in enumerate(starts) if i not in results}
        # If all chunks are stored already, no process is started.
        for i, arrays in self._computed(task, shared, parts) if parts else ():
            store(folder, key, i, arrays)
            results[i] = arrays
            report(sum(sizes[i] for i in results), length)
        return {x: np.concatenate([results[i][x] for i in range(len(sizes))]) for x in results[0]}

    def _computed(self, task: Task, shared: Any, parts: dict[int, Any]) -> Iterator[tuple[int, Results]]:
        """Yield number and results of the chunks, in the order in which they finish."""
        # Dask's own pickle module also handles functions of the main script.
        client, pickle, version = self.client, self._distributed.protocol.pickle, environment_fingerprint()
        try:
            client.wait_for_workers(1, timeout=_WAIT)
        except TimeoutError:
            wait = f"{_WAIT:.0f} s: start one by `dask worker`"
            raise ClusterError(f"the cluster has had no worker for {wait}") from None
        # `pure=False` makes each submission a new one. Otherwise Dask would return the failure of an earlier
        # submission. The shared arguments are the result of a submission as well, so that Dask computes them
        # again if their worker is lost.
        queue, rest = self._distributed.as_completed(loop=client.loop), iter(parts.items())
        try:
            with self._settings({"distributed.admin.large-graph-warning-threshold": "1 TiB"}):
                # Dask warns of large arguments, which are intended here.
                common = client.submit(bytes, pickle.dumps((task, shared)), pure=False)
            while True:
                # Workers may have joined since the last chunk.
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
            wrong = f"the scheduler of the cluster is lost ({error})"
            raise ClusterError(f"{wrong}; the finished chunks are stored") from None
        finally:
            # Chunks that are still waiting are cancelled, also if the caller stops this generator.
            queue.clear()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes that this object has started. An external cluster continues."""
        for opened in (self._client, self._local):
            # A lost connection cannot be closed.
            with contextlib.suppress(OSError):
                if opened is not None:
                    opened.close()
        self._client = self._local = None

    @property
    def client(self) -> Any:
        """Dask client. The first use connects to the scheduler, or starts the local processes.

        Raises:
            ValueError: no scheduler answers at the address.
        """
        if self._client is None:
            with self._settings({"distributed.scheduler.allowed-failures": _DEATHS}):
                if self.dask is None:
                    settings = {"threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
                    # After Ctrl-C a process would log, with tracebacks, that it has lost the other processes.
                    # Failures of the work are raised as errors anyway.
                    settings |= {"silence_logs": logging.CRITICAL, "preload": [_IGNORE_INTERRUPTS]}
                    self._local = self._distributed.LocalCluster(n_workers=self.workers, **settings)
                try:
                    self._client = self._distributed.Client(self._local or self.dask, set_as_default=False)
                except (OSError, ValueError) as error:
                    if self.dask is None:
                        raise
                    raise ValueError(f"the Dask scheduler at {self.dask} does not answer: {error}") from None
        return self._client


def _compute(version: str, common: bytes, part: bytes) -> tuple[int, Results]:
    """Compute a chunk in a worker, and return its number and results.

    Raises:
        ClusterError: the worker has another environment and would compute other digits.
    """
    from distributed.protocol import pickle

    if environment_fingerprint() != version:
        what = "Python, tpd or its packages: install the same"
        raise ClusterError(f"a worker of the cluster has another version of {what}")
    # This must precede the next line: otherwise JAX would convert arrays to 32 bits when they are unpickled.
    jax_setup.use_64_bits()
    (task, shared), (number, own) = pickle.loads(common), pickle.loads(part)
    return number, {name: np.asarray(values) for name, values in task(own, *shared).items()}


def stored(folder: Path, key: str, count: int) -> dict[int, Results]:
    """Read the stored chunks of a batch with the fingerprint `key`, by their numbers from 0 to `count`.

    The function reports damaged files and leaves them out. It creates the folder if necessary.
    """
    folder.mkdir(parents=True, exist_ok=True)
    numbers = [i for i in range(count) if (folder / f"{i}.npz").exists()]
    # `unsealed` returns None for a file whose checksum is wrong, or that belongs to another batch.
    read = {i: files.unsealed((folder / f"{i}.npz").read_bytes(), f"{key} {i}") for i in numbers}
    sound = {i: dict(np.load(io.BytesIO(data))) for i, data in read.items() if data is not None}
    if len(sound) < len(numbers):
        files.say_damaged(f"{len(numbers) - len(sound)} chunks", folder, "computed")
    return sound


def store(folder: Path, key: str, number: int, results: Results) -> None:
    """Write a chunk to its file, behind a checksum that `stored` checks."""
    np.savez(data := io.BytesIO(), **results)  # type: ignore[arg-type]
    files.place(folder / f"{number}.npz", files.sealed(data.getvalue(), f"{key} {number}"))


def check_where(workers: object, cluster: object, progress: object = None) -> None:
    """Raise `ValueError` if an argument is not a number of threads, a cluster, or a function."""
    if workers is not None:
        checks.count("workers", workers)
    checks.optional("cluster", cluster, Cluster)
    checks.function("progress", progress)


def _source(task: Task) -> tuple[str, str]:
    """Return the full name of a task, and the source of its module if it does not belong to this package.

    Raises:
        ValueError: workers cannot import the function by its name.
    """
    module, name = getattr(task, "__module__", None), getattr(task, "__qualname__", "<locals>")
    if "<locals>" in name or "<lambda>" in name or module is None:
        raise ValueError("`task` must be a function at the top level of a module")
    try:
        # The source of this package is a part of the fingerprint anyway, see `source_fingerprint`.
        is_ours = module.startswith("tpd.")
        return f"{module}.{name}", "" if is_ours else inspect.getsource(inspect.getmodule(task) or task)
    except (OSError, TypeError):
        raise ValueError(f"`task` must be in a file, but {module}.{name} is not") from None


def fingerprint(*values: Any) -> str:
    """Return the hexadecimal SHA-256 of values: numbers, text, arrays, dataclasses, and containers of these.

    Raises:
        TypeError: an object of another kind, which has no unique description.
    """
    digest = hashlib.sha256()
    _add(digest, values)
    return digest.hexdigest()


@lru_cache(maxsize=1)
def source_fingerprint() -> str:
    """Return the fingerprint of the source of this package. Another version may compute other digits."""
    root = Path(__file__).parents[1]
    paths = {path: Path(os.path.relpath(path, root)).as_posix() for path in files.source_files(root)}
    return fingerprint([(name, path.read_bytes()) for path, name in paths.items()])


@lru_cache(maxsize=1)
def environment_fingerprint() -> str:
    """Return the fingerprint of the source of this package and of the versions of its dependencies."""
    return fingerprint(source_fingerprint(), files.versions())


def _add(digest: Any, value: Any) -> None:
    """Add a value to a digest.

    Type and length are added as well, so that different values cannot give the same bytes.
    """
    kind, content, parts = f"{type(value).__module__}.{type(value).__qualname__}", b"", []
    if isinstance(value, enum.Enum):
        # Name and class identify a member, whatever its value is.
        content = value.name.encode()
    elif isinstance(value, (str, bytes, bool, int, float, type(None), np.generic)):
        content = repr(value).encode()
    elif is_dataclass(value) and not isinstance(value, type):
        parts = [(f.name, getattr(value, f.name)) for f in fields(value)]
    elif isinstance(value, Mapping):
        parts = sorted(value.items())
    elif isinstance(value, (list, tuple)):
        parts = value
    elif hasattr(value, "__array__"):
        # Arrays of NumPy and JAX with the same numbers have the same fingerprint.
        array = np.asarray(value)
        kind, content = f"{array.dtype.str}{array.shape}", array.tobytes()
    else:
        raise TypeError(f"an object of the type {type(value).__name__} has no fingerprint")
    digest.update(f"{kind} {len(content)} {len(parts)};".encode() + content)
    for part in parts:
        _add(digest, part)
