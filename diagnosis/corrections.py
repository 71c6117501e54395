"""Corrections of a campaign for faults of sensors: channels are masked, exchanged or divided."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from identification import Fault, delay_response, mount_response
from identification.words import Campaign, Complex, Dof, FrfEstimate, Mask, Port, Real

Reading = Callable[[Real], Complex]


def match_channels(location: str, dof: str | None) -> Callable[[Port], bool]:
    """Return a function that says whether a fault concerns a channel.

    Args:
        location: ``sensor:<site>``, ``sensor:<site>+<site>`` or ``hammer:<site>``.
        dof: such as ``tx`` or ``tx+ty``; None for all.
    """
    sites = location.partition(":")[2].split("+")
    axes = None if dof is None else dof.split("+")

    def concerns(channel: Port) -> bool:
        return channel.point in sites and (axes is None or channel.direction[1:] in axes)

    return concerns


def mask_channels(campaign: Campaign, concerns: Callable[[Port], bool]) -> Campaign:
    """Return the campaign without some channels, whose cells count as not measured."""

    def edit(estimate: FrfEstimate) -> FrfEstimate:
        kept = np.array([not concerns(dof) for dof in estimate.frf.outputs])
        return _keep_channels(estimate, kept)

    return _edit_estimates(campaign, edit)


def divide_channels(
    campaign: Campaign, concerns: Callable[[Port], bool], reading: Reading
) -> Campaign:
    """Return the campaign with some channels divided by their reading per motion."""

    def edit(estimate: FrfEstimate) -> FrfEstimate:
        rows = np.array([concerns(dof) for dof in estimate.frf.outputs])
        read = reading(estimate.frf.freq_hz)[:, None, None]
        values, variance = estimate.frf.values.copy(), estimate.variance.copy()
        values[:, rows] /= read
        variance[:, rows] /= np.abs(read) ** 2
        return replace(estimate, frf=replace(estimate.frf, values=values), variance=variance)

    return _edit_estimates(campaign, edit)


def divide_hits(campaign: Campaign, location: str, dof: str | None, reading: Reading) -> Campaign:
    """Return the campaign with the tests of one reference divided by a factor on their force.

    Args:
        location: ``hammer:<site>``, the point of the reference.
        dof: its direction; None for all.
        reading: the factor; (n_freq,) of (n_freq,).
    """
    hits = match_channels(location, dof)
    tests = [
        divide_channels(replace(campaign, tests=(test,)), lambda _: True, reading).tests[0]
        if isinstance(test.condition.reference, Dof) and hits(test.condition.reference)
        else test
        for test in campaign.tests
    ]
    return replace(campaign, tests=tuple(tests))


def exchange_channels(campaign: Campaign, pairs: tuple[tuple[Dof, Dof], ...]) -> Campaign:
    """Return the campaign with exchanged channels; a channel without its partner is masked."""
    partner: dict[Port, Port] = {a.positive: b.positive for a, b in pairs}
    partner |= {b.positive: a.positive for a, b in pairs}

    def edit(estimate: FrfEstimate) -> FrfEstimate:
        outputs = estimate.frf.outputs
        place = {dof.positive: row for row, dof in enumerate(outputs)}
        rows, signs = np.arange(len(outputs)), np.ones(len(outputs))
        kept = np.ones(len(outputs), bool)
        for row, dof in enumerate(outputs):
            counterpart = place.get(partner.get(dof.positive, dof.positive))
            kept[row] = counterpart is not None
            if counterpart is not None:
                rows[row] = counterpart
                signs[row] = dof.sign * outputs[counterpart].sign
        moved = estimate.select_outputs(rows)
        frf = replace(estimate.frf, values=moved.frf.values * signs[:, None])
        return _keep_channels(replace(moved, frf=frf), kept)

    return _edit_estimates(campaign, edit)


def read_inverted(freq_hz: Real) -> Complex:
    """Return the reading of an inverted channel per motion; (n_freq,)."""
    return np.full(len(freq_hz), -1.0 + 0.0j)


def find_correction(fault: Fault, campaign: Campaign) -> Callable[[Campaign], Campaign] | None:
    """Return what corrects the channels of a sensor, or hits; None for another kind of fault."""
    concerns = match_channels(fault.location, fault.dof)
    if fault.effect == "sensor_polarity":
        return lambda c: divide_channels(c, concerns, read_inverted)
    if fault.effect == "sensor_swap":
        pairs = _list_pairs(fault, campaign)
        return lambda c: exchange_channels(c, pairs)
    reading = _find_reading(fault)
    if reading is None:
        return None
    if fault.location.startswith("hammer:"):
        return lambda c: divide_hits(c, fault.location, fault.dof, reading)
    return lambda c: divide_channels(c, concerns, reading)


def _find_reading(fault: Fault) -> Reading | None:
    """Return the factor of a faulty channel, or of hits; None for another kind of fault."""
    if fault.effect in ("sensor_gain", "hammer_gain"):
        gain = _read_number(fault.parameters["gain"])
        return lambda freq_hz: np.full(len(freq_hz), gain, np.complex128)
    if fault.effect in ("sensor_delay", "hammer_delay"):
        return partial(delay_response, delay=_read_number(fault.parameters["delay"]))
    if fault.effect == "mount_resonance":
        frequency, damping = (_read_number(fault.parameters[k]) for k in ("frequency", "damping"))
        return lambda freq_hz: mount_response(freq_hz, frequency, damping)
    return None


def _read_number(value: float | tuple[float, ...]) -> float:
    return value if isinstance(value, float) else value[0]


def _list_pairs(fault: Fault, campaign: Campaign) -> tuple[tuple[Dof, Dof], ...]:
    """Return the pairs of exchanged channels: two of one sensor, or all of two sensors."""
    sites = fault.location.partition(":")[2].split("+")
    if len(sites) == 1:
        first, second = str(fault.dof).split("+")
        return ((Dof.parse(f"{sites[0]}:+{first}"), Dof.parse(f"{sites[0]}:+{second}")),)
    axes = [dof.direction[1:] for dof in campaign.outputs if dof.point == sites[0]]
    return tuple(
        (Dof.parse(f"{sites[0]}:+{axis}"), Dof.parse(f"{sites[1]}:+{axis}")) for axis in axes
    )


def _keep_channels(estimate: FrfEstimate, kept: Mask) -> FrfEstimate:
    frf = replace(estimate.frf, values=estimate.frf.values * kept[:, None])
    return replace(estimate, frf=frf, measured=estimate.measured & kept[:, None])


def _edit_estimates(campaign: Campaign, edit: Callable[[FrfEstimate], FrfEstimate]) -> Campaign:
    tests = tuple(replace(test, estimate=edit(test.estimate)) for test in campaign.tests)
    return replace(campaign, tests=tests)
