"""Fixtures of the small machine, and of campaigns that are refused."""

import pytest
from small_machine import drawing, flip, model, true_theta

from identification.words import InputError

__all__ = ["drawing", "flip", "model", "true_theta"]


@pytest.fixture
def refusal(read):
    """The sentence with which a module's own ``read`` refuses."""

    def message(*arguments, **files):
        with pytest.raises(InputError) as caught:
            read(*arguments, **files)
        return str(caught.value)

    return message
