"""`tpd new`: templates are complete job files, and nothing is overwritten."""

import io
import re
import tomllib

import pytest

from tests.cli.conftest import call
from tpd.cli import new
from tpd.cli.grammar import TEMPLATES
from tpd.core import files
from tpd.design import job as jobs
from tpd.report import words

EACH = pytest.mark.parametrize("kind", TEMPLATES)
PULSE, RECORD_KEYS = (
    ("pulse", "pulse_frequency", "pga", "pulse_band"),
    ("records", "scales", "intensity", "validation_share"),
)


@EACH
def test_a_written_template_is_a_valid_job(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert call("new", kind).out.startswith(f"written: {kind}.toml\nnext: ")
    job = jobs.job_of(jobs.read_tables(tmp_path / f"{kind}.toml"))
    assert jobs.job_of(tomllib.loads(job.toml)) == job
    # None stands for the default conditions around the motion.
    assert job.conditions is None
    assert job.full["project"]["name"]
    # The motion lifts the block, and the comment about it has the right numbers.
    f, limit = job.scene.peak, job.scene.uplift
    assert f > limit
    comment = f"the peak acceleration is {f:.2f} g, above the {limit:.2f} g that lift"
    assert comment in new.template(kind)
    assert words.origin(job.scene).endswith("with the paper's excitation and losses") is (kind == "paper")


@EACH
def test_every_key_has_a_comment_and_optional_keys_have_allowed_values(kind):
    text = new.template(kind)
    motion = text[text.index("[excitation]") : text.index("[bob]")]
    # A job has one kind of motion: the optional keys of the others stay comments.
    complete = text.replace(motion, re.sub("# .*", "", motion))
    complete = re.sub(r"^# (?=\[|\w+ = )", "", complete, flags=re.MULTILINE)
    assert complete.count("\n[") == text.count("\n[") + 2
    assert len(jobs.job_of(tomllib.loads(complete)).conditions) == 18 * 16
    for line in text.splitlines():
        assert re.search(r"  # \w", line) or not re.match(r"(# )?\w+ = ", line), line
        assert len(line) <= 110


@EACH
def test_a_template_accepts_a_pulse_or_records_with_a_hazard_instead_of_the_harmonic(kind):
    text = new.template(kind)
    motion, hazard = (text[text.index("[excitation]") : text.index(end)] for end in ("# [hazard]", "[bob]"))
    optional = [line for line in motion.splitlines() if re.match(r"# \w+ = ", line)]
    assert [line.split()[1] for line in optional] == [*PULSE, *RECORD_KEYS]
    for keys in (PULSE, RECORD_KEYS):
        chosen = "\n".join(line[2:] for line in optional if line.split()[1] in keys)
        job = jobs.job_of(tomllib.loads(text.replace(motion, f"[excitation]\n{chosen}\n")))
        assert job.kind == ("pulse" if keys is PULSE else "records")
        assert len(job.conditions) == len(job.conditions.motions) * len(job.conditions.scales)
        assert len(job.conditions.motions) == (5 if keys is PULSE else len(job.motions))
        assert job.hazard is None
    # A hazard belongs to records.
    lines = [line[2:] for line in hazard.splitlines() if re.match(r"# (\w+ = |\[hazard)", line)]
    chosen = "\n".join(line for line in lines if line.split()[0] not in PULSE)
    job = jobs.job_of(tomllib.loads(text.replace(hazard, f"[excitation]\n{chosen}\n")))
    assert job.hazard is job.conditions.hazard
    assert job.hazard.measure.unit == "g"
    # The rates in the template are those of the return periods in its comment.
    assert [1.0 / x for x in job.hazard.rates] == pytest.approx([72, 475, 2475], rel=0.02)


def test_new_does_not_overwrite_a_file(tmp_path):
    out = tmp_path / "mine.toml"
    assert call("new tower --out", str(out)).status == 0
    assert f"tpd optimise {out}" in out.read_text()
    out.write_text("keep me")
    done = call("new statue --out", str(out))
    assert (done.status, done.out) == (2, "")
    assert done.err == f"tpd: {out} exists and was not changed: choose another file with --out\n"
    assert out.read_text() == "keep me"


def test_a_failed_write_leaves_no_partial_file(tmp_path, monkeypatch):
    class Full(io.FileIO):
        def write(self, _):
            raise OSError(28, "No space left on device")

    (tmp_path / "file").write_text("kept")
    done = call("new tower --out", str(tmp_path / "file" / "job.toml"))
    assert (done.status, done.err) == (2, f"tpd: cannot use {tmp_path}/file/job.toml: Not a directory\n")
    monkeypatch.setattr(files, "open", Full, raising=False)
    job = tmp_path / "new" / "job.toml"
    done = call("new tower --out", str(job))
    assert (done.status, done.err) == (2, f"tpd: cannot use {job}: No space left on device\n")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "kept"
