"""``mbw match`` and ``mbw place``: finite-element shapes and few sensors."""
