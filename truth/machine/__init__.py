"""The virtual machine: equation of motion, effects in place, random machines."""
