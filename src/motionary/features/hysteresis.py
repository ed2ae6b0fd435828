"""When does a relation hold, given a strong and a weak test?

Müller and Röder (2006), appendix A: on where the strong test becomes true, off where the
weak test fails. A gap (unknown frames) is a border: what follows starts afresh.
"""

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]


def hysteresis(strong: Bools, weak: Bools, known: Bools) -> Bools:
    """State of a two-threshold switch.

    Parameters
    ----------
    strong, weak, known : arrays, shape (frames,)

    Returns
    -------
    array, shape (frames,), bool; False where not known
    """
    held = strong & known
    rises = held.copy()
    rises[1:] &= ~held[:-1]
    falls = ~(weak & known)
    # The last event decides: odd = rose, even = fell. An off wins over an on at once.
    event = np.arange(1, len(strong) + 1, dtype=np.int32) * 2
    event += rises
    event[~(rises | falls)] = 0
    event[rises & falls] &= ~np.int32(1)
    np.maximum.accumulate(event, out=event)
    return (event & 1).astype(np.bool_)
