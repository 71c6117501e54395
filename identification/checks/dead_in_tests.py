"""Channels that die in some tests of a campaign: they are left out there.

A channel that reads noise alone in one good test, but not in all, has lost its cable there, or it
does not move under that hit. Its body tells both apart: where the other channels of the body
determine its motion, and this stands far above its noise, the channel is dead. Where they do not
determine it, a sensor is dead that reads noise alone in all its channels while another sensor of
its body reads motion: one point of a body that moves does not stand still at all frequencies. Else
only the fact is said.
"""

from dataclasses import replace

import numpy as np

from identification.checks.channels import noise_only_rows
from identification.solid.sensor_errors import Sensors
from identification.words import Campaign, Dof, Layout, Output, Real, Test, shorten_names

_MIN_MOTION_TO_VARIANCE = (
    25.0  # predicted |H|^2 over the variance of the channel and the prediction
)
# Of the largest motion of a sensor: what its channels read of other axes, askew by a degree and
# with the usual transverse sensitivity. Cross-talk that a whole body reads is no motion of it.
_INSTRUMENT_ERROR = 0.03
# Factor on the measure of noise alone up to which a channel may be dead: its body must confirm it.
_WEAK_MARGIN = 2.0
_MIN_MOVING_LINES = 8  # lines of such a motion: by chance noise reaches it on none
_MAX_RELATIVE_RESIDUAL = 1e-6  # of a channel's row beside those of the others: it is determined


def leave_out_dead_channels(campaign: Campaign) -> tuple[Campaign, tuple[str, ...]]:
    """Return the campaign without channels that are dead in single tests, and what was left out.

    Args:
        campaign: tests of one machine.
    """
    weak_rows = [noise_only_rows(test.estimate, _WEAK_MARGIN) for test in campaign.tests]
    alive = {
        output.positive
        for test, weak in zip(campaign.tests, weak_rows, strict=True)
        for row, output in enumerate(test.estimate.frf.outputs)
        if row not in weak
    }
    tests: list[Test] = []
    dead: dict[tuple[Output, ...], list[str]] = {}
    silent: dict[tuple[Output, ...], list[str]] = {}
    for test, weak in zip(campaign.tests, weak_rows, strict=True):
        outputs = test.estimate.frf.outputs
        noise_only = noise_only_rows(test.estimate)
        # What is weak in every test rightly stands still, and says so of its body.
        suspects = [row for row in weak if outputs[row].positive in alive]
        moving = {row: _moves_by_its_body(campaign, test, row, suspects) for row in suspects}
        unknown = [row for row, misses in moving.items() if misses is None]
        left_out = [row for row, misses in moving.items() if misses]
        whole = [
            row
            for row in unknown
            if _whole_sensor_is_in(outputs, row, noise_only)
            and _body_reads_motion(campaign.layout, outputs, row, weak)
        ]
        if len({outputs[row].point for row in whole}) == 1:
            left_out += whole
        undecided = [row for row in unknown if row in noise_only and row not in left_out]
        if len({outputs[row].point for row in undecided}) > 1:
            undecided = []  # several sensors that are silent together stand still
        for group, chosen in ((dead, sorted(left_out)), (silent, undecided)):
            if chosen:
                channels = tuple(outputs[row].positive for row in chosen)
                group.setdefault(channels, []).append(str(test.condition.reference))
        kept = [row for row in range(len(outputs)) if row not in left_out]
        estimate = test.estimate.select_outputs(kept) if kept else test.estimate
        tests.append(replace(test, estimate=estimate))
    remarks = [
        f"{shorten_names(channels)} read noise alone if hit at {', '.join(hits)}, although the "
        "sensor moves in other tests and should move there: a cable was off; left out there"
        for channels, hits in dead.items()
    ]
    remarks += [
        f"{shorten_names(channels)} read noise alone if hit at {', '.join(hits)}: a cable was off, "
        "or nothing moves there under these hits"
        for channels, hits in silent.items()
    ]
    return replace(campaign, tests=tuple(tests)), tuple(remarks)


def _whole_sensor_is_in(outputs: tuple[Output, ...], row: int, silent: list[int]) -> bool:
    """Return whether a sensor of several channels is silent as a whole."""
    sensor = [k for k, dof in enumerate(outputs) if dof.point == outputs[row].point]
    return len(sensor) > 1 and set(sensor) <= set(silent)


def _body_reads_motion(
    layout: Layout, outputs: tuple[Output, ...], row: int, weak: list[int]
) -> bool:
    """Return whether another sensor of the channel's body reads more than noise."""
    dof = outputs[row]
    if not isinstance(dof, Dof):
        return False
    return any(
        k not in weak
        and isinstance(reading, Dof)
        and reading.point != dof.point
        and layout.body_name(reading.point) == layout.body_name(dof.point)
        for k, reading in enumerate(outputs)
    )


def _moves_by_its_body(campaign: Campaign, test: Test, row: int, silent: list[int]) -> bool | None:
    """Return whether a channel misses the motion of its body; None if that is not known."""
    estimate, layout = test.estimate, campaign.layout
    outputs = estimate.frf.outputs
    if not isinstance(outputs[row], Dof):
        return None
    body = layout.body_name(outputs[row].point)
    dead = set(silent)
    companions = [
        k
        for k, dof in enumerate(outputs)
        if k not in dead
        and isinstance(dof, Dof)
        and estimate.measured[k, 0]
        and layout.body_name(dof.point) == body
    ]
    if not companions:
        return None
    channels = tuple(outputs[k].positive for k in (*companions, row))
    sensors = Sensors.of(layout, tuple(d for d in channels if isinstance(d, Dof)))
    rows = sensors.rows(np.zeros(sensors.count))
    arm = np.abs(rows[:, 3:]).max(initial=0.0) or 1.0
    rows = rows / np.repeat([1.0, arm], 3)
    weights = rows[-1] @ np.linalg.pinv(rows[:-1])  # of each other channel in the prediction
    residual = rows[-1] - weights @ rows[:-1]
    if np.linalg.norm(residual) > _MAX_RELATIVE_RESIDUAL * np.linalg.norm(rows[-1]):
        return None
    return _is_missing(test, companions, row, weights)


def _is_missing(test: Test, companions: list[int], row: int, weights: Real) -> bool:
    """Return whether a motion that stands above all noise is missing in a channel's readings.

    On the lines where the predicted motion stands out, the readings of a dead channel are noise;
    those of another one are the motion. The smaller sum of squares decides.
    """
    estimate = test.estimate
    outputs, values = estimate.frf.outputs, estimate.frf.values[:, :, 0]
    signs = np.array([outputs[k].sign for k in companions])
    predicted = outputs[row].sign * (values[:, companions] @ (signs * weights))
    points = np.array([getattr(dof, "point", "") for dof in outputs])
    largest = [np.abs(values[:, points == points[k]]).max(axis=1) for k in companions]
    noise = estimate.variance[:, companions, 0] @ weights**2 + estimate.variance[:, row, 0]
    noise = noise + (_INSTRUMENT_ERROR * np.array(largest).T) ** 2 @ weights**2
    lines = np.abs(predicted) ** 2 > _MIN_MOTION_TO_VARIANCE * noise
    read, moved = values[lines, row], predicted[lines]
    as_dead = float((np.abs(read) ** 2 / noise[lines]).sum())
    as_alive = float((np.abs(read - moved) ** 2 / noise[lines]).sum())
    return int(lines.sum()) >= _MIN_MOVING_LINES and as_dead < as_alive
