"""Tuned values written back: the same machine, with every other word of the file kept."""

import struct
import zlib
from xml.etree import ElementTree

import numpy as np
import pytest
from mbmodel_examples import (
    STATION,
    mass_on_spring,
    mjcf,
    random_request,
    random_tree,
    taut,
    worst_of_channels,
)

from identification.words import Dof, InputError
from mbmodel import (
    Edit,
    FrfRequest,
    Model,
    as_drawn,
    hammer_parts,
    linearise,
    load_machine,
    model_edits,
    sensor_parts,
    spring_parts,
    write_mjcf,
)

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
MESHED = (
    '<body name="meshed"><joint name="j" type="slide" axis="0 0 1" stiffness="1e4" damping="3"/>'
    '<geom type="mesh" mesh="t" density="1000"/></body>'
)


def edits_of(model, theta):
    return model_edits(model, theta)


def spring(name, **values):
    """One edit of a joint or tendon."""
    return [Edit("spring", name, values)]


def random_theta(model, seed=3):
    return model.drawn * np.exp(0.3 * np.random.default_rng(seed).normal(size=len(model.drawn)))


def assert_file_answers_as_model(model, theta, target, frf_request=None):
    frf_request = frf_request or random_request(model.machine, np.linspace(1, 250, 26))
    again = as_drawn(load_machine(target))
    expected = linearise(model, theta, frf_request).values
    assert worst_of_channels(linearise(again, again.drawn, frf_request).values, expected) < 1e-9


def test_the_written_station_answers_as_the_model_at_theta(station_model, away, tmp_path):
    target = tmp_path / "tuned.xml"
    assert write_mjcf(STATION, target, edits_of(station_model, away)) == ()
    assert_file_answers_as_model(station_model, away, target)


def test_written_numbers_are_exact(station_model, away, tmp_path):
    target = tmp_path / "tuned.xml"
    write_mjcf(STATION, target, edits_of(station_model, away))
    np.testing.assert_array_equal(as_drawn(load_machine(target)).drawn, away)


@pytest.mark.parametrize("seed", range(4))
def test_a_written_skew_tree_answers_as_the_model_at_theta(from_text, tmp_path, seed):
    model = as_drawn(from_text(random_tree(seed)))
    theta = random_theta(model)
    target = tmp_path / "tuned.xml"
    assert write_mjcf(model.machine.source, target, edits_of(model, theta)) == ()
    assert_file_answers_as_model(model, theta, target)


def test_tendons_are_written_too(from_text, tmp_path):
    text = mass_on_spring(2, 3e4, 4, name="a") + mass_on_spring(3, 5e4, 6, name="b", node=2)
    tendons = (
        '<tendon><fixed name="t" stiffness="7e3" damping="11"><joint joint="a_j" coef="2"/>'
        '<joint joint="b_j" coef="-3"/></fixed><spatial name="s" stiffness="4e3" damping="3">'
        '<site site="acc1"/><site site="anchor"/></spatial></tendon>'
    )
    anchored = mjcf('<site name="anchor" pos="0.3 0 0.4"/>' + text)
    model = as_drawn(from_text(anchored.replace("</mujoco>", tendons + "</mujoco>")))
    theta = random_theta(model)
    target = tmp_path / "tuned.xml"
    assert write_mjcf(model.machine.source, target, edits_of(model, theta)) == ()
    dofs = (Dof.parse("acc1:+tz"), Dof.parse("acc2:-tz"))
    frf_request = FrfRequest(np.linspace(1, 60, 20), dofs, dofs)
    assert_file_answers_as_model(model, theta, target, frf_request)


def test_a_written_taut_string_answers_as_the_model_at_theta(from_text, tmp_path):
    # Twice the stiffness at the same stretch is twice the tension, so twice the stiffness across.
    text, _ = taut(0.02)
    model = as_drawn(from_text(text))
    target = tmp_path / "tuned.xml"
    assert write_mjcf(model.machine.source, target, edits_of(model, 2 * model.drawn)) == ()
    dofs = (Dof.parse("acc1:+tx"), Dof.parse("acc1:+ty"))
    frf_request = FrfRequest(np.linspace(1, 60, 20), dofs, dofs)
    assert_file_answers_as_model(model, 2 * model.drawn, target, frf_request)


def test_only_the_named_attributes_change(tmp_path):
    target = tmp_path / "tuned.xml"
    write_mjcf(STATION, target, spring("tilt_tz", stiffness=1.5) + spring("ty_rx", damping=2.5))
    before, after = (list(ElementTree.parse(path).iter()) for path in (STATION, target))
    differing = {
        (b.get("name"), name)
        for a, b in zip(before, after, strict=True)
        for name in a.attrib.keys() | b.attrib.keys()
        if a.get(name) != b.get(name) or a.tag != b.tag
    }
    folders = {(None, "meshdir"), (None, "texturedir")}  # since the copy is elsewhere
    assert differing == {("tilt_tz", "stiffness"), ("ty_rx", "damping")} | folders


def test_comments_inside_the_file_survive(tmp_path):
    source, target = tmp_path / "m.xml", tmp_path / "tuned.xml"
    source.write_text(
        mjcf("<!-- the table, weighed -->" + mass_on_spring(4, 3e4, 7)), encoding="utf-8"
    )
    write_mjcf(source, target, spring("a_j", stiffness=4e4))
    assert "<!-- the table, weighed -->" in target.read_text(encoding="utf-8")


def test_the_comment_above_the_station_survives(tmp_path):
    # It says where the figures come from.
    target = tmp_path / "tuned.xml"
    write_mjcf(STATION, target, spring("tilt_tz", stiffness=1.5))
    assert "Where the figures come from" in target.read_text(encoding="utf-8")


def test_a_written_file_can_replace_its_source(tmp_path):
    path = tmp_path / "m.xml"
    path.write_text(mjcf(mass_on_spring(4, 3e4, 7)), encoding="utf-8")
    write_mjcf(path, path, spring("a_j", stiffness=4e4))
    assert load_machine(path).springs[0].stiffness == 4e4


def png():
    def chunk(kind, data):
        check = struct.pack(">I", zlib.crc32(kind + data))
        return struct.pack(">I", len(data)) + kind + data + check

    rows = zlib.compress(b"\0\x10\x20\x30" * 1)
    head = struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


@pytest.fixture
def folders(tmp_path):
    """A folder with a mesh, a picture and a sub-model, and another one to move to."""
    source, target = tmp_path / "drawn", tmp_path / "tuned" / "deep"
    (source / "meshes").mkdir(parents=True)
    target.mkdir(parents=True)
    (source / "meshes" / "t.obj").write_text(TETRAHEDRON, encoding="utf-8")
    (source / "skin.png").write_bytes(png())
    cover = '<body name="cover"><geom size="0.1" contype="0" conaffinity="0"/></body>'
    (source / "part.xml").write_text(
        f'<mujoco><compiler meshdir="meshes"/><asset>{DIRECT}</asset></mujoco>', encoding="utf-8"
    )
    (source / "cover.xml").write_text(mjcf(cover), encoding="utf-8")
    return source, target


MESH = '<mesh name="t" file="meshes/t.obj"/>'
DIRECT = '<mesh name="t" file="t.obj"/>'
CUBE = " ".join(f'file{side}="skin.png"' for side in ("right", "left", "up", "down", "front"))
ASSETS = {
    "two compiler elements": (
        '<compiler angle="radian"/><compiler meshdir="meshes"/>',
        DIRECT,
        MESHED,
    ),
    "a relative mesh": ("", MESH, MESHED),
    "a folder of meshes": ('<compiler meshdir="meshes"/>', DIRECT, MESHED),
    "a folder of assets": ('<compiler assetdir="meshes"/>', DIRECT, MESHED),
    "a mesh and a picture": ("", MESH + '<texture name="x" type="2d" file="skin.png"/>', MESHED),
    "a folder of pictures": (
        '<compiler texturedir="."/>',
        MESH + '<texture name="x" type="2d" file="skin.png"/>',
        MESHED,
    ),
    "a folder of meshes and a picture": (
        '<compiler meshdir="meshes"/>',
        DIRECT + '<texture name="x" type="2d" file="skin.png"/>',
        MESHED,
    ),
    "a picture for each side": (
        "",
        MESH + f'<texture name="x" type="cube" {CUBE} fileback="skin.png"/>',
        MESHED,
    ),
    "an included file with meshes": ("", '</asset><include file="part.xml"/><asset>', MESHED),
    "an attached model": (
        "",
        MESH + '<model name="sub" file="cover.xml"/>',
        MESHED.replace("</body>", '<attach model="sub" body="cover" prefix="c_"/></body>'),
    ),
}


@pytest.mark.parametrize("case", ASSETS)
def test_a_machine_moved_to_another_folder_still_compiles(folders, case):
    source, target = folders
    compiler, assets, body = ASSETS[case]
    path = source / "m.xml"
    path.write_text(
        f'<mujoco>{compiler}<option gravity="0 0 0"/><asset>{assets}</asset>'
        f"<worldbody>{body}</worldbody></mujoco>",
        encoding="utf-8",
    )
    mass = load_machine(path).mass
    assert write_mjcf(path, target / "m.xml", spring("j", stiffness=2e4)) == ()
    moved = load_machine(target / "m.xml")
    assert moved.springs[0].stiffness == 2e4
    np.testing.assert_allclose(moved.mass, mass, rtol=1e-12)
    # A copy states its folders beside those of an included file, which must not win.
    again = source.parent / "again"
    again.mkdir()
    for expanded in (False, True):
        write_mjcf(target / "m.xml", again / "m.xml", (), expanded=expanded)
        np.testing.assert_allclose(load_machine(again / "m.xml").mass, mass, rtol=1e-12)


def test_paths_relative_to_the_working_folder_are_understood(folders, monkeypatch):
    source, target = folders
    path = source / "m.xml"
    path.write_text(mjcf(MESHED, extra=f"<asset>{MESH}</asset>"), encoding="utf-8")
    monkeypatch.chdir(source)
    target = (target / "m.xml").relative_to(source.parent)
    write_mjcf(path.relative_to(source), source / ".." / target, spring("j", stiffness=2e4))
    assert load_machine(source.parent / target).springs[0].stiffness == 2e4


def test_joints_without_a_name_are_reported_as_not_in_the_mjcf(from_text, tmp_path):
    model = as_drawn(from_text(mjcf(mass_on_spring(4, 3e4, 7)).replace('name="a_j"', "")))
    names = [parameter.name for parameter in model.parameters]
    not_written = write_mjcf(
        model.machine.source, tmp_path / "m.xml", edits_of(model, model.drawn * 2)
    )
    assert (
        [missing.name for missing in not_written]
        == names
        == ["a_joint0.stiffness", "a_joint0.damping"]
    )


def test_joints_in_an_included_file_are_reported_as_not_in_the_mjcf(folders):
    source, target = folders
    (source / "part.xml").write_text(
        f"<mujocoinclude><asset>{MESH}</asset><worldbody>{MESHED}</worldbody></mujocoinclude>",
        encoding="utf-8",
    )
    path = source / "m.xml"
    text = mjcf(mass_on_spring(4, 3e4, 7), extra='<include file="part.xml"/>')
    path.write_text(text, encoding="utf-8")
    edits = spring("j", stiffness=2e4) + spring("a_j", stiffness=5e4)
    (missing,) = write_mjcf(path, target / "m.xml", edits)
    assert missing.name == "j.stiffness"
    assert "the file itself has no element" in str(missing)
    moved = {spring.name: spring.stiffness for spring in load_machine(target / "m.xml").springs}
    assert moved == {"j": 1e4, "a_j": 5e4}


def test_a_hardening_springs_higher_terms_survive(tmp_path):
    # MuJoCo's stiffness may be a polynomial; only its linear term is the parameter.
    source, target = tmp_path / "m.xml", tmp_path / "tuned.xml"
    text = mjcf(mass_on_spring(4, 3e4, 7), gravity="0 0 -9.81")
    source.write_text(text.replace('stiffness="30000"', 'stiffness="3e4 0 5e9"'), encoding="utf-8")
    before = load_machine(source).remaining_stiffness
    assert before[0, 0] > 1e3
    assert write_mjcf(source, target, spring("a_j", stiffness=3e4)) == ()
    np.testing.assert_allclose(load_machine(target).remaining_stiffness, before, rtol=1e-9)


@pytest.mark.parametrize("text", [None, "<mujoco>"])
def test_a_source_that_cannot_be_read_again_is_refused(tmp_path, text):
    source = tmp_path / "gone.xml"
    if text is not None:
        source.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"gone\.xml cannot be read again"):
        write_mjcf(source, tmp_path / "m.xml", spring("j", stiffness=1.0))


def test_the_hammer_stays_where_it_is_drawn_if_the_sensor_there_moves(station_model, tmp_path):
    # acc11 is sensor and hammer point in one: moved as a sensor, it leaves a hit11 behind.
    machine = station_model.machine
    hit = tuple(Dof.of("acc11", axis) for axis in range(3))
    model = Model(
        machine,
        (*spring_parts(machine), *sensor_parts(machine), *hammer_parts(machine, hit)),
    )
    theta = model.drawn.copy()
    names = [parameter.name for parameter in model.parameters]
    theta[names.index("acc11.rotation_y")] = 0.05
    theta[names.index("acc11.position_x")] = 0.004
    target = tmp_path / "tuned.xml"
    assert write_mjcf(STATION, target, model_edits(model, theta)) == ()
    again = as_drawn(load_machine(target))
    freq, outputs = np.linspace(5, 200, 14), tuple(Dof.of("acc11", axis) for axis in range(3))
    expected = linearise(model, theta, FrfRequest(freq, outputs, hit)).values
    hammer = tuple(Dof.of("hit11", axis) for axis in range(3))
    values = linearise(again, again.drawn, FrfRequest(freq, outputs, hammer)).values
    assert worst_of_channels(values, expected) < 1e-9
    moved = linearise(again, again.drawn, FrfRequest(freq, outputs, hit)).values
    assert worst_of_channels(moved, expected) > 1e-3


def test_a_copy_and_its_meshes_can_move_together(folders):
    source, target = folders
    path = source / "m.xml"
    path.write_text(mjcf(MESHED, extra=f"<asset>{MESH}</asset>"), encoding="utf-8")
    staging = target / ".writing-1"
    staging.mkdir()
    write_mjcf(path, staging / "m.xml", spring("j", stiffness=2e4), target)
    (staging / "m.xml").rename(target / "m.xml")
    source.parent.rename(source.parent.with_name("elsewhere"))
    moved = source.parent.with_name("elsewhere") / "tuned" / "deep" / "m.xml"
    assert load_machine(moved).springs[0].stiffness == 2e4


def test_a_copy_of_a_copy_names_no_folder_between_them(tmp_path):
    between, target = tmp_path / "third_folder", tmp_path / "deep" / "target"
    between.mkdir()
    target.mkdir(parents=True)
    write_mjcf(STATION, between / "model.xml", ())
    write_mjcf(between / "model.xml", target / "model.xml", ())
    assert "third_folder" not in (target / "model.xml").read_text(encoding="utf-8")
    (between / "model.xml").unlink()
    between.rmdir()
    assert len(load_machine(target / "model.xml").layout.bodies) == len(
        load_machine(STATION).layout.bodies
    )
