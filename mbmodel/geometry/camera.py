"""Camera of pictures: where a point of the machine stands in the image."""

from dataclasses import dataclass

import numpy as np

from identification.words import Real

VIEW_ANGLE_DEG = 40.0  # vertical angle of view: flat enough that no stage looks distorted
_AZIMUTH_DEG, _ELEVATION_DEG = 130.0, -24.0  # view from the front and above, as the pages show it
_MARGIN = 1.06  # distance over that at which the machine just fits into the image
_FRAMING_STEPS = 6  # each moves the camera sideways and back; the picture is then framed within 1 %


@dataclass(frozen=True, eq=False)
class Camera:
    """Camera that looks at a point, as MuJoCo's free camera does; the z axis points up.

    The direction of view is (cos e cos a, cos e sin a, sin e), with azimuth a and elevation e.

    Args:
        centre: point in the middle of the image [m]; (3,).
        distance: from the camera to that point [m].
        azimuth_deg, elevation_deg: direction of view [degrees].
    """

    centre: Real
    distance: float
    azimuth_deg: float = _AZIMUTH_DEG
    elevation_deg: float = _ELEVATION_DEG

    @property
    def axes(self) -> Real:
        """Unit vectors to the right, upwards and along the view, as rows; (3, 3)."""
        a, e = np.radians([self.azimuth_deg, self.elevation_deg])
        view = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        up = np.array([-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)])
        return np.array([np.cross(view, up), up, view])

    def project(self, points: Real, width: int, height: int) -> tuple[Real, Real]:
        """Return pixels of points, from the upper left corner, and their distances along the view.

        Args:
            points: in world axes [m]; (n, 3).
            width: of the image [pixels].
            height: of the image [pixels].

        Returns:
            Pixels (n, 2), and distances [m] (n,).
        """
        seen = (np.asarray(points, float) - self.centre) @ self.axes.T
        depth = seen[:, 2] + self.distance
        scale = height / 2 / np.tan(np.radians(VIEW_ANGLE_DEG) / 2) / depth
        pixels = np.column_stack([width / 2 + scale * seen[:, 0], height / 2 - scale * seen[:, 1]])
        return pixels, depth


def frame_camera(points: Real, aspect: float) -> Camera:
    """Return the camera whose image just holds all points, as much margin on each side.

    Args:
        points: in world axes [m]; (n, 3).
        aspect: width over height of the image.
    """
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    extent = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    right, up, view = Camera(centre, 1.0).axes
    slope = float(np.tan(np.radians(VIEW_ANGLE_DEG) / 2))
    distance = 0.0
    for _ in range(_FRAMING_STEPS):
        seen = points - centre
        across, above, ahead = seen @ right / aspect, seen @ up, seen @ view
        reach = np.maximum(np.abs(across), np.abs(above)) / slope
        distance = max(_MARGIN * float((reach - ahead).max()), 0.05 * extent)
        sides = [values / (ahead + distance) for values in (across, above)]
        middle = [(values.min() + values.max()) / 2 * distance for values in sides]
        centre = centre + middle[0] * aspect * right + middle[1] * up
    return Camera(centre, distance)
