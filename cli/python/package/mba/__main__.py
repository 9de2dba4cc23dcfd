"""The ``mba`` program, also as ``python -m mba``."""

import signal
import sys

from . import _mba
from ._commands import ITSELF


def main() -> int:
    """Runs the program with the arguments of this process."""
    # The program watches signals itself: it saves what it has.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _mba.main(["mba", *sys.argv[1:]], ITSELF)


if __name__ == "__main__":
    sys.exit(main())
