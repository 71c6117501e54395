"""A campaign of a feed axis: motors and a pair of forces in, encoders and accelerometers out.

Everything is in the units of the electronics. The data come from matrices written by hand, in the
joint coordinates of the axis, and not from the package under test.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

# The axis: a frame on the floor (x, z, tilt about y), and a carriage on it (x, tilt about y).
FRAME_MASS, CARRIAGE_MASS = 96.0, 16.0
FRAME_INERTIA, CARRIAGE_INERTIA = 3.2, 0.07
CARRIAGE_HEIGHT = 0.2  # m, of the carriage's centre above that of the frame
STIFFNESS = {
    "frame_tx": 5e6,
    "frame_tz": 6e6,
    "frame_ry": 4e5,
    "carriage_tx": 3e5,
    "carriage_ry": 3e4,
}
DAMPING = {
    "frame_tx": 2e3,
    "frame_tz": 2e3,
    "frame_ry": 2e2,
    "carriage_tx": 1e2,
    "carriage_ry": 4.0,
}
GEAR = 35.0
AVERAGES = 20
REFERENCES = ("drive", "coil-magnet:+tx", "hit1:+z")
CHANNELS = ("encoder", "joint:frame_tx", "head-acc1:+x", "acc2:+x", "acc2:+z", "carriage:+ry")


def write_axis(path: Path) -> None:
    """Write the axis as an MJCF."""
    joints = {
        name: f'<joint name="{name}" type="{"hinge" if name.endswith("ry") else "slide"}" '
        f'axis="{ {"tx": "1 0 0", "tz": "0 0 1", "ry": "0 1 0"}[name[-2:]] }" '
        f'stiffness="{STIFFNESS[name]}" damping="{DAMPING[name]}"/>'
        for name in STIFFNESS
    }
    path.write_text(
        f"""<mujoco model="axis"><option gravity="0 0 0"/>
    <worldbody><body name="frame" pos="0 0 .3">
    {joints["frame_tx"]}{joints["frame_tz"]}{joints["frame_ry"]}
    <inertial pos="0 0 0" mass="{FRAME_MASS}" diaginertia="3.4 {FRAME_INERTIA} 3.6"/>
    <site name="acc1" pos="0.1 0 0.15"/><site name="magnet" pos="0.1 0 0.2"/>
    <site name="hit1" pos="0.2 0 0.1"/>
    <body name="carriage" pos="0 0 {CARRIAGE_HEIGHT}">
    {joints["carriage_tx"]}{joints["carriage_ry"]}
    <inertial pos="0 0 0" mass="{CARRIAGE_MASS}" diaginertia="0.07 {CARRIAGE_INERTIA} 0.08"/>
    <site name="acc2" pos="0.05 0 0.06"/><site name="coil" pos="0.1 0 0"/>
    <site name="head" pos="0.1 0 -0.05"/></body></body></worldbody>
    <actuator><motor name="drive" joint="carriage_tx" gear="{GEAR}"/></actuator>
    <sensor><jointpos name="encoder" joint="carriage_tx"/></sensor></mujoco>""",
        encoding="utf-8",
    )


def write_loaded_axis(path: Path, mass: float) -> None:
    """Write the axis with a known mass [kg] welded to the carriage's centre."""
    write_axis(path)
    text = path.read_text(encoding="utf-8").replace(
        '<site name="acc2"',
        f'<body name="ballast"><inertial pos="0 0 0" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/>'
        '</body><site name="acc2"',
    )
    path.write_text(text, encoding="utf-8")


def axis_frfs(
    freq_hz: np.ndarray,
    scales: Mapping[str, float],
    added_mass: float = 0.0,
    shift: float = 0.0,
    masses: float = 1.0,
) -> np.ndarray:
    """Return the FRFs between all channels and references; (n_freq, n_out, n_in).

    The rows of points are written down by hand: a point at height z above the frame's centre moves
    by x + z a when the frame turns by a about y, and by -x_point a along z.

    Args:
        freq_hz: lines [Hz].
        scales: factors on stiffnesses, by joint.
        added_mass: at the carriage's centre [kg].
        shift: of the carriage along its slide [m].
        masses: factor on all masses and moments of inertia, but for the added mass.
    """
    h, carriage = CARRIAGE_HEIGHT, CARRIAGE_MASS + added_mass / masses
    # Motions of the centres per (frame_tx, frame_tz, frame_ry, carriage_tx, carriage_ry).
    frame_x, frame_z, frame_a = np.eye(5)[0], np.eye(5)[1], np.eye(5)[2]
    car_x = frame_x + h * frame_a + np.eye(5)[3]
    car_z = frame_z - shift * frame_a
    car_a = frame_a + np.eye(5)[4]
    mass = (
        FRAME_MASS * (np.outer(frame_x, frame_x) + np.outer(frame_z, frame_z))
        + FRAME_INERTIA * np.outer(frame_a, frame_a)
        + carriage * (np.outer(car_x, car_x) + np.outer(car_z, car_z))
        + CARRIAGE_INERTIA * np.outer(car_a, car_a)
    )
    stiffness = np.diag([value * scales.get(name, 1.0) for name, value in STIFFNESS.items()])
    damping = np.diag(list(DAMPING.values()))

    def on_frame(x: float, z: float) -> tuple[np.ndarray, np.ndarray]:
        return frame_x + z * frame_a, frame_z - x * frame_a

    def on_carriage(x: float, z: float) -> tuple[np.ndarray, np.ndarray]:
        return car_x + z * car_a, car_z - x * car_a

    rows = np.array(
        [
            np.eye(5)[3],
            frame_x,
            on_carriage(0.1, -0.05)[0] - on_frame(0.1, 0.15)[0],
            on_carriage(0.05, 0.06)[0],
            on_carriage(0.05, 0.06)[1],
            car_a,
        ]
    )
    columns = np.array(
        [
            GEAR * np.eye(5)[3],
            on_carriage(0.1, 0.0)[0] - on_frame(0.1, 0.2)[0],
            on_frame(0.2, 0.1)[1],
        ]
    )
    s = 2j * np.pi * freq_hz[:, None, None]
    dynamic = s**2 * masses * mass + s * damping + stiffness
    receptance = rows @ np.linalg.solve(dynamic, columns.T)
    orders = np.array([0, 2, 2, 2, 2, 2])[:, None]  # the encoder reads positions
    return s**orders * receptance


def close_servo(values: np.ndarray, law: np.ndarray) -> np.ndarray:
    """Return the FRFs with u = -K y closed from the encoder to the drive.

    Args:
        values: FRFs of the open axis; (n_freq, n_out, n_in).
        law: K at every line; (n_freq,).
    """
    read, driven = values[:, [CHANNELS.index("encoder")]], values[:, :, [REFERENCES.index("drive")]]
    loop_gain = law * read[:, 0, REFERENCES.index("drive")]
    return values - driven * (law / (1 + loop_gain))[:, None, None] * read


def write_encoder_campaign(
    folder: Path,
    *,
    scales: Mapping[str, float] | None = None,
    added_mass: float = 0.0,
    gains: Mapping[str, float] | None = None,
    delays: Mapping[str, float] | None = None,
    extra: str = "",
    seed: int = 1,
    lines: int = 150,
    noise: float = 0.01,
    loop: Callable[[np.ndarray], np.ndarray] | None = None,
    masses: float = 1.0,
    further: Mapping[str, Mapping[str, float]] | None = None,
) -> None:
    """Write model.xml, test.npz and campaign.toml.

    Args:
        folder: where.
        scales: factors on stiffnesses of the real machine, by joint.
        added_mass: of the real carriage [kg].
        gains: what channels and references read per SI unit, by label.
        delays: of channels and references [s], by label; those of a reference make H lag.
        extra: further lines of campaign.toml.
        seed: of the noise.
        lines: number of lines.
        noise: of each channel, relative to its rms.
        loop: K(s) with its delay of a loop that was closed, from the encoder to the drive.
        masses: factor on all masses and moments of inertia of the real machine.
        further: further tests by the line of campaign.toml that states their model or pose, with
            ``added_mass`` or ``shift`` of the real machine in them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_axis(folder / "model.xml")
    gains, delays = gains or {}, delays or {}
    freq = np.linspace(8.0, 160.0, lines)
    random = np.random.default_rng(seed)
    channels, references = list(CHANNELS), list(REFERENCES)
    blocks = []
    for number, (line, state) in enumerate({"": {}, **(further or {})}.items()):
        real = {**state, "added_mass": added_mass + state.get("added_mass", 0.0)}
        values = axis_frfs(freq, scales or {}, masses=masses, **real)
        if loop is not None:
            values = close_servo(values, loop(2j * np.pi * freq))
        sigma = noise * np.sqrt((np.abs(values) ** 2).mean(axis=0))
        error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
        measured = values + error[0] + 1j * error[1]
        coherence = 1 / (1 + (AVERAGES - 1) * sigma**2 / np.abs(measured) ** 2)
        for axis, names in ((1, CHANNELS), (2, REFERENCES)):
            for place, name in enumerate(names):
                factor = gains.get(name, 1.0) * np.exp(-2j * np.pi * freq * delays.get(name, 0.0))
                cells = [slice(None)] * 3
                cells[axis] = place
                measured[tuple(cells)] *= factor[:, None]
        file = f"test{number or ''}.npz"
        np.savez(folder / file, frf=measured, coherence=coherence, freq_hz=freq)
        blocks.append(
            f'[[test]]\nfile = "{file}"\naverages = {AVERAGES}\nchannels = {channels}\n'
            f"references = {references}\n{line}\n"
        )
    (folder / "campaign.toml").write_text(
        f'model = "model.xml"\n{"".join(blocks)}{extra}', encoding="utf-8"
    )
