"""What all pages share: frame, picture of the machine, numbers as text."""
