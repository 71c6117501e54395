"""Control loops that are closed around a machine, as known Parts of it."""
