"""The examples in docstrings are true."""

import doctest

import pytest

from omnieval import json_records, text_table, wording
from omnieval.report import published


@pytest.mark.parametrize("module", [json_records, text_table, published, wording])
def test_examples(module):
    result = doctest.testmod(module)
    assert result.attempted > 0
    assert result.failed == 0
