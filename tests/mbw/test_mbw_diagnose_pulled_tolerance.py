"""Sentence on tolerances beyond their usual bound, for a verdict "none"."""

from types import SimpleNamespace

import numpy as np

from diagnosis.settings import SETTINGS
from mbw.diagnose.pulled_tolerance import bound_sentence, pull_sentence
from mbw.diagnose.result import unfinished_fit_sentences

NAMES = ("ty_tx.stiffness", "acc1.rotation_z", "hammer(acc1:ty).rotation_z")


def case(x, *, word="none"):
    """Verdict and fit without any effect, which ended at x; a stiffness has no prior."""
    parametrisation = SimpleNamespace(
        names=NAMES,
        is_tolerance=np.array([False, True, True]),
        coordinates_at_bound=lambda x: np.abs(x) >= 2.5,
    )
    refit = SimpleNamespace(fit=SimpleNamespace(parametrisation=parametrisation, x=np.array(x)))
    found = SimpleNamespace(
        null=SimpleNamespace(fit=SimpleNamespace(parametrisation=parametrisation, x=np.array(x))),
        settings=SETTINGS,
        retuned=SimpleNamespace(refit=refit),
        after=None,
    )
    return SimpleNamespace(verdict=word), found


def told(x, **values):
    return pull_sentence(*case(x, **values))


def test_a_tolerance_beyond_its_bound_is_named():
    assert told([9.0, 1.0, -3.29]) == (
        "This verdict accepts a pull of 3.3 for hammer(acc1:ty).rotation_z (shift in standard "
        "deviations of the prior): among many tolerances, pulls up to 4.5 occur by chance."
    )


def test_of_two_the_one_that_is_pulled_more_comes_first():
    said = told([0.0, 2.7, 3.1])
    assert (
        "accepts a pull of 3.1 for hammer(acc1:ty).rotation_z, a pull of 2.7 for acc1.rotation_z"
        in said
    )


def test_the_sentence_exists_only_if_nothing_is_missing_and_a_tolerance_is_beyond():
    assert told([0.0, 1.0, 3.3], word="explained") is None
    assert told([9.0, 1.0, 2.4]) is None


def test_tolerances_at_their_bounds_are_named():
    _, diagnosis = case([9.0, 2.5, -2.5], word="unexplained")
    assert bound_sentence(diagnosis) == (
        "2 tolerances reached the bound of 2.5 standard deviations in the fit of the re-tuned "
        "model: acc1.rotation_z +2.5, hammer(acc1:ty).rotation_z -2.5."
    )
    diagnosis.after = diagnosis.retuned
    assert "in the fit with the present causes: acc1" in bound_sentence(diagnosis)
    assert bound_sentence(case([9.0, 2.4, 0.0])[1]) is None


def test_fits_that_did_not_converge_are_named():
    def said(converged, retuned, after):
        levels = (SimpleNamespace(unfinished=count) for count in (retuned, after))
        parameters = SimpleNamespace(converged=converged)
        keys = ("parameters", "retuned", "after")
        return unfinished_fit_sentences(
            SimpleNamespace(**dict(zip(keys, (parameters, *levels), strict=True)))
        )

    assert said(True, 0, 0) == []
    sizes, gaps = said(False, 2, 4)
    assert sizes.startswith("The fit that gives the sizes did not converge")
    assert "2 re-tuned, 4 with the cause" in gaps
