"""A machine with motors, encoders and all MuJoCo sensors that have a linear model."""

from pathlib import Path

import mujoco
import numpy as np

PORT_MACHINE = """<mujoco model="axis">
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <site name="ref0" pos="0.3 0 0"/>
    <body name="frame" pos="0 0 0.3">
      <joint name="frame_tx" type="slide" axis="1 0 0" stiffness="5e6" damping="2e3"/>
      <joint name="frame_tz" type="slide" axis="0 0 1" stiffness="6e6" damping="2e3"/>
      <joint name="frame_ry" type="hinge" axis="0 1 0" stiffness="4e5" damping="2e2" pos="0 0 -.3"/>
      <geom type="box" size="0.3 0.2 0.1" density="2000"/>
      <site name="magnet" pos="0.1 0 0.12" euler="0 20 10"/>
      <site name="acc1" pos="0.3 0.1 0.1" euler="10 0 30"/>
      <body name="carriage" pos="0 0 0.2">
        <joint name="carriage_tx" type="slide" axis="1 0 0" stiffness="1e4" damping="50"/>
        <joint name="carriage_ry" type="hinge" axis="0 1 0" stiffness="2e5" damping="20"/>
        <geom type="box" size="0.1 0.1 0.05" density="4000"/>
        <site name="coil" pos="0.1 0 -0.08" euler="0 20 10"/>
        <site name="acc2" pos="0.05 0 0.05" euler="0 0 45"/>
        <site name="foot" pos="0 0 -0.05"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="strut" stiffness="1e4"><site site="ref0"/><site site="coil"/></spatial>
    <fixed name="sum">
      <joint joint="frame_tx" coef="1"/><joint joint="carriage_tx" coef="-2"/>
    </fixed>
  </tendon>
  <actuator>
    <motor name="drive" joint="carriage_tx" gear="35"/>
    <motor name="voice_coil" site="coil" refsite="magnet" gear="1 0 0 0 0 0"/>
    <motor name="jet" site="acc2" gear="0 2 0 0 0 1"/>
    <position name="servo" joint="carriage_ry" kp="1e4" kv="10"/>
    <motor name="pull" tendon="strut" gear="2"/>
  </actuator>
  <sensor>
    <jointpos name="encoder" joint="carriage_tx"/>
    <jointvel name="tacho" joint="carriage_ry"/>
    <tendonpos name="length" tendon="strut"/>
    <tendonvel name="rate" tendon="sum"/>
    <actuatorpos name="drive_pos" actuator="drive"/>
    <actuatorvel name="jet_vel" actuator="jet"/>
    <actuatorpos name="pull_pos" actuator="pull"/>
    <actuatorpos name="coil_pos" actuator="voice_coil"/>
    <framepos name="place" objtype="site" objname="coil"/>
    <framepos name="gap" objtype="site" objname="coil" reftype="site" refname="magnet"/>
    <framelinvel name="linvel" objtype="body" objname="carriage" reftype="site" refname="magnet"/>
    <frameangvel name="angvel" objtype="xbody" objname="carriage" reftype="site" refname="magnet"/>
    <framelinacc name="linacc" objtype="site" objname="acc2"/>
    <frameangacc name="angacc" objtype="site" objname="acc2"/>
    <framexaxis name="x_axis" objtype="site" objname="coil" reftype="site" refname="magnet"/>
    <framequat name="attitude" objtype="site" objname="coil"/>
    <accelerometer name="imu" site="acc2"/>
    <gyro name="gyro" site="acc2"/>
    <velocimeter name="velocity" site="acc1"/>
    <force name="force" site="foot"/>
    <torque name="torque" site="foot"/>
    <actuatorfrc name="servo_force" actuator="servo"/>
    <jointactuatorfrc name="joint_force" joint="carriage_tx"/>
    <subtreecom name="com" body="carriage"/>
    <touch name="touch" site="foot"/>
    <jointpos name="clipped" joint="carriage_tx" cutoff="1e-9"/>
  </sensor>
</mujoco>
"""
_STEP = 1e-6  # m or rad, m/s, N: of central differences


def write_port_machine(folder: Path) -> Path:
    """Write the machine as an MJCF and return its path."""
    path = folder / "axis.xml"
    path.write_text(PORT_MACHINE, encoding="utf-8")
    return path


def state_space_by_differences(
    path: Path, wrenches: dict[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return A, B, C, D of a machine at rest from central differences of ``mj_forward``.

    Args:
        path: of the MJCF.
        wrenches: wrenches at the bodies' inertial frames, (n_body, 6) each: inputs after the
            controls.

    Returns:
        States are positions and velocities of the joints, inputs the controls and wrenches,
        outputs all numbers of the sensors.
    """
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for _ in range(30):  # Newton's method for the static equilibrium
        stiffness, force = np.zeros((model.nv, model.nv)), _forward(model, data, data.qpos)[0]
        for k in range(model.nv):
            change = np.zeros(model.nv)
            change[k] = _STEP
            above = _forward(model, data, data.qpos + change)[0]
            below = _forward(model, data, data.qpos - change)[0]
            stiffness[:, k] = (above - below) / (2 * _STEP)
        data.qpos[:] -= np.linalg.solve(stiffness, force)
    nv, rest = model.nv, data.qpos.copy()
    columns = []
    for k in range(2 * nv + model.nu + len(wrenches)):
        sides = []
        for sign in (1.0, -1.0):
            change = np.zeros(2 * nv + model.nu)
            xfrc = np.zeros((model.nbody, 6))
            if k < len(change):
                change[k] = sign * _STEP
            else:
                xfrc = sign * _STEP * list(wrenches.values())[k - len(change)]
            position, velocity, control = np.split(change, [nv, 2 * nv])
            sides.append(_forward(model, data, rest + position, velocity, control, xfrc))
        columns.append([(a - b) / (2 * _STEP) for a, b in zip(*sides, strict=True)])
    acceleration, sensor = (np.array([column[i] for column in columns]).T for i in range(2))
    a = np.vstack([np.eye(2 * nv)[nv:], acceleration[:, : 2 * nv]])
    b = np.vstack([np.zeros((nv, len(columns) - 2 * nv)), acceleration[:, 2 * nv :]])
    return a, b, sensor[:, : 2 * nv], sensor[:, 2 * nv :]


def _forward(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    position: np.ndarray,
    velocity: np.ndarray | None = None,
    control: np.ndarray | None = None,
    xfrc: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    probe = mujoco.MjData(model)
    probe.qpos[:] = position
    probe.qvel[:] = 0 if velocity is None else velocity
    probe.ctrl[:] = 0 if control is None else control
    probe.xfrc_applied[:] = 0 if xfrc is None else xfrc
    mujoco.mj_forward(model, probe)
    return probe.qacc.copy(), probe.sensordata.copy()
