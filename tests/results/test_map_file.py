"""The map on disk: whole or not at all, what the run said, and nothing that executes."""

import numpy as np
import pytest

import omnieval
from omnieval.errors import ResultError
from omnieval.results.map_file import MAP_FILE, load_map
from omnieval.results.tables import final_map

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


@pytest.fixture(scope="module")
def run(panoramas, tmp_path_factory):
    return omnieval.replay(panoramas, config=CONFIG, out=tmp_path_factory.mktemp("maps") / "run", recording=False)


def test_it_says_what_the_tables_say(run):
    map_, final = run.map, final_map(run.steps, run.nodes)
    assert map_.labels.tolist() == final.labels.tolist()
    assert map_.nodes.tolist() == list(final.nodes)
    assert set(map_.nodes[map_.active].tolist()) == final.active
    np.testing.assert_allclose(map_.representatives, final.representatives, rtol=1e-6)
    assert map_.edges.tolist() == [list(edge) for edge in run.transitions.rows()]
    assert map_.files.tolist() == run.steps["file"].to_list()
    np.testing.assert_array_equal(map_.xy, run.steps.select("x", "y").to_numpy())
    assert map_.rooms.tolist() == run.steps["room"].to_list()
    representatives = dict(run.nodes.select("id", "representative_frame").iter_rows())
    assert map_.representative_frames.tolist() == [representatives[node] for node in map_.nodes.tolist()]


def test_it_holds_the_descriptions_to_the_bit(run, panoramas, tmp_path):
    archive, _ = omnieval.describe_archive(panoramas, tmp_path / "hog.npz")
    np.testing.assert_array_equal(run.map.positions, archive.position)
    np.testing.assert_array_equal(run.map.orientations, archive.orientation)


def test_it_knows_what_made_it(run):
    about = run.map.about
    assert about["mapper"]["settings"]["n_init"] == 10
    assert about["mapper"]["identity"] == run.manifest["mapper"]["identity"]
    assert about["descriptor"]["identity"] == run.manifest["descriptor"]["identity"]
    assert about["camera"] == run.manifest["camera"]
    assert about["run"] == run.manifest["identity"]


def test_two_runs_make_equal_files(run, panoramas, tmp_path):
    other = omnieval.replay(panoramas, config=CONFIG, out=tmp_path / "other", recording=False)
    assert other.map.digest == run.map.digest


def test_without_poses_rooms_and_times(panoramas, tmp_path):
    folder = tmp_path / "bare"
    folder.mkdir()
    for number in range(20):
        (folder / f"{number}.png").write_bytes((panoramas / f"image{number}.png").read_bytes())
    map_ = omnieval.replay(folder, config=CONFIG, out=tmp_path / "run", recording=False).map
    assert not map_.is_posed
    assert np.isnan(map_.yaws).all()
    assert set(map_.rooms.tolist()) == {""}
    assert set(map_.times.tolist()) == {np.iinfo(np.int64).min}


def test_a_damaged_map_is_refused(run, tmp_path):
    whole = (run.folder / MAP_FILE).read_bytes()
    for damage, message in (
        (whole[:-100], "cannot read"),
        (_flipped(whole), "damaged|cannot read"),
        (b"", "cannot read"),
    ):
        (tmp_path / MAP_FILE).write_bytes(damage)
        (tmp_path / "map.json").write_text((run.folder / "map.json").read_text())
        with pytest.raises(ResultError, match=message):
            load_map(tmp_path)


def test_pickled_arrays_are_never_loaded(run, tmp_path):
    arrays = {name: getattr(run.map, name) for name in ("files", "times")}
    np.savez(tmp_path / MAP_FILE, **arrays, xy=np.array([print], dtype=object))
    (tmp_path / "map.json").write_text((run.folder / "map.json").read_text())
    with pytest.raises(ResultError, match="cannot read"):
        load_map(tmp_path)


def test_a_map_of_another_version_is_refused(run, tmp_path):
    (tmp_path / MAP_FILE).write_bytes((run.folder / MAP_FILE).read_bytes())
    (tmp_path / "map.json").write_text(
        (run.folder / "map.json").read_text().replace('"map_version": 1', '"map_version": 2')
    )
    with pytest.raises(ResultError, match="map version 2, this omnieval reads 1"):
        load_map(tmp_path)


def test_an_interrupted_run_leaves_no_map(panoramas, tmp_path):
    def stop(done, total):
        if done == 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        omnieval.replay(panoramas, config=CONFIG, out=tmp_path / "run", recording=False, progress=stop)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["run.json", "steps.parquet"]


def test_overwriting_removes_the_map(panoramas, tmp_path):
    for save_map in (True, False):
        run = omnieval.replay(
            panoramas, config=CONFIG, save_map=save_map, overwrite=True, out=tmp_path / "run", recording=False
        )
        assert (run.folder / MAP_FILE).exists() == save_map


def _flipped(data):
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]
