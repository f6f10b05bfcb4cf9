"""`python -m shapespace`."""

import sys

from shapespace.cli import main

sys.exit(main())
