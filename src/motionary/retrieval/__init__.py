"""Retrieval: index, search, annotation, explanation, duplicates."""
