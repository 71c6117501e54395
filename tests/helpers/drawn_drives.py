"""Campaigns from motors to encoders of machines that ``truth/`` draws, with unknown gains."""

from pathlib import Path

import numpy as np

from identification.words import Real
from tests.helpers.truth_ports import joint_row, plant_receptance
from truth import Plan, write_campaign
from truth.campaign.virtual_test import Subject, draw_subject, measure_subject
from truth.machine.station import Station
from truth.random_streams import stream

FREQ_HZ = np.arange(4.0, 200.0, 1.0)
_HITS = 20  # averages
_DRIVES = 3


def write_drive_campaign(
    nominal: Station, plan: Plan, folder: Path, noise: float = 0.01
) -> tuple[Subject, dict[str, float]]:
    """Write a campaign from motors along joints to encoders of all joints.

    The drives read amperes and one encoder reads counts; the other encoders are in m and rad.

    Args:
        nominal: machine to draw about.
        plan: of the machine and what its drawing lacks.
        folder: where.
        noise: of each FRF, relative to its mean size.

    Returns:
        The machine; the gains by the name of their motor or encoder.
    """
    subject = draw_subject(nominal, plan)
    write_campaign(measure_subject(subject, plan, nominal.name), folder)
    joints = [joint.name for stage in subject.drawing.stages for joint in stage.joints]
    random = stream(plan.seed, "drives")
    driven = [joints[k] for k in sorted(random.choice(len(joints), _DRIVES, replace=False))]
    gains = {f"motor_{name}": float(np.exp(random.normal())) for name in driven}
    gains[f"encoder_{joints[0]}"] = -1e5 * float(np.exp(random.normal()))
    add_ports(folder / "model.xml", driven, joints)
    occasion = subject.scene.occasions[0]
    tested = subject.machine.prepare(occasion)
    outputs, inputs = ([joint_row(tested, name) for name in names] for names in (joints, driven))
    frfs = plant_receptance(subject.machine.rig(occasion), outputs, inputs, FREQ_HZ)
    scales = [gains.get(f"encoder_{name}", 1.0) for name in joints]
    frfs = frfs * np.outer(scales, [gains[f"motor_{name}"] for name in driven])
    _write_files(folder, frfs, noise, random, driven, joints)
    return subject, gains


def add_ports(model: Path, driven: list[str], joints: list[str]) -> None:
    """Write motors and encoders into an MJCF."""
    motors = "".join(f'<motor name="motor_{name}" joint="{name}"/>' for name in driven)
    encoders = "".join(f'<jointpos name="encoder_{name}" joint="{name}"/>' for name in joints)
    text = model.read_text(encoding="utf-8")
    ports = f"<actuator>{motors}</actuator><sensor>{encoders}</sensor></mujoco>"
    model.write_text(text.replace("</mujoco>", ports), encoding="utf-8")


def _write_files(
    folder: Path,
    frfs: np.ndarray,
    noise: float,
    random: np.random.Generator,
    driven: list[str],
    joints: list[str],
) -> None:
    """Write FRFs with noise and coherence, and campaign.toml, instead of the hammer test."""
    deviation: Real = noise * np.abs(frfs).mean(axis=0)
    normal = random.standard_normal((2, *frfs.shape)) / np.sqrt(2)
    measured = frfs + deviation * (normal[0] + 1j * normal[1])
    power = np.abs(frfs) ** 2
    coherence = power / (power + (_HITS - 1) * deviation**2)
    np.savez(folder / "drives.npz", frf=measured, coherence=coherence, freq_hz=FREQ_HZ)
    unknown = [*(f"[hammer.motor_{name}]" for name in driven), f"[sensor.encoder_{joints[0]}]"]
    lines = [
        'model = "model.xml"',
        "[[test]]",
        'file = "drives.npz"',
        'quantity = "receptance"',
        f"averages = {_HITS}",
        f"channels = {[f'encoder_{name}' for name in joints]!r}",
        f"references = {[f'motor_{name}' for name in driven]!r}",
        *(f'{table}\ngain = "unknown"' for table in unknown),
    ]
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
