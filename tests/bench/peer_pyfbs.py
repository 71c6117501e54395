"""The poles of pyFBS 1.0.7 (MIT) on the same FRFs, for the bench alone.

``make bench`` installs pyFBS without what it depends on (Qt, VTK, Ansys), since its poly-reference
LSCF needs numpy alone; the two names that its module imports beside are stood in for here.
"""

import contextlib
import importlib.util
import io
import sys
from pathlib import Path
from types import ModuleType

import numpy as np

from identification.modal import mac


def pyfbs_poles(freq_hz: np.ndarray, values: np.ndarray, highest: int) -> list[np.ndarray] | None:
    """Poles of every second order up to the highest, or None where pyFBS is not installed.

    Args:
        freq_hz: (n_freq,).
        values: (n_freq, n_out, n_in).
        highest: order of the polynomials.
    """
    found = importlib.util.find_spec("pyfbs")
    if found is None or not found.submodule_search_locations:
        return None
    model = _class(Path(found.submodule_search_locations[0]))
    own = model.__new__(model)
    own.frf, own.freq = values, freq_hz
    own.n_o, own.n_i = values.shape[1:]
    with contextlib.redirect_stdout(io.StringIO()):
        own.p_lscf(highest)
    orders = (np.asarray(order[0]).ravel() for order in own.poles)
    return [order[order != 0] for order in orders]


def _class(folder: Path) -> type:
    stubs = {
        name: ModuleType(name) for name in ("pyfbs", "pyfbs.modal_id", "pyfbs.utility", "PyQt5")
    }
    stubs["pyfbs"].__path__ = [str(folder)]
    stubs["pyfbs.utility"].mac = mac  # type: ignore[attr-defined]
    stubs["PyQt5"].QtCore = stubs["PyQt5"].QtWidgets = None  # type: ignore[attr-defined]
    before = {name: sys.modules.get(name) for name in stubs}
    sys.modules.update(stubs)
    try:
        spec = importlib.util.spec_from_file_location(
            "pyfbs.modal_id.modal_id", folder / "modal_id" / "modal_id.py"
        )
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        for name, old in before.items():
            if old is None:
                del sys.modules[name]
            else:
                sys.modules[name] = old
    found: type = module.ModalID
    return found
