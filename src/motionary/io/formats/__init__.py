"""Readers of motion, one module per file format."""
