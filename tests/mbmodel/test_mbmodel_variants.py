"""Variants of a machine: a known mass, a stage elsewhere; exact against machines written anew."""

import re

import numpy as np
import pytest
from encoder_campaign import write_axis

from identification.words import Condition, Dof, InputError
from mbmodel import (
    Evaluator,
    FrfRequest,
    Model,
    add_bending_mode,
    body_parts,
    hammer_parts,
    joint_parts,
    load_machine,
    model_edits,
    parse_input,
    parse_output,
    release_rigid_directions,
    sensor_parts,
    spring_parts,
    with_variants,
    write_mjcf,
)

PAYLOAD = (
    '<body name="payload" pos="0.1 0.05 0.15"><inertial pos="0 0 0.02" mass="5" '
    'diaginertia="0.03 0.04 0.05"/></body>'
)
POSES = {"slide": {"carriage_tx": 0.08}, "turned": {"carriage_tx": -0.05, "frame_ry": 0.3}}
FREQ = np.linspace(6.0, 160.0, 9)
OUTPUTS = ("acc1:+tx", "acc2:+tx", "acc2:+tz", "encoder", "head-acc1:+tx")
INPUTS = ("drive", "hit1:+tz", "coil-magnet:+tx")


def loaded_text(text):
    head, tail = text.split('<site name="acc2"')
    return f'{head}{PAYLOAD}<site name="acc2"{tail}'


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("variants")
    write_axis(folder / "model.xml")
    text = (folder / "model.xml").read_text(encoding="utf-8")
    (folder / "loaded.xml").write_text(loaded_text(text), encoding="utf-8")
    nominal = load_machine(folder / "model.xml")
    variants = {"loaded": load_machine(folder / "loaded.xml")}
    variants |= {
        name: load_machine(folder / "model.xml", pose=pose) for name, pose in POSES.items()
    }
    variants["both"] = load_machine(folder / "loaded.xml", pose=POSES["turned"])
    return with_variants(nominal, variants)


def condition(name):
    return Condition("t.npz", Dof.parse("hit1:+tz"), variant=name)


def request_of(machine):
    return FrfRequest(
        FREQ,
        tuple(parse_output(machine, text) for text in OUTPUTS),
        tuple(parse_input(machine, text) for text in INPUTS),
    )


def whole_model(machine):
    return Model(
        machine,
        (
            *spring_parts(machine),
            *body_parts(machine),
            *joint_parts(machine),
            *sensor_parts(machine, (), ()),
            *hammer_parts(machine, (Dof.parse("hit1:+tz"),)),
        ),
    )


def moved_theta(model, seed=2):
    random = np.random.default_rng(seed)
    theta = model.drawn.copy()
    for k, parameter in enumerate(model.parameters):
        if parameter.positive and parameter.drawn:
            theta[k] *= 1 + 0.1 * random.uniform(-1, 1)
        elif not parameter.positive:
            size = 0.02 if parameter.unit == "rad" else 0.004
            theta[k] += size * random.uniform(-1, 1) * (parameter.unit != "s")
    return theta


@pytest.mark.parametrize("name", ["loaded", "slide", "turned", "both"])
def test_a_variant_at_other_parameters_is_the_machine_written_anew(machine, name, tmp_path):
    model = Model(machine, (*spring_parts(machine), *body_parts(machine), *joint_parts(machine)))
    theta = moved_theta(model)
    # A pose moves stages along the drawn axes; tolerances of joints act there.
    for k, parameter in enumerate(model.parameters):
        is_turned = "joint_rotation" in parameter.name and name != "loaded"
        is_displaced = "joint_position" in parameter.name and name in ("turned", "both")
        theta[k] *= not (is_turned or is_displaced)
    target = tmp_path / "tuned.xml"
    assert not write_mjcf(machine.source, target, model_edits(model, theta))
    if name in ("loaded", "both"):
        target.write_text(loaded_text(target.read_text(encoding="utf-8")), encoding="utf-8")
    twin = load_machine(target, pose=POSES.get("turned" if name == "both" else name))
    expected = Evaluator(Model(twin, spring_parts(twin)), request_of(twin))
    values = Evaluator(model, request_of(machine), condition=condition(name)).at(theta).values
    twin_values = expected.at(Model(twin, spring_parts(twin)).drawn).values
    assert np.abs(values / twin_values - 1).max() < 1e-7
    nominal = Evaluator(model, request_of(machine)).at(theta).values
    assert np.abs(nominal / twin_values - 1).max() > 1e-3, "the variant matters"


@pytest.mark.parametrize("name", ["loaded", "turned"])
def test_slopes_in_a_variant_are_differences(machine, name):
    model = whole_model(machine)
    theta = moved_theta(model)
    evaluator = Evaluator(model, request_of(machine), condition=condition(name), direct=True)
    lines = Evaluator(model, request_of(machine), condition=condition(name)).at(theta)
    columns, values = lines.columns(), lines.values
    peak = np.abs(values).max(axis=0)
    for k, parameter in enumerate(model.parameters):
        step = 2e-4 * abs(theta[k]) if parameter.positive else 1e-5

        def at(scale, k=k, step=step):
            moved = theta.copy()
            moved[k] += scale * step
            return evaluator.at(moved).values

        expected = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step)
        size = max((np.abs(expected) / peak).max(), 1e-4 / (step / 2e-4))
        assert (np.abs(columns[..., k] - expected) / peak).max() < 1e-6 * size, parameter.name
    random = np.random.default_rng(3).normal(size=(2, *values.shape))
    cotangent = random[0] + 1j * random[1]
    gradient = np.einsum("foi,foip->p", cotangent.conj(), columns).real
    assert lines.gradient(cotangent) == pytest.approx(gradient, rel=1e-8, abs=1e-12)


def test_variants_follow_released_directions_and_bending_bodies(machine):
    released, rigid = release_rigid_directions(
        with_variants(machine, {name: machine.variants[name] for name in ("loaded", "slide")}),
        160.0,
    )
    bent = add_bending_mode(released, "carriage")
    for variant in bent.variants.values():
        assert variant.coordinates == bent.coordinates
        assert variant.layout.bodies == bent.layout.bodies
        for locked in rigid:
            k = locked.coordinate
            assert variant.remaining_stiffness[k, k] == locked.stiffness


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: text.replace("carriage_ry", "carriage_rot"), r"its joints are not those"),
        (
            lambda text: re.sub(r'(carriage_tx"[^>]*) stiffness="[^"]*"', r"\1", text),
            r"springs and dampers",
        ),
    ],
)
def test_a_variant_with_other_joints_or_springs_is_refused(machine, tmp_path, change, reason):
    text = change(machine.source.read_text(encoding="utf-8"))
    (tmp_path / "other.xml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=reason):
        with_variants(machine, {"other": load_machine(tmp_path / "other.xml")})


def test_poses_that_cannot_be_taken_are_refused(machine, tmp_path):
    with pytest.raises(InputError, match=r"pose names 'spindle', which is no slide or hinge"):
        load_machine(machine.source, pose={"spindle": 0.1})
    text = machine.source.read_text(encoding="utf-8").replace(
        '<joint name="carriage_tx" type="slide"',
        '<joint name="carriage_tx" type="slide" limited="true" range="-0.1 0.1"',
    )
    (tmp_path / "limited.xml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"beyond the joint's range -0\.1 to 0\.1"):
        load_machine(tmp_path / "limited.xml", pose={"carriage_tx": 0.3})
    held = machine.source.read_text(encoding="utf-8").replace(
        "</actuator>", '<position name="servo" joint="carriage_tx" kp="1e6"/></actuator>'
    )
    (tmp_path / "held.xml").write_text(held, encoding="utf-8")
    with pytest.raises(InputError, match="pulls it back"):
        load_machine(tmp_path / "held.xml", pose={"carriage_tx": 0.05})
