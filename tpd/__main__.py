# PYTHON_ARGCOMPLETE_OK
"""`python -m tpd`: the command line."""

import sys

from tpd.cli import main

sys.exit(main())
