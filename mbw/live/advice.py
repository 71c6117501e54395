"""Where to hit next, and when to stop, from the hits so far and the findings about them."""

from collections.abc import Sequence
from dataclasses import dataclass

from identification.words import Port
from mbw.live.findings import Findings
from mbw.live.test import MIN_HITS, Place, Sheet

MIN_LEAD_NATS = 3.0  # of the leading cause over any other place: odds of 20 to 1
MIN_PLACES = 2  # with fewer, nothing shows whether findings hold elsewhere


@dataclass(frozen=True)
class Advice:
    """Advice on the next hit.

    Args:
        place: where to hit; None for nowhere.
        missing: further hits that it needs.
        stop: whether to stop.
        reason: sentence that says why.
    """

    place: Place | None
    missing: int
    stop: bool
    reason: str


def advise(sheet: Sheet, findings: Sequence[Findings]) -> Advice:
    """Return where to hit next, or that it is time to stop.

    A place that was begun is completed first. Then comes the planned place that shortens the
    interval of the worst parameter most, or, before there are findings, one at a point that was not
    hit. It is time to stop when findings about two successive sets of places agree: no visible gap
    in both, or the same cause, which leads all other places by odds of 20 to 1 in the last.

    Args:
        sheet: hits so far.
        findings: about the hits, in the order of the test; the last may be older than the hits.
    """
    complete = sheet.complete
    waiting = [place for place in sheet.places if place not in complete]
    for place in waiting:
        if count := len(sheet.list_accepted(place)):
            reason = f"{count} of {MIN_HITS} hits there are accepted"
            return Advice(place, MIN_HITS - count, False, reason)
    if not sheet.places:
        return Advice(None, 0, False, "a record of hits in time is awaited; none is there yet")
    if not waiting:
        return Advice(None, 0, True, "all planned places have enough hits")
    if (agreement := find_reason_to_stop(findings)) is not None:
        return Advice(None, 0, True, agreement)
    ranked = {name: rank for rank, name in enumerate(findings[-1].next_hits if findings else ())}
    hit_points = {_point(place[1]) for place in complete}
    best = min(
        waiting,
        key=lambda place: (
            ranked.get(str(place[1]), len(ranked)),
            _point(place[1]) in hit_points,
            sheet.places.index(place),
        ),
    )
    why = "it shortens the intervals most" if str(best[1]) in ranked else "it is planned next"
    return Advice(best, MIN_HITS, False, why)


def find_reason_to_stop(findings: Sequence[Findings]) -> str | None:
    """Return why it is time to stop, or None."""
    if len(findings) < 2:
        return None
    before, last = findings[-2:]
    if len(before.places) < MIN_PLACES:
        return None
    if not before.is_gap_visible and not last.is_gap_visible:
        return "the tuned model explains all hits, before and with the last place"
    if not (before.causes and last.causes):
        return None
    first, *rivals = last.causes
    same = before.causes[0].site == first.site
    elsewhere = [cause.gain for cause in rivals if cause.location != first.location]
    if same and first.gain - max(elsewhere, default=0.0) >= MIN_LEAD_NATS:
        return f"{first.site} leads before and with the last place"
    return None


def _point(port: Port) -> str:
    return port.point
