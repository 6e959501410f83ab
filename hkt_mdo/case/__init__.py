"""The case: what one experiment is, read from a short YAML file and checked before all else.

A case knows no physics and physics knows no case. Every key has a default but `inflow` and
`control`; unknown keys are refused. A physical quantity is a number in the key's own unit, or a
text with a unit, such as ``1400 mm``, which is converted. Whatever is wrong with a file is told as
one `InputError`.
"""

from hkt_mdo.case.control import (
    Control,
    Controller,
    Feedback,
    LinearFeedback,
    OpenLoop,
    QuadraticFeedback,
)
from hkt_mdo.case.design import Design, Driver, Hydrodynamics, Phase, Start
from hkt_mdo.case.document import case_json_schema, case_markdown, commented_case
from hkt_mdo.case.inflow import (
    ConstantInflow,
    GustInflow,
    Inflow,
    RecordInflow,
    SineInflow,
    StepInflow,
    SumInflow,
    TidalConstituent,
    TidalInflow,
    TurbulentInflow,
)
from hkt_mdo.case.schema import Case, load_case, read_case
from hkt_mdo.case.turbine import Fluid, Rotor
from hkt_mdo.sections import Quantity

__all__ = [
    "Case",
    "ConstantInflow",
    "Control",
    "Controller",
    "Design",
    "Driver",
    "Feedback",
    "Fluid",
    "GustInflow",
    "Hydrodynamics",
    "Inflow",
    "LinearFeedback",
    "OpenLoop",
    "Phase",
    "QuadraticFeedback",
    "Quantity",
    "RecordInflow",
    "Rotor",
    "SineInflow",
    "Start",
    "StepInflow",
    "SumInflow",
    "TidalConstituent",
    "TidalInflow",
    "TurbulentInflow",
    "case_json_schema",
    "case_markdown",
    "commented_case",
    "load_case",
    "read_case",
]
