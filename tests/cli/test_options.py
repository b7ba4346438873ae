"""Options and job files are equivalent: every option sets a key of the schema, and the jobs are equal."""

import shlex
import tomllib

import pytest

import tpd
from tpd.cli import common, grammar, parser
from tpd.cli.options import Option, keys
from tpd.design import job as jobs

TABLE = """
block={width=2, height=10.0, mass=40e3}; excitation={amplitude=0.3, frequency=0.5}
--width 2 --height 10 --mass 40e3 --amplitude 0.3 --frequency 0.5
block={friction=0.1, restitution='housner'}
--friction 0.1 --restitution housner
space={mass_ratio=[0.1, 0.4], length_ratio=[0.2, 1], damping_ratio=[0.05, 0.3]}
--mass-ratio 0.1 0.4 --length-ratio 0.2 1 --damping 0.05 0.3
space={mass=[1, 2.5], length=0.12}
--pendulum-mass 1 2.5 --pendulum-length 0.12
space.hinge_height=0.3
--hinge-height 0.3
block={width=1, height=5, mass=9e3, radius_of_gyration=2}; excitation={amplitude=1, frequency=0.3}
--width 1 --height 5 --mass 9e3 --radius-of-gyration 2 --amplitude 1 --frequency 0.3
block={width=2,height=9,mass=4e4,centroid_height=4,radius_of_gyration=3}; \
excitation={amplitude=0.1,frequency=1}
--width 2 --height 9 --mass 4e4 --centroid-height 4 --radius-of-gyration 3 --amplitude 0.1 --frequency 1
block={width=2, height=9, mass=4e4}; frame={width=1, height=11}; excitation={amplitude=1, frequency=0.3}
--width 2 --height 9 --mass 4e4 --frame-width 1 --frame-height 11 --amplitude 1 --frequency 0.3
block={base_friction=0.6, effective_width=0.9}
--base-friction 0.6 --effective-width 0.9
limits={stroke=0.4, clearance=false}
--stroke 0.4 --no-walls
bob.shape='cylinder'; block.cavity_width=0.08
--bob cylinder --cavity 0.08
conditions.exactly=true
--exactly
requirements={at_least=0.2, wall_contacts=0.05, reduce='tilt'}
--at-least 0.2 --wall-contacts 0.05 --reduce tilt
search={searches=3, seed=7}; conditions.amplitudes=[1, 1.1]
--searches 3 --seed 7 --amplitudes 1 1.1
search={optimiser='adam', objective='steady tilt'}; conditions.band=[2, 3]
--optimiser adam --objective 'steady tilt' --band 2 3
search={optimiser='adam', steps=4}
--optimiser adam --steps 4
excitation={pulse='mavroeidis-papageorgiou', pulse_frequency=1, pga=0.4, cycles=2, phase=0.5}
--pulse mavroeidis-papageorgiou --pulse-frequency 1 --pga 0.4 --cycles 2 --phase 0.5
excitation={pulse='ricker', pulse_frequency=1, pga=0.4, pulse_band=[0.2, 0]}
--pulse ricker --pulse-frequency 1 --pga 0.4 --pulse-band 0.2 0
excitation={records=['el-centro', 'b.txt'], scales=[2, 3], intensity='pga', validation_share=0.3}
--records el-centro b.txt --scales 2 3 --intensity pga --validation-share 0.3
excitation={records=['a.txt', 'b.txt'], scales=[1], baseline='mean'}
--records a.txt b.txt --scales 1 --baseline mean
excitation={records=['a=1.txt', 'b'], scales=[1]}; records.events={'a=1.txt'='A 1940', 'b'='2'}
--records a=1.txt b --scales 1 --event 'a=1.txt=A 1940' b=2
excitation={records=['a.txt'], scales=[1], validation_share=['el-centro'], dt=0.01, unit='g', channel=1}
--records a.txt --scales 1 --validation-share el-centro --dt 0.01 --unit g --channel 1
excitation={records=['a.txt'], scales=[1], columns=['time=1', 'N=2'], skip=3, factor=10}
--records a.txt --scales 1 --columns time=1 N=2 --skip 3 --factor 10
conditions={band=[2.3, 2.7], amplitudes=[0.8, 1, 1.2]}; search.risk='cvar'
--band 2.3 2.7 --amplitudes 0.8 1 1.2 --risk cvar
scatter={friction=0.2, length=0.02}
--scatter friction=0.2 length=0.02
excitation={pulse='ricker', pulse_frequency=1, pga=0.4}; search={designs=8, method='rule'}
--pulse ricker --pulse-frequency 1 --pga 0.4 --designs 8 --method rule
starts.kind='rest'; conditions.band=[2, 3]
--from-rest --band 2 3
"""
LINES = TABLE.strip().splitlines()
SAME = list(zip(LINES[::2], LINES[1::2], strict=True))


def job_of(options: str, command: str = "optimise") -> jobs.Job:
    """Return the job of a command."""
    return common.read_case(parser().parse_args([command, *shlex.split(options)])).job


@pytest.mark.parametrize(("file", "options"), SAME)
def test_options_define_the_same_job_as_a_file(tmp_path, monkeypatch, file, options):
    monkeypatch.chdir(tmp_path)
    text = file.replace("; ", "\n")
    (tmp_path / "job.toml").write_text(text)
    job = jobs.job_of(tomllib.loads(text))
    assert job_of(options) == job_of("--scene job.toml") == job != jobs.job_of({})
    # The options of one call have no effect on the next one.
    assert job_of("") == jobs.job_of({})


def test_an_option_in_kg_or_as_a_ratio_replaces_the_range_of_the_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.toml").write_text("[space]\nmass_ratio = [0.02, 0.1]\nlength = 0.1\n")
    space = job_of("--scene job.toml --pendulum-mass 1 --length-ratio 0.2 0.6").space
    assert space == tpd.DesignSpace(mass=1.0, length_ratio=(0.2, 0.6))
    (tmp_path / "again.toml").write_text(job_of("--scene job.toml --pendulum-mass 1 2").toml)
    assert job_of("--scene again.toml").space == tpd.DesignSpace(mass=(1.0, 2.0), length=0.1)


@pytest.mark.parametrize(
    ("content", "options", "expected"),
    [
        ("", "--restitution housner", (0.05, "housner")),
        ("restitution = 'housner'\n", "--friction 0.02", (0.02, "housner")),
        ("restitution = 'housner'\n", "--restitution 0.9", (0.05, 0.9)),
    ],
)
def test_options_override_the_losses_of_a_file(tmp_path, content, options, expected):
    (tmp_path / "scene.toml").write_text(f"[block]\n{content}")
    block = job_of(f"--scene {tmp_path / 'scene.toml'} {options}", "response").block
    assert (block.friction, block.restitution) == expected


def test_the_table_of_this_module_contains_every_option():
    groups = [x for x in vars(grammar).values() if isinstance(x, tuple) and isinstance(x[0], Option)]
    assert len(groups) == 10
    flags = {option.flag for group in groups for option in group if not option.one}
    flags |= {
        key["option"].split()[0] for table in keys().values() for key in table.values() if "option" in key
    }
    assert {*flags, "--scatter"} == {word for word in TABLE.split() if word[:2] == "--"}
