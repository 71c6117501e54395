"""Posterior of a model's parameters: normal in coordinates of which a fit gave the covariance.

    theta = nominal exp(scale x)    or    theta = nominal + scale x,     x ~ N(0, C)

The nominal model is the fitted one. With C = R R' (R = C^(1/2), symmetric) and z ~ N(0, 1),

    x = R z,    |z|^2 <= chi2

is the ellipsoid that holds the parameters with the probability of that quantile of chi-square.
Parts of the machine count, and parameters of effects that its MJCF holds (``effect_slopes``).
Tolerances of sensors and hammer belong to the measurement and are integrated out: their rows and
columns of C are left out.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri

from identification.words import InputError, Integers, Mask, Real, shorten_names
from mbmodel import Model
from tuning.assessment.effect_slopes import EffectSlopes

# Relative difference at which a model's stiffness is no longer the fitted one: what an MJCF holds
# of a value, and the nearest physical inertia, are below it.
_MAX_VALUE_CHANGE = 1e-5


@dataclass(frozen=True, eq=False)
class ParameterPosterior:
    """Normal posterior of coordinates x about a fit.

    Args:
        names: of the coordinates; n_x.
        parameters: names of the parameters that vary with them; n_parameter.
        values: of these parameters at the fit [SI]; (n_parameter,).
        coordinate_of: coordinate of each parameter; (n_parameter,).
        scale: change of the parameters (of their logarithms, for sizes) per unit of x; (n_x,).
        is_logarithmic: whether a coordinate varies the logarithm; (n_x,).
        covariance: C; (n_x, n_x).
        error_floor: relative error of the model at its sensors that held-out lines show beside the
            noise; 0 if they show none.
        discrepancy: relative error of the machine's forces that the residuals show beside noise
            and parameters, as in ``model_discrepancy``; 0 if they show none.
        effects: what parameters of effects change of the machine; None without any.
    """

    names: tuple[str, ...]
    parameters: tuple[str, ...]
    values: Real
    coordinate_of: Integers
    scale: Real
    is_logarithmic: Mask
    covariance: Real
    error_floor: float = 0.0
    discrepancy: float = 0.0
    effects: EffectSlopes | None = None

    def __repr__(self) -> str:
        """Return the number of coordinates and the model-error floor in one line."""
        return (
            f"posterior of {len(self.names)} coordinates: {shorten_names(self.names)}; "
            f"model-error floor {self.error_floor:.2g}"
        )

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.names)

    @cached_property
    def root(self) -> Real:
        """The symmetric root R of C; (n_x, n_x)."""
        values, vectors = np.linalg.eigh(self.covariance)
        return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T

    @property
    def deviation(self) -> Real:
        """Standard deviation of each coordinate times its scale; (n_x,).

        It is relative for sizes, and in SI for other parameters.
        """
        return self.scale * np.sqrt(np.diag(self.covariance))

    def chi_square(self, probability: float = 0.95) -> float:
        """Return the bound of |z|^2 that holds with a probability."""
        return float(chdtri(self.size, 1 - probability))

    def draw(self, count: int, seed: int) -> Real:
        """Draw whitened coordinates z; (count, n_x).

        Args:
            seed: of the random numbers.
        """
        return np.random.default_rng(seed).standard_normal((count, self.size))

    def on(self, model: Model) -> "PosteriorOfModel":
        """Return the posterior of a model whose nominal values are those of the fit.

        Args:
            model: from ``machine_model``, at the tuned values.

        Returns:
            The posterior, whose model has a further Part for the parameters of effects.

        Raises:
            InputError: the model has other springs, or other values, than the fit.
        """
        source = model.machine.source
        of_effects = () if self.effects is None else self.effects.names
        if self.effects is not None:
            model = Model(model.machine, (*model.parts, self.effects.part(model.machine)))
        index_of = {parameter.name: k for k, parameter in enumerate(model.parameters)}
        if missing := [name for name in self.parameters if name not in index_of]:
            raise InputError(
                f"{source} lacks {shorten_names(missing)}, which the fit varied: name the "
                "MJCF that was written beside the posterior"
            )
        indices = np.array([index_of[name] for name in self.parameters], np.intp)
        change = np.abs(model.drawn[indices] - self.values)
        pairs = zip(self.parameters, change, np.abs(self.values), strict=True)
        if changed := [
            name
            for name, size, value in pairs
            if name.endswith((".stiffness", ".damping"))
            and name not in of_effects
            and not size <= _MAX_VALUE_CHANGE * value
        ]:
            raise InputError(
                f"{source} was changed after the fit ({shorten_names(changed)}), so that its "
                "uncertainty is not known: name the MJCF as it was written"
            )
        return PosteriorOfModel(self, model, indices)

    def moved_to(self, model: Model) -> "PosteriorOfModel":
        """Return a posterior of equal relative spread about the values of another model.

        Args:
            model: with all parameters of the posterior, such as that with a diagnosed cause.

        Raises:
            InputError: the model lacks a parameter.
        """
        index_of = {parameter.name: k for k, parameter in enumerate(model.parameters)}
        values = [
            model.drawn[index_of[name]] if name in index_of else value
            for name, value in zip(self.parameters, self.values, strict=True)
        ]
        return replace(self, values=np.array(values)).on(model)


@dataclass(frozen=True, eq=False)
class PosteriorOfModel:
    """Posterior of the parameters of a model; x = 0 are the nominal values.

    A size changes by its fitted value times exp(scale x) - 1. So a body that carries a known mass
    since the fit has the uncertainty of the mass that was fitted.

    Args:
        posterior: of the coordinates that the model has.
        model: with the fitted values as nominal ones, but for known additions.
        indices: number of each parameter of the posterior in the model's theta; (n_parameter,).
    """

    posterior: ParameterPosterior
    model: Model
    indices: Integers

    def theta(self, x: Real) -> Real:
        """Return the parameters at coordinates x [SI]; (n_theta,)."""
        posterior, theta = self.posterior, self.model.drawn.copy()
        steps = (posterior.scale * x)[posterior.coordinate_of]
        logarithmic = posterior.is_logarithmic[posterior.coordinate_of]
        theta[self.indices] += np.where(
            logarithmic, posterior.values * np.expm1(np.where(logarithmic, steps, 0.0)), steps
        )
        is_damping = [p.known in ("damping", "undrawn_damping") for p in self.model.parameters]
        return np.where(is_damping, np.maximum(theta, 0.0), theta)

    def sample(self, count: int, seed: int) -> Real:
        """Draw parameters of the model [SI]; (count, n_theta).

        Args:
            seed: of the random numbers.
        """
        drawn = self.posterior.draw(count, seed) @ self.posterior.root
        return np.array([self.theta(x) for x in drawn]).reshape(count, len(self.model.drawn))

    @cached_property
    def units(self) -> Real:
        """Change of each theta per unit of its delta, the fitted value of a size; (n_theta,)."""
        posterior, units = self.posterior, np.zeros(len(self.model.drawn))
        units[self.indices] = np.where(
            posterior.is_logarithmic[posterior.coordinate_of], posterior.values, 1.0
        )
        return units

    @cached_property
    def rates(self) -> Real:
        """Derivative of each theta by its coordinate at x = 0; (n_theta,)."""
        rates = self.units.copy()
        rates[self.indices] *= self.posterior.scale[self.posterior.coordinate_of]
        return rates

    @cached_property
    def varies(self) -> Mask:
        """Whether each parameter of the model has a coordinate; (n_theta,)."""
        varies = np.zeros(len(self.model.drawn), bool)
        varies[self.indices] = True
        return varies

    @cached_property
    def membership(self) -> Real:
        """1 where a parameter that varies, in theta's order, has a coordinate; (n_varying, n_x)."""
        order = np.argsort(self.indices)
        members = self.posterior.coordinate_of[order]
        return (members[:, None] == np.arange(self.posterior.size)).astype(float)
