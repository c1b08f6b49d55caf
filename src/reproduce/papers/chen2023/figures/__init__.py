"""The drawings of chen2023, chapter by chapter."""
