"""Do the bands of FRFs between ports that were not measured hold? One machine of ``truth/``."""

import re
import tempfile
from pathlib import Path

import numpy as np

from identification.words import Real
from mbmodel import FrfRequest, load_machine, machine_model
from truth import Plan, write_campaign
from truth.campaign.virtual_test import Subject, draw_subject, measure_subject
from truth.machine.dynamics import motion_row
from truth.machine.ports import joint_row, plant_receptance, point_row
from truth.machine.rig import Prepared
from truth.machine.station import Complex, Station
from truth.random_streams import stream
from tuning import NORMAL_QUANTILE_95, open_session, read_posterior, tune
from tuning.files.result import TUNED_MJCF, write_result
from tuning.plant import FrfBands, frf_bands

_JOINTS = 3  # that are inputs, and as many that are outputs
_SPREAD_M = 0.15  # of the points about the centres of mass, standard deviation
_AXES = "xyz"
_DRAWN_PLACE = "drawn_place"
# Outputs by kind: joints, points and a difference of points, a sensor, the place where it is drawn.
_KINDS = {
    "at joints": slice(0, 3),
    "at points": slice(3, 7),
    "at a sensor": slice(7, 10),
    "at its drawn place": slice(10, 13),
}


def plant_coverage(nominal: Station, plan: Plan) -> dict[str, object]:
    """Tune one campaign, and count the bands of unmeasured FRFs that hold the true FRF.

    Each stage gets a point without a sensor, anywhere near its centre of mass. Inputs are forces
    along three joints and a pair of forces between two points. Outputs are three joints, the last
    stage's point in x, y, z, its motion against the first stage's, and twice the last stage's first
    sensor: as a port it is where the sensor truly is, with its true axes, and a site without a
    sensor is where the drawing has it.

    Args:
        nominal: station to draw about.
        plan: of machine and test.

    Returns:
        For magnitude and phase, and for all FRFs of each kind of output: how many bands hold the
        truth, of how many lines, and the medians of relative standard deviation and error;
        chi-square and model-error floor.
    """
    subject = draw_subject(nominal, plan)
    points = _draw_points(subject.drawing, plan.seed)
    drawn = subject.drawing.stages[-1]
    points[_DRAWN_PLACE] = (drawn.name, drawn.sensors[0].position)
    inputs, outputs = _draw_ports(subject.drawing, plan.seed)
    drawn_ports = drawn.sensors[0].site, _DRAWN_PLACE
    outputs += [f"{name}:+t{axis}" for name in drawn_ports for axis in _AXES]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(measure_subject(subject, plan, nominal.name), folder)
        _add_sites(folder / "model.xml", points)
        session = open_session(folder)
        tuned = tune(session)
        write_result(tuned, folder / "tuned")
        model = machine_model(load_machine(folder / "tuned" / TUNED_MJCF))
        posterior = read_posterior(folder / "tuned").on(model)
        layout, freq_hz = model.machine.layout, session.campaign.freq_hz
        ports = [tuple(layout.parse(text) for text in texts) for texts in (outputs, inputs)]
        bands = frf_bands(posterior, FrfRequest(freq_hz, *ports, "receptance"))
    true = _true_plant(subject, plan, points, (outputs, inputs), freq_hz)
    confidence = tuned.confidence
    return {
        "seed": plan.seed,
        "dirt": plan.dirt,
        "chi square": None if confidence is None else confidence.chi_square,
        "floor": posterior.posterior.error_floor,
        "discrepancy": posterior.posterior.discrepancy,
        **_held(bands, true),
    }


def _held(bands: FrfBands, true: Complex) -> dict[str, list[float]]:
    """Count bands of magnitude and phase that hold the truth; add their width and error."""
    low, high = bands.magnitude_interval()
    size = np.abs(true)
    angle = np.abs(np.angle(true / bands.values))
    held = np.stack(
        [
            (low <= size) & (size <= high),
            angle <= NORMAL_QUANTILE_95 * bands.phase_deviation,
        ]
    )
    width = bands.magnitude_deviation / np.abs(bands.values)
    error = np.abs(true / bands.values - 1)
    every = slice(None)
    chosen = {
        "magnitude": (held[0], every),
        "phase": (held[1], every),
        **{kind: (held, outputs) for kind, outputs in _KINDS.items()},
    }
    return {
        kind: [
            int(inside[..., outputs, :].sum()),
            inside[..., outputs, :].size,
            float(np.median(width[:, outputs])),
            float(np.median(error[:, outputs])),
        ]
        for kind, (inside, outputs) in chosen.items()
    }


def _draw_points(drawing: Station, seed: int) -> dict[str, tuple[str, Real]]:
    """Return a point without a sensor for each stage: stage and position, by name."""
    random = stream(seed, "plant.points")
    return {
        f"free_{stage.name}": (stage.name, stage.com + _SPREAD_M * random.standard_normal(3))
        for stage in drawing.stages
    }


def _draw_ports(drawing: Station, seed: int) -> tuple[list[str], list[str]]:
    """Return inputs and outputs as a user names them."""
    random = stream(seed, "plant.ports")
    names = [joint.name for stage in drawing.stages for joint in stage.joints]
    chosen = [f"joint:{names[k]}" for k in random.choice(len(names), 2 * _JOINTS, replace=False)]
    first, last = drawing.stages[0].name, drawing.stages[-1].name
    upper = int(random.integers(1, len(drawing.stages)))
    lower = drawing.stages[upper].parent
    pair = f"free_{drawing.stages[upper].name}-free_{drawing.stages[lower].name}"
    inputs = [*chosen[:_JOINTS], f"{pair}:+t{_AXES[int(random.integers(3))]}"]
    outputs = [*chosen[_JOINTS:], *(f"free_{last}:+t{axis}" for axis in _AXES)]
    return inputs, [*outputs, f"free_{last}-free_{first}:+t{_AXES[int(random.integers(3))]}"]


def _add_sites(model: Path, points: dict[str, tuple[str, Real]]) -> None:
    """Write the points into an MJCF whose body frames are the world frame."""
    text = model.read_text(encoding="utf-8")
    for name, (stage, position) in points.items():
        site = f'<site name="{name}" pos="{" ".join(map(repr, position.tolist()))}" />'
        text = re.sub(rf'(<body name="{stage}"[^>]*>)', rf"\1{site}", text)
    model.write_text(text, encoding="utf-8")


def _true_plant(
    subject: Subject,
    plan: Plan,
    points: dict[str, tuple[str, Real]],
    ports: tuple[list[str], list[str]],
    freq_hz: Real,
) -> Complex:
    """Return the true FRFs; (n_freq, n_out, n_in)."""
    occasion = subject.scene.occasions[0]
    tested = subject.machine.prepare(occasion)
    outputs, inputs = ([_row(tested, points, text) for text in texts] for texts in ports)
    return plant_receptance(subject.machine.rig(occasion), outputs, inputs, freq_hz)


def _row(tested: Prepared, points: dict[str, tuple[str, Real]], text: str) -> Real:
    """Return the row of a port from its label."""
    place, direction = text.split(":")
    if place == "joint":
        return joint_row(tested, direction)
    axis = _AXES.index(direction[-1])
    last = len(tested.station.stages) - 1
    sensor = tested.station.stages[last].sensors[0]
    if place == sensor.site:
        axes = sensor.axes[axis]
        return motion_row(tested.station, last, sensor.position, axes, tested.flexes)
    rows = [point_row(tested, *points[name], axis) for name in place.split("-")]
    return rows[0] if len(rows) == 1 else rows[0] - rows[1]
