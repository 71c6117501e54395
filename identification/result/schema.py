"""Content of ``modes.json``: the measured modes for other programs."""

from pydantic import AliasChoices, Field

from identification.checks.reciprocity_findings import ChannelRatio
from identification.readers.result_files import ResultFile, ResultRow
from identification.solid import Fault


class SingleModeRow(ResultRow):
    """Estimates of a mode by classical single-mode methods; null where a method does not apply.

    Args:
        half_power_damping: damping ratio from the half-power (3 dB) widths, median over
            ``half_power_channels`` FRFs.
        circle_frequency, circle_damping: frequency [Hz] and damping ratio from circles fitted to
            ``circle_channels`` FRFs.
        amplitude_difference: relative difference between the amplitude C by least squares and C
            from the value at resonance.
        reason: why an estimate is missing.
    """

    half_power_damping: float | None
    half_power_channels: int
    circle_frequency: float | None = Field(
        validation_alias=AliasChoices("circle_frequency", "circle_freq_hz")
    )
    circle_damping: float | None
    circle_channels: int
    amplitude_difference: float | None
    reason: str


class IdentifiedModeRow(ResultRow):
    """One identified mode, with standard deviations.

    Args:
        frequency, frequency_sd: natural frequency and its standard deviation [Hz].
        damping, damping_sd: damping ratio and its standard deviation.
        real, imaginary: real and imaginary part of the pole ``s_r`` [rad/s].
        modal_a_real, modal_a_imaginary: parts of the scaling ``a_r`` of the receptance [kg/s];
            null without a drive point.
        phase_collinearity: modal phase collinearity (MPC); 1 for a shape of one phase.
        phase_deviation: mean phase deviation (MPD) from that phase [rad].
        reciprocity: MAC of shape and participation at the drive points; null for fewer than two.
        orders: number of model orders that held the mode; null for a mode that was added later.
        other, other_mac: frequency [Hz] of the paired reference mode, and their MAC.
        shape_real, shape_imaginary: parts of the shape at ``outputs``.
        real_shape: real part of the shape, rotated to the phase where this part is largest.
        body_shape_real, body_shape_imaginary: parts of the shape at ``body_directions``.
        by_hand: estimates by classical single-mode methods.
        scale_sd: relative standard deviation of the size of the mass-normalised shape; null without
            a drive point among the channels.
        doubtful: reasons to doubt that this is a mode of the machine; empty for most.
    """

    frequency: float
    frequency_sd: float
    damping: float
    damping_sd: float
    real: float
    imaginary: float
    modal_a_real: float | None
    modal_a_imaginary: float | None
    phase_collinearity: float
    phase_deviation: float
    reciprocity: float | None
    orders: int | None
    other: float | None
    other_mac: float | None
    shape_real: list[float]
    shape_imaginary: list[float]
    real_shape: list[float]
    body_shape_real: list[float]
    body_shape_imaginary: list[float]
    by_hand: SingleModeRow
    scale_sd: float | None = None
    doubtful: list[str] = []


class SolidRow(ResultRow):
    """Check, by redundant channels, whether a body moves as a solid.

    Args:
        body: name of the body.
        channels: number of channels measured on the body.
        spare: number of redundant channels: those beyond the motions that they determine.
        solid_to: highest frequency up to which the body moves as a solid [Hz]; null if unknown.
        words: result of the check in one sentence.
        frequency: frequency lines [Hz].
        deviation: share of the motion that is not that of a solid, at each frequency.
        faults: faults in the order of their detection.
        more: whether a significant residual remains once these faults are corrected.
        twins: pairs of confounded faults, which these channels cannot distinguish.
        unseen: unidentifiable faults: even large ones leave these channels unchanged.
    """

    body: str
    channels: int
    spare: int
    solid_to: float | None
    words: str
    frequency: list[float]
    deviation: list[float]
    faults: list[Fault] = []
    more: bool = False
    twins: list[tuple[str, str]] = []
    unseen: list[str] = []


class KeptHit(ResultRow):
    """Hit that the averages include.

    Args:
        record: number of its record, from 1.
        hit: number of the hit, from 1.
        time: time of the first rise of the force, from the start of the record [s].
        peak: largest force with its sign [N].
    """

    record: int
    hit: int
    time: float
    peak: float


class RejectedHit(ResultRow):
    """Hit that the averages leave out.

    Args:
        record: number of its record, from 1.
        hit: number of the hit, from 1.
        time: time of the first rise of the force, from the start of the record [s].
        reason: reason of the rejection in words.
    """

    record: int
    hit: int
    time: float
    reason: str


class HitsRow(ResultRow):
    """Estimation of the FRFs of one reference from time records.

    Args:
        test: file of the test.
        setup: set-up of a roved test, or null.
        reference: point and direction of the hits.
        unit: unit of the force channel.
        outputs: channels of motion, as they were read.
        kept, rejected: hits that the averages include and leave out.
        rate: sampling rate [Hz].
        block, pretrigger: length of each hit's block, and of its part before the hit [s].
        force_window: length of the longest force window [s].
        exponential_tau: time constant of the exponential windows of analyser and software together
            [s]; 0 for none.
        added_damping: damping ratio that this window adds to each of ``modes``; it is subtracted
            from the result; zeros without a window.
        left: share of the response that remains at the end of the blocks.
        estimator: H1, H2 or Hv.
    """

    test: str
    setup: str | None
    reference: str
    unit: str = "N"
    outputs: list[str]
    kept: list[KeptHit]
    rejected: list[RejectedHit]
    rate: float
    block: float
    pretrigger: float
    force_window: float
    exponential_tau: float
    added_damping: list[float]
    left: float
    estimator: str


class LevelTrendRow(ResultRow):
    """One mode at each level.

    Args:
        frequency, frequency_sd: natural frequency at each level, and standard deviations [Hz].
        damping, damping_sd: damping ratio at each level, and standard deviations.
        frequency_changes, damping_changes: whether the quantity changes beyond chance.
    """

    frequency: list[float]
    frequency_sd: list[float]
    damping: list[float]
    damping_sd: list[float]
    frequency_changes: bool
    damping_changes: bool


class LevelCheckRow(ResultRow):
    """Modes against the level of the hits.

    Args:
        level: peak forces, the lowest first, in ``unit``.
        unit: unit of the levels: N, N m, or that of the signal that drives; empty if unknown.
        effects: empty if no mode changes; null if any does, since modes alone do not tell which
            effect it is: ``mbw diagnose`` does.
        words: finding in words.
        returns: whether tests return to a level, so that drift between them is known.
        within_tests: whether the levels are those of single hits: one standard deviation of their
            peaks below and above the mean.
        modes: modes that could be followed through all levels.
    """

    level: list[float]
    unit: str = "N"
    effects: list[str] | None
    words: str
    returns: bool
    within_tests: bool = False
    modes: list[LevelTrendRow]


class IdentifiedModesFile(ResultFile):
    """Content of ``modes.json``.

    Args:
        campaign, model: name of the campaign and path of the MJCF.
        keyframe: of the MJCF that gives the pose, empty for the drawing; null without a model.
        band: lowest and highest frequency [Hz].
        lines: number of frequency lines in the band.
        quantity: quantity of the FRFs, such as ``accelerance``.
        outputs, inputs: labels of the channels.
        input_units: unit of what drives at each input, such as N or V; empty where it is unknown.
        roved: whether the hammer roved; by reciprocity, outputs are then the points that were hit
            and inputs the sensors.
        body_directions: determined directions at centres of mass, in world axes.
        undetermined_bodies: bodies of which the sensors do not determine all six directions.
        body_frfs: file of the FRFs at the centres of mass; null if no motion is determined.
        normalisation: scale of the shapes: ``unit modal mass`` (kg^-1/2, ``a_r`` = 2 i Im ``s_r``
            kg) or ``largest entry 1``.
        misfit: squared error over the variance of the noise, per degree of freedom of the fit.
        error, noise: relative error of the synthesised FRFs and the part of the noise alone, root
            mean square over the channels whose noise is at most 0.3 of their FRF; null without any.
        reciprocal_error: error of FRFs synthesised from shapes and ``a_r`` alone; null without
            ``a_r``.
        beside_band: number of poles that represent modes outside the band.
        compared_with: model or file of the reference modes.
        modes: modes inside the band.
        solid: rigid-body checks.
        hits: hits of each reference whose FRFs come from time records.
        setups: comparisons of tests with one reference.
        levels: modes against the level of the hits; null for FRF files of one level.
        reciprocity: what H_ij = H_ji says of channels and hits; empty if it says nothing.
        remarks: findings on channels, hits and set-ups.
    """

    campaign: str
    model: str
    keyframe: str | None = None
    band: tuple[float, float]
    lines: int
    quantity: str
    outputs: list[str]
    inputs: list[str]
    input_units: list[str] = []
    roved: bool
    body_directions: list[str]
    undetermined_bodies: list[str]
    body_frfs: str | None = None
    normalisation: str
    misfit: float
    error: float | None
    noise: float | None
    reciprocal_error: float | None
    beside_band: int
    compared_with: str
    modes: list[IdentifiedModeRow]
    solid: list[SolidRow] = []
    hits: list[HitsRow] = []
    setups: list[str] = []
    levels: LevelCheckRow | None = None
    reciprocity: list[ChannelRatio] = []
    remarks: list[str] = []
