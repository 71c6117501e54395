"""A stage or point masses put on a machine: where, with which names, and in which MJCF."""
