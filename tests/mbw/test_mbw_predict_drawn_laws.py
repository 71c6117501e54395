"""``mbw predict`` of a campaign and of its tuned model: loss factors and branches as drawn."""

import numpy as np
import pytest

from mbmodel import ConstantLoss, Relaxation
from mbw.any_campaign import find_model
from mbw.predict.machines import Additions, MachineRequest, load_machines
from tests.helpers.drawn import drawn


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laws")
    drawn(folder, 72_001, lines=41, stages=2)
    with (folder / "campaign" / "campaign.toml").open("a") as settings:
        settings.write("[spring.stage2_tx]\nloss_factor = 0.1\n")
        settings.write("maxwell = [{ ratio = 0.5, tau = 0.02 }]\n")
    return folder / "campaign"


def test_a_campaign_is_predicted_with_the_laws_that_it_states(campaign):
    mjcf, source, key = find_model(campaign)
    request = MachineRequest(mjcf, (), key, Additions(None, ()), loops_source=source)
    with load_machines(request) as machines:
        model = machines.model
        terms = model.assemble(model.drawn).frequency_dependent
    assert {term.change.shape for term in terms} == {ConstantLoss(), Relaxation(0.02)}
    laplace = 2j * np.pi * np.array([10.0])
    total = sum(term.left @ term.at(laplace)[0] @ term.right.T for term in terms)
    place = model.machine.coordinates.index("stage2_tx")
    (spring,) = (s for s in model.machine.springs if s.name == "stage2_tx")
    branch = 0.5 * laplace[0] * 0.02 / (1 + laplace[0] * 0.02)
    assert total[place, place] == pytest.approx(spring.stiffness * (0.1j + branch))
    assert {term.owner for term in terms} == {"stage2_tx.loss_factor", "stage2_tx.maxwell"}
