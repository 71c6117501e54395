"""Two programs that know nothing of each other answer alike, from one file."""

import numpy as np
import pytest

from identification.words import Dof
from mbmodel import FrfRequest, as_drawn, linearise, load_machine
from tests.helpers.truth_ports import joint_row, plant_receptance, point_row
from truth.campaign.draw import NO_TOLERANCE, draw_basis, draw_drawing, draw_hammers, draw_rigid
from truth.campaign.file_formats import model_xml
from truth.errors import TruthError
from truth.machine.mjcf_reader import read_station
from truth.machine.random_tree import draw_tree
from truth.machine.rig import Prepared, accelerance, build

FREQ = np.linspace(0, 200, 201)
AXES = "xyz"


def machines(nominal):
    basis = draw_rigid(draw_basis(nominal, 31), 2, 31)
    return {
        "station": draw_drawing(basis, 31),
        "tree of 3": draw_tree(40, 3),
        "tree of 6": draw_tree(41, 6),
        "tree of 10": draw_tree(42, 10),
    }


@pytest.mark.parametrize("name", ["station", "tree of 3", "tree of 6", "tree of 10"])
def test_both_give_the_same_frfs_to_nine_digits(name, nominal, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(model_xml(machines(nominal)[name]))
    for mesh in nominal.meshes:
        (tmp_path / "meshes").mkdir(exist_ok=True)
        (tmp_path / "meshes" / mesh.file).write_bytes(mesh.content)
    station = read_station(path)
    node = station.first_aim()
    hammers = draw_hammers(station, node, NO_TOLERANCE, 1)
    ours = accelerance(build(Prepared(station, hammers)), FREQ)
    hits = [hit.node for stage in station.stages for hit in stage.hit_points]
    site = f"hit{node}" if node in hits else f"acc{node}"
    model = as_drawn(load_machine(path))
    question = FrfRequest(
        FREQ,
        tuple(Dof.of(f"acc{one.node}", axis) for _, one in station.sensors() for axis in range(3)),
        tuple(Dof.of(site, axis) for axis in range(3)),
    )
    theirs = linearise(model, model.drawn, question).values
    peak = np.abs(ours).max(axis=0)
    assert (np.abs(ours - theirs) / peak).max() < 1e-9


@pytest.mark.parametrize("name", ["station", "tree of 6"])
def test_both_give_the_same_plant_between_joints_points_and_pairs(name, nominal, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(model_xml(machines(nominal)[name]))
    for mesh in nominal.meshes:
        (tmp_path / "meshes").mkdir(exist_ok=True)
        (tmp_path / "meshes" / mesh.file).write_bytes(mesh.content)
    tested = Prepared(read_station(path), ())
    stages = tested.station.stages
    joints = [stage.joints[k % len(stage.joints)].name for k, stage in enumerate(stages)]
    (_, low), (_, high) = (list(tested.station.sensors())[k] for k in (0, -1))
    owners = [
        stages[k].name for k, one in tested.station.sensors() if one.node in (low.node, high.node)
    ]
    rows = [joint_row(tested, name) for name in joints]
    ends = [
        [point_row(tested, owner, sensor.position, axis) for axis in range(3)]
        for owner, sensor in zip(owners, (low, high), strict=True)
    ]
    rows += ends[1] + [upper - lower for lower, upper in zip(*ends, strict=True)]
    labels = [f"joint:{name}" for name in joints]
    labels += [f"acc{high.node}:+t{axis}" for axis in AXES]
    labels += [f"acc{high.node}-acc{low.node}:+t{axis}" for axis in AXES]
    model = as_drawn(load_machine(path))
    ports = tuple(model.machine.layout.parse(label) for label in labels)
    theirs = linearise(model, model.drawn, FrfRequest(FREQ[1:], ports, ports, "receptance")).values
    ours = plant_receptance(build(tested), rows, rows, FREQ[1:])
    assert (np.abs(ours - theirs) / np.abs(ours).max(axis=0)).max() < 1e-9
    with pytest.raises(TruthError, match="no stage has this joint"):
        joint_row(tested, "elsewhere")
