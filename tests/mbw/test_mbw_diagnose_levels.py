"""Sentences of a diagnosis on the gap at each level, and on laws that look alike."""

from types import SimpleNamespace

from diagnosis.estimates.gap_by_level import LevelGapRow
from diagnosis.verdict.schema import CauseRow
from mbw.diagnose.gap_sentences import level_sentences
from tuning.files.schema import GapRow


def row(level, before, after):
    gaps = (GapRow(error=None, excess=excess) for excess in (before, after))
    retuned, last = gaps
    return LevelGapRow(level=level, retuned=retuned, after=last, closed=None)


def verdict(levels=(), foretold=None, causes=()):
    gap = SimpleNamespace(levels=list(levels), foretold=foretold)
    return SimpleNamespace(gap=gap, causes=list(causes))


def cause(probability):
    return CauseRow(
        effect="friction",
        location="joint:ty",
        dof="ty",
        probability=probability,
        parameters={},
        interval={},
        excess_after=None,
        laws=["Jenkins", "Iwan"],
    )


def test_the_gap_is_told_at_every_level_and_where_it_was_foretold():
    at_levels, foretold = level_sentences(
        verdict([row(40, 2.0, 1.1), row(200, 8.0, 1.5)], row(200, 9.0, 2.5))
    )
    assert at_levels == "Gap in times the noise, level by level: 40 N 2 to 1.1, 200 N 8 to 1.5."
    assert foretold.startswith("Fits to the other levels alone foretell the tests at 200 N 9 to 2")


def test_a_level_without_noise_is_not_told():
    assert level_sentences(verdict([row(40, None, None)])) == []
    assert level_sentences(verdict()) == []


def test_laws_that_look_alike_are_named_for_a_probable_cause():
    (said,) = level_sentences(verdict(causes=[cause(0.9)]))
    assert "friction may be a Jenkins or Iwan element" in said
    assert level_sentences(verdict(causes=[cause(0.2)])) == []
