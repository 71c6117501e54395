"""Roving-hammer campaigns, and their conversion by reciprocity to roving sensors."""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import (
    Campaign,
    Complex,
    Dof,
    Frf,
    FrfEstimate,
    Output,
    Real,
    Signal,
    Test,
    group_by_key,
)


def is_roving_hammer(campaign: Campaign) -> bool:
    """Return whether the hammer roved: there are more references than channels.

    Motors are not counted: a control signal has no reciprocal channel.
    """
    return len(_hit_points(campaign)) > len(campaign.outputs)


def shape_points(campaign: Campaign) -> tuple[Output, ...]:
    """Return the degrees of freedom of shapes: channels, or references of a roving hammer."""
    return _hit_points(campaign) if is_roving_hammer(campaign) else campaign.outputs


def _hit_points(campaign: Campaign) -> tuple[Dof, ...]:
    """Return the references that are forces or torques at points."""
    return tuple(reference for reference in campaign.inputs if isinstance(reference, Dof))


def exchange_hits_and_channels(campaign: Campaign) -> Campaign:
    """Exchange references and channels of a campaign by reciprocity, H_ij = H_ji.

    The result holds the motion of all points that were hit, per force at each sensor. Checks such
    as that of solid bodies need many channels for each reference. If a point was hit in several
    tests, the first one counts. Tests with a motor as reference are left out.
    """
    cells = group_by_key(
        (dof.positive, _Cell.of(test, row, test.condition.reference))
        for test in campaign.tests
        if not isinstance(test.condition.reference, Signal)
        for row, dof in enumerate(test.estimate.frf.outputs)
        if test.estimate.measured[row, 0]
    )
    tests = tuple(_test(sensor, sensor_cells) for sensor, sensor_cells in cells.items())
    return replace(campaign, tests=tests)


@dataclass(frozen=True, eq=False)
class _Cell:
    """One FRF of a test, with the sensor along its positive axis."""

    test: Test
    hit: Dof
    values: Complex
    variance: Real
    coherence: Real | None

    @classmethod
    def of(cls, test: Test, row: int, hit: Dof) -> "_Cell":
        """Take the FRF of one channel from a test."""
        estimate = test.estimate
        coherence = None if estimate.coherence is None else estimate.coherence[:, row, 0]
        sign = estimate.frf.outputs[row].sign
        values = sign * estimate.frf.values[:, row, 0]
        return cls(test, hit, values, estimate.variance[:, row, 0], coherence)


def _test(sensor: Output, cells: list[_Cell]) -> Test:
    """Build the test with the sensor as reference and the points that were hit as channels."""
    by_point = {cell.hit.positive: cell for cell in reversed(cells)}
    kept = [cell for cell in cells if by_point[cell.hit.positive] is cell]
    first = kept[0].test.estimate
    hits = tuple(cell.hit for cell in kept)
    known = [cell.coherence for cell in kept if cell.coherence is not None]
    has_coherence = len(known) == len(kept)
    estimate = FrfEstimate(
        frf=Frf(
            first.frf.freq_hz,
            np.stack([cell.values for cell in kept], axis=1)[:, :, None],
            hits,
            (sensor,),
            first.frf.quantity,
        ),
        variance=np.stack([cell.variance for cell in kept], axis=1)[:, :, None],
        variance_source=first.variance_source,
        measured=np.ones((len(kept), 1), bool),
        coherence=np.stack(known, axis=1)[:, :, None] if has_coherence else None,
        averages=first.averages,
        window_tau=first.window_tau,
    )
    return Test(replace(kept[0].test.condition, reference=sensor), estimate)
