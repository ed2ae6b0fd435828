"""Keypoints of one person in the images of several cameras, read and written again."""

from motionary.io.keypoints.reading import read_keypoints
from motionary.io.keypoints.views import LAYOUTS, Place, Views, write_exchanged

__all__ = ["LAYOUTS", "Place", "Views", "read_keypoints", "write_exchanged"]
