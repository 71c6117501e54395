"""The page of a blind test: rates beside baselines, reliability, confusion, every case."""

import json
from html import escape

from mbw.page.html import fill, warnings
from truth.grade import Report, tables, to_json


def render(report: Report, title: str, failed: list[str]) -> str:
    """The page.

    Args:
        report: grades.
        title: of the page.
        failed: sentences about cases that could not be played.
    """
    data = json.loads(to_json(report)) | {"tables": tables(report)}
    both = report.verdicts.all.rates["both"] if report.verdicts else None
    lead = f"{len(report.lines)} campaigns whose answers the diagnosis could not see."
    if both is not None and both.n:
        lead += (
            f" Effect and place were right in {both.hits:g} of {both.n} ({both.low:.0%} to "
            f"{both.high:.0%})."
        )
    reasons = [f"case {name}: {reason}" for name, reason in report.failed.items()]
    return fill(
        "blind/template.html",
        data,
        scripts=["blind/page.js"],
        title=escape(title),
        subtitle="each answer was sealed, its hash published, before the verdict",
        lead=escape(lead),
        warnings=warnings([*failed, *reasons]),
    )
