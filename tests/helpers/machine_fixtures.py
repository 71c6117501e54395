"""The station, and machines from text."""

import numpy as np
import pytest
from mbmodel_examples import STATION

from mbmodel import as_drawn, load_machine


@pytest.fixture(scope="session")
def station():
    return load_machine(STATION)


@pytest.fixture(scope="session")
def station_model(station):
    return as_drawn(station)


@pytest.fixture(scope="session")
def away(station_model):
    """Theta of the station off its drawing, no two parameters by the same factor."""
    spread = np.random.default_rng(5).normal(size=len(station_model.drawn))
    return station_model.drawn * np.exp(0.4 * spread)


@pytest.fixture(scope="session")
def from_text(tmp_path_factory):
    """Writes an MJCF and loads it as a Machine."""
    folder = tmp_path_factory.mktemp("mjcf")
    count = iter(range(1_000_000))

    def load(text, *, name=None):
        path = folder / (name or f"machine{next(count)}.xml")
        path.write_text(text, encoding="utf-8")
        return load_machine(path)

    return load
