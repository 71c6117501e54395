"""Rows of an error budget in the JSON file of ``mbw predict``."""

from identification.readers.result_files import ResultRow
from mbw.plant.margin_schema import LoopLimitRow, MarginsRow
from tuning.plant.error_budget.plant_budget import Touch


class ShareOfErrorRow(ResultRow):
    """Share of a source, joint or pair of sources in the mean square of an error."""

    name: str
    share: float


class ShareOfPoleRow(ResultRow):
    """Share of a mode: its natural frequency [Hz], damping ratio and share.

    A real pole has the frequency ``|s| / (2 pi)`` and the damping ratio 1.
    """

    frequency: float
    damping: float
    share: float


class ErrorRow(ResultRow):
    """Budget of one error.

    Args:
        signal: outputs with their signs.
        unit: in which page and terminal show it.
        rms: root mean square [m or rad].
        low, high: ends of its 95 % interval; null without a posterior.
        deviation: standard deviation of its logarithm; null without a posterior.
        before: rms of the other machine; null without one.
        sources: shares, without cross terms.
        cross_terms: shares of pairs of correlated sources.
        modes: shares of modes and controllers, the largest first.
        modes_rest: share of no mode: of the floor's motion itself, and of approximated laws.
        joints: shares of joint coordinates and of the floor, the largest first.
        touches: springs and dampers, the strongest first.
        freq_hz, cumulative: rms [m or rad] of all that lies above each frequency.
    """

    name: str
    signal: str
    unit: str
    rms: float
    low: float | None
    high: float | None
    deviation: float | None
    before: float | None
    sources: list[ShareOfErrorRow]
    cross_terms: list[ShareOfErrorRow]
    modes: list[ShareOfPoleRow]
    modes_rest: float
    joints: list[ShareOfErrorRow]
    touches: list[Touch]
    freq_hz: list[float]
    cumulative: list[float]


class PoleRow(ResultRow):
    """Pole s [rad/s] with its natural frequency ``|s| / (2 pi)`` [Hz] and damping ratio.

    A real pole has the damping ratio 1, or -1 if it grows; one at zero has none, null.
    """

    frequency: float
    damping: float | None
    real: float
    imaginary: float


class FeedbackRow(ResultRow):
    """Integral force feedback of a set of struts at its best gain.

    Args:
        struts: names.
        gain: g of -g / (s + w_l) [rad/s].
        damping: damping ratio of the target mode.
        frequency: its natural frequency [Hz].
        static_stiffness: share of the struts' static stiffness that is left.
    """

    struts: list[str]
    gain: float
    damping: float
    frequency: float
    static_stiffness: float


class FramesRow(ResultRow):
    """Frames of the platform on six struts.

    Args:
        body: the platform.
        centre_of_mass, centre_of_stiffness: [m].
        jacobian_mass, jacobian_stiffness: elongations per motion at these points, 6 x 6.
        coupling_low, coupling_high: largest coupling in each frame at both ends of the band.
    """

    body: str
    centre_of_mass: list[float]
    centre_of_stiffness: list[float]
    jacobian_mass: list[list[float]]
    jacobian_stiffness: list[list[float]]
    coupling_low: dict[str, float]
    coupling_high: dict[str, float]


class StrutsRow(ResultRow):
    """Damping and decoupling by struts.

    Args:
        target_hz, target_damping: target mode without feedback.
        share: share of the struts in its strain energy.
        leak_hz: corner of the leak [Hz].
        sets: of struts, the best first.
        interval: 95 % interval of the damping ratio of the best set; null without a posterior.
        frames: of a platform on six struts; null without one.
        no_frames: why there are none; empty with frames.
    """

    target_hz: float
    target_damping: float
    share: float
    leak_hz: float
    sets: list[FeedbackRow]
    interval: tuple[float, float] | None
    frames: FramesRow | None
    no_frames: str


class BudgetRow(ResultRow):
    """Error budget.

    Args:
        file: budget.toml.
        before: MJCF of the other machine; null without one.
        band: lowest and highest frequency [Hz].
        loops: names of the loops that are closed.
        lines: number of frequency lines of the integral.
        remarks: sentences.
        errors: budget of each error.
        poles: of the machine with its loops, up to twice the band.
        margins: stability margins of the loops; null without loops.
        limits: what limits the gain of each loop.
    """

    file: str
    before: str | None
    band: tuple[float, float]
    loops: list[str]
    lines: int
    remarks: list[str]
    errors: list[ErrorRow]
    poles: list[PoleRow]
    margins: MarginsRow | None
    limits: list[LoopLimitRow]
