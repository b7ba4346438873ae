"""Results of a long batch in a folder, chunk by chunk, so that an interrupted batch goes on where it was.

Each result is one Zarr array with a file for each chunk. A chunk counts as done when its mark is there, which
is written after its results. Files appear whole or not at all, so that a process may be killed at any moment.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import files

_MANIFEST, _ARRAYS, _DONE = "manifest.json", "results.zarr", "done"


class ChunkStore:
    """Chunks of one batch: `chunk` elements each, the last one perhaps fewer."""

    def __init__(self, folder: Path, length: int, chunk: int, about: dict[str, Any]) -> None:
        """Open the folder of a batch, or make it.

        Args:
            folder: of this batch alone.
            length: elements of the batch.
            chunk: elements of a chunk.
            about: plain values for the manifest: what the results are of.

        Raises:
            ValueError: the folder holds something else, or cannot be written.
        """
        self.folder, self.length, self.chunk = folder, length, chunk
        self.count = -(-length // chunk)
        self._arrays: dict[str, Any] = {}
        expected = {"elements": length, "chunk": chunk, **about}
        try:
            if (folder / _MANIFEST).exists():
                found = json.loads((folder / _MANIFEST).read_text())
                same = {k: found.get(k) for k in expected} == json.loads(json.dumps(expected))
            else:
                same = True
                content = {**expected, "versions": files.versions(), "date": files.today()}
                files.place(folder / _MANIFEST, files.as_json(content))
        except (OSError, ValueError) as error:
            raise ValueError(f"cannot use {folder} for the chunks of a batch: {error}") from None
        if not same:
            raise ValueError(f"{folder} holds chunks of another batch: choose another folder")
        self._group = _zarr().open_group(folder / _ARRAYS, mode="a")
        # One file for each mark: a mark is never written twice.
        marks = {"shape": (self.count,), "chunks": (1,), "dtype": "uint8", "fill_value": 0}
        self._marks = self._group[_DONE] if _DONE in self._group else self._group.create_array(_DONE, **marks)

    def missing(self) -> list[int]:
        """Numbers of the chunks that are not done, in order."""
        return [int(i) for i in np.flatnonzero(np.asarray(self._marks[:]) == 0)]

    def bounds(self, number: int) -> tuple[int, int]:
        """First element of a chunk, and the one after its last."""
        return number * self.chunk, min((number + 1) * self.chunk, self.length)

    def write(self, number: int, results: dict[str, np.ndarray]) -> None:
        """Store the results of a chunk, arrays whose leading axis are its elements, and mark it as done."""
        first, last = self.bounds(number)
        for name, values in results.items():
            self._array(name, values)[first:last] = values
        self._marks[number] = 1

    def read(self) -> dict[str, np.ndarray]:
        """Results of all elements, by name.

        Raises:
            RuntimeError: a chunk is missing: its elements would be zeros.
        """
        if missing := self.missing():
            raise RuntimeError(f"{len(missing)} of {self.count} chunks are missing in {self.folder}")
        names = sorted(n for n in self._group.array_keys() if n != _DONE)
        return {name: np.asarray(self._group[name][:]) for name in names}

    def _array(self, name: str, values: np.ndarray) -> Any:
        """Array of a result, made when its first chunk is there, which tells its shape and type."""
        if name not in self._arrays:
            if name not in self._group:
                shape, inner = (self.length, *values.shape[1:]), (self.chunk, *values.shape[1:])
                self._group.create_array(name, shape=shape, chunks=inner, dtype=values.dtype)
            self._arrays[name] = self._group[name]
        return self._arrays[name]


def _zarr() -> Any:
    """Module that stores arrays.

    Raises:
        ValueError: it is not installed.
    """
    try:
        import zarr
    except ModuleNotFoundError:
        raise ValueError("a cluster needs Dask and Zarr: install `tpd[dask]`") from None
    return zarr
