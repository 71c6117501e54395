"""A live test as a whole: folder, judged hits, findings, advice, and the log of decisions."""

import json
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from identification.readers.campaign_toml import model_file, read_settings
from identification.readers.result_files import FORMAT
from identification.words import InputError, WorkbenchError, rounded_text
from mbmodel import load_machine
from mbw.live.advice import Advice, advise
from mbw.live.findings import Findings, FindingsWorker, FullRefits, write_accepted
from mbw.live.model import HitPredictor
from mbw.live.test import HitRow, LiveTest, Sheet
from mbw.live.watcher import FolderWatch
from mbw.workbench.state_log import state_folder
from tuning.session import prepare_machine

ACCEPTED, LOG = "accepted", "live.jsonl"
_N_SENTENCES = 200  # that are kept for the page
_View = TypeVar("_View")


@dataclass(eq=False)
class LiveSession:
    """State of a live test; its methods may be called from several threads.

    Args:
        test: files and decisions.
        predictor: FRFs of the model; None if campaign.toml names a layout alone.
        folder: where log and accepted hits are kept.
        say: told each sentence for the screen.
        band: band that the findings see [Hz]; None for all lines with coherence.
    """

    test: LiveTest
    predictor: HitPredictor | None
    folder: Path
    say: Callable[[str], None] = lambda text: None
    band: tuple[float, float] | None = None
    findings: list[Findings] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Read the decisions of an earlier session of this test."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._changed = threading.Condition(threading.RLock())
        self._watch = FolderWatch(self.test.source.parent, self.test.patterns, self.test.read)
        self._worker = FindingsWorker(self.folder / ACCEPTED, self.band)
        self._refits = FullRefits(self.folder, self._tell)
        self.sheet: Sheet = self.test.judge()
        self.advice: Advice = advise(self.sheet, [])
        self.version = 0
        self.sentences: deque[str] = deque(maxlen=_N_SENTENCES)
        self.last_change = time.monotonic()
        self._judged: dict[str, bool] = {}
        self._said: set[str] = set()
        for row in _read_log(self.folder / LOG):
            if row.get("decision", "") is None:
                self.test.decisions.pop(row["hit"], None)
            elif "decision" in row:
                self.test.decisions[row["hit"]] = row["decision"]

    @classmethod
    def open(
        cls,
        path: Path,
        say: Callable[[str], None],
        band: tuple[float, float] | None = None,
    ) -> "LiveSession":
        """Open the folder of a test that is about to begin or runs.

        Args:
            band: band of the findings [Hz]; None for their own choice.

        Raises:
            InputError: campaign.toml or the model cannot be used.
        """
        source, settings = read_settings(path)
        nominal = load_machine(model_file(source, settings), key=settings.key)
        machine, remarks = prepare_machine(source, settings, nominal)
        for remark in (*machine.remarks, *remarks):
            say(remark)
        test = LiveTest(source, settings, machine.layout)
        stated = [entry.quantity for entry in settings.test if entry.quantity]
        quantity = stated[0] if stated else "accelerance"
        predictor = HitPredictor(machine, tuple(test.planned), quantity)
        return cls(test, predictor, state_folder(source) / "live", say, band)

    def step(self) -> None:
        """Look at the folder and the findings once, and judge what is new."""
        changes = self._watch.poll()
        result = self._worker.collect()
        with self._changed:
            for path, records in changes.read:
                self.test.add(path, records)
            for path in changes.gone:
                self.test.drop(path)
            if isinstance(result, Findings):
                self.findings.append(result)
                if self.predictor is not None:
                    self.predictor.tune(result.theta)
                self._tell_findings(result)
            elif result is not None:
                self._tell(result)
            for sentence in changes.failures:
                self._tell(sentence)
            if changes.read or changes.gone or result is not None:
                self._judge()
            try:
                self._worker.ask(self.test, self.sheet)
                if self.advice.stop and self.findings:
                    self._refits.ask(self.test, self.sheet)
            except (OSError, WorkbenchError) as error:  # a full disk stops no test
                self._tell(f"no findings about these hits: {error}")

    def decide(self, key: str, decision: bool | None) -> None:
        """Take a refused hit back, withdraw an accepted one, or leave it to the judgement.

        Args:
            key: of the hit.
            decision: whether it counts; None for the judgement.

        Raises:
            InputError: there is no such hit, or it is cut off.
        """
        with self._changed:
            hit = next((hit for hit in self.sheet.hits if hit.key == key), None)
            if hit is None:
                raise InputError(f"there is no hit {key}: look at the list again")
            if decision and hit.is_cut_off:
                raise InputError(f"{key} gives no FRF, since {hit.reason}: hit again")
            if decision is None:
                self.test.decisions.pop(key, None)
            else:
                self.test.decisions[key] = decision
            self._write_log({"hit": key, "decision": decision})
            self._judge()

    def wait(self, version: int, timeout_s: float) -> int:
        """Wait until something has changed, and return the version of the state."""
        with self._changed:
            self._changed.wait_for(lambda: self.version != version, timeout_s)
            return self.version

    def read(self, view: Callable[["LiveSession"], _View]) -> _View:
        """Return what a function reads, all from one state."""
        with self._changed:
            return view(self)

    def write_accepted(self, staging: Path, folder: Path) -> None:
        """Write a campaign of the accepted hits.

        Args:
            staging, folder: as for ``mbw.live.findings.write_accepted``.

        Raises:
            InputError: no hit is accepted yet.
        """
        with self._changed:
            places = [place for place in self.sheet.places if place in self.sheet.estimates]
            if not places:
                raise InputError("no hit is accepted yet: hit first")
            write_accepted(self.test, self.sheet, places, staging, folder)

    def close(self) -> None:
        """End the processes of findings and refits."""
        self._worker.close()
        self._refits.close()

    def _judge(self) -> None:
        """Judge all hits, tell what is new of them, and what to do next."""
        try:
            self.sheet = self.test.judge(self.predictor)
        except WorkbenchError as error:  # of the hits together, such as two sampling rates
            self._tell(str(error))
            return
        for remark in self.sheet.remarks:
            if remark not in self._said:
                self._said.add(remark)
                self._tell(remark)
        before, self.advice = self.advice, advise(self.sheet, self.findings)
        for hit in self.sheet.hits:
            is_new = hit.key not in self._judged
            if is_new or self._judged[hit.key] != hit.is_accepted:
                self._tell_hit(hit, is_new=is_new)
            self._judged[hit.key] = hit.is_accepted
        if self.advice != before:
            self._tell(self.describe_advice())
        self.last_change = time.monotonic()
        self._renew()

    def _renew(self) -> None:
        """Tell those that wait that something has changed."""
        self.version += 1
        self._changed.notify_all()

    def _tell(self, sentence: str) -> None:
        """Say a sentence, and keep it for the page."""
        with self._changed:
            self.sentences.append(sentence)
            self._renew()
        self.say(sentence)

    def _tell_hit(self, hit: HitRow, *, is_new: bool) -> None:
        """Say and log how a hit is judged."""
        self._write_log({"hit": hit.key, "reason": hit.reason, "accepted": hit.is_accepted})
        count = len(self.sheet.list_accepted(hit.place))
        if hit.is_accepted:
            word = "accepted" if is_new or hit.decision is None else "taken back"
            text = f"{word}, {count} there"
        else:
            text = f"NOT ACCEPTED: {hit.reason or 'withdrawn'}"
        self._tell(f"{hit.key}, {abs(hit.peak_n):.3g} N at {hit.place[1]}: {text}")

    def _tell_findings(self, result: Findings) -> None:
        """Say what the findings are, and how old the hits are that they are about."""
        self._tell(describe_findings(result, time.monotonic()))

    def describe_advice(self) -> str:
        """Return what to do next in one sentence."""
        advice = self.advice
        if advice.place is None:
            return f"{'STOP' if advice.stop else 'NEXT'}: {advice.reason}"
        return f"NEXT: hit {advice.place[1]}, {advice.missing} more ({advice.reason})"

    def _write_log(self, row: dict[str, Any]) -> None:
        """Append a line to the log; a full disk stops no test."""
        line = json.dumps({"at": time.time(), "format": FORMAT, **row})
        try:
            with (self.folder / LOG).open("a", encoding="utf-8") as file:
                file.write(line + "\n")
        except OSError as error:
            self._tell(
                f"{self.folder / LOG} takes nothing more ({error.strerror}): make room for it"
            )


def describe_findings(result: Findings, now: float) -> str:
    """Return provisional findings in one sentence.

    Args:
        result: findings.
        now: time [s].
    """
    age = f"{result.hits} hits, {max(now - result.since, 0.0):.0f} s old"
    excess = "" if result.excess is None else f", excess {result.excess:.3g}"
    if not result.is_gap_visible:
        return f"provisional ({age}): the tuned model explains them{excess}"
    causes = ", ".join(
        f"{cause.site} {rounded_text(cause.gain, 3)} nats" for cause in result.causes[:3]
    )
    return f"provisional ({age}{excess}): {causes or 'no effect explains the gap'}"


def _read_log(path: Path) -> list[dict[str, Any]]:
    """Return the lines of a log; a last line that was cut off is left out."""
    rows = []
    try:
        lines = path.read_text("utf-8").splitlines()
    except OSError:
        return []
    for line in lines:
        try:
            rows.append(json.loads(line))
        except ValueError:
            continue
    return [row for row in rows if isinstance(row, dict) and "hit" in row]
