"""Script for a child process that reads the numbers in the messages of an MCAP file.

Messages are JSON, or ROS 2 (CDR). A number of a message goes by topic and field, as in
``/joint_states.position[0]``, and its times by the topic, as in ``/joint_states:time``: the stamp
in the header of the message, else when it was published [s after a full second].
"""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def read(path: Path, max_array_bytes: int) -> dict[str, np.ndarray]:
    """Read the numbers and times of every topic; arrays of one topic have one length.

    Args:
        max_array_bytes: bytes that all numbers together may take in memory.

    Raises:
        ValueError: the file holds more numbers.
        Exception: the file is damaged.
    """
    rows: dict[str, list[dict[str, float]]] = {}
    count, origin = 0, 0
    with path.open("rb") as stream:
        factory, decoders = DecoderFactory(), {}
        for schema, channel, message in make_reader(stream).iter_messages():
            if channel.id not in decoders:
                is_json = channel.message_encoding == "json"
                decoders[channel.id] = (
                    json.loads if is_json else factory.decoder_for(channel.message_encoding, schema)
                )
            decode = decoders[channel.id]
            if decode is None:
                continue
            numbers = dict(_numbers("", decode(message.data)))
            origin = origin or message.publish_time // 1_000_000_000  # doubles hold no epoch in ns
            seconds, rest = divmod(message.publish_time, 1_000_000_000)
            stamp = (numbers.get(f".header.stamp.{name}") for name in ("sec", "nanosec"))
            whole, part = (float(each or 0) for each in stamp)
            if not (whole or part):  # a header that nobody filled
                whole, part = float(seconds), float(rest)
            time = whole - origin + part * 1e-9
            rows.setdefault(channel.topic, []).append({":time": time, **numbers})
            count += 1 + len(numbers)
            if 8 * count > max_array_bytes:
                raise ValueError("it holds far more numbers than its size lets expect")
    return {
        f"{topic}{name}": np.array([row.get(name, np.nan) for row in messages])
        for topic, messages in rows.items()
        for name in dict.fromkeys(name for row in messages for name in row)
    }


def _numbers(name: str, value: object) -> Iterator[tuple[str, float]]:
    """Yield every number in a message with the names of the fields that lead to it."""
    if isinstance(value, bool | int | float):
        yield name, float(value)
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from _numbers(f"{name}.{key}", each)
    elif isinstance(value, list | tuple | np.ndarray):
        for k, each in enumerate(value):
            yield from _numbers(f"{name}[{k}]", each)
    elif hasattr(value, "__slots__"):  # a message of ROS 2
        for key in value.__slots__:
            yield from _numbers(f"{name}.{key}", getattr(value, key))
