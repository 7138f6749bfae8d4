"""``python -m viewer`` is ``pointglass``."""

import sys

from viewer.cli import main

sys.exit(main())
