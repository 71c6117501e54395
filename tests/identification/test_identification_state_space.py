"""The state space of a modal model has the FRFs of the modal sum."""

from dataclasses import replace

import control
import numpy as np
import pytest

from identification.modal.state_space import modal_state_space
from identification.words import Dof, ModalModel


def model(lower, upper):
    random = np.random.default_rng(3)
    poles = 2 * np.pi * np.array([12.0, 31.0, 90.0]) * (-0.01 + 1j)
    shapes, participation = (
        random.standard_normal((n, 3)) + 1j * random.standard_normal((n, 3)) for n in (4, 2)
    )
    return ModalModel(
        poles,
        shapes,
        participation,
        lower,
        upper,
        tuple(Dof(f"acc{k}", "+tx") for k in range(4)),
        tuple(Dof(f"acc{k}", "+tx") for k in range(2)),
        np.zeros(3),
        np.zeros(3),
    )


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_its_response_is_the_modal_sum(rank):
    random = np.random.default_rng(4)
    lower = random.standard_normal((4, rank)) @ random.standard_normal((rank, 2))
    whole = model(lower, random.standard_normal((4, 2)))
    matrices = modal_state_space(whole)
    assert matrices[0].shape == (2 * (3 + rank), 2 * (3 + rank))
    freq = np.linspace(1.0, 120.0, 50)
    system = control.ss(*matrices)
    values = system(2j * np.pi * freq).transpose(2, 0, 1)
    np.testing.assert_allclose(values, whole.synthesise(freq, "receptance").values, rtol=1e-9)


def test_a_model_without_modes_is_its_residual():
    bare = model(np.zeros((4, 2)), np.ones((4, 2)))
    bare = replace(
        bare,
        poles=np.zeros(0),
        shapes=np.zeros((4, 0)),
        participation=np.zeros((2, 0)),
        freq_sd=np.zeros(0),
        damping_sd=np.zeros(0),
    )
    a, b, c, d = modal_state_space(bare)
    assert (a.shape, b.shape, c.shape) == ((0, 0), (0, 2), (4, 0))
    np.testing.assert_array_equal(d, np.ones((4, 2)))
