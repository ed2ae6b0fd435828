"""The command `motionary`: each command parses, makes one library call, and prints.

What computes is imported inside the commands, so that help and errors of use come at once.
"""

import sys

STOPPED_BY_KEYBOARD = 130


def main() -> None:
    """Run the command line of this process and exit."""
    try:
        from motionary.cli.app import run_app

        run_app()
    except KeyboardInterrupt:
        sys.exit(STOPPED_BY_KEYBOARD)
