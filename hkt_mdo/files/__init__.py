"""Every format, both ways, and the shipped data."""
