"""Page of ``mbw simulate``: inputs and motion in time."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from identification.words import Real
from mbmodel import HammerTestPlan, VirtualTest
from mbmodel.simulation.closed_loops import LoopRecord
from mbw.page.html import fill_template, pack_real, warning_boxes

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
    title: str, subtitle: str, step: str, remarks: Sequence[str], views: Sequence[PageView]
) -> str:
    """Return the HTML page of a simulation.

    Args:
        title: of the page.
        subtitle: of the page.
        step: sentence on integrator and error.
        remarks: for the user.
        views: records that are shown.
    """
    return fill_template(
        "simulate/template.html",
        {"views": [_view(view) for view in views]},
        title=escape(title),
        subtitle=escape(subtitle),
        step=escape(step),
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
