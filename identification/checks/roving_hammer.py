"""A roving hammer's test, seen as if its fixed sensors were the hammer."""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import Campaign, Complex, Dof, Frf, FrfEstimate, Real, Test


def is_roved(campaign: Campaign) -> bool:
    """Whether the hammer moved and the sensors stayed: more points hit than channels measured."""
    return len(campaign.inputs) > len(campaign.outputs)


def shape_points(campaign: Campaign) -> tuple[Dof, ...]:
    """Where shapes are known: channels, or of a roving hammer the points that were hit."""
    return campaign.inputs if is_roved(campaign) else campaign.outputs


def exchanged(campaign: Campaign) -> Campaign:
    """The campaign with hits as channels and channels as hits, by reciprocity H_ij = H_ji.

    So the motion of all points that were hit, to a force at each sensor, is there to be looked at,
    as whether bodies are solid. A point that was hit in several tests counts by the first.
    """
    cells: dict[Dof, list[_Cell]] = {}
    for test in campaign.tests:
        for row, dof in enumerate(test.estimate.frf.outputs):
            if test.estimate.measured[row, 0]:
                cells.setdefault(dof.positive, []).append(_Cell.of(test, row))
    tests = tuple(_test(sensor, own) for sensor, own in cells.items())
    return replace(campaign, tests=tests)


@dataclass(frozen=True, eq=False)
class _Cell:
    """One FRF of a test: the sensor along its positive axis."""

    test: Test
    values: Complex
    variance: Real
    coherence: Real | None

    @classmethod
    def of(cls, test: Test, row: int) -> "_Cell":
        estimate = test.estimate
        coherence = None if estimate.coherence is None else estimate.coherence[:, row, 0]
        sign = estimate.frf.outputs[row].sign
        values = sign * estimate.frf.values[:, row, 0]
        return cls(test, values, estimate.variance[:, row, 0], coherence)


def _test(sensor: Dof, cells: list[_Cell]) -> Test:
    own = {cell.test.condition.reference.positive: cell for cell in reversed(cells)}
    kept = [cell for cell in cells if own[cell.test.condition.reference.positive] is cell]
    first = kept[0].test.estimate
    hits = tuple(cell.test.condition.reference for cell in kept)
    known = [cell.coherence for cell in kept if cell.coherence is not None]
    whole = len(known) == len(kept)
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
        coherence=np.stack(known, axis=1)[:, :, None] if whole else None,
        averages=first.averages,
        window_tau=first.window_tau,
    )
    return Test(replace(kept[0].test.condition, reference=sensor), estimate)
