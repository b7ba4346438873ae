"""Where the commands keep compiled programs, and what they do with damaged ones."""

import os
import subprocess
import sys

import jax
import pytest

from tests.damage import WAYS, damage
from tpd.core import jax_setup

CACHED = """
import jax
from tpd.core import jax_setup
jax_setup.use_64_bits()
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
found = []
jax.monitoring.register_event_listener(lambda event, **_: found.append(event.endswith("/cache_hits")))

def first(x): return x + 1.0
def second(x): return x * 2.0
def third(x): return x - 3.0
def fourth(x): return 4.0 - x

print([float(jax.jit(f)(10.0)) for f in (first, second, third, fourth)], sum(found))
"""
HOMELESS = """
import os, pwd
os.environ.pop("HOME", None)
def nobody(user): raise KeyError(user)
pwd.getpwuid = nobody
from tpd.core import jax_setup
print(jax_setup.use_64_bits())
"""


def run(code, **places):
    """Exit status, output and warnings of a process."""
    environment = {k: v for k, v in os.environ.items() if k not in ("JAX_COMPILATION_CACHE_DIR", "XLA_FLAGS")}
    environment.pop("XDG_CACHE_HOME", None)
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment | places, capture_output=True, text=True
    )
    said = [line.partition("UserWarning: ")[2] for line in done.stderr.splitlines() if "Warning: " in line]
    return done.returncode, done.stdout.strip(), said


def test_damaged_cache_files_of_jax_are_compiled_again(tmp_path):
    place = {"XDG_CACHE_HOME": str(tmp_path)}
    values = "[11.0, 20.0, 7.0, -6.0]"
    folder = tmp_path / "tpd" / "compiled"
    assert run(CACHED, **place) == (0, f"{values} 0", [])
    for path, way in zip(sorted(folder.glob("*-cache")), WAYS, strict=True):
        damage(path, way)
    said = [f"programs in {folder} were damaged, and are compiled again"]
    assert run(CACHED, **place) == (0, f"{values} 0", said)
    assert run(CACHED, **place) == (0, f"{values} 4", [])


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files here")
@pytest.mark.parametrize(("mode", "kept"), [(0o1777, False), (0o755, True)])
def test_a_folder_of_other_users_is_not_used_and_gives_one_warning(tmp_path, mode, kept):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(mode)
    status, out, said = run(CACHED, JAX_COMPILATION_CACHE_DIR=str(shared))
    assert (status, out) == (0, "[11.0, 20.0, 7.0, -6.0] 0")
    sentence = (
        f"compiled code is not stored, so every run compiles it: other users can write to {shared}; "
        f"run `chmod go-w {shared}`, or set other folders with NUMBA_CACHE_DIR and JAX_COMPILATION_CACHE_DIR"
    )
    assert said == ([] if kept else [sentence])
    if kept:
        assert run(CACHED, JAX_COMPILATION_CACHE_DIR=str(shared))[1].endswith("4")


@pytest.mark.skipif(sys.platform == "win32", reason="no such folder")
def test_a_cache_without_a_folder_or_a_home_gives_one_warning():
    for name in ("HOME", "JAX_COMPILATION_CACHE_DIR"):
        status, out, (said,) = run(CACHED, **{name: "/proc/nowhere"})
        assert (status, out) == (0, "[11.0, 20.0, 7.0, -6.0] 0")
        assert "/proc/nowhere" in said
        assert "cannot be written to" in said
    status, out, (said,) = run(HOMELESS)
    assert (status, out) == (0, "None")
    assert "there is no home" in said


@pytest.mark.parametrize("error", [RuntimeError("Unknown backend cpu"), AssertionError()])
def test_platforms_without_the_cpu_or_without_a_device_are_rejected_in_one_sentence(monkeypatch, error):
    def devices(backend):
        raise error

    monkeypatch.setattr(jax, "local_devices", devices)
    with pytest.raises(ValueError, match="`JAX_PLATFORMS` must name devices of this machine and include"):
        jax_setup.cpu()
