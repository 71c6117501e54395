"""Page of ``mbw simulate``: inputs and motion in time.

Units of inputs and outputs of a simulation in time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from identification.words import Loop, Quantity, Real, Signal
from mbmodel import HammerTestPlan, Machine, VirtualTest
from mbmodel.ports.signal_rows import is_floor
from mbmodel.simulation.drives import (
    REFERENCE,
    Drive,
    JointDof,
    LoopSignal,
    Reading,
    SensorValue,
)
from mbmodel.simulation.loop_signals import LoopRecord
from mbw.page.html import fill_template, pack_real, warning_boxes
from mbw.page.numbers import MOTION_UNITS

PAGE = "simulate.html"
_MAX_VIEWS = 12  # first hits that the page shows
_MAX_PAGE_NUMBERS = 3_000_000  # of all channels and instants; more would make the page slow

Column = tuple[str, str, Real]  # label, unit, values (n_time,)


@dataclass(frozen=True, eq=False)
class PageView:
    """Inputs and motion of one record.

    Args:
        label: of the record.
        time_s: instants [s]; (n_time,).
        inputs, outputs: label, unit and values of each channel.
        start: point that is shown first; empty for the first of all.
        loops: closed loops.
    """

    label: str
    time_s: Real
    inputs: Sequence[Column]
    outputs: Sequence[Column]
    start: str = ""
    loops: Sequence[LoopRecord] = ()


def render(
    title: str,
    subtitle: str,
    step: str,
    remarks: Sequence[str],
    views: Sequence[PageView],
    sentences: Sequence[str] = (),
) -> str:
    """Return the HTML page of a simulation.

    Args:
        title: of the page.
        subtitle: of the page.
        step: sentence on integrator and error.
        remarks: for the user.
        views: records that are shown.
        sentences: what it showed.
    """
    return fill_template(
        "simulate/template.html",
        {"views": [_view(view) for view in views]},
        title=escape(title),
        subtitle=escape(subtitle),
        step=escape(step),
        lead=f'<p class="lead">{escape(" ".join(sentences))}</p>' if sentences else "",
        warnings=warning_boxes(remarks),
        scripts=["simulate/page.js"],
    )


def hit_views(plan: HammerTestPlan, test: VirtualTest) -> list[PageView]:
    """Return the first hit along each direction of each file."""
    views = []
    for file in plan.files:
        for record in test.records[file.file]:
            time_s = np.arange(record.force.shape[1]) / record.rate_hz
            views.append(
                PageView(
                    f"{file.file}, {record.reference}",
                    time_s,
                    [(str(record.reference), "N", record.force[0])],
                    [
                        (str(dof), "m/s²", values)
                        for dof, values in zip(record.outputs, record.motion[0], strict=True)
                    ],
                    record.reference.point,
                )
            )
    return views[:_MAX_VIEWS]


def _view(view: PageView) -> dict[str, object]:
    """Return a view as packed numbers, every n-th instant of a long one."""
    columns = 1 + len(view.inputs) + len(view.outputs) + 4 * len(view.loops)
    count = len(view.time_s) * columns
    every = slice(None, None, 1 + count // _MAX_PAGE_NUMBERS)

    def pack(columns: Sequence[Column]) -> list[dict[str, str]]:
        return [
            {"label": label, "unit": unit, "values": pack_real(values[every])}
            for label, unit, values in columns
        ]

    return {
        "label": view.label,
        "start": view.start,
        "time": pack_real(view.time_s[every]),
        "inputs": pack(view.inputs),
        "outputs": pack(view.outputs),
        "loops": [
            {
                "name": record.loop.name,
                "unit": record.loop.measured.unit,
                "input": f"{record.loop.input} [{record.loop.input_unit}]",
                "limit": record.loop.limit,
                "followed": pack(
                    [
                        ("reference", record.loop.measured.unit, record.reference),
                        ("measured", record.loop.measured.unit, record.measured),
                    ]
                ),
                "error": pack([("error", record.loop.measured.unit, record.error)]),
                "control": pack([("control", record.loop.input_unit, record.control)]),
            }
            for record in view.loops
        ],
    }


def loop_columns(loops: Sequence[LoopRecord]) -> list[tuple[str, str, Real]]:
    """Return label, unit and values of the signals of closed loops."""
    return [
        (f"{label}:{record.loop.name}", unit, values)
        for record in loops
        for label, unit, values in (
            (REFERENCE, record.loop.measured.unit, record.reference),
            ("measured", record.loop.measured.unit, record.measured),
            ("control", record.loop.input_unit, record.control),
        )
    ]


def input_unit(machine: Machine, drive: Drive, loops: Sequence[Loop]) -> str:
    """Return the unit of an input; the reference of a loop has that of what it measures."""
    if isinstance(drive, LoopSignal):
        return next(loop.measured.unit for loop in loops if loop.name == drive.loop)
    if isinstance(drive, Signal) and not drive.is_directed:
        return "control"
    if isinstance(drive, JointDof):
        return "N m" if _turns(machine, drive) else "N"
    if is_floor(machine, drive):
        return MOTION_UNITS["accelerance"][drive.is_rotation]
    return "N m" if drive.is_rotation else "N"


def output_unit(machine: Machine, reading: Reading, quantity: Quantity) -> str:
    """Return the unit of an output: a joint gives its position, a sensor what MuJoCo defines.

    A sensor that has no linear model, such as a rangefinder, gives ``sensor``.
    """
    if isinstance(reading, SensorValue):
        linear_reading = machine.sensors.readings.get(str(reading))
        return "sensor" if linear_reading is None else linear_reading.unit
    if isinstance(reading, JointDof):
        return "rad" if _turns(machine, reading) else "m"
    return MOTION_UNITS[quantity][reading.is_rotation]


def _turns(machine: Machine, dof: JointDof) -> bool:
    return next(axle.turns for axle in machine.axles if axle.joint == dof.joint)
