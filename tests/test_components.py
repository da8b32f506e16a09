"""A component is found by any of its names, known by its identity, and made again only as it was."""

from __future__ import annotations

import dataclasses
import importlib
import os
import sys
import types
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel, ValidationError

from omnieval.components.component import Component, resolve_component
from omnieval.components.names import find_class, known
from omnieval.descriptors.description import Description
from omnieval.descriptors.hog import Hog, HogSettings
from omnieval.errors import ConfigError, ResultError
from omnieval.mapping.interface import Mapper, NoSettings
from omnieval.mapping.leader import Leader, LeaderSettings

GREY = np.arange(32, dtype=np.uint8).reshape(4, 8)

SOURCE = """
import numpy as np
import omnieval

class Tiny:
    scale = 1

    def describe(self, panorama):
        return omnieval.Description(np.full(2, {value}, np.float32), np.ones((4, 1), np.float32))
"""

WITH_SIBLING = """
import numpy as np
import omnieval
from helper import VALUE

class Tiny:
    def describe(self, panorama):
        return omnieval.Description(np.full(2, VALUE, np.float32), np.ones((4, 1), np.float32))
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "own.py"
    path.write_text(SOURCE.format(value=1))
    return path


def described(component: Component) -> float:
    """The number that a `Tiny` fills its descriptor with."""
    return float(component.make().describe(GREY).position[0])


def overwrite(path: Path, text: str) -> None:
    """Change a file as `cp -p` does: its size and times stay."""
    status = path.stat()
    assert len(text) == status.st_size
    path.write_text(text)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


class Banded(BaseModel):
    rows: int = 4


class Bands:
    name = "bands"
    Settings = Banded

    def __init__(self, settings: Banded | None = None) -> None:
        self.settings = settings or Banded()

    def describe(self, panorama: Any) -> Description:
        rows = panorama.reshape(self.settings.rows, -1).mean(axis=1)
        return Description(rows.astype(np.float32), np.ones((4, 1), np.float32))


class Reach:
    """A mapper that keeps its parameter to itself, and much else."""

    def __init__(self, reach: float = 2.0) -> None:
        self._reach = reach
        self.seen: list[int] = []

    def step(self, description: Description) -> None:
        self.seen.append(1)


class Derived(Mapper):
    """A mapper that derives from the base class, and has a constructor as it likes."""

    name = "derived"

    def __init__(self, reach: float = 2.0) -> None:
        super().__init__()
        self.reach = reach

    def step(self, description: Description) -> Any: ...

    def finish(self) -> Any: ...


class TestNames:
    @pytest.mark.parametrize(("kind", "names"), [("descriptor", ["hog", "gist"]), ("mapper", ["roman2020", "leader"])])
    def test_those_that_come_with_us_are_known_and_made(self, kind: Any, names: list[str]) -> None:
        assert known(kind)[:2] == names
        for name in names:
            component = resolve_component(kind, name)
            assert (component.kind, component.name, component.spec) == (kind, name, name)
            assert component.make().settings.model_dump(mode="json") == component.settings
            assert component.is_default == (name == names[0])

    def test_a_package_and_class(self) -> None:
        found = resolve_component("descriptor", f"{__name__}:Bands", {"rows": 2})
        assert (found.name, found.spec, found.settings) == ("bands", f"{__name__}:Bands", {"rows": 2})
        assert found.make().describe(GREY).position.tolist() == [7.5, 23.5]

    def test_the_place_of_one_of_ours_is_the_same_as_its_name(self) -> None:
        assert (
            resolve_component("mapper", "omnieval.mapping.leader:Leader").identity
            == resolve_component("mapper", "leader").identity
        )

    def test_a_file_and_class(self, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        found = resolve_component("descriptor", f"{file}:Tiny")
        assert (found.name, described(found)) == ("tiny", 1.0)
        monkeypatch.chdir(file.parent)
        assert resolve_component("descriptor", "own.py:Tiny").identity == found.identity

    def test_an_entry_point(self, monkeypatch: pytest.MonkeyPatch) -> None:
        entry = EntryPoint("plugin", f"{__name__}:Bands", "omnieval.descriptors")
        monkeypatch.setattr(
            "omnieval.components.names.entry_points", lambda group: [entry] if group == entry.group else []
        )
        assert known("descriptor") == ["hog", "gist", "plugin"]
        assert known("mapper") == ["roman2020", "leader", "geodesic", "birch", "valley"]
        found = resolve_component("descriptor", "plugin", {"rows": 2})
        assert (found.name, found.spec, found.settings) == ("bands", "plugin", {"rows": 2})
        assert isinstance(found.make(), Bands)
        with pytest.raises(ConfigError, match="unknown mapper 'plugin'"):
            resolve_component("mapper", "plugin")

    def test_an_entry_point_does_not_replace_one_of_ours(self, monkeypatch: pytest.MonkeyPatch) -> None:
        entry = EntryPoint("hog", f"{__name__}:Bands", "omnieval.descriptors")
        monkeypatch.setattr("omnieval.components.names.entry_points", lambda group: [entry])
        assert isinstance(resolve_component("descriptor", "hog").make(), Hog)
        assert known("descriptor") == ["hog", "gist"]

    def test_a_class(self) -> None:
        found = resolve_component("descriptor", Bands, {"rows": 2})
        assert found.identity == resolve_component("descriptor", f"{__name__}:Bands", {"rows": 2}).identity
        assert resolve_component("descriptor", Hog).spec == "hog"

    def test_a_class_that_only_this_process_knows_can_be_made_here(self) -> None:
        class Local(Bands):
            name = "local"

        found = resolve_component("descriptor", Local, {"rows": 2})
        assert (found.name, found.spec, found.settings) == ("local", None, {"rows": 2})
        assert isinstance(found.make(), Local)
        assert found.fresh().settings == Banded(rows=2)

    def test_an_object(self) -> None:
        given = Bands(Banded(rows=1))
        found = resolve_component("descriptor", given)
        assert found.make() is given
        assert found.fresh() is not given
        assert found.fresh().settings == given.settings
        assert found.identity == resolve_component("descriptor", Bands, {"rows": 1}).identity
        assert (
            resolve_component("mapper", Leader(LeaderSettings(radius=4.0))).identity
            == resolve_component("mapper", "leader", {"radius": 4.0}).identity
        )

    def test_a_component_is_what_it_is_but_only_as_its_own_kind(self) -> None:
        leader = resolve_component("mapper", "leader")
        assert resolve_component("mapper", leader) is leader
        with pytest.raises(ConfigError, match="leader is not a descriptor but a mapper"):
            resolve_component("descriptor", leader)

    def test_a_name_is_made_of_the_class_where_it_has_none(self) -> None:
        assert resolve_component("mapper", Reach).name == "reach"
        greys = types.new_class("GreyBands2", (), {}, lambda body: body.update(describe=Bands.describe))
        assert resolve_component("descriptor", greys()).name == "grey-bands2"


class TestIdentity:
    def test_other_settings_are_another_identity(self) -> None:
        one, other = (resolve_component("mapper", "leader", {"radius": radius}) for radius in (2.0, 3.0))
        assert one.identity != other.identity
        assert one.about["identity"] != other.about["identity"]
        assert one.code == other.code
        assert resolve_component("mapper", "leader").identity == other.identity, "the default is 3"

    def test_what_an_object_keeps_to_itself_counts(self) -> None:
        one, other, again = (resolve_component("mapper", Reach(reach)) for reach in (2.0, 3.0, 2.0))
        assert one.identity == again.identity != other.identity

    def test_a_base_class_without_parameters_hides_none(self) -> None:
        made = resolve_component("mapper", f"{__name__}:Derived").make()
        assert (made.reach, made.settings) == (2.0, NoSettings())
        assert resolve_component("mapper", Derived(3.0)).settings == {"reach": 3.0}
        assert resolve_component("mapper", Derived(3.0)).fresh().reach == 3.0

    def test_an_array_counts(self) -> None:
        def projecting(seed: int) -> Component:
            given = Bands()
            vars(given).pop("settings")
            given.matrix = np.random.default_rng(seed).random((3, 3))  # type: ignore[attr-defined]
            return resolve_component("descriptor", given)

        assert projecting(0).identity == projecting(0).identity != projecting(1).identity

    def test_what_wraps_another_component_is_known_by_it_too(self) -> None:
        class Wrapped:
            def __init__(self, inner: Hog) -> None:
                self.inner = inner

            def describe(self, panorama: Any) -> Description:
                return self.inner.describe(panorama)

        one, other = (resolve_component("descriptor", Wrapped(Hog(HogSettings(bins=bins)))) for bins in (8, 16))
        assert one.identity != other.identity

    def test_what_it_remembers_while_it_works_is_not_part_of_it(self) -> None:
        given = Reach()
        found = resolve_component("mapper", given)
        before = dict(found.identity)
        given.step(Description(np.zeros(1, np.float32), np.zeros((1, 1), np.float32)))
        assert found.identity == before
        assert found.settings == {"_reach": 2.0}

    def test_slots_are_held_too(self) -> None:
        @dataclasses.dataclass(frozen=True, slots=True)
        class Slotted:
            rows: int = 4

            def describe(self, panorama: Any) -> None: ...

        assert resolve_component("descriptor", Slotted(2)).settings == {"rows": 2}

    def test_other_code_is_another_identity_under_the_same_name(self, tmp_path: Path) -> None:
        found = []
        for number in (1, 2):
            path = tmp_path / str(number) / "own.py"
            path.parent.mkdir()
            path.write_text(SOURCE.format(value=number))
            found.append(resolve_component("descriptor", f"{path}:Tiny"))
        assert found[0].name == found[1].name
        assert found[0].identity != found[1].identity
        path.write_text(SOURCE.format(value=1))
        assert resolve_component("descriptor", f"{path}:Tiny").identity == found[0].identity, "wherever it lies"

    def test_the_two_methods_share_no_code_that_is_only_one_of_theirs(self) -> None:
        roman, leader = (resolve_component("mapper", name) for name in ("roman2020", "leader"))
        assert roman.code != leader.code
        hog, gist = (resolve_component("descriptor", name) for name in ("hog", "gist"))
        assert hog.code != gist.code

    def test_weights_are_known_by_their_bytes(self, tmp_path: Path) -> None:
        file = tmp_path / "weights.bin"
        file.write_bytes(b"one")
        source = tmp_path / "learned.py"
        source.write_text(
            "from pydantic import BaseModel\n"
            f"class Chosen(BaseModel):\n    file: str = {str(file)!r}\n"
            "class Learned:\n    Settings = Chosen\n"
            "    def __init__(self, settings):\n        self.settings, self.weights = settings, settings.file\n"
            "    def describe(self, panorama): ...\n"
        )
        before = resolve_component("descriptor", f"{source}:Learned")
        assert before.weights is not None
        overwrite_bytes = file.stat()
        file.write_bytes(b"two")
        os.utime(file, ns=(overwrite_bytes.st_atime_ns, overwrite_bytes.st_mtime_ns))
        after = resolve_component("descriptor", f"{source}:Learned")
        assert (before.code, before.settings) == (after.code, after.settings)
        assert before.weights != after.weights
        with pytest.raises(ResultError, match=r"learned has changed since the run \(weights\); replay it again"):
            before.again()
        file.unlink()
        with pytest.raises(ConfigError, match=r"cannot read the weights .*weights\.bin"):
            resolve_component("descriptor", f"{source}:Learned")


class TestEditedCode:
    def test_an_edited_file_has_another_digest_and_is_loaded_anew(self, file: Path) -> None:
        before = resolve_component("descriptor", f"{file}:Tiny")
        overwrite(file, SOURCE.format(value=2))
        after = resolve_component("descriptor", f"{file}:Tiny")
        assert before.code != after.code
        assert described(after) == 2.0

    def test_so_has_one_whose_sibling_was_edited(self, tmp_path: Path) -> None:
        path, helper = tmp_path / "own.py", tmp_path / "helper.py"
        path.write_text(WITH_SIBLING)
        helper.write_text("from further import VALUE\n")
        (tmp_path / "further.py").write_text("VALUE = 1\n")
        before = resolve_component("descriptor", f"{path}:Tiny")
        assert described(before) == 1.0
        overwrite(tmp_path / "further.py", "VALUE = 2\n")
        after = resolve_component("descriptor", f"{path}:Tiny")
        assert before.code != after.code
        assert described(after) == 2.0
        (tmp_path / "unrelated.py").write_text("VALUE = 3\n")
        assert resolve_component("descriptor", f"{path}:Tiny").code == after.code

    def test_siblings_of_two_folders_are_not_taken_for_each_other(self, tmp_path: Path) -> None:
        found = []
        for number in (1, 2):
            folder = tmp_path / str(number)
            folder.mkdir()
            (folder / "own.py").write_text(WITH_SIBLING)
            (folder / "helper.py").write_text(f"VALUE = {number}\n")
            found.append(resolve_component("descriptor", f"{folder}/own.py:Tiny"))
        assert [described(component) for component in found] == [1.0, 2.0]
        assert found[0].code != found[1].code
        assert "helper" not in sys.modules

    def test_a_package_is_digested_with_all_it_imports_of_its_own(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        package = tmp_path / "mypackage"
        package.mkdir()
        (package / "__init__.py").write_text("VALUE = 1\n")
        (package / "deep.py").write_text("from . import VALUE\n")
        (package / "own.py").write_text(WITH_SIBLING.replace("from helper", "from mypackage.deep"))
        monkeypatch.syspath_prepend(str(tmp_path))
        before = resolve_component("descriptor", "mypackage.own:Tiny")
        assert described(before) == 1.0
        (package / "__init__.py").write_text("VALUE = 22\n")
        importlib.invalidate_caches()
        # What was edited after it was loaded still runs as it was, and is called what it is.
        assert resolve_component("descriptor", "mypackage.own:Tiny").identity == before.identity
        for name in ("mypackage", "mypackage.deep", "mypackage.own"):
            importlib.reload(sys.modules[name])
        after = resolve_component("descriptor", "mypackage.own:Tiny")
        assert described(after) == 22.0
        assert after.code != before.code
        for name in ("mypackage", "mypackage.deep", "mypackage.own"):
            del sys.modules[name]

    def test_a_class_without_a_file_is_known_by_its_source_and_by_what_it_uses(self) -> None:
        """As in a notebook, where what was typed is not a file."""

        def typed(helper: str, method: str = "return twice(panorama)") -> Component:
            module = types.ModuleType("a_notebook")
            sys.modules["a_notebook"] = module
            exec(
                f"def twice(x):\n    {helper}\nclass Own:\n    def describe(self, panorama):\n        {method}",
                vars(module),
            )
            return resolve_component("descriptor", module.Own())

        one = typed("return x * 2")
        assert one.spec is None
        assert one.identity == typed("return x * 2").identity
        assert one.identity != typed("return x * 3").identity
        assert one.identity != typed("return x * 2", "return twice(twice(panorama))").identity
        del sys.modules["a_notebook"]


class TestAgain:
    def test_what_has_not_changed_is_made_again(self, file: Path) -> None:
        for kind, chosen in (("descriptor", "gist"), ("mapper", "leader"), ("descriptor", f"{file}:Tiny")):
            component = resolve_component(kind, chosen)  # type: ignore[arg-type]
            read = Component.of_run(component.kind, component.about)
            assert read == component
            assert read.again().identity == component.identity
            assert type(read.again().make()).__name__ == type(component.make()).__name__

    def test_edited_code_is_refused_with_a_sentence(self, file: Path) -> None:
        component = resolve_component("descriptor", f"{file}:Tiny")
        overwrite(file, SOURCE.format(value=2))
        with pytest.raises(ResultError) as raised:
            component.again()
        assert str(raised.value) == "the descriptor tiny has changed since the run (code); replay it again"

    def test_a_file_that_is_gone_is_refused_with_a_sentence(self, file: Path) -> None:
        component = resolve_component("descriptor", f"{file}:Tiny")
        file.unlink()
        with pytest.raises(ResultError, match=r"^the descriptor tiny cannot be made again: .*cannot read .*own\.py"):
            component.again()

    def test_settings_that_are_no_more_are_refused_with_a_sentence(self) -> None:
        leader = resolve_component("mapper", "leader")
        older = dataclasses.replace(leader, settings={"reach": 3.0})
        with pytest.raises(ResultError, match=r"^the mapper leader cannot be made again: reach: ") as raised:
            older.again()
        assert "\n" not in str(raised.value)

    def test_an_object_of_a_class_that_nothing_finds_again_is_refused_with_a_sentence(self) -> None:
        class Local(Bands):
            pass

        component = resolve_component("descriptor", Local())
        assert component.again() is component, "while it is at hand"
        with pytest.raises(
            ResultError, match="was an object in memory, not in a file or package, so it cannot be made"
        ):
            Component.of_run("descriptor", component.about).again()

    def test_an_object_that_its_constructor_takes_apart_is_made_with_what_it_had(self) -> None:
        component = resolve_component("mapper", Reach(5.0))
        again = Component.of_run("mapper", component.about).again()
        assert again.identity == component.identity
        assert vars(again.make()) == {"_reach": 5.0, "seen": []}

    def test_an_object_that_was_changed_after_it_was_made_is_not_made_with_its_defaults(self) -> None:
        given = Reach()
        given.margin = 0.5  # type: ignore[attr-defined]
        component = resolve_component("mapper", given)
        with pytest.raises(
            ConfigError, match="reach cannot be made with the margin it had; let its constructor take it"
        ):
            component.fresh()
        with pytest.raises(ResultError, match=r"cannot be made again: .* the margin it had"):
            Component.of_run("mapper", component.about).again()


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ("hogg", "unknown descriptor 'hogg'; did you mean hog?"),
        ("", "unknown descriptor ''"),
        (":Bands", "expected package.module:Class or path/file.py:Class"),
        ("own.py:", "expected package.module:Class or path/file.py:Class"),
        ("no.such.package:Bands", "cannot be imported: ModuleNotFoundError: No module named 'no'"),
        ("no/such/file.py:Bands", "cannot read .*file.py: No such file or directory"),
        (f"{__name__}:Band", f"{__name__} has no Band; did you mean Bands"),
        (f"{__name__}:GREY", "is not a descriptor: a descriptor is a class with a method describe"),
        (f"{__name__}:Reach", "is not a descriptor: a descriptor is a class with a method describe"),
        (Reach, "is not a descriptor: a descriptor is a class with a method describe"),
        (Reach(), "Reach is not a descriptor: a descriptor is a class with a method describe"),
        (3, "int is not a descriptor"),
    ],
)
def test_what_is_no_component_is_refused_in_one_line(chosen: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as raised:
        resolve_component("descriptor", chosen)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("class Tiny(\n", "cannot be imported: SyntaxError"),
        ("\0", "cannot be imported: "),
        ("1 / 0\n", "cannot be imported: ZeroDivisionError: division by zero"),
        ("import no_such_module\n", "cannot be imported: ModuleNotFoundError: No module named 'no_such_module'"),
        ("class Other: ...\n", "has no Tiny; "),
        (
            "class Tiny:\n    def __init__(self, net): ...\n    def describe(self, panorama): ...\n",
            "cannot be made: .*'net'",
        ),
        ("class Tiny:\n    settings = {'a': {1, 2}}\n    def describe(self, panorama): ...\n", "must be plain values"),
    ],
)
def test_a_file_that_does_not_work_is_refused_in_one_line(file: Path, text: str, message: str) -> None:
    for _ in range(2):  # what failed is not taken for loaded
        file.write_text(text)
        with pytest.raises(ConfigError, match=message) as raised:
            resolve_component("descriptor", f"{file}:Tiny")
        assert "\n" not in str(raised.value)
    file.write_text(SOURCE.format(value=1))
    assert described(resolve_component("descriptor", f"{file}:Tiny")) == 1.0


def test_settings_are_validated() -> None:
    with pytest.raises(ValidationError, match="radius"):
        resolve_component("mapper", "leader", {"radius": -1})
    with pytest.raises(ValidationError, match="rows"):
        resolve_component("descriptor", Bands, {"rows": "many"})
    with pytest.raises(ConfigError, match="cannot be made with the scale it had"):
        resolve_component("mapper", Reach, {"scale": 2})


def test_a_file_beside_a_folder_of_our_name_takes_the_package_that_runs(tmp_path):
    """As in a checkout."""
    (tmp_path / "omnieval").mkdir()
    (tmp_path / "omnieval" / "__init__.py").write_text("raise RuntimeError('another copy')\n")
    (tmp_path / "mine.py").write_text("import omnieval\n\nclass Beside(omnieval.Leader): ...\n")
    cls = find_class("mapper", f"{tmp_path / 'mine.py'}:Beside")
    assert issubclass(cls, Mapper)
