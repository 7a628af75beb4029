"""`python -m straw`: the command line, where the console command is not on the path."""

import sys

from straw.replay.cli import main

sys.exit(main())
