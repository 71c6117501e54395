"""Diagnosis without a hammer: motors and encoders alone, a loop closed, beside a hammer test.

Each case is a virtual machine of random stages with one fault of the survival ratio 4 of its hammer
test. Three joints have a motor and all have an encoder; a servo is closed around the first motor.
``mbw excite`` chooses signals and amplitude for 60 s, for the nominal machine. The FRFs are those
of the true machine in the loop, with the variance that the excitation gives. Both tests are
diagnosed.

A fault is *found* if the most probable cause has its effect, and its place among its ``places``. A
*wrong cause* has a probability of 0.5 or more and is not there. In the environment:

* ``LIMIT=10``: the first ten cases only;
* ``JOBS=1``: processes.
"""

import os
import tempfile
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import numpy as np
from threadpoolctl import threadpool_limits

from diagnosis import build_verdict, diagnose
from identification.words import Complex, Real
from tests.bench.beside_background import truth_is_first, wrong_causes
from tests.bench.kept import cases, only_kept
from tests.helpers.drawn_drives import add_ports
from tests.helpers.truth_ports import joint_row, plant_receptance
from truth import Cause, Plan, Protocol, TruthError, Wanted, write_campaign
from truth.campaign.virtual_test import Subject, draw_subject, measure_subject
from truth.grade.answer import answer_from
from truth.grade.rates import rate_of
from truth.grade.read_verdict import verdict_from
from truth.machine.random_tree import draw_tree
from truth.random_streams import stream
from tuning import open_session
from tuning.excitation.design import Excitation, design_excitation
from tuning.excitation.limits import DriveLimits
from tuning.excitation.request import ExcitationOptions, build_request
from tuning.excitation.tested_machine import open_tested_machine

NAME = "without_hammer"
FIRST, COUNT = 990_000, 60
RATIO = 4.0
EFFECTS = (  # that a machine itself has, and no instrument
    "appendage",
    "feedback_delay",
    "flexible_body",
    "gyroscopic",
    "inertance",
    "joint_coupling",
    "mass_error",
    "missing_dof",
    "parallel_path",
    "structural_damping",
    "support_loss",
    "viscoelastic",
)
STAGES, DRIVES = 3, 3
BAND_HZ, SECONDS = (4.0, 200.0), 60.0
FORCE_N, TORQUE_NM = 200.0, 20.0  # of the drives; the hammer's level is 200 N
STEP = 1e-8  # m and rad, of the encoders
# The servo: a third of the joint's stiffness, with a lead from 100 to 2000 Hz.
SERVO_SHARE, SERVO_LEAD_HZ, SERVO_POLE_HZ = 0.3, 100.0, 2000.0
GAIN, DRIVE_GAIN, DELAY_S = 0.01, 0.02, 2e-5  # tolerances of encoders and drives
_TRIES, _NEXT_SEED = 5, 1_000


def run() -> list[dict[str, object]]:
    """Draw, diagnose and grade what is missing; return the rates of both tests."""
    limit = min(int(os.environ.get("LIMIT", COUNT)), COUNT)
    rows, _ = cases(
        NAME, range(COUNT if only_kept() else limit), _case, int(os.environ.get("JOBS", "1"))
    )
    return [_rate(test, rows) for test in ("drives", "hammer")]


def _rate(test: str, rows: Sequence[dict]) -> dict[str, object]:
    """Return the rates of one kind of test."""
    here = [row[test] for row in rows if test in row]
    found, wrong = (rate_of(float(row[name]) for row in here) for name in ("found", "wrong"))
    places = [row["places"] for row in here if row["found"]]
    return {
        "test": test,
        "n": len(here),
        "found %": None if found.rate is None else 100 * found.rate,
        "from": None if found.low is None else 100 * found.low,
        "to": None if found.high is None else 100 * found.high,
        "wrong cause %": None if wrong.rate is None else 100 * wrong.rate,
        "median places": median(places) if places else None,
        "core s": median(row["seconds"] for row in here) if here else None,
    }


def _case(number: int) -> dict[str, object]:
    """Return what both tests say of a machine."""
    effect = EFFECTS[number % len(EFFECTS)]
    for turn in range(_TRIES):
        seed = FIRST + number + turn * _NEXT_SEED
        nominal = draw_tree(seed, STAGES)
        protocol = Protocol((nominal.first_aim(),), lines=401, resolution_hz=0.5)
        plan = Plan(seed, Cause((Wanted(effect, ratio=RATIO),)), protocol)
        try:
            subject = draw_subject(nominal, plan)
            break
        except TruthError:
            continue
    else:
        return {"effect": effect, "left_out": "no place"}
    campaign = measure_subject(subject, plan, nominal.name)
    answer = campaign.answer.decode()
    with tempfile.TemporaryDirectory() as folder:
        hammer, drives = Path(folder) / "hammer", Path(folder) / "drives"
        write_campaign(campaign, hammer)
        write_campaign(campaign, drives)
        reached = write_excited_campaign(subject, drives, seed)
        row: dict[str, object] = {"effect": effect, "seed": seed, "reached": reached}
        return row | {path.name: _diagnosed(path, answer) for path in (hammer, drives)}


def _diagnosed(folder: Path, answer: str) -> dict[str, object]:
    """Return whether a diagnosis finds the fault, and what it says."""
    began = time.process_time()
    with threadpool_limits(1):
        verdict = build_verdict(diagnose(open_session(folder)))
    seconds = time.process_time() - began
    truth = answer_from(tomllib.loads(answer), "answer")
    stated = verdict_from(verdict.model_dump(mode="json"))
    first = verdict.causes[0] if verdict.causes else None
    return {
        "found": truth_is_first(truth, stated),
        "wrong": bool(wrong_causes(truth, stated)),
        "places": len(first.places or [first.location]) if first else 0,
        "said": f"{first.effect}@{first.location}" if first else verdict.verdict,
        "probability": first.probability if first else None,
        "true": [f"{cause.effect}@{cause.location}" for cause in truth.causes],
        "verdict": verdict.verdict,
        "seconds": seconds,
    }


def write_excited_campaign(subject: Subject, folder: Path, seed: int) -> dict[str, float]:
    """Write the test of a machine by its drives, with a servo closed; return what is reached.

    Args:
        subject: the machine.
        folder: campaign of its hammer test, whose model gets motors and encoders.
        seed: of drives, errors of instruments and noise.
    """
    random = stream(seed, "without_hammer")
    joints = [joint for stage in subject.drawing.stages for joint in stage.joints]
    names = [joint.name for joint in joints]
    numbers = sorted(random.choice(len(joints), DRIVES, replace=False).tolist())
    driven = [names[k] for k in numbers]
    add_ports(folder / "model.xml", driven, names)
    servo = SERVO_SHARE * joints[numbers[0]].stiffness
    zero, pole = (2 * np.pi * value for value in (SERVO_LEAD_HZ, SERVO_POLE_HZ))
    gain = servo * pole / zero
    loop = (
        f'[loop.servo]\ninput = "motor_{driven[0]}"\noutput = "encoder_{driven[0]}"\n'
        f"controller = {{ zeros = [{-zero!r}], poles = [{-pole!r}], gain = {gain!r} }}\n"
    )
    stated = {
        "channels": [f"encoder_{name}" for name in names],
        "references": [f"motor_{name}" for name in driven],
    }
    _write_toml(folder, stated, 2, loop)
    excitation = _excite(folder, stated, [joints[k].kind == "hinge" for k in numbers])
    freq_hz = excitation.plan.freq_hz
    frfs = _true_frfs(subject, names, driven, freq_hz)
    laplace = 2j * np.pi * freq_hz
    law = gain * (laplace + zero) / (laplace + pole)
    frfs = _close(frfs, law, numbers[0])
    frfs = frfs * _errors(random, GAIN, len(names), freq_hz)[:, :, None]
    frfs = frfs * _errors(random, DRIVE_GAIN, DRIVES, freq_hz)[:, None]
    variance = np.stack([t.estimate.variance[:, :, 0] for t in excitation.campaign.tests], axis=2)
    normal = random.standard_normal((2, *frfs.shape)) / np.sqrt(2)
    frfs = frfs + np.sqrt(variance) * (normal[0] + 1j * normal[1])
    np.savez(folder / "drives.npz", frf=frfs, variance=variance, freq_hz=freq_hz)
    _write_toml(folder, stated, excitation.plan.averages, loop)
    pairs = zip(excitation.limited, excitation.peaks(), strict=True)
    return {f"{each.drive} {each.what}": peak / each.limit for each, peak in pairs}


def _excite(folder: Path, stated: dict[str, list[str]], turns: Sequence[bool]) -> Excitation:
    """Return the excitation of the nominal machine in its loop."""
    tested = open_tested_machine(folder)
    limits = {
        name: DriveLimits(force=TORQUE_NM if is_torque else FORCE_N)
        for name, is_torque in zip(stated["references"], turns, strict=True)
    }
    steps = dict.fromkeys(stated["channels"], STEP)
    options = ExcitationOptions(limits, stated["channels"], {}, steps, BAND_HZ, SECONDS, 2000.0)
    request, _ = build_request(tested.machine, options)
    return design_excitation(tested.machine, request, tested.tolerance)


def _true_frfs(
    subject: Subject, names: Sequence[str], driven: Sequence[str], freq_hz: Real
) -> Complex:
    """Return positions of joints per force of motors, loops open; (n_freq, n_out, n_in)."""
    occasion = subject.scene.occasions[0]
    tested = subject.machine.prepare(occasion)
    outputs, inputs = ([joint_row(tested, name) for name in each] for each in (names, driven))
    return plant_receptance(subject.machine.rig(occasion), outputs, inputs, freq_hz)


def _close(frfs: Complex, law: Complex, read: int) -> Complex:
    """Return FRFs with u = -K y closed from one encoder to the first motor."""
    encoder, motor = frfs[:, read], frfs[:, :, 0]
    correction = law / (1 + law * encoder[:, 0])
    return frfs - correction[:, None, None] * motor[:, :, None] * encoder[:, None]


def _errors(random: np.random.Generator, gain: float, count: int, freq_hz: Real) -> Complex:
    """Return gain and delay of each channel; (n_freq, count)."""
    gains = 1 + gain * random.standard_normal(count)
    delays = DELAY_S * random.standard_normal(count)
    return gains * np.exp(-2j * np.pi * freq_hz[:, None] * delays)


def _write_toml(folder: Path, stated: dict[str, list[str]], averages: int, loop: str) -> None:
    """Write campaign.toml of the test by drives."""
    (folder / "campaign.toml").write_text(
        'model = "model.xml"\n[[test]]\nfile = "drives.npz"\nquantity = "receptance"\n'
        f"averages = {averages}\nchannels = {stated['channels']!r}\n"
        f"references = {stated['references']!r}\n{loop}",
        encoding="utf-8",
    )
