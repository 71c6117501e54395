"""The workbench for Python: ``import mbworkbench as mb``.

Identify the modal model of a hammer test, tune a multi-body model to it, and diagnose what the
model lacks. Paths may be text or ``Path``, labels may be text or ``Dof``, such as ``acc11:+tx``.

    campaign = mb.read_campaign("assets/demo")
    tuned = mb.tune(campaign)
    result = mb.diagnose(tuned)
    result.plot().show()

Every result has a short ``repr``, a table in a notebook, ``.to_pandas()`` and ``.plot()``. This
package computes nothing itself: it opens files, calls the packages that compute, and shows their
results.
"""

from importlib.metadata import version

from mbworkbench.hidden_packages import refuse_hidden_packages

refuse_hidden_packages()  # before any of them is imported

# ruff: noqa: E402
from diagnosis.settings import DiagnosisSettings
from identification.words import (
    Condition,
    ConvergenceError,
    Dof,
    Frf,
    FrfEstimate,
    InputError,
    Layout,
    ModalModel,
    Tolerance,
    UsageError,
    WorkbenchError,
)
from mbmodel.simulation.signals import move_signal
from mbworkbench.budgets import (
    ErrorBudgetResult,
    MarginsResult,
    SimulatedBudget,
    error_budget,
    margins,
    simulate_budget,
)
from mbworkbench.campaign import IdentifiedModel, MeasuredCampaign, identify, read_campaign
from mbworkbench.comparison import ComparisonResult, compare
from mbworkbench.diagnosis import DiagnosisResult, diagnose
from mbworkbench.excitation import ExcitationResult, excite
from mbworkbench.model import MachineModel, ModelModes, read_model
from mbworkbench.plant import TunedPlant, predict_poses, read_plant
from mbworkbench.plots import plot
from mbworkbench.tuning import ParameterTable, TunedModel, tune

__version__ = version("mbworkbench")

__all__ = [
    "ComparisonResult",
    "Condition",
    "ConvergenceError",
    "DiagnosisResult",
    "DiagnosisSettings",
    "Dof",
    "ErrorBudgetResult",
    "ExcitationResult",
    "Frf",
    "FrfEstimate",
    "IdentifiedModel",
    "InputError",
    "Layout",
    "MachineModel",
    "MarginsResult",
    "MeasuredCampaign",
    "ModalModel",
    "ModelModes",
    "ParameterTable",
    "SimulatedBudget",
    "Tolerance",
    "TunedModel",
    "TunedPlant",
    "UsageError",
    "WorkbenchError",
    "__version__",
    "compare",
    "diagnose",
    "error_budget",
    "excite",
    "identify",
    "margins",
    "move_signal",
    "plot",
    "predict_poses",
    "read_campaign",
    "read_model",
    "read_plant",
    "simulate_budget",
    "tune",
]


def __dir__() -> list[str]:
    return list(__all__)
