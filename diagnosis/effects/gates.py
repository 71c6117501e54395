"""Effects that gates prove from spare channels alone, without a hypothesis to be refitted."""

from diagnosis.hypothesis import Effect
from identification import FAULTS


def _nothing(_: object) -> tuple[()]:
    """A gate proposes."""
    return ()


PROVEN = {
    "dead_channel": Effect(
        _nothing,
        noun=FAULTS["dead_channel"],
        means="the channel holds no motion",
        confirm="look at its cable and plug, and repeat one hit",
    ),
    "mount_resonance": Effect(
        _nothing,
        noun=FAULTS["mount_resonance"],
        means="the sensor resonates on its mounting",
        confirm="glue or screw the sensor on anew and repeat one hit: the resonance moves up",
    ),
    "sensor_delay": Effect(
        _nothing,
        noun=FAULTS["sensor_delay"],
        means="the sensor's channels come late",
        confirm="give the sensor another input of the analyser and repeat one hit",
    ),
    "sensor_swap": Effect(
        _nothing,
        noun=FAULTS["sensor_swap"],
        means="channels are exchanged",
        confirm="knock at each of them and see which channel answers",
    ),
}
