"""Virtual hammer test: hits on the machine in time, accelerometers with errors, raw records."""
