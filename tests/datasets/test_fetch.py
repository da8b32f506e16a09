"""Downloads, from a server on this machine that breaks off, changes its files, or serves what one must not unpack."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
import threading
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from omnieval.datasets import load
from omnieval.datasets.fetch import fetch
from omnieval.errors import ConfigError, DatasetError
from tests.cli.test_cli import in_process
from tests.datasets.trees import cold_names, make_cold

NAME = "cold-freiburg/part_a/seq2_cloudy3"


@dataclass
class Server:
    """What is served, under which ETag, and after how many bytes each answer in turn breaks off (None: not at all)."""

    files: dict[str, bytes]
    tag: str | None = '"1"'
    breaks: list[int | None] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    url: str = ""


@pytest.fixture
def server():
    served = Server({})

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            wanted = self.headers.get("Range", "")
            served.asked.append(wanted)
            data = served.files.get(self.path)
            if data is None:
                self.send_error(404)
                return
            start = 0
            if wanted and self.headers.get("If-Range") == served.tag:
                start = int(wanted.removeprefix("bytes=").removesuffix("-"))
            if start >= len(data):
                self.send_error(416)
                return
            self.send_response(206 if start else 200)
            if start:
                self.send_header("Content-Range", f"bytes {start}-{len(data) - 1}/{len(data)}")
            self.send_header("Content-Length", str(len(data) - start))
            if served.tag:
                self.send_header("ETag", served.tag)
            self.end_headers()
            length = served.breaks.pop(0) if served.breaks else None
            self.wfile.write(data[start:][:length])

        def log_message(self, format, *args):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as listening:
        served.url = f"http://127.0.0.1:{listening.server_address[1]}/mirror"
        thread = threading.Thread(target=listening.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield served
        listening.shutdown()
        thread.join()


@pytest.fixture
def archive(server, tmp_path):
    """The archive of a small sequence of COLD, a folder around it, on the server."""
    sequence = make_cold(tmp_path / "made" / "seq2_cloudy3", cold_names(12))
    return put(server, lambda opened: opened.add(sequence, "seq2_cloudy3"))


def put(server, fill):
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode="w") as opened:
        fill(opened)
    server.files[f"/mirror/{NAME}.tar"] = data.getvalue()
    return data.getvalue()


def get(server, tmp_path, **options):
    return fetch(NAME, tmp_path / "data", base_url=server.url, **options)


def starts(server):
    """Return from which byte on each answer was asked for."""
    return [int(wanted.removeprefix("bytes=").removesuffix("-") or 0) for wanted in server.asked]


def left(tmp_path):
    return sorted(path.name for path in (tmp_path / "data" / "cold-freiburg" / "part_a").iterdir())


def test_a_sequence_is_downloaded_unpacked_and_read(server, archive, tmp_path):
    told = []
    folder = get(server, tmp_path, progress=lambda done, total: told.append((done, total)))
    assert folder == tmp_path / "data" / "cold-freiburg" / "part_a" / "seq2_cloudy3"
    assert len(load(folder)) == 12
    assert load(folder).card == "cold-freiburg"
    assert told[-1] == (len(archive), len(archive))
    assert left(tmp_path) == ["seq2_cloudy3", "seq2_cloudy3.tar.sha256"]
    recorded = (folder.parent / "seq2_cloudy3.tar.sha256").read_text()
    assert recorded == f"{hashlib.sha256(archive).hexdigest()}  seq2_cloudy3.tar\n"


def test_what_is_there_is_not_downloaded_again(server, archive, tmp_path):
    folder = get(server, tmp_path)
    assert get(server, tmp_path) == folder
    assert len(server.asked) == 1


def test_a_download_that_breaks_off_is_gone_on_with_at_once(server, archive, tmp_path):
    server.breaks = [len(archive) // 3] * 2
    assert len(load(get(server, tmp_path))) == 12
    first, second, third = starts(server)
    assert first == 0 < second < third


def test_a_download_that_was_given_up_is_gone_on_with_later(server, archive, tmp_path):
    server.breaks = [len(archive) // 3, 0, 0, 0]
    with pytest.raises(DatasetError, match=r"broken.* \d+ bytes are kept, so run the command again"):
        get(server, tmp_path)
    assert left(tmp_path) == [".seq2_cloudy3.tar.part", ".seq2_cloudy3.tar.part.json"]
    assert len(load(get(server, tmp_path))) == 12
    assert starts(server)[-1] > 0
    assert left(tmp_path) == ["seq2_cloudy3", "seq2_cloudy3.tar.sha256"]


@pytest.mark.parametrize("tag", ['"2"', None])
def test_an_archive_that_changed_meanwhile_is_downloaded_anew(server, archive, tmp_path, tag):
    server.breaks = [len(archive) // 3, 0, 0, 0]
    with pytest.raises(DatasetError):
        get(server, tmp_path)
    server.tag = tag
    more = make_cold(tmp_path / "more" / "seq2_cloudy3", cold_names(15))
    put(server, lambda opened: opened.add(more, "seq2_cloudy3"))
    assert len(load(get(server, tmp_path))) == 15


def test_a_download_that_was_killed_at_its_end_is_finished(server, archive, tmp_path):
    server.breaks = [len(archive) // 3, 0, 0, 0]
    with pytest.raises(DatasetError):
        get(server, tmp_path)
    (tmp_path / "data" / "cold-freiburg" / "part_a" / ".seq2_cloudy3.tar.part").write_bytes(archive)
    assert len(load(get(server, tmp_path))) == 12


def test_a_later_download_must_be_the_same_archive(server, archive, tmp_path):
    folder = get(server, tmp_path)
    folder.rename(tmp_path / "elsewhere")
    assert len(load(get(server, tmp_path))) == 12
    folder.rename(tmp_path / "elsewhere too")
    put(server, lambda opened: opened.add(tmp_path / "made", "seq2_cloudy3"))
    with pytest.raises(DatasetError, match=r"not the archive that was downloaded before: .*seq2_cloudy3\.tar\.sha256"):
        get(server, tmp_path)
    assert not folder.exists()


def outside(opened):
    info = tarfile.TarInfo("../../stolen.txt")
    info.size = 4
    opened.addfile(info, io.BytesIO(b"data"))


def absolute_link(opened):
    info = tarfile.TarInfo("seq2_cloudy3/link")
    info.type, info.linkname = tarfile.SYMTYPE, "/etc/passwd"
    opened.addfile(info)


@pytest.mark.parametrize("fill", [outside, absolute_link])
def test_an_archive_that_leaves_its_folder_is_refused(server, tmp_path, fill):
    put(server, fill)
    with pytest.raises(DatasetError, match="is not safe and was removed"):
        get(server, tmp_path)
    assert left(tmp_path) == []
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


@pytest.mark.parametrize("spoil", [lambda data: b"<html>please log in</html>", lambda data: data[: len(data) // 2]])
def test_what_is_no_sound_archive_is_refused_and_not_remembered(server, archive, tmp_path, spoil):
    server.files[f"/mirror/{NAME}.tar"] = spoil(archive)
    with pytest.raises(DatasetError, match="is not a sound archive and was removed"):
        get(server, tmp_path)
    assert left(tmp_path) == []
    server.files[f"/mirror/{NAME}.tar"] = archive
    assert len(load(get(server, tmp_path))) == 12


@pytest.mark.parametrize("inside", ["", "cold-freiburg/part_a/seq2_cloudy3/"])
def test_folders_around_the_sequence_are_left_out(server, tmp_path, inside):
    sequence = make_cold(tmp_path / "made" / "seq2_cloudy3", cold_names(12))
    put(server, lambda opened: opened.add(sequence / "omni_cam", f"{inside}omni_cam"))
    folder = get(server, tmp_path)
    assert [path.name for path in folder.iterdir()] == ["omni_cam"]


def test_what_the_server_has_not_is_said_with_a_way_on(server, tmp_path):
    with pytest.raises(DatasetError, match=r"there is no http://.*seq2_cloudy3\.tar; .*https://www.cas.kth.se/COLD/"):
        get(server, tmp_path)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("cold-friburg/part_a/x", "did you mean cold-freiburg?"),
        ("cold-freiburg", "write for example cold-freiburg/part_a/seq2_cloudy3"),
        ("cold-freiburg/../x", "names no sequence"),
        ("innova/route1", "where innova can be downloaded is not known"),
    ],
)
def test_a_name_that_is_no_sequence_is_refused(name, words, tmp_path):
    with pytest.raises(ConfigError, match=words.replace("?", r"\?")):
        fetch(name, tmp_path / "data")
    assert list(tmp_path.iterdir()) == []


def test_the_command_prints_the_folder(server, archive, tmp_path):
    done = in_process("dataset", "fetch", NAME, "--base-url", server.url, cwd=tmp_path)
    assert done.stdout == f"{tmp_path / 'datasets' / NAME}\n"
    assert "omnieval dataset check" in done.stderr
    again = in_process("dataset", "fetch", NAME, "--base-url", server.url, "--json", cwd=tmp_path)
    assert json.loads(again.stdout) == {"schema_version": 1, "folder": str(tmp_path / "datasets" / NAME)}


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("cold-freiburg", "omnieval dataset fetch cold-freiburg/part_a/seq2_cloudy3"),
        ("cold-freiburg", "omnieval dataset info cold-freiburg"),
        (NAME, f"omnieval dataset fetch {NAME}"),
        ("innova", "omnieval dataset info innova"),
        ("cold-friburg", "did you mean cold-freiburg?"),
    ],
)
def test_the_name_of_a_card_is_no_source_and_the_right_command_is_said(source, words, tmp_path):
    for command in (["dataset", "check"], ["replay"]):
        done = in_process(*command, source, cwd=tmp_path)
        assert done.returncode == 3
        assert words in done.stdout + done.stderr
