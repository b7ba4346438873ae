"""Results of a long batch in a folder, chunk by chunk, so that an interrupted batch goes on where it was.

Each result is one Zarr array with a file for each chunk. A mark that is written after these files says that
the chunk is complete, and has their checksum: a chunk whose files are others is computed again.

Zarr describes and reads the arrays. The chunks are written here: without compression they are nothing but
their numbers, and Zarr's event loop takes some 3 ms of processor time for each.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from tpd.core import files

_MANIFEST, _ARRAYS, _DONE, _CHECKSUM = "manifest.json", "results.zarr", "done", "checksum"


class ChunkStore:
    """Chunks of one batch: `chunk` elements each, the last one perhaps fewer."""

    def __init__(self, folder: Path, length: int, chunk: int, about: dict[str, Any]) -> None:
        """Open the folder of a batch, or make it.

        Args:
            folder: of this batch alone.
            length: elements of the batch.
            chunk: elements of a chunk.
            about: plain values for the manifest: what the results are of.

        A folder whose manifest or descriptions are damaged is put aside, and all is computed again.

        Raises:
            ValueError: the folder holds something else, or cannot be written.
        """
        self.folder, self.length, self.chunk = folder, length, chunk
        self.count = -(-length // chunk)
        about = json.loads(files.as_json({"elements": length, "chunk": chunk, **about}))
        try:
            if not self._open(about):
                files.put_aside(folder, "chunks", "computed")
                self._open(about)
        except OSError as error:
            raise ValueError(f"cannot use {folder} for the chunks of a batch: {error}") from None

    def _open(self, about: dict[str, Any]) -> bool:
        """Find out what is there, or make it; False where it is damaged as a whole."""
        manifest, module = self.folder / _MANIFEST, zarr()
        if not manifest.exists():
            content = {**about, "versions": files.versions(), "date": files.today()}
            files.place(manifest, files.as_json({**content, _CHECKSUM: _of(content)}))
        try:
            found = json.loads(manifest.read_bytes())
            if found.pop(_CHECKSUM) != _of(found):
                return False
        except (ValueError, KeyError, TypeError, AttributeError):
            return False
        if {k: found.get(k) for k in about} != about:
            raise ValueError(f"{self.folder} holds chunks of another batch: choose another folder")
        try:
            self._group = module.open_group(self.folder / _ARRAYS, mode="a")
            self._arrays = {name: self._group[name] for name in self._group.array_keys()}
            if _DONE not in self._arrays:
                self._create(_DONE, (self.count,), (1,), np.dtype("uint64"))
        except OSError:
            raise
        except Exception:
            # Zarr does not say what it raises for a description that makes no sense.
            return False
        marked = [i for i in range(self.count) if self._file(_DONE, i).exists()]
        self._sound = {i for i in marked if self._is_sound(i)}
        # Where no chunk is as it was written, the descriptions are damaged; they belong to all.
        if marked and not self._sound:
            return False
        if len(self._sound) < len(marked):
            files.say_damaged(f"{len(marked) - len(self._sound)} chunks", self.folder, "computed")
        return True

    def missing(self) -> list[int]:
        """Numbers of the chunks that are not complete and as they were written, in order."""
        return sorted(set(range(self.count)) - self._sound)

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
        files.place(self._file(_DONE, number), self._checksum(number))
        self._sound.add(number)

    def read(self) -> dict[str, np.ndarray]:
        """Results of all elements, by name.

        Raises:
            RuntimeError: a chunk is missing: its elements would be zeros.
        """
        self._sound = {i for i in self._sound if self._is_sound(i)}
        if missing := self.missing():
            raise RuntimeError(f"{len(missing)} of {self.count} chunks are missing in {self.folder}")
        return {name: np.asarray(x[:]) for name, x in sorted(self._arrays.items()) if name != _DONE}

    def _create(self, name: str, shape: tuple[int, ...], chunks: tuple[int, ...], dtype: np.dtype) -> None:
        """Describe an array whose chunks are stored as they lie in memory, little-endian."""
        plain = {"compressors": None, "filters": None, "fill_value": 0}
        self._arrays[name] = self._group.create_array(name, shape=shape, chunks=chunks, dtype=dtype, **plain)

    def _is_sound(self, number: int) -> bool:
        """Whether the files of a chunk are those that its mark was written for."""
        with contextlib.suppress(OSError):
            return self._file(_DONE, number).read_bytes() == self._checksum(number)
        return False

    def _checksum(self, number: int) -> bytes:
        """Checksum of the files of a chunk, and of what says how to read them."""
        digest = hashlib.blake2b(digest_size=8)
        for name in sorted(self._arrays):
            chunk = [] if name == _DONE else [self._file(name, number)]
            for path in (self.folder / _ARRAYS / name / "zarr.json", *chunk):
                content = path.read_bytes()
                digest.update(f"{name} {len(content)} ".encode() + content)
        return digest.digest()

    def _file(self, name: str, number: int) -> Path:
        """File of a chunk: Zarr's default key has one number for each axis, and only the first is cut."""
        axes = [str(number), *("0" for _ in self._arrays[name].shape[1:])]
        return self.folder.joinpath(_ARRAYS, name, "c", *axes)


def _of(content: dict[str, Any]) -> str:
    """Checksum of a manifest."""
    return hashlib.sha256(files.as_json(content).encode()).hexdigest()


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
