"""The benchmark: what joins it, what is looked for in which map, and what its page says."""

import shutil

import polars as pl
import pytest

import omnieval
from omnieval.ablation.grid import make_axis
from omnieval.ablation.plan import make_plan
from omnieval.ablation.suite import benchmark_axes, benchmark_pairs, benchmark_sources
from omnieval.comparison.page import benchmark_page
from omnieval.components.names import known
from omnieval.errors import ConfigError
from omnieval.results.schemas import FOUND
from tests.cli.test_cli import in_process


def test_all_registered_mappers_are_joined_by_a_strangers():
    axes = {axis.name: axis.values for axis in benchmark_axes([make_axis("mapper", "mine.py:Mine,leader", "--mapper")])}
    assert axes["mapper"] == (*known("mapper"), "mine.py:Mine")
    assert axes["descriptor"] == ("hog", "gist")


def test_every_light_is_found_in_the_map_of_the_first():
    assert benchmark_sources([2]) == ["synthetic:cloudy:2", "synthetic:night:2", "synthetic:sunny:2"]
    pairs = benchmark_pairs(benchmark_sources([2]))
    assert pairs == dict.fromkeys(["synthetic:night:2", "synthetic:sunny:2"], "synthetic:cloudy:2")
    assert set(benchmark_pairs(benchmark_sources())) < set(benchmark_sources())
    assert benchmark_pairs(["folder:/a", "synthetic:night:3", "synthetic"]) == {}


@pytest.fixture(scope="module")
def ablation(panoramas, tmp_path_factory):
    """Two mappers on a sequence and on its beginning, which is looked for in the map of the whole."""
    folder = tmp_path_factory.mktemp("found")
    part = shutil.copytree(panoramas, folder / "part")
    for number in range(40, 80):
        (part / f"image{number}.png").unlink()
    rows = (part / "poses.csv").read_text().splitlines()
    (part / "poses.csv").write_text("\n".join(rows[:41]) + "\n")
    settings = {"roman2020.n_init": 10, "roman2020.n_new": 10, "roman2020.gamma": 1.0}
    omnieval.ablate(
        [panoramas, part],
        mapper=["roman2020", "leader"],
        settings=settings,
        localize={str(part): str(panoramas)},
        out=folder / "out",
    )
    return folder / "out", part, settings


def test_a_row_has_what_localising_in_the_map_of_a_run_has(ablation, panoramas, tmp_path):
    folder, part, settings = ablation
    table = pl.read_parquet(folder / "ablation.parquet")
    assert table.filter(pl.col("map").is_null())["dataset"].unique().to_list() == [panoramas.name]
    for row in table.filter(pl.col("map").is_not_null()).iter_rows(named=True):
        own = settings if row["mapper"] == "roman2020" else None
        run = omnieval.replay(panoramas, mapper=row["mapper"], config=own, out=tmp_path / row["mapper"])
        found = omnieval.localize(run, str(part), out=tmp_path / f"{row['mapper']}-found")
        expected = found.measures.row(by_predicate=pl.col("strategy") == row["strategy"], named=True)
        assert {name: row[name] for name in FOUND} == {name: expected[name] for name in FOUND}
        assert row["map"] == panoramas.name


def test_the_page_has_every_method_and_says_how_the_papers_does(ablation, panoramas):
    table = pl.read_parquet(ablation[0] / "ablation.parquet")
    page = benchmark_page(table, "omnieval ablate", {"code": "abc", "versions": {"omnieval": "1"}})
    assert "2 mappers (roman2020, leader) with 1 descriptors (hog) on 2 sequences: 4 runs, 4 finished." in page
    verdicts = page.split("## Where the paper's method wins and loses")[1].split("##")[0]
    (line,) = (line for line in verdicts.splitlines() if line.startswith("| pair_f1"))
    values = {row["mapper"]: row["pair_f1"] for row in table.filter(dataset=panoramas.name).iter_rows(named=True)}
    difference = values["roman2020"] - values["leader"]
    word = "ahead" if difference > 0 else "behind"
    assert [cell.strip() for cell in line.split("|")[2:6]] == ["hog", "leader", word, f"{difference:+.3f}"]
    failed = table.with_columns(error=pl.when(pl.col("job") == 3).then(pl.lit("ValueError: no")))
    assert "3 finished, 1 failed" in benchmark_page(failed, "omnieval ablate", {})
    assert "1/2 finished" in benchmark_page(failed, "omnieval ablate", {})


def test_the_command_writes_the_page_and_strangers_join(panoramas, tmp_path):
    stranger = tmp_path / "mine.py"
    stranger.write_text(
        "from omnieval.mapping.leader import Leader\n\n\nclass Mine(Leader):\n    name = 'mine'\n    swept = ()\n"
    )
    arguments = ("--preset", "benchmark", "--mapper", f"{stranger}:Mine", "--limit", "60", "--out", "out")
    result = in_process("ablate", f"folder:{panoramas}", *arguments, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "the page is out/benchmark.md" in result.stderr
    page = (tmp_path / "out" / "benchmark.md").read_text("utf-8")
    for mapper in (*known("mapper"), "mine"):
        assert f"| {mapper} " in page
    assert "No sequence was looked for in the map of another." in page


def test_what_is_not_among_the_sequences_is_not_localised(panoramas):
    with pytest.raises(ConfigError, match="not among the sequences"):
        make_plan([panoramas], [], localize={str(panoramas): "synthetic"})
