"""Beside a hammer test that does not go as planned: odd names, rates, hits, and a full disk."""

import tomllib

import numpy as np
import pytest
from live_test import PLACES, Clock, look, play

from identification.words import InputError
from mbw.live import findings
from mbw.live.session import LiveSession


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    return play(tmp_path_factory.mktemp("played"))


@pytest.fixture(autouse=True)
def full_disk(monkeypatch, tmp_path):
    """A log of its own, and a disk that takes no campaign of accepted hits."""

    def refuse(folder):
        raise OSError(28, "No space left on device", str(folder))

    monkeypatch.setattr(findings, "write_atomically", refuse)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def copy_test(played, folder, edit=lambda text: text):
    """A folder with campaign.toml and model, and no hit."""
    folder.mkdir()
    (folder / "model.xml").write_bytes((played / "model.xml").read_bytes())
    text = (played / "campaign.toml").read_text("utf-8")
    (folder / "campaign.toml").write_text(edit(text), encoding="utf-8")
    return folder


def good_hits(played, place):
    """Files of the good hits at a place of the played test."""
    answer = tomllib.loads((played / "answer.toml").read_text("utf-8"))
    bad = {row["file"] for row in answer["bad_hit"]}
    return [path for path in sorted(played.glob(f"*{place}*.npz")) if path.name not in bad]


def test_hits_are_told_apart_whatever_their_files_are_called(played, tmp_path):
    def into_folders(text):
        for place in ("acc1", "acc3"):
            text = text.replace(f"hits_200N_{place}+tx_", f"{place}/hit#")
        return text

    folder, said = copy_test(played, tmp_path / "folders", into_folders), []
    for place in ("acc1", "acc3"):
        (folder / place).mkdir()
        for number, path in enumerate(good_hits(played, place)):
            (folder / place / f"hit#{number}.npz").write_bytes(path.read_bytes())
    session = LiveSession.open(folder, said.append)
    look(session, Clock())
    keys = {f"{place}/hit#{number}.npz" for place in ("acc1", "acc3") for number in range(3)}
    assert {hit.key for hit in session.sheet.hits} == keys
    assert all(any(text.startswith(f"{key}, ") for text in said) for key in keys)
    session.decide("acc3/hit#1.npz", False)
    assert [hit.key for hit in session.sheet.hits if not hit.is_accepted] == ["acc3/hit#1.npz"]


def test_a_hit_keeps_its_decision_when_its_file_grows(played, tmp_path):
    folder, clock = copy_test(played, tmp_path / "grows"), Clock()
    hits = [dict(np.load(path)) for path in good_hits(played, "acc1")]
    for count in (1, 2):
        arrays = {**hits[0]}
        for name in ("force", "response"):
            arrays[name] = np.concatenate([hit[name] for hit in hits[:count]])
        np.savez(folder / "hits_200N_acc1+tx_all.npz", **arrays)
        if count == 1:
            session = LiveSession.open(folder, lambda text: None)
        look(session, clock)
        if count == 1:
            session.decide("hits_200N_acc1+tx_all.npz", False)
    assert [hit.is_accepted for hit in session.sheet.hits] == [False, True]


def test_a_file_of_another_rate_is_told_and_the_other_hits_are_judged(played, tmp_path):
    folder, said, clock = copy_test(played, tmp_path / "rates"), [], Clock()
    session = LiveSession.open(folder, said.append)
    first, second = good_hits(played, "acc1")[:2]
    for path in (first, second):
        (folder / path.name).write_bytes(path.read_bytes())
    strange = good_hits(played, "acc3")[0]
    arrays = dict(np.load(strange))
    np.savez(folder / strange.name, **{**arrays, "rate_hz": 2 * arrays["rate_hz"]})
    look(session, clock)
    assert [hit.is_accepted for hit in session.sheet.hits] == [True, True]
    sentence = f"{strange.name} is not counted: it was sampled at 1024 Hz, others at 512 Hz"
    assert said.count(sentence) == 1


def test_a_hit_that_gives_no_frf_is_not_taken_back(played, tmp_path):
    folder = copy_test(played, tmp_path / "late")
    for path in good_hits(played, "acc1"):
        (folder / path.name).write_bytes(path.read_bytes())
    late = good_hits(played, "acc3")[0]
    arrays = dict(np.load(late))
    for name in ("force", "response"):  # the hit lies at the end of its record
        arrays[name] = np.roll(arrays[name], arrays[name].shape[-1] - 80, axis=-1)
    np.savez(folder / late.name, **arrays)
    session = LiveSession.open(folder, lambda text: None)
    look(session, Clock())
    with pytest.raises(InputError, match="gives no FRF, since its block leaves the record"):
        session.decide(late.name, True)
    assert list(session.sheet.estimates) == [PLACES[0]]


def test_a_full_disk_stops_no_test(played):
    said, clock = [], Clock()
    session = LiveSession.open(played, said.append)
    look(session, clock)
    session.step()
    session.close()
    assert sum("no findings about these hits" in text for text in said) == 1
    assert session.sheet.estimates
