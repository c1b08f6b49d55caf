"""Niu, Wei and Li, Sensors 24, 259 (2024): registering the images of a 3CMOS star sensor."""
