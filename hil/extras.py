"""Libraries that not every installation has, and the extra of this package that brings each."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping

EXTRAS: Mapping[str, str] = {
    **dict.fromkeys(("jinja2", "markupsafe", "matplotlib"), "pages"),
    **dict.fromkeys(("sqlalchemy", "alembic"), "archive"),
    **dict.fromkeys(("canopen", "cantools"), "links"),
    **dict.fromkeys(
        (
            "h5py",
            "asammdf",
            "nptdms",
            "pyarrow",
            "openpyxl",
            "python_calamine",
            "pyuff",
            "comtrade",
            "lvm_read",
            "mcap",
        ),
        "formats",
    ),
    **dict.fromkeys(("dask", "distributed"), "cluster"),
    **dict.fromkeys(
        ("typst", "pyhanko", "pyhanko_certvalidator", "asn1crypto", "cryptography", "pikepdf", "pypdf"), "passport"
    ),
    **dict.fromkeys(("starlette", "anyio", "uvicorn", "python_multipart", "argon2", "itsdangerous"), "console"),
    "pyvisa_py": "visa",
    "nidaqmx": "ni",
    "psycopg": "postgresql",
    "xarray": "notebook",
    "fmpy": "fmu",
    "ziglang": "fmu-cross",
}
"""By the name under which a library is imported."""


def is_installed(library: str) -> bool:
    """Whether a library can be imported; it is not imported for that."""
    try:
        return importlib.util.find_spec(library) is not None
    except (ModuleNotFoundError, ValueError):
        return False


def of_extra(error: ModuleNotFoundError) -> str:
    """The library of an extra that was not found; empty where it is none of an extra."""
    library = (error.name or "").partition(".")[0]
    return library if library in EXTRAS else ""


def remedy(library: str) -> str:
    """How to get a library."""
    extra = EXTRAS.get(library)
    return f"pip install 'valve-hil[{extra}]'" if extra else f"install {library}"


def lacking(library: str) -> str:
    """That a library is not there, and how to get it."""
    return f"the package '{library}', which is not installed: {remedy(library)}"
