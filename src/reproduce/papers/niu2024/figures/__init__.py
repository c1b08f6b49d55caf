"""The drawings of niu2024, chapter by chapter."""
