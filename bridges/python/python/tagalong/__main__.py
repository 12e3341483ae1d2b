"""The program: `python -m tagalong` is `tagalong`."""

import sys

from . import main

sys.exit(main())
