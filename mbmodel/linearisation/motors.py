"""Forces of a machine's actuators per unit of their controls, and the dynamics between both.

The activation w of a filter of MuJoCo follows w' = (u - w) / tau, that of an integrator w' = u
(manual, Computation, "Actuation model"). The force is linear in w at rest. So a control acts
through 1 / (tau s + 1), or 1 / s, whatever the machine does.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from identification.words import Complex, InputError, Real, UsageError
from mbmodel.mjcf.names import actuator_name
from mbmodel.mjcf.stages import stage_of
from mbmodel.mjcf.tendons import tendon_body_jacobian

# Limits of forces, which are lifted where the force per control is computed.
_FORCE_LIMITS = (
    "actuator_forcelimited",
    "jnt_actfrclimited",
    "tendon_actfrclimited",
    "actuator_actlimited",
)
_FILTERS = mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT
# Of the control, so small that a limit of the force which is not reached stays so [1].
_SMALL_CONTROL = 1e-6
# Relative to the largest force: a control that changes the force by less has no effect.
_MAX_GAIN_ERROR = 1e-6


@dataclass(frozen=True)
class Activation:
    """First-order dynamics between a control u and the activation w of its actuator.

    Args:
        rate: 1 / tau of a filter, 0 of an integrator [1/s].
    """

    rate: float

    @property
    def drive(self) -> float:
        """Rate of w per unit of u [1/s]."""
        return self.rate or 1.0

    def __call__(self, laplace: Complex) -> Complex:
        """Return w / u at each s; (n_freq,).

        Raises:
            UsageError: an integrator at s = 0.
        """
        if not self.rate and not laplace.all():
            raise UsageError(
                "an actuator that integrates its control has no finite response at 0 Hz: start the "
                "band above it"
            )
        return self.drive / (laplace + self.rate)


def _read_activation(model: mujoco.MjModel, actuator: int) -> Activation | None:
    """Return the dynamics of a filter or integrator; None for other actuators."""
    kind = mujoco.mjtDyn(model.actuator_dyntype[actuator])
    if kind in _FILTERS:
        return Activation(1 / max(float(model.actuator_dynprm[actuator, 0]), mujoco.mjMINVAL))
    return Activation(0.0) if kind == mujoco.mjtDyn.mjDYN_INTEGRATOR else None


def change_command(model: mujoco.MjModel, data: mujoco.MjData, control: int, change: float) -> None:
    """Change a control, and the activation that follows it at rest or integrates it, in place."""
    actuator = int(np.repeat(np.arange(model.nactuator), model.actuator_ctrlnum)[control])
    activation = _read_activation(model, actuator)
    if activation is None or activation.rate:
        data.ctrl[control] += change
    if activation is not None:
        data.act[model.actuator_actadr[actuator]] += change


@dataclass(frozen=True, eq=False)
class ActuatorGain:
    """Forces of an actuator per unit of its control, or of its activation.

    Args:
        joint: generalised forces of an actuator at a joint or fixed tendon; (nv,).
        body: forces at the centres of mass of an actuator at a site or spatial tendon;
            (6 n_body,).
        activation: dynamics from the control to the activation; None if the control acts at once.
    """

    joint: Real
    body: Real
    activation: Activation | None = None


def actuator_gains(  # one argument for each thing known of the machine at rest
    model: mujoco.MjModel,
    data: mujoco.MjData,
    path: Path,
    stages: list[int],
    centres: tuple[Real, ...],
    jacobian: Real,
    *,
    only_at_bodies: bool = False,
) -> tuple[dict[str, ActuatorGain], tuple[str, ...]]:
    """Return the gain of each actuator by name, and remarks on actuators without effect.

    Forces are linear in the control or activation, so the generalised force is the difference of
    two of them.
    An actuator at a site exerts a wrench along its gear, and its opposite on a reference site; one
    at a spatial tendon exerts the tendon's pull. These act at bodies, so that they follow when
    joints move. An actuator with several controls is as many inputs, ``<name>.0``, ``<name>.1`` and
    so on. One without controls is none: its stiffness and damping belong to the machine.

    Args:
        stages: MJCF body number of each stage.
        centres: centre of mass of each stage [m]; (3,) each.
        jacobian: T; (6 n_body, nv).
        only_at_bodies: whether to leave out actuators that act at joints.

    Raises:
        InputError: an actuator whose force is at a limit at rest.
    """
    pulls = tendon_body_jacobian(model, data, stages, centres) if model.nactuator else {}
    gains: dict[str, ActuatorGain] = {}
    idle = []
    for actuator in range(model.nactuator):
        name, count = actuator_name(model, actuator), int(model.actuator_ctrlnum[actuator])
        wrench = wrench_at_bodies(model, data, actuator, pulls, stages, centres)
        if only_at_bodies and wrench is None:
            continue
        for k in range(count):
            joint = _force_per_control(model, data, int(model.actuator_ctrladr[actuator]) + k)
            if joint is None:
                raise InputError(
                    f"{path}: actuator {name!r} is at a limit of its force at rest, where it has "
                    "no linear model: widen forcerange or actuatorfrcrange"
                )
            if not joint.any():
                idle.append(name)
                continue
            port = name if count == 1 else f"{name}.{k}"
            activation = _read_activation(model, actuator)
            gains[port] = ActuatorGain(*_split_gain(joint, wrench, jacobian), activation)
    return gains, _idle_remarks(idle)


def _idle_remarks(idle: list[str]) -> tuple[str, ...]:
    """Return a remark that names actuators whose controls exert no force."""
    if not idle:
        return ()
    names = ", ".join(repr(name) for name in dict.fromkeys(idle))
    return (
        f"the controls of {names} exert no force at rest, by a flag, a group that is switched off, "
        "a muscle, whose activation is held, or geometry: they are no inputs",
    )


def _split_gain(joint: Real, wrench: Real | None, jacobian: Real) -> tuple[Real, Real]:
    """Return a generalised force as a wrench at bodies, if it has one, and the rest at joints."""
    if wrench is None or not (row := jacobian.T @ wrench).any():
        return joint, np.zeros(len(jacobian))
    moved = np.abs(joint) > _MAX_GAIN_ERROR * np.abs(joint).max()
    body = wrench * (joint[moved] @ row[moved]) / (row[moved] @ row[moved])
    return joint - jacobian.T @ body, body


def _force_per_control(model: mujoco.MjModel, data: mujoco.MjData, control: int) -> Real | None:
    """Return the generalised force per unit of a command, or None at a limit of force; (nv,)."""
    original = {name: getattr(model, name).copy() for name in _FORCE_LIMITS}
    flags = model.opt.disableflags
    try:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL
        limited = [
            _control_difference(model, data, control, change) / change
            for change in (_SMALL_CONTROL, -_SMALL_CONTROL)
        ]
        for name in _FORCE_LIMITS:
            getattr(model, name)[:] = 0
        force = _control_difference(model, data, control, 1.0)
    finally:
        model.opt.disableflags = flags
        for name, value in original.items():
            getattr(model, name)[:] = value
    scale = max(np.abs(force).max(), np.abs(data.qfrc_actuator).max(), 1e-300)
    rounding = _MAX_GAIN_ERROR * scale
    is_at_limit = any(np.abs(slope - force).max() > rounding for slope in limited)
    return None if is_at_limit else force


def _control_difference(
    model: mujoco.MjModel, data: mujoco.MjData, control: int, change: float
) -> Real:
    """Return the change of the generalised force with a change of one command; (nv,)."""
    forces = []
    for amount in (change, 0.0):
        probe = copy.copy(data)
        change_command(model, probe, control, amount)
        mujoco.mj_fwdPosition(model, probe)
        mujoco.mj_fwdVelocity(model, probe)
        mujoco.mj_fwdActuation(model, probe)
        forces.append(probe.qfrc_actuator.copy())
    return forces[0] - forces[1]


def wrench_at_bodies(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    actuator: int,
    pulls: Mapping[int, Real],
    stages: list[int],
    centres: tuple[Real, ...],
) -> Real | None:
    """Return the wrench of a unit actuator force at the bodies, or None if it acts at joints.

    Between a site and a reference site it acts on both, in opposite directions along the axes of
    the reference. MuJoCo leaves out coordinates that move both; their share is no wrench at bodies.

    Args:
        actuator: its number.
        pulls: rows of the spatial tendons, by the number of the tendon.
        stages, centres [m] (3,): as for ``actuator_gains``.
    """
    kind = mujoco.mjtTrn(model.actuator_trntype[actuator])
    target, reference = model.actuator_trnid[actuator].tolist()
    if kind == mujoco.mjtTrn.mjTRN_TENDON:
        return pulls.get(target)
    if kind != mujoco.mjtTrn.mjTRN_SITE:
        return None
    axes = data.site_xmat[target if reference < 0 else reference].reshape(3, 3)
    gear = model.actuator_gear[actuator]
    force, torque = axes @ gear[:3], axes @ gear[3:]
    wrench = np.zeros((len(stages), 6))
    for site, sign in ((target, 1.0), (reference, -1.0)):
        stage = stage_of(model, model.site_bodyid[site]) if site >= 0 else -1
        if stage in stages:
            arm = data.site_xpos[site] - centres[stages.index(stage)]
            wrench[stages.index(stage)] += sign * np.append(force, torque + np.cross(arm, force))
    return wrench.ravel() if wrench.any() else None
