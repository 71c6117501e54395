"""A hammer test of a large machine: three hits, an accelerometer of three axes on each body."""

import numpy as np

from identification.words import Campaign, Condition, Dof, Frf, FrfEstimate, Test
from mbmodel import Evaluator, FrfRequest, Machine, as_drawn
from tuning import build_toleranced_model
from tuning.misfit.misfit import Misfit
from tuning.parametrisation.user_specification import parametrise

NOISE = 0.01  # of each channel's rms over the band


def large_request(machine: Machine, lines: int) -> FrfRequest:
    """All directions of all sensors, hit along three axes at the last one."""
    points = machine.layout.points
    outputs = tuple(Dof.of(point, axis) for point in points for axis in range(3))
    inputs = tuple(Dof.of(points[-1], axis) for axis in range(3))
    return FrfRequest(np.linspace(1.0, 200.0, lines), outputs, inputs)


def large_campaign(machine: Machine, lines: int, *, seed: int = 0) -> Campaign:
    """The machine's own accelerances with noise."""
    model, request = as_drawn(machine), large_request(machine, lines)
    values = Evaluator(model, request).at(model.drawn).values
    random = np.random.default_rng(seed)
    tests = []
    for column, reference in enumerate(request.inputs):
        clean = values[:, :, column : column + 1]
        sigma = NOISE * np.sqrt((np.abs(clean) ** 2).mean(axis=0))
        error = random.normal(size=(2, *clean.shape)) * sigma / np.sqrt(2)
        frf = Frf(
            request.freq_hz,
            clean + error[0] + 1j * error[1],
            request.outputs,
            (reference,),
            "accelerance",
        )
        variance = np.broadcast_to(sigma**2, clean.shape)
        measured = np.ones(clean.shape[1:], bool)
        estimate = FrfEstimate(frf, variance, "coherence", measured, averages=1000)
        tests.append(Test(Condition("virtual.uff", reference), estimate))
    return Campaign("virtual", machine.layout, tuple(tests))


def large_misfit(machine: Machine, lines: int) -> tuple[Misfit, np.ndarray]:
    """The misfit of a tuning with all tolerances, and the nominal coordinates."""
    campaign = large_campaign(machine, lines)
    model = build_toleranced_model(machine, campaign)
    parametrisation = parametrise(model, campaign.tolerance)
    misfit = Misfit(model, campaign, parametrisation, model_error_floor=0.01)
    return misfit, parametrisation.coordinates(model.drawn)
