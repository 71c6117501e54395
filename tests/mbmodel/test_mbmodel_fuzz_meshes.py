"""Mutated meshes of bodies give one sentence or a mass, quickly."""

import pytest

from tests.helpers.fuzz_measurements import MESH_TARGETS
from tests.helpers.fuzzing import find_faults
from tests.helpers.mutations import MUTATIONS


@pytest.mark.parametrize("target", MESH_TARGETS, ids=lambda target: target.name)
def test_a_mutated_mesh_is_read_or_refused(target, tmp_path):
    assert find_faults(target, tmp_path, target.seeds(MUTATIONS)) == {}
