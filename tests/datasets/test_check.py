"""Every finding of a check, alone and all at once."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from omnieval.datasets import Pose, load
from omnieval.datasets import check as check_module
from omnieval.datasets.card_findings import path_length
from omnieval.datasets.check import check, duration
from omnieval.datasets.cold import format_name
from omnieval.datasets.sequence import Frame
from omnieval.errors import DatasetError
from omnieval.imaging.soundness import examined
from tests.datasets.trees import START_NS, codes, cold_names, image_bytes, make_cold, make_folder


def test_a_sound_sequence_has_no_findings_but_facts(tmp_path):
    root = make_cold(tmp_path / "seq", cold_names(5), label=lambda i: "CR-A" if i < 3 else "KT-A")
    report = check(root)
    assert report.ok
    assert report.findings == ()
    assert (report.source, report.name, report.root, report.card) == (f"cold:{root}", "seq", str(root), None)
    assert (report.frames, report.image_size, report.rooms) == (5, (16, 12), {"CR": 3, "KT": 2})
    assert report.length_m == pytest.approx(0.4)
    assert report.spacing_m == pytest.approx(0.1)
    assert report.duration_s == pytest.approx(0.8)


def test_progress_counts_every_image(tmp_path):
    seen = []
    check(make_cold(tmp_path / "seq", cold_names(5)), progress=lambda done, total: seen.append((done, total)))
    assert seen == [(i, 5) for i in range(1, 6)]


def test_more_images_than_a_batch_are_all_read(tmp_path, monkeypatch):
    monkeypatch.setattr(check_module, "_BATCH", 2)
    root = make_cold(tmp_path / "seq", cold_names(5))
    (root / "omni_cam" / cold_names(5)[4]).write_bytes(b"")
    assert codes(check(root)) == [("empty-image", f"omni_cam/{cold_names(5)[4]}")]


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"", "empty-image"),
        (b"plain text", "not-an-image"),
        (image_bytes()[: len(image_bytes()) // 2], "truncated-image"),
        (image_bytes(width=8), "wrong-size"),
        (None, "unreadable-image"),
    ],
)
def test_one_broken_image_is_found(tmp_path, content, code):
    root = make_cold(tmp_path / "seq", cold_names(4))
    victim = root / "omni_cam" / cold_names(4)[2]
    victim.unlink()
    if content is None:
        victim.symlink_to(victim)
    else:
        victim.write_bytes(content)
    report = check(root)
    assert codes(report) == [(code, f"omni_cam/{victim.name}")]
    assert not report.ok
    assert report.image_size == (16, 12)


class TestFolders:
    def test_a_missing_folder(self, tmp_path):
        for source in (f"cold:{tmp_path}/none", f"folder:{tmp_path}/none", f"{tmp_path}/none"):
            assert codes(check(source)) == [("missing-folder", ".")]

    def test_a_file(self, tmp_path):
        (tmp_path / "file").touch()
        for source in (f"cold:{tmp_path}/file", f"folder:{tmp_path}/file", f"{tmp_path}/file"):
            assert codes(check(source)) == [("not-a-folder", ".")]

    def test_a_folder_in_a_circle_of_links(self, tmp_path):
        (tmp_path / "loop").symlink_to(tmp_path / "loop")
        assert codes(check(f"cold:{tmp_path}/loop")) == [("missing-folder", ".")]

    def test_an_empty_folder(self, tmp_path):
        assert codes(check(f"cold:{tmp_path}")) == [("empty", ".")]
        assert codes(check(f"folder:{tmp_path}"))[0] == ("empty", ".")
        assert codes(check(tmp_path)) == [("not-a-sequence", ".")]

    def test_no_omni_cam(self, tmp_path):
        (tmp_path / "std_cam").mkdir()
        assert codes(check(f"cold:{tmp_path}")) == [("missing-omni-cam", ".")]

    def test_an_empty_omni_cam(self, tmp_path):
        (tmp_path / "omni_cam").mkdir()
        assert codes(check(tmp_path)) == [("empty", "omni_cam"), ("no-labels", "localization/places.lst")]

    def test_several_sequences(self, tmp_path):
        for name in "abcd":
            make_cold(tmp_path / name, cold_names(1))
        report = check(f"cold:{tmp_path}")
        assert codes(report) == [("several-sequences", ".")]
        assert "holds 4 sequences (a, b, c, ...)" in report.findings[0].message

    def test_a_folder_that_cannot_be_listed(self, tmp_path, monkeypatch):
        root = make_cold(tmp_path / "seq", cold_names(1))

        def refuse(self):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("pathlib.Path.iterdir", refuse)
        assert codes(check(f"cold:{root}")) == [("unreadable-folder", ".")]

    def test_an_unknown_source_is_no_finding(self):
        with pytest.raises(DatasetError, match="unknown source"):
            check("nonsense:/data")


class TestCold:
    def test_names_labels_and_images_at_odds(self, tmp_path):
        names = cold_names(4)
        root = make_cold(tmp_path / "seq", names)
        (root / "omni_cam" / "IMG,1.jpeg").write_bytes(b"")
        (root / "omni_cam" / "Thumbs.db").touch()
        (root / "omni_cam" / ".DS_Store").touch()
        absent = cold_names(5)[4]
        lines = [
            f"{names[0]} CR-A",
            f"{names[1]} CR-A",
            f"{names[1]} KT-A",
            "broken",
            f"{absent} CR-A",
            f"{names[3]} CR",
        ]
        (root / "localization" / "places.lst").write_text("\n".join(lines))
        report = check(root)
        assert codes(report) == [
            ("bad-name", "omni_cam/IMG,1.jpeg"),
            ("conflicting-label", "localization/places.lst:3"),
            ("bad-label", "localization/places.lst:4"),
            ("empty-image", "omni_cam/IMG,1.jpeg"),
            ("stray-file", "omni_cam/Thumbs.db"),
            ("missing-image", f"omni_cam/{absent}"),
            ("image-without-label", f"omni_cam/{names[2]}"),
        ]
        assert [finding.severity for finding in report.findings] == ["error"] * 4 + ["warning"] * 3
        assert report.frames == 4

    def test_no_labels_is_worth_a_word_only(self, tmp_path):
        report = check(make_cold(tmp_path / "seq", cold_names(2), label=None))
        assert codes(report) == [("no-labels", "localization/places.lst")]
        assert report.ok

    def test_labels_that_are_no_text(self, tmp_path):
        root = make_cold(tmp_path / "seq", cold_names(1))
        (root / "localization" / "places.lst").write_bytes(b"\xff\xfe\x80")
        assert codes(check(root)) == [("unreadable-labels", "localization/places.lst")]

    def test_two_images_of_one_time(self, tmp_path):
        names = [format_name(START_NS, Pose(x, 0.0, 0.0)) for x in (0.0, 1.0)]
        assert codes(check(make_cold(tmp_path / "seq", names))) == [("duplicate-time", f"omni_cam/{names[1]}")]

    def test_a_pose_that_cannot_be(self, tmp_path):
        far = f"t1.000000_x{'9' * 200}.000000_y0.000000_a0.000000.jpeg"
        back = f"t2.000000_x-{'9' * 200}.000000_y0.000000_a0.000000.jpeg"
        degrees = "t3.000000_x0.000000_y0.000000_a90.000000.jpeg"
        report = check(make_cold(tmp_path / "seq", [far, back, degrees]))
        assert codes(report) == [
            ("bad-pose", f"omni_cam/{far}"),
            ("bad-pose", f"omni_cam/{back}"),
            ("yaw-out-of-range", f"omni_cam/{degrees}"),
        ]

    def test_the_largest_yaw_of_six_decimals_is_in_range(self, tmp_path):
        name = format_name(START_NS, Pose(0.0, 0.0, math.pi))
        assert "a3.141593" in name
        assert codes(check(make_cold(tmp_path / "seq", [name]))) == []

    def test_count_length_and_size_against_the_card(self, tmp_path):
        root = make_cold(tmp_path / "cold-freiburg" / "part_a" / "seq2_cloudy3", cold_names(3))
        report = check(root)
        messages = {finding.code: finding.message for finding in report.findings}
        assert re.search(r"\b3 images, .* 2778", messages["count-differs"])
        assert re.search(r"0\.20 m long, .* 102\.68 m", messages["length-differs"])
        assert re.search(r"16 x 12, .* 640 x 480", messages["size-differs"])
        assert len(messages) == len(report.findings)
        assert report.ok
        opened = {finding for finding in examined(load(root)).findings if finding.severity != "info"}
        assert opened == set(report.findings)

    def test_an_unlisted_sequence_of_a_known_family_has_only_its_size_compared(self, tmp_path):
        root = make_cold(tmp_path / "cold-freiburg" / "part_a" / "seq9_cloudy1", cold_names(3))
        assert codes(check(root)) == [("size-differs", ".")]


class TestFolder:
    def test_every_fault_of_the_table_and_the_camera_at_once(self, tmp_path):
        poses = 'file,x,y,yaw,time\n1.png,0,0,0,5\n2.png,nan,0,0,4\n3.png,0,0,90,4\ngone.png,0,0,0,\n5.png,"1,5",0,0,\n'
        names = ["1.png", "2.png", "3.png", "4 é.png"]
        report = check(make_folder(tmp_path / "f", names, poses, "kind = 'panoramc'"))
        assert codes(report) == [
            ("bad-pose-row", "poses.csv:6"),
            ("bad-camera", "camera.toml"),
            ("yaw-in-degrees", "poses.csv"),
            ("bad-pose", "poses.csv:3"),
            ("missing-image", "gone.png"),
            ("image-without-pose", "4 é.png"),
            ("names-not-in-order", "2.png"),
            ("duplicate-time", "3.png"),
        ]
        assert report.length_m is None
        assert report.duration_s is None

    def test_a_wrong_header_is_the_only_fault_of_the_table(self, tmp_path):
        report = check(make_folder(tmp_path / "f", ["1.png"], "file,speed,y,yaw\n1.png,0,0,0\n"))
        assert codes(report) == [("bad-pose-row", "poses.csv:1")]

    def test_a_table_that_is_no_text(self, tmp_path):
        root = make_folder(tmp_path / "f", ["1.png"])
        (root / "poses.csv").write_bytes(b"\xff\xfe\x80")
        assert codes(check(root)) == [("unreadable-poses", "poses.csv")]

    def test_no_poses_is_worth_a_word_only(self, tmp_path):
        report = check(make_folder(tmp_path / "f", ["1.png"]))
        assert codes(report) == [("no-poses", "poses.csv")]
        assert report.ok


def frames(*rows: tuple[int | None, float | None, float]) -> tuple[Frame, ...]:
    """Frames from rows of time, x (None: no pose) and y."""
    return tuple(
        Frame(Path(f"{i}.png"), f"{i}.png", time, Pose(x, y, 0.0) if x is not None else None)
        for i, (time, x, y) in enumerate(rows)
    )


class TestFacts:
    def test_the_length_is_that_of_the_polyline(self):
        assert path_length(frames((0, 0, 0), (1, 3, 4), (2, 3, 0))) == pytest.approx(9.0)
        assert path_length(frames((0, 0, 0))) == 0.0

    @pytest.mark.parametrize(
        "rows",
        [
            [],
            [(0, 0, 0), (1, None, 0)],
            [(0, 0, 0), (1, math.inf, 0)],
            [(0, math.nan, 0), (1, 0, 0)],
            [(0, -1e308, 0), (1, 1e308, 0)],
        ],
    )
    def test_the_length_is_unknown_unless_every_position_is_known(self, rows):
        assert path_length(frames(*rows)) is None

    def test_the_duration_is_unknown_unless_every_time_is_known(self):
        assert duration(frames((5_000_000_000, 0, 0), (7_500_000_000, 0, 0))) == 2.5
        assert duration(frames((5, 0, 0), (None, 0, 0))) is None
        assert duration(()) is None
