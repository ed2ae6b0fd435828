"""When does a relation hold, given a strong and a weak test?

Müller and Röder (2006), appendix A: on where the strong test becomes true, off where the
weak test fails. A gap (unknown frames) is a border: what follows starts afresh.
"""

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]


def hysteresis(strong: Bools, weak: Bools, known: Bools, *, before: bool = False) -> Bools:
    """State of a two-threshold switch.

    As what passes the strong test passes the weak one too, the switch is on after a
    strong frame until the weak test fails.

    Parameters
    ----------
    strong, weak, known : arrays, shape (frames,)
    before : state before the first frame; of a stream, the last state so far

    Returns
    -------
    array, shape (frames,), bool; False where not known
    """
    on = strong & known
    off = ~(weak & known)
    # The last event decides: odd = on, even = off; 1 and 0 come before the first frame.
    order = np.arange(2, 2 * len(strong) + 2, 2, dtype=np.int32)
    event = np.where(on | off, order, np.int32(0))
    event += on & ~off
    event[:1] = np.maximum(event[:1], np.int32(before))
    np.maximum.accumulate(event, out=event)
    return (event & 1).astype(np.bool_)
