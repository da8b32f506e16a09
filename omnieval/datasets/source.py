"""The text that names a sequence: ``SCHEME:PATH``, and for streams what is taken from them, ``#NAME=VALUE,NAME=VALUE``.

What follows the last ``#`` of a source are its options, as in ``video:/data/tour.mp4#every=5`` and
``bag:/data/tour.bag#topic=/camera/image_raw,pose-topic=/odom``. No shell takes these signs for its own. In a value,
``,``, ``#`` and ``%`` are written as in a URL (``%2C``, ``%23``, ``%25``). A file whose own name holds a ``#`` is found
first; written out, its source ends in one more ``#``.
"""

from __future__ import annotations

import urllib.parse
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from omnieval.datasets.scan import canonical_path, exists
from omnieval.datasets.trajectory.between import Joining
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, shown

STREAMS: Mapping[str, tuple[str, ...]] = {
    "video": ("every",),
    "bag": ("topic", "pose-topic", "pose-frame", "every", "poses-tolerance", "poses-interpolate"),
}
"""Schemes that have options, and these in the order in which they are written."""

_MARK = "#"
_KEPT = "/:+-_.~@ "
"""What is not escaped in a value, besides letters and digits."""


@dataclass(frozen=True)
class Address:
    """Where a stream lies, and what is taken from it.

    Attributes
    ----------
    scheme
        One of `STREAMS`.
    path
        The absolute path.
    options
        Values by name, in the order of `STREAMS`; nothing that is the default.
    """

    scheme: str
    path: Path
    options: Mapping[str, str]

    @property
    def source(self) -> str:
        """The source that `parse` reads again."""
        return f"{self.scheme}:{written(str(self.path), self.options)}"

    def without(self, *names: str) -> Address:
        """Return the same stream without some options."""
        kept = {name: value for name, value in self.options.items() if name not in names}
        return Address(self.scheme, self.path, kept)

    @property
    def joining(self) -> Joining:
        """How poses of a topic come to the images."""
        return Joining.of(self.options, self.source)

    @property
    def every(self) -> int:
        """Of how many images one is taken."""
        return int(self.options.get("every", 1))


def parse(scheme: str, rest: str) -> Address:
    """Return what stands behind the scheme of a stream.

    Raises
    ------
    DatasetError
        If there is no path, or an option is unknown or makes no sense.

    Examples
    --------
    >>> parse("video", "/data/tour.mp4#every=5").options
    {'every': '5'}
    """
    path, given = split(rest)
    if not path:
        raise DatasetError(f"{scheme}: names no file; write {scheme}:PATH")
    known = STREAMS[scheme]
    for name, value in given.items():
        if name not in known:
            raise DatasetError(f"unknown option '{shown(name)}' in {scheme}:{shown(rest)}; {did_you_mean(name, known)}")
        if not value:
            raise DatasetError(f"option {name} of {scheme}:{shown(rest)} has no value; write {name}=VALUE")
    if "every" in given:
        given["every"] = _whole_number(given["every"], f"{scheme}:{shown(rest)}")
    given |= Joining.of(given, f"{scheme}:{rest}").written
    options = {name: given[name] for name in known if name in given and (name, given[name]) != ("every", "1")}
    return Address(scheme, canonical_path(path), options)


def split(text: str) -> tuple[str, dict[str, str]]:
    """Return the path and the options of what stands behind a scheme.

    Examples
    --------
    >>> split("tour.bag#topic=/image,every=2")
    ('tour.bag', {'topic': '/image', 'every': '2'})
    >>> split("/C#/tour.mp4")
    ('/C#/tour.mp4', {})
    """
    path, mark, tail = text.rpartition(_MARK)
    if not mark or (tail and "=" not in tail) or exists(canonical_path(text)):
        return text, {}
    pairs = (part.partition("=") for part in tail.split(",") if part)
    return path, {name.strip(): urllib.parse.unquote(value) for name, _, value in pairs}


def apart(source: str, names: Collection[str]) -> tuple[str, dict[str, str]]:
    """Return a source without its options of some names, and these.

    Examples
    --------
    >>> apart("video:/a.mp4#every=5,poses=/a.tum", ["poses"])
    ('video:/a.mp4#every=5', {'poses': '/a.tum'})
    """
    place, given = split(source)
    taken = {name: value for name, value in given.items() if name in names}
    if not taken:
        return source, {}
    return written(place, {name: value for name, value in given.items() if name not in names}), taken


def together(source: str, options: Mapping[str, str]) -> str:
    """Return a source with options behind those it has.

    Examples
    --------
    >>> together("video:/a.mp4#every=5", {"poses": "/a.tum"})
    'video:/a.mp4#every=5,poses=/a.tum'
    """
    place, given = split(source)
    return written(place, {**given, **options}) if options else source


def written(path: str, options: Mapping[str, str]) -> str:
    """Return what `split` reads again.

    Examples
    --------
    >>> written("/data/tour.bag", {"topic": "/a,b"})
    '/data/tour.bag#topic=/a%2Cb'
    """
    if not options and _MARK not in path:
        return path
    pairs = (f"{name}={urllib.parse.quote(value, safe=_KEPT)}" for name, value in options.items())
    return f"{path}{_MARK}{','.join(pairs)}"


def _whole_number(text: str, where: str) -> str:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise DatasetError(f"every={shown(text)} in {where} must be a whole number from 1 on")
    return str(number)
