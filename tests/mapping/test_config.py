"""The mapper's parameters: validated, frozen, described."""

import pytest
from pydantic import ValidationError

from omnieval.mapping.roman2020.settings import PRESETS, Roman2020Settings


def test_every_parameter_says_what_it_means():
    assert all(field.description for field in Roman2020Settings.model_fields.values())


def test_presets_name_valid_values():
    for settings in PRESETS.values():
        assert Roman2020Settings.model_validate(settings).model_dump().items() >= settings.items()


@pytest.mark.parametrize("name", sorted(Roman2020Settings.model_fields))
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1, "nonsense", None, [1]])
def test_bad_values_are_refused_for_every_parameter(name, value):
    with pytest.raises(ValidationError):
        Roman2020Settings.model_validate({name: value})


def test_a_configuration_does_not_change():
    with pytest.raises(ValidationError):
        setattr(Roman2020Settings(), "omega", 1.0)  # noqa: B010 - a plain assignment is already refused by the type checker
