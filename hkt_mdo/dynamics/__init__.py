"""The rotor in time: inflow, control laws and the speed's differential equation; knows no case."""
