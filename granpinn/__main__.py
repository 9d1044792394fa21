"""`python -m granpinn VERB ...` is the console command."""

import sys

from granpinn.cli import main

sys.exit(main())
