"""Optimizers and sparse total derivatives; nothing here knows a turbine."""
