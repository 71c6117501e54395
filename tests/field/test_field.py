"""Every field case does what its ``case.toml`` expects."""

import pytest

from tests.field.cases import case_names, run_case


@pytest.mark.parametrize("name", case_names())
def test_a_field_case_is_right(name):
    assert run_case(name).faults == ()
