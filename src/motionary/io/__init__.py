"""Readers and writers, one module per file format."""

from motionary.io.reading import MOTION_SUFFIXES, read

__all__ = ["MOTION_SUFFIXES", "read"]
