"""The state space against python-control's own frequency response, and its names."""

import sys

import control
import numpy as np
import pytest
from exudyn_twin import exudyn_twin
from mbmodel_examples import OPEN, STATION, random_request, random_tree, worst_of_channels

from identification.words import Dof
from mbmodel import FrfRequest, as_drawn, linearise, load_machine, state_space

MODELS = [
    pytest.param(STATION, id="microstation"),
    *(pytest.param(path, id=path.parent.name) for path in OPEN),
]
if not OPEN:
    absent = pytest.mark.skip(reason="shared/campaigns/open is not beside the repository")
    MODELS.append(pytest.param(None, id="open", marks=absent))


@pytest.fixture(autouse=True)
def no_slycot(monkeypatch):
    """With slycot, python-control evaluates faster and five digits worse."""
    monkeypatch.setitem(sys.modules, "slycot", None)


def by_control(model, theta, frf_request):
    """python-control's response; (n_freq, n_out, n_in)."""
    system = state_space(model, theta, frf_request)
    response = control.frequency_response(system, 2 * np.pi * frf_request.freq_hz, squeeze=False)
    return np.moveaxis(response.complex, -1, 0)


# python-control solves with an unbalanced A whose entries span 1e10, and its C cancels at low
# frequency: error 1e-10 or better of each channel's peak.


@pytest.mark.parametrize("path", MODELS)
def test_python_control_gives_the_same_frfs(path):
    model = as_drawn(load_machine(path))
    frf_request = random_request(model.machine, np.linspace(1, 250, 21), n_out=9, n_in=3)
    values = linearise(model, model.drawn, frf_request).values
    assert worst_of_channels(by_control(model, model.drawn, frf_request), values) < 1e-9


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
def test_python_control_agrees_in_every_quantity(station_model, away, quantity):
    frf_request = random_request(station_model.machine, np.linspace(1, 250, 21), quantity=quantity)
    values = linearise(station_model, away, frf_request).values
    assert worst_of_channels(by_control(station_model, away, frf_request), values) < 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_python_control_agrees_on_a_skew_tree(from_text, seed):
    model = as_drawn(from_text(random_tree(seed)))
    frf_request = random_request(model.machine, np.linspace(1, 400, 31), seed=seed)
    values = linearise(model, model.drawn, frf_request).values
    assert worst_of_channels(by_control(model, model.drawn, frf_request), values) < 1e-9


def test_state_spaces_poles_are_exudyns(station_model):
    # A from joint coordinates, M and K of exudyn from absolute ones.
    dof = (Dof.parse("ty:+tx"),)
    system = state_space(station_model, station_model.drawn, FrfRequest(np.ones(1), dof, dof))
    twin = exudyn_twin(STATION)
    n = len(twin.mass)
    A = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-np.linalg.solve(twin.mass, np.hstack([twin.stiffness, twin.damping]))],
        ]
    )
    poles, twin_poles = (np.sort_complex(np.linalg.eigvals(matrix)) for matrix in (system.A, A))
    size = np.abs(twin_poles)
    assert all((np.abs(twin_poles - pole) / size).min() < 1e-8 for pole in poles)


def test_states_are_named_after_the_coordinates(station_model):
    dof = (Dof.parse("ty:+tx"),)
    system = state_space(station_model, station_model.drawn, FrfRequest(np.ones(1), dof, dof))
    names = station_model.machine.coordinates
    assert system.state_labels == [*names, *(f"{name}'" for name in names)]


def test_inputs_and_outputs_are_named_after_their_labels(station_model):
    frf_request = random_request(station_model.machine, np.ones(1), n_out=4, n_in=2)
    system = state_space(station_model, station_model.drawn, frf_request)
    assert system.output_labels == [str(dof) for dof in frf_request.outputs]
    assert system.input_labels == [str(dof) for dof in frf_request.inputs]
    assert system.name == "microstation"


def test_a_full_stop_in_a_sites_name_becomes_a_bar(from_text):
    model = as_drawn(from_text(random_tree(3).replace("acc1", "acc.1")))
    dof = (Dof.parse("acc.1:+tx"),)
    system = state_space(model, model.drawn, FrfRequest(np.ones(1), dof, dof))
    assert system.output_labels == ["acc_1:+tx"]


def test_only_an_acceleration_follows_a_force_at_once(station_model):
    for quantity, expected in (("receptance", 0), ("mobility", 0), ("accelerance", 1)):
        frf_request = random_request(station_model.machine, np.ones(1), quantity=quantity)
        system = state_space(station_model, station_model.drawn, frf_request)
        assert bool(system.D.any()) == bool(expected)


def test_shapes_follow_states_outputs_and_inputs(station_model):
    frf_request = random_request(station_model.machine, np.ones(1), n_out=4, n_in=2)
    system = state_space(station_model, station_model.drawn, frf_request)
    assert (system.nstates, system.noutputs, system.ninputs) == (72, 4, 2)
