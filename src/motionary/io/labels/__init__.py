"""Reading and writing labels, one module per file format."""

from motionary.io.labels.table import read_labels, write_labels

__all__ = ["read_labels", "write_labels"]
