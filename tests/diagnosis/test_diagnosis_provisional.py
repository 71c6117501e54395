"""Provisional findings: the null model, score tests of it, and the rank of planned hits."""

import numpy as np
import pytest
from small_machine import MJCF, virtual_campaign

from diagnosis.next_test.provisional import find_provisionally
from identification.words import Dof, Tolerance
from mbmodel import as_drawn, load_machine
from tuning import Session, build_toleranced_model, parametrise


@pytest.fixture
def session(tmp_path):
    (tmp_path / "pair.xml").write_text(MJCF, encoding="utf-8")
    model = as_drawn(load_machine(tmp_path / "pair.xml"))
    factors = np.exp(np.random.default_rng(5).normal(0, 0.4, len(model.drawn)))
    campaign = virtual_campaign(model, model.drawn * factors, lines=80)
    toleranced = build_toleranced_model(model.machine, campaign)
    return Session(
        tmp_path / "campaign.toml", toleranced, campaign, parametrise(toleranced, Tolerance())
    )


def test_a_tuned_model_of_the_true_machine_has_no_gap_and_ranks_planned_hits(session):
    planned = [Dof.parse("acc1:+tx"), Dof.parse("acc2:+tz")]
    findings = find_provisionally(session, planned)
    assert not findings.is_gap_visible
    assert findings.causes == ()
    assert findings.gap.excess == pytest.approx(1.0, abs=0.2)
    assert {row.place for row in findings.next_hits} == set(map(str, planned))
    assert all(row.after <= row.before for row in findings.next_hits)
    names = [parameter.name for parameter in findings.model.parameters]
    fitted = dict(zip(names, findings.theta, strict=True))
    assert np.isfinite(list(fitted.values())).all()
