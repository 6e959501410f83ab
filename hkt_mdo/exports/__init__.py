"""Exports: a result in the files that other programs read, one module a format."""

FORMATS = {
    "csv": "tables:Csv",
    "json": "tables:Json",
    "netcdf": "tables:Netcdf",
    "windio": "windio:Windio",
    "controller": "controller:Controller",
    "sections": "solids:Sections",
    "stl": "solids:Stl",
    "step": "step:Step",
    "openfast": "openfast:OpenFast",
    "rosco": "rosco:Rosco",
}
"""Module and class of each format, by the name that `hkt export --to` takes."""

PACKAGES = {"netcdf": ("netCDF4", "records"), "step": ("OCP", "cad")}
"""Module that a format needs beyond those of hkt_mdo, and the extra that installs it."""
