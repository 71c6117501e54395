"""How far joints move in a simulation, and remarks where that reaches stops, or misses them."""

import mujoco
import numpy as np

from identification.words import Real
from mbmodel.mjcf.names import joint_name
from mbmodel.mjcf.refusals import is_enabled
from mbmodel.nonlinear_joints.files import describe_law, find_nonlinear_joints
from mbmodel.nonlinear_joints.friction_solver import IMPEDANCE_RANGE
from mbmodel.nonlinear_joints.laws import GapSpring, PolynomialSpring
from mbmodel.simulation.time_model import TimeModel

_SLIDE_OR_HINGE = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
_FIRST_COORDINATE = 1  # of MuJoCo's full physics state, behind the time


class JointReach:
    """The least and the largest coordinate of each joint in a simulation.

    Args:
        model: the machine at rest.
    """

    def __init__(self, model: TimeModel) -> None:
        """Begin at rest."""
        self._compiled = model.compiled
        kinds = [mujoco.mjtJoint(kind) for kind in model.compiled.jnt_type]
        self._joints = [joint for joint, kind in enumerate(kinds) if kind in _SLIDE_OR_HINGE]
        addresses = model.compiled.jnt_qposadr[self._joints]
        self._columns = _FIRST_COORDINATE + addresses
        self._springs: Real = model.compiled.qpos_spring[addresses]
        self._low: Real = model.start[self._columns].copy()
        self._high: Real = self._low.copy()

    def extend(self, states: Real) -> None:
        """Take further states into account.

        Args:
            states: MuJoCo's full physics states; (n_record, n_step, n_state).
        """
        places = states[:, :, self._columns]
        self._low = np.minimum(self._low, places.min(axis=(0, 1)))
        self._high = np.maximum(self._high, places.max(axis=(0, 1)))

    def remarks(self) -> tuple[str, ...]:
        """Return a sentence for each stop that is reached, and each law that the motion misses."""
        return (*self._limit_remarks(), *self._law_remarks())

    def _limit_remarks(self) -> list[str]:
        """Return a sentence for each joint that reaches the end of its range."""
        compiled, sentences = self._compiled, []
        if not is_enabled(compiled, mujoco.mjtDisableBit.mjDSBL_LIMIT):
            return []
        for low, high, joint in zip(self._low, self._high, self._joints, strict=True):
            if not compiled.jnt_limited[joint]:
                continue
            first, last = compiled.jnt_range[joint]
            beyond = max(first - low, high - last)
            if beyond > -compiled.jnt_margin[joint]:
                unit, stiffness_unit = _units(compiled, joint)
                sentences.append(
                    f"joint {joint_name(compiled, joint)!r} reaches the end of its range "
                    f"({first:.4g} to {last:.4g} {unit}) and goes {max(beyond, 0.0):.3g} {unit} "
                    "beyond: MuJoCo's stop is soft, a damped spring of about "
                    f"{limit_stiffness(compiled, joint):.3g} {stiffness_unit} by its solreflimit "
                    "and the inertia behind it; write a tendon with a dead band for a stop of "
                    "known stiffness"
                )
        return sentences

    def _law_remarks(self) -> list[str]:
        """Return a sentence for each gap that stays open and each spring beyond its peak force."""
        compiled, sentences = self._compiled, []
        rows = {joint_name(compiled, joint): row for row, joint in enumerate(self._joints)}
        for law in find_nonlinear_joints(compiled):
            row = rows[law.joint]
            low, high = self._low[row] - self._springs[row], self._high[row] - self._springs[row]
            unit, _ = _units(compiled, self._joints[row])
            start = f"joint {law.joint!r} has {describe_law(law)}, and moves from {low:.3g} to "
            if isinstance(law, GapSpring) and max(-low, high) < law.gap:
                sentences.append(f"{start}{high:.3g} {unit}: it never reaches a stop of its gap")
            elif isinstance(law, PolynomialSpring):
                peak = _first_negative(law.k, 2 * law.k2, 3 * law.k3)
                if peak is not None and low < peak < high:
                    sentences.append(
                        f"{start}{high:.3g} {unit}: its stiffness is negative beyond "
                        f"{peak:.3g} {unit}"
                    )
        return sentences


def limit_stiffness(compiled: mujoco.MjModel, joint: int) -> float:
    r"""Return the stiffness of the stops of a joint's range where they are first touched.

    MuJoCo's manual, chapters Computation ("Parameters") and Modeling ("Reference"): at rest the
    force f of a constraint obeys R f = k r, with the penetration r, R = (1 - d) / (d m), and
    k = d / (dw T ratio)^2, or k = stiffness d / dw^2 in the direct format. So f / r is
    m d^2 / ((1 - d) (dw T ratio)^2), in proportion to the inertia m; d and dw are the first two
    numbers of ``solimplimit``, T and ratio those of ``solreflimit``.

    Args:
        joint: number of the slide or hinge.

    Returns:
        [N/m or N m/rad].
    """
    first, second = (float(value) for value in compiled.jnt_solref[joint])
    impedances = np.clip(compiled.jnt_solimp[joint][:2], *IMPEDANCE_RANGE)
    near, far = (float(value) for value in impedances)
    stiffness = 1.0 / (first * second) ** 2 if first > 0 else -first
    inertia = 1.0 / float(compiled.dof_invweight0[compiled.jnt_dofadr[joint]])
    return inertia * stiffness * near**2 / ((1.0 - near) * far**2)


def unstable_springs(compiled: mujoco.MjModel) -> tuple[str, ...]:
    """Return a phrase for each polynomial spring that pushes away from rest beyond a place."""
    numbers = {joint_name(compiled, joint): joint for joint in range(compiled.njnt)}
    phrases = []
    for law in find_nonlinear_joints(compiled):
        if isinstance(law, PolynomialSpring):
            place = _first_negative(law.k, law.k2, law.k3)
            if place is not None:
                unit, _ = _units(compiled, numbers[law.joint])
                phrases.append(
                    f"joint {law.joint!r} has {describe_law(law)}, which pushes away from rest "
                    f"beyond {place:.3g} {unit}"
                )
    return tuple(phrases)


def _units(compiled: mujoco.MjModel, joint: int) -> tuple[str, str]:
    """Return the units of a joint's coordinate and of its stiffness."""
    is_slide = mujoco.mjtJoint(compiled.jnt_type[joint]) == mujoco.mjtJoint.mjJNT_SLIDE
    return ("m", "N/m") if is_slide else ("rad", "N m/rad")


def _first_negative(constant: float, linear: float, square: float) -> float | None:
    """Return the place nearest to 0 beyond which a parabola is negative, or None."""
    roots = np.roots([square, linear, constant])
    places = [float(root.real) for root in roots if root.imag == 0 and root.real]
    # Of a place and its mirror image the positive one comes first.
    places.sort(key=lambda place: (float(f"{abs(place):.9g}"), -place))
    for place in places:
        beyond = place * (1 + 1e-6)
        if constant + linear * beyond + square * beyond**2 < 0:
            return place
    return None
