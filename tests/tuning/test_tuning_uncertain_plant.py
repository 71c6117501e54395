"""The uncertain plant F_u(M, Delta) against the model's own FRFs at the parameters of Delta."""

import re

import numpy as np
import pytest
from mbmodel_examples import random_request, random_tree

from identification.words import Dof, UsageError
from mbmodel import Evaluator, FrfRequest, machine_model, parse_input
from tuning import ParameterPosterior
from tuning.plant import assemble_uncertain_plant, measure_lft_error

FREQ = np.linspace(3.0, 400.0, 25)


def posterior_of(model, seed=1, spread=0.03):
    """Independent coordinates, one for each parameter, with spreads that all differ."""
    rng = np.random.default_rng(seed)
    names = tuple(parameter.name for parameter in model.parameters)
    is_size = np.array([parameter.positive for parameter in model.parameters])
    deviation = spread * rng.uniform(0.5, 1.5, len(names)) * np.where(is_size, 1.0, 0.01)
    return ParameterPosterior(
        names,
        names,
        model.drawn.copy(),
        np.arange(len(names)),
        rng.uniform(0.5, 2.0, len(names)),
        is_size,
        np.diag(deviation**2),
    ).on(model)


def upper_lft(plant, delta, freq):
    """F_u(M, Delta) line by line from the matrices of M alone; (n_freq, n_out, n_in)."""
    width, values = int(plant.ranks.sum()), []
    change = np.diag(np.repeat(delta, plant.ranks))
    for f in freq:
        states = np.linalg.solve(2j * np.pi * f * np.eye(len(plant.a)) - plant.a, plant.b)
        m = plant.c @ states + plant.d
        inner = np.linalg.solve(np.eye(width) - m[:width, :width] @ change, m[:width, width:])
        values.append(m[width:, width:] + m[width:, :width] @ change @ inner)
    return np.array(values)


def worst(values, expected):
    peak = np.abs(expected).max(axis=0)
    return float((np.abs(values - expected) / np.where(peak > 0, peak, 1)).max())


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("seed", [1, 4])
def test_stiffness_damping_and_mass_are_exact_at_any_size(from_text, seed, quantity):
    # Under so little weight the equilibrium stays. Where it moves with stiffness and mass, as of
    # a hung machine, blocks are linearised.
    model = machine_model(
        from_text(random_tree(seed, n_body=3).replace('"0 0 0"', '"0 0 -0.2"', 1))
    )
    assert model.machine.statics is None
    request = random_request(model.machine, FREQ, quantity=quantity, seed=seed)
    posterior = posterior_of(model)
    plant = assemble_uncertain_plant(posterior, request, min_share=0.0)
    exact = [name for name, is_exact in zip(plant.names, plant.is_exact, strict=True) if is_exact]
    assert {name.rpartition(".")[2][:4] for name in exact} == {"stif", "damp", "mass", "iner"}
    rng, x = np.random.default_rng(seed), np.zeros(posterior.posterior.size)
    delta = np.zeros(len(plant.names))
    for k, name in enumerate(plant.names):
        place = posterior.posterior.names.index(name)
        if plant.is_exact[k] and plant.is_relative[k]:
            delta[k] = rng.uniform(-0.4, 0.9)
            x[place] = np.log1p(delta[k]) / posterior.posterior.scale[place]
    expected = Evaluator(model, request).at(posterior.theta(x)).values
    nominal = Evaluator(model, request).at(model.drawn).values
    assert worst(nominal, expected) > 0.1
    assert worst(upper_lft(plant, delta, FREQ), expected) < 1e-9


def test_a_spring_has_rank_one_and_a_mass_rank_three(from_text):
    model = machine_model(from_text(random_tree(4, n_body=3)))
    plant = assemble_uncertain_plant(posterior_of(model), random_request(model.machine, FREQ), 0.0)
    for name, rank in zip(plant.names, plant.ranks, strict=True):
        if name.endswith((".stiffness", ".damping")):
            assert rank == 1
        if name.endswith(".mass"):
            assert rank <= 3


def test_a_moved_floor_feels_the_changed_mass(from_text):
    model = machine_model(from_text(random_tree(4, n_body=3)))
    outputs = random_request(model.machine, FREQ).outputs
    floor = (Dof.parse("floor:+tx"), Dof.parse("floor:-tz"))
    request = FrfRequest(FREQ, outputs, floor)
    posterior = posterior_of(model)
    plant = assemble_uncertain_plant(posterior, request, 0.0)
    place = next(k for k, name in enumerate(plant.names) if name.endswith(".mass"))
    delta, x = np.zeros(len(plant.names)), np.zeros(posterior.posterior.size)
    delta[place] = 0.7
    number = posterior.posterior.names.index(plant.names[place])
    x[number] = np.log(1.7) / posterior.posterior.scale[number]
    expected = Evaluator(model, request).at(posterior.theta(x)).values
    assert worst(upper_lft(plant, delta, FREQ), expected) < 1e-9
    with pytest.raises(UsageError, match="accelerance"):
        assemble_uncertain_plant(posterior, FrfRequest(FREQ, outputs, floor, "mobility"))


def test_joints_and_centres_of_mass_are_linearised_and_their_error_is_stated(from_text):
    model = machine_model(from_text(random_tree(1, n_body=3)))
    request = random_request(model.machine, FREQ)
    errors = []
    for spread in (1e-3, 1e-4):
        posterior = posterior_of(model, spread=spread)
        plant = assemble_uncertain_plant(posterior, request, 0.0)
        z = posterior.posterior.draw(3, seed=2)
        errors.append(measure_lft_error(plant, posterior, request, z))
        moved = posterior.theta(posterior.posterior.root @ z[0])
        evaluator = Evaluator(model, request)
        difference = worst(evaluator.at(moved).values, evaluator.at(model.drawn).values)
        assert errors[-1] < 0.3 * difference
    assert errors[1] < 0.02 * errors[0]  # quadratic in the change


def test_a_sample_is_a_named_state_space_of_the_model_at_its_parameters(from_text):
    model = machine_model(from_text(random_tree(4, n_body=3)))
    request = random_request(model.machine, FREQ)
    posterior = posterior_of(model, spread=1e-3)
    plant = assemble_uncertain_plant(posterior, request)
    z = posterior.posterior.draw(1, seed=3)[0]
    system = plant.sample(z)
    assert system.input_labels == [str(dof) for dof in request.inputs]
    assert system.output_labels == [str(dof) for dof in request.outputs]
    values = np.array([system(2j * np.pi * f, squeeze=False) for f in FREQ])
    expected = Evaluator(model, request).at(posterior.theta(posterior.posterior.root @ z)).values
    assert worst(values, expected) < 1e-3
    nominal = Evaluator(model, request).at(model.drawn).values
    values = np.array([plant.nominal()(2j * np.pi * f, squeeze=False) for f in FREQ])
    assert worst(values, nominal) < 1e-9


def test_parameters_without_influence_get_no_block(from_text):
    model = machine_model(from_text(random_tree(4, n_body=3)))
    request = random_request(model.machine, FREQ)
    posterior = posterior_of(model)
    whole = assemble_uncertain_plant(posterior, request, 0.0)
    fewer = assemble_uncertain_plant(posterior, request, 0.02)
    assert 0 < len(fewer.names) < len(whole.names)
    assert set(fewer.names) < set(whole.names)


def test_actuators_with_a_state_lag_behind_their_inputs(from_text):
    text = random_tree(1, n_body=3).replace("</mujoco>", "<actuator>{}</actuator></mujoco>")
    dynamics = "filter", "none", "integrator"
    joints = re.findall(r'<joint name="(\w+)"', text)[:3]
    rows = zip(dynamics, joints, strict=True)
    motors = [
        f'<general name="{kind}" joint="{joint}" dyntype="{kind}" dynprm="0.01"/>'
        for kind, joint in rows
    ]
    model = machine_model(from_text(text.format("".join(motors))))
    inputs = tuple(parse_input(model.machine, kind) for kind in dynamics)
    request = FrfRequest(FREQ, random_request(model.machine, FREQ, seed=1).outputs, inputs)
    posterior = posterior_of(model)
    plant = assemble_uncertain_plant(posterior, request, min_share=0.0)
    delta = np.where(plant.is_exact & plant.is_relative, 0.2, 0.0)
    x = np.zeros(posterior.posterior.size)
    for name, value in zip(plant.names, delta, strict=True):
        place = posterior.posterior.names.index(name)
        x[place] = np.log1p(value) / posterior.posterior.scale[place]
    expected = Evaluator(model, request).at(posterior.theta(x)).values
    assert worst(upper_lft(plant, delta, FREQ), expected) < 1e-9
