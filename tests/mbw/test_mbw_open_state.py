"""State of the workbench and its log: undo and redo, torn lines, full disks, one server a state."""

import os
from dataclasses import replace
from functools import reduce

import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.words import InputError
from mbw.workbench.state import History, Look, Move, Redo, SessionState, Undo, View, apply
from mbw.workbench.state_log import log_path, open_log

FIRST = SessionState("c", "m", View("a", "b"))


@pytest.fixture(autouse=True)
def state_home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "states"))
    return tmp_path / "states"


# ---- states ------------------------------------------------------------------------------------

MOVES = st.builds(
    lambda name, x: Move(values={name: x}), st.sampled_from("pqr"), st.sampled_from([-1.0, 0, 2.5])
)
ACTIONS = st.lists(MOVES | st.builds(Undo) | st.builds(Redo) | st.just(Look(mode=3)), max_size=30)


@given(ACTIONS)
def test_undo_walks_back_to_the_first_parameters_and_redo_to_the_last(actions):
    history = reduce(apply, actions, History(FIRST))
    back = reduce(apply, [Undo()] * len(history.past), history)
    assert back.state.coordinates == ()
    again = reduce(apply, [Redo()] * len(back.future), back)
    last = history.future[0] if history.future else history.state
    assert again.state.coordinates == last.coordinates
    assert history.revision == len(actions)


def test_a_look_is_no_step_of_undo():
    moved = apply(History(FIRST), Move(values={"p": 1.0}))
    looked = apply(moved, Look(channel="c", mode=4))
    back = apply(looked, Undo())
    assert back.state == replace(FIRST, view=View("a", "c", 4))


def test_a_parameter_moved_back_to_its_drawing_leaves_the_state_as_drawn():
    assert FIRST.move({"p": 1.0}).move({"p": 0.0}) == FIRST
    assert FIRST.move({"p": 1.0}).key != FIRST.key


# ---- the log -----------------------------------------------------------------------------------


@given(ACTIONS)
def test_the_log_gives_the_state_again(tmp_path_factory, actions):
    path = tmp_path_factory.mktemp("log") / "work.jsonl"
    with open_log(path, FIRST) as log:
        for action in actions:
            log.append(action)
    with open_log(path, replace(FIRST, campaign="not used: the log begins with its own")) as log:
        assert log.history == reduce(apply, actions, History(FIRST))
        assert log.remark == ""


@pytest.mark.parametrize("torn", [b'{"do":"move","val', '{"do":"move","values":{"é'.encode()[:-1]])
def test_a_torn_last_line_is_named_and_left_out(tmp_path, torn):
    path = tmp_path / "work.jsonl"
    with open_log(path, FIRST) as log:
        log.append(Move(values={"p\u2028": 1.0}))
    whole = path.read_bytes()
    path.write_bytes(whole + torn)
    with open_log(path, FIRST) as log:
        assert "cut off" in log.remark
        assert log.history.revision == 1
    assert path.read_bytes() == whole


def test_an_action_that_the_disk_does_not_take_is_not_in_the_log(tmp_path, monkeypatch):
    path, write = tmp_path / "work.jsonl", os.write
    with open_log(path, FIRST) as log:
        log.append(Move(values={"p": 1.0}))

        def fill(number, content):
            if len(content) > 5:
                return write(number, content[:5])
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "write", fill)
        with pytest.raises(OSError, match="No space left"):
            log.append(Move(values={"q": 2.0}))
        monkeypatch.setattr(os, "write", write)
        log.append(Move(values={"r": 3.0}))
    with open_log(path, FIRST) as log:
        assert dict(log.history.state.coordinates) == {"p": 1.0, "r": 3.0}


def test_a_log_whose_first_line_was_cut_off_begins_anew(tmp_path):
    path = tmp_path / "work.jsonl"
    with open_log(path, FIRST):
        pass
    whole = path.read_bytes()
    for kept in (whole[:-1], whole[:9]):
        path.write_bytes(kept)
        with open_log(path, FIRST) as log:
            assert (log.history.state, log.remark) == (FIRST, "")
        assert path.read_bytes() == whole


def test_one_state_has_one_server_and_other_content_another_log(tmp_path):
    path = log_path(tmp_path / "model.xml", "work", FIRST)
    with (
        open_log(path, FIRST),
        pytest.raises(InputError, match="another mbw open"),
        open_log(path, FIRST),
    ):
        pass
    assert path != log_path(tmp_path / "model.xml", "work", replace(FIRST, model="changed"))
    with pytest.raises(InputError, match="--state"):
        log_path(tmp_path / "model.xml", "../up", FIRST)
    path.write_text("no log\n", encoding="utf-8")
    with pytest.raises(InputError, match="no log of this version"), open_log(path, FIRST):
        pass
