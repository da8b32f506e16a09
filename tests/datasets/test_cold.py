"""The COLD reader: names, labels, folders."""

from __future__ import annotations

import os
import sys
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.datasets import Camera, Pose
from omnieval.datasets.cold import format_name, parse_name, scan_cold, scan_places
from omnieval.errors import DatasetError
from tests.datasets.trees import START_NS, cold_names, make_cold

NAME = "t1152904768.652404_x-1.511887_y1.036311_a1.348328.jpeg"


def read_cold(path):
    return scan_cold(path).sequence()


MICROMETRES = st.integers(-(10**12), 10**12)


class TestNames:
    def test_a_name_holds_time_and_pose(self):
        assert parse_name(NAME) == (1152904768652404000, Pose(-1.511887, 1.036311, 1.348328))

    def test_no_digit_of_the_time_is_lost(self):
        time_ns, _ = parse_name("t1152904768.999999_x0.000000_y0.000000_a0.000000.jpeg")
        assert time_ns == 1152904768999999000

    @pytest.mark.parametrize(
        "name",
        [
            "",
            "image.jpeg",
            NAME.replace(".jpeg", ".JPEG"),
            NAME.replace(".jpeg", ".jpg"),
            NAME.replace(".jpeg", "_jpeg"),
            NAME + "\n",
            " " + NAME,
            NAME.replace("-1.511887", "-1,511887"),
            NAME.replace("1.348328", "1.34833"),
            NAME.replace("1.348328", "nan"),
            NAME.replace("1.348328", "+1.348328"),
            NAME.replace("1152904768", "-1152904768"),
            NAME.replace("1152904768", "١١٥٢٩٠٤٧٦٨"),
        ],
    )
    def test_what_is_not_exactly_such_a_name_is_refused(self, name):
        with pytest.raises(DatasetError, match="not a COLD image name"):
            parse_name(name)

    @pytest.mark.parametrize("seconds", ["9223372037", "9" * 20, "9" * 5000])
    def test_a_time_beyond_64_bits_is_refused(self, seconds):
        with pytest.raises(DatasetError, match="2262"):
            parse_name(NAME.replace("1152904768", seconds))

    def test_leading_zeros_change_nothing(self):
        assert parse_name(NAME.replace("t1152", "t" + "0" * 5000 + "1152")) == parse_name(NAME)

    def test_an_error_is_one_line(self):
        with pytest.raises(DatasetError) as caught:
            parse_name("two\nlines.jpeg")
        assert "\n" not in str(caught.value)

    @given(st.text())
    def test_only_dataset_errors_come_out(self, name):
        with pytest.raises(DatasetError):
            parse_name(name)

    @given(st.from_regex(r"\At\d+\.\d{6}_x-?\d+\.\d{6}_y-?\d+\.\d{6}_a-?\d+\.\d{6}\.jpeg\Z"))
    def test_names_of_the_right_form_parse_or_are_refused(self, name):
        try:
            time_ns, _ = parse_name(name)
        except DatasetError:
            return
        assert 0 <= time_ns < 2**63

    @given(st.integers(0, (2**63 - 1) // 1000), MICROMETRES, MICROMETRES, MICROMETRES)
    def test_parsing_undoes_formatting(self, micros, x, y, yaw):
        pose = Pose(x / 1e6, y / 1e6, yaw / 1e6)
        time_ns, parsed = parse_name(format_name(micros * 1000, pose))
        assert time_ns == micros * 1000
        assert astuple(parsed) == pytest.approx(astuple(pose), abs=5e-7)
        assert format_name(time_ns, parsed) == format_name(micros * 1000, pose)


class TestPlaces:
    @pytest.mark.parametrize(
        ("label", "room"),
        [("CR-A", "CR"), ("2PO1-B", "2PO1"), ("LR", "LR"), ("A-B-C", "A-B"), ("küche-A", "küche")],
    )
    def test_the_room_stands_before_the_part(self, label, room):
        assert scan_places(f"{NAME} {label}\n") == ({NAME: room}, [])

    def test_order_is_kept_and_blank_lines_and_line_ends_do_not_matter(self):
        rooms, _ = scan_places("b.jpeg CR-A\r\n\r\na.jpeg\tKT-A  \n")
        assert list(rooms.items()) == [("b.jpeg", "CR"), ("a.jpeg", "KT")]

    @pytest.mark.parametrize("line", ["a.jpeg", "a.jpeg CR A", "a.jpeg -A", "a.jpeg -"])
    def test_other_lines_are_refused_by_number(self, line):
        rooms, (fault,) = scan_places(f"x.jpeg CR-A\n{line}\n")
        assert (rooms, fault.where) == ({"x.jpeg": "CR"}, "localization/places.lst:2")

    def test_two_labels_for_one_image_are_refused(self):
        _, (fault,) = scan_places("a.jpeg CR-A\na.jpeg KT-A\n")
        assert "CR-A and KT-A" in fault.message

    @given(st.text())
    def test_any_text_is_rooms_or_findings(self, text):
        rooms, faults = scan_places(text)
        assert all(file and room for file, room in rooms.items())
        assert all(fault.message.isprintable() for fault in faults)

    word = st.text(st.characters(exclude_categories=("Z", "C")), min_size=1)
    code = st.text(st.characters(categories=("L", "N")), min_size=1)

    @given(st.dictionaries(word, st.tuples(code, code)))
    def test_parsing_undoes_formatting(self, labels):
        text = "".join(f"{file} {room}-{part}\n" for file, (room, part) in labels.items())
        assert scan_places(text) == ({file: room for file, (room, _) in labels.items()}, [])


class TestFolders:
    def test_frames_carry_name_time_pose_and_room(self, tmp_path):
        names = cold_names(3)
        sequence = read_cold(make_cold(tmp_path / "seq1", names, label=lambda i: f"R{i}-A"))
        assert [frame.file for frame in sequence.frames] == names
        assert [frame.time_ns for frame in sequence.frames] == [START_NS + i * 200_000_000 for i in range(3)]
        assert sequence.rooms == ("R0", "R1", "R2")
        assert sequence.positions == pytest.approx(np.array([[0, 0], [0.1, 0], [0.2, 0]]))
        assert (sequence.name, sequence.source) == ("seq1", f"cold:{tmp_path / 'seq1'}")
        assert sequence.camera == Camera("omnidirectional", None)

    def test_frames_are_in_time_order_not_in_name_order(self, tmp_path):
        late = "t1000000000.000000_x0.000000_y0.000000_a0.000000.jpeg"
        early = "t999999999.000000_x0.000000_y0.000000_a0.000000.jpeg"
        assert late < early
        sequence = read_cold(make_cold(tmp_path / "seq", [late, early]))
        assert [frame.file for frame in sequence.frames] == [early, late]

    def test_only_names_are_read(self, tmp_path):
        root = make_cold(tmp_path / "seq", cold_names(2))
        for image in (root / "omni_cam").iterdir():
            image.write_bytes(b"not an image")
        assert len(read_cold(root)) == 2

    def test_labels_may_be_named_in_another_case_and_without_endings(self, tmp_path):
        names = cold_names(3)
        root = make_cold(tmp_path / "seq", names, label=None)
        (root / "localization").mkdir()
        lines = [f"{names[0].upper()} CR-A", f"omni_cam/{names[1].removesuffix('.jpeg')} KT-A", f"{names[2]} CR-B"]
        (root / "localization" / "Places.LST").write_text("\n".join(lines))
        assert scan_cold(root).sequence().rooms == ("CR", "KT", "CR")

    def test_labels_are_optional(self, tmp_path):
        assert read_cold(make_cold(tmp_path / "seq", cold_names(2), label=None)).rooms == (None, None)

    @pytest.mark.parametrize("inner", ["cold-freiburg_part_a_seq2_cloudy3", "inner folder", "日本"])
    def test_the_only_nested_folder_is_the_sequence(self, tmp_path, inner):
        make_cold(tmp_path / "outer" / inner, cold_names(2))
        sequence = read_cold(tmp_path / "outer")
        assert sequence.root == tmp_path / "outer" / inner
        assert sequence.name == inner.replace(" ", "-")

    def test_the_image_folder_itself_means_its_sequence(self, tmp_path):
        root = make_cold(tmp_path / "seq", cold_names(2))
        assert read_cold(root / "omni_cam").root == root

    def test_several_nested_folders_are_refused(self, tmp_path):
        for name in ("seq1", "seq2"):
            make_cold(tmp_path / name, cold_names(1))
        with pytest.raises(DatasetError, match=r"holds 2 sequences \(seq1, seq2\)"):
            read_cold(tmp_path)

    def test_a_known_family_is_recognised(self, tmp_path):
        sequence = read_cold(make_cold(tmp_path / "cold-freiburg" / "part_a" / "seq2_cloudy3", cold_names(2)))
        assert sequence.card == "cold-freiburg"

    def test_a_bad_name_is_named_and_the_others_counted(self, tmp_path):
        root = make_cold(tmp_path / "seq", [*cold_names(2), "x.jpeg", "y.jpeg", "z.jpeg"], label=None)
        with pytest.raises(DatasetError) as caught:
            read_cold(root)
        assert "omni_cam/x.jpeg" in str(caught.value)
        assert f"and 2 more: `omnieval dataset check cold:{root}` shows all" in str(caught.value)

    def test_a_relative_path_loads_again_from_elsewhere(self, tmp_path, monkeypatch):
        make_cold(tmp_path / "seq", cold_names(2))
        (tmp_path / "elsewhere").mkdir()
        monkeypatch.chdir(tmp_path / "elsewhere")
        source = read_cold("../seq").source
        monkeypatch.chdir("/")
        assert len(read_cold(source.removeprefix("cold:"))) == 2

    def test_a_link_keeps_the_name_it_was_given(self, tmp_path):
        make_cold(tmp_path / "disk7", cold_names(2))
        (tmp_path / "seq2_cloudy3").symlink_to(tmp_path / "disk7")
        assert read_cold(tmp_path / "seq2_cloudy3").name == "seq2_cloudy3"

    def test_links_in_a_circle_are_no_sequence(self, tmp_path):
        (tmp_path / "a").symlink_to(tmp_path / "b")
        (tmp_path / "b").symlink_to(tmp_path / "a")
        for path in (tmp_path / "a", tmp_path / "a" / ".." / "b"):
            with pytest.raises(DatasetError):
                read_cold(path)

    def test_a_link_to_its_own_parent_does_not_hide_the_sequence(self, tmp_path):
        root = make_cold(tmp_path / "outer" / "seq", cold_names(2))
        (root / "omni_cam" / "again").symlink_to(root)
        assert len(read_cold(tmp_path / "outer")) == 2

    @pytest.mark.skipif(sys.platform != "linux", reason="only Linux takes any bytes as a file name")
    def test_a_name_that_is_no_unicode_is_refused_in_printable_words(self, tmp_path):
        root = make_cold(tmp_path / "seq", cold_names(1))
        (root / "omni_cam" / os.fsdecode(b"\xff.jpeg")).touch()
        with pytest.raises(DatasetError) as caught:
            read_cold(root)
        assert str(caught.value).isprintable()
