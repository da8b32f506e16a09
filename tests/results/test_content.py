"""The content hash: equal for equal content, different for the smallest difference, blind to the clock."""

import json

import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import omnieval
from omnieval.loop import replay
from omnieval.results.content import MEASURED, content_hash, folder_hash
from omnieval.results.run_folder import open_run
from omnieval.results.schemas import NODES, PARTITIONS, STEPS, TRANSITIONS, ablation_schema
from tests.cli.test_cli import in_process

ITEM = pl.Struct({"kind": pl.Enum(["a", "b"]), "frames": pl.List(pl.Int32)})
TABLE = pl.DataFrame(
    {
        "number": pl.Series([1, None, 3], dtype=pl.Int32),
        "real": [0.0, None, float("nan")],
        "flag": [True, False, None],
        "text": ["", None, "é"],
        "time": pl.Series([None, 5, 6], dtype=pl.Datetime("ns")),
        "items": pl.Series([[{"kind": "a", "frames": [1, 2]}], None, []], dtype=pl.List(ITEM)),
        "seconds": [1.0, 2.0, 3.0],
    }
)


def with_value(name, row, value):
    values = TABLE[name].to_list()
    values[row] = value
    return TABLE.with_columns(pl.Series(name, values, dtype=TABLE.schema[name]))


@pytest.mark.parametrize(
    "changed",
    [
        with_value("number", 0, 2),
        with_value("number", 1, 0),
        with_value("real", 0, -0.0),
        with_value("real", 0, 5e-324),
        with_value("real", 1, 0.0),
        with_value("flag", 2, False),
        with_value("text", 1, ""),
        with_value("text", 2, "e"),
        TABLE.with_columns(pl.col("time").dt.offset_by("1ns")),
        with_value("items", 1, []),
        with_value("items", 2, [None]),
        with_value("items", 0, [{"kind": "b", "frames": [1, 2]}]),
        with_value("items", 0, [{"kind": "a", "frames": [2, 1]}]),
        with_value("items", 0, [{"kind": "a", "frames": None}]),
        TABLE.reverse(),
        TABLE.head(2),
        TABLE.rename({"number": "count"}),
        TABLE.with_columns(pl.col("number").cast(pl.Int64)),
        TABLE.with_columns(pl.col("time").cast(pl.Datetime("us"))),
        TABLE.select(sorted(TABLE.columns)),
        TABLE.drop("flag"),
    ],
)
def test_every_difference_counts(changed):
    assert content_hash(changed) != content_hash(TABLE)


def test_the_clock_and_the_file_do_not_count(tmp_path):
    assert content_hash(TABLE) == content_hash(TABLE.with_columns(seconds=pl.lit(9.0)))
    assert content_hash(TABLE) == content_hash(TABLE.drop("seconds"))
    TABLE.write_parquet(tmp_path / "other.parquet", compression="lz4", row_group_size=1, statistics=False)
    assert content_hash(pl.read_parquet(tmp_path / "other.parquet")) == content_hash(TABLE)
    assert content_hash(pl.concat([TABLE.head(1), TABLE.slice(1)], rechunk=False)) == content_hash(TABLE)
    for schema in (STEPS, NODES, TRANSITIONS, PARTITIONS, ablation_schema({"omega": "float"})):
        assert {name for name in schema if name in MEASURED} == set(schema) & {"milliseconds", "seconds"}
        assert content_hash(schema.to_frame()) != content_hash(TABLE)


def test_the_hash_of_a_table_never_changes():
    assert content_hash(TABLE) == "5c7c76e28dc2f776e8a66982d5191fa1"


def test_a_type_without_a_definition_is_refused():
    with pytest.raises(TypeError, match="not defined for columns of Object"):
        content_hash(pl.DataFrame({"a": pl.Series([object()], dtype=pl.Object)}))


lists = st.lists(st.none() | st.lists(st.none() | st.integers(-3, 3), max_size=3), max_size=4)


@given(lists, lists)
@settings(max_examples=200, deadline=None)
def test_lists_have_equal_hashes_exactly_when_they_are_equal(one, other):
    tables = [pl.DataFrame({"a": pl.Series(values, dtype=pl.List(pl.Int32))}) for values in (one, other)]
    assert (content_hash(tables[0]) == content_hash(tables[1])) == (one == other)


def test_run_json_has_the_hashes_of_the_tables(panoramas, tmp_path):
    config = omnieval.configure(n_init=10, n_new=10, gamma=1.0, omega=3.5, merge_y=0.5)
    run = replay(panoramas, config=config, out=tmp_path / "run")
    stored = json.loads((tmp_path / "run" / "run.json").read_text())["content_hashes"]
    tables = {"steps": run.steps, "nodes": run.nodes, "transitions": run.transitions, "quality": run.quality}
    assert stored == {name: content_hash(table) for name, table in tables.items()}
    assert open_run(tmp_path / "run").content_hash == folder_hash(stored)


def test_diff_tells_equal_steps_from_equal_runs(panoramas, tmp_path):
    base = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}
    for name, leftovers in {"one": "retest", "same": "retest", "other": "unassigned"}.items():
        replay(panoramas, config=omnieval.configure(base, leftovers=leftovers), out=tmp_path / name)
    one = open_run(tmp_path / "one").content_hash
    same = in_process("diff", "one", "same", cwd=tmp_path).stdout.splitlines()
    assert same == ["equal: all 80 steps", f"content hash: {one} | {one}"]
    other = in_process("diff", "one", "other", cwd=tmp_path).stdout.splitlines()
    assert other[0] == "equal: all 80 steps; only the final maps differ"
    assert other[1] == f"content hash: {one} | {open_run(tmp_path / 'other').content_hash}"
    said = json.loads(in_process("diff", "one", "other", "--json", cwd=tmp_path).stdout)
    assert (said["equal"], "difference" in said) == (False, False)
