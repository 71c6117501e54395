"""Terms with a dependence on frequency of their own: against MuJoCo's and a line-by-line twin."""

from dataclasses import replace

import control
import numpy as np
import pytest
from small_machine import MJCF, drawing

from identification.words import Condition, Dof
from mbmodel import (
    AddedPart,
    Change,
    Evaluator,
    FrfRequest,
    Model,
    Parameter,
    as_drawn,
    export_state_space,
    joint_parts,
    load_machine,
    sensor_parts,
    spring_parts,
)
from mbmodel.assembly import FrequencyDependentTerm
from mbmodel.frf.solver import WoodburySolver

__all__ = ["drawing"]

FREQ = np.linspace(3, 160, 53)
OUTPUTS = tuple(Dof.parse(f"acc{n}:+{d}") for n in (1, 3, 4) for d in ("tx", "ty", "tz"))
INPUTS = (Dof.parse("acc3:+tx"), Dof.parse("acc5:-tz"))
REQUEST = FrfRequest(FREQ, OUTPUTS, INPUTS)
MASS, STIFFNESS, DAMPING = 3.0, 6e5, 40.0
HANGING = """<body name="cover"><inertial pos="0 0.03 0.7" mass="3" diaginertia="1e-9 1e-9 1e-9"/>
  <joint type="slide" axis="1 0 0" stiffness="6e5" damping="40"/></body>"""


@pytest.fixture(scope="module")
def machine(drawing):
    return load_machine(drawing)


def resonator(s):
    """Dynamic mass of an appendage per its mass, times s^2."""
    spring = (DAMPING * s + STIFFNESS) / MASS
    return s**2 * spring / (s**2 + spring)


def on_head(machine, *axes, shape=None, power=0, name="cover"):
    """A Part that adds to the head's translations."""
    frame = np.zeros((len(machine.body_mass), len(axes)))
    frame[6 + np.array(axes), np.arange(len(axes))] = 1.0
    core = np.zeros((1, 3, len(axes), len(axes)))
    core[0, power] = np.eye(len(axes))
    change = Change("body", frame, frame, core, shape=shape)
    return AddedPart.linear(
        "body:head", (Parameter(f"{name}.mass", 0.0, "kg", positive=False),), (change,)
    )


@pytest.fixture(scope="module")
def lossy_model(machine):
    """Joints and sensors that move, an appendage, structural damping of the head's joint."""
    nv = len(machine.coordinates)
    core = np.zeros((1, 3, nv, nv))
    core[0, 0] = np.diag([0, 0, 0, 8e6, 6e6, 3e5])
    eta = AddedPart.linear(
        "joint:head",
        (Parameter("head.loss_factor", 0.0, "1", positive=False),),
        (Change("joint", np.eye(nv), np.eye(nv), core, shape=lambda s: 1j * np.sign(s.imag)),),
    )
    late = AddedPart.linear(
        "joint:base",
        (Parameter("base.delay", 0.0, "1", positive=False),),
        (replace(eta.derivatives(None)[0], shape=lambda s: np.exp(-0.002 * s) - 1),),
        when=lambda condition: condition.reference.direction == "+tx",
    )
    parts = (
        *spring_parts(machine),
        *joint_parts(machine),
        *sensor_parts(machine),
        on_head(machine, 0, shape=resonator),
        eta,
        late,
    )
    return Model(machine, parts)


def test_an_appendage_is_a_body_on_a_spring(machine, tmp_path):
    path = tmp_path / "hanging.xml"
    path.write_text(MJCF.replace("</body>\n    </body>", f"{HANGING}</body>\n    </body>"))
    expected = Evaluator(as_drawn(load_machine(path)), REQUEST)
    expected = expected.at(expected.model.drawn).values
    parts = (
        *spring_parts(machine),
        on_head(machine, 0, shape=resonator),
        on_head(machine, 1, 2, power=2, name="rigid"),  # it moves with the head along y and z
    )
    model = Model(machine, parts)
    theta = model.drawn.copy()
    theta[-2:] = MASS
    values = Evaluator(model, REQUEST).at(theta).values
    scale = np.abs(expected).max(axis=(0, 1))
    np.testing.assert_allclose(values / scale, expected / scale, atol=1e-7)
    without = Evaluator(model, REQUEST).at(model.drawn).values
    assert np.abs((without - expected) / scale).max() > 0.05


def random_theta(model, seed=3):
    rng = np.random.default_rng(seed)
    theta = model.drawn * np.exp(0.1 * rng.normal(size=len(model.drawn)))
    theta += np.where(model.drawn == 0, 0.01 * rng.normal(size=len(theta)), 0.0)
    theta[-3:] = (2.5, 0.2, 0.4)
    return theta


@pytest.mark.parametrize("condition", [None, Condition("a", INPUTS[0])])
def test_the_dynamic_stiffness_is_that_of_a_twin_line_by_line(lossy_model, condition):
    theta = random_theta(lossy_model)
    lines = Evaluator(lossy_model, REQUEST, condition=condition).at(theta)
    assembly = lines.assembly
    eye = np.eye(len(assembly.jacobian))
    head = eye[6:7] @ assembly.jacobian
    springs = np.diag([0, 0, 0, 8e6, 6e6, 3e5])
    for k, s in enumerate(REQUEST.laplace):
        z = assembly.matrices.dynamic_stiffness(s) + 2.5 * resonator(s) * head.T @ head
        z = z + 0.2j * springs
        if condition is not None:
            z = z + 0.4 * (np.exp(-0.002 * s) - 1) * springs
        drive = assembly.jacobian.T @ lines.ports.force
        expected = s**2 * lines.readout @ np.linalg.solve(z, drive)
        expected *= lines.output_factor[:, k, None]
        np.testing.assert_allclose(lines.values[k], expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("condition", [None, Condition("a", INPUTS[0])])
def test_columns_and_adjoint_are_difference_quotients(lossy_model, condition):
    theta = random_theta(lossy_model)
    evaluator = Evaluator(lossy_model, REQUEST, condition=condition)
    lines = evaluator.at(theta)
    columns = lines.columns()
    rng = np.random.default_rng(4)
    cotangent = rng.normal(size=lines.values.shape) + 1j * rng.normal(size=lines.values.shape)
    adjoint = lines.gradient(cotangent)
    for k in range(len(theta)):
        step = 1e-4 * max(abs(theta[k]), 0.01)
        values = []
        for m in (2, 1, -1, -2):
            moved = theta.copy()
            moved[k] += m * step
            values.append(evaluator.at(moved).values)
        quotient = (-values[0] + 8 * values[1] - 8 * values[2] + values[3]) / (12 * step)
        rounding = 1e-12 * np.abs(lines.values).max() / step
        name = lossy_model.parameters[k].name
        off = np.abs(columns[..., k] - quotient).max()
        assert off < 1e-6 * np.abs(quotient).max() + rounding, name
        assert adjoint[k] == pytest.approx(
            (cotangent.conj() * columns[..., k]).sum().real,
            rel=1e-9,
            abs=1e-9 * np.abs(columns[..., k]).sum(),
        ), name
    # What acts in one test only is nothing elsewhere.
    assert (np.abs(columns[..., -1]).max() > 0) == (condition is not None)


def test_the_state_space_of_an_appendage_and_losses_is_near_them(lossy_model):
    # The appendage is rational; the law of the loss is any function here, not one of our own.
    theta = random_theta(lossy_model)
    sensors = [name.startswith("acc") for name in (p.name for p in lossy_model.parameters)]
    theta = np.where(sensors, lossy_model.drawn, theta)
    export = export_state_space(lossy_model, theta, REQUEST)
    system = export.system
    values = control.frequency_response(system, 2 * np.pi * FREQ, squeeze=False).complex
    expected = Evaluator(lossy_model, REQUEST).at(theta).values
    assert {law.owner: law.approximation.kind for law in export.laws} == {
        "cover.mass": "fitted poles",
        "head.loss_factor": "positive frequencies",
    }
    assert export.laws[0].approximation.max_error < 1e-9
    lossless = np.where([p.name == "head.loss_factor" for p in lossy_model.parameters], 0, theta)
    without = Evaluator(lossy_model, REQUEST).at(lossless).values
    near, far = (np.linalg.norm(each - expected) for each in (np.moveaxis(values, -1, 0), without))
    assert near < 0.05 * far


def test_a_line_exactly_at_an_undamped_resonance_answers_hugely_not_never():
    class Unit:
        """Z0 = 1 of one coordinate."""

        laplace = 2j * np.pi * np.array([1.0, 2.0])

        def solve(self, force, **_):
            return np.broadcast_to(force, (1, 1, 2)).astype(complex)

    core = np.zeros((3, 1, 1))
    core[0] = -1.0
    whole = FrequencyDependentTerm(
        np.ones((1, 1)),
        np.ones((1, 1)),
        Change("joint", None, None, core),
        np.zeros((6, 1)),
        np.zeros((6, 1)),
    )
    answer = WoodburySolver(Unit(), (whole,)).solve(np.ones((1, 1, 1)))
    assert np.isfinite(answer).all()
    assert (np.abs(answer) > 1e10).all()
