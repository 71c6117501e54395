"""MuJoCo's warnings leave no file and no line; a motion without mass is refused by name."""

import re

import pytest
from small_machine import MJCF

from identification.words import InputError
from mbmodel import load_machine

FAR = MJCF.replace('pos="0 0 0.1" stiffness="4e6"', 'pos="0 0 2e9" stiffness="4e6"')
# Two slides of one body whose axes differ by 1e-8 rad.
TWINS = MJCF.replace('type="slide" axis="0 0 1" pos', 'type="slide" axis="1 0 1e-8" pos')


@pytest.mark.parametrize("text", [FAR, TWINS])
def test_a_motion_without_mass_is_refused_and_nothing_is_written(
    text, tmp_path, monkeypatch, capfd
):
    assert text != MJCF
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.xml").write_text(text)
    with pytest.raises(InputError, match=re.escape("without moving any mass")) as caught:
        load_machine(tmp_path / "model.xml")
    assert "joint 'base_t" in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["model.xml"]
    assert capfd.readouterr() == ("", "")
