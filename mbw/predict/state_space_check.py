"""FRFs of the state space beside those of the equation of motion: in words, JSON and HTML."""

from collections.abc import Sequence
from html import escape

import numpy as np

from identification.words import Dof, Input, capitalise, shorten_names
from mbmodel import ApproximatedLaw, FrfRequest, Machine, Model, StateSpaceComparison
from mbw.page.html import pack_complex, pack_real
from mbw.page.numbers import format_percent
from mbw.predict.curves import port_unit
from mbw.predict.requests import PredictRequest, band_lines, read_quantity
from mbw.predict.schema import LawRow, StateSpaceCheckRow
from mbw.site_kinds import hammer_sites

_LOSS = "positive frequencies"  # kind of a constant loss
_KINDS = {
    "pade": "Pade's fraction",
    "fitted poles": "fitted stable poles",
}


def check_request(machine: Machine, request: PredictRequest, inputs: Sequence[Input]) -> FrfRequest:
    """Return the FRFs of the check: all motions of the centres of mass per hammer direction.

    Args:
        machine: with its bodies.
        request: band, lines and quantity.
        inputs: that the user names; empty for the three directions of the first hammer point, or
            of the last body's centre of mass where there is none.
    """
    layout = machine.layout
    point = (hammer_sites(layout) or [layout.bodies[-1]])[0]
    return FrfRequest(
        band_lines(request),
        layout.body_dofs(),
        tuple(inputs) or tuple(Dof.of(point, axis) for axis in range(3)),
        read_quantity(request),
    )


def law_sentences(rows: Sequence[LawRow]) -> list[str]:
    """Return how the state space holds the laws, and with which errors, one sentence a kind."""
    groups: dict[tuple[object, ...], list[LawRow]] = {}
    for row in rows:
        law = row.parameter.rpartition(".")[2]
        errors = () if row.kind == _LOSS else (row.max_error, row.max_error_of_stiffness)
        key = (law, row.kind, row.order, row.states, *errors)
        groups.setdefault(key, []).append(row)
    return [_law_sentence(group) for group in groups.values()]


def _law_sentence(rows: Sequence[LawRow]) -> str:
    """Return the sentence on laws that are alike."""
    names, row = shorten_names([each.parameter for each in rows]), rows[0]
    states = f"{row.states} state{'' if row.states == 1 else 's'}{' each' * (len(rows) > 1)}"
    if row.kind == "exact":
        return f"{names}: exact, with {states}"
    if row.kind == _LOSS:
        worst = max(rows, key=lambda each: each.max_error)
        joint = worst.parameter.rpartition(".")[0]
        return (
            f"{names}: by the poles of positive frequency, as no causal system has constant "
            f"losses; along {joint} the accelerance is off by at most "
            f"{format_percent(worst.max_error)} of its peak"
        )
    if row.kind == "tustin":
        return (
            f"{names}: sampled controller by Tustin's rule with the delay of its hold ({states}), "
            f"error at most {format_percent(row.max_error)}"
        )
    if row.max_error_of_stiffness is None:
        return (
            f"{names}: controller with {_KINDS[row.kind]} of its delay ({states}), error at most "
            f"{format_percent(row.max_error)}"
        )
    return (
        f"{names}: {_KINDS[row.kind]} of order {row.order} ({states}), error of the law at most "
        f"{format_percent(row.max_error)}, rms {format_percent(row.rms_error)}; at most "
        f"{format_percent(row.max_error_of_stiffness)} of the stiffness"
    )


def law_rows(laws: Sequence[ApproximatedLaw], model: Model) -> list[LawRow]:
    """Return the approximations as rows.

    Args:
        laws: of the state space.
        model: with the size of each law as a parameter.
    """
    sizes = {parameter.name: parameter.drawn for parameter in model.parameters}
    rows = []
    for law in laws:
        fit = law.approximation
        rows.append(
            LawRow(
                parameter=law.owner,
                kind=fit.kind,
                order=fit.function.order,
                states=law.states,
                max_error=fit.max_error,
                rms_error=fit.rms_error,
                weighted_error=fit.rms_error,
                max_error_of_stiffness=None
                if law.owner not in sizes or fit.kind == _LOSS
                else fit.max_error * fit.largest_size * abs(sizes[law.owner]),
                is_passive=fit.is_passive,
            )
        )
    return rows


def check_row(comparison: StateSpaceComparison, model: Model) -> StateSpaceCheckRow:
    """Return the comparison for the JSON file."""
    request, (output, column, worst_hz) = comparison.request, comparison.worst
    return StateSpaceCheckRow(
        outputs=[str(dof) for dof in request.outputs],
        inputs=[str(dof) for dof in request.inputs],
        quantity=request.quantity,
        band=(float(request.freq_hz[0]), float(request.freq_hz[-1])),
        lines=len(request.freq_hz),
        states=comparison.states,
        max_difference=comparison.max_difference,
        rms_difference=comparison.rms_difference,
        worst_output=str(output),
        worst_input=str(column),
        worst_hz=worst_hz,
        is_stable=not comparison.growth > 0,
        laws=law_rows(comparison.laws, model),
    )


def check_lines(row: StateSpaceCheckRow) -> list[str]:
    """Return the comparison as lines of text."""
    low, high = row.band
    lines = [
        f"state space of {row.states} states by python-control against the equation of motion, "
        f"{len(row.outputs)} x {len(row.inputs)} FRFs at centres of mass, {row.quantity}, "
        f"{row.lines} lines, {low:g} to {high:g} Hz:",
        f"  largest difference {row.max_difference:.2e} of the FRF's peak, at {row.worst_output} / "
        f"{row.worst_input}, {row.worst_hz:.4g} Hz; rms difference {row.rms_difference:.2e}",
    ]
    if not row.is_stable:
        lines.append("  the state space is unstable: a pole grows")
    return lines + [f"  {sentence}" for sentence in law_sentences(row.laws)]


def check_section(row: StateSpaceCheckRow) -> str:
    """Return HTML of the comparison."""
    head, *rest = check_lines(row)
    items = "".join(f"<li>{escape(line.strip())}</li>" for line in rest)
    return (
        f"<h2>State space</h2><p>{escape(capitalise(head))}</p><ul>{items}</ul>"
        '<div id="state-space"></div>'
        '<p class="soft">The FRF with the largest difference: by the equation of motion, by the '
        "state space, and their difference.</p>"
    )


def check_curves(comparison: StateSpaceComparison, machine: Machine) -> dict[str, object]:
    """Return the FRF with the largest difference for the page."""
    request, (output, column, _) = comparison.request, comparison.worst
    return {
        "freq": pack_real(request.freq_hz),
        "values": pack_complex(comparison.worst_frfs),
        "difference": pack_real(np.abs(np.subtract(*comparison.worst_frfs))),
        "label": f"{output} / {column}",
        "quantity": request.quantity,
        "unit": port_unit(machine, request.quantity, output, column),
    }
