"""Control co-design of hydrokinetic turbines with OpenMDAO and Dymos."""
