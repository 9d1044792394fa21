"""What `granpinn train` does with its settings: identification with its checks, and the report."""

from __future__ import annotations

import time
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from threading import Thread

from granpinn import progress, results
from granpinn.checks import wanted
from granpinn.commands.shared.flow_files import require_flow_files
from granpinn.config import Config
from granpinn.fit.context import FIELDS
from granpinn.identification.identified import load
from granpinn.identification.identify import identify
from granpinn.identification.start import require_kept
from granpinn.kernels.builds import wake
from granpinn.output import owned
from granpinn.results.record import why_not_done
from granpinn.results.result import in_words
from granpinn.terminal import say

REPORT = "report"
FIGURES = 4.5  # seconds that the figures and the page take


def run(config: Config, verbose: bool = False, begin: float | None = None) -> int:
    """Identify, write the results and the report; the exit code.

    Args:
        verbose: print all that is known before the answer in a few lines.
        begin: time.monotonic() at which the command began, for its time limit.
    """
    begin = time.monotonic() if begin is None else begin
    assert config.flow is not None
    assert config.out is not None
    folder, flows = Path(config.out), [config.flow, *config.further_flows]
    require_flow_files([Path(flow) for flow in flows], "train on")
    checks = wanted(config)
    asked = [check.name for check in checks if check.asked(config)]
    with owned(folder), ExitStack() as at_end:
        listener = progress.automatic()
        at_end.callback(listener.stop)
        # matplotlib takes a second to load; the training leaves the interpreter idle
        Thread(target=import_module, args=("granpinn.figures.page",)).start()
        Thread(target=wake, args=(config.device,)).start()
        result = identify(
            flows if len(flows) > 1 else config.flow,
            config,
            one_law=len(flows) > 1,
            run_dir=folder,
            progress=listener,
            reserve=time.monotonic() - begin + FIGURES,
        )
        listener.stop()
        if verbose:
            print(result.summary())
        print(result, flush=True)
        for name in [] if verbose else asked:
            if name in result.checks:
                print(result.checks[name], flush=True)
        listener.stage("figures")
        for place in [*(folder / f"{k:03d}" for k in range(len(result.flows))), folder]:
            try:
                page = str((result if place == folder else load(place)).report())
            except Exception as error:
                why = why_not_done(error)
                page = f"not done: {why}"
                if place == folder:
                    results.write_results(result.without(REPORT, why), folder / "results.json")
        listener.stop()
        print(f"report: {page}")
        require_kept(folder)
    missing = [name for name in (FIELDS, *asked) if name in result.not_done]
    for name in missing:
        why = result.not_done[name]
        say(f"granpinn.train: no {in_words(name)}: {why}; the other results are valid")
    return 1 if missing else 0
