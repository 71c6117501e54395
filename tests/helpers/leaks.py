"""Whether campaigns tell their cause by anything but their FRFs: trees that are trained to see it.

What is not a value of an FRF or a coherence is a feature: names, number, order and size of files,
what campaign.toml says, headers of the universal files, every number of the drawing.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.model_selection import GroupKFold

_DATASET = re.compile(rb"    -1\n(    58b.{69}|   164)\n")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_LONGEST = 400  # numbers of the drawing that are features


def features(files: Mapping[str, bytes]) -> dict[str, float]:
    """Everything that can be read of a campaign without its values."""
    found: dict[str, float] = {"files": len(files)}
    stated = tomllib.loads(files["campaign.toml"].decode())
    for number, (name, content) in enumerate(files.items()):
        if name.startswith("meshes/"):
            continue
        found[f"name {number}"] = _hashed(name.encode())
        found[f"size {number}"] = len(content)
        if name.endswith(".uff"):
            found |= {f"uff {number} {key}": v for key, v in _headers(content).items()}
    for number, test in enumerate(stated["test"]):
        for key, value in test.items():
            is_number = isinstance(value, int | float)
            found[f"test {number} {key}"] = value if is_number else _hashed(value.encode())
    found |= {f"tolerance {key}": value for key, value in stated["tolerance"].items()}
    drawing = files["model.xml"].decode()
    for number, text in enumerate(_NUMBER.findall(drawing)[:_LONGEST]):
        found[f"drawing {number}"] = float(text)
    for attribute in ("stiffness", "damping", "mass"):
        values = [float(one) for one in re.findall(rf' {attribute}="([^"]+)"', drawing)]
        logs = np.log(np.array([value for value in values if value > 0]))
        found |= {f"{attribute} mean": float(logs.mean()), f"{attribute} sd": float(logs.std())}
        found[f"{attribute} count"] = len(values)
    return found


def _hashed(name: bytes) -> float:
    """A number that is the same for the same name, and whatever it holds in digits."""
    return float(sum((i + 1) * byte for i, byte in enumerate(name)) % 99991)


def _headers(content: bytes) -> dict[str, float]:
    """Numbers of records and of bytes in their headers; the order of the records."""
    found, order = [], 0
    for match in re.finditer(_DATASET, content):
        header = content[match.end() : match.end() + 900].split(b"\n")[:10]
        text = b"\n".join(header)
        order = (order * 31 + int(_hashed(text))) % 99991
        found.append(_hashed(match.group(1)))
    return {"records": len(found), "order": order, "first": found[0], "last": found[-1]}


@dataclass(frozen=True)
class Seen:
    """How well trees tell labels apart.

    Args:
        accuracy: balanced over the classes.
        low, high: its 95 % interval.
        chance: of a guess.
        n: campaigns.
    """

    accuracy: float
    low: float
    high: float
    chance: float
    n: int


def seen(campaigns: list[dict[str, float]], labels: list[str], groups: list[int]) -> Seen:
    """Train boosted trees on four fifths and try them on the rest, in turn.

    Args:
        campaigns: features.
        labels: what is to be told.
        groups: campaigns of one machine stay together.
    """
    names = sorted({name for one in campaigns for name in one})
    table = np.array([[one.get(name, -1.0) for name in names] for one in campaigns])
    table = table[:, np.ptp(table, axis=0) > 0]  # what never differs costs time alone
    truth = np.array(labels)
    guess = np.empty_like(truth)
    for train, test in GroupKFold(5).split(table, truth, groups):
        model = HistGradientBoostingClassifier(
            max_iter=40, min_samples_leaf=5, class_weight="balanced", random_state=0
        )
        guess[test] = model.fit(table[train], truth[train]).predict(table[test])
    classes = np.unique(truth)
    rates = np.array([(guess[truth == one] == one).mean() for one in classes])
    counts = np.array([(truth == one).sum() for one in classes])
    # Two hits and two misses more (Agresti and Coull 1998): none of n is no certainty.
    shares = (rates * counts + 2) / (counts + 4)
    sd = float(np.sqrt((shares * (1 - shares) / (counts + 4)).sum())) / len(classes)
    accuracy = float(rates.mean())
    low, high = max(accuracy - 1.96 * sd, 0.0), min(accuracy + 1.96 * sd, 1.0)
    return Seen(accuracy, low, high, 1 / len(classes), len(truth))
