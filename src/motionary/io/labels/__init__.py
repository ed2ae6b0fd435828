"""Readers and writers of labels, one module per file format."""
