"""What the columns of a table of poses are, by the words of its heading."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from omnieval.wording import shown

Role = Literal["name", "time", "nanoseconds", "x", "y", "z", "yaw", "qx", "qy", "qz", "qw", "room"]

METRES = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "km": 0.001}
"""Units of length, and how many of each are a metre."""
SECONDS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Units of time, and how many nanoseconds each is."""
ANGLES = ("rad", "deg")

_UNITS = {
    **{name: name for name in (*METRES, *SECONDS, *ANGLES)},
    **{"meter": "m", "meters": "m", "metre": "m", "metres": "m", "millimetres": "mm", "millimeters": "mm"},
    **{"sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "usec": "us", "nsec": "ns", "nsecs": "ns"},
    **{"nanoseconds": "ns", "nanosec": "ns", "microseconds": "us", "milliseconds": "ms", "millis": "ms"},
    **{"radian": "rad", "radians": "rad", "degree": "deg", "degrees": "deg", "°": "deg"},
}
_PLACE_WORDS = frozenset(
    [
        "pos",
        "position",
        "p",
        "t",
        "translation",
        "trans",
        "location",
        "loc",
        "coord",
        "coordinate",
        "coordinates",
        "point",
        "pose",
        "field",
        "world",
        "w",
        "map",
        "odom",
        "gt",
        "ground",
        "truth",
        "groundtruth",
        "base",
        "link",
        "robot",
        "camera",
        "cam",
        "body",
        "imu",
        "rs",
        "r",
        "s",
        "wb",
        "wc",
        "global",
        "true",
    ]
)
_TURN_WORDS = frozenset(["q", "quat", "quaternion", "orientation", "orient", "rotation", "rot"])
_ALONE: dict[str, Role] = {
    **dict.fromkeys(("file", "filename", "image", "img", "name", "imagefile", "imagename", "path", "picture"), "name"),
    **dict.fromkeys(("time", "timestamp", "timestamps", "stamp", "t", "sec", "secs", "epoch", "utime"), "time"),
    **dict.fromkeys(("tx", "px", "x", "easting", "east", "posx", "xpos"), "x"),
    **dict.fromkeys(("ty", "py", "y", "northing", "north", "posy", "ypos"), "y"),
    **dict.fromkeys(("tz", "pz", "z", "posz", "zpos", "altitude", "alt", "elevation"), "z"),
    **dict.fromkeys(("yaw", "theta", "heading", "th", "psi", "angle", "orientation", "rz", "rotz"), "yaw"),
    **dict.fromkeys(("nsecs", "nsec", "nanosec", "nanosecs", "nanoseconds"), "nanoseconds"),
    **{"qx": "qx", "qy": "qy", "qz": "qz", "qw": "qw"},
    **dict.fromkeys(("room", "label", "place", "category", "class"), "room"),
}
_AXES: dict[str, Role] = {"x": "x", "y": "y", "z": "z"}
_PARTS: dict[str, Role] = {"x": "qx", "y": "qy", "z": "qz", "w": "qw"}
_PHRASES: tuple[tuple[Role, frozenset[str], frozenset[str]], ...] = (
    (
        "name",
        frozenset(["file", "filename", "name", "path", "image"]),
        frozenset(["file", "image", "img", "picture", "rgb"]),
    ),
    (
        "time",
        frozenset(["time", "timestamp", "stamp"]),
        frozenset(["header", "image", "ros", "unix", "epoch", "field", "gps"]),
    ),
    ("yaw", frozenset(["yaw", "theta", "heading"]), _PLACE_WORDS | _TURN_WORDS),
)
"""What the last word of several means, and what may stand before it."""
_OF_THE_EARTH = frozenset(("lat", "latitude", "lon", "lng", "long", "longitude"))
_COMPASS = frozenset(("azimuth", "bearing", "compass", "course"))
_LIKELY = 0.8
"""How much an unknown word must resemble a known one to be taken for a slip of it."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column that means something: where it is, what it is, and its unit if the heading tells it."""

    index: int
    role: Role
    title: str
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class Heading:
    """What a heading says.

    Attributes
    ----------
    columns
        By role.
    unread
        Titles of the other columns.
    notes
        What is worth saying of them.
    """

    columns: dict[Role, Column]
    unread: tuple[str, ...]
    notes: tuple[str, ...]


def read_heading(titles: Sequence[str]) -> Heading:
    """Return what the columns below a heading are.

    Raises
    ------
    ValueError
        If x or y is missing, two columns claim to be the same, or a title is a slip of one that is missing.
    """
    found, unread = _known_columns(titles)
    notes: list[str] = []
    earth = [title for title in unread if _words(title)[0] and _words(title)[0][-1] in _OF_THE_EARTH]
    if earth and not {"x", "y"} <= found.keys():
        raise ValueError(
            f"column '{shown(earth[0])}' is an angle on the Earth; project it to metres first, such as UTM x and y"
        )
    for title in unread:
        meant = _slip_of(title)
        if meant and meant not in {*found, "room"} and (meant != "yaw" or "qw" not in found):
            raise ValueError(f"unknown column '{shown(title)}'; did you mean {_in_words(meant)}?")
    missing = [axis for axis in ("x", "y") if axis not in found]
    if missing:
        raise ValueError(
            f"no column {missing[0]} among {', '.join(map(shown, titles))}; expected such as file,x,y,yaw or "
            "time,x,y,yaw"
        )
    turned = [title for title in unread if set(_words(title)[0]) & _COMPASS]
    if turned:
        notes.append(f"{', '.join(map(shown, turned))} is of a compass, clockwise, and is not read as yaw")
    partial = [axis for axis in ("qx", "qy", "qz", "qw") if axis not in found]
    if 0 < len(partial) < 4:
        raise ValueError(f"a quaternion needs qx, qy, qz and qw, there is no {partial[0]}")
    return Heading(found, tuple(unread), tuple(notes))


def _known_columns(titles: Sequence[str]) -> tuple[dict[Role, Column], list[str]]:
    """Return the columns whose titles are understood, and the titles of the others."""
    found: dict[Role, Column] = {}
    unread: list[str] = []
    for index, title in enumerate(titles):
        role, unit = role_of(title)
        if role is None:
            unread.append(title)
        elif role == "time" and role in found and _tells_more(found, unread, Column(index, role, title, unit)):
            continue
        elif role in found:
            if titles[found[role].index].casefold() == title.casefold():
                raise ValueError(f"column {shown(title)} appears twice; keep one")
            both = f"'{shown(found[role].title)}' and '{shown(title)}'"
            raise ValueError(f"columns {both} may both be {_in_words(role)}; rename the one that is not")
        else:
            found[role] = Column(index, role, title, unit)
    if "nanoseconds" in found and "time" not in found:  # not a part of the time, but all of it
        whole = found.pop("nanoseconds")
        found["time"] = Column(whole.index, "time", whole.title, "ns")
    return found, unread


def role_of(title: str) -> tuple[Role | None, str | None]:
    """Return what a column of a title is and its unit, None where the title does not tell.

    Examples
    --------
    >>> role_of("p_RS_R_x [m]"), role_of("pose.orientation.w"), role_of("yaw_deg"), role_of("v_RS_R_x [m s^-1]")
    (('x', 'm'), ('qw', None), ('yaw', 'deg'), (None, None))
    >>> role_of("#timestamp [ns]"), role_of("ImageFile"), role_of("speed")
    (('time', 'ns'), ('name', None), (None, None))
    """
    words, unit = _words(title)
    if not words:
        return None, None
    role = _role(words)
    return role, unit if role else None


def _role(words: Sequence[str]) -> Role | None:
    """Return what a column is of which these are the words, without a unit."""
    last, before = words[-1], set(words[:-1])
    if before & _TURN_WORDS and last in _PARTS:
        return _PARTS[last]
    if last in _AXES and before <= _PLACE_WORDS:
        return _AXES[last]
    if (joined := "".join(words)) in _ALONE:
        return _ALONE[joined]
    return next((role for role, lasts, befores in _PHRASES if before and last in lasts and before <= befores), None)


def _words(title: str) -> tuple[list[str], str | None]:
    """Return the words of a title in lower case without its unit, and the unit."""
    bracketed = re.search(r"[\[({]\s*([^\])}]*?)\s*[\])}]", title)
    bare = re.sub(r"[\[({].*", "", title)
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare)
    words = re.findall(r"[^\W_]+", apart.casefold())
    if bracketed:
        return words, _UNITS.get(bracketed[1].casefold())
    if len(words) > 1 and words[-1] in _UNITS and _role(words) is None and _role(words[:-1]):
        return words[:-1], _UNITS[words[-1]]
    return words, None


def _tells_more(found: dict[Role, Column], unread: list[str], column: Column) -> bool:
    """Decide what a second column of times is: nanoseconds of the first, or another time; False if nobody can tell."""
    first = found["time"]
    if (first.unit, column.unit) == ("s", "ns") and _words(first.title)[0] == _words(column.title)[0]:
        found["nanoseconds"] = Column(column.index, "nanoseconds", column.title, "ns")
        return True
    if _of_a_header(column.title) == _of_a_header(first.title):
        return False
    found["time"], other = (column, first) if _of_a_header(column.title) else (first, column)
    unread.append(other.title)
    return True


def _of_a_header(title: str) -> bool:
    """Tell whether a time is that of the message itself, not of when it was recorded."""
    return "header" in _words(title)[0]


def _slip_of(title: str) -> Role | None:
    """Return the role of the one word that a title is nearly; None if it is not like any."""
    word = "".join(_words(title)[0])
    near = difflib.get_close_matches(word, [known for known in _ALONE if len(known) > 2], n=1, cutoff=_LIKELY)
    return _ALONE[near[0]] if near else None


def _in_words(role: Role) -> str:
    return "the file name" if role == "name" else role
