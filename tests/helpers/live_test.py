"""A virtual live test of the model of two bodies, and looks at its folder."""

from simulate_command import run as simulate
from simulate_command import write_pair_model

from identification.words import Dof
from mbw.live.watcher import REST_S

PLACES = tuple((k, Dof.parse(text)) for k, text in enumerate(("acc1:+tx", "acc3:+tx")))


class Clock:
    """A clock that a test moves."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def play(folder):
    """Play a virtual test with bad hits; return the folder in which its files lie one by one."""
    options = ["--hits", 3, "--bad-hits", 0.5, "--seed", 2, "--live", 0, "--rate", 512]
    options += ["--block", 1, "--hammer", "acc1:+tx", "--hammer", "acc3:+tx", "--no-pictures"]
    simulate(write_pair_model(folder), *options, "--out", folder / "test", "--quiet")
    return folder / "test"


def look(session, clock):
    """Look twice at the folder; its files rest in between."""
    session._watch.clock = clock
    session.step()
    clock.now += REST_S + 0.1
    session.step()
