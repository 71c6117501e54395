"""Modes against the level of the hits, for the files and the page of ``mbw identify``."""

from identification.level_check import LevelCheck
from mbw.page.html import read_asset
from mbw.results.identified_schema import LevelCheckRow, LevelTrendRow


def level_row(check: LevelCheck | None) -> LevelCheckRow | None:
    """Return the row of modes.json; None for a campaign of one level."""
    if check is None:
        return None
    modes = [
        LevelTrendRow(
            frequency=trend.freq_hz.tolist(),
            frequency_sd=trend.freq_sd.tolist(),
            damping=trend.damping.tolist(),
            damping_sd=trend.damping_sd.tolist(),
            frequency_changes=frequency_changes,
            damping_changes=damping_changes,
        )
        for trend, (frequency_changes, damping_changes) in zip(
            check.trends, check.changed, strict=True
        )
    ]
    return LevelCheckRow(
        level=check.level_n.tolist(),
        unit=check.unit,
        effects=[] if check.is_constant else None,
        words=check.sentence,
        returns=check.returns,
        within_tests=check.is_within_tests,
        modes=modes,
    )


def level_section(row: LevelCheckRow | None) -> str:
    """Return the HTML of the section; empty for a campaign of one level."""
    return "" if row is None else read_asset("identify/levels.html")


def level_data(row: LevelCheckRow | None) -> dict[str, object] | None:
    """Return the data of the page's script."""
    return None if row is None else row.model_dump()
