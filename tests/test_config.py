"""Parameters by name: set from anywhere, checked all at once, explained in one line."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, Field

from omnieval.config import (
    Config,
    Setting,
    as_config,
    configure,
    full_name,
    parameters,
    parse_assignment,
    presets,
    read_settings,
    resolve,
)
from omnieval.errors import ConfigError, OmnievalError


class Own:
    """A component of somebody else's that shares names of parameters with ours."""

    class Settings(BaseModel):
        omega: float = Field(1.0, gt=0)
        rows: int = Field(8, gt=0)
        wide: int = 3

    name = "own"

    def __init__(self, settings=None):
        self.settings = settings or self.Settings()

    def describe(self, panorama): ...

    def step(self, description): ...


def test_every_parameter_has_a_name_a_meaning_and_a_place():
    known = parameters()
    assert {"omega", "n_new", "hog.bins", "imaging.rows", "leader.radius", "gist.levels"} <= known.keys()
    assert all(field.description for field in known.values())
    for name, field in known.items():
        if field.default is not None:
            assert configure({name: field.default}) == configure()


def test_the_parameters_are_those_of_what_was_chosen_first():
    names = list(parameters("leader", "gist"))
    assert names[0] == "radius"
    assert names.index("imaging.rows") < names.index("gist.levels") < names.index("roman2020.omega")
    assert "hog.bins" in names
    assert "hog.bins" not in parameters("leader", "gist", everything=False)


def test_later_settings_win_and_presets_come_first():
    config = resolve([Setting("omega", 3, "a"), Setting("omega", "4.5", "b")], preset="paper-literal")
    assert config.mapper.settings["omega"] == 4.5
    assert config.mapper.settings["covariance"] == "pinv"
    assert configure({"covariance": "ridge"}, preset="paper-literal").mapper.settings["covariance"] == "ridge"


@pytest.mark.parametrize("name", ["omega", "mapper.omega", "roman2020.omega"])
def test_a_parameter_is_called_bare_or_by_whose_it_is(name):
    config = configure({name: 1.7})
    assert config.mapper.settings["omega"] == config.settings["omega"] == 1.7
    assert full_name(name) == "omega"


@pytest.mark.parametrize("name", ["bins", "hog.bins", "descriptor.bins"])
def test_a_bare_name_finds_the_descriptor_where_the_mapper_has_none_of_it(name):
    config = configure({name: 8})
    assert config.descriptor.settings["bins"] == config.settings["hog.bins"] == 8
    assert full_name(name) == "hog.bins"


def test_a_bare_name_of_the_mapper_goes_to_the_mapper_and_one_of_two_others_to_none():
    config = configure({"omega": 3.0}, descriptor=Own)
    assert (config.mapper.settings["omega"], config.descriptor.settings["omega"]) == (3.0, 1.0)
    assert configure({"own.omega": 3.0}, descriptor=Own).descriptor.settings["omega"] == 3.0
    with pytest.raises(ConfigError, match=r"rows can be imaging\.rows or own\.rows: say which"):
        configure({"rows": 16}, descriptor=Own)
    assert configure({"imaging.rows": 64}, descriptor=Own).imaging.rows == 64


def test_components_are_chosen_by_settings_too_and_what_is_given_wins():
    assert configure({"mapper": "leader", "radius": 2.0}).mapper.settings == {"radius": 2.0}
    assert configure({"mapper": "leader"}, mapper="roman2020").mapper.name == "roman2020"
    chosen = [Setting("descriptor", "gist", "a file"), Setting("descriptor", "hog", "--set")]
    assert resolve(chosen).descriptor.name == "hog"
    with pytest.raises(ConfigError, match=r"unknown mapper 'leder' \(configure\); did you mean leader"):
        configure({"mapper": "leder"})


def test_a_component_that_is_given_keeps_its_settings_but_for_those_that_are_set():
    given = configure(mapper="leader", radius=2.0, descriptor=Own, wide=9)
    again = configure({"own.omega": 2.0}, mapper=given.mapper, descriptor=given.descriptor)
    assert again.mapper == given.mapper
    assert again.descriptor.settings == {"omega": 2.0, "rows": 8, "wide": 9}


def test_what_is_given_besides_a_configuration_changes_it():
    config = configure({"imaging.rows": 64}, mapper="leader", radius=2.0)
    assert as_config(config) is config
    changed = as_config(config, descriptor="gist")
    assert (changed.mapper, changed.imaging, changed.descriptor.name) == (config.mapper, config.imaging, "gist")
    assert as_config(config, radius=4.0).mapper.settings == {"radius": 4.0}
    assert as_config({"omega": 3.0}, gamma=2.0).settings.items() >= {"omega": 3.0, "gamma": 2.0}.items()


def test_what_is_not_chosen_can_be_set_by_its_full_name_for_when_it_is_and_is_checked():
    assert configure({"leader.radius": 2.0}) == configure()
    assert configure({"leader.radius": 2.0}, mapper="leader").mapper.settings == {"radius": 2.0}
    with pytest.raises(ConfigError, match=r"leader\.radius: expected greater than 0, got -1"):
        configure({"leader.radius": -1})
    with pytest.raises(ConfigError, match="radius is a parameter of leader, which was not chosen"):
        configure(radius=2.0)
    with pytest.raises(ConfigError, match="omega is a parameter of roman2020, which was not chosen"):
        configure(mapper="leader", omega=2.0)


def test_presets_are_those_of_the_mapper():
    assert {"recommended", "paper-literal"} == presets().keys()
    assert presets("leader") == {"recommended": {}}
    with pytest.raises(ConfigError, match="unknown preset 'paper-literal'"):
        configure(preset="paper-literal", mapper="leader")


def test_a_run_gives_its_configuration_back():
    config = configure({"gist.levels": 3, "imaging.rows": 64}, mapper="leader", radius=2.0, descriptor="gist")
    manifest = {"mapper": config.mapper.about, "descriptor": config.descriptor.about}
    read = Config.of_run(json.loads(json.dumps(manifest | {"imaging": config.imaging.model_dump(mode="json")})))
    assert read == config
    assert read.settings == config.settings
    assert read.seed == 0
    assert configure(seed=7).seed == 7


def test_all_faults_are_named_at_once():
    with pytest.raises(ConfigError) as raised:
        configure({"omega": -1, "n_new": "many", "hog.bins": 1, "imaging.rows": 0, "leader.radius": 0})
    for part in (
        *("omega: expected greater than 0, got -1", "n_new: expected", "hog.bins: expected greater"),
        *("imaging.rows: expected", "leader.radius: expected"),
    ):
        assert part in str(raised.value)
    with pytest.raises(ConfigError) as raised:
        configure({"omgea": 2, "gama": 3, "hog.bin": 4})
    for part in ("'omgea' (configure); did you mean omega", "'gama'", "'hog.bin'"):
        assert part in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_truth_value_is_no_number():
    with pytest.raises(ConfigError, match="omega: expected a number, got true"):
        configure(omega=True)


def test_a_file_is_read_by_sections(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('omega = 3\n[mapper]\ngamma = 4\n[hog]\nkernel = "sobel"\n[leader]\nradius = 2\n')
    settings = resolve(read_settings(path)).settings
    assert (settings["omega"], settings["gamma"], settings["hog.kernel"]) == (3.0, 4.0, "sobel")
    assert resolve(read_settings(path)[2:], mapper="leader").settings["radius"] == 2.0


@pytest.mark.parametrize("content", [b"omega = ", b"\xff\xfe", b"[a\n"])
def test_a_file_that_is_no_toml_is_refused_by_name(tmp_path, content):
    path = tmp_path / "mine.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=r"mine\.toml"):
        read_settings(path)


@pytest.mark.parametrize("text", ["", "omega", "=3", "  =3"])
def test_an_assignment_needs_a_name_and_an_equals_sign(text):
    with pytest.raises(ConfigError, match="NAME=VALUE"):
        parse_assignment(text)


def test_an_unknown_descriptor_is_refused():
    with pytest.raises(ConfigError, match="unknown descriptor 'gits'"):
        configure(descriptor="gits")


values = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(), st.lists(st.integers(), max_size=2))


@given(name=st.one_of(st.sampled_from(sorted(parameters())), st.text(max_size=12)), value=values)
def test_whatever_is_set_only_our_own_errors_come_out(name, value):
    try:
        config = configure({name: value})
    except OmnievalError:
        return
    assert isinstance(config, Config)


@given(st.text(max_size=30))
def test_whatever_is_assigned_only_our_own_errors_come_out(text):
    try:
        resolve([parse_assignment(text)])
    except OmnievalError:
        return
    assert full_name(text.partition("=")[0].strip()) is not None or text.partition("=")[0].strip() in parameters()
