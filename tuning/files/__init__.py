"""The files of a tuning: ``tuned.json``, the tuned MJCF and the FRFs."""
