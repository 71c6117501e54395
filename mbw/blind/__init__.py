"""``mbw blind``: campaigns drawn, diagnosed and graded; the page of their grades."""
