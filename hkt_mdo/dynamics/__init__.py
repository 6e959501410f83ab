"""The rotor over time: inflow, control laws and the speed's equation of motion, without a case."""
