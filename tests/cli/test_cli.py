"""The command line as its users meet it: a process, its two streams and its exit code."""

import contextlib
import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from omnieval.cli import main
from omnieval.config import parameters
from omnieval.results.run_folder import open_run
from omnieval.results.schemas import SCHEMA_VERSION

SMALL = ("--set", "n_init=10", "--set", "n_new=10", "--set", "gamma=1", "--set", "omega=3.5", "--set", "merge_y=0.5")


def omnieval(*arguments, cwd):
    command = [sys.executable, "-c", "from omnieval.cli import main; main()", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, env=dict(os.environ))


def in_process(*arguments, cwd):
    """The same without the cost of a new interpreter."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = int(stop.code or 0)
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def fails(result, code, *words):
    assert result.returncode == code, result.stderr
    assert result.stdout == ""
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("omnieval: ")
    for word in words:
        assert word in lines[0]


@pytest.fixture(scope="module")
def replayed(panoramas, tmp_path_factory):
    cwd = tmp_path_factory.mktemp("cwd")
    return cwd, omnieval("replay", f"folder:{panoramas}", *SMALL, cwd=cwd)


def test_replay_writes_the_run_folder_and_says_what_it_came_to(replayed):
    cwd, result = replayed
    assert (result.returncode, result.stderr) == (0, "")
    folder = result.stdout.splitlines()[0]
    assert re.fullmatch(r"runs/three-places\d*-hog", folder)
    assert sorted(path.name for path in (cwd / folder).iterdir()) == [
        "map.json",
        "map.npz",
        "nodes.parquet",
        "quality.parquet",
        "replay.rrd",
        "run.json",
        "steps.parquet",
        "transitions.parquet",
    ]
    assert "silhouette" in result.stdout
    assert "by loop closure" in result.stdout


def test_json_is_one_object_with_the_manifest(panoramas, tmp_path):
    result = in_process("replay", panoramas, *SMALL, "--no-rrd", "--json", "--limit", "40", cwd=tmp_path)
    content = json.loads(result.stdout)
    assert content["status"] == "complete"
    assert content["schema_version"] == SCHEMA_VERSION
    assert content["cut"] == {"start": 0, "stride": 1, "limit": 40}
    assert len(open_run(tmp_path / content["run"]).steps) == 40
    assert not (tmp_path / content["run"] / "replay.rrd").exists()


def test_a_second_run_gets_a_folder_of_its_own_and_out_is_never_overwritten_unasked(panoramas, tmp_path):
    arguments = ("replay", panoramas, *SMALL, "--no-rrd", "--limit", "20")
    first, second = in_process(*arguments, cwd=tmp_path), in_process(*arguments, cwd=tmp_path)
    assert second.stdout.splitlines()[0] == first.stdout.splitlines()[0] + "-2"
    assert in_process(*arguments, "--out", "here", cwd=tmp_path).returncode == 0
    fails(in_process(*arguments, "--out", "here", cwd=tmp_path), 2, "here holds a replay already", "--overwrite")
    assert in_process(*arguments, "--out", "here", "--overwrite", cwd=tmp_path).returncode == 0


def test_describe_then_map_decides_what_replay_decides(replayed, panoramas, tmp_path):
    cwd, result = replayed
    assert in_process("describe", panoramas, "--out", "three.npz", cwd=tmp_path).returncode == 0
    mapped = in_process("map", "npz:three.npz", *SMALL, "--json", cwd=tmp_path)
    steps = open_run(tmp_path / json.loads(mapped.stdout)["run"]).steps
    expected = open_run(cwd / result.stdout.splitlines()[0]).steps
    assert steps.drop("milliseconds").equals(expected.drop("milliseconds"))
    plain = json.loads(in_process("map", "three.npz", "--limit", "20", *SMALL, "--json", cwd=tmp_path).stdout)
    assert plain["source"] == f"npz:{tmp_path / 'three.npz'}"


def test_render_rebuilds_the_recording(replayed):
    cwd, result = replayed
    folder = Path(result.stdout.splitlines()[0])
    rendered = in_process("render", folder, "--no-images", cwd=cwd)
    assert rendered.stdout.strip() == str(folder / "replay.rrd")
    assert rendered.returncode == 0


def test_help_is_there_for_every_command(tmp_path):
    root = omnieval("--help", cwd=tmp_path).stdout
    for command in ("replay", "map", "describe", "render", "view", "compare", "diff", "parameters", "dataset"):
        assert command in root
        page = in_process(command, "--help", cwd=tmp_path)
        assert page.returncode == 0
        assert "Examples" in page.stdout or command == "dataset"


def test_help_imports_no_heavy_library(tmp_path):
    code = (
        "import sys\nfrom omnieval.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'cv2', 'polars', 'rerun', 'sklearn', 'scipy', 'pydantic'} & set(sys.modules)\n"
        "sys.exit(', '.join(sorted(heavy)) or 0)\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")


def test_parameters_are_all_listed_with_their_meaning(tmp_path):
    listed = json.loads(in_process("parameters", "--json", cwd=tmp_path).stdout)["parameters"]
    assert list(listed) == list(parameters())
    assert all(facts["meaning"] and facts["range"] for facts in listed.values())
    assert "omega" in in_process("parameters", cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["replay", "{panoramas}", "--set", "omgea=2"], 2, ["omgea", "did you mean omega", "--set omgea=2"]),
        (["replay", "{panoramas}", "--set", "omega=-1"], 2, ["omega", "greater than 0", "'-1'"]),
        (["replay", "{panoramas}", "--set", "omega=nan"], 2, ["omega", "finite"]),
        (["replay", "{panoramas}", "--set", "covariance=diag"], 2, ["covariance", "diagonal", "'diag'"]),
        (["replay", "{panoramas}", "--set", "hog.binz=8"], 2, ["hog.binz", "did you mean hog.bins"]),
        (["replay", "{panoramas}", "--set", "hog.bins=1"], 2, ["hog.bins", "greater than or equal to 2"]),
        (["replay", "{panoramas}", "--set", "omega"], 2, ["NAME=VALUE"]),
        (["replay", "{panoramas}", "--preset", "paper"], 2, ["unknown preset", "paper-literal"]),
        (["replay", "{panoramas}", "--descriptor", "hogg"], 2, ["unknown descriptor", "did you mean hog"]),
        (["replay", "{panoramas}", "--config", "none.toml"], 2, ["none.toml"]),
        (["replay", "{panoramas}", "--limit", "0"], 2, ["--limit"]),
        (["replay", "{panoramas}", "--start", "1000"], 3, ["none of its 80 frames"]),
        (["replay", "{panoramas}", "--limit", "5"], 2, ["n_init = 20"]),
        (["replay", "{panoramas}", "--no-rrd", "--spawn"], 2, ["--no-rrd", "--spawn"]),
        (["replay", "cold:nowhere"], 3, ["nowhere"]),
        (["replay", "synthetic:dusk"], 3, ["dusk", "cloudy"]),
        (["map", "none.npz"], 3, ["none.npz"]),
        (["render", "nothing"], 2, ["not a run folder"]),
        (["view", "nothing"], 2, ["not a run folder"]),
        (["dataset", "info", "cold-freiberg"], 3, ["cold-freiburg"]),
        (["nonsense"], 2, ["nonsense"]),
        (["replay", "--nonsense"], 2, ["--nonsense"]),
    ],
)
def test_every_slip_gets_one_line_and_its_exit_code(arguments, code, words, panoramas, tmp_path):
    fails(in_process(*(part.format(panoramas=panoramas) for part in arguments), cwd=tmp_path), code, *words)
    assert list(tmp_path.iterdir()) == []


def test_debug_shows_the_traceback(tmp_path):
    result = omnieval("compare", "nowhere", "--debug", cwd=tmp_path)
    assert result.returncode == 1
    assert "Traceback" in result.stderr


def test_settings_win_over_files_and_files_over_presets(panoramas, tmp_path):
    (tmp_path / "mine.toml").write_text('omega = 3.0\ngamma = 2\n[hog]\nbins = 8\n[imaging]\nkind = "panoramic"\n')
    arguments = ["--preset", "paper-literal", "--config", "mine.toml", "--set", "gamma=1.5", "--set", "n_init=10"]
    result = in_process("replay", panoramas, *arguments, "--no-rrd", "--json", "--limit", "30", cwd=tmp_path)
    content = json.loads(result.stdout)
    mapper = content["mapper"]["settings"]
    assert (mapper["covariance"], mapper["omega"], mapper["gamma"]) == ("pinv", 3.0, 1.5)
    assert content["descriptor"]["settings"]["bins"] == 8


def test_dataset_list_info_and_check(panoramas, tmp_path):
    assert "cold-freiburg" in in_process("dataset", "list", cwd=tmp_path).stdout
    assert "Pronobis" in in_process("dataset", "info", "cold-freiburg", cwd=tmp_path).stdout
    good = in_process("dataset", "check", panoramas, "--json", cwd=tmp_path)
    assert good.returncode == 0
    assert json.loads(good.stdout)["frames"] == 80


def test_dataset_check_prints_every_finding_and_exits_with_3(panoramas, tmp_path):
    broken = tmp_path / "broken"
    broken.mkdir()
    for file in panoramas.iterdir():
        (broken / file.name).write_bytes(file.read_bytes())
    (broken / "image7.png").write_bytes(b"")
    (broken / "image8.png").write_text("no image")
    (broken / "image9.png").unlink()
    result = in_process("dataset", "check", broken, cwd=tmp_path)
    assert result.returncode == 3
    for name in ("image7.png", "image8.png", "image9.png"):
        assert name in result.stdout
    assert len(result.stderr.strip().splitlines()) == 1


def test_bad_archives_get_one_line(tmp_path):
    np.savez(tmp_path / "flat.npz", position=np.zeros((5, 4), np.float32), orientation=np.zeros((4, 8, 2), np.float32))
    fails(in_process("map", "flat.npz", cwd=tmp_path), 3, "orientation", "(5, n, n)")
    np.savez(tmp_path / "objects.npz", position=np.array([{}], dtype=object))
    fails(in_process("map", "objects.npz", cwd=tmp_path), 3, "objects.npz")
    nan = np.full((30, 4), np.nan, np.float32)
    np.savez(tmp_path / "nan.npz", position=nan, orientation=np.zeros((30, 8, 2), np.float32))
    fails(in_process("map", "nan.npz", cwd=tmp_path), 3, "NaN", "image 0")
    np.savez(tmp_path / "named.npz", positions=nan)
    fails(in_process("map", "named.npz", cwd=tmp_path), 3, "no array 'position', it has positions;")
    fails(in_process("dataset", "check", "npz:nan.npz", cwd=tmp_path), 3, "holds descriptors and no images")


def test_text_of_an_archive_may_be_bytes_as_other_programs_write_it(tmp_path):
    rng = np.random.default_rng(0)
    names = np.array([f"{number}\u00e9.png".encode() for number in range(12)])
    np.savez(tmp_path / "b.NPZ.npz", position=rng.random((12, 4)), orientation=rng.random((12, 8, 2)), files=names)
    (tmp_path / "b.NPZ.npz").rename(tmp_path / "b.NPZ")
    mapped = in_process("map", "b.NPZ", "--mapper", "leader", "--json", cwd=tmp_path)
    steps = open_run(tmp_path / json.loads(mapped.stdout)["run"]).steps
    assert steps["file"].to_list()[3] == "3\u00e9.png"


def test_output_into_a_closed_pipe_is_no_traceback(tmp_path):
    command = f"{sys.executable} -c 'from omnieval.cli import main; main()' parameters | head -n 1"
    result = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert result.stderr == ""
    assert result.stdout.count("\n") == 1


def test_every_step_of_a_replay_is_in_the_table(replayed):
    cwd, result = replayed
    steps = open_run(cwd / result.stdout.splitlines()[0]).steps
    assert steps["frame"].to_list() == list(range(80))
    assert steps.select(pl.col("file").n_unique()).item() == 80


def test_runs_are_compared_and_their_first_difference_shown(replayed, panoramas, tmp_path):
    cwd, result = replayed
    one = cwd / result.stdout.splitlines()[0]
    assert (
        in_process("replay", panoramas, *SMALL, "--set", "gamma=20", "--no-rrd", "--out", "b", cwd=tmp_path).returncode
        == 0
    )
    parted = in_process("diff", one, "b", cwd=tmp_path).stdout
    assert "is the first that differs" in parted
    assert "assigned | prominence" in parted
    assert "1.0 | 20.0" in parted
    assert "content hash: " in parted
    assert in_process("diff", one, one, cwd=tmp_path).stdout.startswith("equal: all 80 steps\n")
    assert json.loads(in_process("diff", one, "b", "--json", cwd=tmp_path).stdout)["equal"] is False
    table = in_process("compare", one, "b", cwd=tmp_path).stdout
    assert "silhouette" in table
    assert "gamma" in table
    assert len(json.loads(in_process("compare", one, "b", "--json", cwd=tmp_path).stdout)["runs"]) == 2


def test_a_map_goes_on_with_another_sequence(replayed, panoramas):
    cwd, result = replayed
    run = result.stdout.splitlines()[0]
    on = ("replay", panoramas, "--limit", "4", "--no-rrd", "--out", "on", "--map", run)
    done = in_process(*on, cwd=cwd)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search(rf"continues from +\S+, the first 80 frames \(.*{run}\)\n", done.stdout)
    assert len(open_run(cwd / "on").steps) == 84
    fails(in_process(*on, *SMALL, cwd=cwd), 2, "continues with its own mapper, descriptor and imaging")


def test_without_a_usable_cache_the_replay_goes_on_and_says_so(panoramas, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("OMNIEVAL_CACHE", str(tmp_path / "file"))
    result = in_process("replay", panoramas, *SMALL, "--no-rrd", "--limit", "30", cwd=tmp_path)
    assert result.returncode == 0
    assert "descriptor cache" in result.stderr
    assert "nothing more is kept in" in result.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="has no SIGINT to send")
def test_an_interrupt_ends_with_130_one_line_and_the_steps_so_far(panoramas, tmp_path):
    code = (
        "import os, signal, sys\n"
        "import omnieval.loop as loop\n"
        "row = loop.step_row\n"
        "def interrupted(step, *rest):\n"
        "    if step.frame == 33:\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "    return row(step, *rest)\n"
        "loop.step_row = interrupted\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from omnieval.cli import main\n"
        "main(sys.argv[1:])\n"
    )
    arguments = ["replay", str(panoramas), *SMALL, "--out", "run"]
    command = [sys.executable, "-c", code, *arguments]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    fails(result, 130, "interrupted")
    run = open_run(tmp_path / "run")
    assert (run.status, len(run.steps)) == ("interrupted", 33)
