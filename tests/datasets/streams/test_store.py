"""What was decoded is kept while the stream stays as it is, whole or not at all, whoever else decodes it."""

import json
import shutil
import subprocess
import sys

import pytest

from omnieval.datasets.sequence import Frame
from omnieval.datasets.source import parse
from omnieval.datasets.streams.store import INDEX, Contents, decoded
from omnieval.descriptors.cache_folder import prune
from omnieval.errors import DatasetError


@pytest.fixture
def stream(tmp_path, monkeypatch):
    monkeypatch.setenv("OMNIEVAL_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "tour.mp4"
    path.write_bytes(b"stream")
    return path


class Decoder:
    """Writes one image and counts how often it was asked to."""

    def __init__(self, image=b"image"):
        self.calls = 0
        self.image = image

    def __call__(self, folder):
        self.calls += 1
        (folder / "frame000000.png").write_bytes(self.image)
        return Contents((Frame(folder / "frame000000.png", "frame000000.png", 7),))


def held(path, decoder, options=""):
    address = parse("video", f"{path}{options}")
    return decoded(address, [address.path], decoder)


def test_a_stream_is_decoded_once(stream):
    decoder = Decoder()
    folder, contents = held(stream, decoder)
    assert held(stream, decoder) == (folder, contents)
    assert decoder.calls == 1
    assert contents.frames == (Frame(folder / "frame000000.png", "frame000000.png", 7),)
    assert sorted(path.name for path in folder.iterdir()) == ["frame000000.png", INDEX]


def test_a_stream_that_was_replaced_is_decoded_again_and_so_is_one_with_other_options(stream):
    decoder = Decoder()
    folders = {held(stream, decoder)[0], held(stream, decoder, "#every=2")[0]}
    other = stream.with_name("other.mp4")
    other.write_bytes(b"STREAM")
    shutil.copystat(stream, other)  # the same size, and the same time of change
    other.replace(stream)
    folders.add(held(stream, decoder)[0])
    assert (decoder.calls, len(folders)) == (3, 3)


def test_where_it_lies_does_not_matter(stream):
    decoder = Decoder()
    folder, _ = held(stream, decoder)
    link = stream.with_name("link.mp4")
    link.symlink_to(stream)
    assert held(link, decoder)[0] == folder
    assert decoder.calls == 1


@pytest.mark.parametrize("lost", ["frame000000.png", INDEX])
def test_what_was_lost_from_the_cache_is_decoded_again(stream, lost):
    decoder = Decoder()
    folder, contents = held(stream, decoder)
    (folder / lost).unlink()
    assert held(stream, decoder) == (folder, contents)
    assert decoder.calls == 2
    assert (folder / "frame000000.png").read_bytes() == b"image"


def test_a_decoder_that_fails_leaves_nothing(stream, tmp_path):
    def fails(folder):
        (folder / "frame000000.png").write_bytes(b"half")
        raise DatasetError("is damaged")

    with pytest.raises(DatasetError, match="is damaged"):
        held(stream, fails)
    assert [path for path in (tmp_path / "cache" / "streams").iterdir() if path.is_dir()] == []


def test_what_killed_processes_left_is_removed(stream):
    folder, _ = held(stream, Decoder())
    left = folder.with_name(f".{folder.name}-abc")
    shutil.move(folder, left)
    held(stream, Decoder())
    assert not left.exists()


def test_a_stream_that_grows_meanwhile_is_refused(stream):
    def recording(folder):
        stream.write_bytes(stream.read_bytes() + b"more")
        return Decoder()(folder)

    with pytest.raises(DatasetError, match="changed while it was read"):
        held(stream, recording)
    assert held(stream, Decoder())[1].frames


def test_a_cache_that_cannot_be_written_is_said(stream, tmp_path):
    (tmp_path / "cache").write_text("a file")
    with pytest.raises(DatasetError, match=r"cannot be kept in the cache .*OMNIEVAL_CACHE"):
        held(stream, Decoder())


_PROCESS = """
import json, sys
from pathlib import Path
from omnieval.datasets.source import parse
from omnieval.datasets.streams.store import decoded
from tests.datasets.streams.test_store import Decoder
address, decoder = parse("video", sys.argv[1]), Decoder()
sys.stdin.readline()
folder, contents = decoded(address, [address.path], decoder)
print(json.dumps([folder.name, decoder.calls, contents.frames[0].read().decode()]))
"""


@pytest.mark.slow
def test_of_two_processes_at_once_one_decodes(stream):
    command = [sys.executable, "-c", _PROCESS, str(stream)]
    both = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    for one in both:
        assert one.stdin is not None
        one.stdin.write("go\n")
        one.stdin.flush()
    said = [json.loads(one.communicate()[0]) for one in both]
    assert said[0][0] == said[1][0]
    assert sorted(calls for _, calls, _ in said) == [0, 1]
    assert {image for _, _, image in said} == {"image"}


def test_what_a_process_has_opened_is_not_pruned(stream):
    folder, _ = held(stream, Decoder())
    pruned = prune(most_bytes=0)
    assert [item.paths for item in pruned.in_use] == [(folder,)]
    assert (folder / "frame000000.png").exists()


def test_what_was_pruned_is_decoded_again(stream):
    decode = "import sys; from tests.datasets.streams.test_store import *; held(sys.argv[1], Decoder())"
    subprocess.run([sys.executable, "-c", decode, str(stream)], check=True)
    assert [item.kind for item in prune(most_bytes=0).removed] == ["streams"]  # once it has ended, it holds nothing
    decoder = Decoder()
    held(stream, decoder)
    assert decoder.calls == 1
