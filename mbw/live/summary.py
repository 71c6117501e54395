"""State of a live test, as JSON."""

import numpy as np

from identification.readers.result_files import ResultFile, ResultRow
from mbw.live.session import LiveSession
from mbw.live.test import MIN_HITS, HitRow, Place, Sheet, describe_place


class LiveHit(ResultRow):
    """A hit.

    Args:
        hit: its file, and its number in it from 2 on.
        place: label of where it belongs.
        peak: largest force, signed [N].
        accepted: whether it counts.
        reason: what speaks against it; null if nothing.
        decision: what the user decided; null for nothing.
    """

    hit: str
    place: str
    peak: float
    accepted: bool
    reason: str | None
    decision: bool | None

    @classmethod
    def of_hit(cls, hit: HitRow, place: str) -> "LiveHit":
        """Return a hit of the sheet."""
        return cls(
            hit=hit.key,
            place=place,
            peak=hit.peak_n,
            accepted=hit.is_accepted,
            reason=hit.reason,
            decision=hit.decision,
        )


class LivePlace(ResultRow):
    """A place and direction.

    Args:
        place: point and direction, with the level where tests differ in it.
        accepted: number of accepted hits.
        refused: number of other hits.
        needed: hits that it needs.
        coherence: median over lines and channels; null below two hits.
        interval: median half width of the 95 % interval of |H| over |H|; null without hits.
    """

    place: str
    accepted: int
    refused: int
    needed: int
    coherence: float | None
    interval: float | None


class LiveCause(ResultRow):
    """A provisional cause.

    Args:
        site: effect and place.
        gain: gain that the score test predicts [nats].
    """

    site: str
    gain: float


class LiveSummary(ResultFile):
    """State of a live test.

    Args:
        hits: all hits, in the order of their files.
        places: places and directions.
        next: place to hit next; null for none.
        missing: hits that it needs.
        stop: whether it is time to stop.
        reason: why.
        causes: provisional causes, the best first; null without findings.
        excess: error over noise of the tuned model; null without findings.
        found_hits: number of the hits that the findings are about; null without findings.
        found_at: when the last of them came, in seconds of the computer's steady clock.
        remarks: sentences on the test as a whole.
    """

    hits: list[LiveHit]
    places: list[LivePlace]
    next: str | None
    missing: int
    stop: bool
    reason: str
    causes: list[LiveCause] | None
    excess: float | None
    found_hits: int | None
    found_at: float | None
    remarks: list[str]

    @classmethod
    def of(cls, session: LiveSession) -> "LiveSummary":
        """Return the state of a session."""
        sheet, advice, settings = session.sheet, session.advice, session.test.settings
        last = session.findings[-1] if session.findings else None
        names = {place: describe_place(settings, place) for place in sheet.places}
        return cls(
            hits=[LiveHit.of_hit(hit, names[hit.place]) for hit in sheet.hits],
            places=[_describe(sheet, place, names[place]) for place in sheet.places],
            next=None if advice.place is None else names[advice.place],
            missing=advice.missing,
            stop=advice.stop,
            reason=advice.reason,
            causes=None
            if last is None
            else [LiveCause(site=cause.site, gain=cause.gain) for cause in last.causes],
            excess=None if last is None else last.excess,
            found_hits=None if last is None else last.hits,
            found_at=None if last is None else last.since,
            remarks=list(sheet.remarks),
        )


def _describe(sheet: Sheet, place: Place, name: str) -> LivePlace:
    """Return the row of a place."""
    estimate = sheet.estimates.get(place)
    coherence = interval = None
    if estimate is not None:
        frf, lines = estimate.estimate, slice(1, None)
        size = np.abs(frf.frf.values[lines])
        deviation = np.sqrt(frf.variance[lines] / 2)  # of the modulus: half of that of the value
        interval = 1.96 * float(np.median(deviation / np.maximum(size, np.finfo(float).tiny)))
        if frf.coherence is not None:
            coherence = float(np.median(frf.coherence[lines]))
    accepted = len(sheet.list_accepted(place))
    return LivePlace(
        place=name,
        accepted=accepted,
        refused=sum(hit.place == place for hit in sheet.hits) - accepted,
        needed=max(MIN_HITS - accepted, 0),
        coherence=coherence,
        interval=interval,
    )
