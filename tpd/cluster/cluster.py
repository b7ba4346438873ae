"""Batches on many processes or machines, with Dask: the chunks are stored as they finish.

The batch is cut into chunks whose bounds depend on the batch alone, and each chunk is computed by one process
from the same inputs. So the answer does not depend on the number of workers, nor on which of them are lost:
Dask gives the chunk of a lost worker to another one, and a batch that was stopped goes on with the chunks
that are missing. One process, that of the caller, writes: no chunk is stored twice, and workers need no
common folder.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import re
import uuid
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from tpd.cluster.chunk_store import ChunkStore, zarr
from tpd.core import checks
from tpd.core.fingerprints import fingerprint, of_environment

Task = Callable[..., dict[str, np.ndarray]]
"""Function at the top level of a module: of the elements of a chunk and of what all chunks share, to arrays
whose leading axis is the elements."""

_AHEAD = 3
"""Chunks that wait at every worker, so that none is idle while results are written."""
_CHUNKS = 24
"""Chunks that a batch should have at least."""
_DEATHS = 10
"""Workers that may be lost over one chunk: after more of them the chunk is probably the cause."""
_WAIT = 30.0
"""Seconds in which a first worker must be there."""


class ClusterError(RuntimeError):
    """A batch that a cluster cannot compute: its workers, its scheduler or a chunk failed."""


class Cluster:
    """Worker processes on this machine, or a Dask cluster, and the folder in which chunks are stored.

    A context manager: the processes begin with the first batch and end with the block. A script that starts
    processes must do so under `if __name__ == "__main__":`, as always with Python's multiprocessing.
    """

    def __init__(self, folder: Path | str, *, workers: int | None = None, dask: str | None = None) -> None:
        """Nothing is started yet.

        Args:
            folder: for chunks and manifests. The same batch goes on from what is there; other batches lie
                beside it.
            workers: processes on this machine; default the number of cores.
            dask: address of a Dask scheduler, such as tcp://host:8786, in place of `workers`. Its workers
                need the same version of this package; JAX is set to 64 bits in them.

        Raises:
            ValueError: both, workers below one, what is no address, or Dask or Zarr are not installed.
        """
        checks.instance("folder", folder, (Path, str))
        checks.optional("dask", dask, str)
        if not str(folder) or (Path(folder).exists() and not Path(folder).is_dir()):
            raise ValueError(f"`folder` must be a folder, but is {checks.shown(str(folder))}")
        if workers is not None and dask is not None:
            raise ValueError("`workers` and `dask` exclude one another, but both are given")
        if workers is not None:
            checks.count("workers", workers)
        if dask is not None and not re.fullmatch(r"(\w+://)?[^:/\s]+:\d+|(tcp|tls)://\[.+\]:\d+", dask):
            # Dask itself answers after a minute.
            raise ValueError(f"`dask` must be an address such as tcp://host:8786, but is {dask!r}")
        self.folder, self.dask = Path(folder), dask
        self.workers = workers or os.cpu_count() or 1
        self._client: Any = None
        self._local: Any = None
        _distributed()

    def map(
        self,
        name: str,
        task: Task,
        batch: Any,
        shared: tuple[Any, ...] = (),
        *,
        chunk: int,
        progress: Callable[[int, int], None] | None = None,
    ) -> dict[str, np.ndarray]:
        """`task` of every chunk of a batch, put together.

        Args:
            name: of the batch, for its folder.
            task: see `Task`.
            batch: pytree of arrays with one leading axis; single numbers belong to every element.
            shared: further arguments of `task`, sent once to every worker.
            chunk: most elements of a chunk; a short batch has shorter ones.
            progress: called with (elements done, of how many) after each chunk.

        Returns:
            The arrays of all chunks, by name.

        Raises:
            ValueError: a folder that cannot be used, a cluster that cannot be reached, or inputs or a task
                that cannot be told from others.
            ClusterError: workers of another version, a scheduler or too many workers that are lost. An
                error of the task itself is raised as it is.
        """
        part_of, length = _parts(batch)
        chunk = min(chunk, -(-length // _CHUNKS))
        source, text = _source(task)
        try:
            key = fingerprint(of_environment(), source, text, chunk, part_of(0, length), shared)
        except TypeError as error:
            raise ValueError(f"these inputs cannot be computed on a cluster: {error}") from None
        about = {"of": name, "task": source, "fingerprint": key}
        store = ChunkStore(self.folder / f"{name}-{key[:16]}", length, chunk, about)
        missing = store.missing()
        done = length - sum(b - a for a, b in map(store.bounds, missing))
        if progress is not None and done:
            progress(done, length)
        # Nothing is started for a batch that is there already.
        if missing:
            for number, results in self._computed(task, shared, part_of, store, missing):
                store.write(number, results)
                first, last = store.bounds(number)
                done += last - first
                if progress is not None:
                    progress(done, length)
        return store.read()

    def __enter__(self) -> Cluster:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the processes that were started; an external cluster is not stopped."""
        for opened in (self._client, self._local):
            if opened is not None:
                # A connection that is lost cannot be closed.
                with contextlib.suppress(OSError):
                    opened.close()
        self._client = self._local = None

    @property
    def client(self) -> Any:
        """Dask's client; connected, and local processes started, on first use.

        Raises:
            ValueError: nobody answers at the address.
        """
        if self._client is None:
            dask, distributed = _distributed()
            settings = {"distributed.scheduler.allowed-failures": _DEATHS}
            with dask.config.set(settings):
                try:
                    where = self._started(distributed) if self.dask is None else self.dask
                    self._client = distributed.Client(where, set_as_default=False)
                except (OSError, ValueError) as error:
                    if self.dask is None:
                        raise
                    raise ValueError(f"no Dask scheduler answers at {self.dask}: {error}") from None
        return self._client

    def _started(self, distributed: Any) -> Any:
        """Processes on this machine, with one thread each."""
        self._local = distributed.LocalCluster(
            n_workers=self.workers,
            threads_per_worker=1,
            dashboard_address="127.0.0.1:0",
            silence_logs="ERROR",
        )
        return self._local

    def _computed(
        self,
        task: Task,
        shared: tuple[Any, ...],
        part_of: Callable[[int, int], Any],
        store: ChunkStore,
        missing: list[int],
    ) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
        """Results of chunks in the order in which they finish."""
        _, distributed = _distributed()
        client = self.client
        # Not the fingerprint: another caller may have the same batch on the same cluster.
        key = uuid.uuid4().hex
        try:
            self._prepare(key, shared)
            yield from self._streamed(key, task, part_of, store, missing)
        except distributed.KilledWorker as error:
            raise ClusterError(f"too many workers were lost over one chunk: {error}") from None
        except (CancelledError, distributed.comm.CommClosedError) as error:
            self.close()
            raise ClusterError(
                f"the scheduler of the cluster is lost ({error}); the finished chunks are stored"
            ) from None
        finally:
            with contextlib.suppress(Exception):
                client.unregister_worker_plugin(key)

    def _prepare(self, key: str, shared: tuple[Any, ...]) -> None:
        """Send every worker once what chunks share, also one that comes in place of another."""
        # Loaded here, and not with the package: it needs Dask.
        from tpd.cluster.worker import Prepared

        try:
            self.client.wait_for_workers(1, timeout=_WAIT)
        except TimeoutError:
            raise ClusterError(
                f"the cluster has had no worker for {_WAIT:.0f} s: start one by `dask worker`"
            ) from None
        prepared = Prepared(key, of_environment(), shared, local=self._local is not None)
        _persistently(lambda: self.client.register_plugin(prepared, name=key))

    def _streamed(
        self,
        key: str,
        task: Task,
        part_of: Callable[[int, int], Any],
        store: ChunkStore,
        missing: list[int],
    ) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
        """Submit a few chunks for each worker, and another one for each result."""
        _, distributed = _distributed()
        from tpd.cluster.worker import compute

        queue, waiting = distributed.as_completed(loop=self.client.loop), 0
        rest = iter(missing)

        def submit() -> int:
            # Workers may have joined since the last time.
            workers = len(self.client.scheduler_info(n_workers=-1)["workers"])
            sent = 0
            while waiting + sent < _AHEAD * max(1, workers) and (number := next(rest, None)) is not None:
                part = part_of(*store.bounds(number))
                # Every submission is a new one: Dask would give back the failure of a former run.
                queue.add(self.client.submit(compute, key, of_environment(), task, part, number, pure=False))
                sent += 1
            return sent

        try:
            waiting += submit()
            while waiting:
                future = next(queue)
                waiting -= 1
                waiting += submit()
                yield future.result()
        finally:
            queue.clear()


def check_where(workers: object, cluster: object, progress: object = None) -> None:
    """Raise `ValueError` unless work can be done by so many threads, or on a cluster, and reported so."""
    if workers is not None:
        checks.count("workers", workers)
    checks.optional("cluster", cluster, Cluster)
    checks.function("progress", progress)


def _persistently(ask: Callable[[], Any]) -> None:
    """Ask all workers, again where one of them was lost while it was asked."""
    for left in reversed(range(_DEATHS)):
        try:
            ask()
        except OSError:
            if not left:
                raise
        else:
            return


def _parts(batch: Any) -> tuple[Callable[[int, int], Any], int]:
    """Elements of a batch between two bounds, and how many there are."""
    import jax

    leaves, structure = jax.tree.flatten(batch)
    arrays = [np.asarray(x) for x in leaves]
    lengths = {len(x) for x in arrays if x.ndim}
    if len(lengths) != 1 or 0 in lengths:
        raise ValueError(
            f"`batch` must be arrays of one length above zero, but has lengths {sorted(lengths)}"
        )

    def part_of(first: int, last: int) -> Any:
        return jax.tree.unflatten(structure, [x[first:last] if x.ndim else x for x in arrays])

    return part_of, lengths.pop()


def _source(task: Task) -> tuple[str, str]:
    """Full name of a task, and the text of its module where that is not of this package.

    Raises:
        ValueError: a function that workers cannot import by its name.
    """
    module, name = getattr(task, "__module__", None), getattr(task, "__qualname__", "<locals>")
    if "<locals>" in name or "<lambda>" in name or module is None:
        raise ValueError("`task` must be a function at the top level of a module")
    own = module.startswith("tpd.")
    try:
        return f"{module}.{name}", "" if own else inspect.getsource(inspect.getmodule(task) or task)
    except (OSError, TypeError):
        raise ValueError(f"`task` must be in a file, but {module}.{name} is not") from None


def _distributed() -> tuple[Any, Any]:
    """Modules of Dask.

    Raises:
        ValueError: they are not installed.
    """
    try:
        import dask
        import distributed
    except ModuleNotFoundError:
        raise ValueError("a cluster needs Dask and Zarr: install `tpd[dask]`") from None
    zarr()
    return dask, distributed
