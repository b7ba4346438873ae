"""`tpd new`: templates are whole job files, and nothing is overwritten."""

import re
import tomllib

import pytest

from tpd.cli import main, new
from tpd.design import job as jobs
from tpd.design import optimise as search
from tpd.report import words

KINDS = pytest.mark.parametrize("kind", new.KINDS)


@KINDS
def test_a_template_is_written_and_read_back_as_a_job(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", kind]) == 0
    assert capsys.readouterr().out.startswith(f"written: {kind}.toml\nnext: ")
    job = jobs.job_of(jobs.read(tmp_path / f"{kind}.toml"))
    assert jobs.job_of(tomllib.loads(job.toml)) == job
    # None is the neighbourhood of the motion.
    assert job.conditions is None
    assert job.full["project"]["name"]


@KINDS
def test_every_key_that_is_commented_out_is_a_key_with_an_allowed_value(kind):
    text = new.template(kind)
    motion = text[text.index("[motion]") : text.index("[bob]")]
    whole = text.replace(motion, re.sub("# .*", "", motion))
    whole = re.sub(r"^# (?=\[|\w+ = )", "", whole, flags=re.MULTILINE)
    assert whole.count("\n[") == text.count("\n[") + 3
    job = jobs.job_of(tomllib.loads(whole))
    assert len(job.conditions) == 18 * 16


@KINDS
def test_a_pulse_and_records_may_stand_in_place_of_the_harmonic(kind):
    text = new.template(kind)
    motion = text[text.index("[motion]") : text.index("[bob]")]
    own = [line for line in motion.splitlines() if line.startswith("# ")]
    assert [line.split()[1] for line in own] == [*PULSE, *SHAKEN]
    for keys in (PULSE, SHAKEN):
        chosen = "\n".join(line[2:] for line in own if line.split()[1] in keys)
        job = jobs.job_of(tomllib.loads(text.replace(motion, f"[motion]\n{chosen}\n")))
        assert job.kind == ("pulse" if keys is PULSE else "records")
        assert len(job.conditions) == len(job.motions) * len(job.conditions.scales)


PULSE, SHAKEN = ("pulse", "pulse_frequency", "pga"), ("records", "scales", "held_out")


@KINDS
def test_every_key_of_a_template_has_its_reason(kind):
    for line in new.template(kind).splitlines():
        if re.match(r"(# )?\w+ = ", line):
            assert re.search(r"  # \w.{3}", line), line
        assert len(line) <= 110


@KINDS
def test_the_block_of_a_template_lifts_and_its_comment_has_the_right_numbers(kind):
    scene = jobs.job_of(tomllib.loads(new.template(kind))).scene
    f, limit = words.acceleration(scene), words.threshold(scene)
    assert f > limit
    assert f"with the frequency {f:.2f} g, above the {limit:.2f} g at which" in new.template(kind)


def test_the_paper_s_template_is_the_paper_s_scene():
    job = jobs.job_of(tomllib.loads(new.template("paper")))
    assert words.origin(job.scene).endswith("with the paper's motion and losses")


RECORDS = "--records", "el-centro", "loma-prieta", "--scales", "2", "3"


@pytest.fixture
def asked(monkeypatch) -> dict:
    """Arguments of a search that is not begun."""
    given = {}

    def optimise(scene, *positional, **named):
        given.update(named, scene=scene)
        raise ValueError("the search begins")

    monkeypatch.setattr(search, "optimise", optimise)
    return given


@KINDS
@pytest.mark.mends("a job file of `tpd new` was refused with records: `site.gravity` is for harmonics")
def test_every_template_goes_with_records(kind, asked, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = new.template(kind).replace("gravity = 9.80665", "gravity = 9.79")
    (tmp_path / "mine.toml").write_text(text)
    assert main(["optimise", "--scene", "mine.toml", *RECORDS]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == "tpd: the search begins"
    job = jobs.job_of(jobs.read(tmp_path / "mine.toml"))
    assert asked["scene"].gravity == 9.79
    assert asked["scene"].block == job.scene.block
    assert asked["space"] == job.space
    assert asked["worth"] == job.worth
    assert {x.name for x in asked["limits"]} == {x.name for x in job.limits} - {"worsening", "reserve"}


@pytest.mark.mends("widths in the scatter table of a job were refused with records")
def test_the_scatter_of_a_job_is_that_of_the_blocks_that_judge(asked, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = new.template("tower").replace("# [scatter]", "[scatter]").replace("# length = ", "length = ")
    (tmp_path / "tower.toml").write_text(text)
    assert main(["optimise", "--scene", "tower.toml", *RECORDS]) == 2
    assert asked["ensemble"].length == 0.02
    assert asked["ensemble"].damping == 0.2


@pytest.mark.parametrize(
    ("line", "options", "sentence"),
    [
        (
            "",
            ("--exactly",),
            "`conditions.exactly` goes with a harmonic motion, which this job",
        ),
        (
            "",
            ("--amplitude", "0.1", "--frequency", "1"),
            "[motion] has keys of a harmonic motion (`amplitude",
        ),
        ("", ("--searches", "3"), "`search.searches` goes with a harmonic motion"),
    ],
)
@pytest.mark.mends("what conflicts between a job and records was not said")
def test_what_has_no_effect_on_records_is_named(
    line, options, sentence, asked, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(new.template("tower") + line)
    assert main(["optimise", "--scene", "mine.toml", *RECORDS, *options]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert sentence in error
    assert not asked


def test_records_without_sizes_are_one_sentence(asked, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(new.template("tower"))
    assert main(["optimise", "--scene", "mine.toml", "--records", "el-centro"]) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert error.startswith("tpd: a design on records needs `motion.scales` (--scales)")
    assert not asked


def test_a_file_that_exists_is_left_alone(tmp_path, capsys):
    out = tmp_path / "mine.toml"
    assert main(["new", "tower", "--out", str(out)]) == 0
    assert f"tpd optimise --scene {out}" in out.read_text()
    out.write_text("keep me")
    capsys.readouterr()
    assert main(["new", "statue", "--out", str(out)]) == 2
    assert (
        capsys.readouterr().err == f"tpd: {out} exists and is left as it is: name another file with --out\n"
    )
    assert out.read_text() == "keep me"


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("new", "castle"), "invalid choice: 'castle'"),
        (("new",), "required: KIND"),
        (("new", "tower", "--out", "/proc/nowhere/tower.toml"), "cannot write /proc/nowhere/tower.toml"),
        (("new", "tower", "--out", "."), "exists and is left as it is"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(command, said, capsys):
    try:
        status = main([*command])
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert said in err
