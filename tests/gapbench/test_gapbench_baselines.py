"""The baselines: evidence against the dense density, laws on measured data, and rankings."""

import json
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from gapbench.answer import read_answer
from gapbench.baselines import latent_force as lf
from gapbench.baselines import ranking as rank
from gapbench.baselines.effect_laws import Field
from gapbench.baselines.latent_force import latent_force
from gapbench.baselines.refit import refit
from truth.campaign.changed_tower import (
    ASSET,
    TowerChange,
    change_tower,
    read_tower,
    write_tower,
)
from truth.grade.verdict import CATALOGUE


def changed(folder, *changes):
    """Write the tower before and after changes."""
    freq_hz, before = read_tower()
    after = change_tower(freq_hz, before, list(changes), np.random.default_rng(11))
    thin = slice(None, None, 4)
    write_tower(folder, ASSET / "model.xml", freq_hz[thin], after[thin], before[thin])
    return folder


def random_field(rng):
    """Return a field of 9 lines and 2 channels with random FRFs and residual."""
    model, left = rng.standard_normal((2, 9, 2)) + 1j * rng.standard_normal((2, 9, 2))
    residual = SimpleNamespace(
        model=model, left=left, variance=rng.uniform(0.5, 2, (9, 2)), moves=np.ones(2, bool)
    )
    return Field(residual, left, np.linspace(1.0, 9.0, 9), {}, {})


@pytest.mark.parametrize("shared", [False, True])
def test_the_evidence_is_the_density_of_a_complex_normal(shared, monkeypatch):
    monkeypatch.setattr(lf, "MODEL_ERRORS", (0.03,))
    monkeypatch.setattr(lf, "BUMPS", (3,))
    rng = np.random.default_rng(1)
    fields = [random_field(rng) for _ in range(2)]
    columns = [rng.standard_normal((9, 2, 2)) + 1j * rng.standard_normal((9, 2, 2)) for _ in fields]
    blocks, values, logs = [], [], 0.0
    for field, column in zip(fields, columns, strict=True):
        size = np.abs(field.residual.model + field.residual.left) ** 2
        variance = field.residual.variance + 0.03**2 * size
        white = column / np.sqrt(variance)[:, :, None]
        white = white / np.sqrt((np.abs(white) ** 2).mean(axis=(0, 1))) / np.sqrt(18)
        bumps = np.exp(-0.5 * ((field.omega[:, None] - [1.0, 5.0, 9.0]) / 4.0) ** 2)
        blocks.append((bumps[:, None, :, None] * white[:, :, None, :]).reshape(18, 6))
        values.append((field.left / np.sqrt(variance)).ravel())
        logs -= np.log(variance).sum()
    if shared:
        design = np.vstack(blocks)
    else:
        design = np.block([[blocks[0], np.zeros((18, 6))], [np.zeros((18, 6)), blocks[1]]])
    y, best = np.concatenate(values), -np.inf
    for strength in lf.STRENGTHS:
        covariance = np.eye(36) + strength**2 * design @ design.conj().T
        quadratic = (y.conj() @ np.linalg.solve(covariance, y)).real
        best = max(best, logs - np.linalg.slogdet(covariance)[1] - quadratic)
    assert lf._evidence(fields, columns, shared) == pytest.approx(best)


@pytest.mark.parametrize(
    ("change", "tolerance"),
    [
        (TowerChange("mass_error", "body:floor1", {"mass": 0.8}), 0.1),
        (TowerChange("stiffness", "joint:floor2", {"stiffness": 1e4}), 0.1),
    ],
)
def test_a_latent_force_names_a_change_of_the_measured_tower(tmp_path, change, tolerance):
    answer = latent_force(refit(changed(tmp_path, change)))
    (cause,) = answer["sets"][0]["causes"]
    assert (cause["effect"], cause["places"]) == (change.effect, [change.location])
    assert cause["size"] == pytest.approx(next(iter(change.sizes.values())), rel=tolerance)
    assert answer["gap"][1] < 0.5 * answer["gap"][0]
    read_answer(json.dumps({"format": 1, **answer}), frozenset(CATALOGUE))


def test_one_factor_of_all_frfs_blames_the_force_channel(tmp_path):
    change = TowerChange("hammer_gain", "hammer:default", {"gain": 1.4})
    fitted = refit(changed(tmp_path, change))
    answer = rank.ranking(fitted)
    (cause,) = answer["sets"][0]["causes"]
    assert cause["effect"] == "hammer_gain"
    factor, taken = rank._common_factor(fitted)
    assert taken > rank.FACTOR_SHARE
    # Of the measured FRFs before the change, not of the model's: only near the change itself.
    assert factor == pytest.approx(1.4, abs=0.2)
    assert rank.refit_only(fitted)["unexplained"] == pytest.approx(1.0)


def test_even_odds_of_a_gap_are_where_they_are_stated():
    assert rank.gap_probability(rank.EXCESS_OF_EVEN_ODDS) == 0.5
    assert rank.gap_probability(1.0) < 0.02
    assert rank.gap_probability(1.25) > 0.98


def test_a_baseline_runs_as_an_entry_does(tmp_path):
    folder = changed(tmp_path)
    words = [sys.executable, "-m", "gapbench.baselines", "refit_only", str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    answer = read_answer(done.stdout, frozenset(CATALOGUE))
    assert answer.none + answer.unexplained == pytest.approx(1.0)
    done = subprocess.run(words[:-2], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "latent_force" in done.stderr
