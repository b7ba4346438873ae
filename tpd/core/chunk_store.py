"""Results of a long batch in a folder, chunk by chunk, so that an interrupted batch goes on where it was.

Each result is one Zarr array with a file for each chunk. A mark that is written after these files says that
the chunk is complete. Zarr describes and reads the arrays. The chunks are written here: without compression
they are nothing but their numbers, and Zarr's event loop takes some 3 ms of processor time for each.
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
        expected = {"elements": length, "chunk": chunk, **about}
        try:
            if (folder / _MANIFEST).exists():
                found = json.loads((folder / _MANIFEST).read_text())
                if not isinstance(found, dict):
                    raise ValueError("its manifest is no table")
                same = {k: found.get(k) for k in expected} == json.loads(json.dumps(expected))
            else:
                same = True
                content = {**expected, "versions": files.versions(), "date": files.today()}
                files.place(folder / _MANIFEST, files.as_json(content))
            self._group = zarr().open_group(folder / _ARRAYS, mode="a")
            self._arrays = {name: self._group[name] for name in self._group.array_keys()}
            if _DONE not in self._arrays:
                self._create(_DONE, (self.count,), (1,), np.dtype("uint8"))
        except (OSError, ValueError, KeyError) as error:
            raise ValueError(f"cannot use {folder} for the chunks of a batch: {error}") from None
        if not same:
            raise ValueError(f"{folder} holds chunks of another batch: choose another folder")

    def missing(self) -> list[int]:
        """Numbers of the chunks that are not complete, in order."""
        return [i for i in range(self.count) if not all(self._stored(name, i) for name in self._arrays)]

    def bounds(self, number: int) -> tuple[int, int]:
        """First element of a chunk, and the one after its last."""
        return number * self.chunk, min((number + 1) * self.chunk, self.length)

    def write(self, number: int, results: dict[str, np.ndarray]) -> None:
        """Store the results of a chunk, arrays whose leading axis is its elements, and its mark."""
        for name, values in results.items():
            if name not in self._arrays:
                shape, inner = (self.length, *values.shape[1:]), (self.chunk, *values.shape[1:])
                self._create(name, shape, inner, values.dtype)
            # Zarr stores whole chunks, so that the last one is filled up.
            whole = np.zeros((self.chunk, *values.shape[1:]), values.dtype.newbyteorder("<"))
            whole[: len(values)] = values
            files.place(self._file(name, number), whole.tobytes())
        files.place(self._file(_DONE, number), b"\1")

    def read(self) -> dict[str, np.ndarray]:
        """Results of all elements, by name.

        Raises:
            RuntimeError: a chunk is missing: its elements would be zeros.
        """
        if missing := self.missing():
            raise RuntimeError(f"{len(missing)} of {self.count} chunks are missing in {self.folder}")
        return {name: np.asarray(x[:]) for name, x in sorted(self._arrays.items()) if name != _DONE}

    def _create(self, name: str, shape: tuple[int, ...], chunks: tuple[int, ...], dtype: np.dtype) -> None:
        """Describe an array whose chunks are stored as they lie in memory, little-endian."""
        plain = {"compressors": None, "filters": None, "fill_value": 0}
        self._arrays[name] = self._group.create_array(name, shape=shape, chunks=chunks, dtype=dtype, **plain)

    def _stored(self, name: str, number: int) -> bool:
        """Whether the file of a chunk is there with all its bytes: a loss of power may leave it empty."""
        file, array = self._file(name, number), self._arrays[name]
        size = int(np.prod(array.chunks)) * array.dtype.itemsize
        return file.exists() and file.stat().st_size == size

    def _file(self, name: str, number: int) -> Path:
        """File of a chunk: Zarr's default key has one number for each axis, and only the first is cut."""
        axes = [str(number), *("0" for _ in self._arrays[name].shape[1:])]
        return self.folder.joinpath(_ARRAYS, name, "c", *axes)


def zarr() -> Any:
    """Module that describes and reads arrays.

    Raises:
        ValueError: it is not installed.
    """
    try:
        import zarr as module
    except ModuleNotFoundError:
        raise ValueError("a cluster needs Dask and Zarr: install `tpd[dask]`") from None
    return module
