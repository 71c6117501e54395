"""Page of a blind test: success rates and baselines, reliability, confusion matrix, all cases."""

import json
from html import escape

from mbw.page.html import fill_template, warning_boxes
from truth.grade import Report, tables, to_json


def render(report: Report, title: str, failed: list[str]) -> str:
    """Return the HTML page of a blind test.

    Args:
        report: grades of the verdicts.
        title: title of the page.
        failed: sentences on cases that could not be run.
    """
    data = json.loads(to_json(report)) | {"tables": tables(report)}
    both = report.verdicts.all.rates["both"] if report.verdicts else None
    lead = f"The diagnosis was scored on {len(report.lines)} campaigns with withheld answers."
    if both is not None and both.n:
        lead += (
            f" Effect and place were right in {both.hits:g} of {both.n} cases (95 % interval "
            f"{both.low:.0%} to {both.high:.0%})."
        )
    reasons = [f"case {name}: {reason}" for name, reason in report.failed.items()]
    return fill_template(
        "blind/template.html",
        data,
        scripts=["blind/page.js"],
        title=escape(title),
        subtitle="the hash of each answer was published before the verdict",
        lead=escape(lead),
        warnings=warning_boxes([*failed, *reasons]),
    )
