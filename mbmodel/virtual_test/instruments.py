"""Errors of accelerometers and hammer, drawn within tolerances as the models of Parts have them.

A sensor of gains g, transverse sensitivity S, true axes R a_k at r + offset and delays tau reads
y_k = sum_j (diag(g) + S)_kj l_j (v, w), delayed by tau_k; see ``mbmodel.parts``. The force channel
makes H_measured = gain exp(-i w delay) H: it reads f / gain, ahead by ``delay``.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from identification.words import Dof, Layout, Real, Tolerance
from mbmodel.spatial import rotation_matrix

NO_ERRORS = Tolerance(  # stiffness and damping are no instruments
    **dict.fromkeys(vars(Tolerance()).keys() - {"stiffness", "damping"}, 0.0)
)
_SYMMETRIC_PAIRS = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, eq=False)
class SensorErrors:
    """Errors of one accelerometer.

    Args:
        gains: of the channels x y z; (3,).
        rotation: rotation vector from the drawn to the true axes, world axes [rad]; (3,).
        offset: true place minus the drawn one, world axes [m]; (3,).
        cross: symmetric transverse sensitivity of xy, xz, yz; (3,).
        delays: of the channels [s]; (3,).
    """

    gains: Real
    rotation: Real
    offset: Real
    cross: Real
    delays: Real

    @property
    def mix(self) -> Real:
        """Readings per acceleration along the true axes, diag(g) + S; (3, 3)."""
        matrix = np.diag(self.gains)
        for size, (first, second) in zip(self.cross, _SYMMETRIC_PAIRS, strict=True):
            matrix[first, second] = matrix[second, first] = size
        return matrix


@dataclass(frozen=True, eq=False)
class HammerErrors:
    """Errors of the hits along one direction.

    Args:
        rotation: true direction is the drawn one turned by this rotation vector [rad]; (3,).
        offset: true place minus the drawn one [m]; (3,).
    """

    rotation: Real
    offset: Real


@dataclass(frozen=True, eq=False)
class ForceChannelErrors:
    """Errors of a hammer's force channel: H_measured = gain exp(-i w delay) H.

    Args:
        gain: factor on the FRFs.
        delay: [s]; negative for a force channel that lags.
    """

    gain: float
    delay: float


@dataclass(frozen=True, eq=False)
class Instruments:
    """Drawn errors of all instruments.

    Args:
        sensors: by the name of the site.
        hammers: by point and positive direction.
        force_channels: by the name of the hammer.
    """

    sensors: Mapping[str, SensorErrors]
    hammers: Mapping[Dof, HammerErrors]
    force_channels: Mapping[str, ForceChannelErrors]


def draw_instruments(
    sites: Iterable[str],
    references: Iterable[Dof],
    hammers: Iterable[str],
    tolerance: Tolerance,
    random: np.random.Generator,
) -> Instruments:
    """Draw the errors of all instruments, normal with the tolerances as standard deviations.

    Args:
        sites: names of the accelerometers' sites.
        references: points and directions that are hit.
        hammers: names of the hammers.
        tolerance: one standard deviation each; those of masses and joints are not used.
    """

    def vector(deviation: float) -> Real:
        return deviation * random.standard_normal(3)

    return Instruments(
        {
            site: SensorErrors(
                1 + vector(tolerance.sensor_gain),
                vector(tolerance.sensor_angle),
                vector(tolerance.sensor_position),
                vector(tolerance.sensor_cross),
                vector(tolerance.sensor_delay),
            )
            for site in dict.fromkeys(sites)
        },
        {
            dof: HammerErrors(vector(tolerance.hammer_angle), vector(tolerance.hammer_position))
            for dof in dict.fromkeys(reference.positive for reference in references)
        },
        {
            name: ForceChannelErrors(
                1 + tolerance.hammer_gain * float(random.standard_normal()),
                tolerance.hammer_delay * float(random.standard_normal()),
            )
            for name in dict.fromkeys(hammers)
        },
    )


def sensor_rows(layout: Layout, site: str, errors: SensorErrors) -> Real:
    """Return what a sensor's three channels read per motion of its drawn place.

    Args:
        layout: with the site.
        site: name of the site.
        errors: of the sensor.

    Returns:
        Per motion along and about x y z, world axes, of the point where it is drawn; (3, 6).
    """
    axes = rotation_matrix(errors.rotation) @ layout.axes[layout.points.index(site)]
    rows = np.hstack([axes.T, np.cross(errors.offset, axes.T)])
    return errors.mix @ rows


def hit_wrench(layout: Layout, dof: Dof, errors: HammerErrors, turn: Real, place: Real) -> Real:
    """Return the wrenches at the stages' centres of mass per N of one hit.

    Args:
        layout: with the point that is hit.
        dof: intended point and direction.
        errors: of all hits along the direction.
        turn: further rotation vector of this hit [rad]; (3,).
        place: further displacement of this hit [m]; (3,).

    Returns:
        (6 n_stage,).
    """
    row = layout.rows([dof])[0].reshape(-1, 6)
    stage = layout.bodies.index(layout.body_name(dof.point))
    matrix = rotation_matrix(turn) @ rotation_matrix(errors.rotation)
    wrench: Real = np.zeros((len(layout.bodies), 6))
    if dof.is_rotation:
        wrench[stage, 3:] = matrix @ row[stage, 3:]
        return wrench.reshape(-1)
    is_point = dof.point in layout.points
    position = layout.positions[layout.points.index(dof.point)] if is_point else None
    arm = np.zeros(3) if position is None else position - layout.centres[stage]
    force = matrix @ row[stage, :3]
    wrench[stage, :3] = force
    wrench[stage, 3:] = np.cross(arm + errors.offset + place, force)
    return wrench.reshape(-1)
