"""Division of a machine's sites into accelerometers and hammer points."""

from identification.words import Layout, is_hammer_point


def sensor_sites(layout: Layout) -> list[str]:
    """Return the accelerometers.

    Without any, return all sites that are neither hammer points nor ends of tendons.
    """
    return list(layout.sensors) or [
        name
        for name in layout.points
        if not is_hammer_point(name) and name not in layout.without_sensor
    ]


def hammer_sites(layout: Layout) -> list[str]:
    """Return the hammer points."""
    return [name for name in layout.points if is_hammer_point(name)]
