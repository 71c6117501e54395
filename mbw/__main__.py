"""``python -m mbw``."""

from mbw.command import main

main()
