"""Localisations in a reference: images of other sequences must be found in its maps as well as before."""

import shutil

import pytest

from omnieval.config import configure
from omnieval.errors import ConfigError, DatasetError, RegressionError
from omnieval.loop import replay
from omnieval.regression.case_report import explanations, failure
from omnieval.regression.cases import Selection
from omnieval.regression.gate import check
from omnieval.regression.reference import read_localizations, read_reference
from omnieval.regression.update import change_lines, update
from tests.cli.test_cli import in_process
from tests.localization.conftest import CONFIG

CONFIGURED = configure(CONFIG)
ASKED = (
    '\n[[localization]]\nname = "{name}"  # by hand\nmap = "{map}"\nquery = "folder:{query}"\ncut = {{ stride = 16 }}\n'
)


@pytest.fixture(scope="module")
def images(panoramas, tmp_path_factory):
    """Two folders of the same images: one to map, one to look for in the map."""
    root = tmp_path_factory.mktemp("images")
    shutil.copytree(panoramas, root / "known")
    shutil.copytree(panoramas, root / "asked")
    return root


@pytest.fixture(scope="module")
def made(images, tmp_path_factory):
    """A reference with a case and two localisations in its map, written by an update."""
    path = tmp_path_factory.mktemp("reference") / "places.toml"
    update(path, [f"folder:{images}/known"], selection=Selection(CONFIGURED))
    (case,) = read_reference(path)
    asked = [ASKED.format(name=name, map=case.name, query=images / "asked") for name in ("again", "once-more")]
    path.write_text(path.read_text() + "".join(asked))
    changes = update(path)
    lines = [line for change in changes for line in change_lines(change)]
    assert lines[:2] == [f"{case.name}: unchanged", "again: changed"]
    assert "  nearest recall@1 1" in lines
    return path


@pytest.fixture
def reference(made, tmp_path):
    path = tmp_path / made.name
    shutil.copy(made, path)
    shutil.copytree(made.parent / made.stem, tmp_path / made.stem)
    return path


def rewritten(reference, old, new, count=-1):
    text = reference.read_text()
    assert old in text
    reference.write_text(text.replace(old, new, count))


def test_what_holds_passes_and_a_second_update_changes_nothing(reference):
    reports = check(reference)
    assert [report.name for report in reports][1:] == ["again", "once-more"]
    assert not any(report.failed for report in reports)
    metrics = [outcome.metric for outcome in reports[1].outcomes]
    assert metrics[:4] == ["levels recall@1", "levels error_mean", "levels node_accuracy", "nearest recall@1"]
    before = reference.read_text()
    assert "# by hand" in before
    update(reference)
    assert reference.read_text() == before


def test_a_map_is_made_once_for_all_that_is_looked_for_in_it(reference, monkeypatch):
    replayed = []

    def counted(*given, **more):
        replayed.append(given)
        return replay(*given, **more)

    monkeypatch.setattr("omnieval.regression.cases.replay", counted)
    check(reference)
    assert len(replayed) == 1


def test_a_worse_localisation_fails_with_one_line(reference, tmp_path):
    at = reference.read_text().index("[[localization]]")
    text = reference.read_text()
    reference.write_text(
        text[:at] + text[at:].replace("error_mean = { value = 0.0,", "error_mean = { value = -0.2,", 1)
    )
    failed = in_process("check", "--reference", reference, cwd=tmp_path)
    assert failed.returncode == 4
    (line,) = failed.stderr.splitlines()
    assert line.endswith(
        f"{reference} is not met: levels error_mean of again is 0.0000, expected -0.2000 (allowed 0.1); "
        "if this is intended, accept it with --update"
    )
    assert "worse" in failed.stdout


def test_a_map_that_is_another_is_said_where_a_localisation_is_worse(reference):
    rewritten(reference, "error_mean = { value = 0.0,", "error_mean = { value = -0.2,", 1)
    (_, again, _) = check(reference)
    assert list(explanations(again)) == []
    rewritten(reference, 'map_digest = "', 'map_digest = "f')
    (_, again, once_more) = check(reference)
    assert "has changed since the reference was made" in "".join(explanations(again))
    assert list(explanations(once_more)) == []


def test_a_query_that_cannot_be_read_is_no_regression_and_hides_no_other(reference, images):
    rewritten(reference, f"folder:{images}/asked", f"folder:{images}/nowhere", 1)
    case, again, once_more = check(reference)
    assert isinstance(again.error, DatasetError)
    assert "cannot be localised" in str(again.error)
    assert not again.worse
    assert not case.failed
    assert not once_more.failed
    assert isinstance(failure([case, again, once_more], reference), DatasetError)


def test_without_its_map_a_localisation_is_no_regression(reference, images):
    rewritten(reference, f"folder:{images}/known", f"folder:{images}/nowhere")
    reports = check(reference)
    assert [type(report.error) for report in reports] == [DatasetError] * 3
    assert "there is no map to localise in" in str(reports[1].error)


@pytest.mark.parametrize("expected", ["", "\n[localization.expected.levels]\n"])
def test_what_expects_nothing_guards_nothing(made, reference, expected, images):
    (case,) = read_reference(reference)
    reference.write_text(
        reference.read_text() + ASKED.format(name="new", map=case.name, query=images / "asked") + expected
    )
    new = check(reference)[-1]
    assert isinstance(new.error, RegressionError)
    assert "guards nothing" in str(new.error)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name = "again"', 'name = "once-more"', "more than one case once-more"),
        ("map = ", 'map = "elsewhere" #', "no case makes the map 'elsewhere'"),
        ("[localization.expected.levels]", "[localization.expected.far]", "unknown strategy 'far'"),
        ('"recall@1"', '"recall@2"', "unknown metric 'recall@2'"),
        ("query = ", "quest = ", "query: Field required"),
    ],
)
def test_a_faulty_localisation_is_refused_by_name(reference, old, new, words):
    rewritten(reference, old, new, 1)
    with pytest.raises(ConfigError) as fault:
        read_localizations(reference, read_reference(reference))
    assert words in str(fault.value)


@pytest.mark.slow
def test_several_processes_say_the_same(reference):
    def said(reports):
        return [(report.name, report.outcomes, report.notes, report.parting) for report in reports]

    counted = []
    assert said(check(reference, jobs=2, progress=lambda *done: counted.append(done))) == said(check(reference))
    assert counted == [(1, 1)]
