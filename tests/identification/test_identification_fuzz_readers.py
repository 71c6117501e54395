"""Mutated measurements and meshes of shapes give one sentence or a result, quickly."""

import pytest

from tests.helpers.fuzz_measurements import MEASUREMENT_TARGETS
from tests.helpers.fuzzing import find_faults
from tests.helpers.mutations import MUTATIONS


@pytest.mark.parametrize("target", MEASUREMENT_TARGETS, ids=lambda target: target.name)
def test_a_mutated_measurement_is_read_or_refused(target, tmp_path):
    assert find_faults(target, tmp_path, target.seeds(MUTATIONS)) == {}
