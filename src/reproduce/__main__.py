"""The command `reproduce`, also as `python -m reproduce`."""

import sys


def main() -> None:
    """Run the command line; an interrupt of its imports is reported in one line."""
    try:
        from reproduce.views.cli import main as run

        run(prog_name="reproduce")
    except KeyboardInterrupt:
        sys.exit("Aborted!")


if __name__ == "__main__":
    main()
