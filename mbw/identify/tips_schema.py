"""Content of ``tips.json``: hammer tips side by side, for other programs."""

from identification.readers.result_files import ResultFile, ResultRow


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
