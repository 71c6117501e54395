"""``mbw live``: watch the folder of a running test until it ends, and write its accepted hits."""

import sys
import threading
import time
import webbrowser
from contextlib import ExitStack
from pathlib import Path

from identification.words import WorkbenchError
from mbw.files import write_json
from mbw.live.page import LivePage
from mbw.live.session import LiveSession
from mbw.live.summary import LiveSummary
from mbw.messages import SCREEN
from mbw.output_folder import ResultOptions
from mbw.remarks import list_reading_options
from mbw.workbench.server import serve_beside

_LOOK_INTERVAL_S = 0.2
_KEY_HELP = "b: take the last refused hit back; w: withdraw the last accepted hit; Ctrl-C: end"


def run(
    folder: Path,
    *,
    idle: float | None,
    terminal: bool,
    browser: bool,
    band: tuple[float, float] | None,
    out: Path | None,
    json: Path | None,
    overwrite: bool,
) -> None:
    """Run the verb with the values of its options, as ``mbw.live.options`` describes them.

    Raises:
        InputError: campaign.toml or the model cannot be used.
    """
    with SCREEN.status(f"opening {folder}"):
        session = LiveSession.open(folder, SCREEN.say, band)
    SCREEN.say(f"waiting for hits in {session.test.source.parent}; the log is in {session.folder}")
    SCREEN.say(session.describe_advice())
    if sys.stdin is not None and sys.stdin.isatty():
        SCREEN.say(f"{_KEY_HELP} (each with Enter)")
        threading.Thread(target=_listen, args=(session,), daemon=True).start()
    with ExitStack() as stack:
        stack.callback(session.close)
        if not terminal:
            server = stack.enter_context(serve_beside(LivePage(session, _announce)))
            SCREEN.say(f"page of the test: {server.address}")
            if browser:
                webbrowser.open(server.address)
        try:
            while idle is None or time.monotonic() - session.last_change < idle:
                session.step()
                time.sleep(_LOOK_INTERVAL_S)
        except KeyboardInterrupt:
            SCREEN.say("the test is ended")
    if session.sheet.estimates:
        outputs = ResultOptions(out, overwrite=overwrite)
        with outputs.open("live", session.test.source, "accepted", ["campaign.toml"]) as output:
            with output.write() as place:
                session.write_accepted(place, output.path)
            words = " ".join([str(output.path), *list_reading_options()])
            SCREEN.say(f"accepted hits are in {output.path}: mbw diagnose {words}")
    if json is not None:
        write_json(LiveSummary.of(session).model_dump_json(indent=1), json)


def _announce(address: str) -> None:
    """Say the address that the next browser needs."""
    SCREEN.say(f"address for a further browser: {address}")


def _listen(session: LiveSession) -> None:
    """Take decisions from the keyboard."""
    for line in sys.stdin:
        word = line.strip().lower()
        refused = [hit for hit in session.sheet.hits if not hit.is_accepted]
        accepted = [hit for hit in session.sheet.hits if hit.is_accepted]
        hits = {"b": refused, "w": accepted}.get(word)
        if hits is None:
            SCREEN.say(_KEY_HELP)
        elif not hits:
            SCREEN.say("there is no such hit")
        else:
            try:
                session.decide(hits[-1].key, word == "b")
            except WorkbenchError as error:
                SCREEN.say(str(error))
