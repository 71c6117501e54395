"""augmented.xml holds the established causes alone."""

from types import SimpleNamespace

import numpy as np
import pytest

from mbw.diagnose.files import find_established_fit


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
    assert find_established_fit(diagnosis(established, refits=refits))[0] == session
