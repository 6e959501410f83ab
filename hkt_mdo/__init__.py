"""Control co-design of hydrokinetic turbines: blade and controller optimized together.

    from hkt_mdo import load_case, run_case
    solution = run_case(load_case("first_turbine"), "results/mine")

The names below are the whole public interface: cases, problems, runs and results, and the base
classes of extensions (docs/dev/architecture.md). Each is imported when it is first used.
"""

from importlib import import_module

_HOMES = {
    "Case": "case.Case",
    "load_case": "case.load_case",
    "InputError": "errors.InputError",
    "Solution": "results.solution.Solution",
    "build_problem": "start.build.build_problem",
    "RotorGroup": "problem.rotor_group.RotorGroup",
    "TurbineGroup": "start.build.TurbineGroup",
    "check": "run.check.check_case",
    "run_case": "run.run.run_case",
    "sweep": "run.sweep.run_sweep",
    "simulate": "studies.other_flows.runs_of",
    "export": "exports.base.export",
    "report": "pages.page.write_report",
    "Aggregate": "dynamics.aggregates.Aggregate",
    "FeedbackLaw": "dynamics.laws.FeedbackLaw",
    "Inflow": "dynamics.flows.Inflow",
    "Limit": "dynamics.limits.Limit",
    "Objective": "dynamics.objectives.Objective",
    "Quantity": "sections.Quantity",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str):
    """Import a public name on first use, so that `import hkt_mdo` costs nothing."""
    if name == "__version__":
        return import_module(f"{__name__}.errors").program_version()
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home, _, attribute = _HOMES[name].rpartition(".")
    return getattr(import_module(f"{__name__}.{home}"), attribute)


def __dir__() -> list[str]:
    return __all__
