"""Effects that the data checks prove by redundant channels alone, without a refit."""

from diagnosis.hypothesis import Effect
from identification import FAULT_PHRASES


def _propose_none(_: object) -> tuple[()]:
    """Return none: the data checks propose."""
    return ()


PROVEN = {
    "dead_channel": Effect(
        _propose_none,
        noun=FAULT_PHRASES["dead_channel"],
        means="{channel} holds no motion",
        confirm="look at cable and plug of {channel}, and repeat one hit",
    ),
    "sensor_body": Effect(
        _propose_none,
        noun=FAULT_PHRASES["sensor_body"],
        means="{place} moves with another body than drawn",
        confirm="look on which body {place} sits",
    ),
}
