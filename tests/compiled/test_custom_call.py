"""The interface between XLA, the host and compiled code: settings by name, and frames of buffers."""

from functools import partial

import jax
import jaxlib
import numba
import numpy as np
import pytest

from tpd.compiled import custom_call
from tpd.compiled.calling import RUNS
from tpd.compiled.custom_call import API_VERSION, FRAME, SETTINGS


def test_settings_of_a_call_reject_unknown_names():
    row = np.array(tuple(RUNS.settings("GROUND", free=2.5)), SETTINGS)
    assert row["task"] == RUNS.entry().GROUND > 0
    assert row["free"] == 2.5
    assert sum(row[name] for name in SETTINGS.names) == row["task"] + 2.5
    with pytest.raises(TypeError, match="there are no settings freely, tasks"):
        RUNS.settings("GROUND", freely=1.0, tasks=2.0)


def test_the_api_version_does_not_depend_on_the_installed_xla(tmp_path, monkeypatch):
    header = tmp_path / "include" / "xla" / "ffi" / "api" / "c_api.h"
    header.parent.mkdir(parents=True)
    header.write_text("#define XLA_FFI_API_MAJOR 4\n#define XLA_FFI_API_MINOR 9\n")
    monkeypatch.setattr(jaxlib, "__file__", str(tmp_path / "__init__.py"))
    assert API_VERSION == 0 + 3 * 2**32


def test_xla_rejects_an_unsupported_api_version():
    def of_version(api):
        def call(address):
            custom_call.rows_of(address, np.zeros(8, np.int64), api)
            return 0

        return numba.cfunc("int64(int64)")(call)

    # JAX registers nothing before it knows its devices.
    jax.devices()
    handlers = of_version(API_VERSION), of_version(9 + 9 * 2**32)
    register = partial(jax.ffi.register_ffi_target, platform="cpu")
    register("tpd_of_this_version", jax.ffi.pycapsule(handlers[0].address))
    with pytest.raises(jax.errors.JaxRuntimeError, match=r"API version \(9.9\) is incompatible"):
        register("tpd_of_a_later_version", jax.ffi.pycapsule(handlers[1].address))


@numba.njit
def rows_of(address, a):
    return custom_call.rows_of(address, a, 7)


def test_a_call_from_the_host_passes_its_rows_and_buffers():
    a, frame = np.zeros(8, np.int64), np.zeros(FRAME, np.int64)
    frame[1:3], frame[3:6] = (2, 9), (11, 12, 13)
    assert rows_of(frame.ctypes.data, a) == (2, 9, True)
    assert a[:4].tolist() == [11, 12, 13, 0]


def test_a_metadata_request_gets_the_version_and_computes_no_row():
    a, frame = np.zeros(8, np.int64), np.zeros(FRAME, np.int64)
    # An extension of type 1: its fourth number is the address of what the version is written to.
    version, extension = np.zeros(FRAME, np.int64), np.zeros(FRAME, np.int64)
    extension[1], extension[3] = 1, version.ctypes.data
    frame[0], frame[1] = 1, extension.ctypes.data
    assert rows_of(frame.ctypes.data, a) == (0, 0, False)
    assert version[3] == 7
    frame[1], frame[4] = 0, 1
    assert rows_of(frame.ctypes.data, a) == (0, 0, False)


def test_unknown_extensions_before_a_version_request_are_ignored():
    a, frame, settings = np.zeros(8, np.int64), np.zeros(FRAME, np.int64), np.zeros(FRAME, np.int64)
    sizes, buffers, other, request, version = (np.zeros(FRAME, np.int64) for _ in range(5))
    # One operand with three rows of settings, and no result.
    sizes[0], settings[3:6], buffers[0] = 3, (77, 2, sizes.ctypes.data), settings.ctypes.data
    frame[[0, 1, 4, 7, 9, 14]] = 1, other.ctypes.data, 3, 1, buffers.ctypes.data, buffers.ctypes.data
    other[1], other[3] = 2, version.ctypes.data
    assert rows_of(frame.ctypes.data, a) == (0, 3, False)
    assert a[0] == 77
    assert not version.any()
    other[2], request[1], request[3] = request.ctypes.data, 1, version.ctypes.data
    assert rows_of(frame.ctypes.data, a) == (0, 0, False)
    assert version[3] == 7


@numba.njit
def first_coefficient(address, s, n):
    f = custom_call.pieces(address, s[n], n)
    return f.pieces, f.cubics[0, 0]


def test_pieces_of_a_record_are_shared_or_separate_for_each_row():
    s, table = np.zeros(2, SETTINGS), np.arange(24.0).reshape(6, 4)
    s["pieces"], s["record"] = 3, [2, 0]
    assert first_coefficient(table.ctypes.data, s, 0) == (3, 8.0)
    s["record"] = -1
    assert first_coefficient(table.ctypes.data, s, 1) == (3, 12.0)


def test_only_contiguous_arrays_of_64_bit_floats_reach_compiled_code():
    run = custom_call.on_host(numba.cfunc("int64(int64)")(lambda address: 0))
    good = np.zeros((3, 4))
    fixed = good.copy()
    fixed.flags.writeable = False
    run(0, 3, good, fixed, np.zeros(2, SETTINGS), np.zeros(0), np.zeros(3, complex))
    for bad in (
        good[:, 1],
        good.T,
        good[::-1],
        good.astype("f4"),
        good.astype(">f8"),
        good.astype(int),
        fixed.T,
    ):
        with pytest.raises(TypeError, match="compiled code needs contiguous arrays of 64-bit floats"):
            run(0, 3, good, bad)
