"""`python -m granpinn VERB ...` is the console command."""

import sys

from granpinn.commands.shared.cli import main

sys.exit(main())
