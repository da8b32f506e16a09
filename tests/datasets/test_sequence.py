"""Parts of a sequence."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.datasets import Frame, Sequence
from omnieval.datasets.cachedir import cache_dir
from omnieval.errors import DatasetError
from omnieval.material.source import Cut

WHOLE = Sequence("s", "folder:/s", Path("/s"), tuple(Frame(Path(f"/s/{i}"), str(i)) for i in range(40)))
CUTS = st.builds(Cut, st.integers(-12, 12), st.integers(1, 4), st.none() | st.integers(1, 50))


@given(cuts=st.lists(CUTS, max_size=4))
def test_cuts_compose(cuts):
    part, expected = WHOLE, WHOLE.frames
    for cut in cuts:
        expected = expected[cut.start :: cut.stride][: cut.limit]
        if not expected:
            with pytest.raises(DatasetError, match="leave none"):
                part.cut(start=cut.start, stride=cut.stride, limit=cut.limit)
            return
        part = part.cut(start=cut.start, stride=cut.stride, limit=cut.limit)
    assert part.frames == expected
    start, stride, limit = part.cut_from
    assert WHOLE.cut(start=start, stride=stride, limit=limit).frames == expected


def test_a_cut_of_a_cut_says_what_was_cut_from_the_whole():
    part = WHOLE.cut(start=2, stride=3, limit=6).cut(start=1, stride=2)
    assert [frame.file for frame in part.frames] == ["5", "11", "17"]
    assert part.cut_from == (5, 6, 3)


@pytest.mark.parametrize("cut", [{"stride": 0}, {"stride": -1}, {"limit": 0}, {"limit": -1}, {"start": 40}])
def test_a_cut_that_leaves_nothing_is_refused(cut):
    with pytest.raises(DatasetError, match="leave none of its 40 frames"):
        WHOLE.cut(**cut)


def test_the_cache_may_lie_in_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("OMNIEVAL_CACHE", "~/kept")
    assert cache_dir() == tmp_path / "kept"
