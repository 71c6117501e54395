"""Visits to a level: the tests of one level that were made one after the other."""

from collections.abc import Sequence
from dataclasses import replace

from identification.words import Campaign, Input, Output, Test


def group_visits(campaign: Campaign) -> list[tuple[float | None, Campaign]]:
    """Return the tests of each visit to a level, in the order of the campaign.

    Tests that state no level are at one unknown level. A test joins the first visit to its level
    that it continues, as another direction or set-up; one that measures the same again begins a
    further visit.
    """
    visits: list[tuple[float | None, list[Test]]] = []
    for test in campaign.tests:
        level = test.condition.level_n
        for known, tests in visits:
            if known == level and _is_continued(tests, test):
                tests.append(test)
                break
        else:
            visits.append((level, [test]))
    return [(level, replace(campaign, tests=tuple(tests))) for level, tests in visits]


def _is_continued(visited: Sequence[Test], test: Test) -> bool:
    """Return whether a test adds channels to a visit and measures none again in its set-up.

    Set-ups may share a sensor, such as one at a fixed reference.
    """
    cells = _list_cells([test])
    same_setup = [known for known in visited if known.condition.setup == test.condition.setup]
    return not cells & _list_cells(same_setup) and not cells <= _list_cells(visited)


def _list_cells(tests: Sequence[Test]) -> set[tuple[Output, Input]]:
    """Return the channels and references of tests, along positive axes."""
    return {
        (dof.positive, test.condition.reference.positive)
        for test in tests
        for dof in test.estimate.frf.outputs
    }
