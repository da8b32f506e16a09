"""Tables as CSV, which knows neither lists nor structures: these are joined to text.

Items of a list are joined by spaces. Items that are structures are joined by ``; ``, each as ``name=value`` for what it
has, joined by spaces, a list in it by commas.
"""

from __future__ import annotations

from typing import Any

import polars as pl


def flat_csv(table: pl.DataFrame) -> str:
    """Return a table as CSV, one line per row behind the heading; null is an empty cell.

    Examples
    --------
    >>> table = pl.DataFrame({"node": [3], "frames": [[1, 2]], "rooms": [[{"room": "A", "share": 0.5}]]})
    >>> print(flat_csv(table), end="")
    node,frames,rooms
    3,1 2,room=A share=0.5
    """
    nested = [column.name for column in table if column.dtype.is_nested()]
    flat = [pl.Series(name, [_text(value) for value in table[name].to_list()], dtype=pl.String) for name in nested]
    return table.with_columns(*flat).write_csv()


def _text(value: Any) -> str | None:
    if value is None:
        return None
    items = value if isinstance(value, list) else [value]
    structured = any(isinstance(item, dict) for item in items)
    return ("; " if structured else " ").join(map(_item, items))


def _item(item: Any) -> str:
    if not isinstance(item, dict):
        return "" if item is None else str(item)
    return " ".join(f"{name}={_value(value)}" for name, value in item.items() if value is not None)


def _value(value: Any) -> str:
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)
