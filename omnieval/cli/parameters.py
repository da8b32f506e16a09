"""``omnieval parameters``: every parameter, its default, range and meaning."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_args

from omnieval.cli import options

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo


def parameters(
    mapper: options.MapperName = None, descriptor: options.DescriptorName = None, json: options.Json = False
) -> None:
    """List every parameter with its default, range and meaning: of a mapper, of imaging, of descriptors.

    Examples:

      omnieval parameters

      omnieval parameters --mapper leader

      omnieval replay --set n_new=30 --set hog.orientation_width=32
    """
    from omnieval.cli.console import print_json
    from omnieval.config import parameters as known

    described = {name: _describe(field) for name, field in known(mapper, descriptor).items()}
    if json:
        print_json({"schema_version": 1, "parameters": described})
        return
    width = max(len(name) for name in described)
    for name, facts in described.items():
        default = "none" if facts["default"] is None else facts["default"]
        print(f"{name:<{width}}  {default}  ({facts['range']})")
        print(f"{'':<{width}}  {facts['meaning']}")


def _describe(field: FieldInfo) -> dict[str, Any]:
    return {"default": field.default, "range": _range(field), "meaning": field.description}


def _range(field: FieldInfo) -> str:
    choices = [choice for choice in get_args(field.annotation) if isinstance(choice, str)]
    if choices:
        return " | ".join(choices)
    signs = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
    bounds = [
        f"{sign} {getattr(rule, name)}"
        for rule in field.metadata
        for name, sign in signs.items()
        if hasattr(rule, name)
    ]
    kinds = [kind for kind in (get_args(field.annotation) or (field.annotation,)) if kind is not type(None)]
    names = {int: "whole number", float: "number", str: "text"}
    return ", ".join([*(names.get(kind, str(kind)) for kind in kinds), *bounds])
