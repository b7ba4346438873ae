# PYTHON_ARGCOMPLETE_OK
"""Command line: `python -m tpd` is the same as the command `tpd`."""

import sys

from tpd.cli import main

sys.exit(main())
