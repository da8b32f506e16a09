"""Whatever the bytes of a file are, only errors that omnieval raises on purpose come out of the readers.

Valid inputs are changed here and there, so that the changes get past the first check of a reader. How many times is
set by ``OMNIEVAL_FUZZ`` (examples a test); the default is small and always the same.
"""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from omnieval.config import Config, Setting, parameters, parse_assignment, read_settings, resolve
from omnieval.datasets import load
from omnieval.datasets.cards import card, overridden, parse_camera, parse_card
from omnieval.datasets.cold import format_name, parse_name, scan_places
from omnieval.datasets.findings import errors
from omnieval.datasets.poses import scan_table
from omnieval.datasets.registry import scan
from omnieval.descriptors.archive import load_archive
from omnieval.errors import ConfigError, DatasetError, OmnievalError
from omnieval.regression.reference import read_reference
from tests.datasets.trees import cold_names, make_folder

T = TypeVar("T")
EXAMPLES = os.environ.get("OMNIEVAL_FUZZ")
settings.register_profile("fuzz", max_examples=int(EXAMPLES or 200), deadline=None, derandomize=EXAMPLES is None)
fuzzed = settings(settings.get_profile("fuzz"), database=None)

TOKENS = (
    b"", b"\0", b"\n", b"\r", b"\t", b" ", b",", b";", b".", b"-", b"_", b"=", b"'", b'"', b"[", b"]", b"{", b"}", b"#",
    b"\xff", b"\xfe", b"\xed\xa0\x80", b"\xef\xbb\xbf", "é".encode(), "٣".encode(), "\u2028".encode(), b"\x1b[31m",
    b"nan", b"-inf", b"1e999", b"-1", b"0", b"1_0", b"0x1F", b"9" * 30, b"9" * 5000, b"[" * 2000, b"a." * 1000,
    b"true", b"1979-05-27", b"../", b"/", b"**", b"PK\x05\x06", b"O", b"|O", b"(-1,)",
)  # fmt: skip


@st.composite
def changed(draw: st.DrawFn, *originals: bytes) -> bytes:
    """One of some valid inputs after a few cuts, repetitions, insertions and flipped bits."""
    data = bytearray(draw(st.sampled_from(originals)))
    for _ in range(draw(st.integers(1, 5))):
        start = draw(st.integers(0, len(data)))
        end = min(len(data), start + draw(st.integers(0, 12)))
        kind = draw(st.sampled_from(["insert", "replace", "cut", "repeat", "flip", "end"]))
        if kind in {"insert", "replace"}:
            data[start : end if kind == "replace" else start] = draw(st.sampled_from(TOKENS))
        elif kind == "cut":
            del data[start:end]
        elif kind == "repeat":
            data[start:start] = data[start:end]
        elif kind == "flip" and start < len(data):
            data[start] ^= 1 << draw(st.integers(0, 7))
        elif kind == "end":
            del data[start:]
    return bytes(data)


def text_of(data: bytes) -> str:
    """Text as a name or an argument may hold it: bytes that are no UTF-8 become surrogates."""
    return data.decode("utf-8", "surrogateescape")


def _answer(read: Callable[[], T]) -> tuple[T | None, str]:
    """What a reader returns, or how it refuses; every other error is let through."""
    try:
        return read(), ""
    except OmnievalError as error:
        return None, str(error)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@fuzzed
@given(changed(*(name.encode() for name in cold_names(2))))
def test_a_cold_name_is_read_or_refused(data):
    try:
        time_ns, pose = parse_name(text_of(data))
    except DatasetError:
        return
    assert 0 <= time_ns < 2**63
    assert all(math.isfinite(value) for value in (pose.x, pose.y, pose.yaw))
    assert parse_name(format_name(time_ns, pose))[0] == time_ns


@fuzzed
@given(changed("".join(f"{name} 2PO{i}-A\n" for i, name in enumerate(cold_names(3))).encode()))
def test_a_list_of_places_is_read_or_refused(data):
    rooms, faults = scan_places(text_of(data))
    assert all(fault.message.isprintable() for fault in faults)
    assert all(name and room and room.split() == [room] for name, room in rooms.items())


@fuzzed
@given(changed(b"file,x,y,yaw,room,time\n0.png,1.5,-2,0.5,CR,12.25\n1.png,1.5,-2,0.5,CR,12.5\n2.png,,,,,\n"))
def test_a_table_of_poses_is_read_or_refused(data):
    table, faults = scan_table(data, "poses.csv")
    captures = [row.capture for row in table.rows if row.capture is not None]
    assert all(fault.message.isprintable() for fault in faults)
    assert all(capture.time_ns is None or abs(capture.time_ns) < 2**63 for capture in captures)


@fuzzed
@given(changed(b'kind = "omnidirectional"\n[mirror]\ncx = 320.0\ncy = 240\nr_in = 45.0\nr_out = 230.0\n'))
def test_a_camera_is_read_or_refused(data):
    try:
        camera = parse_camera(text_of(data))
    except DatasetError:
        return
    assert camera.mirror is None or 0 <= camera.mirror.r_in < camera.mirror.r_out


CARDS = (
    b'title = "A"\nget = "from"\ncitation = "C"\nimage_size = [640, 480]\nfolders = ["a"]\n[rooms]\nCR = "corridor"\n'
    b"[mirror]\ncx = 1.0\ncy = 1.0\nr_in = 1.0\nr_out = 2.0\n[[sequences]]\npath = 'a/b'\nimages = 3\nlength_m = 2.5\n",
    b"[layout]\nimages = 'omni/*.png'\nkind = 'auto'\n[layout.ground_truth]\nfile = 'gt.csv'\nheader = true\n"
    b"columns = ['file', 'x', 'y', 'yaw', '-']\ndelimiter = ';'\nlength_unit = 'cm'\nangle_unit = 'deg'\n",
)


@fuzzed
@given(changed(*CARDS))
def test_a_data_card_is_read_or_refused(data):
    text = text_of(data)
    for read in (lambda: parse_card("mine", text), lambda: overridden(card("innova"), text, "innova.toml")):
        try:
            found = read()
        except DatasetError:
            continue
        assert found.mirror is None or found.mirror.r_in < found.mirror.r_out


@pytest.fixture(scope="module")
def innova(place):
    root: Path = make_folder(place / "route", [f"{number}.png" for number in range(4)])
    return root


@fuzzed
@given(
    own=st.one_of(st.just(CARDS[1].replace(b"omni/*", b"*")), changed(CARDS[1].replace(b"omni/*", b"*"))),
    truth=changed(b"file;x;y;yaw;\n" + b"".join(b"%d.png;1.5;2;30;a\n" % number for number in range(4))),
)
def test_ground_truth_and_its_card_are_read_or_refused(innova, own, truth):
    (innova / "innova.toml").write_bytes(own)
    (innova / "gt.csv").write_bytes(truth)
    for finding in (found := scan(f"innova:{innova}")).findings:
        assert finding.message
        assert finding.message.isprintable()
    try:
        sequence = load(f"innova:{innova}")
    except DatasetError:
        assert errors(found.findings)
        return
    assert all(frame.path.is_relative_to(innova) for frame in sequence.frames)


@fuzzed
@given(changed(b"omega=1.85", b"covariance=pinv", b"hog.bins=8", b"imaging.cx=320", b"descriptor=gist", b"seed=7"))
def test_an_assignment_is_taken_or_refused(data):
    try:
        config = resolve([parse_assignment(text_of(data))])
    except ConfigError:
        return
    assert survives_the_manifest(config)


def survives_the_manifest(config):
    """Whether ``run.json`` gives a configuration back as it was."""
    about = {"mapper": config.mapper.about, "descriptor": config.descriptor.about}
    told = json.loads(json.dumps(about | {"imaging": config.imaging.model_dump(mode="json")}))
    return Config.of_run(told) == config


@fuzzed
@given(name=st.sampled_from(sorted(parameters())), value=st.one_of(st.floats(), st.integers(), st.text(), st.binary()))
def test_a_value_is_taken_or_refused(name, value):
    config, refusal = _answer(lambda: resolve([Setting(name, value, "here")]))
    if config is None:
        assert name in refusal
    else:
        assert survives_the_manifest(config)


@fuzzed
@given(changed(b'omega = 1.85\nn_new = 30\ncovariance = "pinv"\n[hog]\nbins = 8\n[imaging]\nkind = "panoramic"\n'))
def test_a_file_of_parameters_is_taken_or_refused(place, data):
    (place / "mine.toml").write_bytes(data)
    config, refusal = _answer(lambda: resolve(read_settings(place / "mine.toml")))
    assert config is not None or str(place / "mine.toml") in refusal


REFERENCE = b"""schema_version = 2
[[case]]
name = "night"
source = "synthetic:night"
cut = { start = 0, stride = 1 }
trace = "synthetic/night.parquet"
[case.parameters]
descriptor = "hog"
omega = 1.85
[case.expected]
nodes = { value = 9, min = 8, max = 10 }
silhouette = { value = 0.31, tolerance = 0.02 }
share_forced = { value = 0.04, tolerance = 0.05, better = "lower" }
[case.made]
date = "2026-01-31T12:00:00+00:00"
code = "a"
dataset_fingerprint = "b"
versions = { numpy = "2.0" }
parameters = { omega = 1.85 }
"""


@fuzzed
@given(changed(REFERENCE))
def test_a_reference_is_read_or_refused(place, data):
    (place / "mine.toml").write_bytes(data)
    try:
        for case in read_reference(place / "mine.toml"):
            case.config()
    except OmnievalError:
        return


def _npz(*, compressed: int = zipfile.ZIP_STORED, objects: bool = False) -> bytes:
    rng = np.random.default_rng(0)
    arrays = {
        "position": rng.random((3, 2), np.float32),
        "orientation": rng.random((3, 2, 2), np.float32),
        "file": np.array(["a", "b", "c"]),
        "xy": np.array([{}] * 3, dtype=object) if objects else rng.random((3, 2)),
        "yaw": rng.random(3),
        "room": np.array(["R"] * 3),
        "time_ns": np.arange(3),
    }
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compressed) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, array, allow_pickle=True)
            # A fixed date, so that the bytes are always the same.
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), member.getvalue(), compressed)
    return stream.getvalue()


@fuzzed
@given(st.one_of(st.binary(), changed(_npz(), _npz(compressed=zipfile.ZIP_DEFLATED), _npz(objects=True))))
@example(_npz(objects=True))
@example(_npz(compressed=zipfile.ZIP_LZMA))
def test_an_archive_is_read_or_refused(place, data):
    (place / "d.npz").write_bytes(data)
    archive, refusal = _answer(lambda: load_archive(place / "d.npz"))
    if archive is None:
        assert str(place / "d.npz") in refusal
        return
    assert np.isfinite(archive.position).all()
    assert np.isfinite(archive.orientation).all()
    assert len(archive.frames) == len(archive.position) == len(archive.orientation)
