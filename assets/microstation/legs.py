"""The station with its hexapod on six legs instead of six springs, derived from station.xml."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from stages import leg_ends

# Heights of the joints: on the spindle's flange, and within the top plate. CHOSEN.
BASE_HEIGHT, TOP_HEIGHT = -0.437, -0.285
# Along z all legs together are as stiff as the hexapod's joint, RECALLED, and lose as much.
VERTICAL_STIFFNESS, LOSS_TIME = 1e8, 7e-5
DIRECTIONS = ("tx", "ty", "tz", "rx", "ry", "rz")

_HEADER = """<!--
  The micro-station of station.xml with its hexapod on six legs; make_station.py makes it from that
  file (make station). The hexapod's six joints have no springs and dampers here, the tendons leg1
  to leg6 carry it.
    SEEN      the joint circles: base 175.5 mm at 9.5 degrees, top 118 mm at 12.1 degrees.
    CHOSEN    the joints' heights, {low:g} m on the spindle and {high:g} m in the top plate, so that
              the legs lean by {lean:.1f} degrees; legs of equal stiffness, {stiffness:.6g} N/m,
              such that tz is the RECALLED 1e8 N/m; damping {loss:g} s times the stiffness, as in
              the hexapod's joint of station.xml.
  Stiffness of the six legs at the hexapod's joint, ({place}), in N/m and N m/rad, beside that
  of the joint in station.xml (RECALLED). One scale is free, the geometry sets the rest:
{table}
  A push in x there also turns the hexapod about y, one in y about x ({coupling:.4g} N). At the
  height {elastic:.4g} m it does not, and rx and ry are {tilting:.4g} N m/rad.
  Everything else is as in station.xml, whose header follows.
-->
"""


def write_legs(station: str, target: Path) -> None:
    """Write the MJCF with legs.

    Args:
        station: text of station.xml.
        target: the file to write.
    """
    legs = _legs()
    joint, drawn = _joint(station)
    text = station
    for end, body in ((0, "spindle"), (1, "hexapod")):
        sites = [
            f'<site name="leg{n}_{("base", "top")[end]}" pos="{_numbers(leg[end])}" size="0.008" '
            'rgba="0.2 0.2 0.2 1"/>'
            for n, leg in enumerate(legs, start=1)
        ]
        text = _add_sites(text, body, sites)
    for direction in DIRECTIONS:
        pattern = rf'(<joint name="hexapod_{direction}"[^>]*?) stiffness="[^"]*" damping="[^"]*"'
        text = _once(pattern, r'\1 stiffness="0" damping="0"', text)
    stiffness = leg_stiffness()
    tendons = "".join(
        f'    <spatial name="leg{n}" stiffness="{stiffness:.9g}" '
        f'damping="{stiffness * LOSS_TIME:.9g}" width="0.004" rgba="0.2 0.2 0.2 1">\n'
        f'      <site site="leg{n}_base"/>\n      <site site="leg{n}_top"/>\n    </spatial>\n'
        for n in range(1, len(legs) + 1)
    )
    text = _once(r"</worldbody>\n", f"</worldbody>\n  <tendon>\n{tendons}  </tendon>\n", text)
    text = _once(r'<mujoco model="microstation">', '<mujoco model="microstation_legs">', text)
    target.write_text(_header(joint, drawn) + text, encoding="utf-8")


def leg_stiffness() -> float:
    """Stiffness of one leg [N/m] for which all together have the vertical one."""
    return VERTICAL_STIFFNESS / sum(_direction(leg)[2] ** 2 for leg in _legs())


def stiffness_at(place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stiffness of the six legs against a small motion of the top about a point; (6, 6).

    A leg along u with its top joint at r lengthens by [u; (r - p) x u]' (v, w) when the top moves
    by v and turns by w about p: K = k sum J J'.
    """
    rows = []
    for leg in _legs():
        direction = _direction(leg)
        rows.append(np.r_[direction, np.cross(leg[1] - place, direction)])
    jacobian = np.array(rows)
    stiffness: NDArray[np.float64] = leg_stiffness() * jacobian.T @ jacobian
    return stiffness


def _legs() -> list[NDArray[np.float64]]:
    """Base joint and top joint of each leg, world axes [m]; (2, 3) each."""
    heights = [[BASE_HEIGHT], [TOP_HEIGHT]]
    return [np.hstack([np.array(ends), heights]) for ends in leg_ends()]


def _direction(leg: NDArray[np.float64]) -> NDArray[np.float64]:
    along = leg[1] - leg[0]
    unit: NDArray[np.float64] = along / np.linalg.norm(along)
    return unit


def _joint(station: str) -> tuple[NDArray[np.float64], list[float]]:
    """Where the hexapod's joint sits in station.xml [m], and its six stiffnesses."""
    found = [
        re.search(rf'<joint name="hexapod_{d}"[^>]* pos="([^"]*)" stiffness="([^"]*)"', station)
        for d in DIRECTIONS
    ]
    if None in found:
        raise RuntimeError("station.xml has not the six joints of the hexapod: mend it")
    matches = [match for match in found if match]
    return np.array(matches[0][1].split(), float), [float(match[2]) for match in matches]


def _header(joint: NDArray[np.float64], drawn: list[float]) -> str:
    found = stiffness_at(joint)
    # Where the coupling of ty and rx vanishes: a step up by h changes it by h k_ty.
    height = -found[1, 3] / found[1, 1]
    centre = joint + np.array([0.0, 0.0, height])
    rows = "".join(
        f"    {name}   {value:.4g} (joint: {was:.4g})\n"
        for name, value, was in zip(DIRECTIONS, np.diag(found), drawn, strict=True)
    )
    return _HEADER.format(
        low=BASE_HEIGHT,
        high=TOP_HEIGHT,
        lean=np.degrees(np.arccos(_direction(_legs()[0])[2])),
        stiffness=leg_stiffness(),
        loss=LOSS_TIME,
        place=", ".join(f"{value:g}" for value in joint),
        table=rows.rstrip("\n"),
        coupling=abs(found[1, 3]),
        elastic=centre[2],
        tilting=stiffness_at(centre)[3, 3],
    )


def _add_sites(text: str, body: str, sites: list[str]) -> str:
    """Sites after the last one of a body's own, at the same indent."""
    start = text.index(f'<body name="{body}">')
    inner = text.find("<body", start + 1)
    end = inner if inner > 0 else text.index("</body>", start)
    last = text.rindex("<site", start, end)
    indent = text[text.rindex("\n", 0, last) : last]
    after = text.index("/>", last) + 2
    return text[:after] + "".join(indent + site for site in sites) + text[after:]


def _once(pattern: str, replacement: str, text: str) -> str:
    changed, count = re.subn(pattern, replacement, text)
    if count != 1:
        raise RuntimeError(f"station.xml has {pattern} {count} times, expected once: mend it")
    return changed


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(f"{value:.6f}" for value in values)
