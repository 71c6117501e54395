"""A compiled MJCF in which stiffness, masses and joints can be set, to find where it then rests."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np

from identification.words import ConvergenceError, Real
from mbmodel.linearisation.closed_chains import Chains
from mbmodel.linearisation.equilibrium import find_equilibrium
from mbmodel.linearisation.force_slopes import compute_forces, net_force
from mbmodel.linearisation.tendon_slopes import tendon_elongation
from mbmodel.mjcf.edit import Addition, Edit, NotInMjcf
from mbmodel.mjcf.keyframes import pose_data
from mbmodel.mjcf.names import body_name, joint_name, tendon_name

# All numbers on which the forces at rest depend and which Parts change.
_STATIC_FIELDS = (
    "jnt_stiffness",
    "tendon_stiffness",
    "body_mass",
    "body_ipos",
    "jnt_pos",
    "jnt_axis",
)
_MIN_FORCE_SHARE = 1e-9  # of the largest force at rest: less is the rounding of the search

StaticEdits = Iterable[Edit | Addition | NotInMjcf]


@dataclass(frozen=True, eq=False)
class Statics:
    """A compiled MJCF at rest.

    Args:
        model: the compiled model; never changed.
        path: of the MJCF, for messages.
        keyframe: that gives the controls; empty for none.
        pose: joint positions at rest [m, rad]; (nq,).
        stages: MJCF body number of each stage.
        frames: axes of the stages at rest, in columns, in world axes; (n_stage, 3, 3).
        centres: centres of mass in these axes, from the origin of the MJCF body [m]; (n_stage, 3).
        chains: those at the nominal rest that are closed; None without any.
    """

    model: mujoco.MjModel
    path: Path
    keyframe: str
    pose: Real
    stages: tuple[int, ...]
    frames: Real
    centres: Real
    chains: Chains | None = None

    @property
    def n_coordinate(self) -> int:
        """Number of coordinates of the MJCF's machine: the joints' that its chains leave."""
        return self.model.nv if self.chains is None else len(self.chains.kept)

    def move(self, model: mujoco.MjModel, pose: Real, direction: Real, step: float) -> Real:
        """Return the pose at a step along a direction; chains stay closed; (nq,).

        Args:
            model: changed copy of the compiled model.
            pose: joint positions from which it goes; (nq,).
            direction: of the machine's coordinates [m, rad]; (n_coordinate,).
            step: multiple of the direction.
        """
        data = mujoco.MjData(model)
        data.qpos[:] = pose
        chains = self.chains_at(model, data)
        moved = direction if chains is None else chains.basis @ direction
        mujoco.mj_integratePos(model, data.qpos, moved, step)
        self.chains_at(model, data)
        return data.qpos.copy()

    def chains_at(self, model: mujoco.MjModel, data: mujoco.MjData) -> Chains | None:
        """Return the closed chains at a pose, closed in place; None without any.

        Args:
            model: as for ``move``.
            data: near a pose at which they close.

        Raises:
            ConvergenceError: they do not close.
        """
        if self.chains is None:
            return None
        chains = replace(self.chains, model=model).at(data)
        if chains is None:
            raise ConvergenceError(f"{self.path}: the chains do not close where the machine rests")
        return chains

    @cached_property
    def _numbers(self) -> dict[str, dict[str, int]]:
        """Numbers of joints, tendons and bodies by their names."""
        model = self.model
        return {
            "joint": {joint_name(model, k): k for k in range(model.njnt)},
            "tendon": {tendon_name(model, k): k for k in range(model.ntendon)},
            "inertial": {body_name(model, k): k for k in range(model.nbody)},
        }

    def data_at(self, model: mujoco.MjModel, pose: Real) -> mujoco.MjData:
        """Return a state at a pose, with the controls of the keyframe and all forces.

        Args:
            model: as ``with_edits`` returns it.
            pose: joint positions [m, rad]; (nq,).
        """
        data = pose_data(model, self.keyframe)
        data.qpos[:] = pose
        compute_forces(model, data)
        return data

    def with_edits(self, edits: StaticEdits) -> mujoco.MjModel:
        """Return a copy of the compiled model with other stiffness, masses, centres and joints.

        Args:
            edits: what Parts write into the MJCF; what does not act at rest is left out.
        """
        model = mujoco.MjModel.__copy__(self.model)
        self.apply(model, edits)
        return model

    def apply(self, model: mujoco.MjModel, edits: StaticEdits) -> None:
        """Set stiffness, masses, centres and joints in place.

        Args:
            model: as ``with_edits`` returns it.
            edits: as there.
        """
        for edit in edits:
            if not isinstance(edit, Edit):
                continue
            numbers, values = self._numbers, edit.values
            if edit.kind == "spring" and "stiffness" in values:
                if (joint := numbers["joint"].get(edit.name)) is not None:
                    model.jnt_stiffness[joint] = values["stiffness"]
                else:
                    model.tendon_stiffness[numbers["tendon"][edit.name]] = values["stiffness"]
            elif edit.kind == "inertial":
                body = numbers["inertial"][edit.name]
                model.body_mass[body], model.body_ipos[body] = values["mass"], values["pos"]
            elif edit.kind == "joint":
                joint = numbers["joint"][edit.name]
                model.jnt_pos[joint], model.jnt_axis[joint] = values["pos"], values["axis"]

    def find_pose(self, model: mujoco.MjModel) -> Real:
        """Return the joint positions at which a changed model rests; (nq,).

        Raises:
            ConvergenceError: it has no equilibrium.
        """
        start = self.data_at(model, self.pose)
        return find_equilibrium(model, self.path, start).data.qpos.copy()

    def force_change(
        self, model: mujoco.MjModel, data: mujoco.MjData, lower: StaticEdits, upper: StaticEdits
    ) -> Real:
        """Return the difference of the net force at one pose between two sets of edits; (nv,).

        Args:
            model: as ``with_edits`` returns it; left as it was.
            data: its state.
            lower: edits of the force that is subtracted.
            upper: edits of the force from which it is.
        """
        original = {name: getattr(model, name).copy() for name in _STATIC_FIELDS}
        forces = []
        for edits in (upper, lower):
            self.apply(model, edits)
            compute_forces(model, data)
            forces.append(net_force(model, data).copy())
            for name, values in original.items():
                getattr(model, name)[:] = values
        return forces[0] - forces[1]


def is_preloaded(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Return whether any weight, spring, tendon or actuator exerts a force at rest."""
    has_weight = bool(model.opt.gravity.any()) and not (
        model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY
    )
    tension = model.tendon_stiffness * tendon_elongation(model, data)
    forces = np.concatenate([data.qfrc_passive, data.qfrc_actuator, tension])
    return has_weight or bool(np.abs(forces).max(initial=0.0) > _MIN_FORCE_SHARE)
