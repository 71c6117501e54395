"""Do the 95 % intervals of a tuning hold? Machines of ``truth/`` that lack nothing."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.words import Dof
from mbmodel import FrfRequest, linearise
from truth import Plan, Protocol, draw_campaign, write_campaign
from truth.campaign.draw import Tolerances, draw_basis, draw_drawing, draw_hammers, draw_true
from truth.machine.rig import Prepared, accelerance, build
from truth.machine.station import Sensor, Station
from tuning import NORMAL_QUANTILE_95, estimate_confidence, fit, open_session
from tuning.assessment.frf_bands import frf_deviations
from tuning.assessment.parameter_confidence import rank_pulls
from tuning.campaign_tuning import choose_fit, refit_without_bounds

IGNORED = '\n[sensor.acc{node}]\nignore = ["x", "y", "z"]\n'


def covered(
    nominal: Station, seed: int, protocol: Protocol, *, others: int = 3
) -> dict[str, object]:
    """Tune one campaign; which intervals hold the truth.

    One sensor is left out of the tuning. The FRFs between its place and itself, its three
    directions, are predicted for an ideal sensor and hammer there.

    Args:
        nominal: station to draw about.
        seed: of machine and test.
        protocol: of the test.
        others: sensors that the stage of the one left out keeps, at least.

    Returns:
        For stiffness, damping and FRFs (real and imaginary parts, all lines): how many intervals
        hold, of how many; chi-square; the largest pull; whether the fit within bounds was kept.
    """
    drawing = draw_drawing(draw_basis(nominal, seed), seed)
    true = draw_true(draw_basis(nominal, seed), Tolerances(), seed)
    node = _spare(drawing, protocol.nodes, seed, others)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(draw_campaign(nominal, Plan(seed, protocol=protocol)), folder)
        with (folder / "campaign.toml").open("a", encoding="utf-8") as file:
            file.write(IGNORED.format(node=node))
        session = open_session(folder)
        bounded = fit(session.model, session.campaign, parametrisation=session.parametrisation)
        free = refit_without_bounds(session.model, session.campaign, bounded)
        found = choose_fit(bounded, free)
        sure = estimate_confidence(session.model, session.campaign, found)
        freq = session.campaign.freq_hz
        axes = tuple(Dof.of(f"acc{node}", axis) for axis in range(3))
        lines = linearise(session.model, found.theta, FrfRequest(freq, axes, axes))
        unit = np.ones(lines.values.shape, complex)
        spread = frf_deviations(lines, sure, [unit, 1j * unit])
    low, high = sure.interval()
    rows: dict[str, object] = {
        "seed": seed,
        "chi square": sure.chi_square,
        "largest pull": rank_pulls(free.parametrisation, free.x)[0][1],
        "bounded": found is bounded and free is not bounded,
    }
    values = {one.name: k for k, one in enumerate(session.model.parameters)}
    for kind in ("stiffness", "damping"):
        inside = [
            bool(low[place] <= getattr(joint, kind) <= high[place])
            for stage in true.stages
            for joint in stage.joints
            if (place := values.get(f"{joint.name}.{kind}")) is not None
        ]
        rows[kind] = [sum(inside), len(inside)]
    off = lines.values - _at_site(true, drawing, node, freq)
    parts = [
        np.abs(off.real) <= NORMAL_QUANTILE_95 * spread[0],
        np.abs(off.imag) <= NORMAL_QUANTILE_95 * spread[1],
    ]
    rows["FRF"] = [int(sum(part.sum() for part in parts)), 2 * off.size]
    return rows


def _spare(station: Station, hit: tuple[int, ...], seed: int, others: int) -> int:
    """A sensor that is not hit, on a stage with at least some others."""
    nodes = [
        sensor.node
        for stage in station.stages
        if len(stage.sensors) > others
        for sensor in stage.sensors
        if sensor.node not in hit
    ]
    return nodes[seed % len(nodes)]


def _at_site(true: Station, drawing: Station, node: int, freq_hz: np.ndarray) -> np.ndarray:
    """Accelerances of the true machine for an ideal sensor and hammer where the drawing has one."""
    index, ideal = next((k, one) for k, one in drawing.sensors() if one.node == node)
    stages = [replace(stage, sensors=()) for stage in true.stages]
    stages[index] = replace(stages[index], sensors=(Sensor(node, ideal.position, ideal.axes),))
    station = replace(true, stages=tuple(stages))
    nothing = Tolerances(**dict.fromkeys(vars(Tolerances()), 0.0))
    hammers = draw_hammers(drawing, node, nothing, 0)
    return accelerance(build(Prepared(station, hammers)), freq_hz)
