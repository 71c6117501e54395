"""posterior.npz beside tuned.xml: bands at a port that no sensor measured, from the files alone."""

import numpy as np
import pytest
from campaign_folder import write_folder

from identification.words import Dof, InputError
from mbmodel import FrfRequest, linearise, load_machine, machine_model
from tuning import open_session, read_posterior, tune, write_result
from tuning.assessment.frf_bands import frf_deviations
from tuning.plant import frf_bands

AXES = tuple(Dof.of("acc6", axis) for axis in range(3))
REQUEST = FrfRequest(np.linspace(6.0, 160.0, 40), AXES, AXES)


@pytest.fixture(scope="module")
def tuned(tmp_path_factory):
    """The small machine, tuned without its sensor 6, and the folder of the result."""
    folder = write_folder(tmp_path_factory.mktemp("posterior") / "campaign")
    settings = folder / "campaign.toml"
    text = settings.read_text(encoding="utf-8")
    settings.write_text(text + '\n[sensor.acc6]\nignore = ["x", "y", "z"]\n', encoding="utf-8")
    result = tune(open_session(folder))
    write_result(result, folder / "tuned")
    return result, folder / "tuned"


@pytest.fixture(scope="module")
def posterior(tuned):
    _, folder = tuned
    return read_posterior(folder).on(machine_model(load_machine(folder / "tuned.xml")))


def test_bands_from_the_files_are_those_of_the_fit(tuned, posterior):
    result, _ = tuned
    bands = frf_bands(posterior, REQUEST)
    lines = linearise(result.session.model, result.model_fit.theta, REQUEST)
    peak = np.abs(lines.values).max()
    np.testing.assert_allclose(bands.values, lines.values, atol=1e-7 * peak)
    # the direction of a value far below the peak is rounding
    clear = np.abs(lines.values) > 1e-4 * peak
    unit = np.where(clear, lines.values / np.where(clear, np.abs(lines.values), 1), 1)
    expected = frf_deviations(lines, result.confidence, [unit, 1j * unit])
    for deviation, own in zip(expected, (bands.magnitude, bands.phase), strict=True):
        np.testing.assert_allclose(own[clear], deviation[clear], rtol=1e-4)


def test_the_measurements_own_parameters_are_integrated_out(tuned, posterior):
    result, _ = tuned
    names = posterior.posterior.parameters
    assert not any(name.startswith(("acc", "hammer")) for name in names)
    assert {"head_tx.stiffness", "base.mass", "head.joint_position_x"} <= set(names)
    confidence = result.confidence
    places = [confidence.parametrisation.names.index(name) for name in posterior.posterior.names]
    covariance = confidence.covariance[np.ix_(places, places)]
    np.testing.assert_array_equal(posterior.posterior.covariance, covariance)


def test_a_broken_posterior_is_refused(tuned, tmp_path):
    _, folder = tuned
    whole = dict(np.load(folder / "posterior.npz", allow_pickle=False))
    target = tmp_path / "posterior.npz"
    for key, value in (
        ("covariance", whole["covariance"][:-1]),
        ("values", whole["values"] * np.nan),
        ("coordinate_of", whole["coordinate_of"] + 1),
        ("error_floor", np.array("none")),
    ):
        np.savez(target, **{**whole, key: value})
        with pytest.raises(InputError, match="run mbw tune or mbw diagnose again"):
            read_posterior(target)
    del whole["scale"]
    np.savez(target, **whole)
    with pytest.raises(InputError, match="run mbw tune or mbw diagnose again"):
        read_posterior(tmp_path)
