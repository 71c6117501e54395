"""Sums over lines and hits that a body's fits need."""

import numpy as np
from solid_bodies import Case, draw

from identification.solid.body_channels import body_data, exchange_channels, join_tests
from identification.solid.moments import Moments


def test_sums_of_exchanged_channels_are_those_of_the_exchanged_data():
    drawn = draw(Case(7, sensors=3, lines=80))
    table = join_tests(drawn)
    data = body_data(table, drawn, drawn.layout.bodies[0])
    order, signs = [3, 4, 5, 0, 1, 2, 6, 7, 8], np.array([1.0] * 6 + [-1.0, 1.0, 1.0])
    moved = Moments.of(data).exchange_channels(order, signs)
    anew = Moments.of(exchange_channels(data, order, signs))
    delays = np.linspace(-1e-5, 2e-5, len(order))
    for first, second in (
        (moved, anew),
        (moved.without_delays(delays), anew.without_delays(delays)),
    ):
        for name in ("mask", "gram", "noise", "count"):
            np.testing.assert_allclose(getattr(first, name), getattr(second, name), rtol=1e-9)
