"""``--camera FILE.toml`` means the same wherever images are taken."""

import json

import pytest

from omnieval.config import with_camera
from omnieval.errors import ConfigError
from omnieval.imaging.settings import ImagingConfig
from tests.cli.test_cli import in_process


@pytest.fixture
def cwd(tmp_path):
    (tmp_path / "upper.toml").write_text('kind = "panoramic"\nbelt = "0.1:0.6"\n', encoding="utf-8-sig")
    (tmp_path / "lower.toml").write_text('kind = "panoramic"\nbelt = "0.4:0.9"\n')
    return tmp_path


def test_a_sweep_takes_the_images_through_the_camera(panoramas, cwd):
    grid = ("--mapper", "leader", "--vary", "radius=3,4", "--limit", "8")
    done = in_process("ablate", panoramas, *grid, "--camera", "upper.toml", "--out", "sweep", cwd=cwd)
    assert done.returncode == 0, done.stderr
    jobs = json.loads((cwd / "sweep" / "run.json").read_text())
    assert "0.1:0.6" in json.dumps(jobs)


def test_a_case_is_of_a_camera(panoramas, cwd):
    case = ("--reference", "cases.toml", "--mapper", "leader", "--limit", "8", "--camera")
    made = in_process("check", panoramas, *case, "upper.toml", "--update", cwd=cwd)
    assert made.returncode == 0, made.stderr
    assert "0.1:0.6" in (cwd / "cases.toml").read_text()
    assert in_process("check", panoramas, *case, "upper.toml", cwd=cwd).returncode == 0
    assert in_process("check", panoramas, *case, "lower.toml", cwd=cwd).returncode == 4


def test_queries_have_a_camera_of_their_own(panoramas, cwd):
    run = ("--mapper", "leader", "--no-rrd", "--limit", "8", "--camera", "upper.toml", "--out", "run")
    assert in_process("replay", panoramas, *run, cwd=cwd).returncode == 0
    find = ("localize", "run", panoramas, "--limit", "4", "--strategy", "nearest")
    assert in_process(*find, "--camera", "upper.toml", "--out", "same", cwd=cwd).returncode == 0
    refused = in_process(*find, "--camera", "lower.toml", "--out", "other", cwd=cwd)
    assert refused.returncode == 2
    assert "its camera has belt [0.4, 0.9], not [0.1, 0.6]" in refused.stderr


def test_a_camera_replaces_another_whole_but_not_the_size_of_the_panoramas(cwd):
    told = ImagingConfig(rows=64, columns=256, cx=300.0, cy=200.0, r_in=40.0, r_out=190.0)
    assert with_camera(told, cwd / "upper.toml") == ImagingConfig(
        rows=64, columns=256, kind="panoramic", belt="0.1:0.6"
    )
    with pytest.raises(ConfigError, match="cannot read the camera"):
        with_camera(told, cwd / "none.toml")
