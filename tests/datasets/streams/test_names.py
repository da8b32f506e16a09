"""Which paths are taken for videos and bags."""

import pytest

from omnieval.datasets.streams.names import is_bag, is_video


@pytest.mark.parametrize(
    ("name", "video", "bag"),
    [
        ("tour.mp4", True, False),
        ("TOUR.AVI", True, False),
        ("tour.bag", False, True),
        ("tour.mcap", False, True),
        ("tour_0.db3", False, True),
        ("tour.zip", False, False),
        ("tour", False, False),
        (f"{'n' * 5000}.mp4", True, False),
    ],
)
def test_files_are_known_by_their_ending(tmp_path, name, video, bag):
    assert (is_video(tmp_path / name), is_bag(tmp_path / name)) == (video, bag)


@pytest.mark.parametrize(
    ("names", "bag"),
    [
        (["metadata.yaml", "tour_0.db3"], True),
        (["metadata.yaml", "tour_0.db3.zstd"], True),
        (["tour_0.mcap"], True),
        (["tour_0.mcap", "1.png"], False),
        (["metadata.yaml", "tour_0.mcap", "1.png"], True),
        (["metadata.yaml", "1.png"], False),
        (["tour.bag"], False),
        ([], False),
    ],
)
def test_a_folder_is_a_bag_if_it_holds_a_recording_of_ros2_and_no_images(tmp_path, names, bag):
    for name in names:
        (tmp_path / name).touch()
    assert is_bag(tmp_path) is bag


def test_a_folder_is_no_video_whatever_it_is_called(tmp_path):
    (tmp_path / "tour.mp4").mkdir()
    assert not is_video(tmp_path / "tour.mp4")
