"""MuJoCo's log: nothing is written into the working directory or between the command's messages.

MuJoCo writes a warning to its console and to ``MUJOCO_LOG.TXT`` in the working directory. What it
warns of is checked here in other ways: the compiler's warnings are remarks of the machine, and a
singular mass matrix is refused with the name of the joint.
"""

import mujoco


def silence_mujoco_log() -> None:
    """Keep MuJoCo from writing its warnings to a file or to the console."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = config.logto_console = False
    config.set()
