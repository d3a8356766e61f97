"""Check the Digital Calibration Certificate of a passport against PTB's schemas, which are not in this tree.

    pip install xmlschema
    python -m tests.dcc --schemas DIR [--passport FILE.pdf]

DIR holds `dcc.xsd` (3.2.1) with the schemas that it includes beside it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from hil.passport.certificate import Signer
from hil.passport.contents import files_inside
from hil.passport.dcc import certificate_xml
from hil.passport.unit import read_unit_runs
from tests.passports import installed, run_of


def faults(xml: Path, schemas: Path) -> list[str]:
    """What the schemas find wrong in a certificate."""
    try:
        import xmlschema
    except ImportError:
        sys.exit("tests.dcc: needs the package xmlschema: pip install xmlschema")
    schema = xmlschema.XMLSchema(schemas / "dcc.xsd")
    return [f"{error.path}: {error.reason}" for error in schema.iter_errors(xml)]


def _certificate(passport: Path | None, folder: Path) -> bytes:
    if passport is not None:
        return next(content for name, content in files_inside(passport.read_bytes()) if name.name == "certificate.xml")
    return certificate_xml(read_unit_runs([run_of(folder)]), Signer("a lab", ""), "SN-7-1", names=True)


def main() -> int:
    """Exit status 0 when the certificate is valid, 1 when it is not."""
    asked = argparse.ArgumentParser(description="Check a Digital Calibration Certificate against its schemas.")
    asked.add_argument("--schemas", type=Path, required=True)
    asked.add_argument("--passport", type=Path)
    given = asked.parse_args()
    installed()
    with TemporaryDirectory() as folder:
        xml = Path(folder) / "certificate.xml"
        xml.write_bytes(_certificate(given.passport, Path(folder)))
        found = faults(xml, given.schemas)
    print("\n".join(found) or "valid under DCC 3.2.1")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
