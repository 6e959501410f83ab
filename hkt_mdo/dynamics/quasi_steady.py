from hkt_mdo.problem.start import Operation  # noqa: F401
