"""The interface between XLA, the host and compiled code: settings by name, and frames of buffers."""

import re
from pathlib import Path

import jaxlib
import numba
import numpy as np
import pytest

from tpd.exact import custom_call
from tpd.exact.calling import LINEAR
from tpd.exact.custom_call import FIELDS, FRAME, SETTINGS, api_version


def test_settings_are_a_row_by_name_and_no_other_name_passes():
    row = np.array(tuple(LINEAR.settings("GROUND", free=2.5)), SETTINGS)
    assert row["task"] == LINEAR.entry().GROUND > 0
    assert row["free"] == 2.5
    assert sum(row[name] for name in FIELDS) == row["task"] + 2.5
    with pytest.raises(TypeError, match="there are no settings freely, tasks"):
        LINEAR.settings("GROUND", freely=1.0, tasks=2.0)


def test_the_version_is_that_which_the_installed_xla_declares():
    header = (Path(jaxlib.__file__).parent / "include/xla/ffi/api/c_api.h").read_text()
    major, minor = (int(re.search(rf"XLA_FFI_API_{n} (\d+)", header)[1]) for n in ("MAJOR", "MINOR"))
    assert api_version() == major + minor * 2**32


@numba.njit
def rows_of(address, a):
    return custom_call.rows_of(address, a, 7)


def test_a_frame_of_the_host_names_its_rows_and_buffers():
    a, frame = np.zeros(8, np.int64), np.zeros(FRAME, np.int64)
    frame[1:3], frame[3:6] = (2, 9), (11, 12, 13)
    assert rows_of(frame.ctypes.data, a) == (2, 9, True)
    assert a[:4].tolist() == [11, 12, 13, 0]


def test_xla_asks_for_the_version_in_an_extension_and_other_stages_compute_nothing():
    a, frame = np.zeros(8, np.int64), np.zeros(FRAME, np.int64)
    # A metadata extension: its fourth number is the address of what the version is written to.
    version, extension = np.zeros(FRAME, np.int64), np.zeros(FRAME, np.int64)
    extension[3] = version.ctypes.data
    frame[0], frame[1] = 1, extension.ctypes.data
    assert rows_of(frame.ctypes.data, a) == (0, 0, False)
    assert version[3] == 7
    frame[1], frame[4] = 0, 1
    assert rows_of(frame.ctypes.data, a) == (0, 0, False)


@numba.njit
def first_coefficient(address, s, n):
    f = custom_call.pieces(address, s[n], n)
    return f.pieces, f.cubics[0, 0]


def test_pieces_are_shared_by_row_or_every_motion_s_own():
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
