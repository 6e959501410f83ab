"""A case as an OpenMDAO problem."""
