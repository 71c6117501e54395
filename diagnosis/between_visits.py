"""Parameters that differ between two visits to a machine, or between machines of a drawing."""

from dataclasses import dataclass, replace

import numpy as np

from identification.words import TOLERANCE_BOUND_SIGMA, Real
from mbmodel import REST_FACTOR
from tuning import Parametrisation


@dataclass(frozen=True)
class VisitPriors:
    """Standard deviations of what differs between two visits to one machine, without any change.

    Args:
        stiffness: of ln of the common factor on all stiffness. The moduli of steel and aluminium
            fall by 0.03 to 0.05 % per kelvin, so this is a difference of 10 to 17 K.
        damping: of ln of the common factor on all damping: losses of joints and cables repeat to
            some per cent from day to day.
        gain: of ln of each gain: calibration, mounting and cable of one and the same instrument.
        delay: of each delay [s]: start of sampling and filters of one and the same instrument.
    """

    stiffness: float = 0.005
    damping: float = 0.05
    gain: float = 0.005
    delay: float = 1e-5


VISIT_PRIORS = VisitPriors()
_REMOUNTED = {  # of a test: what is mounted, hit or switched on anew, and its prior
    "sensor_gain": "gain",
    "hammer_gain": "gain",
    "unknown_gain": "gain",
    "sensor_delay": "delay",
    "hammer_delay": "delay",
}
_PLACED = (  # anew, so that the campaign's tolerances hold
    "sensor_angle",
    "sensor_position",
    "sensor_cross",
    "hammer_angle",
    "hammer_position",
)


def calibrate_nominally(varies: Parametrisation, theta: Real) -> Real:
    """Return parameters with instruments as they are stated.

    A model whose error exceeds the tolerance of gains tells nothing of them: its fit pulls
    instruments to make up for what it lacks. The rest holds that, whatever the instruments are:
    with their nominal calibration, sizes of changes are as right as that is.

    Args:
        varies: coordinates of the fit before; a parameter that a cause released is no tolerance.
        theta: its parameters [SI]; (n_parameter,).
    """
    tolerances = np.append(varies.is_tolerance, False)[varies.coordinate_of]
    kinds = {*_REMOUNTED, *_PLACED} - {"unknown_gain"}
    of_instruments = np.array([parameter.known in kinds for parameter in varies.parameters])
    return np.where(tolerances & of_instruments, varies.fixed, theta)


def vary_between_visits(
    varies: Parametrisation, theta: Real, priors: VisitPriors = VISIT_PRIORS
) -> Parametrisation:
    """Return the coordinates of what differs between two visits of itself.

    Args:
        varies: coordinates of the fit before; what does not vary there stays.
        theta: its parameters, which become the nominal ones [SI]; (n_parameter,).
        priors: standard deviations.
    """
    coordinate_of, scale = np.full(len(theta), -1), np.ones(len(theta))
    numbers: dict[object, int] = {}
    for k, parameter in enumerate(varies.parameters):
        old, kind = int(varies.coordinate_of[k]), parameter.known
        group: object = old
        if kind in ("stiffness", "damping"):
            group, deviation = kind, getattr(priors, kind)
        elif kind in _REMOUNTED:
            deviation = getattr(priors, _REMOUNTED[kind])
            if not parameter.positive and _REMOUNTED[kind] == "gain":
                deviation *= abs(theta[k])
        else:
            deviation = np.inf
        is_varied = kind in ("stiffness", "damping", *_REMOUNTED, *_PLACED)
        if parameter.name == REST_FACTOR:
            group, deviation, old, is_varied = "stiffness", priors.stiffness, 0, True
        is_narrow = varies.is_tolerance[old] and varies.scale[k] < deviation and group == old
        # A place that a cause of the state before released has no tolerance, and stays.
        if old < 0 or not is_varied or not (is_narrow or np.isfinite(deviation)):
            continue
        coordinate_of[k] = numbers.setdefault(group, len(numbers))
        scale[k] = varies.scale[k] if is_narrow else deviation
    size, bound = len(numbers), np.full(len(numbers), TOLERANCE_BOUND_SIGMA)
    return Parametrisation(
        varies.parameters,
        coordinate_of=coordinate_of,
        scale=scale,
        fixed=theta,
        is_tolerance=np.ones(size, bool),
        precision=np.ones(size),
        lower=-bound,
        upper=bound,
    )


def vary_between_machines(varies: Parametrisation, theta: Real) -> Parametrisation:
    """Return the coordinates of what differs between two machines of one drawing.

    Each coordinate of the fit before varies about its fitted value, with sqrt(2) times its width.

    Args:
        varies: coordinates of the fit before; what does not vary there stays, and so do causes.
        theta: its parameters, which become the nominal ones [SI]; (n_parameter,).
    """
    kinds = np.array([parameter.known for parameter in varies.parameters])
    place, is_tolerance = varies.coordinate_of, varies.is_tolerance
    # A cause released its parameters: they have neither prior nor width, and stay.
    kept = varies.precision > 0
    kept[place[varies.free & np.isin(kinds, ("stiffness", "damping"))]] = True
    widths = np.where(np.append(is_tolerance, False)[place], np.sqrt(2), 1.0)
    undrawn = np.flatnonzero(varies.free & (kinds == "undrawn_damping"))  # never negative
    lower = varies.lower.copy()
    lower[place[undrawn]] = -theta[undrawn] / varies.scale[undrawn]
    about = replace(
        varies,
        scale=widths * varies.scale,
        fixed=theta,
        precision=np.where(is_tolerance, varies.precision, varies.precision / 2),
        lower=lower,
    )
    return about.restrict(kept, np.zeros(varies.size))
