"""Entry point of ``python -m mbw``, which runs the command."""

from mbw.command import main

main()
