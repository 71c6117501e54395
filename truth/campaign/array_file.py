"""Write FRFs and coherences as an array file (.npz), whose labels campaign.toml states."""

import io

import numpy as np

from truth.campaign.measure import Measurement


def array_bytes(measurement: Measurement) -> bytes:
    """Return the content of the file: ``freq_hz``, ``frf`` and ``coherence``, if there is one."""
    arrays = {"freq_hz": measurement.freq_hz, "frf": measurement.frf, "format": np.array(1)}
    if measurement.coherence is not None:
        arrays["coherence"] = measurement.coherence
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()
