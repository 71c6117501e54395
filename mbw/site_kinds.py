"""Division of a machine's sites into accelerometers and hammer points."""

from identification.words import Layout, is_hammer_point, node_number


def sensor_sites(layout: Layout) -> list[str]:
    """Return the accelerometers: sites with a node number that are not hammer points.

    Without such a site, return all sites that are not hammer points.
    """
    points = [name for name in layout.points if not is_hammer_point(name)]
    return [name for name in points if node_number(name) is not None] or points


def hammer_sites(layout: Layout) -> list[str]:
    """Return the hammer points."""
    return [name for name in layout.points if is_hammer_point(name)]
