"""Work beside each other: in order, with functions made in functions, the same for any jobs."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis import EFFECTS
from diagnosis.refits.parallel import run_in_parallel
from diagnosis.refits.refitting import add_cause, run_refits
from diagnosis.settings import SETTINGS
from tests.helpers.drawn import drawn
from tests.helpers.refits import early_scene, refit_null

INTERRUPTED = """
import signal, sys, time
from pathlib import Path
from diagnosis.refits.parallel import run_in_parallel

def work(number, folder):
    Path(folder, f"begun{number}").touch()
    time.sleep(60)

signal.signal(signal.SIGINT, signal.default_int_handler)  # in a shell's background it is ignored
try:
    made = run_in_parallel([(work, (k, sys.argv[1])) for k in (0, 1)], 2)
    Path(sys.argv[1], "asked").touch()
    list(made)
except KeyboardInterrupt:
    sys.exit(130)
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A campaign with a strong effect at a joint, and a fit with 10 %."""
    session, _ = drawn(
        tmp_path_factory.mktemp("coupled"), 72_021, "joint_coupling", ratio=6.0, lines=161
    )
    return early_scene(session)


def test_what_is_returned_has_the_order_of_what_is_asked_in_other_processes():
    power = 3
    calls = [(lambda x: (x**power, os.getpid()), (k,)) for k in range(7)]
    values, places = zip(*run_in_parallel(calls, 2), strict=True)
    assert values == tuple(k**3 for k in range(7))
    assert os.getpid() not in places
    alone, here = zip(*run_in_parallel(calls, 1), strict=True)
    assert alone == values
    assert set(here) == {os.getpid()}
    assert list(run_in_parallel([], 2)) == []


def test_refits_in_processes_are_those_one_after_the_other_and_keep_their_hypotheses(scene):
    null = refit_null(scene)
    hypotheses = list(EFFECTS["joint_coupling"](scene))[:3]
    tasks = [add_cause(null, hypothesis) for hypothesis in hypotheses]
    alone, beside = (
        run_refits(replace(scene, jobs=jobs), tasks, SETTINGS.schedule) for jobs in (1, 2)
    )
    for first, second, hypothesis in zip(alone, beside, hypotheses, strict=True):
        assert first.causes == second.causes == (hypothesis,)
        assert first.statistics == second.statistics
        assert np.array_equal(first.fit.x, second.fit.x)


@pytest.mark.parametrize("sign", ["asked", "begun1"])  # while they begin, and at work
def test_an_interrupt_ends_other_processes_in_silence(tmp_path, sign):
    script = tmp_path / "asks.py"
    script.write_text(INTERRUPTED)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    command = [sys.executable, str(script), str(tmp_path)]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
    ) as process:
        while not (tmp_path / sign).is_file() and process.poll() is None:
            time.sleep(0.05)
        time.sleep(0.3)
        os.killpg(process.pid, signal.SIGINT)
        said = process.stderr.read()
    assert process.returncode == 130, said
    assert said == ""
