"""Beside a hammer test: the folder is watched, hits are judged, and nothing in it changes."""

import hashlib
import json
import shutil
import tomllib

import numpy as np
import pytest
from live_test import PLACES, Clock, look, play
from typer.testing import CliRunner

from diagnosis.next_test.provisional import ProvisionalCause
from identification.words import Dof, InputError
from mbw.assets import asset_path
from mbw.command import app
from mbw.live.advice import advise
from mbw.live.findings import Findings, FindingsWorker, FullRefits
from mbw.live.session import LiveSession, describe_findings
from mbw.live.test import MIN_HITS, HitRow, Sheet
from mbw.live.watcher import REST_S, FolderWatch
from tuning import open_session


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    return play(tmp_path_factory.mktemp("played"))


@pytest.fixture
def alone(monkeypatch, tmp_path):
    """No processes beside the test, and a log of its own."""
    monkeypatch.setattr(FindingsWorker, "ask", lambda *_: None)
    monkeypatch.setattr(FullRefits, "ask", lambda *_: None)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def contents(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}


def read_number(path):
    text = path.read_text("utf-8")
    if not text.endswith("end"):
        raise InputError(f"{path} is cut off: export it again")
    return text


def test_a_file_counts_when_it_rests_and_can_be_read(tmp_path):
    clock = Clock()
    watch = FolderWatch(tmp_path, ["*.txt"], read_number, clock)
    path = tmp_path / "a.txt"
    path.write_text("one", encoding="utf-8")
    assert watch.poll().read == ()
    clock.now += REST_S / 2
    path.write_text("one two", encoding="utf-8")  # still written: its rest begins anew
    assert watch.poll().read == ()
    clock.now += REST_S
    assert watch.poll().read == ()  # rests, and is cut off
    path.write_text("one two end", encoding="utf-8")
    assert watch.poll().read == ()
    clock.now += REST_S
    assert watch.poll().read == ((path, "one two end"),)
    clock.now += 10
    assert watch.poll().read == ()  # once


def test_a_file_that_stays_cut_off_is_told_once_and_read_when_it_is_whole(tmp_path):
    clock = Clock()
    watch = FolderWatch(tmp_path, ["*.txt"], read_number, clock)
    (tmp_path / "a.txt").write_text("one", encoding="utf-8")
    told = []
    for _ in range(40):
        told += watch.poll().failures
        clock.now += 0.2
    assert len(told) == 1
    assert "a.txt is not counted" in told[0]
    (tmp_path / "a.txt").write_text("one end", encoding="utf-8")
    watch.poll()
    clock.now += REST_S
    assert len(watch.poll().read) == 1


def test_a_file_that_no_pattern_names_is_said_once(tmp_path):
    clock = Clock()
    (tmp_path / "campaign.toml").write_text("", encoding="utf-8")  # there before the test
    watch = FolderWatch(tmp_path, ["hit*.txt"], read_number, clock)
    watch.poll()
    for name in ("hit1.txt", "impact1.txt", "~impact1.txt"):
        (tmp_path / name).write_text("end", encoding="utf-8")
    said = [sentence for _ in range(9) for sentence in watch.poll().failures]
    assert said == ["impact1.txt is not counted: the test names hit*.txt"]


def test_files_come_late_in_the_order_of_their_time_and_may_go(tmp_path):
    clock = Clock()
    watch = FolderWatch(tmp_path / "late", ["*.txt"], read_number, clock)
    assert watch.poll().read == ()  # the folder is not there yet
    (tmp_path / "late").mkdir()
    for name in ("b", "a"):
        (tmp_path / "late" / f"{name}.txt").write_text(f"{name} end", encoding="utf-8")
    (tmp_path / "late" / "c.log").write_text("end", encoding="utf-8")
    watch.poll()
    clock.now += REST_S
    assert {path.stem for path, _ in watch.poll().read} == {"a", "b"}
    (tmp_path / "late").rename(tmp_path / "away")  # a network folder that is away
    assert (watch.poll().read, watch.poll().gone) == ((), ())
    (tmp_path / "away").rename(tmp_path / "late")
    assert watch.poll().gone == ()
    (tmp_path / "late" / "a.txt").unlink()
    assert [path.stem for path in watch.poll().gone] == ["a"]


def test_bad_hits_are_refused_and_good_ones_accepted(played, alone, tmp_path):
    before = contents(played)
    answer = tomllib.loads((played / "answer.toml").read_text("utf-8"))
    bad = {row["file"]: row["kind"] for row in answer["bad_hit"]}
    said = []
    session = LiveSession.open(played, said.append)
    look(session, Clock())
    judged = {hit.key: hit.is_accepted for hit in session.sheet.hits}
    assert len(bad) > 1
    assert {key for key, accepted in judged.items() if not accepted} == set(bad)
    assert session.advice.stop
    assert contents(played) == before
    for key in bad:
        assert sum(key in text and "NOT ACCEPTED" in text for text in said) == 1


def test_hits_are_judged_one_by_one_before_the_next(played, alone, tmp_path):
    folder = tmp_path / "comes"
    folder.mkdir()
    for name in ("campaign.toml", "model.xml"):
        (folder / name).write_bytes((played / name).read_bytes())
    answer = tomllib.loads((played / "answer.toml").read_text("utf-8"))
    bad = {row["file"] for row in answer["bad_hit"]}
    session, clock = LiveSession.open(folder, lambda text: None), Clock()
    assert session.advice.place == PLACES[0]
    for path in sorted(played.glob("*.npz")):
        (folder / path.name).write_bytes(path.read_bytes())
        look(session, clock)
        last = session.sheet.hits[-1]
        assert last.key == path.name
        assert last.is_accepted is (path.name not in bad)
    at_once = LiveSession.open(folder, lambda text: None)
    look(at_once, Clock())
    assert at_once.sheet.hits == session.sheet.hits
    assert list(at_once.sheet.estimates) == list(session.sheet.estimates) != []
    for place, hits in at_once.sheet.estimates.items():
        of_session = session.sheet.estimates[place]
        np.testing.assert_array_equal(hits.estimate.frf.values, of_session.estimate.frf.values)
        np.testing.assert_array_equal(hits.estimate.variance, of_session.estimate.variance)
        assert hits.remarks == of_session.remarks


def test_a_decision_counts_against_the_judgement_and_outlives_the_session(played, alone):
    answer = tomllib.loads((played / "answer.toml").read_text("utf-8"))
    bad = answer["bad_hit"][0]["file"]
    session, clock = LiveSession.open(played, lambda text: None), Clock()
    look(session, clock)
    refused = next(hit for hit in session.sheet.hits if hit.key == bad)
    session.decide(bad, True)
    taken_back = next(hit for hit in session.sheet.hits if hit.key == bad)
    assert (taken_back.is_accepted, taken_back.reason) == (True, refused.reason)
    count = session.sheet.estimates[taken_back.place].estimate.averages
    again = LiveSession.open(played, lambda text: None)
    look(again, clock)
    assert next(hit for hit in again.sheet.hits if hit.key == bad).is_accepted
    again.decide(bad, None)
    assert not next(hit for hit in again.sheet.hits if hit.key == bad).is_accepted
    assert again.sheet.estimates[taken_back.place].estimate.averages == count - 1
    with pytest.raises(InputError, match="there is no hit nothing"):
        again.decide("nothing", True)


def test_a_file_of_other_length_or_without_hits_is_told_and_spoils_nothing(played, alone, tmp_path):
    folder = tmp_path / "odd"
    folder.mkdir()
    for path in played.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    first = sorted(folder.glob("*.npz"))[0]
    arrays = dict(np.load(first))
    short = {
        **arrays,
        "force": arrays["force"][..., :200],
        "response": arrays["response"][..., :200],
    }
    np.savez(folder / first.name.replace("001", "900"), **short)
    quiet = {**arrays, "force": np.zeros_like(arrays["force"])}
    np.savez(folder / first.name.replace("001", "901"), **quiet)
    said, clock = [], Clock()
    session = LiveSession.open(folder, said.append)
    look(session, clock)
    clock.now += 2
    session.step()
    assert any("_901.npz is not counted" in text and "no hit in the force" in text for text in said)
    assert any("_900.npz is not counted: it has 200 samples" in t for t in session.sheet.remarks)
    assert len(session.sheet.hits) == len(list(played.glob("*.npz")))


def test_the_command_writes_the_accepted_hits_as_a_campaign(played, alone, tmp_path):
    out, summary = tmp_path / "accepted", tmp_path / "live.json"
    arguments = [
        "live",
        str(played),
        "--idle",
        "3",
        "--terminal",
        "--out",
        str(out),
        "--json",
        str(summary),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert "NEXT: hit acc1:+tx, 3 more" in result.output
    assert "STOP: all planned places have enough hits" in result.output
    state = json.loads(summary.read_text("utf-8"))
    accepted = sum(hit["accepted"] for hit in state["hits"])
    campaign = open_session(out).campaign
    assert sum(test.estimate.averages for test in campaign.tests) == accepted
    assert [row["needed"] for row in state["places"]] == [0, 0]
    assert all(0.5 < row["coherence"] <= 1 and row["interval"] < 0.5 for row in state["places"])


def test_other_verbs_say_what_a_pattern_of_hits_is_for(played):
    result = CliRunner().invoke(app, ["identify", str(played)])
    assert result.exit_code == 3
    assert "mbw live reads them" in " ".join(result.output.split())


def test_a_folder_of_frfs_is_told_what_a_live_test_needs(tmp_path):
    shutil.copytree(asset_path("two_bodies"), tmp_path / "c")
    words = ["live", str(tmp_path / "c"), "--idle", "2", "--terminal"]
    said = " ".join(CliRunner().invoke(app, words).output.split())
    assert "STOP" not in said
    assert "it holds FRFs, and a live test needs the records of hits in time" in said


def test_scores_of_provisional_causes_have_no_exponent():
    text = describe_findings(findings((), ("mass_error", "body:lid", 5.64e4)), 0.0)
    assert "mass_error@body:lid 56,400 nats" in text


def test_a_campaign_without_a_model_is_refused(tmp_path):
    toml = 'layout = "a.toml"\n[[test]]\nfile = "*.npz"\n'
    (tmp_path / "campaign.toml").write_text(toml, encoding="utf-8")
    with pytest.raises(InputError, match="names no model"):
        LiveSession.open(tmp_path, lambda text: None)


def sheet(*counts):
    """A sheet with some accepted hits at each place."""
    places = tuple((k, Dof.of(f"acc{k}", k % 3)) for k in range(len(counts)))
    hits = [
        HitRow(f"{k}_{n}", place, 200.0, None, None)
        for k, place in enumerate(places)
        for n in range(counts[k])
    ]
    return Sheet(places, tuple(hits))


def findings(places, *causes, visible=True, further=()):
    found = tuple(ProvisionalCause(effect, place, None, gain) for effect, place, gain in causes)
    return Findings(tuple(places), 3 * len(places), 0.1, 2.0, visible, found, tuple(further), {})


def test_a_place_that_was_begun_is_completed_first():
    advice = advise(sheet(MIN_HITS, 0, 1), [])
    assert (str(advice.place[1]), advice.missing, advice.stop) == ("acc2:+tz", 2, False)


def test_the_next_place_is_the_most_informative_one_or_at_a_new_point():
    three = sheet(MIN_HITS, 0, 0)
    assert str(advise(three, []).place[1]) == "acc1:+ty"
    ranked = [findings(three.places[:1], further=("acc2:+tz", "acc1:+ty"))]
    assert str(advise(three, ranked).place[1]) == "acc2:+tz"


def test_it_is_time_to_stop_when_findings_agree():
    four = sheet(MIN_HITS, MIN_HITS, MIN_HITS, 0)
    two, three = four.places[:2], four.places[:3]
    nothing = [findings(places, visible=False) for places in (two, three)]
    assert advise(four, nothing).stop
    assert not advise(four, nothing[1:]).stop
    lead = ("mass_error", "body:head", 50.0)
    near, far = ("appendage", "body:base", 48.5), ("appendage", "body:base", 20.0)
    assert advise(four, [findings(two, lead), findings(three, lead, far)]).stop
    assert not advise(four, [findings(two, lead), findings(three, lead, near)]).stop
    assert not advise(four, [findings(two, far), findings(three, lead, far)]).stop
    assert not advise(four, [findings(two, visible=False), findings(three, lead, far)]).stop
    assert advise(sheet(MIN_HITS, MIN_HITS), []).stop
