"""A check as JUnit XML, which continuous integration shows as tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from omnieval.regression.report import CaseReport, explanations, failure_line
from omnieval.results.atomic import replacing
from omnieval.wording import shown


def write_junit(reports: Sequence[CaseReport], path: Path) -> None:
    """Write one test suite a case and one test case a guarded value.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    root = ET.Element("testsuites", name="omnieval check")
    for report in reports:
        _add_suite(root, report)
    ET.indent(root)
    with replacing(path) as temporary:
        ET.ElementTree(root).write(temporary, encoding="utf-8", xml_declaration=True)


def _add_suite(root: ET.Element, report: CaseReport) -> None:
    tests = len(report.outcomes) + (report.fault is not None)
    failures = sum(outcome.failed for outcome in report.outcomes) + (report.fault is not None)
    name = shown(report.name)
    suite = ET.SubElement(root, "testsuite", name=name, tests=str(tests), failures=str(failures))
    why = "\n".join(shown(line) for line in explanations(report))
    if report.fault is not None:
        _add_failure(ET.SubElement(suite, "testcase", classname=name, name="replay"), report.fault, why)
    for outcome in report.outcomes:
        test = ET.SubElement(suite, "testcase", classname=name, name=outcome.metric)
        if outcome.failed:
            _add_failure(test, failure_line(report.name, outcome), why)


def _add_failure(test: ET.Element, message: str, why: str) -> None:
    ET.SubElement(test, "failure", message=shown(message)).text = why
