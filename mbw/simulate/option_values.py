"""Values of the options of a virtual hammer test."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class TestOptions:
    """Values of the options of a virtual hammer test; None and empty for the defaults.

    Args:
        hammer: hammer points or directions.
        like: campaign whose test is imitated.
        levels: mean peak forces [N].
        hits: hits along each direction.
        setups: number of roving set-ups; None for 1.
        rate_hz: samples per second.
        block_s: length of a record [s].
        pulse_s: duration of the pulse [s].
        double_share: share of the hits that bounce.
        exact: whether nothing is noisy or off.
        outputs: channels.
        noise: density of the noise of accelerometers [m/s^2/sqrt(Hz)].
        force_noise: density of the noise of the force channel [N/sqrt(Hz)].
        peak_scatter: largest relative deviation of the peak force.
        pulse_scatter: largest relative deviation of the pulse's duration.
        aim_scatter: standard deviation of the aim about each axis [rad].
        place_scatter: standard deviation of the place along each axis [m].
    """

    __test__ = False

    hammer: Sequence[str]
    like: Path | None
    levels: Sequence[float]
    hits: int | None
    setups: int | None
    rate_hz: float | None
    block_s: float | None
    pulse_s: float | None
    double_share: float
    exact: bool
    outputs: Sequence[str]
    noise: float | None
    force_noise: float | None
    peak_scatter: float | None
    pulse_scatter: float | None
    aim_scatter: float | None
    place_scatter: float | None
