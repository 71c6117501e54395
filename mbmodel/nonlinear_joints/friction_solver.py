r"""Parameters of MuJoCo's solver with which ``frictionloss`` acts as Coulomb friction.

MuJoCo's manual, chapters Computation ("Parameters") and Modeling ("Friction"), gives the state
equation. A row of friction has no position residual, so its reference acceleration is -b v. The
solver interpolates between this and the acceleration a without friction, by the impedance d, as far
as the limit F allows. For a joint that moves the mass m, the force is

    f = -clip(m d (b v + a), -F, F).

- It reverses with v + a / b, not with v: at the angular frequency w it leads the motion by
  atan(w / b). No part of a step h can be resolved, so b = 1 / h is enough, and an error estimate
  that compares steps sees the lead only if b grows as h shrinks.
- Below F it gives way like a damper m b d / (1 - d).
- While it sticks, v decays at the rate b d, which an explicit integrator of step h follows if
  b d h < 2.

A positive ``solreffriction`` (T, ratio) has b = 2 / (d T); the ratio has no effect on friction.
The flag ``refsafe``, on by default, raises T to 2 h. A T far below any step thus gives
b = 1 / (d h): friction then vanishes or reverses with v + d h a, the velocity at the end of the
step. That is the time-stepping scheme of Moreau (1988) and Jean (1999) for Coulomb friction, of
first order in h and stable for every h. The remaining creep is that of a damper m / (h (1 - d)). In
a simulation d follows from the step, so that this is 1e8 1/s times the mass for steps up to 0.1 ms.

The direct format (-stiffness, -damping) has a fixed b = damping / d, which ``refsafe`` does not
bound: one b is either late for short steps or unstable for long ones.
"""

import mujoco
import numpy as np

from identification.words import Real

_TIME_CONSTANT_S = 1e-9  # below every step, so that refsafe sets it to two steps
IMPEDANCE_RANGE = (1e-4, 0.9999)  # to which MuJoCo clips impedances (mjMINIMP, mjMAXIMP)
_MAX_IMPEDANCE = IMPEDANCE_RANGE[1]
_MIN_STEP_IMPEDANCE = 0.9  # the force still reverses within a step, for steps below 0.1 us
# Damper over mass, below the limit, for steps of 0.1 us to 0.1 ms; 1 N on 1 kg creeps by 10 nm/s. A
# creep that depended on the step would look like an error of the step.
CREEP_RATE = 1e8  # 1/s
FRICTION_SOLVER: dict[str, tuple[float, ...]] = {
    "solreffriction": (_TIME_CONSTANT_S, 1.0),
    "solimpfriction": (_MAX_IMPEDANCE, _MAX_IMPEDANCE, 0.001),
}
# Settings that a simulation replaces: MuJoCo's defaults, with which friction is soft, and those
# that write_nonlinear_joints wrote before, which lead by 17 deg at 50 Hz.
_REPLACED = (
    ((0.02, 1.0), (0.9, 0.95, 0.001)),
    ((0.002, 1.0), (0.999, 0.999, 0.001)),
)


def has_dry_friction(compiled: mujoco.MjModel) -> bool:
    """Return whether a joint or tendon of a compiled model has ``frictionloss``."""
    return bool((compiled.dof_frictionloss > 0).any() or (compiled.tendon_frictionloss > 0).any())


def set_friction_solver(compiled: mujoco.MjModel, step_s: float) -> None:
    """Let dry friction act at the right instant for a step, unless the file sets its solver.

    Where it does so, ``refsafe`` is switched on for the whole model: it also bounds time constants
    of other constraints to two steps.

    Args:
        compiled: the compiled model, which is changed.
        step_s: of the integration [s].
    """
    impedance = float(
        np.clip(1.0 - 1.0 / (CREEP_RATE * step_s), _MIN_STEP_IMPEDANCE, _MAX_IMPEDANCE)
    )
    rows = (
        (compiled.dof_frictionloss, compiled.dof_solref, compiled.dof_solimp),
        (compiled.tendon_frictionloss, compiled.tendon_solref_fri, compiled.tendon_solimp_fri),
    )
    for losses, references, impedances in rows:
        for row in np.flatnonzero(losses > 0):
            if is_replaced(references[row], impedances[row]):
                references[row] = FRICTION_SOLVER["solreffriction"]
            if references[row, 0] == _TIME_CONSTANT_S:
                impedances[row, :2] = impedance
                compiled.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)


def is_replaced(reference: Real, impedance: Real) -> bool:
    """Return whether ``set_friction_solver`` replaces the parameters of a row of friction.

    Args:
        reference: ``solreffriction``; (2,).
        impedance: ``solimpfriction``; (5,).
    """
    return any(
        np.array_equal(reference, solref) and np.array_equal(impedance[:3], solimp)
        for solref, solimp in _REPLACED
    )


def reversal_rate(reference: Real, impedance: Real) -> float | None:
    """Return the rate b of a row of friction [1/s]; None if it follows from the step.

    Args:
        reference (2,), impedance (5,): as for ``is_replaced``.
    """
    if is_replaced(reference, impedance) or reference[0] == _TIME_CONSTANT_S:
        return None
    width_impedance = float(np.clip(impedance[1], *IMPEDANCE_RANGE))
    if reference[0] > 0:
        return 2.0 / (width_impedance * float(reference[0]))
    return float(-reference[1]) / width_impedance


def creep_rate(rate: float, impedance: Real) -> float:
    """Return the damper as which friction gives way below its limit, over the mass [1/s].

    Args:
        rate: at which the force reverses, b [1/s].
        impedance: ``solimpfriction``; (5,).
    """
    constant = float(np.clip(impedance[0], *IMPEDANCE_RANGE))
    return rate * constant / (1.0 - constant)
