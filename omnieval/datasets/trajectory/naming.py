"""Which image a table means by a name, however that is spelt."""

from __future__ import annotations

import re
import unicodedata
from collections import defaultdict
from collections.abc import Mapping, Sequence

_ENDING = re.compile(r"\.[a-z][a-z0-9]{1,4}$")


class NameIndex:
    """Images by the ways to name them; a path is the surest, then the end of one, whatever its ending or case."""

    def __init__(self, files: Sequence[str]) -> None:
        plain = {file: _plain(file) for file in files}
        self._exact: Mapping[str, str] = {name: file for file, name in plain.items()}
        stems: defaultdict[str, list[str]] = defaultdict(list)
        for file, name in plain.items():
            stems[_stem(name)].append(file)
        self._stems = stems

    def meant(self, name: str) -> list[str]:
        """Return the images that a name may mean."""
        plain = _plain(name)
        if plain in self._exact:
            return [self._exact[plain]]
        candidates = self._stems.get(_stem(plain), [])
        for alike in (_parts_alike, _ending_alike, _case_alike):
            if len(candidates) < 2:
                return candidates
            likeness = [alike(plain, _plain(file)) for file in candidates]
            candidates = [file for file, score in zip(candidates, likeness, strict=True) if score == max(likeness)]
        return candidates


def _plain(name: str) -> str:
    """Return what spellings of one path have in common: separators, ``./``, composed and decomposed accents."""
    return unicodedata.normalize("NFC", name.replace("\\", "/")).removeprefix("./")


def _stem(plain: str) -> str:
    """Return the last part of a path without its ending, in lower case."""
    return _ENDING.sub("", plain.rpartition("/")[2].casefold())


def _parts_alike(one: str, other: str) -> int:
    """Return how many parts, from the end, two paths have in common, without their endings."""
    ones, others = (_ENDING.sub("", path.casefold()).split("/")[::-1] for path in (one, other))
    count = 0
    for a, b in zip(ones, others, strict=False):
        if a != b:
            break
        count += 1
    return count


def _ending_alike(one: str, other: str) -> bool:
    endings = [_ENDING.search(path.casefold()) for path in (one, other)]
    return len({ending and ending[0] for ending in endings}) == 1


def _case_alike(one: str, other: str) -> bool:
    return one.rpartition("/")[2] == other.rpartition("/")[2]
