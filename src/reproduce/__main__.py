"""`python -m reproduce` is the command `reproduce`."""

from reproduce.views.cli import main

main(prog_name="reproduce")
