"""``python -m plyflow`` is the command ``plyflow``."""

from ._installation import main

main()
