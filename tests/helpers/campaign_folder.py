"""Write a campaign of the small machine as a user would have it: a folder with a .mat file."""

from pathlib import Path

import numpy as np
import scipy.io
from small_machine import MJCF

from identification.words import Dof
from mbmodel import Evaluator, FrfRequest, as_drawn, load_machine

AVERAGES = 10
CAMPAIGN = """\
model = "model.xml"

[[test]]
file = "impact.mat"
averages = 10
level = 200.0
channels = "nodes 1..6, xyz"
references = ["3:+x", "3:-y", "3:+z"]
"""


def write_folder(folder: Path, *, noise: float = 0.01, seed: int = 1, lines: int = 120) -> Path:
    """Write model.xml, impact.mat and campaign.toml; dead channels hold noise only."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.xml").write_text(MJCF, encoding="utf-8")
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    model = as_drawn(load_machine(folder / "model.xml"))
    random = np.random.default_rng(seed)
    theta = model.drawn * np.exp(random.normal(0, 0.4, len(model.drawn)))
    freq = np.linspace(5.0, 165.0, lines)
    outputs = tuple(Dof.of(f"acc{k}", axis) for k in range(1, 7) for axis in range(3))
    inputs = (Dof("acc3", "+tx"), Dof("acc3", "-ty"), Dof("acc3", "+tz"))
    values = Evaluator(model, FrfRequest(freq, outputs, inputs)).at(theta).values
    rms = np.sqrt((np.abs(values) ** 2).mean(axis=0))
    sigma = np.maximum(noise * rms, 1e-3 * noise * rms.max())
    error = random.normal(size=(2, *values.shape)) * sigma / np.sqrt(2)
    noisy = values + error[0] + 1j * error[1]
    # var = |H|^2 (1 - g2) / (g2 (n - 1)), solved for g2
    ratio = (AVERAGES - 1) * sigma**2 / np.abs(noisy) ** 2
    scipy.io.savemat(
        folder / "impact.mat",
        {
            "FRFs": np.moveaxis(noisy, 0, 2),
            "COHs": np.moveaxis(1 / (1 + ratio), 0, 2),
            "freqs": freq,
        },
    )
    return folder
