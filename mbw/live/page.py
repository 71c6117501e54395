"""Answers of the server for the page of a live test: its state, FRFs, and decisions on hits."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict

from mbmodel.ports.port_units import input_unit, output_unit
from mbw.live.session import LiveSession
from mbw.live.summary import LiveSummary
from mbw.workbench.frames import encode_frame
from mbw.workbench.server import PageAnswer, list_assets


class LiveView(LiveSummary):
    """State of a live test as the page shows it.

    Args:
        name: name of the folder.
        folder: the folder.
        age_s: age of the findings [s]; null without findings.
        sentences: what was said, the last one last.
    """

    name: str
    folder: str
    age_s: float | None
    sentences: list[str]

    @classmethod
    def of(cls, session: LiveSession) -> "LiveView":
        """Return the state of a session."""
        summary, folder = LiveSummary.of(session), session.test.source.parent.absolute()
        since = summary.found_at
        return cls(
            **dict(summary),
            name=folder.name,
            folder=str(folder),
            age_s=None if since is None else time.monotonic() - since,
            sentences=list(session.sentences),
        )


class DecideRequest(BaseModel):
    """A request to take a hit back or to withdraw it."""

    model_config = ConfigDict(extra="forbid")
    hit: str
    accepted: bool


@dataclass(frozen=True, eq=False)
class LivePage:
    """Page of a live test.

    Args:
        session: the test.
        announce: says the address that a further browser needs.
    """

    session: LiveSession
    announce: Callable[[str], None] = field(default=lambda address: None)
    assets: ClassVar[Mapping[str, tuple[str, str]]] = list_assets(
        "live/index.html",
        "live/live.css",
        "live/live.js",
        *(f"workbench/{name}.js" for name in ("curves", "exchange", "sliders")),
    )

    def read(self, path: str, query: Mapping[str, str]) -> PageAnswer | None:
        """Return the state of the test, or the FRF of a place; None for another address."""
        if path == "/live":
            view = self.session.read(LiveView.of)
            return PageAnswer(view.model_dump_json().encode(), "application/json")
        if path == "/frf":
            place, channel = query.get("place", ""), query.get("channel", "")
            return PageAnswer(
                self.session.read(lambda session: _encode_frf(session, place, channel))
            )
        return None

    def perform(self, task: str, content: bytes) -> PageAnswer | None:
        """Take a hit back or withdraw it; None for another task."""
        if task != "decide":
            return None
        request = DecideRequest.model_validate_json(content)
        self.session.decide(request.hit, request.accepted)
        return PageAnswer.of({})

    def wait(self, versions: tuple[int, ...], timeout_s: float) -> tuple[int, ...]:
        """Wait for another version of the state."""
        return (self.session.wait(versions[0] if versions else -1, timeout_s),)


def _encode_frf(session: LiveSession, number: str, channel: str) -> bytes:
    """Return the FRF of a place, by its number, at a channel, or else at the hammer's own.

    Without an accepted hit there, or for a place that does not exist, the frame has no curves.
    """
    places = dict(
        zip(map(str, range(len(session.sheet.places))), session.sheet.places, strict=True)
    )
    hits = session.sheet.estimates.get(places[number]) if number in places else None
    header: dict[str, Any] = {"version": session.version, "modes": [], "channels": [], "unit": "1"}
    if hits is None:
        return encode_frame({**header, "view": {"reference": number, "channel": channel}}, {})
    estimate, lines = hits.estimate, slice(1, None)
    labels = [str(output) for output in estimate.frf.outputs]
    name = next((label for label in (channel, str(hits.reference)) if label in labels), labels[0])
    row = labels.index(name)
    frf = estimate.frf
    arrays = {
        "freq": frf.freq_hz[lines],
        "measured": frf.values[lines, row, 0],
        "deviation": estimate.variance[lines, row, 0] ** 0.5,
    }
    if session.predictor is not None:
        machine, ports = session.predictor.machine, ((frf.outputs[row],), frf.inputs)
        unit = output_unit(machine, frf.outputs[row], frf.quantity)
        header["unit"] = f"{unit}/{input_unit(machine, hits.reference)}"
        model = session.predictor.frfs(frf.freq_hz[lines], *ports, estimate.window_tau)
        arrays["current"] = model[:, 0, 0]
    if estimate.coherence is not None:
        arrays["coherence"] = estimate.coherence[lines, row, 0]
    view = {"reference": number, "channel": name}
    return encode_frame({**header, "channels": labels, "view": view}, arrays)
