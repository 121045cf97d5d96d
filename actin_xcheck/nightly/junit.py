"""A night as JUnit XML, which continuous integration reads: a suite per check, a case per claim."""

import math
import re
import xml.etree.ElementTree as ET

from actin_xcheck.core.claim import Claim
from actin_xcheck.nightly.record import Done, Kept

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""What has no place in XML, however it is escaped."""


def junit(night: Kept) -> bytes:
    """Return the night as a document; claims that nobody judges and checks that were not run are skipped."""
    root = ET.Element("testsuites", _clean({"name": f"actin_xcheck {night.begun.name}"}))
    for done in night.done:
        _suite(root, done, night)
    for left in night.left_out:
        case = ET.SubElement(
            _empty(root, left.name, night, skipped=1), "testcase", _case(left.name, "is run")
        )
        ET.SubElement(case, "skipped", _clean({"message": left.why}))
    for what in ("tests", "failures", "errors", "skipped"):
        root.set(what, str(sum(int(suite.get(what, 0)) for suite in root)))
    root.set("time", f"{night.seconds:.3f}")
    ET.indent(root, " ")
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def _suite(root: ET.Element, done: Done, night: Kept) -> None:
    verdicts = ["ERROR" if done.trouble else claim.verdict for claim in done.claims]
    suite = _empty(
        root, done.name, night, tests=len(verdicts), failures=verdicts.count("FAIL"),
        errors=verdicts.count("ERROR"), skipped=verdicts.count("NOT JUDGED"),
    )  # fmt: skip
    suite.set("hostname", _clean({"at": done.host or night.begun.machine})["at"])
    if math.isfinite(done.seconds):  # of a lost process nobody knows
        suite.set("time", f"{done.seconds:.3f}")
    for claim, file in zip(done.claims, done.files, strict=True):
        case = ET.SubElement(suite, "testcase", _case(done.name, claim.key))
        if done.trouble:
            ET.SubElement(case, "error", _clean({"message": done.trouble, "type": "trouble"}))
        elif claim.verdict == "FAIL":
            said = {"message": claim.excess, "type": "claim"}
            ET.SubElement(case, "failure", _clean(said)).text = _text(claim, file)
        elif claim.verdict == "NOT JUDGED":
            ET.SubElement(case, "skipped", _clean({"message": f"{claim.value:.3g}, no bound"}))


def _empty(root: ET.Element, name: str, night: Kept, skipped: int = 0, **counts: int) -> ET.Element:
    """A suite with its counts; a check that was not run is one case that is skipped."""
    counted = {"tests": skipped, "failures": 0, "errors": 0, "skipped": skipped, **counts}
    stated = {"name": name, "timestamp": night.begun.date[:19], "hostname": night.begun.machine}
    return ET.SubElement(root, "testsuite", _clean(stated | {what: str(n) for what, n in counted.items()}))


def _case(check: str, name: str) -> dict[str, str]:
    return _clean({"classname": check, "name": name})


def _text(claim: Claim, file: str) -> str:
    return _NO_XML.sub("?", "\n".join((claim.statement, claim.note, claim.command, f"{file}{claim.path}")))


def _clean(attributes: dict[str, str]) -> dict[str, str]:
    return {name: _NO_XML.sub("?", value) for name, value in attributes.items()}
