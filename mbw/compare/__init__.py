"""``mbw compare``: tests beside each other, and the diagnosis of a change."""
