"""`python -m tpd.cli`."""

import sys

from tpd.cli import main

sys.exit(main())
