"""Sensors of a body that bends: exact gradients where the mode has a zero in one direction."""

import numpy as np
import pytest

from mbmodel import BendingMode, Model, add_bending_mode
from tests.helpers.drawn import drawn
from tuning import Misfit, parametrise, rebuild_for_machine, thin_lines


def test_a_mode_without_motion_in_one_direction_of_a_sensor_has_an_exact_gradient(tmp_path):
    session, _ = drawn(tmp_path, 72_001, lines=161)
    machine = session.model.machine
    layout = machine.layout
    sites = list(dict.fromkeys(dof.point for dof in session.campaign.outputs))
    body = layout.body_name(sites[0])
    sensors = tuple(site for site in sites if layout.body_name(site) == body)
    base = rebuild_for_machine(session.model, add_bending_mode(machine, body))
    part = BendingMode(base.machine, body, 60.0, sensors, ()).part()
    model = Model(base.machine, (*base.parts, part))
    varies = parametrise(model, session.campaign.tolerance)
    x = np.zeros(varies.size)
    added = [varies.names.index(p.name) for p in part.parameters if p.name in varies.names]
    x[added] = np.random.default_rng(1).uniform(0.05, 0.3, len(added))
    still = [k for k in added if varies.names[k].endswith(f"{sensors[0]}_y")]
    assert still
    x[still] = 0.0
    problem = Misfit(model, thin_lines(session.campaign, 16), varies, model_error_floor=0.05)
    value, gradient, normal = problem.quadratic_model(x)
    step, way = 1e-5, np.random.default_rng(2).standard_normal(varies.size)
    ends = [problem.value(x + sign * step * way) for sign in (1, -1)]
    assert gradient @ way == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-4)
    assert np.isfinite(value)
    assert (np.diag(normal.dense())[added] > 0).all()
