"""Axes: what is written is what is swept, exactly, and every fault is said at once."""

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.ablation.grid import EXPERIMENTS, configurations, make_axis, parse_axis, preset_axes, read_axes, value_of
from omnieval.ablation.plan import make_plan
from omnieval.config import Setting
from omnieval.errors import ConfigError, DatasetError


def swept(*texts, **settings):
    axes = [parse_axis(text) for text in texts]
    configs = configurations(axes, [Setting(name, value, "test") for name, value in settings.items()])
    return [tuple(value_of(config, axis.name) for axis in axes) for config in configs]


@pytest.mark.parametrize(
    ("axis", "values"),
    [
        ("omega=1.7:2.3:0.15", [1.7, 1.85, 2.0, 2.15, 2.3]),
        ("merge_y=0.75:2.25:0.25", [0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25]),
        ("omega=0.1:0.3:0.1", [0.1, 0.2, 0.3]),
        ("n_new=50:20:-10", [50, 40, 30, 20]),
        ("n_new=20, 30,40:60:10", [20, 30, 40, 50, 60]),
        ("covariance=diagonal,pinv", ["diagonal", "pinv"]),
        ("descriptor=hog,gist", ["hog", "gist"]),
        ("hog.bins=8:16:8", [8, 16]),
        ("mapper.omega=2", [2.0]),
        ("imaging.r_out=150.5,160", [150.5, 160.0]),
        ("omega=1:2:0.33333333334", [1.0, 1.33333333334, 1.66666666668, 2.0]),
    ],
)
def test_values_are_the_ones_written(axis, values):
    assert [point[0] for point in swept(axis)] == values


@given(
    first=st.decimals("0.01", "5", places=2),
    step=st.decimals("0.01", "2", places=3).filter(lambda step: step > 0),
    count=st.integers(1, 20),
)
def test_a_range_is_the_list_of_its_values(first, step, count):
    values = [first + number * step for number in range(count)]
    spelled = parse_axis("omega=" + ",".join(map(str, values))).values
    ranged = parse_axis(f"omega={first}:{values[-1]}:{step}").values
    assert [Decimal(value) for value in ranged] == [Decimal(value) for value in spelled] == values
    assert swept(f"omega={first}:{values[-1]}:{step}") == [(float(value),) for value in values]


@given(first=st.integers(10, 100), step=st.integers(1, 9), excess=st.integers(0, 8), count=st.integers(1, 9))
def test_a_range_stops_before_its_end_is_passed(first, step, excess, count):
    last = first + (count - 1) * step + min(excess, step - 1)
    assert swept(f"n_new={first}:{last}:{step}") == [(first + number * step,) for number in range(count)]


def test_the_last_axis_varies_fastest():
    assert swept("omega=2,3", "n_new=10,20") == [(2, 10), (2, 20), (3, 10), (3, 20)]
    assert len(configurations([])) == 1


def test_axes_from_a_file_are_those_of_the_command_line(tmp_path):
    file = tmp_path / "axes.toml"
    file.write_text('omega = "1.7:2.3:0.15"\nn_new = [20, 30]\n[hog]\nbins = 8\n')
    from_file = configurations(read_axes(file))
    assert from_file == configurations(list(map(parse_axis, ["omega=1.7:2.3:0.15", "n_new=20,30", "hog.bins=8"])))
    with pytest.raises(ConfigError, match="cannot read axes"):
        read_axes(tmp_path / "none.toml")


def test_the_papers_sweep_has_five_by_seven_points_for_each_descriptor():
    for name, experiment in EXPERIMENTS.items():
        assert len(configurations(preset_axes([], experiment, name))) == 70
    asked = preset_axes([make_axis("descriptor", "hog", "test"), make_axis("n_new", "20,30", "test")], experiment, name)
    assert [axis.name for axis in asked] == ["descriptor", "omega", "merge_y", "n_new"]
    assert len(configurations(asked)) == 70


@pytest.mark.parametrize("text", ["omega", "=1", "omega=", "omega=1,", "omega=1:2", "omega=1:2:0", "omega=2:1:1"])
def test_an_axis_that_is_none_is_refused(text):
    with pytest.raises(ConfigError, match="vary"):
        parse_axis(text)


@pytest.mark.parametrize(
    "text", ["omega=1:nan:1", "omega=1:inf:1", "omega=1:2:inf", "omega=1:2:-inf", "omega=a:b:c", "omega=0:1:1e-9"]
)
def test_a_range_without_end_is_refused(text):
    with pytest.raises(ConfigError, match=r"expected first:last:step|take a larger step"):
        parse_axis(text)


def test_every_fault_is_named_at_once():
    with pytest.raises(ConfigError) as caught:
        swept("omega=1,-1", "covarianc=diagonal,pinv", "n_new=ten", "gamma=5,6", "gamma=7", "split=random", split="x")
    message = str(caught.value)
    for word in ("'-1'", "did you mean covariance?", "'ten'", "gamma is varied twice", "split is both varied", "'x'"):
        assert word in message
    assert message.count("covarianc'") == 1
    assert "\n" not in message


def test_a_value_that_stands_twice_is_refused():
    with pytest.raises(ConfigError, match="omega: a value is given twice"):
        swept("omega=1.7,1.70,2")


def test_sources_are_checked_after_the_grid(panoramas):
    with pytest.raises(DatasetError, match=r"nowhere.*nothing"):
        make_plan([panoramas, "nowhere", "nothing"], [])
    with pytest.raises(ConfigError, match=r"^omega: (?!.*nowhere)"):
        make_plan(["nowhere"], [parse_axis("omega=x")])
    with pytest.raises(ConfigError, match="named twice"):
        make_plan([panoramas, f"folder:{panoramas}"], [])
    with pytest.raises(ConfigError, match=r"n_init = 90 images but there are only 80"):
        make_plan([panoramas], [parse_axis("n_init=20,90")])


@pytest.mark.parametrize("content", ["omega = " + "[" * 5000, "omega = 1" + "0" * 5000, "\udcff"])
def test_a_file_of_axes_that_makes_no_sense_is_refused(tmp_path, content):
    file = tmp_path / "axes.toml"
    file.write_bytes(content.encode("utf-8", "surrogateescape"))
    with pytest.raises(ConfigError, match=r"axes\.toml"):
        read_axes(file)
