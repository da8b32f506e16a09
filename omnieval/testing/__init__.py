"""Contract checks for descriptors, sequences, mappers and metrics of your own, to be called from your tests.

What passes can be replayed, cached and recorded like omnieval's own::

    from omnieval.testing import check_descriptor

    def test_my_descriptor():
        check_descriptor(MyDescriptor())

Every function raises AssertionError with one line that says what the contract asks and what was found; an exception
of the object under test passes through.
"""

from omnieval.testing.dataset import check_dataset
from omnieval.testing.descriptor import check_descriptor
from omnieval.testing.mapper import check_mapper
from omnieval.testing.metric import check_metric

__all__ = ["check_dataset", "check_descriptor", "check_mapper", "check_metric"]
