"""``python -m viewer`` is ``pointglass``: the command line, and Ctrl-C while even that is still being imported."""

import sys


def main() -> int:
    """Runs the command line and returns its exit code."""
    try:
        from viewer.cli import main as run

        return run()
    except KeyboardInterrupt:
        print("pointglass: stopped", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
