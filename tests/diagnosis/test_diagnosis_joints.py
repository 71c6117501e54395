"""Effects of joints whose springs are few, missing or drawn the other way round."""

import re

import numpy as np

from diagnosis import EFFECTS, Scene
from diagnosis.refits.refitting import add_hypotheses
from mbmodel import Model
from tests.helpers.drawn import drawn, line_by_line
from tuning import open_session


def freed(tmp_path, sizes):
    """A machine one slide of which is drawn without these sizes, and its couplings by place."""
    folder = tmp_path / "campaign"
    drawn(tmp_path, 72_001, lines=61)
    text = (folder / "model.xml").read_text()
    at = text.index('name="stage3_tx"')
    end = text.index("/>", at)
    zero = re.sub(rf'({sizes})="[^"]*"', r'\1="0"', text[at:end])
    (folder / "model.xml").write_text(text[:at] + zero + text[end:])
    session = open_session(folder)
    scene = Scene(session, session.model.drawn)
    return scene, {one.location: one for one in EFFECTS["joint_coupling"](scene)}


def test_a_slide_without_stiffness_couples_nothing(tmp_path):
    scene, made = freed(tmp_path, "stiffness|damping")
    assert len(made["joint:stage2"].follow) == 6
    assert sorted(made["joint:stage3"].follow.values()) == [
        "stage3_ty.damping",
        "stage3_ty.stiffness",
        "stage3_tz.damping",
        "stage3_tz.stiffness",
    ]
    for one in made.values():
        add_hypotheses(scene.session, one)


def test_a_free_drive_with_a_damper_couples_by_that(tmp_path):
    _, made = freed(tmp_path, "stiffness")
    follow = made["joint:stage3"].follow.values()
    assert "stage3_tx.damping" in follow
    assert "stage3_tx.stiffness" not in follow


def test_supports_of_a_joint_drawn_along_minus_x_lose_the_same(tmp_path):
    folder = tmp_path / "campaign"
    drawn(tmp_path, 72_001, lines=61)
    answers, lost = [], np.array([0.7, 0.2, 0.0, 0.4])
    for turned in (False, True):
        if turned:
            text = (folder / "model.xml").read_text()
            for joint in ("stage2_tx", "stage2_ry"):
                at = text.index(f'name="{joint}"')
                text = text[:at] + re.sub(
                    r'axis="([^"]*)"', lambda found: minus(found[1]), text[at:], count=1
                )
            (folder / "model.xml").write_text(text)
        session = open_session(folder)
        scene = Scene(session, session.model.drawn)
        one = next(o for o in EFFECTS["support_loss"](scene) if o.location == "joint:stage2")
        model = Model(session.model.machine, (*session.model.parts, *one.parts))
        theta = model.drawn.copy()
        names = [parameter.name for parameter in model.parameters]
        theta[[names.index(name) for name in one.coordinates]] = lost
        answers.append(line_by_line(model, theta, session.campaign))
    np.testing.assert_allclose(answers[1], answers[0], atol=1e-9 * np.abs(answers[0]).max())


def minus(axis: str) -> str:
    return 'axis="{} {} {}"'.format(*(-float(x) for x in axis.split()))
