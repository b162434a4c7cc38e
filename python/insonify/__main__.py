"""The command line: `python -m insonify render abdomen -o abdomen.png`, or `insonify` where the package is installed."""

import signal
import sys

from . import _insonify


def main() -> int:
    """Runs the command that the program's arguments ask for; returns the exit code."""
    # Python would hear of Ctrl-C only after the command.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _insonify.run_command(["insonify", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
