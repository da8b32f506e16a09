"""A synthetic building of which only the beginning is there."""

import pytest

from tests.docs.site import furnish_cache


@pytest.fixture(scope="module")
def small_building(few_clusters, tmp_path_factory):
    """A cache of our own, in which the synthetic building is there already, and short."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMNIEVAL_CACHE", str(tmp_path_factory.mktemp("small-building")))
        furnish_cache()
        yield
