"""``modes.json``: the measured modes for other programs."""

from typing import Annotated

from pydantic import BaseModel, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]


class ByHand(BaseModel):
    """What the classical methods say of a mode; null where they say nothing.

    Args:
        half_power_damping: ratio from the 3 dB widths, median over ``half_power_channels``.
        circle_frequency, circle_damping: of circles fitted to ``circle_channels`` FRFs [Hz, 1].
        amplitude_difference: of C by least squares and from the value at resonance, relative.
        reason: why something is missing.
    """

    half_power_damping: Finite | None
    half_power_channels: int
    circle_frequency: Finite | None
    circle_damping: Finite | None
    circle_channels: int
    amplitude_difference: Finite | None
    reason: str


class ModeRow(BaseModel):
    """One identified mode; standard deviations in the same units.

    Args:
        frequency, frequency_sd: natural frequency [Hz].
        damping, damping_sd: ratio.
        real, imaginary: of the pole s_r [rad/s].
        modal_a_real, modal_a_imaginary: of a_r of receptance [kg/s]; null without a drive point.
        phase_collinearity: 1 where the shape is real but for one phase.
        phase_deviation: mean, from that phase [rad].
        reciprocity: MAC of shape and participation at the drive points; null for fewer than two.
        orders: model orders in which it came back; null for a mode found later.
        other, other_mac: frequency [Hz] of the mode of the compared model that pairs, and MAC.
        shape_real, shape_imaginary: at ``outputs``.
        real_shape: its real part at the phase where that is largest.
        body_shape_real, body_shape_imaginary: at ``body_directions``.
        by_hand: what the classical methods say of it.
    """

    frequency: Finite
    frequency_sd: Finite
    damping: Finite
    damping_sd: Finite
    real: Finite
    imaginary: Finite
    modal_a_real: Finite | None
    modal_a_imaginary: Finite | None
    phase_collinearity: Finite
    phase_deviation: Finite
    reciprocity: Finite | None
    orders: int | None
    other: Finite | None
    other_mac: Finite | None
    shape_real: list[Finite]
    shape_imaginary: list[Finite]
    real_shape: list[Finite]
    body_shape_real: list[Finite]
    body_shape_imaginary: list[Finite]
    by_hand: ByHand


class FaultRow(BaseModel):
    """What is wrong with a sensor, with two of them, or with a body as a solid.

    Args:
        effect: such as ``sensor_gain`` or ``flexible_body``.
        location: ``sensor:acc12``, ``sensor:acc1+acc2`` or ``body:ty``.
        dof: such as ``tz`` or ``tx+ty``; null for all.
        probability: that it is present, given what was named before it.
        parameters: gain; rotation [rad] and offset [m] along world axes; delay [s]; frequency [Hz],
            damping.
        excess_after: what remains with it, over the noise.
    """

    effect: str
    location: str
    dof: str | None
    probability: Finite
    parameters: dict[str, Finite | list[Finite]]
    excess_after: Finite


class SolidRow(BaseModel):
    """Whether a body moves as a solid, by the channels that it has to spare.

    Args:
        body: its name.
        channels: measured on it.
        spare: channels beyond the motions that they determine.
        solid_to: highest frequency up to which it moves as a solid [Hz]; null if none is known.
        words: the verdict.
        frequency: [Hz].
        deviation: share of the motion that is not that of a solid, at each frequency.
        faults: in the order in which they were found.
        more: whether something significant remains beside them.
        twins: pairs of faults that these channels cannot tell apart.
        unseen: faults that could be large and leave no mark in these channels.
    """

    body: str
    channels: int
    spare: int
    solid_to: Finite | None
    words: str
    frequency: list[Finite]
    deviation: list[Finite]
    faults: list[FaultRow] = []
    more: bool = False
    twins: list[tuple[str, str]] = []
    unseen: list[str] = []


class KeptHit(BaseModel):
    """A hit that was averaged.

    Args:
        record: in which it is, from 1.
        hit: its number, from 1.
        time: of its first rise, from the start of its record [s].
        peak: largest force, signed [N].
    """

    record: int
    hit: int
    time: Finite
    peak: Finite


class RejectedHit(BaseModel):
    """A hit that was left out.

    Args:
        record: in which it is, from 1.
        hit: its number, from 1.
        time: of its first rise, from the start of its record [s].
        reason: in words.
    """

    record: int
    hit: int
    time: Finite
    reason: str


class HitsRow(BaseModel):
    """How the FRFs of one reference were made from time records.

    Args:
        test: the file.
        setup: of a roved test, or null.
        reference: where and along what the hammer hit.
        outputs: channels of motion, as they were read.
        kept, rejected: hits.
        rate: samples per second [Hz].
        block, pretrigger: length of each hit's block and its part before the hit [s].
        force_window: longest part of a block in which the force was kept [s].
        exponential_tau: time constant of the exponential window [s]; 0 for none.
        added_damping: what that window adds to the damping ratio of each of ``modes``, taken off
            again; zeros without one.
        left: share of the response that is left where the blocks end.
        estimator: H1, H2 or Hv.
    """

    test: str
    setup: str | None
    reference: str
    outputs: list[str]
    kept: list[KeptHit]
    rejected: list[RejectedHit]
    rate: Finite
    block: Finite
    pretrigger: Finite
    force_window: Finite
    exponential_tau: Finite
    added_damping: list[Finite]
    left: Finite
    estimator: str


class ModesFile(BaseModel):
    """``modes.json``.

    Args:
        campaign, model: names; the model's is the path of its MJCF.
        band: [Hz].
        lines: of the band.
        quantity: of the FRFs.
        outputs, inputs: labels.
        roved: whether the hammer did: by reciprocity, outputs are then the points that were hit and
            inputs the sensors.
        body_directions: determined directions at centres of mass, world axes.
        undetermined_bodies: bodies without all six.
        normalisation: of the shapes: ``unit modal mass`` (kg^-1/2, a_r = 2 i Im s_r kg) or
            ``largest entry 1``.
        misfit: squared error over the variance of the noise, per free value.
        error, noise: of the synthesis and of a perfect one, relative, rms over the channels whose
            noise is at most 0.3 of their FRF; null without any.
        reciprocal_error: of the synthesis by shapes and a_r alone; null without a_r.
        beside_band: poles that stand for modes outside the band.
        compared_with: the model or file of ``other``.
        modes: inside the band.
        solid: checks of the bodies, where they were made.
        hits: of each reference, where FRFs were made from time records.
        setups: what tests with the hammer at one place say of one another.
        remarks: what is wrong with channels, hits or set-ups.
    """

    campaign: str
    model: str
    band: tuple[Finite, Finite]
    lines: int
    quantity: str
    outputs: list[str]
    inputs: list[str]
    roved: bool
    body_directions: list[str]
    undetermined_bodies: list[str]
    normalisation: str
    misfit: Finite
    error: Finite | None
    noise: Finite | None
    reciprocal_error: Finite | None
    beside_band: int
    compared_with: str
    modes: list[ModeRow]
    solid: list[SolidRow] = []
    hits: list[HitsRow] = []
    setups: list[str] = []
    remarks: list[str] = []
