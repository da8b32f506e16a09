"""A check as JUnit XML, which continuous integration shows as tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from omnieval.regression.case_report import CaseReport, explanations, failure_line
from omnieval.results.atomic import replacing
from omnieval.results.manifest import expanded
from omnieval.wording import shown


def write_junit(reports: Sequence[CaseReport], path: Path) -> None:
    """Write one test suite per case and one test case per guarded value.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    suites = [_suite(report) for report in reports]
    root = ET.Element("testsuites", name="omnieval check")
    for name in ("tests", "failures", "errors"):
        root.set(name, str(sum(int(suite.get(name, 0)) for suite in suites)))
    root.set("time", _seconds(sum(report.seconds or 0.0 for report in reports)))
    root.extend(suites)
    ET.indent(root)
    with replacing(expanded(path)) as temporary:
        ET.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


def _suite(report: CaseReport) -> ET.Element:
    """Return the suite of a case; what could not be replayed is an error, what is worse a failure."""
    name, seconds = shown(report.name), report.seconds or 0.0
    why = "\n".join(shown(line) for line in explanations(report))
    kind = "failure" if report.worse else "error"
    tests: list[tuple[str, str | None]] = [("replay", report.fault)] if report.fault is not None else []
    tests += [(one.metric, failure_line(report.name, one) if one.failed else None) for one in report.outcomes]
    suite = ET.Element("testsuite", name=name, tests=str(len(tests)))
    for test, fault in tests:
        each = _seconds(seconds / len(tests))
        case = ET.SubElement(suite, "testcase", classname=name, name=test, time=each)
        if fault is not None:
            ET.SubElement(case, kind, message=shown(fault)).text = why
    for each in ("failure", "error"):
        suite.set(f"{each}s", str(len(suite.findall(f"testcase/{each}"))))
    suite.set("time", _seconds(seconds))
    return suite


def _seconds(value: float) -> str:
    return f"{value:.3f}"
