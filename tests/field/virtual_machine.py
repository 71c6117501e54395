"""The machine of the field cases: a table and a stage with four modes, solved in closed form.

The table moves along z; the stage moves along z and tilts about x and y against it. With the
coordinates q = (z_table, z_stage, rx, ry) the equation of motion is M q'' + C q' + K q = B f, and
the accelerance at the sensors is H = -w^2 S (K + i w C - w^2 M)^-1 S^T, in the convention
exp(+i w t).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig

TABLE_KG, STAGE_KG = 60.0, 25.0
STAGE_INERTIA = (0.9, 1.3)  # kg m^2 about x and y
STIFFNESS = (1.6e6, 2.4e6, 6.0e4, 3.3e5)  # N/m, N/m, N m/rad, N m/rad
DAMPING = (180.0, 220.0, 4.6, 9.0)  # N s/m, N s/m, N m s/rad, N m s/rad
SITES = np.array([[0.2, 0.15], [-0.2, 0.15], [0.2, -0.1], [-0.15, -0.15], [0.05, 0.1]])  # m, stage
FREQ_HZ = 0.5 * np.arange(1, 221)
NOISE = 1e-2  # relative standard deviation of an FRF value
HEIGHT_M = 0.3  # of all sensors

MODEL = f"""<mujoco model="field_machine">
  <compiler angle="radian"/>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="table">
      <inertial pos="0 0 0" mass="{TABLE_KG:g}" diaginertia="2 2 3"/>
      <joint name="table_tz" type="slide" axis="0 0 1" stiffness="{STIFFNESS[0]:g}" damping="{DAMPING[0]:g}"/>
      <body name="stage" pos="0 0 {HEIGHT_M:g}">
        <inertial pos="0 0 0" mass="{STAGE_KG:g}" diaginertia="{STAGE_INERTIA[0]:g} {STAGE_INERTIA[1]:g} 1.9"/>
        <joint name="stage_tz" type="slide" axis="0 0 1" stiffness="{STIFFNESS[1]:g}" damping="{DAMPING[1]:g}"/>
        <joint name="stage_rx" type="hinge" axis="1 0 0" stiffness="{STIFFNESS[2]:g}" damping="{DAMPING[2]:g}"/>
        <joint name="stage_ry" type="hinge" axis="0 1 0" stiffness="{STIFFNESS[3]:g}" damping="{DAMPING[3]:g}"/>
{{sites}}
      </body>
    </body>
  </worldbody>
</mujoco>
"""  # noqa: E501


@dataclass(frozen=True, eq=False)
class Machine:
    """Mass, damping, stiffness and sensor matrices.

    Attributes:
        M, C, K: (4, 4).
        S: heights of the sensors per coordinate; (n_sensor, 4).
    """

    M: np.ndarray
    C: np.ndarray
    K: np.ndarray
    S: np.ndarray

    def accelerance(self, freq_hz=FREQ_HZ, references=(0, 2)):
        """Return the FRFs at all sensors; (n_freq, n_sensor, n_reference)."""
        omega = 2 * np.pi * np.asarray(freq_hz)[:, None, None]
        dynamic = self.K + 1j * omega * self.C - omega**2 * self.M
        force = np.broadcast_to(self.S[list(references)].T, (len(freq_hz), 4, len(references)))
        return -(omega**2) * (self.S @ np.linalg.solve(dynamic, force))

    def modes(self):
        """Return natural frequencies [Hz] and damping ratios, in rising order."""
        n = len(self.M)
        zero, unit = np.zeros((n, n)), np.eye(n)
        poles = eig(
            np.block([[zero, unit], [-self.K, -self.C]]),
            np.block([[unit, zero], [zero, self.M]]),
            right=False,
        )
        poles = sorted(poles[poles.imag > 0], key=abs)
        return np.abs(poles) / (2 * np.pi), -np.real(poles) / np.abs(poles)


def field_machine(stiffness=STIFFNESS, damping=DAMPING):
    """Return the machine, with other springs and dampers if stated."""
    x, y = SITES.T
    S = np.column_stack([np.ones_like(x), np.ones_like(x), y, -x])
    M = np.diag([TABLE_KG + STAGE_KG, STAGE_KG, *STAGE_INERTIA])
    M[0, 1] = M[1, 0] = STAGE_KG
    return Machine(M, np.diag(damping), np.diag(stiffness), S)


def model_text(length_scale=1.0):
    """Return the MJCF of the machine; ``length_scale`` multiplies the places of its sites."""
    sites = "\n".join(
        f'        <site name="acc{n}" pos="{x * length_scale:g} {y * length_scale:g} 0"/>'
        for n, (x, y) in enumerate(SITES, start=1)
    )
    return MODEL.replace("{sites}", sites)


def layout_text(length_scale=1.0):
    """Return the layout of the sensors; ``length_scale`` multiplies the places."""
    return "".join(
        f"[site.acc{n}]\nposition = "
        f"[{x * length_scale:g}, {y * length_scale:g}, {HEIGHT_M * length_scale:g}]\n"
        for n, (x, y) in enumerate(SITES, start=1)
    )


def add_noise(values, seed=1, relative=NOISE):
    """Return FRFs with complex noise, and the coherence of 10 hits.

    The noise of a channel is equal on all lines: ``relative`` times the median of |H|. The variance
    v of H1 from n hits is |H|^2 (1 - g2) / (g2 (n - 1)), so that g2 = 1 / (1 + (n - 1) v / |H|^2).
    """
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(*values.shape, 2)) @ [1, 1j] / np.sqrt(2)
    size = np.abs(values)
    deviation = relative * np.median(size, axis=0)
    return values + deviation * noise, 1 / (1 + 9 * (deviation / size) ** 2)
