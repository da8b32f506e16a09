"""Ablations over components: each row is that of an independent replay, whatever mapped and described."""

import dataclasses
import json
import shutil

import polars as pl
import pytest

import omnieval
from omnieval.ablation.grid import configurations, make_axis, parse_axis, parse_span
from omnieval.ablation.plan import make_plan
from omnieval.ablation.run import run_plan
from omnieval.ablation.summary import best_and_median
from omnieval.config import Setting
from omnieval.errors import ConfigError
from omnieval.mapping.interface import NoSettings
from omnieval.mapping.leader import Leader, LeaderSettings
from omnieval.material.reopened import reopened
from omnieval.metrics.evaluation import METRICS
from omnieval.report.heatmaps import sweep_figures
from omnieval.report.sources import open_sources
from omnieval.results.run_folder import open_run
from tests.material.test_reopened import TINY
from tests.report.charts import figure_of

BASE = {"n_init": 10, "n_new": 10, "gamma": 1.0}
WITH_SETTINGS = TINY.replace(
    "class Tiny:\n",
    "class Tiny:\n    def __init__(self, bands=(1, 2), rows=None):\n        self.bands = list(bands)\n\n",
)
THIRDS = """
import numpy as np
import omnieval
from omnieval import EventKind, FinalMap, NodeEvent, Placement, Role, Step
from pydantic import BaseModel

class Thirds:
    \"\"\"Every so many images make a node. It must be told of what comes, and does not branch.\"\"\"

    name = "thirds"

    class Settings(BaseModel):
        radius: int = 20

    def __init__(self, settings):
        self.settings, self.seen, self.expected = settings, [], 0

    def expect(self, descriptions):
        self.expected += len(descriptions)

    def step(self, description):
        frame = len(self.seen)
        assert frame < self.expected
        self.seen.append(description.position)
        node, since = divmod(frame, self.settings.radius)
        events = (NodeEvent(EventKind.CREATED, node + 1, frames=(frame,)), NodeEvent(EventKind.ACTIVATED, node + 1))
        return Step(frame, "taken" if since else "new", Role.JOINED if since else Role.FOUNDING, node + 1,
                    events=() if since else events)

    def finish(self):
        labels = np.arange(len(self.seen)) // self.settings.radius + 1
        nodes = tuple(range(1, int(labels.max()) + 1))
        means = np.array([np.array(self.seen)[labels == node].mean(axis=0) for node in nodes], np.float64)
        return FinalMap(labels, (Placement.LOOP_CLOSURE,) * len(labels), nodes, frozenset(nodes), means)
"""


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A descriptor and a mapper of your own: where their classes are."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "tiny.py").write_text(WITH_SETTINGS)
    (folder / "thirds.py").write_text(THIRDS)
    return f"{folder}/tiny.py:Tiny", f"{folder}/thirds.py:Thirds"


@pytest.fixture(scope="module")
def table(panoramas, own, tmp_path_factory):
    tiny, _ = own
    out = tmp_path_factory.mktemp("components") / "out"
    vary = {"omega": [0.5, 3.5], "radius": [1.2, 2.0, 4.0]}
    omnieval.ablate(
        panoramas, vary, mapper="roman2020,leader", descriptor=["hog", tiny], settings=BASE, jobs=2, out=out,
        keep_steps=True, csv=True,
    )  # fmt: skip
    return out, pl.read_parquet(out / "ablation.parquet")


def test_an_axis_varies_for_the_components_that_have_it(table):
    rows = table[1].select("mapper", "descriptor", "omega", "radius").rows()
    assert rows == [
        *(("roman2020", name, omega, None) for name in ("hog", "tiny") for omega in (0.5, 3.5)),
        *(("leader", name, None, radius) for name in ("hog", "tiny") for radius in (1.2, 2.0, 4.0)),
    ]
    assert table[1]["error"].null_count() == len(rows)
    assert table[1]["n_new"].to_list() == [10] * 4 + [None] * 6
    assert table[1]["tiny.bands"].to_list() == [None, None, "[1, 2]", "[1, 2]", None, None, None, *["[1, 2]"] * 3]


def test_every_row_is_that_of_an_independent_replay(table, own, panoramas, tmp_path):
    out, rows = table
    assert rows["nodes"].n_unique() == 3
    for row in rows.iter_rows(named=True):
        settings = BASE | {"omega": row["omega"]} if row["mapper"] == "roman2020" else {"radius": row["radius"]}
        descriptor = own[0] if row["descriptor"] == "tiny" else "hog"
        run = omnieval.replay(
            panoramas, mapper=row["mapper"], descriptor=descriptor, config=settings, out=tmp_path / str(row["job"])
        )
        assert {name: row[name] for name in METRICS} == run.metrics
        margin = run.manifest["smallest_margin"]
        assert (row["smallest_margin"], row["smallest_margin_frame"]) == (margin["value"], margin["frame"])
        (trace,) = (out / "steps").glob(f"{row['job']:05d}-*.parquet")
        steps = pl.read_parquet(trace)
        assert steps.schema == run.steps.schema
        names = [name for name in steps.columns if name != "milliseconds"]
        assert steps.select(names).equals(run.steps.select(names))


def test_the_best_runs_are_known_by_the_components_they_had(table, own):
    (sweep,) = open_sources([table[0]]).sweeps
    assert [(one.mapper, one.descriptor) for one in sweep.replays] == [
        ("roman2020", "hog"),
        ("roman2020", "tiny"),
        ("leader", "hog"),
        ("leader", "tiny"),
    ]
    last = sweep.replays[-1]
    assert (last.config.descriptor.spec, last.config.descriptor.settings) == (own[0], {"bands": [1, 2]})
    assert [gate.name for gate in last.method.gates] == ["distance"]
    with last.material() as material:
        assert len(list(material.described)) == 80


@pytest.mark.parametrize("mapper", ["leader"])
def test_every_piece_of_an_interval_is_the_map_of_its_values(panoramas, tmp_path, mapper):
    out = tmp_path / "exact"
    plan = make_plan([panoramas], [parse_axis(f"mapper={mapper}")], exact=parse_span("radius=1.1:4"))
    pieces = run_plan(plan, out=out).table
    assert pieces["error"].null_count() == len(pieces)
    assert (pieces["exact_from"][0], pieces["exact_to"][-1]) == (1.1, 4.0)
    assert pieces["exact_from"].to_list()[1:] == pieces["exact_to"].to_list()[:-1]
    assert len(pieces) > 3
    for number in (0, len(pieces) // 2, len(pieces) - 1):
        row = pieces.row(number, named=True)
        for name, radius in (("first", row["exact_from"]), ("middle", (row["exact_from"] + row["exact_to"]) / 2)):
            run = omnieval.replay(panoramas, mapper=mapper, radius=radius, out=tmp_path / f"{number}-{name}")
            assert {name: row[name] for name in METRICS} == run.metrics


def test_a_mapper_of_ones_own_that_does_not_branch_is_swept_beside_others(own, panoramas, tmp_path):
    vary = {"radius": [2, 30]}
    rows = omnieval.ablate(panoramas, vary, mapper=["leader", own[1]], out=tmp_path / "out", jobs=2, keep_steps=True)
    assert rows["error"].to_list() == [None] * 4
    assert rows["radius"].to_list() == [2.0, 30.0] * 2  # a whole number for the one, a real one for the other
    assert rows.filter(mapper="thirds")["nodes"].to_list() == [40, 3]
    (sweep,) = open_sources([tmp_path / "out"]).sweeps
    assert sweep.replays[-1].config.mapper.settings == {"radius": 30}
    run = omnieval.replay(panoramas, mapper=own[1], radius=30, out=tmp_path / "run")
    assert {name: rows.row(3, named=True)[name] for name in METRICS} == run.metrics


def test_an_archive_is_called_what_it_is(panoramas, tmp_path):
    file = tmp_path / "three.npz"
    omnieval.describe_archive(panoramas, file)
    rows = omnieval.ablate(
        file, {"radius": [1.2, 4.0]}, mapper="leader", start=4, limit=70, out=tmp_path / "archive", keep_steps=True
    )
    assert rows["descriptor"].to_list() == ["archive"] * 2
    assert not any(name.startswith("hog.") for name in rows.columns)
    images = omnieval.ablate(panoramas, {"radius": [1.2, 4.0]}, mapper="leader", start=4, limit=70, out=tmp_path / "i")
    assert rows.select(METRICS).equals(images.select(METRICS))
    (replay,) = open_sources([tmp_path / "archive"]).sweeps[0].replays
    with replay.material() as material:
        assert len(list(material.described)) == 70


@pytest.mark.parametrize(
    ("name", "column", "values"), [("leader.radius", "radius", [1.2, 4.0]), ("bins", "hog.bins", [8, 16])]
)
def test_an_axis_is_known_by_its_column_whatever_it_was_called(panoramas, tmp_path, name, column, values):
    plan = make_plan([panoramas], [parse_axis("mapper=leader"), make_axis(name, values, "test")])
    rows = run_plan(plan, out=tmp_path / "out").table
    assert plan.varied == ("mapper", column)
    assert rows[column].to_list() == values
    assert best_and_median(rows, plan.varied)[column][0] in values
    (sweep,) = open_sources([tmp_path / "out"]).sweeps
    assert sweep.axes == {"mapper": ["leader"], column: values}
    assert column not in sweep.fixed
    assert "sweep-hog" in [figure_of(block).key for block in sweep_figures(sweep)]


@pytest.mark.parametrize(
    ("axes", "settings", "words"),
    [
        (["radius=1,2", "leader.radius=3,4"], {}, "radius is varied twice"),
        (["bins=8,16", "hog.bins=4"], {}, "hog.bins is varied twice"),
        (["radius=1,2"], {"leader.radius": 3}, "radius is both varied"),
        (["descriptor.bins=8"], {"hog.bins": 3}, "hog.bins is both varied"),
    ],
)
def test_one_parameter_under_two_names_is_noticed(axes, settings, words):
    given = [Setting(name, value, "test") for name, value in settings.items()]
    with pytest.raises(ConfigError, match=words):
        configurations([parse_axis("mapper=leader"), *map(parse_axis, axes)], given)


@pytest.mark.parametrize(("vary", "descriptor"), [({"radius": [1, 2]}, "hog,gist"), ({"hog.bins": [8, 16]}, None)])
def test_what_an_archive_cannot_have_is_not_varied(panoramas, tmp_path, vary, descriptor):
    file = tmp_path / "three.npz"
    omnieval.describe_archive(panoramas, file)
    with pytest.raises(ConfigError, match=r"three\.npz holds descriptors already"):
        omnieval.ablate(file, vary, mapper="leader", descriptor=descriptor, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_namesakes_are_refused(own, panoramas, tmp_path):
    (tmp_path / "tiny.py").write_text(TINY)
    with pytest.raises(ConfigError, match="several descriptors called tiny; give each a name of its own"):
        omnieval.ablate(panoramas, descriptor=[own[0], f"{tmp_path}/tiny.py:Tiny"], out=tmp_path / "out")

    def __init__(self):
        self.describe = lambda panorama: omnieval.Description(panorama[:4].mean(axis=1), panorama[:4])


def test_what_only_this_process_knows_is_not_sent_to_others(panoramas, tmp_path):
    class Own(Leader):
        name = "own"

    with pytest.raises(ConfigError, match="--jobs: the mapper own is known in this process only"):
        omnieval.ablate(panoramas, mapper=[Own], jobs=2, out=tmp_path / "two")
    assert not (tmp_path / "two").exists()
    one = omnieval.ablate(panoramas, {"radius": [2, 4]}, mapper=[Own], out=tmp_path / "one")
    same = omnieval.ablate(panoramas, {"radius": [2, 4]}, mapper="leader", out=tmp_path / "same")
    assert one.select(METRICS).equals(same.select(METRICS))


class Talking(Leader):
    """A mapper that holds what no other process can be sent."""

    name = "talking"

    def __init__(self, settings=None, images=None):
        super().__init__(settings, images)
        self.say = lambda words: words


def test_an_object_may_hold_what_cannot_be_sent_to_a_process(panoramas, tmp_path):
    mapper = Talking(LeaderSettings(radius=2))
    found = omnieval.ablate([panoramas], mapper=mapper, descriptor="hog,gist", jobs=2, out=tmp_path / "out")
    assert found["error"].to_list() == [None, None]
    assert found["radius"].to_list() == [2, 2]


class Usual(Leader):
    """A mapper that could branch, but has nothing to be set."""

    name = "usual"
    Settings = NoSettings  # type: ignore[assignment]  # it has none of the parameters of the one it is made from
    swept = ()  # type: ignore[assignment]

    @property
    def settings(self):
        return LeaderSettings()

    @settings.setter
    def settings(self, value):
        del value

    def decide(self, frame):
        return dataclasses.replace(super().decide(frame), comparisons=())


def test_a_mapper_without_parameters_is_a_row(panoramas, tmp_path):
    rows = omnieval.ablate(panoramas, mapper=[Usual, Leader], out=tmp_path / "out", keep_steps=True)
    assert rows["error"].to_list() == [None, None]
    usual, leader = rows.select(METRICS).rows()
    assert usual == leader


def test_a_descriptor_that_only_this_process_knows_may_be_used_by_many(panoramas, tmp_path):
    class Grey:
        def describe(self, panorama):
            return omnieval.Description(panorama[:4].mean(axis=1), panorama[:4].T.copy())

    rows = omnieval.ablate(
        panoramas, {"radius": [1.2, 4]}, mapper="leader", descriptor=Grey(), jobs=2, out=tmp_path / "two"
    )
    assert rows["error"].to_list() == [None, None]
    assert rows["descriptor"].to_list() == ["grey", "grey"]


def test_the_best_run_knows_what_was_left_out(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images")
    (images / "image33.png").write_bytes(b"")
    plan = make_plan([images], [parse_axis("mapper=leader"), parse_axis("radius=1.2,4")], skip_bad=True)
    run_plan(plan, out=tmp_path / "out", record_best=True)
    best = open_run(tmp_path / "out" / "best")
    assert [bad["file"] for bad in best.manifest["skipped"]] == ["image33.png"]
    with reopened(best) as material:
        assert len(list(material.described)) == 79
    assert json.loads((tmp_path / "out" / "run.json").read_text())["grid"]["skipped"] == {
        best.manifest["source"]: ["image33.png"]
    }
