"""Do the bands of FRFs between ports that were not measured hold? One machine of ``truth/``."""

import re
import tempfile
from pathlib import Path

import numpy as np

from diagnosis import diagnose
from identification.words import Real
from mbmodel import FrfRequest, load_machine, machine_model
from mbw.diagnose.augmented import write_augmented
from tests.helpers.truth_ports import joint_row, plant_receptance, point_row
from truth import Plan, write_campaign
from truth.campaign.virtual_test import Subject, draw_subject, measure_subject
from truth.machine.dynamics import motion_row
from truth.machine.rig import Prepared
from truth.machine.station import Complex, Station
from truth.random_streams import stream
from tuning import NORMAL_QUANTILE_95, Session, open_session, read_posterior, tune
from tuning.files.plant_folder import AUGMENTED
from tuning.files.result import TUNED_MJCF, write_result
from tuning.plant import AlternativePlants, FrfBands, frf_bands

_JOINTS = 3  # that are inputs, and as many that are outputs
_SPREAD_M = 0.15  # of the points about the centres of mass, standard deviation
_AXES = "xyz"
_DRAWN_PLACE = "drawn_place"
Ports = tuple[list[str], list[str]]  # outputs and inputs
# Outputs by kind: joints, points and a difference of points, a sensor, the place where it is drawn.
_KINDS = {
    "at joints": slice(0, 3),
    "at points": slice(3, 7),
    "at a sensor": slice(7, 10),
    "at its drawn place": slice(10, 13),
}


def plant_coverage(
    nominal: Station, plan: Plan, *, is_diagnosed: bool = False
) -> dict[str, object]:
    """Tune one campaign, and count the bands of unmeasured FRFs that hold the true FRF.

    Each stage gets a point without a sensor, anywhere near its centre of mass. Inputs are forces
    along three joints and a pair of forces between two points. Outputs are three joints, the last
    stage's point in x, y, z, its motion against the first stage's, and twice the last stage's first
    sensor: as a port it is where the sensor truly is, with its true axes, and a site without a
    sensor is where the drawing has it.

    Args:
        nominal: station to draw about.
        plan: of machine and test.
        is_diagnosed: whether the same is counted for the plant of a diagnosis, with all plants that
            are probable.

    Returns:
        For magnitude and phase, and for all FRFs of each kind of output: how many bands hold the
        truth, of how many lines, and the medians of relative standard deviation and error;
        chi-square and model-error floor. ``after`` has the counts of the diagnosis.
    """
    subject = draw_subject(nominal, plan)
    points = _draw_points(subject.drawing, plan.seed)
    drawn = subject.drawing.stages[-1]
    points[_DRAWN_PLACE] = (drawn.name, drawn.sensors[0].position)
    ports = _draw_ports(subject.drawing, plan.seed)
    drawn_ports = drawn.sensors[0].site, _DRAWN_PLACE
    ports[0].extend(f"{name}:+t{axis}" for name in drawn_ports for axis in _AXES)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_campaign(measure_subject(subject, plan, nominal.name), folder)
        _add_sites(folder / "model.xml", points)
        session = open_session(folder)
        tuned = tune(session)
        write_result(tuned, folder / "tuned")
        file = folder / "tuned" / TUNED_MJCF
        posterior = read_posterior(file.parent)
        bands = _bands(file, file.parent, ports, session)
        further = _diagnosed_bands(session, folder, ports) if is_diagnosed else None
    freq_hz = session.campaign.freq_hz
    true = _true_plant(subject, plan, points, ports, freq_hz)
    confidence = tuned.confidence
    return {
        "seed": plan.seed,
        "dirt": plan.dirt,
        "chi square": None if confidence is None else confidence.chi_square,
        "floor": posterior.error_floor,
        "discrepancy": posterior.discrepancy,
        **_held(bands, bands.magnitude_interval(), true),
    } | ({} if further is None else {"after": _held(*further, true)})


def _diagnosed_bands(
    session: Session, folder: Path, ports: Ports
) -> tuple[FrfBands, tuple[Real, Real]]:
    """Return the bands of the diagnosed plant, and the interval over all probable plants."""
    file = folder / "diagnosed" / AUGMENTED
    file.parent.mkdir()
    plant = write_augmented(diagnose(session), file).plant
    bands = _bands(file, file.parent, ports, session)
    rivals = [(row, file.with_name(row.file)) for row in plant.alternatives]
    if not rivals:
        return bands, bands.magnitude_interval()
    weights = np.array([plant.probability, *(row.probability for row, _ in rivals)])
    further = [_bands(mjcf, mjcf.with_suffix(".npz"), ports, session) for _, mjcf in rivals]
    names = (plant.name, *(row.name for row, _ in rivals))
    plants = AlternativePlants(names, weights / weights.sum(), (bands, *further))
    return bands, plants.magnitude_interval()


def _bands(mjcf: Path, posterior: Path, ports: Ports, session: Session) -> FrfBands:
    """Return the bands between ports of a written machine with its posterior."""
    model = machine_model(load_machine(mjcf))
    layout, freq_hz = model.machine.layout, session.campaign.freq_hz
    rows = [tuple(layout.parse(text) for text in texts) for texts in ports]
    request = FrfRequest(freq_hz, *rows, "receptance")
    return frf_bands(read_posterior(posterior).on(model), request)


def _held(bands: FrfBands, interval: tuple[Real, Real], true: Complex) -> dict[str, list[float]]:
    """Count bands of magnitude and phase that hold the truth; add their width and error."""
    low, high = interval
    size = np.abs(true)
    angle = np.abs(np.angle(true / bands.values))
    held = np.stack(
        [
            (low <= size) & (size <= high),
            angle <= NORMAL_QUANTILE_95 * bands.phase_deviation,
        ]
    )
    width = (high - low) / (2 * NORMAL_QUANTILE_95 * np.abs(bands.values))
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


def _draw_ports(drawing: Station, seed: int) -> Ports:
    """Return outputs and inputs as a user names them."""
    random = stream(seed, "plant.ports")
    names = [joint.name for stage in drawing.stages for joint in stage.joints]
    chosen = [f"joint:{names[k]}" for k in random.choice(len(names), 2 * _JOINTS, replace=False)]
    first, last = drawing.stages[0].name, drawing.stages[-1].name
    upper = int(random.integers(1, len(drawing.stages)))
    lower = drawing.stages[upper].parent
    pair = f"free_{drawing.stages[upper].name}-free_{drawing.stages[lower].name}"
    inputs = [*chosen[:_JOINTS], f"{pair}:+t{_AXES[int(random.integers(3))]}"]
    outputs = [*chosen[_JOINTS:], *(f"free_{last}:+t{axis}" for axis in _AXES)]
    return [*outputs, f"free_{last}-free_{first}:+t{_AXES[int(random.integers(3))]}"], inputs


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
    ports: Ports,
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
