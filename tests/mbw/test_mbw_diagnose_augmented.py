"""augmented.xml holds the established causes alone."""

from types import SimpleNamespace

import numpy as np
import pytest

from mbw.diagnose.augmented import find_alternatives, find_established_fit


def diagnosis(established, *, refits=()):
    """Return a diagnosis with the fitted causes a and b and the proven fault p."""
    causes = [SimpleNamespace(key=(name,)) for name in "pab"]

    def refit(name):
        return SimpleNamespace(session=name, fit=SimpleNamespace(theta=np.array([len(name)])))

    known = {frozenset({(name,) for name in names}): refit(names) for names in refits}
    return SimpleNamespace(
        present=SimpleNamespace(causes=causes, established=tuple((name,) for name in established)),
        gross_hypotheses=causes[:1],
        after=SimpleNamespace(refit=refit("after")),
        parameters=SimpleNamespace(theta=np.array([7.0])),
        retuned=SimpleNamespace(refit=refit("retuned")),
        search=SimpleNamespace(refit_of=lambda keys: known.get(frozenset(keys))),
    )


@pytest.mark.parametrize(
    ("established", "refits", "session"),
    [("ab", (), "after"), ("pab", (), "after"), ("", ("a",), "retuned"), ("p", ("a",), "retuned"),
     ("a", ("a", "b"), "a"), ("pb", ("a", "b"), "b"), ("a", (), "retuned")],
)  # fmt: skip
def test_the_fit_that_is_written_has_the_established_causes_alone(established, refits, session):
    assert find_established_fit(diagnosis(established, refits=refits))[0].session == session


def test_plants_of_at_least_five_per_cent_are_alternatives_with_probabilities_of_sum_one():
    a, b, proven = ("a", "body:a", None), ("b", "body:b", None), ("p", "sensor:p", "tx")
    sets = (((proven, a), 0.6), ((proven, b), 0.2), ((proven,), 0.16), ((proven, a, b), 0.04))
    diagnosed = SimpleNamespace(
        posterior=SimpleNamespace(none=0.0, unexplained=0.0, sets=sets),
        gross_hypotheses=[SimpleNamespace(key=proven)],
    )
    alternatives = find_alternatives(diagnosed, frozenset({a}))
    assert [keys for keys, _ in alternatives] == [{a}, {b}, set()]
    assert [share for _, share in alternatives] == pytest.approx(
        [0.6 / 0.96, 0.2 / 0.96, 0.16 / 0.96]
    )
    alone = find_alternatives(diagnosed, frozenset({a, b}))
    assert alone[0][1] == pytest.approx(0.04)
