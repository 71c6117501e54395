"""Which sites of a machine are accelerometers, which hammer points."""

from identification.words import Layout, is_hammer, node_of


def sensors(layout: Layout) -> list[str]:
    """Sites that end in a node's number and are no hammer points; else all that are none."""
    points = [name for name in layout.points if not is_hammer(name)]
    return [name for name in points if node_of(name) is not None] or points


def hammers(layout: Layout) -> list[str]:
    """Hammer points."""
    return [name for name in layout.points if is_hammer(name)]
