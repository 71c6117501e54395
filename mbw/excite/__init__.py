"""``mbw excite``: signals for a machine's drives, designed for what is to be found."""
