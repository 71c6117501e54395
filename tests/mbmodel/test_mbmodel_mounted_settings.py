"""Compiler settings of two files that are combined hold for the bodies of their own file."""

import pytest
from mbmodel_examples import mass_on_spring, mjcf

from mbmodel import MountedStage, PointMass, combine, load_machine


@pytest.mark.parametrize(
    ("base", "stage"),
    [
        ('<compiler settotalmass="90"/>', ""),
        ("", '<compiler boundmass="9" boundinertia="0.3"/>'),
        ('<default><joint springdamper="0.02 0.1"/></default>', '<compiler settotalmass="7"/>'),
    ],
    ids=["total mass of the machine", "least mass of the stage", "springs by frequency"],
)
def test_settings_of_both_files_hold_for_their_own_bodies(from_text, tmp_path, base, stage):
    machine = from_text(mjcf(mass_on_spring(40, 4e6, 90), extra=base))
    top, out = tmp_path / "top.xml", tmp_path / "out"
    top.write_text(mjcf(mass_on_spring(4, 3e5, 9), extra=stage), encoding="utf-8")
    out.mkdir()
    alone = load_machine(top)
    combined = combine(
        machine, out, MountedStage(top, "a", (0, 0, 0)), [PointMass("a", 3.0, (0.0, 0.0, 0.0))]
    ).machine
    masses = [m.body_mass[0, 0] for m in (machine, alone)]
    assert combined.body_mass[0, 0] == pytest.approx(masses[0] + 3.0, rel=1e-9)
    assert combined.body_mass[6, 6] == pytest.approx(masses[1], rel=1e-9)
    expected = [s.stiffness for m in (machine, alone) for s in m.springs]
    assert [s.stiffness for s in combined.springs] == pytest.approx(expected, rel=1e-9)
