"""Parameters by name: set from anywhere, checked all at once, explained in one line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.config import Config, Setting, configure, parameters, parse_assignment, read_settings, resolve
from omnieval.errors import ConfigError, OmnievalError


def test_every_parameter_has_a_name_a_meaning_and_a_place():
    known = parameters()
    assert {"omega", "n_new", "hog.bins", "imaging.rows", "descriptor"} <= known.keys()
    assert all(field.description for field in known.values())
    for name, field in known.items():
        if field.default is not None:
            assert configure({name: field.default}) == Config()


def test_later_settings_win_and_presets_come_first():
    config = resolve([Setting("omega", 3, "a"), Setting("omega", "4.5", "b")], preset="paper-literal")
    assert config.mapper.omega == 4.5
    assert config.mapper.covariance == "pinv"
    assert configure({"covariance": "ridge"}, preset="paper-literal").mapper.covariance == "ridge"


def test_the_name_in_run_json_works_too():
    assert configure({"mapper.omega": 1.7}).mapper.omega == 1.7


def test_all_faults_are_named_at_once():
    with pytest.raises(ConfigError) as raised:
        configure({"omega": -1, "n_new": "many", "hog.bins": 1})
    for part in ("omega: expected greater than 0, got -1", "n_new: expected", "hog.bins: expected greater"):
        assert part in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_truth_value_is_no_number():
    with pytest.raises(ConfigError, match="omega: expected a number, got true"):
        configure(omega=True)


def test_a_file_is_read_by_sections(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('omega = 3\n[mapper]\ngamma = 4\n[hog]\nkernel = "sobel"\n')
    config = resolve(read_settings(path))
    assert (config.mapper.omega, config.mapper.gamma, config.hog.kernel) == (3.0, 4.0, "sobel")


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
    assert text.partition("=")[0].strip().removeprefix("mapper.") in parameters()
