"""`python -m warpmis`."""

import sys

from warpmis.cli import main

sys.exit(main())
