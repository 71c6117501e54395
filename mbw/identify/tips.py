"""Hammer tips side by side: ``mbw identify CAMPAIGN --compare OTHER``.

Content of ``tips.json``: hammer tips side by side, for other programs.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from identification.hits.tips import (
    HammerTip,
    StrongestTip,
    campaign_tips,
    strongest_sentence,
    strongest_tips,
    tip_sentence,
)
from identification.readers.result_files import ResultFile, ResultRow
from identification.words import Campaign, UsageError
from mbw.page.html import fill_template, pack_real


class TipRow(ResultRow):
    """Force and coherence of one hammer tip.

    Args:
        tip: name of the campaign, with that of the hammer if the campaign has several.
        hits: number of averaged hits; 0 if unknown.
        peak: median of the largest forces [N]; null for files of FRFs.
        force_limit: highest frequency at which the force is within 20 dB of its largest line [Hz].
        band: first and last line with such a force and a median coherence above 0.9 [Hz]; null if
            there is none.
        frequency: frequency lines [Hz].
        energy: energy spectral density of the force, mean of the hits [N^2 s/Hz]; null for files of
            FRFs.
        coherence: median over channels and references; null for single hits.
    """

    tip: str
    hits: int
    peak: float | None
    force_limit: float | None
    band: tuple[float, float] | None
    frequency: list[float]
    energy: list[float] | None
    coherence: list[float] | None


class StrongestRow(ResultRow):
    """Band in which one tip puts in more energy than every other.

    Args:
        tip: name of the tip.
        band: ends of the band [Hz].
        gain_db: energy over that of the second strongest tip, median over the band [dB].
    """

    tip: str
    band: tuple[float, float]
    gain_db: float


class TipsFile(ResultFile):
    """Content of ``tips.json``.

    Args:
        sentences: one sentence on each tip, and one on the strongest tip of each band.
        tips: tips in the order of the command.
        strongest: parts of the common band by the strongest tip; empty without forces.
    """

    sentences: list[str]
    tips: list[TipRow]
    strongest: list[StrongestRow]


TIPS_JSON, TIPS_PAGE = "tips.json", "tips.html"


@dataclass(frozen=True, eq=False)
class TipComparison:
    """Tips of several campaigns, and the bands in which each puts in the most energy.

    Args:
        tips: tips in the order of the command.
        strongest: parts of the common band.
    """

    tips: tuple[HammerTip, ...]
    strongest: tuple[StrongestTip, ...]

    @property
    def sentences(self) -> list[str]:
        """One sentence for each tip, and one on the strongest tip of each band."""
        texts = [*map(tip_sentence, self.tips), strongest_sentence(self.strongest)]
        return [text for text in texts if text]


def compare_tips(campaigns: Sequence[Campaign]) -> TipComparison:
    """Compare the tips of campaigns on all lines of their records.

    Raises:
        UsageError: two campaigns have one name, so that the result could not tell them apart.
    """
    tips = tuple(tip for campaign in campaigns for tip in campaign_tips(campaign))
    names = [tip.name for tip in tips]
    if duplicate := next((name for name in names if names.count(name) > 1), None):
        raise UsageError(
            f"--compare: two campaigns have the name {duplicate}: rename the folder of one"
        )
    return TipComparison(tips, strongest_tips(tips))


def write_tips(comparison: TipComparison, folder: Path, *, has_page: bool) -> None:
    """Write ``tips.json``, and ``tips.html`` if pictures are wanted."""
    text = _content(comparison).model_dump_json(indent=1)
    (folder / TIPS_JSON).write_text(text + "\n", "utf-8")
    if has_page:
        (folder / TIPS_PAGE).write_text(_page(comparison), encoding="utf-8")


def _content(comparison: TipComparison) -> TipsFile:
    return TipsFile(
        sentences=comparison.sentences,
        tips=[_row(tip) for tip in comparison.tips],
        strongest=[
            StrongestRow(tip=part.name, band=(part.low_hz, part.high_hz), gain_db=part.gain_db)
            for part in comparison.strongest
        ],
    )


def _row(tip: HammerTip) -> TipRow:
    return TipRow(
        tip=tip.name,
        hits=tip.hits,
        peak=tip.peak_n,
        force_limit=tip.force_limit_hz,
        band=tip.band_hz,
        frequency=tip.freq_hz.tolist(),
        energy=tip.energy.tolist() if tip.has_force else None,
        coherence=tip.coherence.tolist() if tip.has_coherence else None,
    )


def _page(comparison: TipComparison) -> str:
    """Return the page: energy and coherence of all tips along one frequency axis."""
    rows = [
        {
            "name": tip.name,
            "freq": pack_real(tip.freq_hz),
            "energy": pack_real(tip.energy) if tip.has_force else "",
            "coherence": pack_real(tip.coherence) if tip.has_coherence else "",
            "band": None if tip.band_hz is None else list(tip.band_hz),
            "limit": tip.force_limit_hz,
            "peak": tip.peak_n,
            "hits": tip.hits,
            "top": float(np.max(tip.energy, initial=0.0)),
        }
        for tip in comparison.tips
    ]
    items = "".join(f"<li>{escape(text)}</li>" for text in comparison.sentences)
    return fill_template(
        "identify/tips_template.html",
        {
            "tips": rows,
            "strongest": [
                {"name": part.name, "low": part.low_hz, "high": part.high_hz}
                for part in comparison.strongest
            ],
        },
        title="Hammer tips side by side",
        subtitle=escape(", ".join(tip.name for tip in comparison.tips)),
        sentences=items,
        scripts=["identify/tips.js"],
    )
