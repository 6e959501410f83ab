"""Readers and writers of all file formats, and the shipped data."""
