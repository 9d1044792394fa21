"""`python -m granpinn VERB ...` is the console command."""

import sys

from granpinn.command.cli import main

sys.exit(main())
