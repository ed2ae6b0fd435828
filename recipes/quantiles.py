"""Thresholds of the features that search stands on: `python -m recipes.quantiles [OUTPUT]`.

Quantiles of each quantity over everyday motion of CMU and the exercises of UI-PRMD, half of
the frames each, with the mirror image of every frame. Both may be used by anybody; nothing
of HDM05 is in them. The same files give the same bytes.
"""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motionary.features import MEASURE_HZ, Body
from motionary.features.everyday import QUANTILES, THRESHOLDS, Quantity, list_quantities
from motionary.io import name_recordings, read
from motionary.motion import resample

Floats = NDArray[np.float64]

SOURCE = (
    "CMU Graphics Lab Motion Capture Database (mocap.cs.cmu.edu, funded by NSF EIA-0196217); "
    "Vakanski, Jun, Paul, Baker: A Data Set of Human Body Movements for Physical Rehabilitation "
    "Exercises (UI-PRMD), Data 3(1):2, 2018"
)
#: Folders, and every which frame at 120 Hz counts: about 2000 of each.
FOLDERS = {"ui_prmd/correct": 120, "cmu_everyday": 24}
_DECIMALS = 4


def measure(folder: Path) -> dict[str, list[float]]:
    """Four quantiles of each quantity, by the name that both sides share."""
    quantities = list_quantities()
    samples = np.concatenate(
        [
            _measure_file(path, quantities, step)
            for part, step in FOLDERS.items()
            for path in name_recordings(folder / part).values()
        ]
    )
    pooled: dict[str, list[Floats]] = {}
    for quantity, values in zip(quantities, samples.T, strict=True):
        pooled.setdefault(quantity.threshold_key, []).append(values)
        if quantity.is_signed:
            pooled[quantity.threshold_key].append(-values)
    return {
        key: np.nanquantile(np.concatenate(values), np.array(QUANTILES) / 100)
        .round(_DECIMALS)
        .tolist()
        for key, values in pooled.items()
    }


def _measure_file(path: Path, quantities: Sequence[Quantity], step: int) -> Floats:
    motion = read(path)
    positions = resample(motion.generic_positions(), rate_hz=motion.rate_hz, to_hz=MEASURE_HZ)
    body = Body.from_positions(positions, rate_hz=MEASURE_HZ)
    return np.column_stack([one.measure(body)[::step] for one in quantities])


def main() -> None:
    """Write the thresholds."""
    output = Path(sys.argv[1]) if len(sys.argv) > 1 else THRESHOLDS
    thresholds = measure(Path(os.environ["MOTIONARY_DATA"]))
    rows = ",\n".join(f"  {json.dumps(key)}: {row}" for key, row in thresholds.items())
    output.write_text(
        f'{{\n "source": {json.dumps(SOURCE)},\n "quantiles": {list(QUANTILES)},\n'
        f' "thresholds": {{\n{rows}\n }}\n}}\n',
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
