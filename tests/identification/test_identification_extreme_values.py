"""Values that no machine has, in FRFs and time records, and FRFs without any information."""

import numpy as np
import pytest
import scipy.io
from campaign_folder import write_folder
from hammer_records import Hammer, a_system, strike
from typer.testing import CliRunner

from identification.modal.lscf_method import lscf
from mbw.command import app

RECORDS = """\
layout = "layout.toml"
[[test]]
file = "records.npz"
channels = ["7:+z", "1:+x", "1:-y", "2:+z"]
references = ["7:+z"]
"""
SITES = "".join(f"[site.acc{k}]\nposition = [{k}.0, 0.0, {k * k}.0]\n" for k in (1, 2, 7))


def refusal(campaign, tmp_path):
    done = CliRunner().invoke(app, ["identify", str(campaign), "--out", str(tmp_path / "out")])
    assert done.exit_code == 3, done.stderr
    return done.stderr


@pytest.mark.parametrize(
    ("name", "place", "value", "sentence"),
    [
        ("FRFs", (0, 0, 30), 1e300, "a value beyond 1e+30 at 45.3361 Hz, response 1:+tx"),
        ("FRFs", (3, 1, 7), -1e200, "a value beyond 1e+30 at 14.4118 Hz, response 2:+tx"),
        ("FRFs", ..., 1e250, "a value beyond 1e+30 at 5 Hz, response 1:+tx"),
        ("freqs", (0, -1), 1e12, "freq_hz is 1e+12 at index (119,), beyond 1e+08"),
    ],
)
def test_an_frf_that_no_machine_has_is_refused(tmp_path, name, place, value, sentence):
    campaign = write_folder(tmp_path / "campaign")
    arrays = scipy.io.loadmat(campaign / "impact.mat")
    arrays = {key: np.array(arrays[key]) for key in ("FRFs", "COHs", "freqs")}
    arrays[name][place] = value
    scipy.io.savemat(campaign / "impact.mat", arrays)
    assert sentence in refusal(campaign, tmp_path)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("force", 1e300, "force holds NaN or values beyond 1e+30"),
        ("response", -1e200, "response holds NaN or values beyond 1e+30"),
        ("rate_hz", 1e300, "rate_hz holds NaN or values beyond 1e+30"),
        ("rate_hz", 1e-300, "sampling rate is 1e-300 Hz"),
    ],
)
def test_a_record_that_no_machine_has_is_refused(tmp_path, name, value, sentence):
    records = strike(a_system(), Hammer())
    arrays = {"force": records.force, "response": records.motion, "rate_hz": np.array([1024.0])}
    arrays = {key: np.array(values) for key, values in arrays.items()}
    arrays[name].ravel()[arrays[name].size // 2] = value
    np.savez(tmp_path / "records.npz", **arrays)
    (tmp_path / "campaign.toml").write_text(RECORDS)
    (tmp_path / "layout.toml").write_text(SITES)
    assert sentence in refusal(tmp_path, tmp_path)


@pytest.mark.parametrize("values", [np.ones(200), (-1.0) ** np.arange(200), np.arange(200.0)])
def test_frfs_that_are_all_alike_have_poles_or_none_but_no_error(values):
    alike = np.broadcast_to(values[:, None, None], (200, 4, 3)) + 0j
    sets = lscf(np.arange(1.0, 201.0), alike, 12)
    assert [poles.order for poles in sets] == list(range(1, 13))
    assert all(np.isfinite(poles.poles).all() for poles in sets)
