"""Checks of solid bodies in the files and on the page of ``mbw identify``."""

import numpy as np

from identification import BodyCheck, Fault
from identification.words import Real
from mbw.identify.schema import FaultRow, SolidRow
from mbw.page.html import packed

_EFFECTS = {
    "sensor_gain": "gain",
    "sensor_polarity": "turned sign",
    "sensor_misalignment": "axes",
    "sensor_position": "place",
    "sensor_swap": "exchanged channels",
    "sensor_delay": "delay",
    "mount_resonance": "resonance of its mount",
    "dead_channel": "no signal",
    "sensor_unknown": "no known kind",
    "flexible_body": "flexible",
}
_UNITS = {  # what a number of the files is multiplied by to be read
    "gain": (1.0, ""),
    "rotation": (180 / np.pi, "°"),
    "offset": (1e3, " mm"),
    "delay": (1e3, " ms"),
    "frequency": (1.0, " Hz"),
    "damping": (100.0, " %"),
}


def solid_row(check: BodyCheck) -> SolidRow:
    """A body's row of ``modes.json``."""
    kept = np.isfinite(check.deviation)
    return SolidRow(
        body=check.body,
        channels=len(check.channels),
        spare=check.spare,
        solid_to=check.solid_to_hz,
        words=check.words,
        frequency=check.freq_hz[kept].tolist(),
        deviation=check.deviation[kept].tolist(),
        faults=[fault_row(fault) for fault in check.faults],
        more=check.more,
        twins=list(check.twins),
        unseen=list(check.unseen),
    )


def fault_row(fault: Fault) -> FaultRow:
    """A fault as its row in a file."""
    parameters = {
        name: list(value) if isinstance(value, tuple) else float(value)
        for name, value in fault.parameters.items()
    }
    return FaultRow(
        effect=fault.effect,
        location=fault.location,
        dof=fault.dof,
        probability=fault.probability,
        parameters=parameters,
        excess_after=fault.excess_after,
    )


def solid_data(row: SolidRow) -> dict[str, object]:
    """What the page's script shows of a body."""
    deviation: Real = np.array(row.deviation)
    return {
        **row.model_dump(include={"body", "channels", "spare", "solid_to", "words", "more"}),
        "freq": packed(np.array(row.frequency)),
        "deviation": packed(100 * deviation),
        "faults": [_fault_cells(fault) for fault in row.faults],
        "twins": [[fault_words(one) for one in pair] for pair in row.twins],
        "unseen": [fault_words(one) for one in row.unseen],
    }


def _fault_cells(fault: FaultRow) -> list[str]:
    """Effect, place, direction, parameters, probability and what remains, to be read."""
    return [
        _EFFECTS.get(fault.effect, fault.effect),
        _place(fault.location),
        "all" if fault.dof is None else fault.dof.replace("+", ", "),
        "; ".join(parameter_words(*item) for item in fault.parameters.items()) or "-",
        f"{100 * fault.probability:.3g} %",
        f"{fault.excess_after:.3g}",
    ]


def parameter_words(name: str, value: float | list[float]) -> str:
    """``offset 0, 12.3, -4 mm`` of a parameter in SI units."""
    factor, unit = _UNITS.get(name, (1.0, ""))
    values = value if isinstance(value, list) else [value]
    return f"{name} {', '.join(f'{factor * one:.3g}' for one in values)}{unit}"


def fault_words(label: str) -> str:
    """``acc1 tx: gain`` of ``sensor_gain@sensor:acc1:tx``."""
    effect, _, rest = label.partition("@")
    kind, _, place = rest.partition(":")
    point, _, dof = place.partition(":")
    where = " ".join(part for part in (_place(f"{kind}:{point}"), dof.replace("+", ", ")) if part)
    return f"{where}: {_EFFECTS.get(effect, effect)}"


def _place(location: str) -> str:
    """Without its kind: ``acc1, acc2`` of ``sensor:acc1+acc2``."""
    return location.partition(":")[2].replace("+", ", ")
