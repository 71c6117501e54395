"""The workbench for Python: ``import mbworkbench as mb``.

Identify the modal model of a hammer test, tune a multi-body model to it, and diagnose what the
model lacks. Paths may be text or ``Path``, labels may be text or ``Dof``, such as ``acc11:+tx``.

    campaign = mb.read_campaign("assets/demo")
    model = mb.read_model("assets/demo/model.xml")
    tuned = mb.tune(model, campaign)
    result = mb.diagnose(campaign)
    mb.plot(result).show()

This package computes nothing itself: it opens files, calls the packages that compute, and shows
their results as tables and figures.
"""

from importlib.metadata import version

from mbworkbench.hidden_packages import refuse_hidden_packages

refuse_hidden_packages()  # before any of them is imported

# ruff: noqa: E402
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
from mbworkbench.budgets import ErrorBudgetResult, error_budget
from mbworkbench.campaign import MeasuredCampaign, read_campaign
from mbworkbench.diagnosing import DiagnosisResult, diagnose
from mbworkbench.identifying import IdentifiedModel, identify
from mbworkbench.model import MachineModel, ModelModes, read_model
from mbworkbench.parameters import ParameterTable
from mbworkbench.plots import plot
from mbworkbench.tuned_plant import TunedPlant, read_plant
from mbworkbench.tuning_result import TunedModel, tune

__version__ = version("mbworkbench")

__all__ = [
    "Condition",
    "ConvergenceError",
    "DiagnosisResult",
    "Dof",
    "ErrorBudgetResult",
    "Frf",
    "FrfEstimate",
    "IdentifiedModel",
    "InputError",
    "Layout",
    "MachineModel",
    "MeasuredCampaign",
    "ModalModel",
    "ModelModes",
    "ParameterTable",
    "Tolerance",
    "TunedModel",
    "TunedPlant",
    "UsageError",
    "WorkbenchError",
    "__version__",
    "diagnose",
    "error_budget",
    "identify",
    "plot",
    "read_campaign",
    "read_model",
    "read_plant",
    "tune",
]
