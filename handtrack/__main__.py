"""``python -m handtrack`` is ``handtrack``."""

import sys

from handtrack.cli import main

sys.exit(main())
