"""``python -m pointglass`` of an installed wheel, which has this file as pointglass/__main__.py."""

from pointglass.viewer.__main__ import main

if __name__ == "__main__":
    main()
