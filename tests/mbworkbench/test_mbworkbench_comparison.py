"""``mb.compare``: two visits with the change, two machines, a fleet."""

import shutil

import pytest

import mbworkbench as mb
from tests.helpers.changed_chain import BEFORE, write_visits


def test_two_visits_have_modes_frfs_and_the_change(tmp_path):
    first, second = write_visits(tmp_path, factor=1.003)
    steps = []
    result = mb.compare(first, mb.read_campaign(second), progress=steps.append)
    assert steps
    cause = result.diagnosis.verdict.causes[0]
    assert (cause.effect, cause.location) == ("stiffness", "joint:high")
    assert "Another stiffness at joint high, along x" in result.sentence
    assert result.sentence in repr(result)
    frame = result.to_pandas()
    assert list(frame["changed"]) == [False, False, True]
    assert len(result.plot().data) == 2
    assert result.frf_differences[0].over_noise > 10
    assert "<table>" in result._repr_html_()


def test_two_machines_and_a_fleet_are_compared_without_a_diagnosis(tmp_path):
    first, second = write_visits(tmp_path, after=BEFORE, factor=1.003)
    third = tmp_path / "third"
    shutil.copytree(second, third)
    pair = mb.compare(first, second, two_machines=True, diagnosis=False)
    assert pair.diagnosis is None
    assert all(frequency.is_change for frequency, _ in pair.shifts)
    fleet = mb.compare(first, second, third)
    assert "in all 3 tests" in fleet.sentence
    assert list(fleet.to_pandas()["tests"]) == [3, 3, 3]
    with pytest.raises(mb.UsageError, match="a fleet has no shifts"):
        _ = fleet.shifts


def test_one_campaign_and_campaigns_that_differ_are_refused(tmp_path):
    first, second = write_visits(tmp_path)
    with pytest.raises(mb.UsageError, match="needs two campaigns"):
        mb.compare(first)
    file = second / "campaign.toml"
    file.write_text(file.read_text() + "[tolerance]\nmass = 0.05\n")
    with pytest.raises(mb.InputError, match=r"differ in tolerance.mass: make them agree"):
        mb.compare(first, second)
