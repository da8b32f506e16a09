"""The silhouette gate: every way to fail, what passes, and what an update keeps."""

import shutil
import tomllib
from pathlib import Path
from xml.etree import ElementTree as ET

import polars as pl
import pytest

import omnieval
from omnieval.archiving import describe_archive
from omnieval.errors import ConfigError, DatasetError, RegressionError, ResultError
from omnieval.loop import replay
from omnieval.mapping.roman2020.settings import PRESETS
from omnieval.material.source import Cut
from omnieval.regression import case_report as report
from omnieval.regression import judge
from omnieval.regression.cases import Selection, canonical_source, portable
from omnieval.regression.gate import check
from omnieval.regression.guarded import Case, Guard, NodeRange
from omnieval.regression.junit import write_junit
from omnieval.regression.reference import read_localizations, read_reference, write_reference
from omnieval.regression.trace import DECISION, first_parting, read_trace, write_trace
from omnieval.regression.update import change_lines, update
from omnieval.results.intervals import intervals_of_run
from omnieval.statistics import blocks
from omnieval.statistics.estimate import Estimate

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}
CONFIGURED = omnieval.configure(CONFIG)
COMMITTED = sorted((Path(__file__).parents[1] / "runs" / "reference").glob("*.toml"))


def a_case(**changed):
    guards = {"silhouette": Guard(value=0.30, tolerance=0.02)}
    return Case(
        **{"name": "one", "source": "synthetic", "nodes": NodeRange(value=9, min=8, max=10), "guards": guards} | changed
    )


def judged(metrics, within=lambda metric: None, **changed):
    return {outcome.metric: outcome.judgement for outcome in judge.judge(a_case(**changed), metrics, within)}


@pytest.fixture(scope="module")
def run(panoramas, tmp_path_factory):
    return replay(panoramas, config=CONFIGURED, out=tmp_path_factory.mktemp("runs") / "first")


@pytest.fixture
def reference(run, tmp_path):
    """A reference with the one case that `run` replays."""
    path = tmp_path / "reference" / "three.toml"
    update(path, [str(run.folder)])
    return path


def rewritten(reference, **changed):
    """The same reference with its case changed."""
    (case,) = read_reference(reference)
    reference.unlink()
    write_reference((case.model_copy(update=changed),), reference)
    return case


def without_poses(panoramas, folder):
    """The same images as a source without positions and labels."""
    folder.mkdir()
    for image in panoramas.glob("*.png"):
        (folder / image.name).symlink_to(image)
    return f"folder:{folder}"


@pytest.mark.parametrize(
    ("got", "judgement"),
    [
        (0.30, "ok"),
        (0.28, "ok"),
        (0.32, "ok"),
        (0.2799, "worse"),
        (0.33, "better"),
        (None, "missing"),
        (float("nan"), "missing"),
    ],
)
def test_a_value_may_fall_by_its_tolerance_and_rise_as_it_likes(got, judgement):
    assert judged({"nodes": 9, "silhouette": got}) == {"nodes": "ok", "silhouette": judgement}


@pytest.mark.parametrize(("got", "judgement"), [(0.05, "ok"), (0.11, "worse"), (0.0, "ok"), (-0.1, "better")])
def test_of_some_values_less_is_better(got, judgement):
    guards = {"share_forced": Guard(value=0.05, tolerance=0.05, better="lower")}
    assert judged({"nodes": 9, "share_forced": got}, guards=guards)["share_forced"] == judgement


@pytest.mark.parametrize(
    ("nodes", "judgement"), [(8, "ok"), (10, "ok"), (7, "outside"), (11, "outside"), (None, "missing")]
)
def test_nodes_stay_in_their_range(nodes, judgement):
    assert judged({"nodes": nodes, "silhouette": 0.3})["nodes"] == judgement


@pytest.mark.parametrize(
    ("ends", "of_more", "of_less"),
    [
        ((0.10, 0.16), "worse", "better"),
        ((0.10, 0.19), "ok", "ok"),
        ((0.20, 0.22), "ok", "ok"),
        ((0.26, 0.40), "ok", "ok"),
        ((0.28, 0.40), "better", "worse"),
        ((None, None), "missing", "missing"),
    ],
)
def test_an_interval_is_worse_where_all_of_it_is(ends, of_more, of_less):
    for better, judgement in (("higher", of_more), ("lower", of_less)):
        guards = {"pair_f1": Guard(value=0.22, interval=(0.18, 0.27), better=better)}
        found = judged(
            {"nodes": 9, "pair_f1": 0.2}, {"pair_f1": Estimate(0.2, ends[0], ends[1], 60)}.get, guards=guards
        )
        assert found["pair_f1"] == judgement
    assert judged({"nodes": 9, "pair_f1": 0.2}, guards=guards)["pair_f1"] == "missing"


def test_intervals_are_guarded_where_images_can_be_resampled(run, reference, monkeypatch):
    monkeypatch.setattr(blocks, "BLOCK_S", 1.0)  # the whole sequence is of 16 s
    update(reference, [str(run.folder)], intervals=True)
    (case,) = read_reference(reference)
    guarded = {name for name, guard in case.guards.items() if guard.interval}
    assert {"silhouette_image", "share_forced", "pair_f1"} <= guarded
    assert not {"silhouette", "rooms_ari", "reentry_f1"} & guarded
    within, kept = intervals_of_run(run), case.guards["silhouette_image"].interval
    found = within("silhouette_image")
    assert found
    assert found.low is not None
    assert found.high is not None
    assert kept == (round(found.low, 6), round(found.high, 6))
    (same,) = check(reference, [str(run.folder)])
    assert not same.failed
    before = reference.read_text()
    update(reference, [str(run.folder)])  # what is guarded by an interval stays so
    assert reference.read_text() == before
    higher = case.guards["silhouette_image"].model_copy(update={"interval": (found.high + 0.01, found.high + 0.2)})
    rewritten(reference, guards={**case.guards, "silhouette_image": higher})
    (worse,) = check(reference, [str(run.folder)])
    assert [outcome.metric for outcome in worse.outcomes if outcome.failed] == ["silhouette_image"]
    assert f"[{found.low:.4g}, {found.high:.4g}]" in str(report.failure([worse], reference))


def test_a_replay_without_metrics_has_every_value_missing():
    assert judged({}) == {"nodes": "missing", "silhouette": "missing"}


def test_a_run_holds_against_the_reference_made_of_it(run, reference):
    (found,) = check(reference, [str(run.folder)])
    assert not found.failed
    assert {outcome.judgement for outcome in found.outcomes} == {"ok"}
    assert (found.parting, found.settings, found.notes) == (None, {}, ())


def test_sources_and_the_whole_reference_are_replayed_to_the_same(run, reference, panoramas):
    for reports in (check(reference, [f"folder:{panoramas}"]), check(reference)):
        (found,) = reports
        assert not found.failed
        assert found.parting is None
        assert {outcome.metric: outcome.got for outcome in found.outcomes}["silhouette"] == run.metrics["silhouette"]


def test_a_value_that_fell_fails_and_is_named(run, reference):
    (case,) = read_reference(reference)
    higher = case.guards["silhouette"].model_copy(update={"value": case.guards["silhouette"].value + 0.1})
    rewritten(reference, guards={**case.guards, "silhouette": higher})
    (found,) = check(reference, [str(run.folder)])
    assert found.failed
    assert [outcome.metric for outcome in found.outcomes if outcome.failed] == ["silhouette"]
    assert "silhouette of " in str(report.failure([found], reference))
    row = next(row for row in report.table_rows([found]) if row["metric"] == "silhouette")
    assert (row["judgement"], row["difference"]) == ("worse", "-0.1000")


def test_a_better_value_passes_and_is_said(run, reference):
    (case,) = read_reference(reference)
    lower = case.guards["silhouette"].model_copy(update={"value": case.guards["silhouette"].value - 0.1})
    rewritten(reference, guards={**case.guards, "silhouette": lower})
    (found,) = check(reference, [str(run.folder)])
    assert not found.failed
    assert "better" in {row["judgement"] for row in report.table_rows([found])}


def test_nodes_outside_their_range_fail(run, reference):
    rewritten(reference, nodes=NodeRange(value=50, min=49, max=51))
    (found,) = check(reference, [str(run.folder)])
    assert [outcome.judgement for outcome in found.outcomes if outcome.failed] == ["outside"]


def test_a_null_value_fails_and_an_update_says_that_it_is_lost(panoramas, reference, tmp_path):
    rewritten(reference, source=without_poses(panoramas, tmp_path / "bare"))
    (found,) = check(reference)
    failed = {outcome.metric: outcome.judgement for outcome in found.outcomes if outcome.failed}
    assert {"silhouette", "silhouette_sq", "rooms_ari"} <= set(failed)
    assert set(failed.values()) == {"missing"}
    assert any("not those that the reference was made with" in note for note in found.notes)
    (change,) = update(reference)
    assert any("silhouette has no value any more" in line for line in change_lines(change))
    assert "silhouette" not in read_reference(reference)[0].guards


def test_an_interrupted_run_fails(run, reference, panoramas, tmp_path):
    def stop(done, total):
        if done == 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replay(panoramas, config=CONFIGURED, out=tmp_path / "half", progress=stop)
    (found,) = check(reference, [str(tmp_path / "half")])
    assert {outcome.judgement for outcome in found.outcomes} == {"missing"}
    assert found.parting is not None
    assert (found.parting.frame, found.parting.got) == (30, None)
    assert len(found.notes) == 1  # and none that the images are others
    assert "is interrupted" in found.notes[0]
    with pytest.raises(ResultError, match="is interrupted"):
        update(reference, [str(tmp_path / "half")])


def test_a_case_whose_sequence_is_gone_fails(reference, tmp_path):
    rewritten(reference, source=f"folder:{tmp_path / 'gone'}")
    (found,) = check(reference)
    assert found.failed
    assert found.fault is not None
    assert "cannot be replayed" in found.fault
    error = report.failure([found], reference)
    assert isinstance(error, DatasetError)  # what cannot be read is not a regression
    assert "--update" not in str(error)


def test_maps_that_are_worse_come_before_cases_that_cannot_be_replayed(run, reference, tmp_path):
    rewritten(reference, nodes=NodeRange(value=50, min=49, max=51))
    gone = a_case(name="gone", source=f"folder:{tmp_path / 'gone'}")
    write_reference((gone,), reference)
    reports = check(reference)
    assert [found.worse for found in reports] == [True, False]
    assert isinstance(report.failure(reports, reference), RegressionError)
    assert report.failure([], reference) is None


def test_a_component_that_is_gone_is_an_error_of_configuration(reference, tmp_path):
    rewritten(reference, mapper=f"{tmp_path / 'gone.py'}:Gone")
    (found,) = check(reference)
    assert isinstance(report.failure([found], reference), ConfigError)


def test_a_source_that_is_not_there_is_no_regression_and_hides_no_other(reference, panoramas, tmp_path):
    good, *gone = check(reference, [str(panoramas), f"folder:{tmp_path / 'gone'}", "nowhere", "gone.npz"])
    assert not good.failed
    assert [type(found.error) for found in gone] == [DatasetError] * 3
    assert "--update" not in str(report.failure(gone, reference))


def test_what_the_reference_has_no_case_for_fails(run, reference, panoramas, tmp_path):
    other = replay(panoramas, config=omnieval.configure({**CONFIG, "gamma": 2.0}), out=tmp_path / "other")
    (found,) = check(reference, [str(other.folder)])
    assert found.failed
    assert found.fault is not None
    assert "gamma 1.0 there, 2.0 here" in found.fault
    (found,) = check(reference, [f"folder:{tmp_path}"])
    assert found.fault is not None
    assert "no case of folder:" in found.fault


def test_a_selection_chooses_among_the_cases_of_a_source(reference, panoramas):
    (found,) = check(reference, [str(panoramas)], selection=Selection(CONFIGURED))
    assert not found.failed
    (found,) = check(reference, [str(panoramas)], selection=Selection(CONFIGURED, Cut(limit=40)))
    assert found.fault is not None
    assert "limit None there, 40 here" in found.fault
    with pytest.raises(ConfigError, match="name one"):
        check(reference, selection=Selection(CONFIGURED))


def test_no_reference_and_an_empty_one_fail(tmp_path):
    with pytest.raises(RegressionError, match="there is no reference"):
        check(tmp_path / "none.toml")
    with pytest.raises(RegressionError, match="there is no reference"):
        update(tmp_path / "none.toml")
    empty = tmp_path / "empty.toml"
    empty.write_text("schema_version = 2\n")
    with pytest.raises(RegressionError, match="guards nothing"):
        check(empty)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("schema_version = 2", "schema_version = 1", "schema version 1"),
        ("schema_version = 2", "schema_version = ", "cannot read"),
        ("silhouette_sq =", "silhouete_sq =", "did you mean silhouette_sq"),
        ("tolerance = 0.02", "tolerance = -0.02", "tolerance"),
        ("tolerance = 0.02", "interval = [0.4, 0.2]", "the wrong way round"),
        ("tolerance = 0.02", "tolerance = 0.02, interval = [0.2, 0.4]", "one of the two"),
        (", tolerance = 0.02", "", "one of the two"),
        ("nodes = ", "share_pending = ", "nodes"),
        ("name = ", "nome = ", "name"),
        ("stride = 1", "stride = 0", "stride"),
        ("stride = 1", "strid = 1", "strid"),
        ("[[case]]", "[case]", "write every case as a"),
        ("date = ", "dote = ", "date"),
    ],
)
def test_a_faulty_reference_is_refused_by_name(reference, old, new, words):
    reference.write_text(reference.read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=words) as caught:
        check(reference)
    assert "three.toml" in str(caught.value)


def test_two_cases_of_one_name_are_refused(reference):
    text = reference.read_text()
    reference.write_text(text + text[text.index("[[case]]") :])
    with pytest.raises(ConfigError, match="more than one case"):
        check(reference)


def test_a_changed_default_is_caught_at_the_first_step_that_differs(panoramas, tmp_path, monkeypatch):
    path = tmp_path / "defaults.toml"
    not_gamma = {name: value for name, value in CONFIG.items() if name != "gamma"}
    monkeypatch.setitem(PRESETS, "recommended", {"gamma": 1.0})
    update(path, [str(panoramas)], selection=Selection(omnieval.configure(not_gamma)))
    assert "gamma" not in read_reference(path)[0].parameters
    monkeypatch.setitem(PRESETS, "recommended", {"gamma": 20.0})
    (found,) = check(path)
    assert found.failed
    assert found.settings == {"gamma": (1.0, 20.0)}
    assert found.parting is not None
    assert found.parting.expected is not None
    assert found.parting.got is not None
    assert (found.parting.expected["verdict"], found.parting.got["verdict"]) == ("assigned", "prominence")
    said = "\n".join(report.explanations(found))
    assert f"step {found.parting.frame} (image" in said
    assert "gamma was 1.0 when the reference was made, is 20.0" in said


def test_the_trace_explains_and_never_judges(run, reference):
    (case,) = read_reference(reference)
    trace = read_trace(reference.parent / case.trace)
    write_trace(trace.with_columns(best_frame=trace["best_frame"] + 1), reference.parent / case.trace)
    (found,) = check(reference, [str(run.folder)])
    assert not found.failed
    assert found.parting is not None
    (reference.parent / case.trace).write_bytes(b"no parquet")
    (found,) = check(reference, [str(run.folder)])
    assert not found.failed
    assert "cannot read the decision trace" in found.notes[0]
    update(reference)
    assert check(reference, [str(run.folder)])[0].notes == ()


@pytest.mark.parametrize("column", DECISION[1:])
def test_the_first_differing_row_is_found(run, column):
    steps = run.steps
    frame = steps.filter(pl.col("verdict") == "assigned")["frame"][-1]
    trace = steps.select(DECISION)
    assert first_parting(trace, steps) is None
    found = first_parting(trace.with_columns(pl.when(pl.col("frame") != frame).then(pl.col(column))), steps)
    assert found is not None
    assert (found.frame, found.file) == (frame, steps["file"][frame])


def test_a_replay_that_is_longer_or_shorter_parts_at_the_end(run):
    trace, steps = run.steps.select(DECISION), run.steps
    longer, shorter = first_parting(trace.head(60), steps), first_parting(trace, steps.head(60))
    assert longer is not None
    assert (longer.frame, longer.expected) == (60, None)
    assert shorter is not None
    assert (shorter.frame, shorter.file, shorter.got) == (60, None, None)


def test_an_update_makes_a_reference_that_says_where_it_comes_from(run, reference):
    content = tomllib.loads(reference.read_text())
    (case,) = content["case"]
    assert case["descriptor"] == "hog"
    assert case["parameters"] == CONFIG
    nodes = run.metrics["nodes"]
    assert case["expected"]["nodes"] == {"value": nodes, "min": nodes - 1, "max": nodes + 1}
    assert case["expected"]["silhouette"]["value"] == pytest.approx(run.metrics["silhouette"], abs=1e-6)
    assert case["expected"]["silhouette"]["tolerance"] == 0.02
    assert case["expected"]["share_assigned"]["tolerance"] == 0.05
    assert case["made"]["code"] == run.manifest["code"]
    assert case["made"]["dataset_fingerprint"] == run.manifest["dataset_fingerprint"]
    assert case["made"]["versions"] == run.manifest["versions"]
    assert case["made"]["parameters"]["covariance"] == "diagonal"
    assert case["made"]["mapper_code"] == run.manifest["mapper"]["code"]
    assert (reference.parent / case["trace"]).stat().st_size < 20_000


def test_a_second_update_changes_nothing(reference):
    before = reference.read_bytes()
    (change,) = update(reference)
    assert list(change_lines(change)) == [f"{change.name}: unchanged"]
    assert reference.read_bytes() == before


def test_an_update_keeps_what_people_edit_and_says_what_changed(run, reference):
    (case,) = read_reference(reference)
    guards = {
        "silhouette": Guard(value=0.123, tolerance=0.5),
        "share_retest": Guard(value=0.9, tolerance=0.4, better="lower"),
    }
    rewritten(reference, name="mine", nodes=NodeRange(value=50, min=45, max=51), guards=guards)
    (change,) = update(reference)
    (renewed,) = read_reference(reference)
    nodes = run.metrics["nodes"]
    assert renewed.name == "mine"
    assert renewed.nodes == NodeRange(value=nodes, min=max(1, nodes - 5), max=nodes + 1)
    assert {name: (guard.tolerance, guard.better) for name, guard in renewed.guards.items()} == {
        "silhouette": (0.5, "higher"),
        "share_retest": (0.4, "lower"),
    }
    assert renewed.guards["silhouette"] == case.guards["silhouette"].model_copy(update={"tolerance": 0.5})
    lines = list(change_lines(change))
    assert lines[0] == "mine: changed"
    assert any(line.startswith("  silhouette 0.123 -> ") for line in lines)


def test_an_update_adds_to_a_reference_without_cases(run, tmp_path):
    path = tmp_path / "new.toml"
    path.write_text("# mine\nschema_version = 2\n")
    update(path, [str(run.folder)])
    assert path.read_text().startswith("# mine\nschema_version = 2\n\n[[case]]\nname = ")
    path.write_text(
        'schema_version = 2\ncase = [{ name = "a", source = "synthetic", expected = { nodes = { value = 1, '
        "min = 1, max = 1 } } }]\n"
    )
    with pytest.raises(ConfigError, match="write every case as a"):
        update(path, [str(run.folder)])


def test_an_update_forgets_parameters_that_there_are_no_more(reference):
    reference.write_text(reference.read_text().replace("[case.made.parameters]", "[case.made.parameters]\nold = 3"))
    assert check(reference)[0].settings == {"old": (3, None)}
    update(reference)
    assert check(reference)[0].settings == {}


def test_comments_and_order_survive_an_update(run, reference):
    text = reference.read_text()
    line = next(line for line in text.splitlines() if line.startswith("silhouette_sq"))
    edited = text.replace(line, f"# squared distances weigh the far ones\n{line}  # loose on purpose", 1)
    edited = edited.replace("[[case]]", "# the house of 2024\n[[case]]", 1)
    edited = edited.replace(f"value = {run.metrics['nodes']}, min", f"value = {run.metrics['nodes'] + 1}, min", 1)
    reference.write_text(edited)
    update(reference)
    after = reference.read_text()
    for comment in ("# squared distances weigh the far ones", "# loose on purpose", "# the house of 2024"):
        assert comment in after
    assert after.index("# squared distances") < after.index("silhouette_sq") < after.index("share_assigned")


MAPPER = """
import omnieval
class {name}(omnieval.Leader):
    name = "own-leader"
"""
DESCRIPTOR = """
import numpy as np
import omnieval
class Rows:
    def describe(self, panorama):
        rows = panorama.astype(np.float32).reshape(32, -1).mean(axis=1) * {factor}
        columns = panorama.astype(np.float32).reshape(-1, 64, 8).mean(axis=(0, 2))
        return omnieval.Description(rows, columns[:, np.newaxis])
"""


def test_own_components_are_cases_of_their_own(run, reference, panoramas, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(MAPPER.format(name="Own") + DESCRIPTOR.format(factor=1))
    selection = Selection(omnieval.configure(mapper="own.py:Own", descriptor="own.py:Rows", radius=2.0))
    (change,) = update(reference, [str(panoramas)], selection=selection)
    assert change.added
    first, own = read_reference(reference)
    assert (own.mapper, own.descriptor, own.parameters) == ("own.py:Own", "own.py:Rows", {"radius": 2.0})
    assert first.descriptor == "hog"
    assert not any(found.failed for found in check(reference))
    (found,) = check(reference, [str(run.folder)])
    assert found.name == first.name


def test_a_changed_descriptor_fails_with_a_warm_cache_as_with_a_cold_one(reference, panoramas, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(DESCRIPTOR.format(factor=1))
    selection = Selection(omnieval.configure(CONFIG, descriptor="own.py:Rows"))
    path = tmp_path / "own.toml"
    update(path, [str(panoramas)], selection=selection)
    assert not check(path)[0].failed
    (tmp_path / "own.py").write_text(DESCRIPTOR.format(factor=0))
    (found,) = check(path)
    assert found.parting is not None
    assert "the code of the descriptor has changed since the reference was made" in found.notes


FLAGGED = """
import omnieval
class Flags(omnieval.LeaderSettings):
    flag: bool = False
    sizes: list[int] = [1]
    nested: dict[str, list[int]] = {}
    most: int | None = 5
class Flagged(omnieval.Leader):
    name = "flagged"
    Settings = Flags
"""


def test_settings_of_any_type_are_kept_and_those_that_cannot_be_said_refused(panoramas, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(FLAGGED)
    path = tmp_path / "own.toml"
    settings = {"flag": True, "sizes": [1, 2], "nested": {"a b": [1], 'c "d"': []}}
    update(path, [str(panoramas)], selection=Selection(omnieval.configure(settings, mapper="own.py:Flagged")))
    assert read_reference(path)[0].parameters == settings
    (found,) = check(path)
    assert (found.failed, found.settings) == (False, {})
    before = path.read_bytes()
    selection = Selection(omnieval.configure(mapper="own.py:Flagged", most=None))
    with pytest.raises(ResultError, match="a reference cannot hold most None"):
        update(path, [str(panoramas)], selection=selection)
    assert path.read_bytes() == before


def test_an_object_is_not_what_it_calls_itself(reference, panoramas, tmp_path):
    class Local(omnieval.Hog):
        """Has the name of another, and its settings."""

    before = reference.read_bytes()
    out = tmp_path / "local"
    local = replay(panoramas, descriptor=Local(), config=CONFIG, out=out)
    assert local.manifest["descriptor"]["name"] == "hog"
    (found,) = check(reference, [str(out)])
    assert isinstance(found.error, RegressionError)
    assert "descriptor hog there, hog (an object) here" in str(found.error)
    with pytest.raises(ResultError, match="not in a file or package"):
        update(reference, [str(out)])
    assert reference.read_bytes() == before


def test_a_run_whose_images_are_gone_or_others_is_no_case(reference, panoramas, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(panoramas, folder)
    archive = tmp_path / "copy.npz"
    describe_archive(folder, archive)
    out, mapped = tmp_path / "run", tmp_path / "mapped"
    replay(folder, config=CONFIG, out=out)
    replay(str(archive), config=CONFIG, out=mapped)
    before = reference.read_bytes()
    shutil.copy(folder / "image7.png", folder / "image60.png")
    with pytest.raises(ResultError, match="are not those that"):
        update(reference, [str(out)])
    shutil.rmtree(folder)
    archive.unlink()
    for gone in (out, mapped):
        with pytest.raises(DatasetError, match="cannot be a case"):
            update(reference, [str(gone)])
    assert reference.read_bytes() == before


def test_a_run_that_no_check_could_replay_is_no_case(panoramas, tmp_path, reference):
    class Local(omnieval.Leader):
        name = "local"

    before = reference.read_bytes()
    out = tmp_path / "local"
    replay(panoramas, mapper=Local(), out=out)
    with pytest.raises(ResultError, match="cannot be a case"):
        update(reference, [str(out)])
    file = tmp_path / "own.py"
    file.write_text(MAPPER.format(name="Own"))
    replay(panoramas, mapper=f"{file}:Own", out=tmp_path / "own")
    file.write_text(MAPPER.format(name="Own") + "\n# edited\n")
    with pytest.raises(ResultError, match="has changed since the run"):
        update(reference, [str(tmp_path / "own")])
    assert reference.read_bytes() == before


def test_what_was_left_out_is_part_of_a_case(panoramas, tmp_path):
    folder = tmp_path / "with-a-bad-one"
    folder.mkdir()
    for image in panoramas.iterdir():
        (folder / image.name).write_bytes(image.read_bytes())
    bad = sorted(folder.glob("*.png"))[7]
    bad.write_bytes(b"no image")
    out = tmp_path / "run"
    replay(folder, config=CONFIGURED, out=out, skip_bad=True)
    path = tmp_path / "skipped.toml"
    update(path, [str(out)])
    (case,) = read_reference(path)
    assert case.skipped == (bad.name,)
    (found,) = check(path)
    assert not found.failed
    assert found.parting is None
    (found,) = check(path, [str(out)])
    assert not found.failed
    assert [found.failed for found in check(path, [str(folder)], selection=Selection(CONFIGURED, skip_bad=True))] == [
        False
    ]
    (found,) = check(path, [str(folder)], selection=Selection(CONFIGURED))
    assert f"left out {bad.name} there, none here" in str(found.error)
    other = sorted(folder.glob("*.png"))[9]
    other.write_bytes(b"no image")
    (found,) = check(path)  # other images are no regression
    assert isinstance(found.error, DatasetError)
    assert f"are {bad.name}, {other.name}, not {bad.name}" in str(found.error)
    (change,) = update(path)
    assert not change.added
    assert read_reference(path)[0].skipped == (bad.name, other.name)
    assert isinstance(check(path, [str(out)])[0].error, RegressionError)


def test_an_update_adds_cases_and_leaves_the_others_alone(reference, panoramas):
    (first,) = read_reference(reference)
    selection = Selection(omnieval.configure({**CONFIG, "n_new": 12}), Cut(limit=60))
    (change,) = update(reference, [str(panoramas)], selection=selection)
    assert change.added
    one, two = read_reference(reference)
    assert one == first
    assert (two.name, two.cut, two.parameters["n_new"]) == (f"{first.name}-2", Cut(limit=60), 12)
    assert not any(found.failed for found in check(reference))


def test_archives_of_descriptors_are_guarded_too(panoramas, tmp_path):
    describe_archive(panoramas, tmp_path / "three.npz")
    path, archive = tmp_path / "archive.toml", str(tmp_path / "three.npz")
    (change,) = update(path, [archive], selection=Selection(CONFIGURED))
    assert change.name == "three-map"
    assert not check(path)[0].failed
    (change,) = update(path, [archive], selection=Selection(CONFIGURED, Cut(limit=40)))
    assert change.name == "three-map-2"
    with pytest.raises(ConfigError, match="holds descriptors already"):
        update(path, [archive], selection=Selection(omnieval.configure(CONFIG, descriptor="gist")))
    (tmp_path / "three.npz").rename(tmp_path / "gone.npz")
    assert isinstance(report.failure(check(path), path), DatasetError)


def test_sources_in_the_working_directory_are_written_relative(panoramas, tmp_path, monkeypatch):
    monkeypatch.chdir(panoramas.parent)
    canonical = canonical_source(f"folder:{panoramas.name}")
    assert canonical == omnieval.load(f"folder:{panoramas.name}").source == canonical_source(panoramas.name)
    assert portable(canonical) == f"folder:{panoramas.name}"
    assert portable(f"{panoramas.parent}/own.py:Own") == "own.py:Own"
    assert portable(f"folder:{panoramas.parent}") == "folder:."
    assert portable(f"folder:/other{panoramas.parent}/x") == f"folder:/other{panoramas.parent}/x"
    assert portable(f"folder:{panoramas.parent}-2") == f"folder:{panoramas.parent}-2"
    monkeypatch.chdir(tmp_path)
    assert portable(canonical) == canonical
    assert canonical_source("synthetic") == canonical_source("synthetic:cloudy") == "synthetic:cloudy"


def test_junit_has_a_test_a_value_and_a_failure_a_failed_one(run, reference, tmp_path):
    rewritten(reference, nodes=NodeRange(value=50, min=49, max=51), name='a "name" <&> \x07')
    gone_case = report.CaseReport("gone", error=DatasetError("cannot be replayed: gone"), seconds=1.5)
    reports = (*check(reference, [str(run.folder)]), gone_case)
    write_junit(reports, tmp_path / "check.xml")
    root = ET.parse(tmp_path / "check.xml").getroot()
    one, gone = root.findall("testsuite")
    assert len(one.findall("testcase")) == int(one.attrib["tests"]) == len(reports[0].outcomes)
    failed = [case.attrib["name"] for case in one.findall("testcase") if case.find("failure") is not None]
    assert failed == ["nodes"]
    assert one.attrib["failures"] == gone.attrib["errors"] == gone.attrib["tests"] == "1"
    assert (gone.attrib["failures"], one.attrib["errors"]) == ("0", "0")
    assert root.attrib == {
        "name": "omnieval check",
        "tests": str(len(reports[0].outcomes) + 1),
        "failures": "1",
        "errors": "1",
        "time": "1.500",
    }
    assert all("time" in case.attrib for case in root.iter("testcase"))


@pytest.mark.parametrize("name", ["plain", 'quote " and \\ back', "tab\tline\n", "\x7f", "日本 😀", "a.b = c"])
def test_any_text_survives_the_file(tmp_path, name):
    path = tmp_path / "any.toml"
    write_reference((a_case(name=name, parameters={"imaging.rows": 64, "omega": 1e-7}),), path)
    assert read_reference(path) == (a_case(name=name, parameters={"imaging.rows": 64, "omega": 1e-7}),)


@pytest.mark.parametrize("path", COMMITTED, ids=lambda path: path.stem)
def test_committed_references_parse_and_name_traces_that_are_there(path):
    for case in read_reference(path):
        assert case.config().descriptor.name == case.descriptor
        assert case.made is not None
        assert case.trace is not None
        trace = read_trace(path.parent / case.trace)
        assert trace["frame"].to_list() == list(range(len(trace)))
        tolerance = case.guards["silhouette"].tolerance
        assert tolerance is not None
        assert tolerance <= 0.02


def test_the_six_synthetic_cases_are_committed():
    (path,) = [path for path in COMMITTED if path.stem == "synthetic"]
    found = {(case.source, case.descriptor) for case in read_reference(path)}
    lights = ("synthetic:cloudy", "synthetic:night", "synthetic:sunny")
    assert found == {(light, descriptor) for light in lights for descriptor in ("hog", "gist")}
    localized = read_localizations(path, read_reference(path))
    assert [one.name for one in localized] == ["night-in-cloudy", "sunny-in-cloudy"]
    assert all(list(one.expected) == ["levels", "nearest"] for one in localized)
