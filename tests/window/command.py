"""Runs ``pointglass`` with the arguments after the first, which is a folder: for tests of commands that need a display."""

import sys

from pointglass.viewer.cli import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[2:]))
