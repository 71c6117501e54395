"""What the page is told once: parameters with their intervals, channels, and the machine in 3-D."""

from typing import Any

import numpy as np

from mbmodel import machine_geometry
from mbw.page.picture import picture_data
from mbw.workbench.frames import port_of
from mbw.workbench.subject import Subject, port_labels


def session_data(subject: Subject) -> dict[str, Any]:
    """Return names, parameters, channels and lines of a subject, as JSON can hold them."""
    machine, campaign = subject.model.machine, subject.campaign
    labels = port_labels(machine.layout)
    measured = {} if campaign is None else {
        name: [str(dof) for dof, seen in zip(
            test.estimate.frf.outputs, test.estimate.measured[:, 0].tolist(), strict=True
        ) if seen]
        for name, test in zip(subject.tests, campaign.tests, strict=True)
    }
    return {
        "name": subject.name,
        "model": machine.name,
        "path": str(subject.path),
        "measured": measured,
        "ports": {name: port_of(name) for name in subject.tests},
        "inputs": [*machine.motors, *labels],
        "outputs": labels,
        "quantity": subject.quantity,
        "freq": [float(f"{value:.7g}") for value in subject.freq_hz.tolist()],
        "parameters": _parameter_rows(subject),
        "tuned": subject.tuned_x(),
        "curves": ["measured", "drawn", *(subject.stored or {}), "current"],
        "has_page": subject.result is not None,
        "has_measured_modes": subject.measured_modes is not None,
        "remarks": list(subject.remarks),
    }


def _parameter_rows(subject: Subject) -> list[dict[str, Any]]:
    """Return a row for each coordinate, in x: value = drawn exp(scale x) or drawn + scale x."""
    varies, model = subject.parametrisation, subject.model
    tuned = {} if subject.tuned is None else {row.name: row for row in subject.tuned.parameters}
    first = {int(k): i for i, k in reversed(list(enumerate(varies.coordinate_of.tolist())))}
    rows = []
    for k, name in enumerate(varies.names):
        parameter, index = varies.parameters[first[k]], first[k]
        precision = float(varies.precision[k])
        row: dict[str, Any] = {
            "name": name,
            "location": model.locations[index],
            "unit": parameter.unit,
            "drawn": float(varies.fixed[index]),
            "scale": float(varies.scale[index]),
            "log": bool(varies.is_logarithmic[k]),
            "tolerance": bool(varies.is_tolerance[k]),
            "low": float(varies.lower[k]),
            "high": float(varies.upper[k]),
            "sd": 1 / float(np.sqrt(precision)) if precision > 0 else None,
            "interval": None,
        }
        known = tuned.get(name)
        if known is not None and known.low is not None and known.high is not None and known.seen:
            row["interval"] = [_coordinate(row, known.low), _coordinate(row, known.high)]
        rows.append(row)
    return rows


def _coordinate(row: dict[str, Any], value: float) -> float:
    """Return the x at which a parameter has a value, within its bounds."""
    if not row["log"]:
        x = (value - row["drawn"]) / row["scale"]
    else:
        x = float(np.log(value / row["drawn"])) / row["scale"] if value > 0 else row["low"]
    return float(np.clip(x, row["low"], row["high"]))


def scene_data(subject: Subject) -> dict[str, Any]:
    """Return the machine in 3-D: surfaces, points and lines, and where each port of a test is."""
    machine = subject.model.machine
    layout = machine.layout
    shapes = np.zeros((0, 6 * len(layout.bodies)), complex)
    axes = {name: layout.axes[k].tolist() for k, name in enumerate(layout.points)}
    return {**picture_data(layout, machine_geometry(machine), shapes), "axes": axes}
