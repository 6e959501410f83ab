"""Rotor physics: section, blade, inertia and blade element momentum theory; knows no case."""
