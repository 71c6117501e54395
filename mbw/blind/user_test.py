"""The user's own campaign as a blind test repeats it: model, channels, hits, levels and noise."""

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from identification import read_settings
from identification.readers.campaign_toml import model_file
from identification.readers.controller import CampaignLoopTable, find_controller
from identification.readers.toml_files import toml_key, toml_value
from identification.words import (
    DERIVATIVE_ORDER,
    Campaign,
    Complex,
    InputError,
    Signal,
    Test,
)
from mbmodel.mjcf.read import current_reading
from truth import (
    ClosedLoop,
    OwnTest,
    Protocol,
    StatedTest,
    Station,
    Tolerances,
    TruthError,
    fit_to_machine,
    locate_tests,
    read_station,
)
from tuning import open_campaign

USUAL_BAND_HZ = 200.0  # of a station, for which frequencies of effects are drawn


@dataclass(frozen=True, eq=False)
class UserTest:
    """A user's campaign with its machine.

    Args:
        station: the model that campaign.toml names.
        repeated: the test at the station's sensors and hits.
    """

    station: Station
    repeated: OwnTest

    def with_protocol(self, protocol: Protocol) -> "UserTest":
        """Return the machine tested in another way."""
        return UserTest(self.station, OwnTest(protocol, self.repeated.tolerance))


def is_campaign(path: Path) -> bool:
    """Return whether a path is a campaign's folder, or its campaign.toml."""
    return path.suffix == ".toml" or (path / "campaign.toml").is_file()


def title_of(path: Path) -> str:
    """Return the name of a model, or of the folder of a campaign."""
    if not is_campaign(path):
        return path.stem
    folder = path.absolute()
    return folder.parent.name if path.suffix == ".toml" else folder.name


def find_model(path: Path) -> Path:
    """Return a model itself, or the one that a campaign names."""
    return model_file(*read_settings(path)) if is_campaign(path) else path


def read_test(path: Path, band: tuple[float, float] | None) -> UserTest:
    """Read the test of a campaign, or that of a model: one hit point, in the band of its modes.

    Args:
        path: MJCF of a machine, or a campaign.
        band: lowest and highest frequency [Hz] of a campaign; None for the lines with coherence.

    Raises:
        InputError: the model or the campaign cannot be used.
    """
    if is_campaign(path):
        return read_user_test(path, band)
    try:
        station = read_station(path, current_reading().without)
        protocol = fit_to_machine(Protocol((station.first_aim(),)), station)
    except TruthError as error:
        raise InputError(str(error)) from error
    return UserTest(station, OwnTest(protocol, Tolerances()))


def read_user_test(path: Path, band: tuple[float, float] | None) -> UserTest:
    """Read a campaign as a blind test repeats it.

    Args:
        path: the folder, or its campaign.toml.
        band: lowest and highest frequency [Hz]; None for the lines with coherence.

    Raises:
        InputError: an input cannot be used, or the virtual test has no such channel or hit.
    """
    source, _, campaign = open_campaign(path, band)
    settings = read_settings(path)[1]
    changed = next((entry for entry in settings.test if entry.variant), None)
    if changed is not None:
        raise InputError(
            f"{source}: {changed.file} has a model or pose of its own, which a blind test does not "
            "repeat: leave this test out"
        )
    if settings.key not in (None, "home"):
        raise InputError(f"{source}: key names a keyframe; a blind test knows 'home' alone")
    freq_hz = campaign.freq_hz
    moving = freq_hz > 0
    try:
        station = read_station(find_model(path), current_reading().without)
        station = station.with_encoders(_find_encoders(source, station, campaign))
        integrals = {sensor.site: sensor.integrals for _, sensor in station.sensors()}
        stated = tuple(_state(source, test, moving, integrals) for test in campaign.tests)
        loops = tuple(_read_loop(source, station, *row) for row in settings.loop.items())
        station = replace(station, loops=loops)
        measured = locate_tests(station, freq_hz[moving], stated)
        protocol = Protocol(
            nodes=measured.nodes,
            levels=(max(1e-300, *(test.level for test in stated)),),
            averages=max(2, *(test.averages for test in stated)),
            lines=int(moving.sum()),
            resolution_hz=float(np.median(np.diff(freq_hz[moving]))),
            coherence=all(test.averages > 1 for test in stated),
            scale=float(freq_hz[-1]) / USUAL_BAND_HZ,
            measured=measured,
        )
    except TruthError as error:
        raise InputError(f"{source}: {error}") from error
    return UserTest(station, OwnTest(protocol, _tolerance(campaign)))


def _find_encoders(
    source: Path, station: Station, campaign: Campaign
) -> dict[str, tuple[str, int]]:
    """Return the joint that each encoder reads, and its time derivatives that it reads."""
    joints = {
        str(output): _find_joint(station, str(output), 2)
        for output in campaign.outputs
        if isinstance(output, Signal)
    }
    if strange := [label for label, (joint, _) in joints.items() if not joint]:
        raise InputError(
            f"{source}: its tests read {', '.join(strange)}, and a blind test repeats sensors "
            "jointpos and jointvel, joints, and accelerometers at sites acc<node> alone: leave "
            "these channels out"
        )
    return joints


def _state(
    source: Path,
    test: Test,
    moving: np.ndarray[tuple[int], np.dtype[np.bool_]],
    integrals: dict[str, int],
) -> StatedTest:
    """Return one test with the noise of its accelerances.

    Args:
        integrals: of the acceleration that sensors read, by name.
    """
    condition, estimate = test.condition, test.estimate
    if condition.spindle_speed:
        raise InputError(
            f"{source}: {condition.test} was measured while a spindle turned, which a blind test "
            "does not repeat: leave it out"
        )
    present = np.flatnonzero(estimate.measured[:, 0])
    channels = tuple(str(estimate.frf.outputs[k]) for k in present)
    shared = 2 - DERIVATIVE_ORDER[estimate.frf.quantity]  # a MuJoCo sensor reads its own quantity
    steps = [integrals.get(label) or shared for label in channels]
    omega = 2 * np.pi * estimate.frf.freq_hz[moving, None]
    variance = estimate.variance[moving][:, present, 0]
    smallest = 1e-12 * np.abs(estimate.frf.values[moving][:, present, 0]).max(initial=1e-300)
    return StatedTest(
        reference=str(condition.reference),
        channels=channels,
        deviation=omega**steps * np.maximum(np.sqrt(variance), smallest),
        level=condition.level_n or 0.0,
        averages=estimate.averages or 0,
        setup=condition.setup or "",
        hammer=condition.hammer or "",
    )


def _read_loop(source: Path, station: Station, name: str, table: CampaignLoopTable) -> ClosedLoop:
    """Return a loop that was closed in the test, from a joint to a motor."""
    key = f"loop.{name}"
    order = DERIVATIVE_ORDER[table.quantity]
    joint, order = ("", 0) if table.minus else _find_joint(station, table.output, order)
    if not joint:
        also = f" and subtracts {table.minus}" if table.minus else ""
        raise InputError(
            f"{source}: {key} reads {table.output}{also}, but a blind test repeats loops that read "
            "one joint: leave it out, or test with this loop open"
        )
    controller = find_controller(source, key, table.controller)

    def stiffness(laplace: Complex) -> Complex:
        late = np.exp(-laplace * table.delay)
        return np.asarray(controller.response(laplace) * late * laplace**order, complex)

    stated, files = {**table.model_dump(exclude_defaults=True), "as_stated": True}, {}
    if isinstance(table.controller, str):
        file = source.parent / table.controller
        stated["controller"] = f"{key}{file.suffix}".replace("/", "_")
        files = {stated["controller"]: file.read_bytes()}
    rows = "".join(f"{each} = {toml_value(value)}\n" for each, value in stated.items())
    return ClosedLoop(table.input, joint, stiffness, f"[loop.{toml_key(name)}]\n{rows}", files)


def _find_joint(station: Station, output: str, order: int) -> tuple[str, int]:
    """Return the joint that an output reads, empty if none, and the derivatives that it reads.

    Args:
        order: time derivatives of a joint that is named itself.
    """
    if output.startswith("joint:"):
        return output.removeprefix("joint:"), order
    return station.find_sensed_joint(output)


def _tolerance(campaign: Campaign) -> Tolerances:
    drawn = {field.name for field in fields(Tolerances)}  # springs are drawn by other rules
    stated = vars(campaign.tolerance)
    return Tolerances(**{name: value for name, value in stated.items() if name in drawn})
