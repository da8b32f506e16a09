"""Images found in the map of a small run, compared with loops that compare one pair at a time."""

import json

import numpy as np
import polars as pl
import pytest

import omnieval
from omnieval.errors import ConfigError, ResultError
from omnieval.localization.run import localize, open_localization
from omnieval.localization.table import QUERIES
from omnieval.localization.words import answer_lines, find_query
from omnieval.mapping.step import FinalMap, Placement, Role, Step
from omnieval.results.run_folder import open_run
from tests.localization.conftest import CONFIG
from tests.testing.test_mapper import Slices


@pytest.fixture(scope="module")
def found(mapped, darker, tmp_path_factory):
    return localize(mapped, darker, out=tmp_path_factory.mktemp("found") / "darker")


def rolled_distance(one, other):
    """The distance at the best of all rolls, tried one by one."""
    return min(float(np.linalg.norm(one.astype(float) - np.roll(other, shift, axis=0))) for shift in range(len(other)))


def test_every_query_is_answered_by_every_strategy(found):
    assert found.manifest["status"] == "complete"
    assert found.table.schema == QUERIES
    assert found.table.group_by("strategy").len().sort("strategy").rows() == [
        ("coarse", 20),
        ("levels", 20),
        ("nearest", 20),
    ]


def test_the_places_are_found_with_their_headings(found):
    nearest = found.measures.row(by_predicate=pl.col("strategy") == "nearest", named=True)
    assert nearest["room_accuracy"] == 1.0
    assert nearest["refused"] == 0
    assert nearest["heading_error_median"] < 5.0
    assert 0.2 < nearest["error_mean"] < 1.2


def test_the_nearest_image_is_that_of_a_loop_over_all_pairs(mapped, darker, found):
    map_ = mapped.map
    from omnieval.config import as_config
    from omnieval.material.opening import opened

    with opened(darker, as_config(CONFIG)) as material:
        queries = [one.description for one in material.described][:2]
    answers = found.table.filter(strategy="nearest")
    for query, description in enumerate(queries):
        products = []
        for image in range(len(map_)):
            position = np.linalg.norm(map_.positions[image].astype(float) - description.position)
            products.append(position * rolled_distance(description.orientation, map_.orientations[image]))
        row = answers.row(query, named=True)
        assert row["best_frame"] == int(np.argmin(products))
        assert row["doubt"] == pytest.approx(min(products), rel=1e-6)


def test_coarse_looks_in_the_node_with_the_nearest_mean_only(mapped, found):
    map_ = mapped.map
    for row in found.table.filter(strategy="coarse").iter_rows(named=True):
        assert row["candidates"] == [row["node"]]
        assert row["compared"] == len(map_.images_of(row["node"]))
        assert map_.labels[row["best_frame"]] == row["node"]


def test_levels_refuse_what_no_node_lets_in(found):
    levels = found.table.filter(strategy="levels")
    for row in levels.iter_rows(named=True):
        gate = next(one for one in row["comparisons"] if one["gate"] == "node")
        assert row["doubt"] == min(gate["values"])
        passed = row["doubt"] <= gate["threshold"]
        assert passed == (row["verdict"] != "no-candidate")
        assert (row["node"] is None) == (row["role"] == "refused")


def test_a_query_does_not_change_the_map(mapped, darker, tmp_path):
    files = [mapped.folder / name for name in ("map.npz", "map.json")]
    before, digest = [file.read_bytes() for file in files], mapped.map.digest
    localize(mapped, darker, limit=5, out=tmp_path / "found")
    assert [file.read_bytes() for file in files] == before
    assert mapped.map.digest == digest
    with pytest.raises(ValueError, match="read-only"):
        mapped.map.labels[0] = 7


def test_the_images_of_the_map_are_found_where_they_are(mapped, panoramas, tmp_path):
    again = localize(mapped, panoramas, strategies=["nearest"], out=tmp_path / "again")
    assert again.table["best_frame"].to_list() == list(range(80))
    assert again.table["error"].max() == 0.0
    assert again.measures["recall@1"].item() == 1.0


def test_every_strategy_gives_the_same_alone(mapped, darker, found, tmp_path):
    for strategy in ("levels", "nearest", "coarse"):
        alone = localize(mapped, darker, strategies=[strategy], out=tmp_path / strategy)
        assert alone.table.drop("milliseconds").equals(found.table.filter(strategy=strategy).drop("milliseconds"))


def test_several_sequences_make_one_table_and_keep_their_names(mapped, darker, tmp_path):
    both = localize(mapped, darker, darker, strategies=["nearest"], limit=4, out=tmp_path / "both")
    names = [query["sequence"] for query in both.manifest["queries"]]
    assert names == [darker.name, f"{darker.name}-2"]
    assert both.measures["sequence"].to_list() == names
    assert both.table["query"].to_list() == [0, 1, 2, 3, 0, 1, 2, 3]
    one, other = (both.table.filter(sequence=name).drop("sequence", "milliseconds") for name in names)
    assert one.equals(other)


def test_a_map_without_a_room_knows_not_that_room(mapped, panoramas, tmp_path):
    part = localize(mapped, panoramas, without_rooms=["R2"], within=2.0, out=tmp_path / "part")
    assert part.manifest["map"]["images"] == 64
    assert part.manifest["map"]["digest"] == mapped.map.digest
    assert "R2" not in part.table["best_room"].to_list()
    levels = part.measures.row(by_predicate=pl.col("strategy") == "levels", named=True)
    nearest = part.measures.row(by_predicate=pl.col("strategy") == "nearest", named=True)
    assert nearest["wrong"] == 16
    assert levels["rightly_refused"] == 16
    assert levels["refusal_auc"] > 0.9
    for row in part.measures.iter_rows(named=True):
        assert row["right"] + row["wrong"] + row["rightly_refused"] + row["wrongly_refused"] == 80


def test_a_limited_map_is_that_of_a_shorter_run(mapped, panoramas, darker, tmp_path):
    shorter = omnieval.replay(panoramas, config=CONFIG, limit=40, out=tmp_path / "shorter", recording=False)
    part = localize(mapped, darker, map_limit=40, out=tmp_path / "part")
    whole = localize(shorter, darker, out=tmp_path / "whole")
    assert part.table.drop("milliseconds").equals(whole.table.drop("milliseconds"))


def test_it_is_opened_again(found):
    shown = found._repr_html_()
    assert str(found.folder.name) in shown
    assert shown.count("<table") == 1
    again = open_localization(found.folder)
    assert again.table.equals(found.table)
    assert again.manifest["metrics"] == json.loads((found.folder / "run.json").read_text())["metrics"]


def test_an_answer_is_explained(found):
    lines = answer_lines(found, find_query(found, "3"))
    labels = [label for label, _ in lines]
    assert labels[0] == "image"
    assert [label for label in labels if label in {"levels", "nearest", "coarse"}] == ["levels", "nearest", "coarse"]
    assert sum(label == "error" for label in labels) == 3
    assert find_query(found, found.table["file"][3])[0]["query"] == 3
    with pytest.raises(ResultError, match="no query 99; name one, 0 to 19"):
        find_query(found, "99")


OWN = """
import numpy as np
from omnieval import Description, Descriptor


class Own(Descriptor):
    name = "own"

    def describe(self, panorama):
        rows = panorama.astype(np.float32)
        return Description(rows.mean(axis=1), rows[:, ::2].T.copy())
"""


def test_the_nearest_image_may_belong_to_no_node_and_is_found_all_the_same(panoramas, tmp_path):
    config = CONFIG | {"leftovers": "unassigned", "omega": 1.0, "n_new": 15}
    run = omnieval.replay(panoramas, config=config, out=tmp_path / "run", recording=False)
    unassigned = run.map.labels == 0
    assert unassigned.any()
    found = localize(run, panoramas, strategies=["nearest"], out=tmp_path / "found")
    assert (found.table["node"].is_null() == pl.Series(unassigned)).all()
    assert found.measures.select("refused", "recall@1").row(0) == (0, 1.0)
    query = int(np.flatnonzero(unassigned)[0])
    text = dict(answer_lines(found, find_query(found, str(query))))
    assert text["nearest"].startswith("found at an image that no node has")
    assert text["error"].startswith("0.00 m")


class Nothing(Slices):
    """A mapper that makes no node of anything."""

    def step(self, description):
        return Step(super().step(description).frame, "no", Role.REFUSED, None)

    def finish(self):
        images = len(self.positions)
        nowhere = (Placement.UNASSIGNED,) * images
        return FinalMap(np.zeros(images, np.int64), nowhere, (), frozenset(), np.zeros((0, len(self.positions[0]))))


def test_in_a_map_without_a_node_the_nearest_image_is_found(panoramas, tmp_path):
    run = omnieval.replay(panoramas, mapper=Nothing(), limit=12, out=tmp_path / "run", recording=False)
    found = localize(run, panoramas, limit=3, out=tmp_path / "found")
    assert found.table.select("strategy", "best_frame").rows() == [("nearest", 0), ("nearest", 1), ("nearest", 2)]
    with pytest.raises(ConfigError, match="no node to begin with; leave coarse out"):
        localize(run, panoramas, strategies=["coarse"], out=tmp_path / "coarse")


def test_a_mapper_that_only_this_process_knew_has_a_map_all_the_same(panoramas, tmp_path, caplog):
    class Own(Slices):
        pass

    run = omnieval.replay(panoramas, mapper=Own(), out=tmp_path / "run", recording=False)
    found = localize(run, panoramas, limit=3, out=tmp_path / "found")
    assert found.manifest["strategies"] == ["nearest", "coarse"]
    assert "the mapper's own levels are left out" in caplog.text


def test_a_mapper_of_two_methods_maps_a_part(panoramas, tmp_path):
    run = omnieval.replay(panoramas, mapper="tests.testing.test_mapper:Slices", out=tmp_path / "run", recording=False)
    part = localize(run, panoramas, map_limit=40, limit=3, out=tmp_path / "found")
    assert part.manifest["map"]["images"] == 40


class TestRefused:
    def test_descriptors_in_a_map_of_images_and_images_in_one_of_descriptors(self, mapped, panoramas, tmp_path):
        archive = tmp_path / "three.npz"
        omnieval.describe_archive(panoramas, archive)
        with pytest.raises(ResultError, match="map is of images described by hog; give the images"):
            localize(mapped, f"npz:{archive}", out=tmp_path / "out")
        run = omnieval.replay(f"npz:{archive}", config=CONFIG, out=tmp_path / "run", recording=False)
        with pytest.raises(ResultError, match=r"of descriptors that were made elsewhere; .* give npz:FILE"):
            localize(run, panoramas, out=tmp_path / "out")
        found = localize(run, f"npz:{archive}", strategies=["nearest"], out=tmp_path / "out")
        assert found.table["best_frame"].to_list() == list(range(80))

    def test_a_descriptor_that_has_changed(self, panoramas, tmp_path):
        file = tmp_path / "own.py"
        code = OWN
        file.write_text(code)
        run = omnieval.replay(panoramas, descriptor=f"{file}:Own", config=CONFIG, out=tmp_path / "run", recording=False)
        file.write_text(code.replace("mean(axis=1)", "max(axis=1)"))
        with pytest.raises(ResultError, match="own has changed since the run"):
            localize(run, panoramas, out=tmp_path / "out")

    def test_other_panoramas(self, mapped, darker, tmp_path):
        from omnieval.material.continued import other_camera

        of_map = mapped.map.about["camera"]
        assert other_camera({**of_map, "origin": "elsewhere"}, of_map) is None
        fault = other_camera({**of_map, "rows": 64}, of_map)
        assert fault is not None
        assert "rows 64, not 128" in fault

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"strategies": ["fine"]}, "unknown strategy 'fine'"),
            ({"strategies": []}, "name each strategy once"),
            ({"within": 0.0}, "positive number of metres"),
            ({"within": float("nan")}, "positive number of metres"),
            ({"without_rooms": ["R9"]}, "no room 'R9'"),
            ({"without_rooms": ["kitchen"]}, "no room 'kitchen'; known are R0, R1, R2"),
            ({"without_rooms": ["R0", "R1", "R2"]}, "no image of the map stays"),
            ({"map_limit": 5}, "n_init"),
        ],
    )
    def test_options_that_cannot_be(self, mapped, darker, tmp_path, options, message):
        with pytest.raises(ConfigError, match=message):
            localize(mapped, darker, out=tmp_path / "out", **options)
        assert not (tmp_path / "out").exists()

    def test_no_sequence(self, mapped):
        with pytest.raises(ConfigError, match="at least one sequence"):
            localize(mapped)

    def test_a_mapper_without_levels(self, panoramas, tmp_path):
        run = omnieval.replay(
            panoramas, mapper="tests.testing.test_mapper:Slices", out=tmp_path / "run", recording=False
        )
        with pytest.raises(ConfigError, match="no levels"):
            localize(run, panoramas, strategies=["levels"], out=tmp_path / "out")
        assert localize(run, panoramas, limit=3, out=tmp_path / "out").manifest["strategies"] == ["nearest", "coarse"]

    def test_a_run_without_a_map(self, panoramas, darker, tmp_path):
        run = omnieval.replay(panoramas, config=CONFIG, save_map=False, out=tmp_path / "run", recording=False)
        assert not (run.folder / "map.npz").exists()
        with pytest.raises(ResultError, match="has no map: it was left out"):
            localize(run, darker, out=tmp_path / "out")
        assert open_run(run.folder).status == "complete"
