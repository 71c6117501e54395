"""Parts that all pages share: frame, 3-D picture of the machine, numbers as text."""
