"""Machines written as MJCF, read back, and compared with the machine in memory."""
