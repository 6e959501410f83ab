"""Control co-design of hydrokinetic turbines: blade and controller optimized together.

    from hkt_mdo import load_case, run_case
    solution = run_case(load_case("first_turbine"), "results/mine")

The names below are the whole public interface: cases, problems, runs and results, and the base
classes of extensions (docs/architecture.md). Each is imported when it is first used.
"""

from importlib import import_module

_HOMES = {
    "Case": "case",
    "load_case": "case",
    "InputError": "errors",
    "Solution": "results.solution",
    "build_problem": "start.build",
    "RotorGroup": "problem.rotor_group",
    "TurbineGroup": "start.turbine_group",
    "run_case": "run.run",
    "Aggregate": "dynamics.aggregates",
    "FeedbackLaw": "dynamics.laws",
    "Inflow": "dynamics.flows",
    "Limit": "dynamics.limits",
    "Objective": "dynamics.objectives",
    "Quantity": "sections",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str):
    """Import a public name on first use, so that `import hkt_mdo` costs nothing."""
    if name == "__version__":
        return import_module(f"{__name__}.errors").program_version()
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
