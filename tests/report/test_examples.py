"""The examples in docstrings are true."""

import doctest

import pytest

from omnieval.report import markup, published, wording


@pytest.mark.parametrize("module", [markup, published, wording])
def test_examples(module):
    result = doctest.testmod(module)
    assert result.attempted > 0
    assert result.failed == 0
