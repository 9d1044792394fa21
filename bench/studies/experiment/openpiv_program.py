"""An outside program, never imported: OpenPIV on pairs of pictures, with its own text output.

    python openpiv_program.py PICTURES OUT WINDOW

Reads PICTURES/pair_0000_a.png, ..._b.png and ..._mask.png (white = measure there); writes
OUT/field_A0000.txt, x y u v flags mask in px and px per pair. OpenPIV (GPL-3) is installed by
whoever runs the experiment, in an interpreter of its own; granpinn neither contains nor imports it.
"""

import contextlib
import os
import sys
from pathlib import Path

import numpy as np
from openpiv.settings import PIVSettings
from openpiv.tools import imread
from openpiv.windef import process_image_pair

pictures, out, window = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
settings = PIVSettings()
settings.windowsizes = (2 * window, window, window)
settings.overlap = (window, window // 2, window // 2)
settings.num_iterations = 3
for k, first in enumerate(sorted(pictures.glob("pair_*_a.png"))):
    second, mask = (Path(str(first).replace("_a.png", f"_{what}.png")) for what in ("b", "mask"))
    settings.static_mask = np.asarray(imread(mask)) == 0
    with Path(os.devnull).open("w") as quiet, contextlib.redirect_stdout(quiet):
        process_image_pair((first, second, k), settings, out)
