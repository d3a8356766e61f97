"""The version of this program, and what is said of a file that a newer one made."""

__version__ = "0.1.0"
PROGRAM = f"valve-hil {__version__}"


def is_newer(version: str) -> bool:
    """Whether a version is above this program's; what is no version is not."""
    return _numbers(version) > _numbers(__version__)


def made_by(program: object) -> str:
    """`made by version 0.9.0; this program is version 0.1.0`, of what a file says of its maker: `valve-hil 0.9.0`."""
    version = str(program or "").removeprefix("valve-hil").strip() or "not stated"
    return f"made by version {version}; this program is version {__version__}"


def _numbers(version: str) -> tuple[int, ...]:
    """(0, 9, 0) of `0.9.0`; what follows the numbers is left out."""
    found: list[int] = []
    for part in version.strip().split("."):
        if not part.isdigit():
            break
        found.append(int(part))
    return tuple(found)
