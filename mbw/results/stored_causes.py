"""Causes of a diagnosis as terms of the equation of motion, which a page switches on and off.

A Part of a cause changes the equation by ``f(s) left (core_0 + s core_1 + s^2 core_2) right'``
(``mbmodel.parts.part``). These matrices at the fitted parameters, with the names of their rows, say
all of it, whatever the effect. A share of 0 leaves the cause out, a share of 1 is the fit. The
factor f(s) is kept at the frequency lines of the campaign, and interpolated between them.

Faults of sensors and hits are values of tolerances that the model has already. Laws of joints that
depend on the level, and channels that a fault exchanges, are no such term and cannot be switched.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from diagnosis import Hypothesis
from diagnosis.levels.law_hypothesis import LawPart
from identification.words import Complex, Condition, InputError, Real
from mbmodel import AddedPart, Change, Machine, Parameter
from mbmodel.parts.change_rows import RowNames, fit_change, fit_part
from tuning import Session

_TERM_ARRAYS = ("left", "right", "core", "shape")


@dataclass(frozen=True, eq=False)
class StoredCause:
    """A cause of a diagnosis that a page can switch.

    Args:
        effect: of the catalogue.
        location: its place.
        terms: of the equation of motion at the fitted size; empty if it is no such term.
        rows: names of the bodies and joints whose motions the terms count.
        shares: part of it that acts in each test, by file and reference; empty if all of it acts
            in every one.
        values: fitted values of the tolerances that it releases [SI], by name.
    """

    effect: str
    location: str
    terms: tuple[Change, ...]
    rows: RowNames
    shares: Mapping[tuple[str, str], float]
    values: Mapping[str, float]

    def build_part(self, share: str, machine: Machine) -> AddedPart:
        """Return a Part of a machine with the cause, whose one parameter is its share.

        Args:
            share: name of the parameter.
            machine: that gets the cause; it may have other bodies and joints beside.
        """
        slopes = tuple(replace(term, core=term.core[None]) for term in self.terms)
        parameter = Parameter(share, 0.0, "1", positive=False)
        when = self._act if self.shares else None
        part = AddedPart.linear(self.location, (parameter,), slopes, when)
        return fit_part(part, self.rows, RowNames.of(machine))

    def _act(self, condition: Condition) -> float:
        """Return the part that acts in a test."""
        return self.shares.get((condition.test, str(condition.reference)), 0.0)


def store_causes(session: Session, theta: Real, causes: Sequence[Hypothesis]) -> dict[str, Any]:
    """Return arrays with a fit and with each of its causes.

    Args:
        session: model of the fit, with the Parts of the causes, and its campaign.
        theta: fitted parameters [SI]; (n_parameter,).
        causes: of the fit.
    """
    values = {p.name: v for p, v in zip(session.model.parameters, theta.tolist(), strict=True)}
    machine = session.model.machine
    arrays: dict[str, Any] = {
        "fit_names": np.array(list(values)),
        "fit_values": np.array(list(values.values())),
        "fit_bodies": np.array(machine.layout.bodies),
        "fit_joints": np.array(machine.coordinates),
        "fit_tests": np.array(
            [[t.condition.test, str(t.condition.reference)] for t in session.campaign.tests]
        ),
    }
    laplace = np.asarray(2j * np.pi * session.campaign.freq_hz, np.complex128)
    conditions = [test.condition for test in session.campaign.tests]
    for number, cause in enumerate(causes):
        key = f"cause{number}"
        arrays[f"{key}.site"] = np.array([cause.effect, cause.location])
        arrays[f"{key}.released"] = np.array(cause.release, str)
        terms, shares = _list_terms(cause, values, conditions)
        arrays[f"{key}.shares"] = shares
        arrays[f"{key}.terms"] = np.array([[term.slot, term.point] for term in terms], str)
        for k, term in enumerate(terms):
            shape = np.zeros(0) if term.shape is None else term.shape(laplace)
            content = (term.left, term.right, term.core, shape)
            arrays |= {f"{key}.{k}.{n}": v for n, v in zip(_TERM_ARRAYS, content, strict=True)}
    return arrays


def _list_terms(
    cause: Hypothesis, values: Mapping[str, float], conditions: list[Condition]
) -> tuple[list[Change], Real]:
    """Return the terms of a cause, and the part of it that acts in each test.

    There are none where a law is one of its Parts, or where its Parts act in different tests.
    """
    terms: list[Change] = []
    acting: list[Real] = []
    for part in cause.parts:
        if isinstance(part, LawPart) or not isinstance(part, AddedPart):
            return [], np.zeros(0)
        theta = np.array([values[parameter.name] for parameter in part.parameters])
        terms += part.finite(theta)
        acting.append(np.array([part.acts(each) for each in conditions if part.when is not None]))
    if not acting or any(not np.array_equal(each, acting[0]) for each in acting):
        return [], np.zeros(0)
    return terms, acting[0]


def read_causes(
    arrays: Mapping[str, Any], tests: Sequence[tuple[str, str]]
) -> tuple[StoredCause, ...]:
    """Return the causes of a fit from the arrays of a diagnosis; none in files of earlier versions.

    Args:
        arrays: content of diagnosis.npz.
        tests: file and reference of each test of the campaign that gets them; where there are as
            many as the fit had, they are those of the fit, whatever their names.

    Raises:
        InputError: the arrays do not belong together.
    """
    causes: list[StoredCause] = []
    try:
        if "fit_tests" in arrays and len(tests) != len(arrays["fit_tests"]):
            tests = [(str(file), str(reference)) for file, reference in arrays["fit_tests"]]
        while (key := f"cause{len(causes)}.site") in arrays:
            causes.append(_read_cause(arrays, key.removesuffix(".site"), tests))
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise InputError(
            f"diagnosis.npz is damaged where it holds causes ({error}): diagnose again"
        ) from error
    return tuple(causes)


def read_fitted_values(arrays: Mapping[str, Any]) -> dict[str, float]:
    """Return the fitted parameters [SI] of a diagnosis with its causes, by name."""
    if "fit_names" not in arrays:
        return {}
    names = map(str, arrays["fit_names"])
    return dict(zip(names, arrays["fit_values"].tolist(), strict=True))


def _read_cause(
    arrays: Mapping[str, Any], key: str, tests: Sequence[tuple[str, str]]
) -> StoredCause:
    """Return one cause."""
    effect, location = map(str, arrays[f"{key}.site"])
    values = read_fitted_values(arrays)
    rows = RowNames(tuple(map(str, arrays["fit_bodies"])), tuple(map(str, arrays["fit_joints"])))
    freq_hz = np.asarray(arrays["freq_hz"], float)
    terms = []
    for k, (slot, point) in enumerate(arrays[f"{key}.terms"].tolist()):
        left, right, core, shape = (arrays[f"{key}.{k}.{name}"] for name in _TERM_ARRAYS)
        if not all(np.isfinite(each).all() for each in (left, right, core, shape)):
            raise ValueError("a number is not finite")
        kept = _interpolate(freq_hz, shape) if shape.size else None
        term = Change(slot, left, right, core, point, kept, f"{effect}@{location}")
        fit_change(term, rows, rows)  # refuses rows that are not those of the machine
        if core.shape != (3, left.shape[1], right.shape[1]):
            raise ValueError(f"a term is {core.shape}")
        terms.append(term)
    shares = arrays[f"{key}.shares"]
    released = map(str, arrays[f"{key}.released"])
    return StoredCause(
        effect,
        location,
        tuple(terms),
        rows,
        dict(zip(tests, shares.tolist(), strict=True)) if shares.size else {},
        {name: values[name] for name in released},
    )


def _interpolate(freq_hz: Real, kept: Complex) -> Callable[[Complex], Complex]:
    """Return f(s) between the lines where it is kept; beyond them it stays as at the nearest."""
    columns = kept.reshape(len(freq_hz), -1).T

    def shape(laplace: Complex) -> Complex:
        wanted, sign = np.abs(laplace.imag) / (2 * np.pi), np.where(laplace.imag < 0, -1.0, 1.0)
        parts = [
            np.interp(wanted, freq_hz, column.real)
            + 1j * sign * np.interp(wanted, freq_hz, column.imag)
            for column in columns
        ]
        return np.array(parts).T.reshape(len(laplace), *kept.shape[1:])

    return shape
