"""Values by their keys, beside a search through all pairs for each key."""

from hypothesis import given
from hypothesis import strategies as st

from identification.words import first_by_key, group_by_key

PAIRS = st.lists(st.tuples(st.integers(0, 3), st.integers()))


@given(PAIRS)
def test_groups_hold_all_values_of_a_key_in_the_order_of_the_pairs(pairs):
    groups = group_by_key(pairs)
    assert list(groups) == list(dict.fromkeys(key for key, _ in pairs))
    for key, values in groups.items():
        assert values == [value for other, value in pairs if other == key]


@given(PAIRS)
def test_the_first_value_of_a_key_stays(pairs):
    assert first_by_key(pairs) == {key: values[0] for key, values in group_by_key(pairs).items()}


def test_pairs_may_come_one_by_one():
    assert group_by_key((n % 2, n) for n in range(5)) == {0: [0, 2, 4], 1: [1, 3]}
