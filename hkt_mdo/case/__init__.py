"""The case: the description of one experiment, read from a short YAML file and checked.

A case knows no physics and physics knows no case. Every key has a default but `inflow` and
`control`; unknown keys are refused. A physical quantity is a number in the key's own unit, or a
text with a unit, such as ``1400 mm``, which is converted. Whatever is wrong with a file is reported
as one `InputError`.
"""

from hkt_mdo.case.design import Design, Phase
from hkt_mdo.case.schema import Case, load_case, read_case
from hkt_mdo.case.turbine import Fluid, Rotor

__all__ = ["Case", "Design", "Fluid", "Phase", "Rotor", "load_case", "read_case"]
