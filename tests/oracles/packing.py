"""Packed relations as whole numbers of any length."""


def pack(features):
    """One whole number a frame: relation i is bit i."""
    return [sum(int(value) << i for i, value in enumerate(frame)) for frame in features]


def join(packed):
    """The whole number of a frame that is given in 64-bit pieces, lowest first."""
    return [sum(int(piece) << (64 * i) for i, piece in enumerate(frame)) for frame in packed]
