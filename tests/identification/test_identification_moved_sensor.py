"""A sensor whose site stands on another body than the sensor: both are named."""

import pytest
from solid_bodies import Case, draw, faulty

from identification.solid import check_bodies


def on_the_other_body(layout):
    """The truth: the first sensor of body0 moves with body1."""
    site = layout.points[0]
    return layout.with_point_axes(site, layout.axes[0], "body1")


def test_a_site_on_the_wrong_body_is_named_with_sensor_and_body():
    checks = check_bodies(draw(Case(0, bodies=2, lines=200, layout_change=on_the_other_body)))
    for check in checks:
        assert "p0_0 moves with body1, not with body0" in check.sentence
        assert 'body = "body1" in [sensor.p0_0]' in check.sentence
        assert [(fault.effect, fault.location) for fault in check.faults] == [
            ("sensor_body", "sensor:p0_0")
        ]


@pytest.mark.parametrize("kind", ["gain", "quarter turn", "position"])
def test_other_faults_are_no_wrong_body(kind):
    case, _ = faulty(kind, 1, bodies=2, lines=200)
    assert not any("moves with" in check.sentence for check in check_bodies(draw(case)))
