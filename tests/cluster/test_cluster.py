"""Clusters: the answer depends neither on the workers, nor on which of them are killed and when."""

import importlib
import linecache
import os
import signal
import subprocess
import sys
import threading
import time
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import dask
import numpy as np
import pytest

import tpd
from tests.cluster.cluster_tasks import STEP, batch, slowly_squared
from tests.damage import WAYS, damage
from tpd.cluster.cluster import Cluster, ClusterError, fingerprint, store, stored

SCENE = tpd.paper_scene()
PENDULUM = SCENE.pendulum(mass_ratio=0.1, length_ratio=0.4, damping_ratio=0.1)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Two processes, for all tests that kill none."""
    with Cluster(tmp_path_factory.mktemp("chunks"), workers=2) as opened:
        yield opened


def same(a, b):
    """Whether two results are equal, digit by digit."""
    return all(np.array_equal(a[n], b[n], equal_nan=True) for n in a) and a.keys() == b.keys()


def by_hand(size):
    return slowly_squared(batch(size), 0.0)


def test_chunks_of_a_batch_are_joined_in_order(cluster):
    seen, given = [], {"chunk": 128, "progress": lambda *n: seen.append(n)}
    assert same(cluster.map("squares", slowly_squared, batch(1000), (0.0,), **given), by_hand(1000))
    assert [total for _, total in seen] == [1000] * 24
    assert seen[-1][0] == 1000
    assert seen == sorted(seen)


def test_a_stored_batch_is_not_computed_again(cluster):
    cluster.map("stored", slowly_squared, batch(300), (0.0,), chunk=128)
    shut = Cluster(cluster.folder, dask="tcp://127.0.0.1:1")
    # Nobody answers at that address: nothing was computed.
    assert same(shut.map("stored", slowly_squared, batch(300), (0.0,), chunk=128), by_hand(300))
    other = batch(300) | {"y": np.ones(300)}
    soon = dask.config.set({"distributed.comm.timeouts.connect": "1s"})
    with soon, pytest.raises(ValueError, match=r"the Dask scheduler at tcp://127.0.0.1:1 does not answer"):
        shut.map("stored", slowly_squared, other, (0.0,), chunk=128)


def test_results_on_a_cluster_equal_those_of_one_process(cluster):
    pulse = tpd.Pulse.one_sine(acceleration=3.0, frequency=1.5)
    axes = {"frequency_ratios": np.linspace(1, 6, 5), "acceleration_ratios": np.linspace(1, 8, 7)}
    motions = [pulse.scaled(x) for x in (0.7, 1.0, 1.3)]
    stripes = {"scales": [1.0, 2.0, 4.0], "pendulum": PENDULUM}
    few, answers = tpd.Ensemble(size=8, periods=10), []
    for c in (None, cluster):
        spectrum = tpd.overturning_spectrum(SCENE.block, pulse, PENDULUM, cluster=c, **axes)
        rocking = tpd.rocking_spectrum(SCENE.block, pulse, periods=np.array([0.3, 0.6]), cluster=c)
        fragility = tpd.fragility(SCENE.block, motions, cluster=c, **stripes)
        verdict = tpd.paired_runs(SCENE, PENDULUM, ensemble=few, cluster=c)
        axes_of_map = ("mu", np.linspace(0.05, 0.2, 3)), ("lam", np.array([0.3, 0.6]))
        from_rest = tpd.design_map(SCENE, *axes_of_map, pendulum=PENDULUM, start=np.zeros(4), cluster=c)
        numbers = (spectrum.without_pendulum, spectrum.with_pendulum, rocking.without_pendulum)
        numbers += (*fragility.tilts, from_rest.amplitude)
        said = str(fragility), verdict.summary(), from_rest.status.tolist()
        answers.append((dict(enumerate(numbers)), said))
    assert same(answers[0][0], answers[1][0])
    assert answers[0][1] == answers[1][1]


def test_a_batch_is_complete_after_a_worker_is_killed(tmp_path):
    with Cluster(tmp_path, workers=2) as opened:
        victims = list(opened.client.run(os.getpid).values())

        def kill():
            time.sleep(5 * STEP)
            os.kill(victims[0], signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        found = opened.map("squares", slowly_squared, batch(4000), (STEP,), chunk=128)
        killer.join()
    assert same(found, by_hand(4000))


WHOLE = {i: {"x": np.full(4, float(i)), "y": np.ones((4, 2, 3), np.int8)} for i in range(3)}


@pytest.mark.parametrize("way", [*WAYS, "of another chunk", "of another batch"])
def test_a_damaged_chunk_file_is_not_used(tmp_path, way):
    for number, results in WHOLE.items():
        store(tmp_path / "a", "key", number, results)
    path = tmp_path / "a" / "1.npz"
    if way == "of another chunk":
        path.write_bytes((tmp_path / "a" / "0.npz").read_bytes())
    elif way == "of another batch":
        store(tmp_path / "a", "other", 1, WHOLE[1])
    else:
        damage(path, way)
    said = f"1 chunks in {tmp_path / 'a'} were damaged, and are computed again"
    with pytest.warns(UserWarning, match=said):
        assert sorted(stored(tmp_path / "a", "key", 3)) == [0, 2]
    # A chunk that is missing is no damage.
    path.unlink()
    assert sorted(stored(tmp_path / "a", "key", 3)) == [0, 2]
    store(tmp_path / "a", "key", 1, WHOLE[1])
    found = stored(tmp_path / "a", "key", 3)
    assert all(same(found[i], WHOLE[i]) for i in WHOLE)


def test_invalid_options_and_folders_are_rejected(tmp_path, monkeypatch):
    for options, words in (
        ({"workers": 0}, "`workers` must be"),
        ({"workers": 2, "dask": "tcp://x:1"}, "`workers` and `dask` exclude one another"),
        ({"dask": "localhost"}, "`dask` must be an address such as tcp://host:8786, but is 'localhost'"),
    ):
        with pytest.raises(ValueError, match=words):
            Cluster(tmp_path, **options)
    opened = Cluster(tmp_path / "b", workers=1)
    (tmp_path / "b").write_text("a file")
    with pytest.raises(ValueError, match=r"cannot use .* for the chunks of a batch"):
        opened.map("bad", slowly_squared, batch(10), (0.0,), chunk=128)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match=r"pip install '.\[dask\]'"):
        Cluster(tmp_path)


def test_a_batch_without_fingerprint_or_length_is_rejected(cluster):
    with pytest.raises(ZeroDivisionError):
        cluster.map("bad", slowly_squared, batch(10), (None,), chunk=128)
    refusal = "cannot be computed on a cluster: an object of the type object has no fingerprint"
    with pytest.raises(ValueError, match=refusal):
        cluster.map("bad", slowly_squared, batch(10), (object(),), chunk=128)
    with pytest.raises(ValueError, match="arrays of one length"):
        cluster.map("bad", slowly_squared, {"x": np.zeros(3), "y": np.zeros(2)}, (0.0,), chunk=128)
    with pytest.raises(ValueError, match="`task` must be a function at the top level of a module"):
        cluster.map("bad", lambda part: part, batch(10), chunk=128)


def test_an_edited_task_is_computed_again(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    # Bytecode belongs to a source of the same second and size, so that Python would not see the edit.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    values = []
    for factor in (2, 3):
        (tmp_path / "edited_task.py").write_text(f"def times(x):\n    return {{'y': {factor} * x}}\n")
        sys.modules.pop("edited_task", None)
        linecache.clearcache()
        importlib.invalidate_caches()
        task = importlib.import_module("edited_task").times
        opened = Cluster(tmp_path / "chunks", workers=1)
        # In this process: its workers would look for the module elsewhere.
        monkeypatch.setattr(opened, "_computed", lambda f, _, parts: [(i, f(x)) for i, x in parts.items()])
        values.append(opened.map("edited", task, np.ones(2), chunk=2)["y"])
    assert np.array_equal(values, [[2.0, 2.0], [3.0, 3.0]])
    assert len(list((tmp_path / "chunks").iterdir())) == 2


def test_workers_of_another_version_are_rejected(cluster, monkeypatch):
    monkeypatch.setattr("tpd.cluster.cluster.environment_fingerprint", lambda: "another")
    with pytest.raises(ClusterError, match="a worker of the cluster has another version"):
        cluster.map("versions", slowly_squared, batch(10), (0.0,), chunk=128)


def test_a_command_with_workers_writes_the_results_of_one_process(tmp_path, capsys):
    from tpd.cli import main

    # A spectrum of one frequency and size after another.
    request = ["spectrum", "--pulse", "one-sine", "--points", "8"]
    assert main([*request, "--out", str(tmp_path / "a")]) == 0
    assert main([*request, "--workers", "1", "--out", str(tmp_path / "b")]) == 0
    assert f"chunks: {tmp_path / 'b.chunks'}" in capsys.readouterr().out
    assert (tmp_path / "a/spectrum.csv").read_text() == (tmp_path / "b/spectrum.csv").read_text()
    assert Path(tmp_path / "b.chunks").is_dir()


@pytest.mark.skipif(os.name != "posix", reason="signals are others")
def test_ctrl_c_ends_all_workers_and_keeps_the_chunks(tmp_path):
    asked = ["spectrum", "--pulse", "one-sine", "--points", "40", "--workers", "1", "--out", "out"]
    how = {"cwd": tmp_path, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}

    def chunks():
        return {path: path.stat().st_mtime_ns for path in tmp_path.glob("out.chunks/*/*.npz")}

    with subprocess.Popen([sys.executable, "-m", "tpd", *asked], **how) as run:
        while not chunks() and run.poll() is None:
            time.sleep(0.05)
        run.send_signal(signal.SIGINT)
        # Both pipes end with the last process that holds them.
        out, err = run.communicate(timeout=60)
    assert run.returncode == -signal.SIGINT, err
    assert "chunks: " in out
    assert "Traceback" not in err
    assert "resource_tracker" not in err
    kept = chunks()
    assert kept
    assert not (tmp_path / "out").exists()
    done = subprocess.run([sys.executable, "-m", "tpd", *asked], **(how | {"timeout": 300}))
    assert done.returncode == 0, done.stderr
    assert chunks().items() > kept.items()


def test_different_inputs_have_different_fingerprints():
    values = [1, 1.0, True, "1", [1], [[1]], {"a": 1}, np.array(1.0), np.array([1.0]), None, b"1"]
    values += [*Enum("E", "A B"), SCENE, PENDULUM, [("a", 1)]]
    values += [NamedTuple(name, [("a", int)])(1) for name in "AB"]
    assert len({fingerprint(v) for v in values}) == len(values)
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
    assert fingerprint("ab", "c") != fingerprint("a", "bc")
    assert fingerprint(SCENE) == fingerprint(tpd.paper_scene())
