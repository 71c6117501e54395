"""Latency of the workbench: from the input on a slider to the painted frame, in a real browser.

The station's campaign is open in a window of 1280 x 800: four curves of 800 frequency lines and
their coherence, modes with MAC to the measured ones, misfit over all 207 channels, and a slider for
each of the 72 stiffnesses and dampers beside those of the tolerances. Keys move the sliders, one
after the other; each state is new, so that no frame is a kept one. A frame counts as painted in the
task that follows the browser's next animation frame. The browser draws without a graphics card.
Then the server is used as in an hour, and its memory is compared.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

from mbw.workbench.desk import Desk
from mbw.workbench.edits import AddedMass
from mbw.workbench.opening import open_subject
from mbw.workbench.state import Action, Move, Put
from mbw.workbench.subject import StoredFrfs, WorkbenchSubject
from tests.helpers.browser import Tab, open_tab
from tests.helpers.workbench_server import serve
from tuning import modes_in_band, predict

DEMO = Path(__file__).resolve().parents[2] / "assets" / "demo"
N_SLIDERS, WARM_UP, STROKES = 72, 12, 144
WARM_UP_S, HOUR_S = 1200, 3600
SOFTWARE_GL = "--enable-unsafe-swiftshader"  # the machine in 3-D without a graphics card
MEASURE = """
window.times = [];
addEventListener("input", () => { window.began = performance.now(); }, true);
addEventListener("painted", event => { if (event.detail.isPreview) requestAnimationFrame(() => {
  const channel = new MessageChannel();
  channel.port1.onmessage = () => window.times.push(performance.now() - window.began);
  channel.port2.postMessage(0);
}); });
window.sliders = [...document.querySelectorAll("#groups .row")]
  .filter(row => /stiffness|damping/.test(row.querySelector("label").title))
  .map(row => row.querySelector("input[type=range]"));
window.sliders.forEach(slider => { slider.closest("details").open = true; });
window.stroke = async k => {
  const slider = window.sliders[k % window.sliders.length], before = window.times.length;
  slider.focus({preventScroll: true});
  slider.stepUp(1 + k % 7);
  slider.dispatchEvent(new Event("input", {bubbles: true}));
  while (window.times.length === before) await new Promise(requestAnimationFrame);
  return window.times[before];
};
"""


def four_curves() -> WorkbenchSubject:
    """Return the demo with modes and a third model's curves, of any parameters."""
    subject = open_subject(DEMO, (0.1, 200.0), None)
    campaign, varies = subject.campaign, subject.parametrisation
    assert campaign is not None
    values = predict(subject.model, varies.theta(np.full(varies.size, 0.1)), campaign)
    labels = [
        (name, str(dof))
        for name, test in zip(subject.tests, campaign.tests, strict=True)
        for dof in test.estimate.frf.outputs
    ]
    stored = StoredFrfs(
        {label: k for k, label in enumerate(labels)}, np.hstack([v[..., 0] for v in values])
    )
    return replace(subject, stored={"tuned": stored}, measured_modes=modes_in_band(campaign))


def measure(tab: Tab, address: str, *, moves: bool, adds: bool) -> np.ndarray:
    """Return the latencies [ms] of strokes on all sliders, or on those of an appendage."""
    tab.show(address, still=not moves)
    tab.wait("document.documentElement?.dataset.ready")
    if adds:
        tab.run("[...document.querySelectorAll('#adders button')].at(-1).click()")
        tab.wait("document.querySelector('#marks i.edit')")
    tab.run(MEASURE)
    if adds:
        tab.run("window.sliders = [...document.querySelectorAll('.edit input[type=range]')]; 0")
    assert tab.run("window.sliders.length") == (3 if adds else N_SLIDERS)
    times = [tab.run(f"window.stroke({k})") for k in range(WARM_UP + STROKES)]
    assert tab.run("FAULTS") == []
    return np.array(times[WARM_UP:])


@contextmanager
def computation() -> Iterator[None]:
    """Keep a computation running at low priority on each core, as tunings and diagnoses are."""
    code = "import os; os.nice(10)\nwhile True: pass"
    jobs = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for job in jobs:
            job.kill()
            job.wait()


def use_for_an_hour(desk: Desk) -> dict[str, object]:
    """Return the memory of the server before and after as many moves as an hour has seconds.

    Each is another state; every tenth time a mass is added or changed. Frames are kept up to a
    bound, which the first moves reach.
    """
    random, body = np.random.default_rng(1), next(iter(desk.subject.model.machine.layout.bodies))
    names = desk.subject.parametrisation.names[:N_SLIDERS]

    def use(seconds: int) -> int:
        for second in range(seconds):
            values = {names[second % len(names)]: float(random.normal(0, 0.3))}
            action: Action = Move(values=values)
            if not second % 10:
                mass = AddedMass(name="mass1", body=body, mass=float(random.uniform(1, 50)))
                action = Put(edit=mass)
            desk.act(desk.history.revision, action)
        resident = Path("/proc/self/statm").read_text().split()[1]
        return int(resident) * os.sysconf("SC_PAGE_SIZE")

    before = use(WARM_UP_S)
    grown = use(HOUR_S) - before
    return {"seconds": HOUR_S, "before_mb": before / 1e6, "grown_mb": round(grown / 1e6, 1)}


def run() -> list[dict[str, object]]:
    """Latency with the machine at rest, with a moving mode, and beside a computation."""
    rows = []
    with (
        tempfile.TemporaryDirectory() as home,
        mock.patch.dict(os.environ, {"XDG_STATE_HOME": home}),
        serve(four_curves()) as server,
        open_tab(SOFTWARE_GL) as tab,
    ):
        for name, moves, adds, job in (
            ("machine at rest", False, False, nullcontext()),
            ("a mode in motion", True, False, nullcontext()),
            ("at rest, a computation on each core", False, False, computation()),
            ("sizes of an appendage", False, True, nullcontext()),
        ):
            with job:
                times = measure(tab, server.address, moves=moves, adds=adds)
            rows.append(
                {
                    "case": name,
                    "sliders": N_SLIDERS,
                    "strokes": len(times),
                    "median_ms": round(float(np.median(times)), 1),
                    "p95_ms": round(float(np.percentile(times, 95)), 1),
                    "largest_ms": round(float(times.max()), 1),
                }
            )
        rows.append(use_for_an_hour(server.page.desk))
    return rows
