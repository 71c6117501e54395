"""Pulls of the tolerances: a chart by kind, and a table of the largest.

The pull of a tolerance is its shift in units of its prior's standard deviation.
"""

from html import escape

from identification.words import TOLERANCE_BOUND_SIGMA
from mbw.page.numbers import format_shift, format_tolerance
from tuning import TunedFile
from tuning.assessment.parameter_confidence import MAX_DETERMINED_SHARE
from tuning.files.schema import ParameterRow
from tuning.fitting.machine_fit import PLAUSIBLE_PULL_SIGMA

_TOLERANCE_KINDS = {
    ("body", "mass"): "mass",
    ("body", "inertia"): "inertia",
    ("body", "com"): "centre of mass",
    ("joint", "joint_position"): "joint position",
    ("joint", "joint_rotation"): "joint angle",
    ("sensor", "gain"): "sensor gain",
    ("sensor", "rotation"): "sensor angle",
    ("sensor", "position"): "sensor position",
    ("sensor", "cross"): "transverse sensitivity",
    ("sensor", "delay"): "sensor delay",
    ("hammer", "rotation"): "hammer angle",
    ("hammer", "position"): "hammer position",
    ("hammer", "gain"): "hammer gain",
    ("hammer", "delay"): "hammer delay",
    ("joint", "stiffness"): "stiffness",
    ("joint", "damping"): "damping",
}
_KIND_ROWS = {kind: row for row, kind in enumerate(_TOLERANCE_KINDS.values())}
_LAST_KIND_ROW = 99  # of kinds that the table above does not list
_MAX_PULL_ROWS = 10  # rows of the table of the largest pulls


def kind_of(row: ParameterRow) -> str:
    """Return the kind of a tolerance, such as ``sensor angle``."""
    quantity = row.name.rsplit(".", 1)[-1]
    stem = quantity[:-2] if quantity[-2:] in {"_x", "_y", "_z"} else quantity
    stem = next((kind for kind in ("inertia", "cross") if stem.startswith(f"{kind}_")), stem)
    return _TOLERANCE_KINDS.get((row.location.split(":")[0], stem), stem)


def pull_points(summary: TunedFile) -> dict[str, object]:
    """Return all pulls for the chart: kinds from top to bottom, points with their hover text."""
    rows = _sort_by_pull(summary)
    kinds = sorted(
        {kind_of(row) for row, _ in rows}, key=lambda kind: _KIND_ROWS.get(kind, _LAST_KIND_ROW)
    )
    return {
        "kinds": kinds,
        "trouble": PLAUSIBLE_PULL_SIGMA,
        "bound": TOLERANCE_BOUND_SIGMA,
        "points": [
            {
                "name": row.name,
                "kind": kinds.index(kind_of(row)),
                "pull": pull,
                "vague": _is_vague(row),
                "text": f"{_shift_text(row)}, tolerance {_tolerance_text(row)}",
            }
            for row, pull in rows
        ],
    }


def pulls_table(summary: TunedFile) -> str:
    """Return HTML of the largest pulls, their shifts, and a mark where a bound limited them."""
    rows = _sort_by_pull(summary)
    is_bounded = bool(rows) and abs(rows[0][1]) > PLAUSIBLE_PULL_SIGMA
    body = "".join(
        f"<tr{' class=bad' if abs(pull) > PLAUSIBLE_PULL_SIGMA else ''}>"
        f'<td class="name">{escape(row.name)}'
        f'</td><td class="name">{kind_of(row)}</td><td>{_tolerance_text(row)}</td>'
        f"<td>{pull:+.1f}</td>"
        f"<td>{_shift_text(row)}{' <small>bound</small>' if is_bounded and row.at_bound else ''}"
        "</td></tr>"
        for row, pull in rows[:_MAX_PULL_ROWS]
    )
    return (
        '<table class="tight"><thead><tr><th class="name">largest pulls</th><th class="name"></th>'
        f"<th>tolerance</th><th>pull</th><th>shift</th></tr></thead><tbody>{body}</tbody></table>"
    )


def pulls_note(summary: TunedFile) -> str:
    """Return the caption of chart and table."""
    rows = _sort_by_pull(summary)
    text = (
        "Pull: shift of a tolerance from its nominal value, in standard deviations of its prior. "
        f"Lines: the bound of {TOLERANCE_BOUND_SIGMA:g}, and {PLAUSIBLE_PULL_SIGMA:g}; larger "
        "pulls indicate a fault."
    )
    if rows and abs(rows[0][1]) > PLAUSIBLE_PULL_SIGMA:
        text += (
            f" The tuned model keeps all within {TOLERANCE_BOUND_SIGMA:g}, so that a tolerance "
            "does not absorb the fault."
        )
    if any(_is_vague(row) for row, _ in rows):
        text += " Hollow: the data hardly improve on the prior."
    return text


def _sort_by_pull(summary: TunedFile) -> list[tuple[ParameterRow, float]]:
    """Return tolerances with their pulls, the largest first."""
    rows = [(row, row.pull) for row in summary.parameters if row.pull is not None]
    return sorted(rows, key=lambda pair: -abs(pair[1]))


def _is_vague(row: ParameterRow) -> bool:
    return bool(row.deviation and row.prior and row.deviation > MAX_DETERMINED_SHARE * row.prior)


def _shift_text(row: ParameterRow) -> str:
    return format_shift(row.drawn, row.tuned, row.unit)


def _tolerance_text(row: ParameterRow) -> str:
    return format_tolerance(row.prior or 0.0, row.unit)
