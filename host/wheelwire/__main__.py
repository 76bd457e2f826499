"""`python -m wheelwire` is the command `wheelwire`."""

from wheelwire.cli import main

main()
