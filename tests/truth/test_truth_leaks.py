"""Nothing but the FRFs tells the cause; a leak that is planted is found."""

import pytest

from tests.helpers.leaks import features, seen
from truth.campaign.case_design import draw_case
from truth.machine.random_tree import draw_tree

ROUND = 43  # cases, in which every cause comes and twins are together
CASES = 4 * ROUND


def drawn(number, machines):
    """Features, what is missing, kind of place, and machine of a case."""
    case = draw_case(machines[number // ROUND % 2], 71, number)
    answer = case.campaign.answer.decode()
    place = answer.partition('location = "')[2].partition(":")[0] or "nowhere"
    missing = "something" if case.plan.cause.wanted else "nothing"
    return features(case.campaign.files), missing, place, case.plan.seed


@pytest.fixture(scope="module")
def campaigns(nominal, silence):
    """Rounds of a small tree and of the station in turn.

    Values are no features, nor are sizes. The bench has both."""
    with pytest.MonkeyPatch.context() as patch:
        silence(patch)
        machines = draw_tree(2, 3), nominal
        return [drawn(number, machines) for number in range(CASES)]


@pytest.mark.parametrize("label", [1, 2])
def test_trees_cannot_tell_what_is_missing(campaigns, label):
    kept = [one for one in campaigns if one[label] in ("something", "nothing", "joint", "sensor")]
    found = seen([one[0] for one in kept], [one[label] for one in kept], [one[3] for one in kept])
    assert found.low < found.chance
    assert found.accuracy < 0.68


@pytest.mark.parametrize("planted", ["averages", "name"])
def test_a_planted_leak_is_found(campaigns, planted):
    leaking = []
    for found, missing, _, _ in campaigns:
        one = dict(found)
        if planted == "averages" and missing == "nothing":
            one["test 0 averages"] += 1
        if planted == "name":
            one["name 0"] = one["name 0"] + (missing == "nothing")
        leaking.append(one)
    found = seen(leaking, [one[1] for one in campaigns], [one[3] for one in campaigns])
    assert found.low > found.chance
