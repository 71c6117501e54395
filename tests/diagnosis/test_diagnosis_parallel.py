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

from diagnosis import EFFECTS, Scene
from diagnosis.refits.parallel import side_by_side
from diagnosis.refits.refitting import (
    FIRST,
    LAST,
    LONG,
    asked,
    begun_at,
    fitted,
    further,
    go_on,
    refit,
    unbounded,
)
from tests.helpers.drawn import drawn
from tuning import STAGES, fit

INTERRUPTED = """
import signal, sys, time
from pathlib import Path
from diagnosis.refits.parallel import side_by_side

def work(number, folder):
    Path(folder, f"begun{number}").touch()
    time.sleep(60)

signal.signal(signal.SIGINT, signal.default_int_handler)  # in a shell's background it is ignored
try:
    made = side_by_side([(work, (k, sys.argv[1])) for k in (0, 1)], 2)
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
    early = fit(
        session.model, session.campaign, parametrisation=session.parametrisation, stages=STAGES[:3]
    )
    return Scene(session, early.theta)


def test_what_is_returned_has_the_order_of_what_is_asked_in_other_processes():
    power = 3
    calls = [(lambda x: (x**power, os.getpid()), (k,)) for k in range(7)]
    values, places = zip(*side_by_side(calls, 2), strict=True)
    assert values == tuple(k**3 for k in range(7))
    assert os.getpid() not in places
    alone, here = zip(*side_by_side(calls, 1), strict=True)
    assert alone == values
    assert set(here) == {os.getpid()}
    assert list(side_by_side([], 2)) == []


def test_refits_in_processes_are_those_one_after_the_other_and_keep_their_hypotheses(scene):
    several = list(EFFECTS["joint_coupling"](scene))[:3]
    campaign = scene.session.campaign
    ends = []
    for jobs in (1, 2):
        own = replace(scene, jobs=jobs)
        tasks = [asked(own, one, campaign, FIRST) for one in several]
        first = list(fitted(own, tasks))
        assert [made.hypothesis for made in first] == several
        more = list(fitted(own, [further(made, LAST) for made in first]))
        ends.append([(made.cost, made.chi_square, made.fit.x) for made in (*first, *more)])
    for (cost, chi_square, x), other in zip(*ends, strict=True):
        assert (cost, chi_square) == other[:2]
        assert np.array_equal(x, other[2])


def test_further_steps_may_begin_where_another_refit_ended(scene):
    one, other = list(EFFECTS["joint_coupling"](scene))[:2]
    campaign = scene.session.campaign
    first, second = (refit(scene, each, campaign, FIRST) for each in (one, other))
    begun = begun_at(further(first, LAST), second)
    names = [parameter.name for parameter in first.fit.parametrisation.parameters]
    there = {
        p.name: v
        for p, v in zip(second.fit.parametrisation.parameters, second.fit.theta, strict=True)
    }
    for name, value, old in zip(names, begun.start, first.fit.theta, strict=True):
        assert value == there.get(name, old)
    assert not np.array_equal(begun.start, first.fit.theta)


def test_tolerances_without_bounds_that_go_far_beyond_are_not_followed_to_their_end(scene):
    nothing = refit(scene, None, scene.session.campaign, (*FIRST, *LAST))
    found = unbounded(scene, nothing)
    whole = replace(nothing.session, parametrisation=nothing.session.parametrisation.lift_bounds())
    ended = go_on(scene, replace(nothing, session=whole), LONG)
    pulls = np.abs(ended.fit.x[ended.fit.parametrisation.has_prior])
    assert found.pull > 4.0
    assert pulls.max() > 4.0  # whoever goes to the end says the same
    assert ended.chi_square - 1e-3 <= found.loose < nothing.chi_square


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
