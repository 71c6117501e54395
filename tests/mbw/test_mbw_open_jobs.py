"""Jobs of the workbench: verbs of the command line on a copy of what the page shows."""

import json
import os
import shutil
import signal
import subprocess
import time

import numpy as np
import pytest
from campaign_folder import write_folder
from small_machine import MJCF
from workbench_server import Browser, frame_parts, serve

from identification.words import UsageError
from mbmodel import load_machine
from mbw.workbench.desk import EditedMakers
from mbw.workbench.edits import AddedMass
from mbw.workbench.jobs import Job, JobQueue
from mbw.workbench.opening import open_subject

MOVED = {"head_tx.stiffness": 0.2}


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    return open_subject(write_folder(tmp_path_factory.mktemp("jobs") / "campaign"), None, None)


@pytest.fixture
def queue(tmp_path):
    queue = JobQueue(tmp_path / "jobs").begin()
    yield queue
    queue.close()


def status(queue, number):
    return next(job for job in queue.list_jobs() if job["number"] == number)["status"]


def wait(condition):
    end = time.monotonic() + 120
    while not (result := condition()):
        assert time.monotonic() < end
        time.sleep(0.05)
    return result


def started(queue, number):
    """The process group of a job that has begun to speak or is at work."""
    wait(lambda: status(queue, number) == "running")
    return queue._jobs[number].pid


def test_a_tuning_of_what_the_page_shows_becomes_its_curve(subject, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with serve(subject) as server:
        browser, desk = Browser(server), server.page.desk
        move = {"revision": 0, "action": {"do": "move", "values": MOVED}}
        moved, _ = frame_parts(browser.ask("POST", "/act", move)[2])
        assert browser.ask("POST", "/jobs", {"do": "add", "verb": "tune"})[0] == 200
        assert browser.ask("POST", "/jobs", {"do": "add", "verb": "identify"})[0] == 200

        def jobs():
            rows = json.loads(browser.ask("GET", "/jobs")[2])["jobs"]
            running = [row["number"] for row in rows if row["status"] == "running"]
            assert len(running) <= 1
            return rows if all(row["status"] == "done" for row in rows) else None

        second, first = wait(jobs)
        assert (first["verb"], first["key"]) == ("tune", moved["machine"])
        assert "tuned: error" in first["log"]
        wait(lambda: desk.plant.subject.measured_modes is not None)
        assert desk.wait((1, 0), 0.0) == (1, 2)
        header, arrays = frame_parts(browser.ask("GET", "/frame")[2])
        assert header["x"] == MOVED
        error = np.abs(arrays["tuned"] - arrays["measured"]).max()
        assert error < 0.1 * np.abs(arrays["current"] - arrays["measured"]).max()
        assert any("mac" in row for row in header["modes"])
        code, headers, page = browser.ask("GET", "/result/1")
        assert (code, page[:15]) == (200, b"<!DOCTYPE html>")
        assert headers["Content-Security-Policy"].startswith("sandbox allow-scripts;")
        assert browser.ask("GET", "/result/1", Cookie=None)[0] == 403
        assert browser.ask("GET", f"/result/{second['number']}")[0] == 200
        assert browser.ask("GET", "/result/3")[0] == 404
        assert browser.ask("POST", "/jobs", {"do": "add", "verb": "rm"})[0] == 400


def test_a_workbench_that_is_opened_again_shows_the_last_results(subject, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with serve(subject) as server:
        browser, jobs = Browser(server), server.page.jobs
        for verb in ("tune", "tune", "identify"):
            assert browser.ask("POST", "/jobs", {"do": "add", "verb": verb})[0] == 200
        wait(lambda: all(job["status"] == "done" for job in jobs.list_jobs()))
        wait(lambda: server.page.desk.plant.subject.measured_modes is not None)
        jobs.show(1)  # the user goes back to the first tuning
        before = server.page.desk.plant.subject
    shown = {job["number"]: job["is_shown"] for job in jobs.list_jobs()}
    assert shown == {1: True, 2: False, 3: True}
    with serve(subject) as server:
        after = server.page.desk.plant.subject
        assert after.tuned == before.tuned
        np.testing.assert_array_equal(after.stored["tuned"].values, before.stored["tuned"].values)
        assert after.measured_modes is not None
        place = jobs.folder / "0001" / "out"
    (place / "tuned.json").unlink()
    for _ in range(2):  # what cannot be read stands with the job, once
        with serve(subject) as server:
            assert server.page.desk.plant.subject.tuned is None
            (remark,) = server.page.jobs.list_jobs()[-1]["remarks"]
            assert remark.startswith("its result is not shown: ")


def test_waiting_jobs_leave_the_queue_and_running_ones_are_interrupted(queue, subject):
    state = subject.first_state()
    first, second = (queue.add("diagnose", subject, state).number for _ in range(2))
    started(queue, first)
    assert status(queue, second) == "waiting"
    queue.cancel(second)
    queue.cancel(first)
    wait(lambda: queue._jobs[first].code is not None)
    assert (status(queue, first), status(queue, second)) == ("cancelled", "cancelled")
    queue.resume(first)
    started(queue, first)
    with pytest.raises(UsageError, match=f"job {first} is running"):
        queue.resume(first)
    queue.cancel(first)
    with pytest.raises(UsageError, match="is cancelled"):
        queue.cancel(second)


def test_a_job_outlives_its_server_and_the_next_one_brings_its_result(subject, tmp_path):
    folder, brought = tmp_path / "jobs", []
    killed = JobQueue(folder).begin()
    number = killed.add("predict", subject, subject.first_state()).number
    waiting = killed.add("predict", subject, subject.first_state()).number
    started(killed, number)
    killed._is_open = False  # its thread ends as in a killed process: nothing is interrupted
    killed._thread.join(5)
    queue = JobQueue(folder, lambda job, out: brought.append((job.number, out))).begin()
    wait(lambda: len(brought) == 2)
    assert [each for each, _ in brought] == [number, waiting]
    assert queue.page(number) == brought[0][1] / "predict.html"
    assert queue.page(number).is_file()
    queue.close()


def test_a_killed_job_is_interrupted_and_a_closed_queue_interrupts_its_own(subject, tmp_path):
    queue = JobQueue(tmp_path / "jobs").begin()
    number = queue.add("diagnose", subject, subject.first_state()).number
    os.killpg(started(queue, number), signal.SIGKILL)
    wait(lambda: status(queue, number) == "interrupted")
    queue.resume(number)
    pid = started(queue, number)
    queue.close()
    wait(lambda: not _is_alive(pid))
    again = JobQueue(tmp_path / "jobs")
    assert status(again, number) == "interrupted"
    again.close()


def _is_alive(pid):
    try:
        os.killpg(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_what_cannot_run_is_refused_in_a_sentence(queue, subject, tmp_path):
    state = subject.first_state()
    (tmp_path / "pair.xml").write_text(MJCF, encoding="utf-8")
    alone = open_subject(tmp_path / "pair.xml", None, None)
    with pytest.raises(UsageError, match="open a campaign"):
        queue.add("tune", alone, alone.first_state())
    with pytest.raises(UsageError, match="nowhere is not there: name the campaign after"):
        queue.add("compare", subject, state, "nowhere")
    for path in ("", "~nobody-of-that-name/x", "x" * 300):
        with pytest.raises(UsageError, match="name the campaign after"):
            queue.add("compare", subject, state, path)
    with pytest.raises(UsageError, match="there is no job 7"):
        queue.cancel(7)
    assert queue.list_jobs() == []


def test_a_fit_begins_at_the_drawing_with_what_was_added(subject, tmp_path):
    """Its priors are about the drawing, and its values are those of the page."""
    makers = EditedMakers(subject, tmp_path / "machines")
    (tmp_path / "machines").mkdir()
    queue = JobQueue(tmp_path / "jobs")
    moved = subject.first_state().move({"head.com_x": 1.0, **MOVED})
    plain = queue.add("tune", subject, moved)
    assert Job.model_validate_json(
        (queue.folder / "0001" / "job.json").read_text("utf-8")
    ).source == str(subject.source)
    heavy = moved.add(AddedMass(name="mass1", body="head", mass=2.0))
    queue.add("diagnose", makers.of(heavy).subject, heavy)
    queue.add("predict", makers.of(heavy).subject, heavy)
    fit, model = (load_machine(queue.folder / n / "input" / "model.xml") for n in ("0002", "0003"))
    drawn = subject.model.machine
    stiffness = [{s.name: s.stiffness for s in m.springs}["head_tx"] for m in (drawn, fit, model)]
    assert stiffness[1] == stiffness[0]
    assert stiffness[2] == pytest.approx(stiffness[0] * np.exp(0.2))
    masses = [float(np.diag(m.body_mass)[::6].sum()) for m in (drawn, fit, model)]
    assert masses == pytest.approx([masses[0], masses[0] + 2.0, masses[0] + 2.0])
    assert plain.number == 1


def test_a_broken_job_fails_alone_and_a_reused_number_is_left_alone(subject, tmp_path):
    queue = JobQueue(tmp_path / "jobs")
    broken, good = (queue.add("predict", subject, subject.first_state()).number for _ in range(2))
    shutil.rmtree(queue.folder / "0001")
    queue.begin()
    wait(lambda: status(queue, good) == "done")
    assert status(queue, broken) == "failed"
    queue.close()
    with subprocess.Popen(["sleep", "60"], start_new_session=True) as stranger:
        old = queue._jobs[good].model_copy(
            update={"status": "running", "pid": stranger.pid, "code": None, "began": "long ago"}
        )
        (queue.folder / "0002" / "job.json").write_text(old.model_dump_json(), encoding="utf-8")
        (queue.folder / "0002" / "exit.txt").unlink()
        again = JobQueue(queue.folder).begin()
        wait(lambda: status(again, good) == "interrupted")
        again.close()
        assert stranger.poll() is None
        stranger.kill()


def test_changed_measurements_are_not_used_in_silence(subject, tmp_path):
    place = write_folder(tmp_path / "campaign")
    opened, queue = open_subject(place, None, None), JobQueue(tmp_path / "jobs")
    shutil.copy(write_folder(tmp_path / "later", seed=7) / "impact.mat", place / "impact.mat")
    with pytest.raises(UsageError, match="has changed since it was opened"):
        queue.add("identify", opened, opened.first_state())
    (place / "campaign.toml").unlink()
    with pytest.raises(UsageError, match="has changed since it was opened"):
        queue.add("tune", opened, opened.first_state())
