"""How far tolerances were pulled: points by kind for the chart, and the largest as a table."""

from html import escape

from mbw.page.numbers import moved, tolerance
from tuning import TunedFile
from tuning.assessment.parameter_confidence import PLAUSIBLE
from tuning.files.schema import ParameterRow
from tuning.parametrisation.parametrisation import BOUND

_KINDS = {
    ("body", "mass"): "mass",
    ("body", "inertia"): "inertia",
    ("body", "com"): "centre of mass",
    ("joint", "joint_position"): "joint position",
    ("joint", "joint_rotation"): "joint angle",
    ("sensor", "gain"): "sensor gain",
    ("sensor", "rotation"): "sensor angle",
    ("sensor", "position"): "sensor position",
    ("hammer", "rotation"): "hammer angle",
    ("hammer", "position"): "hammer position",
    ("joint", "stiffness"): "stiffness",
    ("joint", "damping"): "damping",
}
_ORDER = {kind: place for place, kind in enumerate(_KINDS.values())}
_MOST = 10
_VAGUE = 0.7  # of its tolerance: the data tell little


def kind_of(row: ParameterRow) -> str:
    """What a parameter is of, such as ``sensor angle``."""
    quantity = row.name.rsplit(".", 1)[-1]
    stem = quantity[:-2] if quantity[-2:] in {"_x", "_y", "_z"} else quantity
    stem = "inertia" if stem.startswith("inertia_") else stem
    return _KINDS.get((row.location.split(":")[0], stem), stem)


def pull_points(summary: TunedFile) -> dict[str, object]:
    """All pulls for the chart: kinds from top to bottom, points with their hover text."""
    rows = _pulled(summary)
    kinds = sorted({kind_of(row) for row, _ in rows}, key=lambda kind: _ORDER.get(kind, 99))
    return {
        "kinds": kinds,
        "trouble": PLAUSIBLE,
        "bound": BOUND,
        "points": [
            {
                "name": row.name,
                "kind": kinds.index(kind_of(row)),
                "pull": pull,
                "vague": _is_vague(row),
                "text": f"{_moved(row)}, tolerance {_tolerance(row)}",
            }
            for row, pull in rows
        ],
    }


def pulls_table(summary: TunedFile) -> str:
    """HTML of the largest pulls, what they amount to, and where the model was held back."""
    rows = _pulled(summary)
    held = bool(rows) and abs(rows[0][1]) > PLAUSIBLE
    body = "".join(
        f'<tr{" class=bad" if abs(pull) > PLAUSIBLE else ""}><td class="name">{escape(row.name)}'
        f'</td><td class="name">{kind_of(row)}</td><td>{_tolerance(row)}</td><td>{pull:+.1f}</td>'
        f"<td>{_moved(row)}{' <small>bound</small>' if held and row.at_bound else ''}</td></tr>"
        for row, pull in rows[:_MOST]
    )
    return (
        '<table class="tight"><thead><tr><th class="name">largest pulls</th><th class="name"></th>'
        f"<th>tolerance</th><th>pull</th><th>moved</th></tr></thead><tbody>{body}</tbody></table>"
    )


def pulls_note(summary: TunedFile) -> str:
    """What the reader of chart and table must know."""
    rows = _pulled(summary)
    text = (
        "Pull: distance from the drawing in standard deviations of its tolerance. Lines: "
        f"{BOUND:g}, and {PLAUSIBLE:g}, beyond which it is no tolerance but a fault"
    )
    if rows and abs(rows[0][1]) > PLAUSIBLE:
        text += f"; the tuned model keeps all within {BOUND:g}, so as not to swallow it"
    text += "."
    if any(_is_vague(row) for row, _ in rows):
        text += " Hollow: the data tell little."
    return text


def _pulled(summary: TunedFile) -> list[tuple[ParameterRow, float]]:
    """Tolerances with their pulls, the largest first."""
    rows = [(row, row.pull) for row in summary.parameters if row.pull is not None]
    return sorted(rows, key=lambda one: -abs(one[1]))


def _is_vague(row: ParameterRow) -> bool:
    return bool(row.deviation and row.prior and row.deviation > _VAGUE * row.prior)


def _moved(row: ParameterRow) -> str:
    return moved(row.drawn, row.tuned, row.unit)


def _tolerance(row: ParameterRow) -> str:
    return tolerance(row.prior or 0.0, row.unit)
