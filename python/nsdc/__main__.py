"""The command `nsdc`, as `python -m nsdc` and as the script of that name."""

import os
import shutil
import signal
import sys

from . import _core


def main() -> int:
    """Runs the command line; the result is its exit code."""
    # Work that is interrupted ends as that of any program.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    is_terminal = sys.stderr.isatty()
    colour = is_terminal and "NO_COLOR" not in os.environ
    width = max(60, min(120, shutil.get_terminal_size().columns))
    code, _, _ = _core.main(["nsdc", *sys.argv[1:]], False, colour, is_terminal, width)
    return code


if __name__ == "__main__":
    sys.exit(main())
