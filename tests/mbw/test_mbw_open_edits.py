"""Additions to a machine on the workbench: physics, states, margins and budget."""

import json
from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
from budget_case import BUDGET, write_machine
from campaign_folder import write_folder
from hypothesis import given
from hypothesis import strategies as st
from servo_campaign import write_servo_campaign
from small_machine import MJCF
from typer.testing import CliRunner
from workbench_server import Browser, frame_parts, serve

from diagnosis.effects.resonator import build_resonator
from identification.words import InputError, UsageError
from mbmodel import AddedPart, Change, Model, Parameter, transport
from mbw.command import app
from mbw.output_folder import ResultOptions
from mbw.workbench.desk import EditedMakers
from mbw.workbench.edits import AddedAppendage, AddedDelay, AddedMass, AddedSpring, AddedStrut
from mbw.workbench.opening import open_subject
from mbw.workbench.saving import save_state
from mbw.workbench.state import (
    History,
    Look,
    Move,
    Put,
    Redo,
    Remove,
    SessionState,
    Undo,
    View,
    apply,
)
from mbw.workbench.state_log import open_log
from mbw.workbench.state_study import StateStudy
from tuning import open_session, predict

POINT = (0.1, -0.05, 0.2)
MASS = AddedMass(name="mass1", body="head", point=POINT, mass=3.0)
SPRING = AddedSpring(
    name="spring1", body="head", to="base", point=POINT, axis=(1, 2, 2), stiffness=4e6, damping=300
)
GROUNDED = SPRING.model_copy(update={"to": "world"})
END = (-0.2, 0.1, 0.05)
STRUT = AddedStrut(
    name="strut1", body="head", to="base", point=POINT, end=END, stiffness=4e6, damping=300
)
PROPPED = STRUT.model_copy(update={"to": "world"})
APPENDAGE = AddedAppendage(
    name="appendage1", body="head", point=POINT, mass=2.0, frequency=60.0, damping=0.04
)


LOOP = """
[loop.pos]
input = "servo"
output = "acc1:+tx"
delay = 3e-4
controller = { zeros = [], poles = [-2000.0], gain = 10.0 }
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("edits") / "campaign")


@pytest.fixture(scope="module")
def makers(campaign, tmp_path_factory):
    return EditedMakers(open_subject(campaign, None, None), tmp_path_factory.mktemp("machines"))


@pytest.fixture(scope="module")
def model_subject(tmp_path_factory):
    path = tmp_path_factory.mktemp("alone") / "pair.xml"
    path.write_text(MJCF, encoding="utf-8")
    return open_subject(path, (5.0, 165.0), None)


def column(layout, body):
    """The motion of a body's centre of mass, and of the point of the edits, by all motions."""
    frame = np.zeros((6 * len(layout.bodies), 6))
    frame[6 * layout.bodies.index(body) :][:6] = np.eye(6)
    return frame, transport(np.array(POINT))[:3] @ frame.T


def find_axis(edit, layout):
    """The direction of a spring, or of the line between the ends of a strut."""
    axis = np.array(getattr(edit, "axis", END))
    if edit in (STRUT, PROPPED):
        head, base = (layout.centres[layout.bodies.index(name)] for name in ("head", "base"))
        axis = head + POINT - axis - (base if edit is STRUT else 0.0)
    return axis / np.linalg.norm(axis)


def change_of(edit, layout):
    """The edit's equation by hand: a core at s^0, s^1, s^2 on the motions of all bodies."""
    eye, core = np.eye(6 * len(layout.bodies)), np.zeros((3, *2 * (6 * len(layout.bodies),)))
    _, at_head = column(layout, "head")
    if edit in (MASS, APPENDAGE):
        core[2 if edit is MASS else 0] = edit.mass * at_head.T @ at_head
    else:
        axis = find_axis(edit, layout)
        apart = axis @ at_head
        if edit.to == "base":
            arm = layout.centres[layout.bodies.index("head")] + POINT
            arm = arm - layout.centres[layout.bodies.index("base")]
            apart = apart - axis @ transport(arm)[:3] @ column(layout, "base")[0].T
        core[0], core[1] = edit.stiffness * np.outer(apart, apart), 0
        core[1] = edit.damping * np.outer(apart, apart)
    shape = None
    if edit is APPENDAGE:
        shape = build_resonator(2 * np.pi * edit.frequency, edit.damping)
    return Change("body", eye, eye, core, shape=shape)


@pytest.mark.parametrize(
    "edit", [MASS, SPRING, GROUNDED, STRUT, PROPPED, APPENDAGE], ids=lambda e: f"{e.kind}"
)
def test_an_edit_is_its_equation_added_to_the_bodies(makers, edit):
    """Read from the MJCF, it changes FRFs as the same term in the equation of motion does."""
    subject = makers.plain.subject
    state = subject.first_state().add(edit)
    edited = makers.of(state).subject
    change = change_of(edit, subject.model.machine.layout)
    part = AddedPart(
        "body:head", (Parameter("by_hand", 1.0, "1"),), lambda _: (change,), lambda _: ()
    )
    by_hand = Model(subject.model.machine, (*subject.model.parts, part))
    wanted = predict(by_hand, by_hand.drawn, subject.campaign)
    plain = predict(subject.model, subject.model.drawn, subject.campaign)
    for got, meant, before in zip(
        predict(edited.model, edited.model.drawn, edited.campaign), wanted, plain, strict=True
    ):
        size = np.abs(meant - before).max()
        np.testing.assert_allclose(got, meant, atol=2e-5 * size)
        assert size > 1e-3 * np.abs(before).max()


def test_modes_of_an_appendage_are_new_and_the_others_keep_their_partners(makers):
    state = makers.plain.subject.first_state()
    before, _ = frame_parts(makers.of(state).make(state))
    added = state.add(APPENDAGE)
    header, arrays = frame_parts(makers.of(added).make(added))
    new = [row["frequency"] for row in header["modes"] if row["drawn"] is None]
    assert len(header["modes"]) == len(before["modes"]) + 3
    assert len(new) >= 2
    assert all(abs(value - 60.0) < 15.0 for value in new)
    paired = [row["drawn"] for row in header["modes"] if row["drawn"] is not None]
    assert {row["frequency"] for row in before["modes"]} >= set(paired)
    assert len(arrays["shape"]) == 2 * 6 * 3
    assert header["drawn_gap"] == before["gap"]


def test_a_port_of_what_was_added_has_no_curve_as_drawn(makers):
    state = makers.plain.subject.first_state().add(APPENDAGE)
    state = replace(state, view=View("head:+tx", "appendage1:+tx"))
    _, arrays = frame_parts(makers.of(state).make(state))
    assert set(arrays) == {"current", "shape"}
    assert np.isfinite(arrays["current"]).all()
    looked = replace(state, view=View("head:+tx", "base:+tx"))
    _, arrays = frame_parts(makers.of(looked).make(looked))
    plain = replace(looked, edits=())
    _, before = frame_parts(makers.of(plain).make(plain))
    np.testing.assert_array_equal(arrays["drawn"], before["current"])


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (MASS.model_copy(update={"body": "arm"}), "no moving body 'arm'"),
        (SPRING.model_copy(update={"to": "head"}), "choose another end"),
        (SPRING.model_copy(update={"axis": (0.0, 0.0, 0.0)}), "give the axis a direction"),
        (STRUT.model_copy(update={"to": "head", "end": POINT}), "choose another end"),
        (STRUT.model_copy(update={"body": "arm"}), "no moving body 'arm'"),
    ],
    ids=["body", "end", "axis", "strut", "strut's body"],
)
def test_what_cannot_be_added_is_refused_in_a_sentence(makers, edit, words):
    state = makers.plain.subject.first_state().add(edit)
    with pytest.raises((InputError, UsageError), match=words):
        makers.of(state)


@pytest.mark.parametrize(
    ("settings", "edit"),
    [
        ('<compiler settotalmass="200"/>', MASS),
        ('<compiler boundmass="10"/>', MASS),
        ('<compiler settotalmass="200"/>', APPENDAGE),
    ],
)
def test_a_file_that_gives_additions_other_sizes_is_refused(tmp_path, settings, edit):
    model = tmp_path / "pair.xml"
    model.write_text(MJCF.replace("<worldbody>", f"{settings}<worldbody>"), encoding="utf-8")
    subject = open_subject(model, (5.0, 165.0), None)
    with pytest.raises(InputError, match="other masses or springs: take settotalmass"):
        EditedMakers(subject, tmp_path).of(subject.first_state().add(edit))


def test_a_default_class_does_not_change_an_appendage(tmp_path):
    model = tmp_path / "pair.xml"
    default = '<default><joint springdamper="0.05 1"/></default><worldbody>'
    text = MJCF.replace(' damping="', ' springdamper="0 0" damping="')
    text = text.replace("<worldbody>", default)
    model.write_text(text, encoding="utf-8")
    subject = open_subject(model, (5.0, 165.0), None)
    edited = EditedMakers(subject, tmp_path).of(subject.first_state().add(APPENDAGE)).subject
    stiffness = {s.name: s.stiffness for s in edited.model.machine.springs}["appendage1_x"]
    assert stiffness == pytest.approx(2.0 * (2 * np.pi * 60.0) ** 2)


# ---- states ------------------------------------------------------------------------------------

FIRST = SessionState("c", "m", View("a", "b"))
HEAVY = MASS.model_copy(update={"mass": 9.0})
ACTIONS = st.lists(
    st.sampled_from(
        [
            Put(edit=MASS),
            Put(edit=HEAVY),
            Put(edit=SPRING),
            Remove(name="mass1"),
            Remove(name="spring1"),
            Move(values={"spring1.stiffness": 0.5}),
            Move(values={"p": 1.0}),
            Undo(),
            Redo(),
            Look(mode=2),
        ]
    ),
    max_size=25,
)


@given(ACTIONS)
def test_undo_takes_edits_back_and_the_log_gives_them_again(tmp_path_factory, actions):
    history = reduce(apply, actions, History(FIRST))
    names = [edit.name for edit in history.state.edits]
    assert len(set(names)) == len(names)
    back = reduce(apply, [Undo()] * len(history.past), history)
    assert (back.state.edits, back.state.coordinates) == ((), ())
    path = tmp_path_factory.mktemp("log") / "work.jsonl"
    with open_log(path, FIRST) as log:
        for action in actions:
            log.append(action)
    with open_log(path, FIRST) as log:
        assert log.history == history


def test_other_sizes_keep_the_place_in_the_list_and_forget_the_sliders_of_that_edit():
    moved = FIRST.add(SPRING).add(MASS).move({"spring1.stiffness": 0.5, "p": 1.0})
    stiffer = moved.add(SPRING.model_copy(update={"stiffness": 5e6}))
    assert [edit.name for edit in stiffer.edits] == ["spring1", "mass1"]
    assert dict(stiffer.coordinates) == {"p": 1.0}
    assert moved.remove("spring1").edits == (MASS,)
    assert len({FIRST.key, FIRST.add(MASS).key, FIRST.add(HEAVY).key}) == 3


# ---- saving and the server ---------------------------------------------------------------------


def test_a_machine_with_edits_is_saved_and_every_verb_reads_it(makers, tmp_path):
    state = makers.plain.subject.first_state().add(MASS).add(SPRING).add(APPENDAGE)
    state = state.move({"spring1.stiffness": 0.4, "base_tx.stiffness": -0.2})
    edited = makers.of(state).subject
    sentences = save_state(edited, state, ResultOptions(tmp_path / "saved"))
    assert len(sentences) == 1, sentences
    saved = open_session(tmp_path / "saved", (edited.freq_hz[0], edited.freq_hz[-1]))
    theta = edited.parametrisation.theta(state.x(edited.parametrisation.names))
    for read, meant in zip(
        predict(saved.model, saved.model.drawn, saved.campaign),
        predict(edited.model, theta, edited.campaign),
        strict=True,
    ):
        np.testing.assert_allclose(read, meant, rtol=1e-6)


def test_the_page_tries_sizes_out_and_undoes_what_was_added(campaign, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with serve(open_subject(campaign, None, None)) as server:
        browser = Browser(server)

        def act(action, expected=200):
            revision = int(browser.ask("GET", "/frame")[1]["Revision"])
            status, _, content = browser.ask(
                "POST", "/act", {"revision": revision, "action": action}
            )
            assert status == expected, content
            return content

        first, _ = frame_parts(browser.ask("GET", "/frame")[2])
        put = {"do": "put", "edit": MASS.model_dump()}
        added, _ = frame_parts(act(put))
        assert added["structure"] != first["structure"]
        status, _, tried = browser.ask("POST", "/preview", {"edit": HEAVY.model_dump()})
        heavier, _ = frame_parts(tried)
        assert (status, heavier["edits"][0]["mass"]) == (200, 9.0)
        assert browser.ask("GET", "/frame")[2].find(b'"mass": 3.0') > 0
        act({"do": "put", "edit": APPENDAGE.model_dump()})
        act({"do": "look", "channel": "appendage1:+tx"})
        scene = json.loads(browser.ask("GET", "/scene")[2])
        assert [mark["name"] for mark in scene["marks"]] == ["mass1", "appendage1"]
        assert "appendage1" in scene["stages"]
        assert scene["points"][0]["axes"] == [1, 0, 0, 0, 1, 0, 0, 0, 1]
        undone, _ = frame_parts(act({"do": "undo"}))
        assert undone["view"]["channel"] == first["view"]["channel"]
        wrong = {**MASS.model_dump(), "body": "arm"}
        assert b"no moving body" in act({"do": "put", "edit": wrong}, expected=422)
        late = {"kind": "delay", "name": "delay1", "loop": "servo", "delay": 0.001}
        assert b"no control loop" in act({"do": "put", "edit": late}, expected=422)
        wrong = {**MASS.model_dump(), "mass": -1.0}
        assert b"mass: the value should be greater than 0" in act(
            {"do": "put", "edit": wrong}, expected=422
        )
        gone = {"do": "move", "values": {"gyroscopic@body:head.share": 0.0}}
        act(gone)  # as drawn, also of a parameter that is no more
        act({"do": "move", "values": {"gyroscopic@body:head.share": 1.0}}, expected=422)
        act({"do": "undo"})
        assert frame_parts(act({"do": "undo"}))[0]["gap"] == first["gap"]


# ---- margins and budget ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    place = tmp_path_factory.mktemp("plant")
    write_machine(place)
    text = BUDGET.format(gain=3e5, delay=3e-4, lines="")
    (place / "budget.toml").write_text(text, encoding="utf-8")
    return place


def predicted(model, budget, out):
    """Margins and errors that mbw predict states of a machine."""
    words = ["predict", str(model), "--budget", str(budget), "--json", str(out), "-q"]
    run = CliRunner().invoke(app, [*words, "--no-pictures"])
    assert run.exit_code == 0, run.output
    rows = json.loads(out.read_text())
    return rows["budget"]


def test_margins_and_errors_are_those_of_mbw_predict_before_and_after(plant, tmp_path):
    subject = open_subject(plant / "two.xml", (2.0, 45.0), None)
    makers, study = EditedMakers(subject, tmp_path), StateStudy(subject, plant / "budget.toml")
    state = subject.first_state().add(AddedMass(name="mass1", body="head", mass=2.0))
    state = state.move({"head_tx.stiffness": 0.3})
    edited = makers.of(state).subject
    rows = study.study(edited, state)
    save_state(edited, state, ResultOptions(tmp_path / "saved"))
    before = predicted(plant / "two.xml", plant / "budget.toml", tmp_path / "a.json")
    after = predicted(tmp_path / "saved/model.xml", plant / "budget.toml", tmp_path / "b.json")
    assert rows["sentences"] == []
    for number, budget in ((0, before), (1, after)):
        kind = ("drawn", "current")[number]
        (loop,), (wanted,) = rows["loops"], budget["margins"]["loops"]
        for name in ("crossover", "phase", "gain", "delay", "modulus"):
            assert loop[kind][name] == pytest.approx(wanted[name]["value"], rel=1e-6), name
        for row, error in zip(rows["errors"], budget["errors"], strict=True):
            assert row["name"] == error["name"]
    assert rows["loops"][0]["drawn"] != rows["loops"][0]["current"]
    assert all(row["drawn"]["rms"] != row["current"]["rms"] for row in rows["errors"])


def test_a_delay_takes_its_time_off_the_delay_margin_until_the_loop_is_unstable(plant, tmp_path):
    subject = open_subject(plant / "two.xml", (2.0, 45.0), None)
    study = StateStudy(subject, plant / "budget.toml")
    assert [loop.name for loop in study.loops] == ["axis"]

    def with_delay(seconds):
        delay = AddedDelay(name="delay1", loop="axis", delay=seconds)
        return study.study(replace(subject, edits=(delay,)), subject.first_state().add(delay))

    margin = study.study(subject, subject.first_state())["loops"][0]["current"]["delay"]
    late = with_delay(0.4 * margin)["loops"][0]["current"]
    assert late["delay"] == pytest.approx(0.6 * margin, rel=1e-4)
    unstable = with_delay(1.05 * margin)
    assert unstable["loops"][0]["current"]["unstable"] > 0
    assert unstable["errors"][0]["current"] is None
    assert "unstable" in unstable["sentences"][0]


def test_a_delay_is_saved_with_its_loop(tmp_path):
    place = write_servo_campaign(tmp_path)
    with (place / "campaign.toml").open("a", encoding="utf-8") as file:
        file.write(LOOP)
    subject = open_subject(place, None, None)
    makers = EditedMakers(subject, tmp_path)
    state = subject.first_state().add(AddedDelay(name="delay1", loop="pos", delay=2e-4))
    edited = makers.of(state).subject
    assert len(save_state(edited, state, ResultOptions(tmp_path / "saved"))) == 1
    saved = open_session(tmp_path / "saved", (edited.freq_hz[0], edited.freq_hz[-1]))
    (loop,) = saved.model.machine.loops
    assert loop.delay == pytest.approx(5e-4)
    for read, meant in zip(
        predict(saved.model, saved.model.drawn, saved.campaign),
        predict(edited.model, edited.model.drawn, edited.campaign),
        strict=True,
    ):
        np.testing.assert_allclose(read, meant, rtol=1e-8)


def test_a_machine_without_loops_has_nothing_to_study(model_subject):
    study = StateStudy(model_subject)
    assert (study.loops, study.is_wanted) == ((), False)
