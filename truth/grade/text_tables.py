"""A grading as text: aligned tables, n and 95 % interval beside every rate."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from truth.grade.marks import MEANS, RATES
from truth.grade.rates import Diagram, Rate, Spread
from truth.grade.report import Report
from truth.grade.scores import Group, Matrix, Scores
from truth.grade.sizes import Errors, Sizes

_SPLIT_RATES = (
    "effect_first",
    "place_first",
    "both",
    "both_or_twin",
    "top3",
    "where_first",
    "false_alarm",
    "unknown_rejected",
)
_GAP = "  "


def tables(report: Report) -> str:
    """Return the whole report as text, its lines left out."""
    parts = [
        f"cases {report.cases}, of these failed {len(report.failed)}, "
        f"not graded {len(report.ungraded)}"
    ]
    parts += [f"  failed {name}: {why}" for name, why in report.failed.items()]
    parts += [f"  not graded {name}: {why}" for name, why in report.ungraded.items()]
    for name, remarks in report.remarks.items():
        parts += [f"  remark {name}: {remark}" for remark in remarks]
    if report.verdicts is not None:
        parts += ["", *_scores(report.verdicts)]
    if report.baselines:
        parts += ["", "baselines", *_baselines(report)]
    return "\n".join(parts) + "\n"


def rate_text(rate: Rate) -> str:
    """Return a rate in percent with its interval and n: ``66.7 % [35.4, 87.9] n=9``."""
    if rate.rate is None:
        return "- n=0"
    inside = ""
    if rate.low is not None and rate.high is not None:
        inside = f" [{100 * rate.low:.1f}, {100 * rate.high:.1f}]"
    return f"{100 * rate.rate:.1f} %{inside} n={rate.n}"


def align(rows: Iterable[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines, each column as wide as its widest cell."""
    cells = [list(row) for row in rows]
    count = max((len(row) for row in cells), default=0)
    wide = [max(len(row[i]) for row in cells if i < len(row)) for i in range(count)]
    return [
        _GAP.join(cell.ljust(width) for cell, width in zip(row, wide, strict=False)).rstrip()
        for row in cells
    ]


def _baselines(report: Report) -> list[str]:
    """The verdicts and the baselines below each other, and why some cases were skipped."""
    known = {"verdicts": report.verdicts}
    known |= {name: entry.scores for name, entry in report.baselines.items()}
    lines = _groups({name: scores.all for name, scores in known.items() if scores is not None})
    reasons = Counter(
        (name, why) for name, entry in report.baselines.items() for why in entry.skipped.values()
    )
    lines += [f"  {name} skipped in {n} cases: {why}" for (name, why), n in reasons.items()]
    return lines


def _scores(scores: Scores) -> list[str]:
    lines = ["verdicts", *_group(scores.all)]
    for title, split in (
        ("by effect", scores.by_effect),
        ("by kind of place", scores.by_place),
        ("by survival ratio", scores.by_ratio),
        ("by machine", scores.by_machine),
        ("by tag", scores.by_tag),
    ):
        if split:
            lines += ["", title, *_groups(split)]
    if scores.calibration is not None:
        for title, diagram in (
            ("calibration of the most probable hypothesis", scores.calibration.first),
            ("calibration of the causes", scores.calibration.causes),
            ("calibration of the shares", scores.calibration.shares),
        ):
            lines += ["", title, *_diagram(diagram)]
    if scores.sizes is not None:
        lines += ["", "sizes", *_sizes(scores.sizes)]
    if scores.confusion is not None:
        lines += ["", "confusion of effects", *_matrix(scores.confusion.effects)]
        lines += ["", "confusion of kinds of places", *_matrix(scores.confusion.kinds)]
    return lines


def _group(group: Group) -> list[str]:
    rows = [["score", "rate [95 %]", "meaning"]]
    rows += [
        [name, rate_text(group.rates[name]), meaning]
        for name, meaning in RATES.items()
        if group.rates[name].n
    ]
    means = [["number", "mean", "median", "90 %", "largest", "n", "meaning"]]
    means += [
        [name, *_spread(group.means[name]), meaning]
        for name, meaning in MEANS.items()
        if group.means[name].n
    ]
    return [*align(rows), "", *align(means)]


def _groups(split: Mapping[str, Group]) -> list[str]:
    rows = [["", "cases", *_SPLIT_RATES, "p of truth"]]
    for label, group in split.items():
        rates = [rate_text(group.rates[name]) for name in _SPLIT_RATES]
        rows.append(
            [label, str(group.n), *rates, _number(group.means["probability_of_truth"].mean)]
        )
    return align(rows)


def _diagram(diagram: Diagram) -> list[str]:
    rows = [["stated", "mean", "true"]]
    rows += [
        [f"{part.low:g} to {part.high:g}", _number(part.stated), rate_text(part.true)]
        for part in diagram.bins
    ]
    return [*align(rows), f"expected calibration error {_number(diagram.error)} n={diagram.n}"]


def _sizes(sizes: Sizes) -> list[str]:
    rows = [["effect", "parameter", "median error", "90 %", "found", "of"]]
    rows.append(["all", "size", *_errors(sizes.size)])
    for effect, parameters in sizes.parameters.items():
        if effect in sizes.size_of:
            rows.append([effect, "size", *_errors(sizes.size_of[effect])])
        rows += [[effect, name, *_errors(errors)] for name, errors in parameters.items()]
    held = [["intervals", "hold the truth"], ["all", rate_text(sizes.intervals)]]
    held += [[effect, rate_text(rate)] for effect, rate in sizes.intervals_of.items() if rate.n]
    return [*align(rows), "", *align(held)]


def _matrix(matrix: Matrix) -> list[str]:
    said = sorted({label for row in matrix.values() for label in row})
    rows = [["truth \\ said", *said]]
    rows += [
        [true, *(str(matrix[true].get(label, ".")) for label in said)] for true in sorted(matrix)
    ]
    return align(rows)


def _spread(spread: Spread) -> list[str]:
    numbers = (spread.mean, spread.median, spread.ninety, spread.largest)
    return [*(_number(value) for value in numbers), str(spread.n)]


def _errors(errors: Errors) -> list[str]:
    return [_number(errors.median), _number(errors.ninety), str(errors.n), str(errors.true)]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
