"""What ``mbw identify`` found, gathered once for its files, its table and its page."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from identification import BodyCheck
from identification.checks.roving_hammer import is_roved
from identification.modal import (
    ClassicalMode,
    Identified,
    Measured,
    SynthesisError,
    Tolerances,
    classical_checks,
    mpc,
    mpd,
)
from identification.words import Campaign, Layout, ModalModel, Real
from mbw.identify.arrays import arrays_of
from mbw.identify.hits import hits_rows
from mbw.identify.reference_shapes import Other
from mbw.identify.result_parts import QUIET, Parts, parts_of
from mbw.identify.schema import ByHand, ModeRow, ModesFile
from mbw.identify.solid import solid_row


@dataclass(frozen=True, eq=False)
class Result:
    """A modal model and all that is shown beside it.

    Args:
        summary: names and modes.
        arrays: numbers by name, as in modes.npz.
        layout: bodies and points.
    """

    summary: ModesFile
    arrays: dict[str, Any]
    layout: Layout


class SetupCheck(Protocol):
    """What a comparison of two set-ups says."""

    @property
    def agrees(self) -> bool | None:
        """Whether they differ by noise alone; None where nothing tells."""

    @property
    def sentence(self) -> str:
        """The comparison in one sentence."""


@dataclass(frozen=True, eq=False)
class Checks:
    """Of the measurement itself.

    Args:
        solid: of the bodies.
        setups: of tests with one reference, side by side.
    """

    solid: Sequence[BodyCheck] = ()
    setups: Sequence[SetupCheck] = ()


def gather(
    campaign: Campaign,
    identified: tuple[ModalModel, Identified, Measured],
    tolerances: Tolerances,
    *,
    other: Other,
    source: str,
    checks: Checks | None = None,
) -> Result:
    """Put together what ``identify`` found.

    Args:
        campaign: what it was found from.
        identified: by ``identification.modal.identify``.
        tolerances: of the stabilisation.
        other: shapes of a model to compare with.
        source: path of the MJCF.
        checks: of the bodies and of the set-ups, if they were made.
    """
    parts = parts_of(campaign, identified, other)
    arrays = arrays_of(parts, tolerances)
    summary = _summary(parts, source, checks or Checks())
    return Result(summary, arrays, campaign.layout)


def _summary(parts: Parts, source: str, checks: Checks) -> ModesFile:
    measured, found = parts.measured, parts.found
    hands = classical_checks(parts.measured, parts.model)[: parts.inside]
    modes = [_row(parts, mode, hand) for mode, hand in enumerate(hands)]
    return ModesFile(
        campaign=parts.campaign.name,
        model=source,
        band=(float(measured.freq_hz[0]), float(measured.freq_hz[-1])),
        lines=len(measured.freq_hz),
        quantity=parts.quantity,
        outputs=[str(dof) for dof in measured.outputs],
        inputs=[str(dof) for dof in measured.inputs],
        roved=is_roved(parts.campaign),
        body_directions=[str(dof) for dof in parts.bodies.dofs],
        undetermined_bodies=list(parts.bodies.undetermined),
        normalisation=parts.whole.normalisation,
        misfit=found.misfit,
        error=_rms(parts.error, parts.error.error),
        noise=_rms(parts.error, parts.error.noise),
        reciprocal_error=None if parts.alone is None else _rms(parts.alone, parts.alone.error),
        beside_band=len(parts.model.poles) - parts.inside,
        compared_with=parts.compared.other.name,
        modes=modes,
        solid=[solid_row(check) for check in checks.solid],
        hits=hits_rows(parts.campaign, modes),
        setups=[check.sentence for check in checks.setups],
        remarks=[
            *parts.campaign.remarks,
            *(check.sentence for check in checks.setups if check.agrees is False),
        ],
    )


def _rms(of: SynthesisError, values: Real) -> float | None:
    """Over the channels that are not mostly noise; None without any."""
    quiet = of.known & (of.noise <= QUIET)
    return float(np.sqrt((values[quiet] ** 2).mean())) if quiet.any() else None


def _by_hand(hand: ClassicalMode) -> ByHand:
    return ByHand(
        half_power_damping=hand.half_power_damping,
        half_power_channels=hand.half_power_channels,
        circle_frequency=hand.circle_freq_hz,
        circle_damping=hand.circle_damping,
        circle_channels=hand.circle_channels,
        amplitude_difference=hand.amplitude_difference,
        reason=hand.reason,
    )


def _row(parts: Parts, mode: int, hand: ClassicalMode) -> ModeRow:
    model, whole, shape = parts.model, parts.whole, parts.model.shapes[:, mode]
    body = parts.bodies.values[:, mode]
    pair = dict(parts.compared.pairs).get(mode)
    scale = whole.modal_a[mode] if whole.has_scale else None
    return ModeRow(
        frequency=float(model.freq_hz[mode]),
        frequency_sd=float(model.freq_sd[mode]),
        damping=float(model.damping[mode]),
        damping_sd=float(model.damping_sd[mode]),
        real=float(model.poles[mode].real),
        imaginary=float(model.poles[mode].imag),
        modal_a_real=None if scale is None else float(scale.real),
        modal_a_imaginary=None if scale is None else float(scale.imag),
        phase_collinearity=float(mpc(shape[:, None])[0]),
        phase_deviation=float(mpd(shape[:, None])[0]),
        reciprocity=float(whole.reciprocity[mode]) if len(whole.reciprocity) else None,
        orders=_orders(model.poles[mode], parts.found),
        other=None if pair is None else float(parts.compared.other.freq_hz[pair]),
        other_mac=None if pair is None else float(parts.compared.mac[mode, pair]),
        shape_real=shape.real.tolist(),
        shape_imaginary=shape.imag.tolist(),
        real_shape=parts.real[:, mode].tolist(),
        body_shape_real=body.real.tolist(),
        body_shape_imaginary=body.imag.tolist(),
        by_hand=_by_hand(hand),
    )


def _orders(pole: complex, found: Identified) -> int | None:
    """Model orders in which a mode came back before it was refined; None for one found later."""
    near = [
        cluster.count for cluster in found.clusters if abs(cluster.pole - pole) < 0.02 * abs(pole)
    ]
    return max(near) if near else None
