"""Nothing that is read is executed, and nobody is served but this machine."""

import ast
import zipfile
from pathlib import Path

import numpy as np
import pytest

import omnieval
from tests.cli.test_cli import in_process
from tests.faults.commands import one_line

SOURCES = sorted(Path(omnieval.__file__).parent.rglob("*.py"))
EXECUTING = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "runpy", "code", "yaml"}
SERVING = {"serve_grpc", "serve_web_viewer", "serve_web", "serve", "start_web_viewer_server"}


def calls(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield name, node


def options(call):
    return {keyword.arg: keyword.value for keyword in call.keywords}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(SOURCES[0].parent).as_posix())
def test_no_file_of_ours_executes_or_serves_what_it_reads(path):
    tree = ast.parse(path.read_text("utf-8"))
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names = [node.module or ""]
        assert not EXECUTING & {name.partition(".")[0] for name in names}, ast.unparse(node)
    for name, call in calls(tree):
        bare = isinstance(call.func, ast.Name)
        assert not (bare and name in {"eval", "exec", "compile", "__import__"}), ast.unparse(call)
        assert name not in {"system", "popen"}, ast.unparse(call)
        assert name not in SERVING, ast.unparse(call)
        assert "shell" not in options(call), ast.unparse(call)
        allowed = options(call).get("allow_pickle")
        assert allowed is None or ast.unparse(allowed) == "False", ast.unparse(call)
        if name in {"load_objects", "deserialize"}:
            raise AssertionError(ast.unparse(call))


def test_whoever_we_start_or_listen_as_is_bound_to_this_machine():
    view = next(path for path in SOURCES if path.name == "viewer.py" and path.parent.name == "recording")
    assert '_LOOPBACK = "127.0.0.1"' in view.read_text("utf-8")
    launched = 0
    for path in SOURCES:
        for name, call in calls(ast.parse(path.read_text("utf-8"))):
            if name == "bind":
                assert ast.unparse(call.args[0]).startswith("(_LOOPBACK"), f"{path}: {ast.unparse(call)}"
            if name in {"create_server", "TCPServer", "HTTPServer", "ThreadingHTTPServer", "listen"}:
                raise AssertionError(f"{path} listens: {ast.unparse(call)}")
            if name == "Popen":
                launched += 1
                assert "'--bind', _LOOPBACK" in ast.unparse(call), f"{path}: {ast.unparse(call)}"
    assert launched == 1


class Pickled:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (Path.touch, (self.path,))


@pytest.mark.parametrize("key", ["position", "orientation", "file", "room"])
def test_an_archive_with_a_pickle_in_it_is_refused_and_not_opened(panoramas, tmp_path, key):
    assert in_process("describe", panoramas, "--limit", 20, "--out", "a.npz", cwd=tmp_path).returncode == 0
    with np.load(tmp_path / "a.npz") as arrays:
        content = dict(arrays)
    content[key] = np.array([Pickled(tmp_path / "executed")] * 20, dtype=object)
    file = content.pop("file")
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as archive:
        for name, array in {**content, "file": file}.items():
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, array, allow_pickle=True)
    result = in_process("map", "b.npz", "--set", "n_init=10", "--set", "n_new=10", cwd=tmp_path)
    assert result.returncode == 3
    assert "b.npz" in one_line(result.stderr)
    assert not (tmp_path / "executed").exists()
