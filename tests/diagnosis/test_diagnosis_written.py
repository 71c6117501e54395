"""Effects written into an MJCF: MuJoCo reads them, and the machine answers as with the Part."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import EFFECTS, Scene
from diagnosis.stated_values import Vague
from identification.words import Condition
from mbmodel import (
    Model,
    NotInMjcf,
    WrittenModel,
    as_drawn,
    load_machine,
    model_edits,
    read_as_written,
    release_rigid_directions,
    write_model,
)
from tests.helpers.drawn import drawn, line_by_line
from tuning import build_toleranced_model
from tuning.assessment.effect_slopes import find_effect_slopes

FREQ = np.arange(4.0, 160.0, 1.0)
WRITTEN = (
    "appendage",
    "inertance",
    "joint_coupling",
    "mass_error",
    "missing_dof",
    "parallel_path",
    "support_loss",
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A tree without one of its hinges, what it holds rigid loosened."""
    folder = tmp_path_factory.mktemp("written")
    session, _ = drawn(folder, 72_001, lines=161)
    path = folder / "campaign" / "model.xml"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(line for line in lines if 'name="stage2_ry"' not in line))
    machine, held = release_rigid_directions(load_machine(path), FREQ[-1])
    session = replace(session, model=build_toleranced_model(machine, session.campaign))
    return Scene(session, session.model.drawn * 1.0, held)


def sized(scene, one):
    """The model with a hypothesis, and theta with a size that shows."""
    plain = scene.session.model
    model = Model(plain.machine, (*plain.parts, *one.parts))
    theta = model.drawn.copy()
    own = {parameter.name: k for k, parameter in enumerate(model.parameters)}
    random = np.random.default_rng(3)
    for name in one.coordinates:
        theta[own[name]] = random.uniform(0.2, 0.9) if one.signed else random.uniform(-3.0, 3.0)
    for part in one.parts:
        for parameter in part.parameters:  # place, frequency, damping
            if parameter.name not in (*one.coordinates, *one.follow):
                theta[own[parameter.name]] = random.uniform(0.2, 0.9)
    if one.effect == "parallel_path":  # what turns its axes leaves no spring less than nothing
        turned = [name for name in own if name.rpartition("_")[2] in ("yz", "xz", "xy")]
        theta[[own[name] for name in turned]] *= 0.1
    if one.effect == "mass_error":
        theta[[own[name] for name in own if "_mass_" in name]] = 5.0
    if one.effect == "appendage":  # along all axes; a test of its own has the rigid part
        theta[[own[name] for name in own if name.endswith((".across", ".counted"))]] = 0.0
        theta[[own[name] for name in own if name.endswith(".slack")]] = 1.0
    if one.effect == "missing_dof":
        theta[own[one.coordinates[0]]] = 1e3
    return model, theta


def answers(scene, model, theta, target):
    """FRFs of the model, and of the MJCF that is written of it."""
    assert write_model(model, theta, target) == WrittenModel(target.name)
    machine = as_drawn(load_machine(target))
    return (
        line_by_line(model, theta, scene.session.campaign, FREQ),
        line_by_line(machine, machine.drawn, scene.session.campaign, FREQ),
    )


def test_a_direction_that_gives_way_is_written_where_its_joint_is_tuned_to(scene, tmp_path):
    one = next(one for one in EFFECTS["missing_dof"](scene) if one.location == "joint:stage2")
    model, theta = sized(scene, one)
    own = {parameter.name: k for k, parameter in enumerate(model.parameters)}
    for axis, value in zip("xyz", (0.003, -0.004, 0.005), strict=True):
        theta[own[f"stage2.joint_position_{axis}"]] = value
    theta[own["stage2.joint_rotation_x"]] = 0.02
    expected, found = answers(scene, model, theta, tmp_path / "moved.xml")
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_what_moves_along_one_axis_is_hung_at_the_nearest_place_on_it(scene, tmp_path):
    one = next(one for one in EFFECTS["appendage"](scene))
    model, theta = sized(scene, one)
    own = {parameter.name: k for k, parameter in enumerate(model.parameters)}
    x, y, z = (own[name] for name in one.scored)
    theta[x], theta[y], theta[z] = 3.0, 1e-6, 0.0
    place = [name for part in one.parts for p in part.parameters if "position" in (name := p.name)]
    theta[[own[name] for name in place]] = 40.0, 0.2, -0.1
    rigid = [name for name in own if name.endswith((".across", ".counted"))]
    theta[[own[name] for name in rigid]] = 0.0
    theta = model.without_small_sizes(theta)
    assert theta[y] == 0.0  # a millionth of the largest is no mass along y
    expected, found = answers(scene, model, theta, tmp_path / "hung.xml")
    assert (
        np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()
    )  # locked directions give way by 1e-5
    body = one.location.partition(":")[2]
    added = [edit for edit in model_edits(model, theta) if "appendage" in edit.name]
    assert {edit.name.removesuffix(".a") for edit in added} == {f"{body}.appendage_x"}
    drawing = model.machine.drawing.bodies[body]
    (site,) = [edit for edit in added if edit.parent == body]
    at = drawing.origin + drawing.frame @ site.element.values["pos"]
    centre = model.machine.layout.centres[model.machine.layout.bodies.index(body)]
    np.testing.assert_allclose(at - centre, [0.0, 0.02, -0.01], atol=1e-12)
    said = one.state({name: theta[k] for name, k in own.items()})["position"]
    assert isinstance(said, Vague)
    np.testing.assert_allclose(said, at - centre, atol=1e-12)


@pytest.mark.parametrize("second", [0.0, 1.5], ids=["one axis", "two axes"])
@pytest.mark.parametrize(("across", "counted"), [(1.0, 0.0), (1.0, 1.0), (0.4, 0.3)])
def test_a_box_that_is_rigid_across_its_axes_is_felt_there_as_a_mass(
    scene, tmp_path, across, counted, second
):
    hypothesis = next(iter(EFFECTS["appendage"](scene)))
    model, theta = sized(scene, hypothesis)
    places = {parameter.name: k for k, parameter in enumerate(model.parameters)}
    appendage = hypothesis.scored[0].removesuffix(".mass_x")
    numbers = {"mass_x": 3.0, "mass_y": second, "mass_z": 0.0}
    numbers |= {"across": across, "counted": counted}
    numbers |= {"position_x": 0.5, "position_y": 0.2, "position_z": -0.1}
    for name, value in numbers.items():
        theta[places[f"{appendage}.{name}"]] = value
    expected, written = answers(scene, model, theta, tmp_path / "box.xml")
    assert (
        np.abs(written - expected).max() < 1e-5 * np.abs(expected).max()
    )  # locked directions give way by 1e-5
    if second:
        return
    position = hypothesis.state({name: theta[k] for name, k in places.items()})["position"]
    np.testing.assert_allclose(position, [0.05 if across == 1.0 else 0.0, 0.02, -0.01], atol=1e-12)


def test_every_link_is_springs_and_dampers_that_mjcf_holds(scene):
    one = next(iter(EFFECTS["parallel_path"](scene)))
    (part,) = one.parts
    random = np.random.default_rng(2)
    for _ in range(20):
        theta = np.append(random.uniform(0, 1, 6), random.uniform(-1, 1, 6))
        said = part.write(theta)
        assert not any(isinstance(edit, NotInMjcf) for edit in said)
        assert sum(getattr(edit, "parent", "") == "tendon" for edit in said) == 3


@pytest.mark.parametrize("effect", WRITTEN)
def test_the_augmented_mjcf_answers_as_the_model_with_the_part(scene, effect, tmp_path):
    proposed = [one for one in EFFECTS[effect](scene) if one.parts]
    assert proposed
    for number, one in enumerate(proposed[:: max(1, len(proposed) // 3)]):
        model, theta = sized(scene, one)
        expected, found = answers(scene, model, theta, tmp_path / f"{effect}{number}.xml")
        rigid = load_machine(model.machine.source)
        without = line_by_line(as_drawn(rigid), as_drawn(rigid).drawn, scene.session.campaign, FREQ)
        largest = np.abs(expected).max()
        assert np.abs(found - expected).max() < 2e-3 * np.abs(without - expected).max()
        assert np.abs(without - expected).max() > 1e-3 * largest


def test_what_no_mjcf_holds_is_said_with_its_reason(scene):
    condition = scene.session.campaign.tests[0].condition
    assert isinstance(condition, Condition)
    for effect, reason in (
        ("gyroscopic", "let it spin"),
        ("structural_damping", "depends on frequency"),
        ("viscoelastic", "depends on frequency"),
        ("feedback_delay", "depends on frequency"),
        ("drift", "in some tests only"),
    ):
        one = next(one for one in EFFECTS[effect](scene) if one.parts)
        model, theta = sized(scene, one)
        said = [str(edit) for edit in model_edits(model, theta)]
        assert any(reason in text for text in said), (effect, said)


@pytest.mark.parametrize("effect", WRITTEN)
def test_a_parameter_of_an_effect_changes_the_machine_of_the_file_as_in_memory(scene, effect):
    # FRFs by central differences in memory, against the file with the matrices that were measured
    hypothesis = next(iter(EFFECTS[effect](scene)))
    model, theta = sized(scene, hypothesis)
    names = [parameter.name for parameter in model.parameters]
    added = [p.name for part in hypothesis.parts for p in part.parameters]
    steps = {name: 1e-4 * max(1.0, abs(theta[names.index(name)])) for name in added}
    written = read_as_written(model, theta)
    slopes = find_effect_slopes(model, theta, steps, written)
    assert slopes.names
    drawn_parts = as_drawn(written)
    plant = Model(written, (*drawn_parts.parts, slopes.part(written)))
    random = np.random.default_rng(5)
    change = {name: step * random.uniform(0.5, 1.5) for name, step in steps.items()}
    in_memory = np.zeros(len(theta))
    in_memory[[names.index(name) for name in added]] = list(change.values())
    in_file = np.append(np.zeros(len(drawn_parts.drawn)), [change[name] for name in slopes.names])
    campaign = scene.session.campaign
    expected, found = (
        line_by_line(moved, start + step, campaign, FREQ)
        - line_by_line(moved, start - step, campaign, FREQ)
        for moved, start, step in ((model, theta, in_memory), (plant, plant.drawn, in_file))
    )
    assert np.abs(found - expected).max() < 2e-3 * np.abs(expected).max()
