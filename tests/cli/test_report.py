"""``omnieval report`` as its users meet it."""

import json
import os
import subprocess
import sys

import pytest

from tests.cli.test_cli import SMALL, fails, in_process


@pytest.fixture(scope="module")
def results(few_clusters, panoramas, tmp_path_factory):
    """A folder with a run, a sweep and a baseline."""
    cwd = tmp_path_factory.mktemp("results")
    for arguments in (
        ("replay", panoramas, *SMALL, "--no-rrd", "--out", "run"),
        ("baseline", panoramas, "--k", "2:4", "--out", "spectral"),
        ("ablate", panoramas, *SMALL[:6], "--vary", "omega=2.5,3.5", "--vary", "merge_y=0.5,4", "--out", "sweep"),
    ):
        assert in_process(*arguments, cwd=cwd).returncode == 0
    return cwd


def test_the_page_is_written_and_its_path_printed(results, tmp_path):
    result = in_process("report", results / "run", results / "spectral", "--out", "out", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout == "out/index.html\n"
    assert (tmp_path / "out" / "index.html").read_text("utf-8").startswith("<!doctype html>")
    assert len(list((tmp_path / "out" / "figures").glob("*.png"))) == 7


def test_what_is_not_drawn_is_said_on_stderr(results, tmp_path):
    result = in_process("report", results / "sweep", "--out", "out", cwd=tmp_path)
    assert result.returncode == 0
    assert result.stdout == "out/index.html\n"
    (line,) = result.stderr.splitlines()
    assert line.startswith("omnieval: not drawn: Maps of the best runs: no decision trace was kept")


def test_json_is_one_object(results, tmp_path):
    result = in_process("report", results / "sweep", "--out", "out", "--json", cwd=tmp_path)
    content = json.loads(result.stdout)
    assert content["schema_version"] == 1
    assert content["report"] == "out/index.html"
    assert all((tmp_path / "out" / name).exists() for name in content["files"])
    assert "--keep-steps" in content["skipped"][0]["reason"]
    assert result.stderr == ""


def test_a_report_lies_beside_its_first_path_and_is_replaced_only_when_asked(results, tmp_path):
    arguments = ("report", results / "spectral", results / "sweep")
    assert in_process(*arguments, cwd=tmp_path).stdout == f"{results / 'spectral' / 'report' / 'index.html'}\n"
    fails(in_process(*arguments, cwd=tmp_path), 2, "holds a report already", "--overwrite")
    assert in_process(*arguments, "--overwrite", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize(("form", "words"), [("md", "|:---"), ("latex", r"\begin{tabular}")])
def test_tables_alone_go_to_stdout(results, tmp_path, form, words):
    paths = [results / name for name in ("run", "sweep", "spectral")]
    result = in_process("report", *paths, "--format", form, cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert words in result.stdout
    for title in ("Summary", "Table 2", "Table 3"):
        assert title in result.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["nowhere"], 2, ["nowhere is not a run folder"]),
        (["{results}"], 2, ["is not a run folder"]),
        (["{results}/run", "{results}/run"], 2, ["named twice"]),
        (["{results}/run", "--step", "9999"], 2, ["--step 9999", "ends at step 79"]),
        (["{results}/run", "--step", "-1"], 2, ["--step"]),
        (["{results}/run", "--format", "pdf"], 2, ["--format", "pdf", "latex"]),
        (["{results}/run", "--format", "md", "--out", "x", "--json"], 2, ["leave --out, --json out"]),
        (["{results}/run", "--out", "{results}"], 2, ["not a report", "choose another --out"]),
        (["{results}/run", "--out", "{results}/sweep", "--overwrite"], 2, ["ablation, not a report"]),
        ([], 2, ["PATH"]),
    ],
)
def test_every_slip_gets_one_line_and_its_exit_code(arguments, code, words, results, tmp_path):
    fails(in_process("report", *(part.format(results=results) for part in arguments), cwd=tmp_path), code, *words)
    assert list(tmp_path.iterdir()) == []


def test_help_shows_examples_and_imports_nothing_heavy(tmp_path):
    script = (
        "import sys\nfrom omnieval.cli import main\ntry:\n    main(['report', '--help'])\nexcept SystemExit:\n"
        "    print(sorted({'altair', 'vl_convert', 'polars', 'numpy'} & set(sys.modules)), file=sys.stderr)\n"
    )
    command = [sys.executable, "-c", script]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True, env=dict(os.environ))
    assert "Examples" in result.stdout
    assert "--step" in result.stdout
    assert result.stderr.strip() == "[]"


@pytest.mark.slow
def test_a_report_does_not_depend_on_the_hash_seed_or_the_folder_it_is_made_from(results, tmp_path):
    pages = []
    for seed in ("1", "2"):
        cwd = tmp_path / seed
        cwd.mkdir()
        command = [sys.executable, "-c", "from omnieval.cli import main; main()", "report"]
        command += [str(results / "run"), str(results / "spectral"), "--out", "out"]
        environment = dict(os.environ) | {"PYTHONHASHSEED": seed, "LC_ALL": "C", "TZ": f"UTC{seed}"}
        subprocess.run(command, cwd=cwd, capture_output=True, check=True, env=environment)
        files = [cwd / "out" / "index.html", *(cwd / "out" / "figures").iterdir()]
        pages.append({path.name: path.read_bytes() for path in files})
    assert {"index.html", "01-map.png"} <= pages[0].keys()
    assert pages[0] == pages[1]
