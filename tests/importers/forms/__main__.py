"""Counts of all forms, and the wrong ones: `python -m tests.importers.forms [NAME ...]`."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from tests.importers.forms import FAMILIES

for name, family in FAMILIES.items():
    if sys.argv[1:] and not any(part in name for part in sys.argv[1:]):
        continue
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        found = family.outcomes(Path(folder))
    kinds = [outcome.partition(":")[0] for outcome, _ in found.values()]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in ("equal", "refused", "wrong"))
    print(f"{name}: {len(kinds)} forms, {counts}; {time.process_time() - start:.1f} s")
    faults = {
        form: text
        for form, (text, must) in found.items()
        if text != "equal" and (must or text.startswith("wrong"))
    }
    for form, text in faults.items():
        if not any(set(other) < set(form) for other in faults):
            print(f"    {name}({', '.join(f'{k}={v!r}' for k, v in form)}): {text}")
